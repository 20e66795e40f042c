"""A tool that stands in a thread: nothing moves it but along that thread, whatever has stopped it.

Kept in the service's store from the first turn into a thread until the last one out of it, so that it is
known after a loss of power, too:

    {"turns": 7.4, "pitch_mm": 1.0, "line": 12, "program": "plate.ngc"}

``turns`` are signed as M3 turns, ``pitch_mm`` is of the way. Out of it leads ``way_out``: a line that turns
the spindle back and takes the axis along.
"""

from __future__ import annotations

import contextlib
import math
from typing import Any, NamedTuple

from controller.ipc.handoff import Snapshot
from controller.machine.model import Machine
from controller.store.service_store import ServiceStore

DOCUMENT = "thread"  # in the store; null: in none
REV_MIN = 60.0  # of the spindle on the way out
BEYOND_MM = 1.0  # the thread's own end, so that the tap is free
SAVE_REV = 1.0  # a loss of power costs so much of what is known
OUT_REV = 0.05  # less is not in it


class InThread(NamedTuple):
    """Where the tool stands."""

    turns: float
    pitch_mm: float
    line: int
    program: str

    @property
    def depth_mm(self) -> float:
        return abs(self.turns) * self.pitch_mm

    @property
    def facts(self) -> dict[str, Any]:
        return {**self._asdict(), "depth_mm": self.depth_mm}


UNKNOWN = InThread(0.0, 0.0, 0, "")  # it was in one, and nobody knows how far


class ThreadGuard:
    """Call ``look`` with every snapshot; read ``found``."""

    def __init__(self, store: ServiceStore) -> None:
        """Raises OSError."""
        self._store = store
        self.found = store.document(DOCUMENT, taken, None)
        if not store.has(DOCUMENT):
            self.save()  # so that a loss of what comes next is noticed
        elif not store.is_newest(DOCUMENT):
            self.found = UNKNOWN
            self.save()
        self._saved = self.found

    def look(self, now: Snapshot, program: str) -> None:
        """What the tick says of it. A tick that has just begun knows nothing of a thread before it."""
        if abs(now.thread_rev) > OUT_REV:
            self.found = InThread(now.thread_rev, abs(now.thread_pitch_mm), now.line, program)
            if self._saved is None or abs(self._saved.turns - self.found.turns) >= SAVE_REV:
                self.save()
        elif self.found is not None and now.thread_pitch_mm:
            self.is_out()

    def is_out(self) -> None:
        """It has been withdrawn, by us or by hand."""
        self.found = None
        self.save()

    def save(self) -> None:
        """As it is now, on a full disk, too; what no disk takes is saved with the next."""
        self._saved = self.found
        with contextlib.suppress(OSError):
            self._store.keep(DOCUMENT, self.found and self.found._asdict())


def taken(values: Any) -> InThread | None:
    """Raises ValueError, KeyError or TypeError for anything but what is saved."""
    if values is None:
        return None
    found = InThread(
        float(values["turns"]), float(values["pitch_mm"]), int(values["line"]), str(values["program"])
    )
    if not math.isfinite(found.depth_mm):
        raise ValueError("a depth that is no number")
    return found


def way_out(machine: Machine, found: InThread, millimetres: float | None = None) -> str:
    """The lines that turn the tool out along its axis; by the depth that is known, or so far."""
    most = machine.spindle.max_rev_min if machine.spindle is not None else REV_MIN
    length = found.depth_mm + BEYOND_MM if millimetres is None else millimetres
    pitch = -found.pitch_mm if found.turns > 0.0 else found.pitch_mm
    plane = ["G68.3 X0 Y0 Z0 R0"] if machine.rotary() else []
    return "\n".join(
        [
            "G21 G17 G40 G49 G90 G94 M5",
            *plane,
            f"G91 S{min(REV_MIN, most):.3f}",
            f"G33 Z{length:.6f} K{pitch:.6f}",
            "G90 G69",
        ]
    )
