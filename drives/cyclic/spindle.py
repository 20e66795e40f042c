"""A spindle's drive as the tick sees it: a wanted speed in, the actual one and "at speed" out.

It turns in cyclic synchronous velocity (mode 9), where the drive expects to be led: the
wanted speed is approached at `SpindleSettings.acceleration_rev_s2`. In profile velocity
(mode 3) the drive has its own ramp and is told the end. Its RPDO goes out when it has
something new to say, and once a heartbeat; layout: `drives.pdo`, "command" and "feedback".
"""

from __future__ import annotations

from drives import cia402, pdo
from drives.cia402 import State, Wanted
from drives.cyclic.power_stage import LOST_IN_A_ROW, PowerStage
from drives.cyclic.supervised import NEVER_S, EventTimer
from drives.profile import Supervision
from drives.pump.plan_memory import FOLLOWS
from drives.pump.player import to_speed
from drives.pump.speed_ramp import NO_RAMP, SpeedRamp
from drives.pump.wires import DriveWire
from drives.settings import INT32_MAX, INT32_MIN, SpindleSettings

CYCLIC_VELOCITY = 9
STANDING_REV_S = 0.1  # slower than this it stands
LONGEST_STEP_S = 0.1  # of the ramp, after a pause in the ticks
HALF, WHOLE = 2**31, 2**32  # of what a position can count
FULL_LOAD = 1000.0  # of 6077h
MAX_AHEAD = 50  # SYNCs in a row whose position was there at once: rather, one came twice

_unpack_feedback = pdo.FEEDBACK.unpack
_pack_command_into = pdo.COMMAND.pack_into


