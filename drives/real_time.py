"""How a process becomes as real-time as it may be: memory, timers, priority, processors that stay awake."""

from __future__ import annotations

import ctypes
import gc
import os
from collections.abc import Callable

TICK_PRIORITY = 80  # SCHED_FIFO
PUMP_PRIORITY = TICK_PRIORITY + 1  # what is due must not wait for what is computed

_PR_SET_NAME = 15
_PR_SET_TIMERSLACK = 29
_MCL_CURRENT_AND_FUTURE = 3


class Granted(dict[str, bool]):
    """Which of the real-time privileges this process was given."""

    def __and__(self, other: Granted) -> Granted:
        """What both were given."""
        return Granted({name: given and self.get(name, True) for name, given in other.items()})


def prepare(priority: int = TICK_PRIORITY, awake: bool = True) -> Granted:
    """Makes this process as real-time as it may be; call it once, when everything is built.

    What is not permitted is left out, and reported by what is returned: it runs without, only less evenly.
    ``awake``: the processors, too, as long as it lives.
    """
    gc.collect()
    gc.freeze()
    gc.disable()
    libc = ctypes.CDLL(None, use_errno=True)
    granted = Granted(
        locked=libc.mlockall(_MCL_CURRENT_AND_FUTURE) == 0,
        slack=libc.prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0) == 0,
        fifo=_permitted(lambda: os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))),
    )
    if awake:
        granted["awake"] = _permitted(_stay_awake)
    return granted


def name_process(name: str) -> None:
    """Sets the name that ``ps`` shows (15 characters)."""
    ctypes.CDLL(None).prctl(_PR_SET_NAME, name.encode(), 0, 0, 0)


def _stay_awake() -> None:
    """Keeps the processors out of deep sleep, as long as this process lives: waking up costs time."""
    descriptor = os.open("/dev/cpu_dma_latency", os.O_WRONLY)  # kept open: closing it takes the wish back
    os.write(descriptor, bytes(4))


def _permitted(act: Callable[[], None]) -> bool:
    try:
        act()
    except OSError:
        return False
    return True
