"""Whether SYNC reaches the drives of a bus as it was sent: once a period, by what they answer.

The controller does not hear its own SYNC on the wire. A gateway, a bridge or an adapter may repeat it, or
hold it back and send two of them close together; the drives then latch setpoints at the wrong time. What can
be seen of that, and by which drives:

    SYNC comes twice         every drive answers it twice                drives that answer each SYNC
    two come too close       two answers come in one tick, after none    drives that answer each SYNC, while
                             in the last, and between them the motor     they move
                             has hardly moved

Answers that only come late and together, as adapters deliver them, were given a period of motion apart, and
mean nothing. A drive alone that answers twice is another matter (``Drive``: two nodes under one id); alone on
its bus it is taken for SYNC where both answers were given at the same place. A drive that answers every n-th
SYNC shows nothing of this. Of a counter of SYNC (1019h) nothing is known: no data sheet that was looked at
has one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol


class Answering(Protocol):
    """A drive that answers each SYNC."""

    again: int
    near: bool


class SyncAnswers:
    """Of all drives on one bus since they were judged last; none of it on a healthy bus.

    Read: ``again`` (answers beside those that are owed), ``bunched`` (two of them were given close together),
    ``of_all`` (in the last judgement every drive had answered twice).
    """

    __slots__ = ("again", "bunched", "of_all")

    def __init__(self) -> None:
        self.again = 0
        self.bunched = self.of_all = False

    def add(self, bunched: bool = False) -> None:
        """One beside those that are owed."""
        self.again += 1
        self.bunched = self.bunched or bunched

    def judge(self, drives: Sequence[Answering]) -> bool:
        """Whether SYNC was heard twice by ``drives``, who answer each, or two of them were close together."""
        bunched, self.bunched, self.again = self.bunched, False, 0
        self.of_all = bool(drives) and all([drive.again for drive in drives])
        if len(drives) == 1:
            self.of_all = self.of_all and drives[0].near
        return bunched or self.of_all
