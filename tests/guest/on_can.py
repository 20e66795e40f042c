"""Machines, drives and eyes on a CAN interface of Linux, for the tests in the guest."""

from __future__ import annotations

import contextlib
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from guest import absence
from support.live.live_machines import Listener, Live, now_of, session, until
from support.machines.stepped_runs import shipped

from controller.ipc.handoff import Snapshot
from controller.machine.model import Bus, Machine
from controller.runtime.startup import SessionError
from controller.state.modes import Fault
from drives import pdo

HERE = Path(__file__).parent
PERIOD_S = 0.01  # what a guest on a busy computer keeps; limits are counted, never timed
# Behind a serial adapter each frame waits for a turn of the kernel's workers as well, one after the other:
# there and back takes 2 to 8 ms, so that 10 ms are no time for an answer.
SERIAL_PERIOD_S = 0.025
# A computer may be away from its guest for longer than a machine may bear: then it is tried again.
ATTEMPTS = 4
HELD_UP = (Fault.PLANNER_GONE, Fault.TOO_MANY_SKIPS, Fault.FEEDBACK_LOST, Fault.SYNC_LOST)


def held_up(fault: Fault) -> bool:
    """Whether that fault may be the computer's; told with its figures, whichever they are."""
    if fault not in HELD_UP:
        return False
    found = absence.figures()
    print(f"{fault.name}; {found}")  # shown where the test fails
    return found.away()


def skip_if_away(away: bool) -> None:
    """After the last attempt: a computer that was away in each of them has shown nothing."""
    if away:
        pytest.skip(f"the computer was away, {ATTEMPTS} times: {absence.figures()}")


SIMULATED = (sys.executable, "-m", "drives.bench", "--socketcan")


def machine(interface: str = "vcan0", period_s: float = PERIOD_S) -> Machine:
    """The shipped trunnion on a CAN interface."""
    bus = Bus("can0", "socketcan", interface, 1_000_000)
    return shipped(period_s=period_s, buses=(bus,), skip_limit_per_s=50.0)


@contextlib.contextmanager
def drives(interface: str = "vcan0") -> Iterator[subprocess.Popen[bytes]]:
    """Five simulated drives, switched on, in a process of their own."""
    process = subprocess.Popen([*SIMULATED, interface])
    try:
        yield process
    finally:
        process.kill()
        process.wait()


@contextlib.contextmanager
def ready(text: str, machine: Machine) -> Iterator[tuple[Live, Snapshot]]:
    """A session that has come up, and its snapshot then."""
    for left in reversed(range(ATTEMPTS)):
        with session(text, machine) as running:
            try:
                start = running.ready()
            except SessionError:
                away = held_up(now_of(running).fault)
                if left and away:
                    continue
                skip_if_away(away)
                raise
            yield running, start
            return


@contextlib.contextmanager
def drives_when_up(interface: str) -> Iterator[None]:
    """The same on an interface that somebody else brings up."""
    until(lambda: int(Path(f"/sys/class/net/{interface}/flags").read_text(), 16) & 1)
    with drives(interface):
        yield


def ip(*words: str) -> str:
    """The ``ip`` command; its output. Raises CalledProcessError."""
    return subprocess.run(["ip", *words], check=True, capture_output=True, text=True).stdout


@contextlib.contextmanager
def adapter(behind: str = "vcan0") -> Iterator[Callable[[str], None]]:
    """A serial adapter between ``can0``, which is up, and ``behind``; gives the way to tell it things."""
    program = [sys.executable, str(HERE / "adapter.py"), behind]
    process = subprocess.Popen(program, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert process.stdin is not None and process.stdout is not None
    said = process.stdin

    def tell(word: str) -> None:
        said.write(f"{word}\n".encode())
        said.flush()

    try:
        assert process.stdout.readline() == b"ready\n"
        ip("link", "set", "can0", "txqueuelen", "128", "type", "can", "bitrate", "1000000")
        ip("link", "set", "can0", "up")
        yield tell
    finally:
        process.kill()
        process.wait()


def up(wanted: bool, interface: str = "vcan0") -> None:
    """Bring an interface up or down."""
    ip("link", "set", interface, "up" if wanted else "down")


def transmit_queue(frames: int, interface: str = "vcan0") -> None:
    """Make an interface's transmit queue so long; with 0 every frame is refused with ENOBUFS."""
    subprocess.run(f"tc qdisc replace dev {interface} root pfifo limit {frames}".split(), check=True)


def error_frame(classes: int, data: bytes, interface: str = "vcan0") -> None:
    """What a CAN controller would report, put on an interface that has none (linux/can/error.h)."""
    with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as bus:
        bus.bind((interface,))
        bus.send(pdo.FRAME.pack(pdo.ERROR_FLAG | classes, 8, data))


def stopped(machine: Machine) -> bool:
    """Waits until every drive says by SDO that it does not follow us; then whether all stand.

    Without torque (switch on disabled, fault), or holding a gravity axis (quick stop active).
    """
    listener = Listener(machine)
    for node in range(1, 6):  # CiA 402, statusword: 4Fh and 6Fh leave out what means nothing there
        until(lambda node=node: _has_stopped(listener.read(node, 0x6041)))
    return until(lambda: _positions(listener) == _positions(listener))


def _has_stopped(statusword: int) -> bool:
    return statusword & 0x4F in (0x40, 0x08) or statusword & 0x6F == 0x07


def _positions(listener: Listener) -> list[int]:
    return [listener.read(node, 0x6064) for node in range(1, 6)]
