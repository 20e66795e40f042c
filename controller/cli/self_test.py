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
from dataclasses import asdict
from pathlib import Path
from typing import Any

from controller.ipc import control_socket
from controller.machine.model import Bus, Machine
from controller.runtime import cores
from controller.values import dataclass

TICK_NAME = "directrix-tick"  # as `ps` shows it
_ISOLATE = "isolcpus=3 nohz_full=3 rcu_nocbs=3 on the kernel's command line, with the number of one core"
_MAY_HAVE_IT = (
    "a tick takes one when it starts: let its control group have it (AllowedCPUs= of directrix.service and of"
    " the slices above it), isolate one for each machine of this computer, then restart directrix.service"
)
AWAKE = "/dev/cpu_dma_latency"
_GIVE_AWAKE = "'systemd-tmpfiles --create' gives the device to the group"
UNDER_SYSTEMD = "run the machine by directrix.service, which permits it, and this as root"
MIN_QUEUE = 128  # frames
MIN_FREE = 1 << 30  # bytes
ERRORS_ALLOWED = 96  # CiA 301 and ISO 11898: from here on a controller warns
GOOD_CLOCKS = ("tsc", "arch_sys_counter", "kvm-clock", "hyperv_clocksource_tsc_page")
MAY_BE_LATE = 1e-3  # share of the ticks
QUICKER = "a PREEMPT_RT kernel, a core of its own (isolcpus=), the performance governor, or a longer period_s"
ANSWER_S = 5.0
_UNSYNCHRONISED = 0x40  # STA_UNSYNC, linux/timex.h
_CURRENT = 1  # MCL_CURRENT


@dataclass(frozen=True, slots=True)
class Line:
    """One thing that was looked at."""

    name: str
    passed: bool
    found: str
    remedy: str = ""  # "" where it passed

    def to_dict(self) -> dict[str, Any]:
        return asdict(self)


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


def _line(name: str, passed: bool, found: str, remedy: str) -> Line:
    return Line(name, passed, found, "" if passed else remedy)


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
    found = (
        f"the tick was {1e3 * tick['late_max_ms']:.0f} us late at worst;"
        f" {100.0 * skipped:.2g} % of {tick['number']} ticks of {tick['period_ms']:g} ms were skipped"
    )
    return _line("latency", skipped <= MAY_BE_LATE, found, QUICKER)


def _latency(period_s: float, seconds: float, root: Path) -> Line:
    alone = _permitted_of(cores.isolated(root))
    return latency_line(measure(period_s, seconds, alone[0] if alone else None), period_s)


def latency_line(measured: Measured, period_s: float) -> Line:
    """A tick more than a quarter of a period late is skipped: at most one in a thousand may be."""
    late = measured.share_over(period_s / 4.0)
    found = (
        f"woken {1e6 * measured.worst_s:.0f} us late at worst,"
        f" {1e6 * measured.quantile_s(0.99):.0f} us at p99;"
        f" {100.0 * late:.2g} % of {measured.count} ticks of {1e3 * period_s:g} ms would be skipped"
        f"{'' if measured.real_time else ' (without real-time priority)'}"
    )
    return _line("latency", late <= MAY_BE_LATE, found, QUICKER)


def memory(tick: int | None, root: Path) -> Line:
    """A page that has to be fetched is a tick that is lost."""
    if tick is not None:
        locked = _field(_text(root / f"proc/{tick}/status"), "VmLck").split()
        kilobytes = int(locked[0]) if locked else 0
        return _line("locked memory", kilobytes > 0, f"the tick has locked {kilobytes} kB", UNDER_SYSTEMD)
    libc = ctypes.CDLL(None, use_errno=True)
    locks = libc.mlockall(_CURRENT) == 0
    libc.munlockall()
    return _line("locked memory", locks, "permitted" if locks else "not permitted", UNDER_SYSTEMD)


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
        found = f"the tick runs {'SCHED_FIFO' if fifo else 'without real-time'} priority {level}"
        return _line("priority", fifo, found, UNDER_SYSTEMD)
    may = as_real_time()
    return _line("priority", may, "SCHED_FIFO is" + " not" * (not may) + " permitted", UNDER_SYSTEMD)


def own_core(tick: int | None, root: Path) -> Line:
    """A core that nobody else uses, for the tick alone."""
    alone = cores.isolated(root)
    where = sorted(os.sched_getaffinity(tick)) if tick is not None else _permitted_of(alone)
    found = f"isolated: {_listed(alone)}"
    if tick is not None:
        found += f"; the tick on {_listed(where)}"
    elif alone:
        found += f"; permitted: {_listed(where)}"
    passed = bool(where) and set(where) <= set(alone)
    return _line("own core", passed, found, _MAY_HAVE_IT if alone else _ISOLATE)


