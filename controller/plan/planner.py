"""Keeps the tick's queue full: takes the traced path chain by chain, plans it, sends it.

Every message is one chain or pause, complete to a standstill, and is appended at the
queue's end. So the queue always ends at rest and an interrupted planner leaves nothing
half said. What is planned next depends on the path alone, never on the clock; the clock
only decides when.
"""

from __future__ import annotations

from collections.abc import Callable

from controller.handoff import STILL, Piece, PieceMessage, Snapshot, dwell
from controller.kinematics import Kinematics
from controller.machine import Machine
from controller.motions import Motion
from controller.plan import profile
from controller.plan.path import Chain, Path, Pause, Stretch
from controller.plan.program import Act

AHEAD_S = 4.0  # of motion that is planned before the tick needs it


class Planner:
    """Plans one path; ``send`` hands a message to the tick and says whether it went out."""

    def __init__(
        self, machine: Machine, kinematics: Kinematics, send: Callable[[PieceMessage], bool]
    ) -> None:
        self._machine, self._kinematics, self._send = machine, kinematics, send
        self._sequence = 0
        self._items: tuple[Chain | Pause, ...] = ()
        self._next = 0
        self._queue_end_s = 0.0
        self._dropped = False
        self.stretches: dict[int, Stretch] = {}  # by motion id, for traces

    @property
    def finished(self) -> bool:
        """Everything of the path has been sent."""
        return self._next >= len(self._items)

    @property
    def finished_path(self) -> bool:
        """Everything has been sent, and not because the rest was dropped."""
        return self.finished and not self._dropped

    def load(self, path: Path, queue_end_s: float) -> None:
        """Take a path; the first message goes out with the next ``work``."""
        self._items, self._next = path.items, 0
        self._dropped = False
        self._queue_end_s = queue_end_s

    def drop(self) -> None:
        """Forget what has not been sent: the operator stopped the program."""
        self._items, self._next = (), 0
        self._dropped = True

    def work(self, now: Snapshot) -> None:
        """Send what the queue lacks; at most one chain a call."""
        if not self.finished and self._queue_end_s - now.plan_time_s < AHEAD_S:
            item = self._items[self._next]
            last = self._next == len(self._items) - 1
            self._next += 1
            self._append(*self._pieces(item, now, last))

    def keepalive(self) -> None:
        """Tell the tick that the planner lives."""
        self._sequence += 1
        self._send(PieceMessage(self._sequence, self._queue_end_s))

    def _append(self, motions: dict[int, Motion], pieces: tuple[Piece, ...]) -> None:
        self._sequence += 1
        self._send(PieceMessage(self._sequence, self._queue_end_s, motions, pieces))
        for piece in pieces:
            self._queue_end_s += piece.duration_s

    def _pieces(
        self, item: Chain | Pause, now: Snapshot, last: bool
    ) -> tuple[dict[int, Motion], tuple[Piece, ...]]:
        if isinstance(item, Pause):
            stop = item.act is Act.STOP
            rest = dwell(item.seconds, item.place.line, stop=stop, end=last)
            return {}, (
                rest._replace(spindle_rev_min=item.modal.spindle_rev_min, coolant=item.modal.coolant),
            )
        return self._chain(item, now.override, now.rapid_override, last)

    def _chain(
        self, chain: Chain, override: float, rapid_override: float, last: bool
    ) -> tuple[dict[int, Motion], tuple[Piece, ...]]:
        laws = profile.plan(chain, self._machine, self._kinematics, override)
        motions: dict[int, Motion] = {}
        pieces = []
        for stretch, law in zip(chain.stretches, laws, strict=True):
            name = len(self.stretches)
            self.stretches[name] = stretch
            motions[name] = stretch.motion
            rapid = stretch.feed_mm_s is None
            pieces.append(
                Piece(
                    name,
                    stretch.place.line,
                    law,
                    law.duration_s,
                    cutting=stretch.cutting,
                    rapid=rapid,
                    override=1.0 if rapid else override,
                )
            )
        if last:
            pieces.append(Piece(-1, 0, STILL, 0.0, end=True))
        return motions, tuple(pieces)
