"""Whether the computer was away from its guest, by the computer's own figures.

In a guest a test may fail because the guest was not run for a while. Four figures say so, second by second:
- a watcher before all other processes of the guest, which wakes every ``PERIOD_S``, is late by as long as
  the guest's kernel was not run;
- the guest's processes are processes of the computer, which says how long they waited for their turn;
- the column "steal" of its core in /proc/stat is what a hypervisor kept from it (Linux, proc(5)).
- the simulated drives stand for hardware, which is never late, and go before all but the tick: how long
  the last of them took to answer a SYNC, by the kernel's time stamps.
Steal and waiting come from host_figures.py. The guest's own load makes none of them: what happens in a time
without such figures is the machine's doing, and no reason to begin anew.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from guest import host_figures
from support.suite import absent_computer

from drives import pdo

RECORD = Path("/run/absence")
PERIOD_S = 0.01
LATE_S = 0.01  # the period of the guest's machines: by so much, and a tick did not take place
STOLEN = absent_computer.MOST  # of the processors' time
WAITED = 0.1  # of a second; 0.03 to 0.06 beside eight busy programs on two cores
SILENT_S = 0.2  # drives that take longer were off, or not operational
SO_TIMESTAMPNS = 35  # asm-generic/socket.h
ANSWERED_S = 0.0075  # 3 ms are usual; a tick of 10 ms misses what takes longer
INTERFACE, LAST_NODE = "vcan0", 5  # where the drives are, and the one that answers last
LOOK_BACK_S = 6.0  # from a fault at rest to its cause: the stop, and its recording


@dataclass(frozen=True)
class Figures:
    """What was kept from the guest in some seconds, or in one that ended at ``at_s`` (CLOCK_MONOTONIC)."""

    at_s: float = 0.0
    late_s: float = 0.0  # the watcher's latest awakening
    late_ticks: int = 0  # its awakenings later than LATE_S
    stolen: float = 0.0  # 0 to 1; the worst second's
    waited: float = 0.0  # 0 to 1; the worst second's
    answered_s: float = 0.0  # the drives' longest answer

    def away(self) -> bool:
        """Whether the computer was away for long enough to fail a machine that is sound."""
        slow = self.answered_s > ANSWERED_S
        return self.late_ticks > 0 or slow or self.stolen > STOLEN or self.waited > WAITED

    def __str__(self) -> str:
        was = "away" if self.away() else "there"
        return (
            f"the computer was {was}: {self.late_ticks} ticks of {1e3 * PERIOD_S:.0f} ms came late, "
            f"at most by {1e3 * self.late_s:.0f} ms; in the worst second the guest waited for its turn for "
            f"{1e3 * self.waited:.0f} ms, and {100 * self.stolen:.0f} % of its core's time was stolen; "
            f"the drives answered within {1e3 * self.answered_s:.1f} ms"
        )


def figures() -> Figures:
    """Of the last ``LOOK_BACK_S``; waits for the end of this second. AssertionError when nobody watches."""
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
    return [
        Figures(float(at), float(late), int(ticks), *map(float, shares)) for at, late, ticks, *shares in rows
    ]


def worst(seconds: Iterable[Figures]) -> Figures:
    """Of several seconds."""
    found = Figures()
    for second in seconds:
        late_s, stolen = max(found.late_s, second.late_s), max(found.stolen, second.stolen)
        ticks, waited = found.late_ticks + second.late_ticks, max(found.waited, second.waited)
        answered_s = max(found.answered_s, second.answered_s)
        found = Figures(second.at_s, late_s, ticks, stolen, waited, answered_s)
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
    before, host_before, late = (
        absent_computer.times(),
        host_figures.read(absent_computer.STAT.read_text()),
        lates(),
    )
    bus, answers = listening(INTERFACE), Answers()
    with RECORD.open("w", buffering=1) as record:
        while True:
            lates_s = list(itertools.islice(late, round(1.0 / PERIOD_S)))
            after, host_after = absent_computer.times(), host_figures.read(absent_computer.STAT.read_text())
            late_ticks = sum(late_s > LATE_S for late_s in lates_s)
            stolen = absent_computer.share(before, after)
            waited = _share(host_before, host_after)
            record.write(
                f"{time.monotonic():.3f} {max(lates_s):.4f} {late_ticks} {stolen:.4f} {waited:.4f} "
                f"{answers.longest_s(came(bus)):.4f}\n"
            )
            before, host_before = after, host_after


def _share(before: tuple[float, float], after: tuple[float, float]) -> float:
    return (after[0] - before[0]) / max(host_figures.EVERY_S, after[1] - before[1])


class Answers:
    """How long drives take for their answers to SYNC."""

    def __init__(self) -> None:
        self._asked_s: float | None = None  # the first SYNC that has no answer yet

    def longest_s(self, frames: Iterable[tuple[float, int]]) -> float:
        """Of those that have come, with their times; drives that are off or not operational give none."""
        longest_s = 0.0
        for at_s, can_id in frames:
            if can_id == pdo.SYNC:
                self._asked_s = at_s if self._asked_s is None else self._asked_s
            elif self._asked_s is not None:
                taken_s, self._asked_s = at_s - self._asked_s, None
                longest_s = max(longest_s, taken_s if taken_s < SILENT_S else 0.0)
        return longest_s


def listening(interface: str) -> socket.socket:
    """For SYNC and the last drive's answer, with the kernel's time stamps."""
    found = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    wanted = (pdo.SYNC, pdo.TPDO1 + LAST_NODE)
    exactly = b"".join(struct.pack("=II", can_id, 0x7FF) for can_id in wanted)
    found.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, exactly)
    found.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
    found.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
    found.bind((interface,))
    found.setblocking(False)
    return found


def came(bus: socket.socket) -> Iterator[tuple[float, int]]:
    """Frames that have come, each with its time (s) and identifier, as long as the interface is up."""
    with contextlib.suppress(OSError):
        while True:
            frame, stamps, _, _ = bus.recvmsg(pdo.FRAME.size, 64)
            seconds, nanoseconds = struct.unpack("qq", stamps[0][2])
            yield seconds + 1e-9 * nanoseconds, pdo.FRAME.unpack(frame)[0]


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
