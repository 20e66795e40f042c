"""One CiA 402 drive of the path as the tick sees it: frames in, frames out, and what is wrong.

Start of motion without a jump. In cyclic synchronous position a drive goes to its
target the moment it uses it (statusword bit 12). Until then the target sent is the
actual position, every tick anew; from then on (`following`) it is the commanded
setpoint, which the caller must have started at `position`. In interpolated position
(mode 7) it is the same, once controlword bit 4 has started the interpolation.
"""

from __future__ import annotations

from typing import Final

from drives import cia402, pdo
from drives.cia402 import State, Wanted
from drives.cyclic.drive_fault import DriveFault
from drives.cyclic.following_error import FollowingError
from drives.cyclic.load_encoder import LoadEncoder
from drives.cyclic.power_stage import LOST_IN_A_ROW, PowerStage
from drives.cyclic.supervised import NEVER_S, EventTimer, Handler
from drives.cyclic.touch_probe import TouchProbe
from drives.profile import CyclicMode, Supervision
from drives.pump.plan_memory import FOLLOWS
from drives.pump.setpoint_frame import SetpointFrame
from drives.pump.wires import DriveWire
from drives.settings import INT32_MAX, INT32_MIN, OFF_DEMAND, NodeSettings

__all__ = ["Drive", "DriveFault", "Handler"]

# A start edge of homing sent in tick k is latched by the SYNC of k + 1 and seen in
# a statusword of k + 3 at the earliest; until "not attained" has been seen, or this
# many statuswords have passed, "attained" is that of an earlier homing.
STALE_STATUSWORDS = 10

STOOD_FEEDBACKS = 3  # "attained" counts where the motor stands, too

# Different answers to one SYNC, so many SYNCs in a row, are those of two nodes.
TWICE_IN_A_ROW: Final = 3
# Between two answers the motor has gone less than this part of what it went before them: the SYNCs that they
# answer were as close. So many counts at least, or it is the last ones before it stands.
CLOSE: Final = 4
MOVES: Final = 8

SAME_COUNTS: Final = 2.0  # within which a drive's word of the setpoint that it goes by is that which was sent
SETPOINTS_OVERDUE: Final = 0x8250  # CiA 301: the deadline of an RPDO has passed

# Looked up every tick, and an enum's members are slow to look up.
_OPERATION_ENABLED: Final = State.OPERATION_ENABLED
_ENABLED: Final = Wanted.ENABLED
_HOMING: Final = cia402.HOMING
_FOLLOWS: Final = cia402.FOLLOWS_COMMAND
# One that follows and comes to a limit of its own (607Fh, 60C5h) takes bit 12 back until it has caught
# up: after a lost setpoint at full speed. How far it is off then is the following error's matter.
_FOLLOWS_SLOWLY: Final = cia402.FOLLOWS_COMMAND | cia402.INTERNAL_LIMIT
_unpack_feedback: Final = pdo.FEEDBACK.unpack
_pack_controlword_into: Final = pdo.CONTROLWORD.pack_into


