"""Which cores tick and pump have to themselves, and who stays off them.

A core that the kernel was told to isolate (isolcpus=) is made for it: nothing runs there that has not
asked for it by name, which is why a process does not inherit it and has to ask. Without
one, a tick with real-time priority takes the last core that it is permitted: the first ones have the
interrupts. Without that priority it takes none, for on a core with others it could no longer be
moved out of their way; and never the only one, which the others need.

A core is claimed by a name in the abstract name space of sockets. That is free again as soon as its
owner is gone, whatever it died of, and keeps the ticks of two machines from meeting on one core.
"""

from __future__ import annotations

import os
import socket
from collections.abc import Collection, Sequence
from pathlib import Path

ISOLATED = "sys/devices/system/cpu/isolated"


def isolated(root: Path = Path("/")) -> list[int]:
    """Cores that the scheduler leaves alone, ascending."""
    try:
        return numbers((root / ISOLATED).read_text().strip())
    except OSError:
        return []


def numbers(text: str) -> list[int]:
    """A list of the kernel's, "2-3,7"."""
    spans = [part.split("-") for part in text.split(",") if part]
    return [number for span in spans for number in range(int(span[0]), int(span[-1]) + 1)]


def choice(permitted: Collection[int], alone: Sequence[int], real_time: bool) -> list[int]:
    """Cores for a tick, the best first.

    ``permitted``: the affinity that the process was started with; of the isolated ones (``alone``)
    it names those that somebody chose for it, and usually none.
    """
    if alone:
        return [cpu for cpu in alone if cpu in permitted] or list(alone)
    return sorted(permitted)[:0:-1] if real_time else []


def take(real_time: bool) -> int | None:
    """Move this process, for good, to a core that no other tick has; None where there is none for it."""
    permitted = os.sched_getaffinity(0)
    for cpu in choice(permitted, isolated(), real_time):
        if _moved({cpu}) and _claimed(cpu):
            return cpu
    _moved(permitted)
    return None


def give(process: int, real_time: bool) -> int | None:
    """Move another process (the pump) to a further such core; None where there is none for it.

    This process holds the claim, whose own core is left out by it.
    """
    permitted = os.sched_getaffinity(process)
    for cpu in choice(permitted, isolated(), real_time):
        if _moved({cpu}, process) and _claimed(cpu):
            return cpu
    _moved(permitted, process)
    return None


def leave() -> None:
    """Keep this process and those that it starts off the cores of tick and pump; only where two are left."""
    permitted = os.sched_getaffinity(0)
    best = choice(permitted, isolated(), True)
    for taken in (best[:2], best[:1]):
        others = permitted - set(taken)
        if len(others) >= 2:
            _moved(others)
            return


def _claimed(cpu: int) -> bool:
    own = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    try:
        own.bind(f"\0directrix-core-{cpu}")
    except OSError:
        own.close()
        return False
    own.detach()  # open as long as this process lives
    return True


def _moved(cpus: Collection[int], process: int = 0) -> bool:
    """Whether the kernel permits it; a control group may know fewer cores than the computer has."""
    try:
        os.sched_setaffinity(process, cpus)
    except OSError:
        return False
    return True
