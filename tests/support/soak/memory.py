"""Memory of the processes of a machine that runs on: sampled after each run, and whether it grows.

A process takes what it takes when it does a thing for the first time (modules, caches up to their bound),
and the program that lies in it now, long or short, moves its memory up and down by ten megabytes. A leak is
what it holds whatever lies in it: the least of every two minutes, and the median of all slopes between two
of these (Theil, Sen), which a few steps do not move.
"""

from __future__ import annotations

import functools
import gc
from pathlib import Path
from typing import NamedTuple

import numpy as np

from controller import memory

SETTLES_S = 60.0  # of a process' life: then memory is what it is
TELLS_S = 1200.0  # looked at for so long a slope tells
MOST_MB_H = 4.0
LEAST_OF_S = 120.0


class Growth(NamedTuple):
    """Of one process: anonymous memory (MB) of its first and last sample, and how it grew between them."""

    seen_s: float
    first_mb: float
    last_mb: float
    mb_h: float

    @property
    def is_flat(self) -> bool:
        return self.seen_s < TELLS_S or self.mb_h <= MOST_MB_H


class Memory:
    """``look`` after each run; ``growth`` of each process that was seen more than once, by role and pid."""

    def __init__(self) -> None:
        self._samples: dict[tuple[str, int], list[tuple[float, float]]] = {}
        self._begun_s: dict[tuple[str, int], float] = {}

    def look(self, pids: dict[str, int], now_s: float) -> None:
        """``pids`` by role, as they are now."""
        for one in pids.items():
            begun_s = self._begun_s.setdefault(one, now_s)
            if now_s - begun_s >= SETTLES_S and (taken := anonymous_mb(one[1])) is not None:
                self._samples.setdefault(one, []).append((now_s, taken))

    def growth(self) -> dict[str, Growth]:
        return {f"{role} {pid}": growth_of(found) for (role, pid), found in self._samples.items()}


def growth_of(samples: list[tuple[float, float]]) -> Growth:
    """``samples``: (s, MB) in the order of time, one at least."""
    least: dict[int, tuple[float, float]] = {}
    for at, mb in samples:
        n = int((at - samples[0][0]) / LEAST_OF_S)
        least[n] = min(least.get(n, (at, mb)), (at, mb), key=lambda one: one[1])
    at_s, taken_mb = np.array(list(least.values())).T
    i, j = np.triu_indices(len(at_s), 1)
    mb_h = 3600.0 * float(np.median((taken_mb[j] - taken_mb[i]) / (at_s[j] - at_s[i]))) if len(i) else 0.0
    (first_s, first_mb), (last_s, last_mb) = samples[0], samples[-1]
    return Growth(last_s - first_s, first_mb, last_mb, mb_h)


def give_back() -> None:
    """All that a run has left in this process and that is no leak.

    A soak meets an ever new machine and part, so caches with a bound would fill for an hour. Each run finds
    them empty, as in a process of its own; what one without a bound keeps is a leak. Replay, as a command
    whose process ends with it, freezes what is there, and has glibc keep up to 128 MB of what is freed.
    """
    gc.unfreeze()
    gc.collect()
    for one in gc.get_objects():
        if type(one) is functools._lru_cache_wrapper and one.cache_parameters()["maxsize"] is not None:
            one.cache_clear()
    gc.collect()
    memory.give_back()


def anonymous_mb(pid: int | str = "self") -> float | None:
    """What is a process' own; None where there is none any more."""
    try:
        rows = Path(f"/proc/{pid}/status").read_text(encoding="ascii").splitlines()
    except OSError:
        return None
    return next((int(row.split()[1]) / 1024.0 for row in rows if row.startswith("RssAnon")), None)
