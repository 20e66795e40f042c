"""The services of a machine under the guest's systemd, for tests: installed, started, looked at.

The installation lies in /opt/directrix, as README proposes: this checkout, the packages of this
Python and the Python itself are put there by bind mounts, because a service sees neither /root nor
/home nor /tmp, where they may come from.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path
from typing import Any

from guest import on_can
from living import until

from controller import config
from controller.commands.installation import ENVIRONMENT, PANEL, SERVICE, TARGET
from controller.door import Client, DoorError, control_path
from drives import bus, pdo

REPO = Path(__file__).parents[3]
OPT = Path("/opt/directrix")
MACHINE = Path("/etc/directrix/machine.toml")
RUNTIME = Path("/run/directrix")
INTERFACE = "vcan0"
SPEED_MM_S = 10.0
STOPPED_WITHIN_S = 1.0  # heartbeat time, ramp, and the time until somebody looked
_PYTHON = OPT / "python/bin" / os.path.basename(os.path.realpath(sys.executable))


def prepare() -> None:
    """Python, packages and source under /opt/directrix; machine and environment under /etc/directrix."""
    folders = {"python": sys.base_prefix, "packages": sysconfig.get_paths()["purelib"], "source": str(REPO)}
    for name, source in folders.items():
        (OPT / name).mkdir(parents=True, exist_ok=True)
        subprocess.run(["mount", "--bind", source, str(OPT / name)], check=True)
    MACHINE.parent.mkdir(parents=True, exist_ok=True)
    MACHINE.write_text(_machine_text())
    shutil.copy(REPO / "config" / "tools.toml", MACHINE.parent)
    ENVIRONMENT.write_text("".join(f"{key}={value}\n" for key, value in _environment().items()))


def _environment() -> dict[str, str]:
    return {"PYTHONPATH": f"{OPT}/source:{OPT}/packages", "LD_LIBRARY_PATH": str(OPT / "python/lib")}


def _machine_text() -> str:
    """The shipped trunnion on vcan0, at a period that a guest keeps."""
    changes = {
        "period_s = 0.002": f"period_s = {on_can.PERIOD_S}",
        "skip_limit_per_s = 25.0": "skip_limit_per_s = 50.0",
        'interface = "virtual"': f'interface = "socketcan"\nchannel = "{INTERFACE}"',
    }
    text = (REPO / "config" / "trunnion.toml").read_text()
    for old, new in changes.items():
        assert old in text, old
        text = text.replace(old, new)
    return text


def run(*words: str, check: bool = True) -> str:
    """A command; its output, both kinds. Raises AssertionError with it."""
    done = subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert done.returncode == 0 or not check, f"{' '.join(words)}: {done.returncode}\n{done.stdout}"
    return done.stdout


def directrix(*words: str, check: bool = True) -> str:
    """The installed command line, as root."""
    environment = {**os.environ, **_environment()}
    command = [str(_PYTHON), "-P", "-m", "controller", *words]
    done = subprocess.run(
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    assert done.returncode == 0 or not check, f"{words}: {done.returncode}\n{done.stdout}"
    return done.stdout


def shown(what: str, unit: str = SERVICE) -> str:
    """A property of a unit."""
    return run("systemctl", "show", "-P", what, unit).strip()


def active(unit: str = SERVICE) -> bool:
    return shown("ActiveState", unit) == "active"


def told(unit: str = SERVICE) -> str:
    """The end of a unit's journal, for a failed test."""
    return run("journalctl", "--no-pager", "-n", "40", "-o", "cat", "-u", unit, check=False)


def pid_of(name: str) -> int:
    """The process of that name (15 characters of it) in the controller's control group; 0 = none."""
    group = Path("/sys/fs/cgroup") / shown("ControlGroup").lstrip("/") / "cgroup.procs"
    with contextlib.suppress(OSError):
        for pid in group.read_text().split():
            if Path(f"/proc/{pid}/comm").read_text().strip() == name[:15]:
                return int(pid)
    return 0


class Machine:
    """The running controller, spoken to by its local socket."""

    def __init__(self) -> None:
        self._client = Client(control_path(RUNTIME), 120.0)

    def ask(self, verb: str, **args: Any) -> dict[str, Any]:
        return self._client.ask(verb, **args)

    def mode(self) -> str:
        """ "" while nobody answers."""
        try:
            return str(self.ask("status")["mode"])
        except DoorError:
            return ""

    def x_mm(self) -> float:
        """Where the drive of X says that it is."""
        return float(self.ask("status")["joints"]["X"]["actual"])

    def moving(self) -> float:
        """Homed, enabled and on its way along X for a long time; where it is (mm)."""
        until(lambda: self.mode() == "OFF")
        self.ask("home", axes=None)
        until(lambda: not self.ask("status")["not_homed"])
        self.ask("enable")
        until(lambda: self.mode() == "READY")
        self.ask("mdi", text=f"G21 G90 G1 X150. F{60.0 * SPEED_MM_S}")
        until(lambda: self.mode() == "RUNNING" and self.x_mm() > 1.0)
        return self.x_mm()

    def stands(self, since_mm: float) -> bool:
        """After a restart: the drives are off and X is near to where it was when things went wrong.

        Nobody else may ask the drives by SDO meanwhile: the controller, which does, would get the answers.
        """
        until(lambda: self.mode() == "OFF")
        off = all(drive["statusword"] & 0x6F != 0x27 for drive in self.ask("status")["drives"])
        place_mm = self.x_mm()
        return off and abs(place_mm - since_mm) < STOPPED_WITHIN_S * SPEED_MM_S and self.x_mm() == place_mm

    def reset_to_off(self) -> bool:
        """After a fault; whether it is over. Another start of the service is as good."""
        if self.mode() == "FAULT":
            with contextlib.suppress(DoorError):
                self.ask("reset")
        return self.mode() == "OFF"

    def off(self) -> bool:
        """Up again, and nothing has begun by itself."""
        until(lambda: self.mode() == "OFF")
        status = self.ask("status")
        return not status.get("job") and not status.get("spindle", {}).get("actual_rev_min")


def drives_stand() -> bool:
    """Without a controller: whether the drives stand, by SDO; stopped nodes are woken for it."""
    machine = on_can.machine(INTERFACE)
    (settings,) = config.bus_settings(machine)
    port = bus.open(settings)
    port.send(pdo.frame(pdo.NMT, bytes((0x80, 0))))  # enter pre-operational, all nodes
    port.close()
    return on_can.stopped(machine)


def start() -> Machine:
    """Both services, which may run already; returns when both are active, with the counters at zero."""
    run("systemctl", "reset-failed")
    try:
        run("systemctl", "start", TARGET, SERVICE, PANEL)
        until(lambda: active() and active(PANEL))
    except AssertionError as error:
        raise AssertionError(f"{error}\n{told()}\n{told(PANEL)}") from None
    return Machine()


def stop() -> None:
    run("systemctl", "stop", TARGET, SERVICE, PANEL)
