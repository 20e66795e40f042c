"""What a computer must be to hold periods of 1 ms and 0.5 ms, each declared once, with what to write where.

``directrix host check`` has all of them, ``directrix service self-test`` those that every machine needs.
Nothing here changes anything. All is read below ``root`` (/proc, /sys, /dev, /etc), so that tests bring their
own, and a copy of a computer can be looked at on another.
"""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

from controller.cli.host_lines import Line, Write, line
from controller.cli.host_view import CPU, Host, field, spans
from controller.verify.console import say

TICK_PRIORITY = 80  # that `loop.prepare` asks for
AWAKE = "/dev/cpu_dma_latency"
GOOD_CLOCKS = ("tsc", "arch_sys_counter", "kvm-clock", "hyperv_clocksource_tsc_page")
FULL_SPEED = 12  # Mbit/s: such an adapter on USB has one frame of USB in a millisecond
MAX_NAMED = 4  # interrupts in one sentence

SYSCTL_FILE = "/etc/sysctl.d/60-directrix.conf"
TMPFILES = "/etc/tmpfiles.d/directrix.conf"  # of `service install`
TMPFILES_HOST = "/etc/tmpfiles.d/directrix-host.conf"
UNIT = "etc/systemd/system/directrix.service"
# Makers and products that a virtual machine shows instead of a computer's.
VIRTUAL = ("qemu", "kvm", "vmware", "virtualbox", "virtual machine", "xen", "bochs", "amazon ec2", "google")
SCANNERS = {  # file: what it says where nothing scans, and the line for sysctl or the kernel that ends it
    "sys/kernel/mm/ksm/run": ("ksmd", "0", "w /sys/kernel/mm/ksm/run - - - - 0"),
    "sys/kernel/mm/damon/admin/kdamonds/nr_kdamonds": ("kdamond", "0", ""),
    "sys/module/damon_reclaim/parameters/enabled": ("damon_reclaim", "N", "damon_reclaim.enabled=N"),
    "sys/module/damon_lru_sort/parameters/enabled": ("damon_lru_sort", "N", "damon_lru_sort.enabled=N"),
    "proc/sys/kernel/numa_balancing": ("numa_balancing", "0", "kernel.numa_balancing = 0"),
}


def _finding(
    what: str,
    passed: bool | None,
    found: str,
    remedy: str = "",
    *writes: Write,
    bus: str = "",
    needed: bool = True,
) -> Line:
    good = _say(f"good.{what.replace(' ', '_')}")
    return line(what, passed, found, remedy, *writes, good=good, bus=bus, needed=needed)


_hint = partial(_finding, needed=False)  # what helps, though a computer is fit without it


def _say(key: str, **values: object) -> str:
    return say(f"host.{key}", **values)


# --- the kernel and the computer ------------------------------------------------------------


def kernel(host: Host) -> Iterator[Line]:
    """PREEMPT_RT: there, nearly all that the kernel does gives way to the tick."""
    version = host.text("proc/version")
    release = host.text("proc/sys/kernel/osrelease") or [*version.split(), "", "", ""][2]
    real_time = host.text("sys/kernel/realtime") == "1" or "PREEMPT_RT" in version
    found = _say("kernel_rt" if real_time else "kernel_other", release=release or _say("unknown"))
    arm = release.endswith(("arm64", "v8", "2712"))
    remedy = _say("install_rt", package="linux-image-rt-arm64" if arm else "linux-image-rt-amd64")
    yield _finding("kernel", real_time if version else None, found, remedy)


def computer(host: Host) -> Iterator[Line]:
    """A virtual machine runs when its host lets it; what is written in a container is not its computer's."""
    marks = (host.text(f"sys/class/dmi/id/{name}") for name in ("sys_vendor", "product_name"))
    maker = " ".join(filter(None, (*marks, host.text("sys/hypervisor/type"))))
    flags = f" {field(host.cpu, 'flags')} "
    is_virtual = " hypervisor " in flags or any(name in maker.lower() for name in VIRTUAL)
    if is_virtual or host.is_there("proc/device-tree/hypervisor"):
        yield _finding("computer", False, _say("virtual", maker=maker or _say("unknown")), _say("no_virtual"))
    elif host.is_there("run/systemd/container") or host.is_there(".dockerenv"):
        yield _hint("computer", False, _say("container"), _say("outside_container"))
    else:
        seen = bool(maker or flags.strip() or host.is_there("proc/device-tree/model"))
        yield _finding("computer", seen or None, _say("real" if seen else "unknown"))