class Drive(PowerStage):
    """The cyclic side of one drive.

    Read: ``position`` (counts), ``position_at_s``, ``following``, ``setpoint`` (as sent), ``homing_done``,
    ``homing_error``, ``refused`` (setpoints outside of int32, not sent), ``following_error`` (command against
    position), ``missed`` (setpoints that it did not take with their SYNC, -1 until it has told what it goes
    by), ``overdue`` (its own notices that they stay away, emergency 8250h), ``load``, ``probe``, ``near`` (of
    two answers to one SYNC: the motor was at rest between them, or almost), and what `PowerStage` and
    `Supervised` have.
    """

    def __init__(self, settings: NodeSettings, lost_after: int = LOST_IN_A_ROW) -> None:
        """``lost_after``: feedback owed so many times in a row and not come is a fault."""
        profile, node = settings.profile, settings.node
        super().__init__(
            node,
            guarded=profile.supervision is Supervision.GUARDING,
            every=settings.feedback_every,
            braked=settings.brake,
            lost_after=lost_after,
        )
        self.settings = settings
        self.position = 0
        self.position_at_s = NEVER_S
        self.following = False
        self.setpoint = 0
        self.cyclic = True  # False while the drive is in homing mode
        self.homing_done = False
        self.homing_error = False
        self.refused = 0
        self.following_error = FollowingError(settings.following, settings.period_s)
        self._rest = settings.following.rest_counts
        self._target_latched = self._target_reached = 0  # at the last SYNC: taken over; come to
        self._followed = False
        self._twice = 0  # SYNCs in a row
        self._twice_now = False
        self.near = False
        self._before = 0  # counts, where it was before its answer to this SYNC
        self._late = 0  # feedbacks that were missed and may come yet
        self._mode = profile.mode.value
        self._homing = False
        self._homing_statuswords = 0
        self._homing_begun = False
        self._homed_at = 0
        self._stood = 0  # feedbacks in a row
        self._interpolates = profile.mode is CyclicMode.IP
        self._goes_on = _FOLLOWS if self._interpolates else _FOLLOWS_SLOWLY
        self.feed_forward = settings.feed_forward
        self._frame = SetpointFrame(node, profile.rpdo, self.feed_forward)
        self.set_velocity_units(settings.velocity_units)
        self._word_frame = pdo.frame(pdo.rpdo(profile.command_rpdo, node), bytes(2))
        self._timer = EventTimer()
        self.setpoint_bytes = self._frame.bytes
        self.with_sync = (pdo.tpdo(profile.tpdo, node),)
        self.handlers[self.with_sync[0]] = self._feedback
        if settings.mode_tpdo:
            self.handlers[pdo.tpdo(settings.mode_tpdo, node)] = self._mode_display
        self.missed, self.overdue = -1, 0
        self._demand: int | None = None  # as told with the SYNC that is answered now
        self._went_by, self._target_before = 0.0, 0  # counts; as told before, and reached one SYNC before
        self._of_position = settings.demand_index == OFF_DEMAND
        self._per_count = settings.demand_per_count
        if settings.demand_tpdo:
            self.with_sync += (pdo.tpdo(settings.demand_tpdo, node),)
            self.handlers[pdo.tpdo(settings.demand_tpdo, node)] = self._receive_demand
        self.load = LoadEncoder(settings) if settings.load_tpdo else None
        if self.load is not None:
            self.with_sync += (settings.load_can_id,)
            self.handlers[settings.load_can_id] = self._receive_load
        self.probe = TouchProbe(node, settings.probe_tpdo) if settings.probe_tpdo else None
        if self.probe is not None:
            self.handlers |= self.probe.handlers

    def set_velocity_units(self, per_count_s: float) -> None:
        """How many of its units of velocity (60B1h) one count per second is, as commissioning read."""
        self.velocity_per_period = per_count_s / self.settings.period_s

    # -- in

    def _feedback(self, data: memoryview, now_s: float) -> None:
        if len(data) != pdo.PDO_BYTES:
            self.malformed += 1
            self.again += 1
            self.answers.add()
            return
        statusword, position = _unpack_feedback(data)
        if self._arrived:
            self._again(position, statusword)
        else:
            self._before = self.position
            if self._twice:
                self._twice, self._twice_now = self._twice if self._twice_now else 0, False
        self.position = position
        self.position_at_s = now_s
        self._arrived = True
        if statusword != self.statusword or self._pending:
            # The same statusword earns the same answer, so only a new one is worth the work.
            self.statusword = statusword
            self._known = True
            self._step()
        if self._homing:
            self._watch_homing()

    def _receive_demand(self, data: memoryview, now_s: float) -> None:
        if len(data) != pdo.DEMAND.size:
            self.malformed += 1
            return
        (self._demand,) = pdo.DEMAND.unpack(data)
        self.missed = max(self.missed, 0)

    def _receive_load(self, data: memoryview, now_s: float) -> None:
        if self.load is None or len(data) != pdo.DEMAND.size:
            self.malformed += 1
            return
        self.load.receive(*pdo.DEMAND.unpack(data))

    def _look_at_load(self, load: LoadEncoder) -> None:
        """Load against motor, of the same SYNC; where the drive seeks its zero, the two begin anew."""
        if not self.cyclic:
            load.begin_anew()
            return
        load.compare(self.position)
        if self.following and load.fault is not DriveFault.NONE:
            self._lose(load.fault)
            self._step()

    def _compare_demand(self, demand: int) -> None:
        """Goes it by what it was sent? One that limits itself need not, but it does not stay where it was."""
        counts, before = demand / self._per_count, self._went_by
        if self._of_position:
            counts += self.position
        self._went_by = counts
        led = self.following and self.cyclic and not self._unheard
        if led and abs(counts - self._target_reached) > SAME_COUNTS:
            stays = abs(counts - before) <= SAME_COUNTS or abs(counts - self._target_before) <= SAME_COUNTS
            self.missed += stays or not self.statusword & cia402.INTERNAL_LIMIT

    def _emergency(self, data: memoryview, now_s: float) -> None:
        super()._emergency(data, now_s)
        if len(data) >= 2 and data[0] | data[1] << 8 == SETPOINTS_OVERDUE:
            self.overdue += 1

    def _heard(self) -> None:
        if self._demand is not None:
            demand, self._demand = self._demand, None
            self._compare_demand(demand)
        if self.load is not None:
            self._look_at_load(self.load)
        if self.again:
            self._judge_again()
        lag = self._target_reached - self.position
        if not -self._rest <= lag <= self._rest and self.following:
            self._compare(lag)

    def _expect_late(self) -> None:
        while self._unheard:
            self._unheard -= 1
            self._later()

    def _miss(self) -> None:
        super()._miss()
        self._twice, self._twice_now = 0, False
        self._later()

    def _later(self) -> None:
        """One feedback more may come beside the one that is owed."""
        if self._late < self._lost_after:
            self._late += 1

    def expect(self) -> None:
        if self._awaiting:  # a late tick has not listened: that feedback comes with the next
            self._unheard += 1
        self._awaiting = True
        self._target_before = self._target_reached
        self._target_reached, self._target_latched = self._target_latched, self.setpoint

    def measure(self) -> None:
        """Every ``MEASURE_EVERY`` SYNCs; see `FollowingError`."""
        if self.following:
            reached = self._target_reached
            self.following_error.measure(reached - self.position, self._target_latched - reached)

    @property
    def in_position(self) -> bool:
        """Whether it stands where motion has led it."""
        at_rest = self.setpoint == self._target_latched == self._target_reached
        return at_rest and abs(self.setpoint - self.position) <= self.settings.following.in_position_counts

    def _compare(self, lag: int) -> None:
        """Command against position; one that is too far off is lost, and told to stop where it is."""
        beyond = self.following_error.beyond(lag, self._target_latched - self._target_reached)
        if beyond and self.wanted is _ENABLED:
            self._lose(DriveFault.FOLLOWING_ERROR)
            self._step()

    def _again(self, position: int, statusword: int) -> None:
        """A second feedback for one SYNC: one that is late, if one was missed, or one too many."""
        moved, again = self.position - self._before, position - self.position
        near = CLOSE * abs(again) <= abs(moved)
        if self._unheard:
            self._unheard -= 1
            return
        if self._late:
            self._late -= 1
            if near and abs(moved) >= MOVES:
                self.answers.add(bunched=True)
            return
        self.again += 1
        self.answers.add()
        differs = again != 0 or statusword != self.statusword
        self.near = near and statusword == self.statusword
        if self.again > 1:
            self._twice, self._twice_now = 0, False  # of two nodes there would be two
        elif differs and not self._twice_now:
            self._twice_now = True
            self._twice += 1

    def _judge_again(self) -> None:
        """Two different answers to each of the last SYNCs. Where all drives give two, SYNC came twice."""
        self.again = 0
        if self.answers.of_all:
            self._twice, self._twice_now = 0, False
        elif self._twice >= TWICE_IN_A_ROW and self._judged:
            self._lose(DriveFault.NODE_TWICE)
            self._step()

    def _mode_display(self, data: memoryview, now_s: float) -> None:
        """6061h: a drive that a stranger has put into another mode goes by other objects than ours."""
        if len(data) != pdo.MODE_BYTES:
            self.malformed += 1
            return
        ours = data[0] == (_HOMING if self._homing else self._mode)
        # Until it is in operation a frame may be of before the slow side has chosen the mode.
        judged = self._reached and (self.cyclic or self._homing)
        if not ours and judged and self.wanted is _ENABLED:
            self._lose(DriveFault.MODE_LOST)
            self._step()

    # -- the state machine

    def _forget(self) -> None:
        super()._forget()
        self._followed = False
        self.following_error.forget()
        if self.load is not None and self.settings.absolute:  # nobody homes it
            self.load.begin_anew()

    def _look(self, enabled: bool) -> None:
        super()._look(enabled)
        told = enabled and bool(self.statusword & (self._goes_on if self.following else _FOLLOWS))
        follows = told and self.cyclic and not self._stale
        if self.wanted is _ENABLED:
            if follows:
                self._followed = True
            elif self._followed and self.cyclic:
                self._lose()
        # A drive that dropped out stays out: its setpoint is its own position from here on,
        # for taking the commanded one up again later would be a jump. So it is for one that
        # passes through operation on its way to being switched off.
        begins = self.following or self.wanted is _ENABLED
        self.following = follows and begins and not self._state_lost

    def _answer(self, state: State) -> int:
        word = super()._answer(state)
        if word == cia402.ENABLE_OPERATION and state is _OPERATION_ENABLED:
            if self._homing:
                return word | cia402.START_HOMING
            if self._interpolates and self.cyclic:
                return word | cia402.ENABLE_INTERPOLATION
        return word

    # -- homing

    def leave_cyclic(self) -> None:
        """The slow side is about to select another mode (6060h): bit 12 will mean something else."""
        self.cyclic = self.following = self._followed = False

    def resume_cyclic(self) -> None:
        """The slow side has read back the cyclic mode (6061h): bit 12 means "follows" again."""
        self.cyclic = True
        self._step()

    def homing(self, start: bool) -> None:
        """Starts homing (mode 6 must be selected), or takes the start bit back.

        ``homing_done`` or ``homing_error`` tell the end. The drive's setpoints stay its own
        position until ``resume_cyclic``.
        """
        if start:
            self.leave_cyclic()
            self.homing_done = self.homing_error = self._homing_begun = False
            self._homing_statuswords = self._stood = 0
        self._homing = start
        self._step()

    def _watch_homing(self) -> None:
        """Statusword bits 13, 12, 10 in homing mode: 0 1 1 done, 1 x x error, 0 0 x under way."""
        if not self._sent_controlword & cia402.START_HOMING:
            return
        word = self.statusword
        self._homing_statuswords += 1
        moved = abs(self.position - self._homed_at)
        self._homed_at = self.position
        self._stood = self._stood + 1 if moved <= self.settings.following.in_position_counts else 0
        if not word & (cia402.HOMING_ATTAINED | cia402.HOMING_ERROR):
            self._homing_begun = True
        elif self._homing_begun or self._homing_statuswords > STALE_STATUSWORDS:
            self.homing_error = bool(word & cia402.HOMING_ERROR)
            reached = not self.homing_error and bool(word & cia402.TARGET_REACHED)
            self.homing_done = reached and self._stood >= STOOD_FEEDBACKS

    # -- out

    def place(self, room: memoryview) -> None:
        """Packs its frame into ``room`` (16 bytes) from now on: neighbours can go out in one packet."""
        self._frame.place(room)

    def frame(self, setpoint: int, now_s: float) -> bytearray | memoryview:
        """The synchronous RPDO, packed: the setpoint (counts) or the actual position, and with it
        the controlword, or with feed-forward the velocity (the drive's units) of the period it begins.

        The same buffer every time: send it before the next call.
        """
        if not self.following:
            setpoint = self.position
        elif not INT32_MIN <= setpoint <= INT32_MAX:
            self.refused += 1
            setpoint = self.setpoint
        if self.feed_forward:
            # A drive goes from the last target to this one in a straight line: this is its slope.
            slope = round((setpoint - self.setpoint) * self.velocity_per_period) if self.following else 0
            self._frame.pack_velocity(setpoint, slope)
        else:
            word = self._controlword
            self._frame.pack_word(word, setpoint)
            self._sent_controlword = word
        self.setpoint = setpoint
        return self._frame.buffer

    @property
    def wire(self) -> DriveWire:
        """What the pump sends its setpoints by."""
        profile = self.settings.profile
        return DriveWire(self.node, profile.rpdo, self.feed_forward)

    @property
    def word(self) -> int:
        """The controlword that is due, with whether it goes by its target, as the pump reads them."""
        return self._controlword | FOLLOWS * self.following

    def was_sent(self, setpoint: int) -> None:
        """The pump has sent this setpoint (counts), or the position where it does not follow."""
        self.setpoint = setpoint if self.following else self.position
        if not self.feed_forward:
            self._sent_controlword = self._controlword

    def event_frame(self, now_s: float, heartbeat_s: float) -> bytearray | None:
        """With feed-forward: the controlword's own RPDO where it is due, else None."""
        word = self._controlword
        if not self._timer.is_due(word != self._sent_controlword, now_s, heartbeat_s):
            return None
        _pack_controlword_into(self._word_frame, 8, word)
        self._sent_controlword = word
        return self._word_frame