class SpindleDrive(PowerStage):
    """The cyclic side of a spindle.

    Read: ``speed`` (counts/s, actual), ``speed_at_s``, ``rev_min``, ``at_speed``, ``standing``; where it
    tells its position ``turns`` (revolutions since the first one was heard, signed), ``unheard`` (SYNCs since
    the one that it answers: 0 where that is the newest), ``even_syncs`` (in which it has been told one speed)
    and ``load`` (share of the rated torque); and what `PowerStage` and `Supervised` have.
    """

    def __init__(self, settings: SpindleSettings, lost_after: int = LOST_IN_A_ROW) -> None:
        """``lost_after``: feedback owed so many times in a row and not come is a fault."""
        profile, node = settings.profile, settings.node
        super().__init__(
            node,
            guarded=profile.supervision is Supervision.GUARDING,
            every=settings.feedback_every,
            lost_after=lost_after,
        )
        self.settings = settings
        self.set_velocity_units(settings.velocity_units)
        self.speed = 0.0
        self.speed_at_s = NEVER_S
        self._wanted_speed = 0.0  # counts/s
        self._led_speed = 0.0  # on its way there
        self._leads = settings.mode == CYCLIC_VELOCITY
        self._acceleration = abs(settings.acceleration_rev_s2 * settings.counts_per_rev)
        self._standing_speed = abs(STANDING_REV_S * settings.counts_per_rev)
        self._stepped_s = NEVER_S
        self._frame = pdo.command_frame(node, profile.rpdo)
        self._sent_speed = self._even_speed = 0
        self.even_syncs = 0
        self._timer = EventTimer()
        self.turns = self.load = 0.0
        self.unheard = 0
        self._placed = False  # a position, since the last SYNC
        self._ahead = 0  # SYNCs in a row whose position was there at once
        self._turned: int | None = None  # counts, as heard last
        self._directly = False  # the wanted speed is led by somebody else: no ramp of ours
        self._by_plan = False  # it goes out with the setpoints of the pump
        self._ramp = NO_RAMP  # by which the pump leads it, where nobody else does, ...
        self._ramped_rev_s = 0.0  # ... as it is in this period
        self._was_led = False  # since the last tick
        self.with_sync = (pdo.tpdo(profile.tpdo, node),)
        self.handlers[self.with_sync[0]] = self._feedback
        if settings.position_tpdo:
            self.with_sync += (pdo.tpdo(settings.position_tpdo, node),)
            self._per_rev = settings.position_per_rev
            self.handlers[pdo.tpdo(settings.position_tpdo, node)] = self._position

    def set_velocity_units(self, per_count_s: float) -> None:
        """How many of its units of velocity (60FFh, 606Ch) one count per second is, as was read."""
        self._units, self._unit = per_count_s, 1.0 / per_count_s

    # -- what is wanted

    def want_speed(self, rev_min: float) -> None:
        """Turn so fast, rev/min; positive as M3, negative as M4. It turns while ENABLED is wanted."""
        self._wanted_speed = rev_min / 60.0 * self.settings.counts_per_rev
        self._directly = False

    def lead(self, rev_s: float, by_plan: bool = False) -> None:
        """Turn just so fast in the period to come, rev/s: a path leads it, and keeps to its acceleration.

        ``by_plan``: the pump tells it, in the period whose plan has it.
        """
        self._wanted_speed = rev_s * self.settings.counts_per_rev
        self._directly, self._by_plan = True, by_plan

    def stop(self) -> None:
        """Come to a standstill, and stay enabled."""
        self.want_speed(0.0)

    def want(self, wanted: Wanted) -> None:
        """As of every drive; whatever is not ENABLED forgets the speed, so that none comes back by itself."""
        if wanted is not Wanted.ENABLED:
            self.stop()
        super().want(wanted)

    # -- what it does

    @property
    def rev_min(self) -> float:
        """Actual speed, rev/min."""
        return self.speed * 60.0 / self.settings.counts_per_rev

    @property
    def commanded_rev_s(self) -> float:
        """The speed that was sent to it last, rev/s."""
        return self._sent_speed / self.units_per_rev_s

    @property
    def standing(self) -> bool:
        """Whether it has reported to stand."""
        return self.speed_at_s > NEVER_S and abs(self.speed) <= self._standing_speed

    @property
    def at_speed(self) -> bool:
        """Whether the speed heard last is the wanted one, within the settings' share; at 0: it stands."""
        if self.state is not State.OPERATION_ENABLED or self._feedback_lost:
            return self._wanted_speed == 0.0 and self.standing
        share = self.settings.at_speed_share * abs(self._wanted_speed)
        return abs(self.speed - self._wanted_speed) <= max(share, self._standing_speed)

    def _position(self, data: memoryview, now_s: float) -> None:
        """Counts that wrap at 32 bits: what it has turned since the last one is their difference."""
        both = len(data) == pdo.TURNED_AND_LOAD.size
        if not both and len(data) != pdo.TURNED.size:
            self.malformed += 1
            return
        counts, torque = pdo.TURNED_AND_LOAD.unpack(data) if both else (*pdo.TURNED.unpack(data), 0)
        if self._turned is not None:
            self.turns += ((counts - self._turned + HALF) % WHOLE - HALF) / self._per_rev
        self._turned, self._placed = counts, True
        self.unheard = max(self.unheard - 1, -1)
        self.load = torque / FULL_LOAD

    def expect(self) -> None:
        """As of every drive; and a position is owed for each SYNC."""
        super().expect()
        if self._placed and self.unheard > 0:
            self.unheard = 0  # those before it were lost
        self._placed = False
        self.unheard += 1
        even = self._sent_speed == self._even_speed and self.word & FOLLOWS
        self.even_syncs = self.even_syncs + 1 if even else 0
        self._even_speed = self._sent_speed
        self._ahead = self._ahead + 1 if self.unheard < 1 else 0
        if self._ahead > MAX_AHEAD:
            self.unheard = 1

    def _feedback(self, data: memoryview, now_s: float) -> None:
        if len(data) != pdo.PDO_BYTES:
            self.malformed += 1
            return
        statusword, speed = _unpack_feedback(data)
        self.speed = speed * self._unit
        self.speed_at_s = now_s
        if self._arrived:
            self.again += 1
            self.answers.add()
        self._arrived = True
        if statusword != self.statusword or self._pending:
            self.statusword = statusword
            self._known = True
            self._step()

    # -- out

    @property
    def wire(self) -> DriveWire | None:
        """What the pump leads it by; None where the drive has a ramp of its own."""
        return DriveWire(self.node, self.settings.profile.rpdo, False) if self._leads else None

    @property
    def units_per_rev_s(self) -> float:
        """Of velocity (60FFh) in one rev/s."""
        return self.settings.counts_per_rev * self._units

    @property
    def word(self) -> int:
        """The controlword that is due, and whether the pump may lead it."""
        word = self._controlword
        turns = self.state is State.OPERATION_ENABLED and word == cia402.ENABLE_OPERATION
        return word | FOLLOWS * turns

    def was_led(self, rev_s: float) -> bool:
        """The pump has told it this speed in a period, if it could be led."""
        if not self.word & FOLLOWS:
            return False
        self._sent_controlword = self._controlword
        self._sent_speed = to_speed(rev_s, self.units_per_rev_s)
        self._was_led = True
        return True

    def ramp(self, period: int, period_s: float) -> SpeedRamp:
        """How the pump leads it on behind ``period``, whose own speed goes out with the tick's events."""
        settings = self.settings
        if self._directly or not self._leads or not self.word & FOLLOWS:
            self._ramp = NO_RAMP
            return NO_RAMP
        old, to = self._ramp, self._wanted_speed / settings.counts_per_rev
        if old is NO_RAMP or to != old.to_rev_s:
            led = self._led_speed / settings.counts_per_rev if old is NO_RAMP else old.value(period - 1)
            self._ramp = SpeedRamp(period - 1, led, to, abs(settings.acceleration_rev_s2) * period_s)
        self._ramped_rev_s = self._ramp.value(period)
        return self._ramp

    def event_frame(self, now_s: float, heartbeat_s: float) -> bytearray | None:
        """Its RPDO where there is something to tell, else None."""
        if self._directly and self._by_plan and self.word & FOLLOWS:
            self._led_speed, self._stepped_s = self._wanted_speed, now_s
            return None
        word, speed = self._controlword, self._lead(now_s)
        was_led, self._was_led = self._was_led, False
        is_new = word != self._sent_controlword or speed != self._sent_speed
        if was_led and not is_new:
            self._timer.put_off(now_s, heartbeat_s)
            return None
        if not self._timer.is_due(is_new, now_s, heartbeat_s):
            return None
        self._sent_controlword, self._sent_speed = word, speed
        _pack_command_into(self._frame, 8, word, speed)
        return self._frame

    def _lead(self, now_s: float) -> int:
        """The speed to command now, in the drive's units; without operation the actual one, for a start."""
        step_s = min(max(now_s - self._stepped_s, 0.0), LONGEST_STEP_S)
        self._stepped_s = now_s
        if self.state is not State.OPERATION_ENABLED or self._controlword != cia402.ENABLE_OPERATION:
            self._led_speed = 0.0 if self.standing else float(self.speed)
        elif self._directly or not self._leads:
            self._led_speed = self._wanted_speed
        elif self._ramp is not NO_RAMP:
            self._led_speed = self._ramped_rev_s * self.settings.counts_per_rev
            return to_speed(self._ramped_rev_s, self.units_per_rev_s)
        else:
            most = self._acceleration * step_s
            self._led_speed += max(-most, min(most, self._wanted_speed - self._led_speed))
        return max(INT32_MIN, min(INT32_MAX, round(self._led_speed * self._units)))
