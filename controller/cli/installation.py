"""What an installation of the services is: files, links and the commands that make them known.

The unit files are those of the folder ``systemd``, valid as they stand. Two things are put in: the
Python that runs this, and the machine's CAN interfaces with their bit rates. All of it lies
under /etc, so that one list says what an installation writes and what its end takes away.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path

from controller.machine import machine_file
from controller.machine.model import Bus, Machine

SERVICE, PANEL, TARGET = "directrix.service", "directrix-panel.service", "directrix.target"
UNITS = (TARGET, SERVICE, PANEL)
LINES = "directrix-dnc@.service"  # a template: a serial line each, for whom somebody enables it
UNIT_FOLDER = Path("/etc/systemd/system")
NETWORK_FOLDER = Path("/etc/systemd/network")
ENVIRONMENT = Path("/etc/directrix/directrix.env")
STATE = Path("/var/lib/directrix")
COMMAND = "directrix"
NETWORK_PREFIX = "70-directrix-"  # the first that matches counts: before Debian's 73-usb-net-by-mac.link

SHIPPED_PYTHON, SHIPPED_INTERFACE, SHIPPED_RATE = "/opt/directrix/bin/python", "can0", "BitRate=1000000"

# A wired interface may be named before it can carry a frame: systemd-networkd sets the bit rate
# after the kernel has told of the device. IFF_UP is bit 0 of the flags.
_CAN_DROP_IN = """\
# The controller starts when its CAN interfaces are there, and stops when one goes away.
[Unit]
BindsTo={devices}
After={devices} systemd-networkd.service
Wants=systemd-networkd.service

[Service]
ExecStartPre=/bin/sh -c 'for i in {interfaces}; \
do until [ $$(( $$(cat /sys/class/net/$$i/flags) & 1 )) = 1 ]; do sleep 0.1; done; done'
"""
_ENVIRONMENT_HEAD = """\
# Of both services; `directrix service install` writes this file once, then it is yours.
# DIRECTRIX_MACHINE   machine file (or the name of a shipped one)
# DIRECTRIX_SERVE     further options of `directrix serve`, for instance --simulate
# DIRECTRIX_PANEL     options of `directrix panel`
# DIRECTRIX_DNC       options of `directrix dnc receive`, for directrix-dnc@PORT.service
"""
_DEFAULTS = {
    "DIRECTRIX_MACHINE": "trunnion",
    "DIRECTRIX_SERVE": "",
    "DIRECTRIX_PANEL": '"--host 127.0.0.1 --port 8080"',
}


@dataclass(frozen=True, slots=True)
class File:
    """A file of an installation; ``path`` as the running system sees it."""

    path: Path
    text: str


@dataclass(frozen=True, slots=True)
class Link:
    """A symbolic link of an installation."""

    path: Path
    to: Path


def shipped() -> Path:
    """The folder of unit files: in an installed package beside the machine files, else in the checkout."""
    inside = machine_file.SHIPPED / "systemd"
    return inside if inside.is_dir() else machine_file.SHIPPED.parent / "systemd"


def interfaces(machine: Machine) -> list[Bus]:
    """The buses that are CAN interfaces of Linux."""
    return [bus for bus in machine.buses if bus.interface == "socketcan"]


def files(machine: Machine, python: str = sys.executable) -> list[File]:
    """Everything but the environment file, for this machine and this interpreter. Raises OSError."""
    texts = {name: _shipped(name).replace(SHIPPED_PYTHON, python) for name in (*UNITS, LINES)}
    made = [File(UNIT_FOLDER / name, text) for name, text in texts.items()]
    made.append(File(Path("/etc/sysusers.d/directrix.conf"), _shipped("directrix.sysusers")))
    made.append(File(Path("/etc/tmpfiles.d/directrix.conf"), _shipped("directrix.tmpfiles")))
    buses = interfaces(machine)
    for bus in buses:
        made += [_of_interface(bus, kind) for kind in ("network", "link")]
    return [*made, _drop_in(buses)] if buses else made


def _shipped(name: str) -> str:
    return (shipped() / name).read_text()


def _of_interface(bus: Bus, kind: str) -> File:
    text = _shipped(f"{NETWORK_PREFIX}can.{kind}").replace(f"Name={SHIPPED_INTERFACE}", f"Name={bus.channel}")
    text = text.replace(SHIPPED_RATE, f"BitRate={bus.bit_rate}")
    return File(NETWORK_FOLDER / f"{NETWORK_PREFIX}{bus.channel}.{kind}", text)


def _drop_in(buses: list[Bus]) -> File:
    names = [bus.channel for bus in buses]
    text = _CAN_DROP_IN.format(devices=" ".join(map(device, names)), interfaces=" ".join(names))
    return File(UNIT_FOLDER / f"{SERVICE}.d" / "can.conf", text)


def device(interface: str) -> str:
    """systemd's unit of a network interface, its name escaped as `systemd-escape` does."""
    plain = "".join(c if c.isalnum() or c in ":_." else f"\\x{ord(c):02x}" for c in interface)
    return f"sys-subsystem-net-devices-{plain}.device"


