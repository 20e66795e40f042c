"""Who sends what when in one tick: the frames in the order in which the wire takes them.

SYNC is sent into an empty queue and goes first. By its end the drives answer and the tick has its
setpoints ready, so from there on the lowest identifier goes next (arbitration), without a pause:

    SYNC | feedback X Y Z ... | setpoint X Y Z ... |           free          | SYNC
    0                                              last setpoint           period

Setpoints need not wait for feedback: if a drive answers late, setpoints go before it, and the end
is the same.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from drives import pdo
from drives.load.budget import BusBudget
from drives.load.bus_frames import Row
from drives.texts import english


@dataclass(frozen=True, slots=True)
class Slot:
    """One frame's place in the tick, in us from the start of SYNC."""

    row: Row
    start_us: float
    end_us: float

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return {
            "what": english(self.row.text),
            "sender": self.row.sender,
            "can_id": self.row.can_id,
            "start_us": self.start_us,
            "end_us": self.end_us,
        }


def worst(budget: BusBudget) -> list[Slot]:
    """The fullest tick: all drives answer, every frame as long as the rule of stuffing allows."""
    return _laid(budget.cyclic, typical=False)


def typical(budget: BusBudget) -> list[Slot]:
    """The same tick with frames of mean length."""
    return _laid(budget.cyclic, typical=True)


def crowded(budget: BusBudget) -> list[Slot]:
    """Everything at once: also all heartbeats, an emergency of every node and one SDO pair."""
    return _laid(budget.rows, typical=False)


def _laid(rows: Iterable[Row], typical: bool) -> list[Slot]:
    slots: list[Slot] = []
    at_us = 0.0
    for row in sorted(rows, key=_turn):
        end_us = at_us + (row.typical_us if typical else row.worst_us)
        slots.append(Slot(row, at_us, end_us))
        at_us = end_us
    return slots


def _turn(row: Row) -> tuple[bool, int]:
    """SYNC, then by identifier."""
    return row.can_id != pdo.SYNC, row.can_id
