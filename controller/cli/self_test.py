"""What a computer must be and have to run a machine: each a line, pass or fail, with the remedy.

Nothing here changes anything. Where the machine is running, its tick process is looked at;
otherwise this process tries what the tick would ask for. Folders of the kernel (/proc, /sys, /dev) are
read below ``root``, so that tests bring their own.
"""

from __future__ import annotations

import ctypes
import json
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from controller.cli import host_findings
from controller.cli.host_lines import Line, line
from controller.cli.host_view import Host
from controller.ipc import control_socket
from controller.machine.model import Bus, Machine
from controller.runtime import wake_ups
from controller.verify.console import say

MIN_QUEUE = 128  # frames
MIN_FREE = 1 << 30  # bytes
ERRORS_ALLOWED = 96  # CiA 301 and ISO 11898: from here on a controller warns
ANSWER_TIMEOUT_S = 5.0
_UNSYNCHRONISED = 0x40  # STA_UNSYNC, linux/timex.h
_CURRENT = 1  # MCL_CURRENT


def run(machine: Machine, state: Path, seconds: float, root: Path = Path("/")) -> list[Line]:
    """All lines; takes ``seconds`` for the latency where no tick is asked for its own."""
    host = Host(root)
    running = running_tick(state) if host.tick is not None else None
    return [
        _latency(machine.period_s, seconds, host) if running is None else running_latency_line(running),
        memory(host),
        priority(host),
        *host_findings.look(host, host_findings.OF_EVERY_MACHINE),
        *(
            line
            for bus in machine.buses
            if bus.interface == "socketcan"
            for line in can(bus, link_details(bus))
        ),
        disk(state),
        *host_findings.look(host, (host_findings.clock_source,)),
        clock_set(),
    ]


def _say(key: str, **values: object) -> str:
    return say(f"self_test.{key}", **values)


# --- the processor -------------------------------------------------------------------------


def running_tick(state: Path) -> dict[str, float] | None:
    """The tick's part of the status of a running service; None where no service answers."""
    client = control_socket.Client(
        control_socket.control_path(control_socket.runtime_of(state)), longest_s=ANSWER_TIMEOUT_S
    )
    try:
        tick = dict(client.ask("status")["tick"])
        return tick if tick["number"] is not None else None  # none yet
    except (control_socket.CommandRefused, KeyError):
        return None
    finally:
        client.close()


def running_latency_line(tick: dict[str, float]) -> Line:
    """The deadlines of a running tick: it has its core for itself, to measure beside it would say less."""
    skipped = tick["skips"] / max(tick["number"], 1)
    figures = {"worst": 1e3 * tick["late_max_ms"], "percent": 100.0 * skipped, "period": tick["period_ms"]}
    found = _say("kept", ticks=tick["number"], **figures)
    return line("latency", skipped <= wake_ups.MAY_BE_LATE, found, _say("quicker"))


def _latency(period_s: float, seconds: float, host: Host) -> Line:
    late = wake_ups.Histogram()
    given = wake_ups.turn(period_s, seconds, late, host.core_for(wake_ups.may_be_real_time()))
    return latency_line(late, period_s, given.real_time)


def latency_line(late: wake_ups.Histogram, period_s: float, real_time: bool = True) -> Line:
    """A tick more than a quarter of a period late is skipped: at most one in a thousand may be."""
    skipped = late.share_over(wake_ups.LATE_SHARE * period_s)
    figures = {"worst": 1e6 * late.worst_s, "p99": 1e6 * late.quantile_s(0.99)}
    figures |= {"percent": 100.0 * skipped, "ticks": late.count, "period": 1e3 * period_s}
    found = _say("measured" if real_time else "measured_without", **figures)
    return line("latency", skipped <= wake_ups.MAY_BE_LATE, found, _say("quicker"))


def memory(host: Host) -> Line:
    """A page that has to be fetched is a tick that is lost."""
    if host.tick is not None:
        return host_findings.memory(host)
    libc = ctypes.CDLL(None, use_errno=True)
    locks = libc.mlockall(_CURRENT) == 0
    libc.munlockall()
    found = _say("permitted" if locks else "not_permitted")
    return line("locked memory", locks, found, _say("under_systemd"))


