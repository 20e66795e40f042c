"""What a computer must be and have to run a machine: each a line, pass or fail, with the remedy.

Nothing here changes anything. Where the machine is running, its tick process is looked at;
otherwise this process tries what the tick would ask for. Folders of the kernel (/proc, /sys, /dev) are
read below ``root``, so that tests bring their own.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import json
import os
import shutil
import stat
import subprocess
import time
from array import array
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from controller.ipc import control_socket
from controller.machine.model import Bus, Machine
from controller.runtime import cores
from controller.values import dataclass
from controller.verify.console import say

TICK_NAME = "directrix-tick"  # as `ps` shows it
AWAKE = "/dev/cpu_dma_latency"
MIN_QUEUE = 128  # frames
MIN_FREE = 1 << 30  # bytes
ERRORS_ALLOWED = 96  # CiA 301 and ISO 11898: from here on a controller warns
GOOD_CLOCKS = ("tsc", "arch_sys_counter", "kvm-clock", "hyperv_clocksource_tsc_page")
MAY_BE_LATE = 1e-3  # share of the ticks
ANSWER_S = 5.0
_UNSYNCHRONISED = 0x40  # STA_UNSYNC, linux/timex.h
_CURRENT = 1  # MCL_CURRENT


@dataclass(frozen=True, slots=True)
class Line:
    """One thing that was looked at."""

    what: str
    passed: bool
    found: str
    remedy: str = ""  # "" where it passed
    bus: str = ""  # whose it is, if of one

    @property
    def name(self) -> str:
        """Of the line, whatever language is spoken."""
        return f"{self.bus} {self.what}".strip()

    @property
    def shown(self) -> str:
        """The name for people."""
        return f"{self.bus} {_say('name.' + self.what.replace(' ', '_'))}".strip()

    def to_dict(self) -> dict[str, Any]:
        return {"name": self.name, "passed": self.passed, "found": self.found, "remedy": self.remedy}


def run(machine: Machine, state: Path, seconds: float, root: Path = Path("/")) -> list[Line]:
    """All lines; takes ``seconds`` for the latency where no tick is asked for its own."""
    tick = tick_process(root)
    running = _asked(state) if tick is not None else None
    return [
        _latency(machine.period_s, seconds, root) if running is None else kept(running),
        memory(tick, root),
        priority(tick),
        own_core(tick, root),
        governor(root),
        sleep_states(tick, root),
        *(line for bus in machine.buses if bus.interface == "socketcan" for line in can(bus, told(bus))),
        disk(state),
        clock_source(root),
        clock_set(),
    ]


def tick_process(root: Path) -> int | None:
    """Process id of a running tick."""
    for folder in (root / "proc").glob("[0-9]*"):
        if _text(folder / "comm") == TICK_NAME:
            return int(folder.name)
    return None


def _text(path: Path) -> str:
    """Of a file of the kernel, without its line end; "" where it is not there or not for us."""
    try:
        return path.read_text().strip()
    except OSError:
        return ""


def _line(what: str, passed: bool, found: str, remedy: str, bus: str = "") -> Line:
    return Line(what, passed, found, "" if passed else remedy, bus)


def _say(key: str, **values: object) -> str:
    return say(f"self_test.{key}", **values)


# --- the processor -------------------------------------------------------------------------


def _asked(state: Path) -> dict[str, float] | None:
    """What the running tick says of itself; None where it cannot be asked."""
    client = control_socket.Client(
        control_socket.control_path(control_socket.runtime_of(state)), longest_s=ANSWER_S
    )
    try:
        tick = dict(client.ask("status")["tick"])
        return tick if tick["number"] is not None else None  # none yet
    except (control_socket.CommandRefused, KeyError):
        return None
    finally:
        client.close()


def kept(tick: dict[str, float]) -> Line:
    """The deadlines of a running tick: it has its core for itself, to measure beside it would say less."""
    skipped = tick["skips"] / max(tick["number"], 1)
    figures = {"worst": 1e3 * tick["late_max_ms"], "percent": 100.0 * skipped, "period": tick["period_ms"]}
    found = _say("kept", ticks=tick["number"], **figures)
    return _line("latency", skipped <= MAY_BE_LATE, found, _say("quicker"))


def _latency(period_s: float, seconds: float, root: Path) -> Line:
    alone = _permitted_of(cores.isolated(root))
    return latency_line(measure(period_s, seconds, alone[0] if alone else None), period_s)


def latency_line(measured: Measured, period_s: float) -> Line:
    """A tick more than a quarter of a period late is skipped: at most one in a thousand may be."""
    late = measured.share_over(period_s / 4.0)
    figures = {"worst": 1e6 * measured.worst_s, "p99": 1e6 * measured.quantile_s(0.99)}
    figures |= {"percent": 100.0 * late, "ticks": measured.count, "period": 1e3 * period_s}
    found = _say("measured" if measured.real_time else "measured_without", **figures)
    return _line("latency", late <= MAY_BE_LATE, found, _say("quicker"))


def memory(tick: int | None, root: Path) -> Line:
    """A page that has to be fetched is a tick that is lost."""
    if tick is not None:
        locked = _field(_text(root / f"proc/{tick}/status"), "VmLck").split()
        kilobytes = int(locked[0]) if locked else 0
        found = _say("locked", kilobytes=kilobytes)
        return _line("locked memory", kilobytes > 0, found, _say("under_systemd"))
    libc = ctypes.CDLL(None, use_errno=True)
    locks = libc.mlockall(_CURRENT) == 0
    libc.munlockall()
    found = _say("permitted" if locks else "not_permitted")
    return _line("locked memory", locks, found, _say("under_systemd"))


def _field(text: str, name: str) -> str:
    """Of a file of lines ``name: value``."""
    return next(
        (line.split(":", 1)[1].strip() for line in text.splitlines() if line.startswith(f"{name}:")), ""
    )


def priority(tick: int | None) -> Line:
    """SCHED_FIFO, so that only interrupts go before the tick."""
    if tick is not None:
        fifo = os.sched_getscheduler(tick) & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO
        level = os.sched_getparam(tick).sched_priority
        found = _say("runs_fifo" if fifo else "runs_without", level=level)
        return _line("priority", fifo, found, _say("under_systemd"))
    may = as_real_time()
    return _line("priority", may, _say("may_fifo" if may else "may_not_fifo"), _say("under_systemd"))


def own_core(tick: int | None, root: Path) -> Line:
    """A core that nobody else uses, for the tick alone."""
    alone = cores.isolated(root)
    where = sorted(os.sched_getaffinity(tick)) if tick is not None else _permitted_of(alone)
    key = "isolated_tick" if tick is not None else "isolated_permitted" if alone else "isolated"
    found = _say(key, cores=_listed(alone), where=_listed(where))
    passed = bool(where) and set(where) <= set(alone)
    return _line("own core", passed, found, _say("may_have_it" if alone else "isolate"))


def _listed(numbers: Sequence[int]) -> str:
    return ", ".join(map(str, numbers)) or _say("none")


def _permitted_of(cpus: Sequence[int]) -> list[int]:
    """Those on which a process of this control group may run."""
    before = os.sched_getaffinity(0)
    try:
        return [cpu for cpu in cpus if _can_move(cpu)]
    finally:
        os.sched_setaffinity(0, before)


def _can_move(cpu: int) -> bool:
    try:
        os.sched_setaffinity(0, {cpu})
    except OSError:
        return False
    return True


def governor(root: Path) -> Line:
    """A processor that first has to speed up is late."""
    files = (root / "sys/devices/system/cpu").glob("cpu[0-9]*/cpufreq/scaling_governor")
    kinds = sorted({_text(file) for file in files})
    found = ", ".join(kinds) or _say("no_scaling")
    return _line("governor", kinds in ([], ["performance"]), found, _say("governor"))


def sleep_states(tick: int | None, root: Path) -> Line:
    """/dev/cpu_dma_latency: held at 0 it keeps the processors out of deep sleep."""
    if tick is not None:
        held = any(_points_to(file, AWAKE) for file in (root / f"proc/{tick}/fd").glob("*"))
        found = _say("awake" if held else "not_awake", device=AWAKE)
        return _line("deep sleep", held, found, _say("give_awake_restart"))
    device = root / AWAKE.lstrip("/")
    may = os.access(device, os.W_OK) and _for_a_group(device)
    found = _say("may_be_awake" if may else "no_permission" if device.exists() else "not_there")
    return _line("deep sleep", may, found, _say("give_awake", otherwise=_say("under_systemd")))


def _points_to(link: Path, name: str) -> bool:
    try:
        return os.readlink(link) == name
    except OSError:
        return False


def _for_a_group(device: Path) -> bool:
    """Root may write it whatever its mode says, the service only as a member of the group."""
    return os.geteuid() != 0 or bool(device.stat().st_mode & stat.S_IWGRP)


# --- the bus -------------------------------------------------------------------------------


def told(bus: Bus) -> dict[str, Any]:
    """What `ip` says of an interface; {} where there is none."""
    command = ["ip", "-json", "-details", "-statistics", "link", "show", "dev", bus.channel]
    try:
        done = subprocess.run(command, capture_output=True, text=True)
        rows = json.loads(done.stdout or "[]")
    except (FileNotFoundError, json.JSONDecodeError):
        return {}
    return dict(rows[0]) if rows else {}


def can(bus: Bus, link: dict[str, Any]) -> Iterator[Line]:
    """Lines on one CAN interface, as `ip` tells of it."""
    up = "UP" in link.get("flags", ())
    bring = _say("bring_up", channel=bus.channel, bit_rate=bus.bit_rate)
    found = _say("is_up" if up else "is_down" if link else "is_absent", channel=bus.channel)
    yield _line("up", up, found, bring, bus.name)
    if not link:
        return
    length = int(link.get("txqlen", 0))
    longer = _say("longer_queue", channel=bus.channel, frames=MIN_QUEUE)
    yield _line("queue", length >= MIN_QUEUE, _say("frames", count=length), longer, bus.name)
    about = link.get("linkinfo", {}).get("info_data", {})
    rate = about.get("bittiming", {}).get("bitrate")
    if rate is not None:  # a virtual interface has none
        yield _line("bit rate", rate == bus.bit_rate, f"{rate} bit/s", bring, bus.name)
    yield _can_errors(bus, about, link.get("stats64", {}))


def _can_errors(bus: Bus, about: dict[str, Any], statistics: dict[str, Any]) -> Line:
    state = str(about.get("state", "ERROR-ACTIVE"))
    counters = about.get("berr_counter", {})
    worst = max((int(counters.get(way, 0)) for way in ("tx", "rx")), default=0)
    lost = sum(int(statistics.get(way, {}).get("dropped", 0)) for way in ("tx", "rx"))
    errors = sum(int(statistics.get(way, {}).get("errors", 0)) for way in ("tx", "rx"))
    found = _say("errors", state=state, worst=worst, errors=errors, lost=lost)
    passed = state == "ERROR-ACTIVE" and worst < ERRORS_ALLOWED
    return _line("errors", passed, found, _say("wiring"), bus.name)


# --- the rest ------------------------------------------------------------------------------


def disk(state: Path) -> Line:
    """Room for programs, recordings and the journal."""
    folder = next(path for path in (state, *state.absolute().parents) if path.exists())
    free = shutil.disk_usage(folder).free
    found = _say("free", gib=free / 2**30, folder=state)
    return _line("disk", free >= MIN_FREE, found, _say("make_room"))


def clock_source(root: Path) -> Line:
    """The tick asks for the time thousands of times a second."""
    folder = root / "sys/devices/system/clocksource/clocksource0"
    source, others = _text(folder / "current_clocksource"), _text(folder / "available_clocksource")
    remedy = _say("clocks", good=", ".join(GOOD_CLOCKS), others=others or say("cli.nothing"))
    return _line("clock source", source in GOOD_CLOCKS, source or _say("unknown"), remedy)


def clock_set() -> Line:
    """Alarms, runs and recordings carry the time of day."""
    status = ctypes.create_string_buffer(512)  # struct timex, larger than any; modes = 0 only reads
    told = ctypes.CDLL(None, use_errno=True).adjtimex(status)
    flags = ctypes.c_int.from_buffer(status, _TIMEX_STATUS).value
    kept = told >= 0 and not flags & _UNSYNCHRONISED
    found = _say("synchronised" if kept else "not_synchronised")
    return _line("time of day", kept, found, _say("set_time"))


# struct timex: unsigned modes; long offset, freq, maxerror, esterror; int status.
_TIMEX_STATUS = 5 * ctypes.sizeof(ctypes.c_long)


# How late this computer wakes a process that has a deadline, measured as the tick would see it.

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
