"""The services of a machine under the guest's systemd, for tests: installed, started, looked at.

The installation lies in /opt/directrix, as systemd/README.md proposes: this checkout, the packages of this
Python and the Python itself are put there by bind mounts, because a service sees neither /root nor
/home nor /tmp, where they may come from.

The guest has one core for everything, and it may be a busy one. So nothing here is timed: states are
waited for, and asked for seldom enough to leave the core to those who are to reach them.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import socket
import subprocess
import sys
import sysconfig
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

from guest import absence, on_can

from controller.cli.installation import ENVIRONMENT, PANEL, SERVICE, STATE, TARGET
from controller.ipc.control_socket import Client, CommandRefused, control_path
from controller.machine import machine_file
from drives import bus, pdo

REPO = Path(__file__).parents[3]
OPT = Path("/opt/directrix")
MACHINE = Path("/etc/directrix/machine.toml")
RUNTIME = Path("/run/directrix")
INTERFACE = "vcan0"
PANEL_AT = ("127.0.0.1", 8080)
POLL_S = 0.1
LOOKS_FOR_A_FRAME = 50  # after that a drive that was not heard will not be
# What comes of it when tick and drives are kept from each other for longer than a machine may bear.
HELD_UP = {fault.name for fault in on_can.HELD_UP} | {"EMCY", "HEARTBEAT_LOST", "NODE_RESET", "STATE_LOST"}
LOST = {"FEEDBACK_LOST", "SYNC_LOST"}  # what a sound machine does by itself only where it was held up
HANGS_S = 150.0  # no test is meant to come near
SO_RCVBUFFORCE = 33  # asm-generic/socket.h
KEPT_BYTES = 1 << 26  # of frames: some minutes
_PYTHON = OPT / "python/bin" / os.path.basename(os.path.realpath(sys.executable))


def until(done: Callable[[], Any], what: Callable[[], object] = str) -> Any:
    """Waits for something to become true, and gives it; ``what`` is told where it does not."""
    give_up_s = time.monotonic() + HANGS_S
    while not (found := done()):
        assert time.monotonic() < give_up_s, f"waited in vain: {what()}"
        time.sleep(POLL_S)
    return found


# --- installation ------------------------------------------------------------------------


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


# --- commands ----------------------------------------------------------------------------


def run(*words: str, check: bool = True, **more: Any) -> str:
    """A command; its output, both kinds. Raises AssertionError with it."""
    done = subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **more)
    assert done.returncode == 0 or not check, f"{' '.join(words)}: {done.returncode}\n{done.stdout}"
    return done.stdout


def directrix(*words: str, check: bool = True, **more: Any) -> str:
    """The installed command line, as root."""
    environment = {**os.environ, **_environment()}
    return run(str(_PYTHON), "-P", "-m", "controller", *words, check=check, env=environment, **more)


def shown(what: str, unit: str = SERVICE) -> str:
    """A property of a unit."""
    return run("systemctl", "show", "-P", what, unit).strip()


def active(unit: str = SERVICE) -> bool:
    return shown("ActiveState", unit) == "active"


def restarts(unit: str = SERVICE) -> int:
    """How often systemd started it again by itself, since ``start``."""
    return int(shown("NRestarts", unit))


def told(unit: str = SERVICE) -> str:
    """The end of a unit's journal."""
    return run("journalctl", "--no-pager", "-n", "40", "-o", "cat", "-u", unit, check=False)


def pid_of(name: str) -> int:
    """The process of that name (15 characters of it) in the controller's control group; 0 = none."""
    group = Path("/sys/fs/cgroup") / shown("ControlGroup").lstrip("/") / "cgroup.procs"
    with contextlib.suppress(OSError):
        for pid in group.read_text().split():
            if Path(f"/proc/{pid}/comm").read_text().strip() == name[:15]:
                return int(pid)
    return 0


def start() -> Machine:
    """Both services, which may run already; returns when both are active, with the counters at zero."""
    run("systemctl", "reset-failed")
    try:
        run("systemctl", "start", TARGET, SERVICE, PANEL)
        until(lambda: active() and active(PANEL) and panel_answers())  # its start is work for the only core
    except AssertionError as error:
        raise AssertionError(f"{error}\n{told()}\n{told(PANEL)}") from None
    return Machine()


