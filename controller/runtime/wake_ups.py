"""How late this computer wakes who has a deadline, and how evenly SYNC leaves it, counted in bounded memory.

Nothing is kept of a tick but a count: hours of periods of 0.5 ms take as much room as a second of them.

    late = Histogram()
    given = turn(period_s=0.001, seconds=60.0, into=late, cpu=3)
    late.quantile_s(0.999), late.worst_s, late.share_over(0.00025)
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import math
import os
import resource
import select
import time
from array import array
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from controller.tick import loop
from controller.tick.sync_watch import LATE_SHARE as LATE_SHARE
from drives import bus, pdo
from drives.settings import BusSettings

BIN_S = 1e-6
BINS = 20_000  # 20 ms; what is beyond is counted, and the largest of it known
PRIORITY = 70  # below a running tick's, which must not feel the measurement
MAY_BE_LATE = 1e-3  # share of the ticks that may come too late to send
SYNC_FILTERS = ((pdo.SYNC, 0x7FF),)
LISTEN_MS = 50
_EXACT = 1e-9  # s, below the clock's own step
_CURRENT = 1  # MCL_CURRENT


class Histogram:
    """Counts of times in bins of 1 us. A bin has its lower end, and not its upper one."""

    __slots__ = ("beyond", "bins", "count", "worst_s")

    def __init__(self) -> None:
        self.bins = array("Q", bytes(8 * BINS))
        self.beyond = 0  # times of ``BINS`` us and more
        self.count = 0
        self.worst_s = 0.0  # exact

    def add(self, time_s: float) -> None:
        """Count one; a negative one is none late."""
        self.put(max(int((time_s + _EXACT) / BIN_S), 0), 1)
        if time_s > self.worst_s:
            self.worst_s = time_s

    def reach(self, worst_s: float) -> None:
        """One of those that were ``put`` was as long as that."""
        self.worst_s = max(self.worst_s, worst_s)

    def put(self, microseconds: int, count: int) -> None:
        """Count so many of one bin; how long the longest was, ``reach`` says."""
        if microseconds < BINS:
            self.bins[microseconds] += count
        else:
            self.beyond += count
        self.count += count

    def merge(self, other: Histogram) -> None:
        """Add what another one has counted."""
        for n, count in enumerate(other.bins):
            if count:
                self.bins[n] += count
        self.beyond += other.beyond
        self.count += other.count
        self.reach(other.worst_s)

    def quantile_s(self, share: float) -> float:
        """The time (s) that this share of all stays below, to 1 us and never too small; 0 of none."""
        left = min(int(share * self.count), self.count - 1)
        for n, count in enumerate(self.bins):
            left -= count
            if left < 0 and count:
                return min((n + 1) * BIN_S, self.worst_s)
        return self.worst_s

    def over(self, limit_s: float) -> int:
        """How many were as long as that or longer; by less than 1 us too many, never too few."""
        first = min(max(int((limit_s + _EXACT) / BIN_S), 0), BINS)
        return sum(self.bins[first:]) + self.beyond

    def share_over(self, limit_s: float) -> float:
        """Their share of all; 0 of none."""
        return self.over(limit_s) / self.count if self.count else 0.0

    def classes(self, per_decade: int) -> list[tuple[float, float, int]]:
        """(from, to, count) in us, in classes that grow by the same factor; to is inf for what is beyond."""
        decades = math.log10(BINS)
        inner = {round(10.0 ** (n / per_decade)) for n in range(math.ceil(per_decade * decades))}
        edges = [0, *sorted(edge for edge in inner if edge < BINS), BINS]
        found = [(float(low), float(high), sum(self.bins[low:high])) for low, high in pairwise(edges)]
        return [*found, (float(BINS), math.inf, self.beyond)]


@dataclass(frozen=True, slots=True)
class Given:
    """What a turn was given, and what it met."""

    real_time: bool
    minor_faults: int = 0  # pages that were there, and had to be found
    major_faults: int = 0  # pages that had to be fetched


# --- turns -----------------------------------------------------------------------------------


def turn(
    period_s: float, seconds: float, into: Histogram, cpu: int | None = None, clock: loop.Clock | None = None
) -> Given:
    """Sleep from deadline to deadline, as the tick does; on processor ``cpu`` where that is given."""
    count = max(1, round(seconds / period_s))
    return _in_a_turn(cpu, lambda: wake_ups(period_s, count, into, clock or loop.WallClock()))


def wake_ups(period_s: float, count: int, into: Histogram, clock: loop.Clock) -> None:
    """Count the lateness of ``count`` deadlines on a grid; those slept through count as one."""
    now_s, wake, add = clock.now_s, clock.wake, into.add
    deadline_s = now_s() + period_s
    for _ in range(count):
        wake(deadline_s, 0.0)
        late_s = max(now_s() - deadline_s, 0.0)
        add(late_s)
        deadline_s += period_s * (1 + int(late_s / period_s))


def sync_turn(
    period_s: float,
    seconds: float,
    senders: Sequence[bus.Port],
    echoes: Sequence[Echoes],
    cpu: int | None = None,
    clock: loop.Clock | None = None,
) -> Given:
    """Send SYNC on these buses as the tick does, and count its echoes."""
    count = max(1, round(seconds / period_s))
    return _in_a_turn(cpu, lambda: send_syncs(period_s, count, senders, echoes, clock or loop.WallClock()))


def send_syncs(
    period_s: float, count: int, senders: Sequence[bus.Port], echoes: Sequence[Echoes], clock: loop.Clock
) -> None:
    """SYNC at ``count`` deadlines; as in the tick, one that is a quarter of a period late is left out."""
    frame, early_s, latest_s = pdo.frame(pdo.SYNC), loop.early_s(period_s), LATE_SHARE * period_s
    for echo in echoes:
        echo.begin()
    deadline_s = clock.now_s() + period_s
    for _ in range(count):
        clock.wake(deadline_s, early_s)
        late_s = clock.spin(deadline_s) - deadline_s
        if late_s <= latest_s:
            for sender in senders:
                sender.send(frame)
        for echo in echoes:
            echo.drain()
        deadline_s += period_s * (1 + int(max(late_s, 0.0) / period_s))


def _in_a_turn(cpu: int | None, act: Callable[[], None]) -> Given:
    with like_the_tick(cpu) as real_time:
        before = resource.getrusage(resource.RUSAGE_SELF)
        act()
        after = resource.getrusage(resource.RUSAGE_SELF)
    return Given(real_time, after.ru_minflt - before.ru_minflt, after.ru_majflt - before.ru_majflt)


@contextlib.contextmanager
def like_the_tick(cpu: int | None) -> Iterator[bool]:
    """Priority, processor, locked memory, wakefulness, no garbage collection; whether it is real time."""
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
        libc = ctypes.CDLL(None, use_errno=True)
        if libc.mlockall(_CURRENT) == 0:
            ending.callback(libc.munlockall)
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


def may_be_real_time() -> bool:
    """Whether this process may have real-time priority; it does not keep it."""
    scheduler, parameter = os.sched_getscheduler(0), os.sched_getparam(0)
    given = _fifo()
    if given:
        os.sched_setscheduler(0, scheduler, parameter)
    return given


# --- SYNC as it left -------------------------------------------------------------------------


class Echoes:
    """SYNCs of one bus by the kernel's time stamps: how far each interval is off the period (s)."""

    def __init__(self, port: bus.CanSocket, period_s: float) -> None:
        """``port`` hears nothing but SYNC."""
        self.off = Histogram()
        self.heard = 0
        self.port = port
        self._period_s = period_s
        self._buffer = bytearray(pdo.FRAME_BYTES)
        self._last_s: float | None = None
        self._overflows = port.overflows

    def begin(self) -> None:
        """What was before is forgotten: the next interval begins with the next SYNC."""
        while self.port.receive_stamped(self._buffer) is not None:
            pass
        self._last_s, self._overflows = None, self.port.overflows

    def drain(self) -> None:
        """Count what has come. Where the kernel had no room for some, that interval is none."""
        while (at_s := self.port.receive_stamped(self._buffer)) is not None:
            if pdo.unpack(self._buffer)[0] != pdo.SYNC:
                continue  # the controller of the bus tells of an error
            self.heard += 1
            if self._last_s is not None and self.port.overflows == self._overflows:
                self.off.add(abs(at_s - self._last_s - self._period_s))
            self._last_s, self._overflows = at_s, self.port.overflows


@contextlib.contextmanager
def echoes_of(buses: Iterable[BusSettings], period_s: float) -> Iterator[dict[str, Echoes]]:
    """Echoes of each of these buses that is SocketCAN's, by name. Raises BusError."""
    with contextlib.ExitStack() as ending:
        found: dict[str, Echoes] = {}
        for one in buses:
            if one.interface == "socketcan":
                port = bus.open(one, SYNC_FILTERS)
                ending.callback(port.close)
                found[one.name] = Echoes(port, period_s)  # type: ignore[arg-type]
        yield found


def listen(echoes: Sequence[Echoes], seconds: float) -> None:
    """Count what others send for a while; who listens may be late, the time stamps are the kernel's."""
    poll = select.poll()
    for echo in echoes:
        poll.register(echo.port.fileno(), select.POLLIN)
    ends_s = time.monotonic() + seconds
    while (left_s := ends_s - time.monotonic()) > 0.0:
        poll.poll(min(LISTEN_MS, 1e3 * left_s))
        for echo in echoes:
            echo.drain()
