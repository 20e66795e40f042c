"""How long what a program waits for has taken on this machine, by the names of the waits; kept on the disk.

What is expected of the next is the one in the middle of the last few; of one that has never come to pass what
the machine file makes likely (``plan/waits``).
"""

from __future__ import annotations

import contextlib
import statistics
import threading
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from controller import sealed_file
from controller.messages import Message
from controller.plan.timetable import Event
from controller.service import kept_file

FILE = "durations.json"
KEPT = 9  # of each wait the last so many
MAX_NAMES = 2000  # waits that are known by name


class Durations:
    """How long waits took in the last runs of this machine, by their names; any thread."""

    def __init__(self, state: Path, own: bool = True) -> None:
        """``own``: of the service, which puts aside what cannot be read; to others it is as if it were not
        there.
        """
        self._file, self._lock = state / FILE, threading.Lock()
        self._known: dict[str, list[float]]
        self._known, self.damaged = self._read(own)
        self._usual = {name: statistics.median(took) for name, took in self._known.items()}
        self._changed = False

    def _read(self, own: bool) -> tuple[dict[str, list[float]], Message | None]:
        missing = dict[str, list[float]]()
        if own:
            return kept_file.read(self._file, _taken, missing)
        try:
            return _taken(sealed_file.read(self._file)), None
        except kept_file.WRONG:
            return missing, None

    def of(self, event: Event) -> float:
        """What a wait is expected to take."""
        return self._usual.get(event.wait.name, event.wait.seconds)

    def sum_s(self, events: Iterable[Event]) -> float:
        """Of all of them."""
        return sum(map(self.of, events))

    def learn(self, name: str, seconds: float) -> None:
        """What one has taken."""
        with self._lock:
            took = [*self._known.pop(name, ()), round(seconds, 4)][-KEPT:]
            self._known[name] = took
            self._usual[name] = statistics.median(took)
            if len(self._known) > MAX_NAMES:
                del self._usual[next(iter(self._known))], self._known[next(iter(self._known))]
            self._changed = True

    def save(self) -> None:
        """What the disk does not take is learned anew. Waits for the disk."""
        with self._lock, contextlib.suppress(OSError):
            if self._changed:
                sealed_file.write(self._file, self._known)
                self._changed = False


def _taken(kept: Any) -> dict[str, list[float]]:
    """Raises ValueError or TypeError for anything but what is saved."""
    if not isinstance(kept, dict) or not all(kept.values()):
        raise TypeError("no durations")
    return {str(name): [float(one) for one in took][-KEPT:] for name, took in kept.items()}