def undisturbed(machine: Machine, act: Callable[[], None], expected: str = "") -> None:
    """``act``, and once more where it failed, another alarm than expected tells of a guest that was held
    up, and the computer's own figures do, too; skipped with these where they did each time.
    """
    for left in reversed(range(on_can.ATTEMPTS)):
        before = machine.newest_alarm()
        try:
            return act()
        except AssertionError:
            found = (machine.alarms(before) & HELD_UP) - {expected}
            figures = absence.figures()
            print(f"{found or 'no alarm'}; {figures}")  # shown where the test fails
            if not found or not figures.away():
                raise
            if not left:
                on_can.skip_if_away(True)
            warnings.warn(f"it is done anew: {found}; {figures}", stacklevel=2)


def panel_answers() -> bool:
    with contextlib.suppress(OSError), socket.create_connection(PANEL_AT):
        return True
    return False


def stop() -> None:
    run("systemctl", "stop", TARGET, SERVICE, PANEL)


def unreadable_for_the_panel() -> list[str]:
    """Files of the state folder that the panel's user cannot read."""
    found = run("runuser", "-u", "directrix-panel", "--", "find", str(STATE), "-type", "f", "!", "-readable")
    return found.splitlines()


# --- the machine, and what is seen of it on the bus -----------------------------------------


class Machine:
    """The running controller, spoken to by its local socket."""

    FEED_MM_MIN = 600.0
    FAR_MM = 150.0

    def __init__(self) -> None:
        self._client = Client(control_path(RUNTIME), HANGS_S)
        self._from_mm: float | None = None
        self._sound = False  # since it is to move: a fault from then on is this motion's

    def ask(self, verb: str, **args: Any) -> dict[str, Any]:
        return self._client.ask(verb, **args)

    def status(self) -> dict[str, Any]:
        """Empty while nobody answers."""
        try:
            return self.ask("status")
        except CommandRefused:
            return {}

    def mode(self) -> str:
        """ "" while nobody answers."""
        return str(self.status().get("mode", ""))

    def x_mm(self) -> float:
        """Where the drive of X says that it is."""
        return float(self.ask("status")["joints"]["X"]["actual"])

    def moving(self) -> None:
        """Homed, enabled and on a long way along X."""
        self._from_mm, self._sound = None, False
        until(self._is_moving, self.status)

    def _is_moving(self) -> bool:
        """One step towards it, whatever the machine's state is; a fault on the way is reset, and told.

        AssertionError when it lost drives or SYNC while the computer was there.
        """
        status = self.status()
        mode = status.get("mode", "")
        if not mode or "joints" not in status or (status["sequence"] or {}).get("state") == "running":
            return False
        x_mm = float(status["joints"]["X"]["actual"])
        if mode == "RUNNING" and self._from_mm is not None and abs(x_mm - self._from_mm) > 1.0:
            return True
        self._sound = self._sound or mode != "FAULT"
        with contextlib.suppress(CommandRefused):  # refused: the next look will show why
            if mode == "FAULT":
                if self._sound and status["fault"]["name"] in LOST:
                    figures = absence.figures()
                    assert figures.away(), f"{status['fault']}; {figures}"
                warnings.warn(f"on the way to a motion: {status['fault']}", stacklevel=2)
                self.ask("reset")
            elif mode == "OFF":
                self.ask("home" if status["not_homed"] else "enable")
            elif mode == "READY":
                self._from_mm = x_mm
                end_mm = self.FAR_MM if x_mm < self.FAR_MM / 2.0 else 0.0
                self.ask("mdi", text=f"G21 G90 G1 X{end_mm} F{self.FEED_MM_MIN}")
        return False

    def off(self) -> bool:
        """Waits until it is up again with its drives set; whether nothing has begun by itself."""
        until(self._settled, self.status)
        began = self.ask("status")
        until(self.back_to_off, self.status)
        return not began["job"] and not began["spindle"]["actual_rev_min"]

    def _settled(self) -> bool:
        status = self.status()
        return (
            status.get("mode") == "OFF"
            and "joints" in status
            and (status["sequence"] or {}).get("state") != "running"
        )

    def back_to_off(self) -> bool:
        """One step towards it from wherever the machine is; whether it is there, with its drives set.

        Drives that did not take their settings, for instance because this guest kept them waiting,
        are told and tried again by a reset, as the alarm says.
        """
        status = self.status()
        if not status or (status["sequence"] or {}).get("state") == "running":
            return False
        if self._settled() and status["commissioned"]:
            return True
        if status["mode"] == "OFF" and not status["commissioned"]:
            warnings.warn(f"its drives are not set: {status['sequence']}", stacklevel=2)
        asked = {"READY": "disable", "FAULT": "reset", "OFF": "reset"}.get(status["mode"], "stop")
        with contextlib.suppress(CommandRefused):
            self.ask("reset" if not status["tick_alive"] else asked)
        return False

    def alarms(self, after: int = -1) -> set[str]:
        """Names of all that came after that number."""
        return {alarm["name"] for alarm in self.ask("alarms")["alarms"] if alarm["id"] > after}

    def newest_alarm(self) -> int:
        return max((int(alarm["id"]) for alarm in self.ask("alarms")["alarms"]), default=-1)