def links(machine: Machine) -> list[Link]:
    """What `systemctl enable` would make; and an interface that is plugged in again starts the service.

    It may: nothing moves, the drives come up switched off.
    """
    wants = [f"{device(bus.channel)}.wants/{SERVICE}" for bus in interfaces(machine)]
    made = [Link(UNIT_FOLDER / want, UNIT_FOLDER / SERVICE) for want in wants]
    return [Link(UNIT_FOLDER / "multi-user.target.wants" / TARGET, UNIT_FOLDER / TARGET), *made]


def environment(present: str | None, machine: str | None, serve: str | None, panel: str | None) -> str:
    """The environment file: what is there stays as it is, but for what was asked for now."""
    text = present
    if text is None:
        text = _ENVIRONMENT_HEAD + "".join(f"{key}={value}\n" for key, value in _DEFAULTS.items())
    asked = {"DIRECTRIX_MACHINE": machine, "DIRECTRIX_SERVE": serve, "DIRECTRIX_PANEL": panel}
    for key, value in asked.items():
        if value is not None:
            text = _with(text, key, value)
    return text


def _with(text: str, key: str, value: str) -> str:
    kept = [line for line in text.splitlines() if not line.startswith(f"{key}=")]
    written = f'{key}="{value}"' if " " in value else f"{key}={value}"
    return "\n".join([*kept, written]) + "\n"


def machine_named_in(text: str) -> str:
    """DIRECTRIX_MACHINE of an environment file."""
    for line in reversed(text.splitlines()):
        key, _, value = line.partition("=")
        if key == "DIRECTRIX_MACHINE":
            return value.strip().strip('"')
    return _DEFAULTS["DIRECTRIX_MACHINE"]


def machine_file_of(state: Path, root: Path = Path("/")) -> Path | None:
    """Where the installed service reads its machine file from; None for another's state folder."""
    environment = root / ENVIRONMENT.relative_to("/")
    if state.resolve() != (root / STATE.relative_to("/")).resolve() or not environment.is_file():
        return None
    named = Path(machine_named_in(environment.read_text()))
    return named if named.is_absolute() else None


def written(root: Path) -> list[Path]:
    """Every file and link of an installation below ``root``, whatever machine it was made for."""
    system = "etc/systemd/system"
    return _matching(
        root,
        *((system, name) for name in (*UNITS, LINES)),
        (f"{system}/{SERVICE}.d", "can.conf"),
        (f"{system}/*.wants", SERVICE),
        (f"{system}/*.wants", TARGET),
        ("etc/systemd/network", "[0-9][0-9]-directrix-*"),  # of versions with another prefix, too
        ("etc/sysusers.d", "directrix.conf"),
        ("etc/tmpfiles.d", "directrix.conf"),
    )


def enabled_lines(root: Path) -> list[Path]:
    """Links of the serial lines that somebody enabled: another installation leaves them, its end does not."""
    return _matching(root, ("etc/systemd/system/*.wants", LINES.replace("@", "@*")))


def _matching(root: Path, *patterns: tuple[str, str]) -> list[Path]:
    # Names by hand: a link below another root points at nothing, and `glob` would pass it by.
    folders = {(folder, name) for where, name in patterns for folder in root.glob(where)}
    return sorted(path for folder, name in folders for path in folder.iterdir() if fnmatch(path.name, name))
