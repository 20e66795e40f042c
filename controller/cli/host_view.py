"""A computer as its kernel shows it: files of /proc, /sys, /dev and /etc below a root that tests bring.

Nothing of it is judged here: what is good, and what is to be written, is in ``host_findings``.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from controller.cli.host_lines import Write
from controller.runtime import cores

TICK_NAME, PUMP_NAME = "directrix-tick", "directrix-pump"  # as `ps` shows them
CAN_TYPE = "280"  # of an interface, ARPHRD_CAN
MINOR, MAJOR, PRIORITY, POLICY = 7, 9, 37, 38  # columns of /proc/PID/stat after the name
FIFO = "1"  # SCHED_FIFO there
CPU = "sys/devices/system/cpu"
GRUB_FILE = "/etc/default/grub.d/directrix.cfg"
ONE_LINE_FILES = ("boot/firmware/cmdline.txt", "boot/cmdline.txt")  # of a Raspberry Pi


@dataclass(frozen=True, slots=True)
class Interrupt:
    """A line of /proc/interrupts."""

    number: int
    name: str  # chip and actions
    counts: dict[int, int]  # core: how often since the start

    @property
    def actions(self) -> str:
        """Who is called; the last words of the line."""
        return self.name.rsplit("  ", 1)[-1].strip()


class Host:
    """A computer as its kernel shows it below ``root``.

    ``permitted``: of some cores, those on which a process of this control group may run.
    """

    def __init__(
        self, root: Path = Path("/"), permitted: Callable[[Sequence[int]], list[int]] | None = None
    ) -> None:
        self.root = root
        self.permitted = permitted or (permitted_of if root == Path("/") else list)
        self.isolated = cores.isolated(root)
        self.online = self.numbers(f"{CPU}/online")

    def text(self, path: str) -> str:
        """Of a file of the kernel, without its line end; "" where it is not there or not for us."""
        try:
            return (self.root / path).read_text(errors="replace").strip().strip("\0")
        except OSError:
            return ""

    def numbers(self, path: str) -> list[int]:
        """Of a file with a list of the kernel's, "2-3,7"."""
        text = self.text(path)
        return cores.numbers(text) if re.fullmatch(r"[\d,-]+", text) else []

    def is_there(self, path: str) -> bool:
        return (self.root / path).exists()

    @cached_property
    def names(self) -> dict[int, str]:
        """Of the processes, by their numbers."""
        return {int(one.name): self.text(f"proc/{one.name}/comm") for one in self._processes()}

    def _processes(self) -> Iterator[Path]:
        return (self.root / "proc").glob("[0-9]*")

    @cached_property
    def tick(self) -> int | None:
        """Process id of a running tick."""
        return next((number for number, name in self.names.items() if name == TICK_NAME), None)

    @cached_property
    def pump(self) -> int | None:
        """Process id of a running pump."""
        return next((number for number, name in self.names.items() if name == PUMP_NAME), None)

    @cached_property
    def tick_cores(self) -> list[int]:
        """Where a running tick may run."""
        return cores.numbers(field(self.text(f"proc/{self.tick}/status"), "Cpus_allowed_list"))

    def priority_of(self, process: int | None) -> int:
        """Of a running process under SCHED_FIFO; 0 under any other scheduler."""
        row = self.text(f"proc/{process}/stat").rpartition(")")[2].split()
        return int(row[PRIORITY]) if len(row) > POLICY and row[POLICY] == FIFO else 0

    @cached_property
    def core(self) -> int | None:
        """That the tick has, or would take; None where there is none for it."""
        if self.tick is not None and len(self.tick_cores) == 1:
            return self.tick_cores[0]
        return next(iter(cores.choice(self.online, self.isolated, real_time=True)), None)

    def core_for(self, real_time: bool) -> int | None:
        """That a tick would take here; None where it may have none, or takes none."""
        return next(iter(self.permitted(cores.choice(self.online, self.isolated, real_time))), None)

    def tick_faults(self) -> tuple[int, int]:
        """Page faults of a running tick since its start: without the disk, and with it."""
        row = self.text(f"proc/{self.tick}/stat").rpartition(")")[2].split()
        return (int(row[MINOR]), int(row[MAJOR])) if len(row) > MAJOR else (0, 0)

    def siblings(self) -> list[int]:
        """Cores that are the same piece of silicon as the tick's, itself among them."""
        return self.numbers(f"{CPU}/cpu{self.core}/topology/thread_siblings_list")

    def to_isolate(self) -> list[int]:
        """The tick's core with its siblings, where others are left for everybody else."""
        together = sorted({*self.siblings(), *([] if self.core is None else [self.core])})
        return together if set(self.online) - set(together) else together[-1:]

    def others(self) -> str:
        """Cores for everybody else, as the kernel takes them."""
        return spans(sorted(set(self.online) - {*self.to_isolate(), *self.isolated})) or "0"

    def boot(self, word: str) -> Write:
        """A word of the kernel's command line."""
        for file in ONE_LINE_FILES:
            if self.is_there(file):
                return Write(f"/{file}", word, "one_line")
        return Write(GRUB_FILE, f'GRUB_CMDLINE_LINUX="$GRUB_CMDLINE_LINUX {word}"', "grub")

    @cached_property
    def cpu(self) -> str:
        """/proc/cpuinfo, without the tabs before its colons."""
        return re.sub(r"[\t ]+:", ":", self.text("proc/cpuinfo"))

    @property
    def processor(self) -> str:
        """Of what kind; "" where nothing says it."""
        return field(self.cpu, "model name") or field(self.cpu, "Model") or field(self.cpu, "Hardware")

    # --- interrupts ---

    @cached_property
    def interrupts(self) -> dict[int, Interrupt]:
        """Lines of /proc/interrupts that are of a device, by their numbers."""
        head, *rows = self.text("proc/interrupts").splitlines() or [""]
        numbers = [int(one.removeprefix("CPU")) for one in head.split() if re.fullmatch(r"CPU\d+", one)]
        found: dict[int, Interrupt] = {}
        for row in rows:
            number, _, rest = row.strip().partition(":")
            cells = rest.split(maxsplit=len(numbers))
            if number.isdigit() and len(cells) > len(numbers):
                counts = {core: int(count) for core, count in zip(numbers, cells, strict=False)}
                found[int(number)] = Interrupt(int(number), cells[-1].strip(), counts)
        return found

    def affinity(self, number: int) -> list[int]:
        """Cores to which an interrupt comes."""
        folder = f"proc/irq/{number}"
        return self.numbers(f"{folder}/effective_affinity_list") or self.numbers(
            f"{folder}/smp_affinity_list"
        )

    # --- CAN ---

    def can_interfaces(self) -> list[str]:
        """Those that are a device; a virtual one has none."""
        folders = sorted((self.root / "sys/class/net").glob("*"))
        return [
            one.name
            for one in folders
            if self.text(f"sys/class/net/{one.name}/type") == CAN_TYPE and (one / "device").exists()
        ]

    def device(self, channel: str) -> Path:
        """The folder of the device that an interface is of."""
        return (self.root / f"sys/class/net/{channel}/device").resolve()

    def driver(self, channel: str) -> str:
        """The driver of an interface's device; "" where none is known."""
        link = self.device(channel) / "driver"
        return Path(os.path.realpath(link)).name if link.exists() else ""

    def interrupts_of(self, channel: str) -> list[int]:
        """Numbers of those that the device of an interface calls with, or what it is plugged into."""
        device = self.device(channel)
        top = (self.root / "sys").resolve()
        for one in (device, *device.parents):
            if one == top:
                break
            numbers = [int(file.name) for file in (one / "msi_irqs").glob("[0-9]*")]
            if not numbers and (one / "irq").is_file():
                numbers = [int((one / "irq").read_text().strip() or 0)]
            if known := sorted(set(numbers) & self.interrupts.keys()):
                return known
        names = {channel, device.name}
        return [
            number for number, one in self.interrupts.items() if names & set(re.split(r"[\s,]+", one.name))
        ]

    # --- files of the installation ---

    def unit_says(self, key: str) -> str:
        """The last word of the service's unit and its drop-ins on a key; "" where there is none."""
        folder = self.root / "etc/systemd/system"
        files = [folder / "directrix.service", *sorted((folder / "directrix.service.d").glob("*.conf"))]
        rows = [row.strip() for file in files if file.is_file() for row in file.read_text().splitlines()]
        said = [row.partition("=")[2].strip() for row in rows if row.startswith(f"{key}=")]
        return said[-1] if said else ""


def spans(numbers: Sequence[int]) -> str:
    """A list as the kernel takes it: "0-2,7"."""
    found: list[list[int]] = []
    for number in numbers:
        if found and number == found[-1][-1] + 1:
            found[-1] = [found[-1][0], number]
        else:
            found.append([number])
    return ",".join("-".join(map(str, one)) for one in found)


def field(text: str, name: str) -> str:
    """Of a file of lines ``name: value``."""
    return next((row.split(":", 1)[1].strip() for row in text.splitlines() if row.startswith(f"{name}:")), "")


def permitted_of(cpus: Sequence[int]) -> list[int]:
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