def priority(host: Host) -> Line:
    """SCHED_FIFO, so that only interrupts go before the tick, and the pump that plays what it publishes."""
    if host.tick is not None:
        level, above = host.priority_of(host.tick), host.priority_of(host.pump)
        key = "runs_without" if not level else "runs_fifo" if host.pump is None else "runs_with_pump"
        passed = level > 0 and (host.pump is None or above > level)
        return line("priority", passed, _say(key, level=level, above=above), _say("under_systemd"))
    may = wake_ups.may_be_real_time()
    return line("priority", may, _say("may_fifo" if may else "may_not_fifo"), _say("under_systemd"))


# --- the bus -------------------------------------------------------------------------------


def link_details(bus: Bus) -> dict[str, Any]:
    """What `ip` reports of an interface; {} where there is none."""
    command = ["ip", "-json", "-details", "-statistics", "link", "show", "dev", bus.channel]
    try:
        done = subprocess.run(command, capture_output=True, text=True)
        rows = json.loads(done.stdout or "[]")
    except (FileNotFoundError, json.JSONDecodeError):
        return {}
    return dict(rows[0]) if rows else {}


def can(bus: Bus, link: dict[str, Any]) -> Iterator[Line]:
    """Lines on one CAN interface, as `ip` reports it."""
    up = "UP" in link.get("flags", ())
    bring = _say("bring_up", channel=bus.channel, bit_rate=bus.bit_rate)
    found = _say("is_up" if up else "is_down" if link else "is_absent", channel=bus.channel)
    yield line("up", up, found, bring, bus=bus.name)
    if not link:
        return
    length = int(link.get("txqlen", 0))
    longer = _say("longer_queue", channel=bus.channel, frames=MIN_QUEUE)
    yield line("queue", length >= MIN_QUEUE, _say("frames", count=length), longer, bus=bus.name)
    about = link.get("linkinfo", {}).get("info_data", {})
    rate = about.get("bittiming", {}).get("bitrate")
    if rate is not None:  # a virtual interface has none
        yield line("bit rate", rate == bus.bit_rate, f"{rate} bit/s", bring, bus=bus.name)
    yield _can_errors(bus, about, link.get("stats64", {}))


def _can_errors(bus: Bus, about: dict[str, Any], statistics: dict[str, Any]) -> Line:
    state = str(about.get("state", "ERROR-ACTIVE"))
    counters = about.get("berr_counter", {})
    worst = max((int(counters.get(way, 0)) for way in ("tx", "rx")), default=0)
    lost = sum(int(statistics.get(way, {}).get("dropped", 0)) for way in ("tx", "rx"))
    errors = sum(int(statistics.get(way, {}).get("errors", 0)) for way in ("tx", "rx"))
    found = _say("errors", state=state, worst=worst, errors=errors, lost=lost)
    passed = state == "ERROR-ACTIVE" and worst < ERRORS_ALLOWED
    return line("errors", passed, found, _say("wiring"), bus=bus.name)


# --- the rest ------------------------------------------------------------------------------


def disk(state: Path) -> Line:
    """Room for programs, recordings and the journal."""
    folder = next(path for path in (state, *state.absolute().parents) if path.exists())
    free = shutil.disk_usage(folder).free
    found = _say("free", gib=free / 2**30, folder=state)
    return line("disk", free >= MIN_FREE, found, _say("make_room"))


def clock_set() -> Line:
    """Alarms, runs and recordings carry the time of day."""
    status = ctypes.create_string_buffer(512)  # struct timex, larger than any; modes = 0 only reads
    told = ctypes.CDLL(None, use_errno=True).adjtimex(status)
    flags = ctypes.c_int.from_buffer(status, _TIMEX_STATUS).value
    kept = told >= 0 and not flags & _UNSYNCHRONISED
    found = _say("synchronised" if kept else "not_synchronised")
    return line("time of day", kept, found, _say("set_time"))


# struct timex: unsigned modes; long offset, freq, maxerror, esterror; int status.
_TIMEX_STATUS = 5 * ctypes.sizeof(ctypes.c_long)
