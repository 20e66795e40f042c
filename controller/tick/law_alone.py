"""The tie to a spindle as a look ahead has it: the law alone leads, and what leads beside it is laid over."""

from __future__ import annotations

from controller.machine.model import Machine
from controller.motion.motions import ThreadMove
from controller.tick.coupling import Coupling, Law, Tie
from drives.pump.lead import Correction


class LawAlone(Coupling):
    """Read ``law``, of the period that it is in; None: on no thread."""

    def __init__(self, machine: Machine, tie: Coupling) -> None:
        """``tie``: the one whose ticks are looked ahead of."""
        super().__init__(machine, tie._spindle, tie._drives)
        self.reply = tie.reply
        self.law: Law | None = None
        self._wanted = (0.0, 0.0)  # rev, in the last two periods, the newest first

    @property
    def begun(self) -> Correction:
        """What led beside the law where this began."""
        return self.now

    def look(self) -> None:
        """Nothing: whether a spindle settles nobody knows yet."""

    def end(self) -> None:
        super().end()
        self.law = None

    def restore(self, saved: Tie | None) -> None:
        super().restore(saved)
        if saved is not None and self.move is not None:
            before, earlier, *_ = self._past.wanted
            self._wanted = before, earlier
            self.law = Law(self.move, self.s, 0.0, 0.0, before, 0.0, 0.0)

    def follow(self, move: ThreadMove, s: float, v: float, a: float) -> float:
        if self._spindle is None:
            return s
        if not self.active:
            wanted = move.begin_rev + move.rev_per_mm * s
            self._begin(move, wanted, 0.0)
            self._wanted = wanted, wanted
        self.move, self.s = move, s
        self.law = law = Law.of(move, (s, v, a), self._wanted, self._period_s)
        before, _ = self._wanted
        self._wanted = law.wanted_rev, before
        return s