def _listed(numbers: Sequence[int]) -> str:
    return ", ".join(map(str, numbers)) or "none"


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
    found = ", ".join(kinds) or "no frequency scaling"
    remedy = "'cpupower frequency-set -g performance', or cpufreq.default_governor=performance at boot"
    return _line("governor", kinds in ([], ["performance"]), found, remedy)


def sleep_states(tick: int | None, root: Path) -> Line:
    """/dev/cpu_dma_latency: held at 0 it keeps the processors out of deep sleep."""
    if tick is not None:
        held = any(_points_to(file, AWAKE) for file in (root / f"proc/{tick}/fd").glob("*"))
        found = f"the tick {'holds' if held else 'does not hold'} {AWAKE}"
        return _line("deep sleep", held, found, f"{_GIVE_AWAKE}, then restart directrix.service")
    device = root / AWAKE.lstrip("/")
    may = os.access(device, os.W_OK) and _for_a_group(device)
    found = "may be held awake" if may else "no permission" if device.exists() else "not there"
    return _line("deep sleep", may, found, f"{_GIVE_AWAKE}; or {UNDER_SYSTEMD}")


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
    bring = (
        f"'ip link set {bus.channel} up type can bitrate {bus.bit_rate} restart-ms 100', or systemd-networkd"
    )
    yield _line(
        f"{bus.name} up", up, f"{bus.channel} is {'up' if up else 'down' if link else 'absent'}", bring
    )
    if not link:
        return
    length = int(link.get("txqlen", 0))
    longer = (
        f"TransmitQueueLength={MIN_QUEUE} in the .link file that is the first to match it ('udevadm"
        f" test-builtin net_setup_link /sys/class/net/{bus.channel}' names it; 'directrix service install'"
        f" writes one); until the next boot 'ip link set {bus.channel} txqueuelen {MIN_QUEUE}'"
    )
    yield _line(f"{bus.name} queue", length >= MIN_QUEUE, f"{length} frames", longer)
    about = link.get("linkinfo", {}).get("info_data", {})
    rate = about.get("bittiming", {}).get("bitrate")
    if rate is not None:  # a virtual interface has none
        yield _line(f"{bus.name} bit rate", rate == bus.bit_rate, f"{rate} bit/s", bring)
    yield _can_errors(bus, about, link.get("stats64", {}))


def _can_errors(bus: Bus, about: dict[str, Any], statistics: dict[str, Any]) -> Line:
    state = str(about.get("state", "ERROR-ACTIVE"))
    counters = about.get("berr_counter", {})
    worst = max((int(counters.get(way, 0)) for way in ("tx", "rx")), default=0)
    lost = sum(int(statistics.get(way, {}).get("dropped", 0)) for way in ("tx", "rx"))
    errors = sum(int(statistics.get(way, {}).get("errors", 0)) for way in ("tx", "rx"))
    found = f"{state}, error counter {worst}, {errors} errors and {lost} lost frames since it is up"
    remedy = "termination (120 ohms at both ends), shield and earth, stubs, bit rate of every node"
    return _line(f"{bus.name} errors", state == "ERROR-ACTIVE" and worst < ERRORS_ALLOWED, found, remedy)


# --- the rest ------------------------------------------------------------------------------


def disk(state: Path) -> Line:
    """Room for programs, recordings and the journal."""
    folder = next(path for path in (state, *state.absolute().parents) if path.exists())
    free = shutil.disk_usage(folder).free
    found = f"{free / 2**30:.1f} GiB free for {state}"
    return _line("disk", free >= MIN_FREE, found, "1 GiB is needed there; delete recordings and old programs")


def clock_source(root: Path) -> Line:
    """The tick asks for the time thousands of times a second."""
    folder = root / "sys/devices/system/clocksource/clocksource0"
    source, others = _text(folder / "current_clocksource"), _text(folder / "available_clocksource")
    remedy = (
        f"one of {', '.join(GOOD_CLOCKS)}; this kernel offers: {others or 'nothing'}; see its boot messages"
    )
    return _line("clock source", source in GOOD_CLOCKS, source or "unknown", remedy)


def clock_set() -> Line:
    """Alarms, runs and recordings carry the time of day."""
    status = ctypes.create_string_buffer(512)  # struct timex, larger than any; modes = 0 only reads
    told = ctypes.CDLL(None, use_errno=True).adjtimex(status)
    flags = ctypes.c_int.from_buffer(status, _TIMEX_STATUS).value
    kept = told >= 0 and not flags & _UNSYNCHRONISED
    remedy = "'timedatectl set-ntp true', or another time service"
    return _line("time of day", kept, "synchronised" if kept else "not synchronised", remedy)


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