# --- the tick's core -------------------------------------------------------------------------


def own_core(host: Host) -> Iterator[Line]:
    """A core that nobody else uses, for the tick alone."""
    alone = host.isolated
    running = host.tick is not None
    where = host.tick_cores if running else host.permitted(alone)
    key = "isolated_tick" if running else "isolated_permitted" if alone else "isolated"
    found = _say(key, cores=_listed(alone), where=_listed(where))
    if len(host.online) == 1:
        yield _finding("own core", False, found, _say("more_cores"))
    elif alone:
        passed = bool(where) and set(where) <= set(alone)
        yield _finding("own core", passed, found, _say("may_have_it"))
    else:
        word = f"isolcpus=managed_irq,domain,{spans(host.to_isolate()) or 1}"
        yield _finding("own core", False if host.online else None, found, "", host.boot(word))


def _listed(numbers: Sequence[int]) -> str:
    return ", ".join(map(str, numbers)) or _say("none")


def scheduler_ticks(host: Host) -> Iterator[Line]:
    """The scheduler's own interrupt, 250 times a second with Debian's kernels."""
    found = host.numbers(f"{CPU}/nohz_full")
    passed = host.core in found if host.online else None
    words = [host.boot(f"nohz_full={spans(host.to_isolate())}")] if host.core is not None else []
    yield _hint("nohz_full", passed, _say("on_cores", cores=_listed(found)), "", *words)


def threads(host: Host) -> Iterator[Line]:
    """Two threads of one core share its units and caches: who computes on the other slows the tick down."""
    if not (siblings := host.siblings()):
        yield _hint("threads", None, _say("unknown"))
        return
    beside = sorted(set(siblings) - {host.core or 0})
    found = _say("siblings", core=host.core, cores=_listed(beside))
    passed = set(beside) <= set(host.isolated)
    yield _hint("threads", passed, found, _say("no_threads"), host.boot("nosmt"))


def governor(host: Host) -> Iterator[Line]:
    """A processor that first has to speed up is late."""
    files = (host.root / CPU).glob("cpu[0-9]*/cpufreq/scaling_governor")
    kinds = sorted({host.text(str(file.relative_to(host.root))) for file in files})
    found = ", ".join(kinds) or _say("no_scaling" if host.is_there(CPU) else "unknown")
    passed = kinds in ([], ["performance"]) if host.is_there(CPU) else None
    write = host.boot("cpufreq.default_governor=performance")
    yield _finding("governor", passed, found, _say("governor"), write)


def sleep_states(host: Host) -> Iterator[Line]:
    """/dev/cpu_dma_latency: held at 0 it keeps the processors out of deep sleep."""
    write = Write(TMPFILES, f"z {AWAKE} 0660 root directrix -", "tmpfiles")
    if host.tick is not None:
        links = (host.root / f"proc/{host.tick}/fd").glob("*")
        held = any(_points_to(one, AWAKE) for one in links)
        found = _say("awake" if held else "not_awake", device=AWAKE)
        yield _finding("deep sleep", held, found + _deepest(host), _say("give_awake_restart"), write)
        return
    device = host.root / AWAKE.lstrip("/")
    may = os.access(device, os.W_OK) and _for_a_group(device)
    found = _say("may_be_awake" if may else "no_permission" if device.exists() else "not_there")
    yield _finding("deep sleep", may, found + _deepest(host), _say("give_awake"), write)


def _deepest(host: Host) -> str:
    """Of the states in which the tick's core may sleep, the one that takes longest to wake from."""
    folders = sorted((host.root / f"{CPU}/cpu{host.core}/cpuidle").glob("state*"))
    paths = [str(one.relative_to(host.root)) for one in folders]
    states = [
        (int(host.text(f"{one}/latency") or 0), host.text(f"{one}/name"))
        for one in paths
        if host.text(f"{one}/disable") != "1"
    ]
    if not states:
        return ""
    latency_us, name = max(states)
    return "; " + _say("deepest", name=name, latency=latency_us)


def _points_to(link: Path, name: str) -> bool:
    try:
        return os.readlink(link) == name
    except OSError:
        return False


def _for_a_group(device: Path) -> bool:
    """Root may write it whatever its mode says, the service only as a member of the group."""
    return os.geteuid() != 0 or bool(device.stat().st_mode & stat.S_IWGRP)


