"""Computers made up of the files in which the kernel shows them: laptop, industrial PC, Raspberry Pi ..."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

CPU = "sys/devices/system/cpu"
CLOCK = "sys/devices/system/clocksource/clocksource0"
TICK = 4711  # process id
LIMITS = "[Service]\nLimitRTPRIO=90\nLimitMEMLOCK=infinity"


def build(root: Path, files: Mapping[str, str], links: Mapping[str, str] | None = None) -> Path:
    """Write the files, and links of sysfs, which are relative; a file that is there is written over."""
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{text}\n")
    for name, to in (links or {}).items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        (root / to).mkdir(parents=True, exist_ok=True)
        path.symlink_to(Path(*[".."] * (len(Path(name).parts) - 1)) / to)
    return root


def interrupts(*rows: tuple[int, str, tuple[int, ...], str]) -> dict[str, str]:
    """/proc/interrupts and the affinities: number, name, counts by core, cores that it comes to."""
    cores = len(rows[0][2])
    table = ["".join(f"{f'CPU{n}':>12}" for n in range(cores)).rjust(12 * cores + 5)]
    found: dict[str, str] = {}
    for number, name, counts, where in rows:
        table.append(f"{number:>4}:{''.join(f'{count:>12}' for count in counts)}  {name}")
        found[f"proc/irq/{number}/effective_affinity_list"] = where
    table.append("".join(["LOC:", *(f"{99:>12}" for _ in range(cores)), "   Local timer interrupts"]))
    return {"proc/interrupts": "\n".join(table), **found}


def _cores(count: int, governor: str, together: int = 1) -> dict[str, str]:
    """``together``: threads of a core; the second ones have the numbers behind all first ones."""
    found = {f"{CPU}/online": f"0-{count - 1}", f"{CPU}/isolated": ""}
    for n in range(count):
        siblings = sorted({n % (count // together) + k * count // together for k in range(together)})
        found[f"{CPU}/cpu{n}/topology/thread_siblings_list"] = ",".join(map(str, siblings))
        if governor:
            found[f"{CPU}/cpu{n}/cpufreq/scaling_governor"] = governor
    return found


def _states(cpu: int, *states: tuple[str, int]) -> dict[str, str]:
    rows = enumerate(states)
    return {
        f"{CPU}/cpu{cpu}/cpuidle/state{n}/{key}": value
        for n, (name, latency) in rows
        for key, value in {"name": name, "latency": str(latency), "disable": "0"}.items()
    }


def _kernel(release: str, version: str) -> dict[str, str]:
    return {
        "proc/version": f"Linux version {release} (maker@somewhere) {version}",
        "proc/sys/kernel/osrelease": release,
        "proc/sys/kernel/version": version,
    }


def laptop(root: Path) -> Path:
    """Debian 12 as it is installed, two threads a core, and a CANable on USB."""
    files = {
        **_kernel("6.1.0-26-amd64", "#1 SMP PREEMPT_DYNAMIC Debian 6.1.112-1 (2024-09-30)"),
        **_cores(8, "powersave", together=2),
        **_states(7, ("POLL", 0), ("C1E", 10), ("C10", 890)),
        **interrupts(
            (16, "IR-PCI-MSI 327680-edge      xhci_hcd", (0,) * 7 + (98231,), "7"),
            (130, "IR-PCI-MSI 1048576-edge      nvme0q8", (0,) * 7 + (1234,), "7"),
            (131, "IR-PCI-MSI 1048577-edge      nvme0q1", (4321,) + (0,) * 7, "0"),
        ),
        "proc/cpuinfo": "processor\t: 0\nmodel name\t: A mobile processor\nflags\t\t: fpu tsc constant_tsc",
        "proc/cmdline": "BOOT_IMAGE=/vmlinuz root=/dev/mapper/annas--laptop-root ro quiet",
        "sys/class/dmi/id/sys_vendor": "LENOVO",
        "sys/class/dmi/id/product_name": "20XW",
        f"{CPU}/nohz_full": "(null)",
        f"{CLOCK}/current_clocksource": "tsc",
        f"{CLOCK}/available_clocksource": "tsc hpet acpi_pm",
        "sys/kernel/mm/transparent_hugepage/enabled": "[always] madvise never",
        "sys/kernel/mm/ksm/run": "0",
        "proc/sys/kernel/numa_balancing": "0",
        "proc/sys/kernel/sched_rt_runtime_us": "950000",
        "proc/sys/kernel/sched_rt_period_us": "1000000",
        "proc/sys/vm/compact_unevictable_allowed": "1",
        "proc/swaps": "Filename\tType\tSize\tUsed\tPriority\n/dev/dm-1 partition 1000 0 -2",
        "dev/cpu_dma_latency": "",
        "sys/class/net/lo/type": "772",
        "sys/devices/pci0000:00/0000:00:14.0/irq": "16",
        "sys/devices/pci0000:00/0000:00:14.0/usb1/1-2/speed": "12",
        "sys/devices/pci0000:00/0000:00:14.0/usb1/1-2/bMaxPacketSize0": "64",
        "sys/class/net/can0/type": "280",
        "etc/os-release": 'PRETTY_NAME="Debian GNU/Linux 12 (bookworm)"\nID=debian',
    }
    links = {
        "sys/class/net/can0/device": "sys/devices/pci0000:00/0000:00:14.0/usb1/1-2/1-2:1.0",
        "sys/devices/pci0000:00/0000:00:14.0/usb1/1-2/1-2:1.0/driver": "sys/bus/usb/drivers/gs_usb",
    }
    build(root, files, links)
    (root / "dev/cpu_dma_latency").chmod(0o600)
    return root


def industrial(root: Path) -> Path:
    """PREEMPT_RT, four cores, the last one isolated, and a card on PCIe; the machine is installed."""
    files = {
        **_kernel("6.1.0-26-rt-amd64", "#1 SMP PREEMPT_RT Debian 6.1.112-1 (2024-09-30)"),
        **_cores(4, "performance"),
        **_states(3, ("POLL", 0), ("C1", 2)),
        **interrupts(
            (128, "PCI-MSI 524288-edge      peak_pciefd", (9000, 0, 0, 0), "0"),
            (129, "PCI-MSI 1048576-edge      nvme0q4", (0, 0, 500, 0), "2"),
            (130, "PCI-MSI 1048577-edge      nvme0q3", (0, 0, 0, 0), "3"),
        ),
        "sys/kernel/realtime": "1",
        "proc/cpuinfo": "processor\t: 0\nmodel name\t: An industrial processor\nflags\t\t: fpu tsc",
        "proc/cmdline": "root=UUID=1 ro isolcpus=managed_irq,domain,3 nohz_full=3 irqaffinity=0-2",
        "sys/class/dmi/id/sys_vendor": "Maker of boxes",
        "sys/class/dmi/id/product_name": "Box 4",
        f"{CPU}/isolated": "3",
        f"{CPU}/nohz_full": "3",
        f"{CLOCK}/current_clocksource": "tsc",
        f"{CLOCK}/available_clocksource": "tsc hpet acpi_pm",
        "sys/kernel/mm/ksm/run": "0",
        "proc/sys/kernel/sched_rt_runtime_us": "-1",
        "proc/sys/kernel/sched_rt_period_us": "1000000",
        "proc/sys/vm/compact_unevictable_allowed": "0",
        "proc/swaps": "Filename\tType\tSize\tUsed\tPriority",
        "dev/cpu_dma_latency": "",
        "etc/systemd/system/directrix.service": LIMITS,
        "sys/class/net/can0/type": "280",
        "sys/devices/pci0000:00/0000:01:00.0/irq": "16",
        "sys/devices/pci0000:00/0000:01:00.0/msi_irqs/128": "msi",
        "etc/os-release": 'PRETTY_NAME="Debian GNU/Linux 12 (bookworm)"',
    }
    links = {
        "sys/class/net/can0/device": "sys/devices/pci0000:00/0000:01:00.0",
        "sys/devices/pci0000:00/0000:01:00.0/driver": "sys/bus/pci/drivers/peak_pciefd",
    }
    build(root, files, links)
    (root / "dev/cpu_dma_latency").chmod(0o660)
    return root


def raspberry(root: Path) -> Path:
    """A Raspberry Pi with a CAN controller on SPI: no BIOS, no sleep states, one line for the kernel."""
    files = {
        **_kernel("6.6.51+rpt-rpi-v8", "#1 SMP PREEMPT Debian 1:6.6.51-1+rpt3 (2024-10-08)"),
        **_cores(4, "ondemand"),
        **interrupts(
            (52, "GICv2 129 Level     mmc0", (77, 0, 0, 0), "0"),
            (56, "pinctrl-bcm2835  25 Level     spi0.0", (5000, 0, 0, 0), "0"),
        ),
        "proc/cpuinfo": "processor\t: 0\nCPU implementer\t: 0x41\nModel\t\t: Raspberry Pi 4 Model B Rev 1.4",
        "proc/device-tree/model": "Raspberry Pi 4 Model B Rev 1.4\0",
        "proc/cmdline": "console=tty1 root=PARTUUID=1 rootwait",
        f"{CLOCK}/current_clocksource": "arch_sys_counter",
        f"{CLOCK}/available_clocksource": "arch_sys_counter",
        "sys/kernel/mm/transparent_hugepage/enabled": "always [madvise] never",
        "proc/sys/kernel/sched_rt_runtime_us": "950000",
        "proc/sys/vm/compact_unevictable_allowed": "1",
        "proc/swaps": "Filename\tType\tSize\tUsed\tPriority\n/var/swap file 102396 0 -2",
        "dev/cpu_dma_latency": "",
        "boot/firmware/cmdline.txt": "console=tty1 root=PARTUUID=1 rootwait",
        "sys/class/net/can0/type": "280",
        "etc/os-release": 'PRETTY_NAME="Debian GNU/Linux 12 (bookworm)"',
    }
    links = {
        "sys/class/net/can0/device": "sys/devices/platform/soc/fe204000.spi/spi_master/spi0/spi0.0",
        "sys/devices/platform/soc/fe204000.spi/spi_master/spi0/spi0.0/driver": "sys/bus/spi/drivers/mcp251x",
    }
    build(root, files, links)
    (root / "dev/cpu_dma_latency").chmod(0o600)
    return root


def virtual(root: Path) -> Path:
    """Two cores of a host, with a virtual CAN interface, which is no device."""
    files = {
        **_kernel("6.1.0-26-cloud-amd64", "#1 SMP PREEMPT_DYNAMIC Debian 6.1.112-1 (2024-09-30)"),
        **_cores(2, ""),
        **interrupts((24, "PCI-MSI 65536-edge      virtio0-input.0", (10, 20), "1")),
        "proc/cpuinfo": "processor\t: 0\nmodel name\t: A server's\nflags\t\t: fpu tsc hypervisor",
        "sys/class/dmi/id/sys_vendor": "QEMU",
        "sys/class/dmi/id/product_name": "Standard PC (Q35 + ICH9, 2009)",
        f"{CLOCK}/current_clocksource": "kvm-clock",
        f"{CLOCK}/available_clocksource": "kvm-clock tsc acpi_pm",
        "sys/kernel/mm/transparent_hugepage/enabled": "always [madvise] never",
        "sys/kernel/mm/ksm/run": "1",
        "sys/kernel/mm/damon/admin/kdamonds/nr_kdamonds": "1",
        "sys/module/damon_reclaim/parameters/enabled": "Y",
        "proc/sys/kernel/numa_balancing": "1",
        "proc/sys/kernel/sched_rt_runtime_us": "950000",
        "proc/sys/vm/compact_unevictable_allowed": "1",
        "proc/swaps": "Filename\tType\tSize\tUsed\tPriority",
        "dev/cpu_dma_latency": "",
        "sys/class/net/vcan0/type": "280",
    }
    build(root, files)
    (root / "dev/cpu_dma_latency").chmod(0o600)
    return root


def container(root: Path) -> Path:
    """Of /proc what everybody sees, of /sys nothing."""
    files = {
        **_kernel("6.1.0-26-amd64", "#1 SMP PREEMPT_DYNAMIC Debian 6.1.112-1 (2024-09-30)"),
        "proc/cpuinfo": "processor\t: 0\nmodel name\t: A server's\nflags\t\t: fpu tsc",
        ".dockerenv": "",
    }
    return build(root, files)


def with_tick(root: Path, cores: str, priority: int, locked_kb: int, awake: bool = True) -> Path:
    """The same with a tick that runs."""
    columns = ["0"] * 50
    columns[7], columns[9] = "4096", "12"
    columns[37], columns[38] = str(priority), "1" if priority else "0"
    files = {
        f"proc/{TICK}/comm": "directrix-tick",
        f"proc/{TICK}/status": f"Name:\tdirectrix-tick\nVmLck:\t{locked_kb} kB\nCpus_allowed_list:\t{cores}",
        f"proc/{TICK}/stat": f"{TICK} (directrix-tick) {' '.join(columns)}",
    }
    build(root, files)
    folder = root / f"proc/{TICK}/fd"
    folder.mkdir()
    (folder / "7").symlink_to("/dev/cpu_dma_latency" if awake else "socket:[7]")
    return root
