"""What probing cycles have found: a table of the last results, kept on the disk.

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
from pathlib import Path
from typing import Any

from controller import own_files, sealed_file
from controller.machine.model import Machine
from controller.messages import Message
from controller.plan.planner import Touch
from controller.runtime import touch_table
from controller.service import kept_file
from controller.state import record_files

FILE = "probed.json"
KEPT, KEPT_TOUCHES = 500, 2000
_VALUE = r"[a-z]\w*=-?\d+\.\d+"
_RESULT = re.compile(rf"([a-z]\w*)((?: {_VALUE})+)", re.ASCII)


def found(text: str) -> dict[str, Any] | None:
    """The result that a message of a program tells: cycle and values; None where it tells none."""
    if (match := _RESULT.fullmatch(text)) is None:
        return None
    values = dict(one.split("=") for one in match[2].split())
    return {"cycle": match[1], "values": {name: float(value) for name, value in values.items()}}


def _taken(kept: Any) -> list[dict[str, Any]]:
    """Raises TypeError for what are no rows."""
    if not isinstance(kept, list) or not all(isinstance(row, dict) for row in kept):
        raise TypeError("no list of results")
    return kept


def _of_older(state: Path) -> tuple[list[str], Message | None]:
    """Touches that a version before has kept, and what an alarm says where they cannot be read."""
    try:
        return record_files.touches(state), None
    except FileNotFoundError:
        return [], None
    except (OSError, ValueError) as error:
        return [], kept_file.put_aside(state / record_files.OLDER_TOUCHES, error)


class Probed:
    """One per service; any thread."""

    def __init__(self, state: Path) -> None:
        self._file, self._lock = state / FILE, threading.Lock()
        self._table = state / record_files.TOUCHES
        self._touches: list[str] = []  # lines of the table behind its head, the newest last
        self._head = ""
        self._rows: list[dict[str, Any]]
        self._rows, self.damaged = kept_file.read(self._file, _taken, _taken([]))
        none: list[str] = []
        lines, self.touches_damaged = kept_file.read(self._table, record_files.table_lines, none)
        if not lines and self.touches_damaged is None:
            lines, self.touches_damaged = _of_older(state)
        self._head, *self._touches = lines or [""]

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
            sealed_file.write(self._table, [self._head, *self._touches])
            own_files.remove(self._table.with_name(record_files.OLDER_TOUCHES))

    def save(self) -> None:
        """What the disk does not take is only told. Waits for the disk."""
        with self._lock, contextlib.suppress(OSError):
            sealed_file.write(self._file, self._rows)
