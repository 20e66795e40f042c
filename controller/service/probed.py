"""What probing cycles have found: a table of the last results, kept in the store.

A program tells a result as ``(LOG, bore x_mm=#1 y_mm=#2 diameter_mm=#3)``: a name, and values whose names end
in their unit. So do the cycles that ship, and so may any cycle of one's own.

Beside them the last touches themselves, as measuring takes them: lines of a CSV.
"""

from __future__ import annotations

import contextlib
import re
import threading
import time
from collections.abc import Sequence
from typing import Any

from controller.machine.model import Machine
from controller.plan.planner import Touch
from controller.runtime import touch_table
from controller.store.service_store import ServiceStore

DOCUMENT, TOUCHES = "probed", "touches"  # in the store
KEPT, KEPT_TOUCHES = 500, 2000
_VALUE = r"[a-z]\w*=-?\d+\.\d+"
_RESULT = re.compile(rf"([a-z]\w*)((?: {_VALUE})+)", re.ASCII)


def result_of(text: str) -> dict[str, Any] | None:
    """The result that a message of a program tells: cycle and values; None where it tells none."""
    if (match := _RESULT.fullmatch(text)) is None:
        return None
    values = dict(one.split("=") for one in match[2].split())
    return {"cycle": match[1], "values": {name: float(value) for name, value in values.items()}}


def taken(kept: Any) -> list[dict[str, Any]]:
    """Raises TypeError for what are no rows."""
    if not isinstance(kept, list) or not all(isinstance(row, dict) for row in kept):
        raise TypeError("no list of results")
    return kept


def table_lines(values: Any) -> list[str]:
    """Raises TypeError for what are no lines of a table."""
    if not isinstance(values, list) or not values or not all(isinstance(line, str) for line in values):
        raise TypeError("no lines of a table")
    return values


class Probed:
    """One per service; any thread."""

    def __init__(self, store: ServiceStore) -> None:
        """Raises OSError."""
        self._store, self._lock = store, threading.Lock()
        self._rows = store.document(DOCUMENT, taken, taken([]))
        # Lines of the table after its head, the newest last.
        self._head, *self._touches = store.document(TOUCHES, table_lines, [""])

    def to_json(self) -> list[dict[str, Any]]:
        """Time (s since 1970), program, cycle, values; the newest first."""
        return self._rows[::-1]

    def add(self, program: str, results: list[dict[str, Any]]) -> None:
        fresh = [{"at_s": time.time(), "program": program, **one} for one in results]
        self._rows = [*self._rows, *fresh][-KEPT:]

    def touch(self, touches: Sequence[Touch], machine: Machine) -> None:
        """One more touch or some; of a machine with other axes all are begun anew."""
        head, *lines = touch_table.text(touches, machine).splitlines()
        before = self._touches if head == self._head else []
        self._head, self._touches = head, [*before, *lines][-KEPT_TOUCHES:]

    def save_touches(self) -> None:
        """As ``save``."""
        with self._lock, contextlib.suppress(OSError):
            self._store.put(TOUCHES, [self._head, *self._touches])

    def save(self) -> None:
        """What the disk does not take is only told. Waits for the disk."""
        with self._lock, contextlib.suppress(OSError):
            self._store.put(DOCUMENT, self._rows)
