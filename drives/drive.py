"""One CiA 402 drive as the tick sees it: frames in, one frame out, and what is wrong.

It owns no bus, no thread and no clock. Time is handed in, so that the same code
runs on the wall clock and on the stepped one. Nothing here raises: a frame that
makes no sense is counted, a fault is a value.

Start of motion without a jump. In cyclic synchronous position a drive goes to its
target the moment it uses it (statusword bit 12). Until then the target sent is the
actual position, every tick anew; from then on (`following`) it is the commanded
setpoint, which the caller must have started at `position`.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum

from drives import cia402, pdo
from drives.cia402 import State, Wanted
from drives.settings import INT32_MAX, INT32_MIN, NodeSettings

Handler = Callable[[memoryview, float], None]

NEVER_S = float("-inf")
LOST_IN_A_ROW = 2  # one lost TPDO is counted, the second in a row is a fault

# A start edge of homing sent in tick k is latched by the SYNC of k + 1 and seen in
# a statusword of k + 3 at the earliest; until "not attained" has been seen, or this
# many statuswords have passed, "attained" is that of an earlier homing.
STALE_STATUSWORDS = 10

# Looked up every tick, and an enum's members are slow to look up.
_OPERATION_ENABLED = State.OPERATION_ENABLED
_ENABLED = Wanted.ENABLED
_unpack_feedback = pdo.FEEDBACK.unpack
_pack_command_into = pdo.COMMAND.pack_into


class DriveFault(Enum):
    """Why the group cannot go on; the controller has the sentence and the remedy for each."""

    NONE = "none"
    FEEDBACK_LOST = "feedback lost"  # two TPDOs in a row did not come
    STATE_LOST = "state lost"  # left OPERATION_ENABLED, or stopped following, without being told to
    EMCY = "emergency"  # the drive reported an error; see emcy_code
    HEARTBEAT_LOST = "heartbeat lost"  # silent for consumer_s, restarted, or left NMT operational
    BUS_ERROR = "bus error"  # bus-off, error passive, receive overrun, or a second SYNC producer
    SEND_FAILED = "send failed"  # a frame did not go out: queue full, bus gone, or setpoint no int32


_NONE = DriveFault.NONE


class Drive:
    """The cyclic side of one drive.

    Read: ``state``, ``statusword``, ``position`` (counts), ``position_at_s``, ``fresh``
    (the feedback owed for the last SYNC came), ``following``, ``setpoint`` (as sent),
    ``emcy_code``, ``emcy_at_s``, ``heartbeat_at_s``, ``nmt_state``, ``homing_done``,
    ``homing_error``, ``lost`` (TPDOs lost since start), ``malformed`` (frames of wrong length).
    """

    def __init__(self, settings: NodeSettings, lost_after: int = LOST_IN_A_ROW) -> None:
        """``lost_after``: feedback owed so many times in a row and not come is a fault."""
        self.settings = settings
        self._lost_after = lost_after
        self.wanted = Wanted.OFF
        self.statusword = 0
        self.state = State.UNKNOWN
        self.position = 0
        self.position_at_s = NEVER_S
        self.fresh = False
        self.following = False
        self.setpoint = 0
        self.emcy_code = 0
        self.emcy_at_s = NEVER_S
        self.heartbeat_at_s = NEVER_S
        self.nmt_state = -1  # not heard of yet
        self.cyclic = True  # False while the drive is in homing mode
        self.homing_done = False
        self.homing_error = False
        self.lost = 0
        self.malformed = 0
        self.refused = 0  # setpoints outside of int32, not sent
        self._known = False  # a statusword has come
        self._pending = True  # the next statusword is worth a step though it be the same
        self._judged = False  # wanted ENABLED or QUICK_STOP
        self._arrived = False
        self._awaiting = False
        self._missed = 0
        self._feedback_lost = False
        self._reached = False  # OPERATION_ENABLED has been seen since it was wanted
        self._followed = False
        self._state_lost = False
        self._nmt_lost = False
        self._reset_armed = False
        self._homing = False
        self._homing_statuswords = 0
        self._homing_begun = False
        self._controlword = cia402.DISABLE_VOLTAGE
        self._sent_controlword = cia402.DISABLE_VOLTAGE
        self._frame: bytearray | memoryview = pdo.command_frame(settings.node)
        node = settings.node
        self.handlers: dict[int, Handler] = {
            pdo.TPDO1 + node: self._feedback,
            pdo.EMCY + node: self._emergency,
            pdo.HEARTBEAT + node: self._heartbeat,
        }

    # -- in

    def receive(self, can_id: int, data: memoryview, now_s: float) -> bool:
        """Takes one frame; False if it is not of this drive."""
        handler = self.handlers.get(can_id)
        if handler is None:
            return False
        handler(data, now_s)
        return True

    def _feedback(self, data: memoryview, now_s: float) -> None:
        if len(data) != pdo.PDO_BYTES:
            self.malformed += 1
            return
        statusword, self.position = _unpack_feedback(data)
        self.position_at_s = now_s
        self._arrived = True
        if statusword != self.statusword or self._pending:
            # The same statusword earns the same answer, so only a new one is worth the work.
            self.statusword = statusword
            self._known = True
            self._step()
        if self._homing:
            self._watch_homing()

    def _emergency(self, data: memoryview, now_s: float) -> None:
        if len(data) < 2:
            self.malformed += 1
            return
        self.emcy_code = data[0] | data[1] << 8  # 0000h: the error is gone
        self.emcy_at_s = now_s

    def _heartbeat(self, data: memoryview, now_s: float) -> None:
        if len(data) != 1:
            self.malformed += 1
            return
        state = data[0] & 0x7F
        if self.nmt_state == pdo.NMT_OPERATIONAL and state != pdo.NMT_OPERATIONAL:
            self._nmt_lost = True
        self.nmt_state = state
        self.heartbeat_at_s = now_s

    def expect(self) -> None:
        """A SYNC has gone out: one TPDO is owed."""
        self._awaiting = True

    def settle(self) -> None:
        """The time for the owed TPDO is over. A skipped SYNC owes none and changes nothing."""
        if self._awaiting:
            self._awaiting = False
            self.fresh = self._arrived
            if self._arrived:
                self._missed = 0
            else:
                self._missed += 1
                self.lost += 1
                if self._missed >= self._lost_after:
                    self._feedback_lost = True
        self._arrived = False

    # -- the state machine

    def want(self, wanted: Wanted) -> None:
        """Sets the goal; call it once per request. Quick stop and off act with the next frame.

        RESET makes one reset edge per call and forgets what was latched.
        """
        if wanted is Wanted.RESET:
            self._forget()
            self.emcy_code = 0
            self._reset_armed = True
        elif wanted is not self.wanted:
            self._reset_armed = False
            if wanted is _ENABLED:
                self._forget()
        self.wanted = wanted
        self._judged = wanted is _ENABLED or wanted is Wanted.QUICK_STOP
        self._step()

    def _forget(self) -> None:
        self._missed = 0
        self._reached = self._followed = self._state_lost = False
        self._nmt_lost = self._feedback_lost = False

    def _step(self) -> None:
        """One step of the state machine by the newest statusword."""
        self.state = state = cia402.state(self.statusword) if self._known else State.UNKNOWN
        enabled = state is _OPERATION_ENABLED
        follows = enabled and self.cyclic and bool(self.statusword & cia402.FOLLOWS_COMMAND)
        if self.wanted is _ENABLED:
            self._watch_state(enabled, follows)
        # A drive that dropped out stays out: its setpoint is its own position from here on,
        # for taking the commanded one up again later would be a jump.
        self.following = follows and not self._state_lost
        self._controlword = self._answer(state)
        self._pending = self._reset_armed or not self._known

    def _watch_state(self, enabled: bool, follows: bool) -> None:
        if enabled:
            self._reached = True
        elif self._reached:
            self._state_lost = True
        if follows:
            self._followed = True
        elif self._followed and self.cyclic:
            self._state_lost = True

    def _answer(self, state: State) -> int:
        if state is State.UNKNOWN and self.wanted is not Wanted.QUICK_STOP:
            return cia402.DISABLE_VOLTAGE
        if self._state_lost and self.wanted is _ENABLED:
            return cia402.QUICK_STOP
        if self.wanted is Wanted.RESET and state is State.FAULT:
            return self._reset_edge()
        word = cia402.controlword(self.statusword, self.wanted)
        if self._homing and state is _OPERATION_ENABLED and word == cia402.ENABLE_OPERATION:
            return word | cia402.START_HOMING
        return word

    def _reset_edge(self) -> int:
        """Bit 7 low for a frame if it was high, then high once per request."""
        if not self._reset_armed:
            return self._controlword
        if self._sent_controlword & cia402.FAULT_RESET:
            return cia402.DISABLE_VOLTAGE
        self._reset_armed = False
        return cia402.FAULT_RESET

    # -- homing

    def leave_cyclic(self) -> None:
        """The slow side is about to select another mode (6060h): bit 12 will mean something else."""
        self.cyclic = self.following = self._followed = False

    def resume_cyclic(self) -> None:
        """The slow side has read back mode 8 (6061h): bit 12 means "follows" again."""
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
            self._homing_statuswords = 0
        self._homing = start
        self._step()

    def _watch_homing(self) -> None:
        """Statusword bits 13, 12, 10 in homing mode: 0 1 1 done, 1 x x error, 0 0 x under way."""
        if not self._sent_controlword & cia402.START_HOMING:
            return
        word = self.statusword
        self._homing_statuswords += 1
        if not word & (cia402.HOMING_ATTAINED | cia402.HOMING_ERROR):
            self._homing_begun = True
        elif self._homing_begun or self._homing_statuswords > STALE_STATUSWORDS:
            self.homing_error = bool(word & cia402.HOMING_ERROR)
            self.homing_done = not self.homing_error and bool(word & cia402.TARGET_REACHED)

    # -- out

    def place(self, room: memoryview) -> None:
        """Packs its frame into ``room`` (16 bytes) from now on: neighbours can go out in one packet."""
        room[:] = self._frame
        self._frame = room

    def frame(self, setpoint: int, now_s: float) -> bytearray | memoryview:
        """RPDO1, packed: the controlword and the setpoint (counts), or the actual position.

        The same buffer every time: send it before the next call.
        """
        if not self.following:
            setpoint = self.position
        elif not INT32_MIN <= setpoint <= INT32_MAX:
            self.refused += 1
            setpoint = self.setpoint
        self.setpoint = setpoint
        word = self._controlword
        _pack_command_into(self._frame, 8, word, setpoint)
        self._sent_controlword = word
        return self._frame

    # -- judgement

    def fault(self, now_s: float, consumer_s: float) -> DriveFault:
        """What is wrong, the cause before its consequences; judged while ENABLED or QUICK_STOP is wanted.

        All but an overdue heartbeat stays until RESET, or until ENABLED is wanted anew; an
        emergency until RESET, or until the drive takes it back (code 0000h).
        """
        if not self._judged:
            return _NONE
        if self.emcy_code:
            return DriveFault.EMCY
        if self._state_lost:
            return DriveFault.STATE_LOST
        if self._feedback_lost:
            return DriveFault.FEEDBACK_LOST
        # A consumer starts with the first heartbeat it hears (CiA 301, error control).
        if self._nmt_lost or (self.nmt_state >= 0 and now_s - self.heartbeat_at_s > consumer_s):
            return DriveFault.HEARTBEAT_LOST
        return _NONE