class Witness:
    """Hears what the drive of X is told and what it answers, from now on; all in counts, from the bus itself.

    The kernel keeps the frames while this process waits for its turn. What it shows holds however late
    anybody looks: a drive stands within ``STRAY_MM`` of the last setpoint that it got while it was enabled.
    """

    NODE = 1
    STRAY_MM = 5.0  # of 150: heartbeat time and ramp at 10 mm/s, and as much again for a guest that stalls
    ON_PATH_MM = 0.15  # one period at 10 mm/s, and half: the last setpoint may not have been used
    AT_REST = 20  # feedbacks

    def __init__(self) -> None:
        self._machine = on_can.machine(INTERFACE)
        (settings,) = machine_file.bus_settings(self._machine)
        self._command, self._feedback = pdo.RPDO1 + self.NODE, pdo.TPDO1 + self.NODE
        self._port = bus.open(settings, [(self._command, 0x7FF), (self._feedback, 0x7FF)])
        with socket.socket(fileno=os.dup(self._port.fileno())) as own:  # else the newest frames are lost
            own.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, KEPT_BYTES)
        self._buffer = bytearray(pdo.FRAME_BYTES)
        self._told = 0
        self.said: list[tuple[int, int]] = []  # statusword, position; newest last

    def __enter__(self) -> Witness:
        return self

    def __exit__(self, *_: object) -> None:
        self._port.close()

    def _listen(self) -> None:
        while self._port.receive_into(self._buffer):
            can_id, data = pdo.unpack(self._buffer)
            first, second = pdo.COMMAND.unpack(data[: pdo.PDO_BYTES])
            if can_id == self._feedback:
                self.said.append((first, second))
            else:
                self._told = second if _enabled(first) else self._told

    def forget(self) -> None:
        """What comes from now on counts."""
        self._listen()
        self.said.clear()

    def stands(self, machine: Machine) -> bool:
        """Waits until the drive says many times that it is off and where it was; whether that is near.

        ``forget`` is to be called when the controller is back, or it is the time before that is seen.
        """
        looks = iter(range(LOOKS_FOR_A_FRAME))
        until(lambda: self._rests() or (next(looks, None) is None and self._wakes(machine)), machine.status)
        return self.stray_mm() < self.STRAY_MM

    def _wakes(self, machine: Machine) -> bool:
        """A drive that is silent has left NMT operational: this guest kept its controller from it.

        While all is off that is no fault yet. To switch on makes it one, whose reset sets the drives anew.
        """
        if not self.said:
            warnings.warn("a drive fell silent while all was off", stacklevel=2)
            with contextlib.suppress(CommandRefused):
                machine.ask("enable")
            until(machine.back_to_off, machine.status)
        return False

    def stray_mm(self) -> float:
        """From the last setpoint to where the drive is."""
        self._listen()
        return abs(self.said[-1][1] - self._told) / abs(self._machine.axes[0].counts_per_unit)

    def on_the_path(self) -> bool:
        """Waits until the drive says many times the same place; whether that is the last setpoint."""
        until(self._same, lambda: self.said[-self.AT_REST :])
        return self.stray_mm() < self.ON_PATH_MM

    def _rests(self) -> bool:
        """CiA 402: 27h is "operation enabled"."""
        return self._same() and all(word & 0x6F != 0x27 for word, _ in self.said[-self.AT_REST :])

    def _same(self) -> bool:
        self._listen()
        last = self.said[-self.AT_REST :]
        return len(last) == self.AT_REST and len({position for _, position in last}) == 1


def _enabled(controlword: int) -> bool:
    """CiA 402: enable operation."""
    return controlword & 0x8F == 0x0F


def drives_stand() -> bool:
    """Without a controller: whether the drives stand, by SDO; stopped nodes are woken for it."""
    machine = on_can.machine(INTERFACE)
    (settings,) = machine_file.bus_settings(machine)
    port = bus.open(settings)
    port.send(pdo.frame(pdo.NMT, bytes((0x80, 0))))  # enter pre-operational, all nodes
    port.close()
    return on_can.stopped(machine)