def clock_source(host: Host) -> Iterator[Line]:
    """The tick asks for the time thousands of times a second."""
    folder = "sys/devices/system/clocksource/clocksource0"
    source = host.text(f"{folder}/current_clocksource")
    others = host.text(f"{folder}/available_clocksource")
    remedy = _say("clocks", good=", ".join(GOOD_CLOCKS), others=others or _say("none"))
    passed = source in GOOD_CLOCKS if source or host.is_there("sys/devices") else None
    yield _finding("clock source", passed, source or _say("unknown"), remedy)


# --- interrupts and the CAN card -------------------------------------------------------------


def interrupts(host: Host) -> Iterator[Line]:
    """Those of disks, network and USB that come to the tick's core."""
    if not host.interrupts or host.core is None:
        yield _finding("interrupts", None if len(host.online) != 1 else False, _say("unknown"))
        return
    there = [
        one
        for one in host.interrupts.values()
        if one.counts.get(host.core) and host.core in host.affinity(one.number)
    ]
    named = [f"{one.number} ({one.actions})" for one in there[:MAX_NAMED]]
    named += [_say("and_more", count=len(there) - MAX_NAMED)] if len(there) > MAX_NAMED else []
    found = _say("irqs_on", core=host.core, names=", ".join(named) or _say("none"))
    write = host.boot(f"irqaffinity={host.others()}")
    yield _finding("interrupts", not there, found, _say("irqs_away"), write)


def can_cards(host: Host) -> Iterator[Line]:
    """For each CAN interface that is a device: who calls when a frame came, and the way to it."""
    for channel in host.can_interfaces():
        yield _can_interrupt(host, channel)
        yield _adapter(host, channel)


def _can_interrupt(host: Host, channel: str) -> Line:
    numbers = host.interrupts_of(channel)
    where = sorted({core for number in numbers for core in host.affinity(number)})
    named = ", ".join(f"{number} ({host.interrupts[number].actions})" for number in numbers)
    found = _say("irq_of_can", names=named or _say("unknown"), cores=_listed(where))
    passed = host.core not in where if where and host.core is not None else None
    remedy = _say("can_irq_away", cores=host.others(), number=numbers[0] if numbers else 0)
    write = host.boot(f"irqaffinity={host.others()}")
    return _finding("interrupt", passed, found, remedy, write, bus=channel)


def _adapter(host: Host, channel: str) -> Line:
    """USB of full speed gathers frames for 1 ms, of high speed for 125 us; SPI fetches each of them."""
    device = host.device(channel)
    driver = host.driver(channel)
    speed = next((text for one in (device, *device.parents) if (text := _usb_speed(one))), "")
    if speed:
        found, slow = _say("usb", driver=driver, speed=speed), float(speed) <= FULL_SPEED
        return _finding("adapter", False, found, _say("no_usb"), bus=channel, needed=slow)
    if device.name.startswith("spi"):
        return _hint("adapter", False, _say("spi", driver=driver), _say("no_spi"), bus=channel)
    return _finding("adapter", True, driver or _say("unknown"), bus=channel)


def _usb_speed(device: Path) -> str:
    """Mbit/s of a device on USB; "" of any other."""
    file = device / "speed"
    return file.read_text().strip() if file.exists() and (device / "bMaxPacketSize0").exists() else ""


# --- what the tick is granted ----------------------------------------------------------------


def privileges(host: Host) -> Iterator[Line]:
    """SCHED_FIFO and locked memory: of a running tick what it has, before that what its unit grants."""
    if host.tick is not None:
        level = host.priority_of(host.tick)
        found = say("self_test.runs_fifo" if level else "self_test.runs_without", level=level)
        yield _finding("privileges", level >= TICK_PRIORITY, found, _say("by_service"))
        return
    priority, memory = (host.unit_says(name) for name in ("LimitRTPRIO", "LimitMEMLOCK"))
    if not host.is_there(UNIT):
        yield _finding("privileges", False, _say("no_unit"), _say("install_service"))
        return
    found = _say("limits_unit", priority=priority or _say("none"), memory=memory or _say("none"))
    passed = _is_enough(priority or "0", memory or "0")
    lines = [Write(f"/{UNIT}", one, "service") for one in ("LimitRTPRIO=90", "LimitMEMLOCK=infinity")]
    yield _finding("privileges", passed, found, "", *lines)


