"""How long what a program waits for has taken on this machine, by the names of the waits; kept in the store.

What is expected of the next is the one in the middle of the last few; of one that has never come to pass what
the machine file makes likely (``plan/waits``).
"""

from __future__ import annotations

import contextlib
import sqlite3
import statistics
import threading
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from controller import sealed_file
from controller.plan.timetable import Event
from controller.store.service_store import ServiceStore, document_of

DOCUMENT = "durations"  # in the store
KEPT = 9  # of each wait the last so many
MAX_NAMES = 2000  # waits that are known by name


class Durations:
    """How long waits took in the last runs of this machine, by their names; any thread."""

    def __init__(self, known: dict[str, list[float]], store: ServiceStore | None = None) -> None:
        """``known``: what was kept; ``store``: where what is learned is kept, None: nowhere."""
        self._known, self._store, self._lock = known, store, threading.Lock()
        self._usual = {name: statistics.median(took) for name, took in known.items()}
        self._changed = False

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
            if self._changed and self._store is not None:
                self._store.put(DOCUMENT, self._known)
                self._changed = False


def of_service(store: ServiceStore) -> Durations:
    """Of the service, which learns. Raises OSError."""
    return Durations(store.document(DOCUMENT, taken, dict[str, list[float]]()), store)


def of_state(state: Path) -> Durations:
    """For who only reads; what cannot be read is to him as if nothing was known."""
    try:
        return Durations(taken(document_of(state, DOCUMENT)))
    except (*sealed_file.UNREADABLE, sqlite3.Error):
        return Durations({})


def taken(kept: Any) -> dict[str, list[float]]:
    """Raises ValueError or TypeError for anything but what is saved."""
    if not isinstance(kept, dict) or not all(kept.values()):
        raise TypeError("no durations")
    return {str(name): [float(one) for one in took][-KEPT:] for name, took in kept.items()}
