"""How late this computer wakes a process that has a deadline, measured as the tick would see it."""

from __future__ import annotations

import contextlib
import gc
import os
import time
from array import array
from collections.abc import Iterator
from dataclasses import dataclass

PRIORITY = 70  # below a running tick's, which must not feel the measurement


@dataclass(frozen=True, slots=True)
class Measured:
    """Lateness of every deadline (s), sorted."""

    late_s: tuple[float, ...]
    real_time: bool = True

    @property
    def count(self) -> int:
        return len(self.late_s)

    @property
    def worst_s(self) -> float:
        return self.late_s[-1]

    def quantile_s(self, share: float) -> float:
        return self.late_s[min(int(share * self.count), self.count - 1)]

    def share_over(self, limit_s: float) -> float:
        """Share of the deadlines that were missed by more than that."""
        return sum(late > limit_s for late in self.late_s) / self.count


def measure(period_s: float, seconds: float, cpu: int | None = None) -> Measured:
    """Sleep from deadline to deadline for ``seconds``; on processor ``cpu`` where that is given."""
    with _like_the_tick(cpu) as real_time:
        late = _lateness(period_s, max(1, round(seconds / period_s)))
    return Measured(tuple(sorted(late)), real_time)


def _lateness(period_s: float, count: int) -> array[float]:
    """Deadlines lie on a grid; those slept through count as one."""
    late = array("d", bytes(8 * count))
    now, sleep = time.monotonic, time.sleep
    deadline = now() + period_s
    for n in range(count):
        left = deadline - now()
        if left > 0.0:
            sleep(left)
        late[n] = max(now() - deadline, 0.0)
        deadline += period_s * (1 + int(late[n] / period_s))
    return late


@contextlib.contextmanager
def _like_the_tick(cpu: int | None) -> Iterator[bool]:
    """Priority, processor, wakefulness and no garbage collection; gives whether it is real time."""
    scheduler, parameter = os.sched_getscheduler(0), os.sched_getparam(0)
    cpus = os.sched_getaffinity(0)
    with contextlib.ExitStack() as ending:
        with contextlib.suppress(OSError):
            awake = os.open("/dev/cpu_dma_latency", os.O_WRONLY)
            ending.callback(os.close, awake)
            os.write(awake, bytes(4))
        if cpu is not None:
            with contextlib.suppress(OSError):
                os.sched_setaffinity(0, {cpu})
                ending.callback(os.sched_setaffinity, 0, cpus)
        gc.disable()
        ending.callback(gc.enable)
        given = _fifo()
        if given:
            ending.callback(os.sched_setscheduler, 0, scheduler, parameter)
        yield given


def _fifo() -> bool:
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except OSError:
        return False
    return True


def as_real_time() -> bool:
    """Whether this process may have real-time priority; it does not keep it."""
    scheduler, parameter = os.sched_getscheduler(0), os.sched_getparam(0)
    given = _fifo()
    if given:
        os.sched_setscheduler(0, scheduler, parameter)
    return given