def _is_enough(priority: str, memory: str) -> bool:
    enough = priority in ("unlimited", "infinity") or (priority.isdigit() and int(priority) >= TICK_PRIORITY)
    return enough and memory in ("unlimited", "infinity")


def throttling(host: Host) -> Iterator[Line]:
    """What is real-time has 95 % of each second by default: a tick that needs more stands for the rest."""
    runtime = host.text("proc/sys/kernel/sched_rt_runtime_us")
    period = host.text("proc/sys/kernel/sched_rt_period_us") or "1000000"
    found = _say("throttled" if runtime != "-1" else "not_throttled", runtime=runtime, period=period)
    write = Write(SYSCTL_FILE, "kernel.sched_rt_runtime_us = -1", "sysctl")
    yield _hint(
        "throttling", runtime == "-1" if runtime else None, found if runtime else _say("unknown"), "", write
    )


# --- memory ----------------------------------------------------------------------------------


def page_faults(host: Host) -> Iterator[Line]:
    """A locked page stays in memory, and may yet be moved: whoever touches it meanwhile waits."""
    moved = host.text("proc/sys/vm/compact_unevictable_allowed")
    found = _say({"0": "not_moved", "1": "moved"}.get(moved, "unknown"))
    write = Write(SYSCTL_FILE, "vm.compact_unevictable_allowed = 0", "sysctl")
    yield _hint("page faults", moved == "0" if moved else None, found, "", write)
    if host.tick is not None:
        yield memory(host)


def memory(host: Host) -> Line:
    """Of a running tick: a page that has to be fetched is a tick that is lost."""
    locked = field(host.text(f"proc/{host.tick}/status"), "VmLck").split()
    kilobytes = int(locked[0]) if locked else 0
    found = say("self_test.locked", kilobytes=kilobytes)
    return _finding("locked memory", kilobytes > 0, found, say("self_test.under_systemd"))


def huge_pages(host: Host) -> Iterator[Line]:
    """khugepaged gathers pages of a process into large ones, which it cannot touch meanwhile."""
    text = host.text("sys/kernel/mm/transparent_hugepage/enabled")
    chosen = re.search(r"\[(\w+)\]", text)
    found = chosen[1] if chosen else _say("no_huge_pages" if host.is_there("sys/kernel/mm") else "unknown")
    passed = found != "always" if host.is_there("sys/kernel/mm") else None
    yield _hint("huge pages", passed, found, "", host.boot("transparent_hugepage=madvise"))


def scanners(host: Host) -> Iterator[Line]:
    """Threads of the kernel that look through pages and take them away to see who uses them."""
    running = [one for file, one in SCANNERS.items() if host.text(file) not in ("", one[1])]
    seen = host.is_there("sys/kernel/mm") and host.is_there("proc/sys/kernel")
    found = ", ".join(name for name, *_ in running) or _say("none" if seen else "unknown")
    writes = [_scanner_off(host, end) for *_, end in running if end]
    remedy = _say("damon") if any(not end for *_, end in running) else ""
    yield _hint("page scanners", not running if seen else None, found, remedy, *writes)


def _scanner_off(host: Host, end: str) -> Write:
    if end.startswith("w "):
        return Write(TMPFILES_HOST, end, "tmpfiles")
    return Write(SYSCTL_FILE, end, "sysctl") if " = " in end else host.boot(end)


def swap(host: Host) -> Iterator[Line]:
    """The tick's memory is locked, that of planner and panel is not."""
    rows = host.text("proc/swaps").splitlines()
    kinds = [row.split()[1] for row in rows[1:] if len(row.split()) > 1]
    found = _say("swaps", count=len(kinds), kinds=", ".join(sorted(set(kinds)))) if kinds else _say("no_swap")
    yield _hint("swap", not kinds if rows else None, found if rows else _say("unknown"), _say("swap_off"))


Finding = Callable[[Host], Iterator[Line]]

ALL: tuple[Finding, ...] = (
    *(kernel, computer, own_core, scheduler_ticks, threads, interrupts, can_cards, governor, sleep_states),
    *(clock_source, privileges, throttling, page_faults, huge_pages, scanners, swap),
)
OF_EVERY_MACHINE: tuple[Finding, ...] = (own_core, governor, sleep_states)  # and of the self-test


def look(host: Host, findings: Sequence[Finding] = ALL) -> list[Line]:
    """The lines of these findings, in their order."""
    return [one for finding in findings for one in finding(host)]
