"""The CiA 402 state machine of one drive, and whether its feedback comes.

It owns no bus, no thread and no clock. Time is handed in, so that the same code
runs on the wall clock and on the stepped one. Nothing here raises: a frame that
makes no sense is counted, a fault is a value. What the drive is for (following a
path, turning a spindle) is added by the classes built on this one.
"""

from __future__ import annotations

from typing import Final

from drives import cia402, pdo
from drives.cia402 import State, Wanted
from drives.cyclic import drive_fault
from drives.cyclic.drive_fault import DriveFault
from drives.cyclic.supervised import Supervised
from drives.cyclic.sync_answers import SyncAnswers

# Feedback may tell of what was before ENABLED was wanted: a drive on its way to off still says that it
# is enabled. So many later ones must have come before it can have dropped out.
STALE_FEEDBACKS = 3
LOST_IN_A_ROW = 2  # one lost TPDO is counted, the second in a row is a fault

# Looked up every tick, and an enum's members are slow to look up.
_OPERATION_ENABLED: Final = State.OPERATION_ENABLED
_ENABLED: Final = Wanted.ENABLED
_NONE: Final = DriveFault.NONE
POWERED = (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE, State.FAULT_REACTION_ACTIVE)


class PowerStage(Supervised):
    """A drive from power-on to operation and back.

    Read: ``wanted``, ``state``, ``statusword``, ``fresh`` (the feedback owed came), ``lost``
    (TPDOs lost since start), ``again`` (feedbacks in this tick beside the one that is owed, and those that
    were late), and what `Supervised` has. ``answers`` are those of the whole bus.
    """

    def __init__(
        self, node: int, *, guarded: bool, every: int, braked: bool = False, lost_after: int = LOST_IN_A_ROW
    ) -> None:
        """``every``: SYNCs from one TPDO to the next; ``lost_after`` of them missing in a row is a fault."""
        super().__init__(node, guarded)
        self.wanted = Wanted.OFF
        self.statusword = 0
        self.state = State.UNKNOWN
        self.fresh = False
        self.lost = 0
        self.again = 0
        self._made_up = 0  # of ``lost``: that have come after all
        self.answers = SyncAnswers()
        self._braked = braked
        self._every = every
        self._lost_after = lost_after
        self._known = False  # a statusword has come
        self._pending = True  # the next statusword is worth a step though it be the same
        self._arrived = False
        self._awaiting = False
        self._unheard = 0  # SYNCs after which nobody has listened yet, but for the last one
        self._since = 0  # SYNCs without feedback
        self._missed = 0
        self._feedback_lost = False
        self._reached = False  # OPERATION_ENABLED has been seen since it was wanted
        self._stale = 0  # feedbacks that may be older than what is wanted
        self._state_lost = False
        self._lost_as = DriveFault.STATE_LOST
        self._reset_armed = False
        self._controlword = cia402.DISABLE_VOLTAGE
        self._sent_controlword = cia402.DISABLE_VOLTAGE

    # -- feedback

    def expect(self) -> None:
        """A SYNC has gone out: a TPDO is owed, if it is this SYNC's turn."""
        self._awaiting = True

    def settle(self) -> None:
        """The time for an owed TPDO is over. A skipped SYNC owes none and changes nothing.

        A drive that answers every n-th SYNC counts from where it likes: the turn is n SYNCs
        after it was last heard.
        """
        if self._awaiting:
            self._awaiting = False
            if self._arrived:
                self.fresh = True
                self._since = self._missed = 0
                self._heard()
                if self._stale:
                    self._stale -= 1
                    self._pending = self._pending or not self._stale
            else:
                self._since += 1
                if self._since >= self._every:
                    self._miss()
        elif self._arrived:
            self._missed = 0  # late, in a tick that sent no SYNC: what is missed next is not in a row
        self._arrived = False
        if self._unheard:
            self._expect_late()

    def too_many(self) -> int:
        """Feedbacks of this tick, the one that is owed included, if more have come than were ever missed."""
        missed = min(self.again, self.lost - self._made_up)
        self._made_up += missed
        return self.again - missed and self.again - missed + 1

    def _heard(self) -> None:
        """The feedback owed has come; of several that came at once the newest counts."""

    def _expect_late(self) -> None:
        """Of each SYNC after which nobody has listened the feedback may come yet."""

    def _miss(self) -> None:
        self.fresh = False
        self._since = 0
        self._missed += 1
        self.lost += 1
        if self._missed >= self._lost_after:
            self._feedback_lost = True

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
                on_its_way = self._every > 1 or self.state is _OPERATION_ENABLED
                self._stale = STALE_FEEDBACKS if on_its_way else 0
        self.wanted = wanted
        self._judged = wanted is _ENABLED or wanted is Wanted.QUICK_STOP
        self._step()

    def _forget(self) -> None:
        super()._forget()
        self._since = self._missed = 0
        self._reached = self._state_lost = self._feedback_lost = False

    def _step(self) -> None:
        """One step of the state machine by the newest statusword."""
        self.state = state = cia402.state(self.statusword) if self._known else State.UNKNOWN
        self._look(state is _OPERATION_ENABLED)
        self._controlword = self._answer(state)
        self._pending = self._reset_armed or not self._known

    def _look(self, enabled: bool) -> None:
        """What a step means for what the drive is there for."""
        if self.wanted is not _ENABLED:
            return
        if enabled:
            self._reached = not self._stale
        elif self._reached:
            self._lose()

    def _lose(self, fault: DriveFault = _NONE) -> None:
        """It has left operation, or does not follow, without being told to; ``fault``: known otherwise."""
        if not self._state_lost:
            self._state_lost = True
            told = drive_fault.of_statusword(self.state, self.statusword)
            self._lost_as = told if fault is _NONE else fault

    def _answer(self, state: State) -> int:
        if state is State.UNKNOWN and self.wanted is not Wanted.QUICK_STOP:
            return cia402.DISABLE_VOLTAGE
        if self._state_lost and self.wanted is _ENABLED:
            return cia402.QUICK_STOP
        if self.wanted is Wanted.RESET and state is State.FAULT:
            return self._reset_edge()
        return cia402.controlword(self.statusword, self.wanted, self._braked)

    def _reset_edge(self) -> int:
        """Bit 7 low for a frame if it was high, then high once per request."""
        if not self._reset_armed:
            return self._controlword
        if self._sent_controlword & cia402.FAULT_RESET:
            return cia402.DISABLE_VOLTAGE
        self._reset_armed = False
        return cia402.FAULT_RESET

    # -- judgement

    def fault(self, now_s: float, consumer_s: float) -> DriveFault:
        """What is wrong, the cause before its consequences; judged while ENABLED or QUICK_STOP is wanted.

        All but an overdue heartbeat stays until RESET, or until ENABLED is wanted anew; an
        emergency until RESET, or until the drive takes it back (code 0000h).
        """
        if not self._judged:
            return _NONE
        if self.emcy_code:
            return self._emcy_fault
        if self._state_lost and self._left is _NONE:
            return self._lost_as
        return self.out_of_sight(now_s, consumer_s)

    def out_of_sight(self, now_s: float, consumer_s: float) -> DriveFault:
        """Whether it started anew, was stopped or is silent, whatever else it has reported before."""
        if not self._judged:
            return _NONE
        if self._left is not _NONE:
            return self._left
        if self._feedback_lost:
            stopped = 0 <= self.nmt_state != pdo.NMT_OPERATIONAL
            return DriveFault.NODE_STOPPED if stopped else DriveFault.FEEDBACK_LOST
        if self._watched and now_s - self.heartbeat_at_s > consumer_s:
            return DriveFault.HEARTBEAT_LOST
        return _NONE
