"""Whether the computer was away from its guest, by the computer's own figures.

In a guest a test may fail because nothing of the guest was run for a while. Two figures say so, second by
second: a watcher before all other processes of the guest, which wakes every ``PERIOD_S``, is late by as
long as its kernel was not run; and ``run`` copies the line "cpu" of the computer's /proc/stat, whose
column "steal" is the time that a hypervisor kept from it (Linux, proc(5)). The guest's own load makes
neither: what happens in a time without such figures is the machine's doing, and no reason to begin anew.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import held_up

RECORD = Path("/run/absence")
PERIOD_S = 0.01
LATE_S = 0.02  # two TPDOs at the guest's period: what it takes to lose a drive's feedback
STOLEN = held_up.MOST  # of the processors' time
LOOK_BACK_S = 10.0  # from a fault's being seen to its cause: the stop, the look at the log


@dataclass(frozen=True)
class Figures:
    """What was kept from the guest in some seconds, or in one that ended at ``at_s`` (CLOCK_MONOTONIC)."""

    at_s: float = 0.0
    late_s: float = 0.0  # the watcher's latest awakening
    late_ticks: int = 0  # its awakenings later than LATE_S
    stolen: float = 0.0  # 0 to 1; the worst second's

    def away(self) -> bool:
        """Whether the computer was away for long enough to fail a machine that is sound."""
        return self.late_ticks > 0 or self.stolen > STOLEN

    def __str__(self) -> str:
        was = "away" if self.away() else "there"
        return (
            f"the computer was {was}: {self.late_ticks} ticks of {1e3 * PERIOD_S:.0f} ms came late, "
            f"at most by {1e3 * self.late_s:.0f} ms; {100 * self.stolen:.0f} % of its time was stolen"
        )


def figures() -> Figures:
    """Of the last ``LOOK_BACK_S``; waits for the second that has begun. AssertionError when nobody watches."""
    asked_s = time.monotonic()
    while not (seconds := read(RECORD.read_text())) or seconds[-1].at_s < asked_s:
        assert time.monotonic() < asked_s + LOOK_BACK_S, "nobody watches over the guest"
        time.sleep(PERIOD_S)
    return since(asked_s - LOOK_BACK_S)


def since(began_s: float) -> Figures:
    """Of the whole seconds since then (CLOCK_MONOTONIC)."""
    return worst(second for second in read(RECORD.read_text()) if second.at_s > began_s)


def read(text: str) -> list[Figures]:
    """The record's whole lines; the watcher may be writing another."""
    whole = text[: text.rfind("\n") + 1].splitlines()
    rows = [line.split() for line in whole]
    return [Figures(float(at), float(late), int(ticks), float(stolen)) for at, late, ticks, stolen in rows]


def worst(seconds: Iterable[Figures]) -> Figures:
    """Of several seconds."""
    found = Figures()
    for second in seconds:
        late_s, stolen = max(found.late_s, second.late_s), max(found.stolen, second.stolen)
        found = Figures(second.at_s, late_s, found.late_ticks + second.late_ticks, stolen)
    return found


@contextlib.contextmanager
def watched() -> Iterator[None]:
    """With a watcher, which has begun."""
    RECORD.unlink(missing_ok=True)
    watcher = subprocess.Popen([sys.executable, __file__])
    try:
        while not RECORD.exists():
            assert watcher.poll() is None, "the watcher over the guest has ended"
            time.sleep(PERIOD_S)
        yield
    finally:
        watcher.kill()
        watcher.wait()


def watch() -> None:
    """A line for each second, for good."""
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(os.sched_get_priority_max(os.SCHED_FIFO)))
    before, late = held_up.times(), lates()
    with RECORD.open("w", buffering=1) as record:
        while True:
            lates_s = list(itertools.islice(late, round(1.0 / PERIOD_S)))
            after = held_up.times()
            late_ticks = sum(late_s > LATE_S for late_s in lates_s)
            stolen = held_up.share(before, after)
            record.write(f"{time.monotonic():.3f} {max(lates_s):.4f} {late_ticks} {stolen:.4f}\n")
            before = after


def lates() -> Iterator[float]:
    """By how much (s) each awakening on a grid of ``PERIOD_S`` was late; a late one begins another grid."""
    due_s = time.monotonic()
    while True:
        due_s += PERIOD_S
        time.sleep(max(0.0, due_s - time.monotonic()))
        late_s = time.monotonic() - due_s
        due_s += late_s if late_s > PERIOD_S else 0.0
        yield late_s


if __name__ == "__main__":
    watch()
