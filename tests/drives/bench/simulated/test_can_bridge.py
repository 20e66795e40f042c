"""Simulated devices on a raw CAN socket; a socket pair stands for the interface."""

from __future__ import annotations

import select
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from support.drives.hub_process import ROOT, profile, served

from drives import pdo
from drives.bench.simulated import IoNode, SimulatedDrive
from drives.bench.simulated.can_bridge import MAX_WAITING, CanBridge, InterfaceError
from drives.bench.simulated.serve import open_server

HAS_CAN = hasattr(socket, "AF_CAN")
TIMEOUT_S = 20.0


class Wire:
    """The other end of the interface."""

    def __init__(self) -> None:
        self.mine, self.theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.bridge = CanBridge(self.theirs)
        for device in (SimulatedDrive(1), IoNode(9)):
            self.bridge.bus.attach(device)
        self._stopped = False
        self._thread = threading.Thread(target=self.bridge.run, args=(lambda: self._stopped,))
        self._thread.start()

    def put(self, can_id: int, data: bytes = b"") -> None:
        self.mine.send(pdo.frame(can_id, data))

    def hear(self, wanted: Callable[[int, bytes], bool]) -> bytes:
        """Data of the first frame that is wanted."""
        while select.select([self.mine], [], [], TIMEOUT_S)[0]:
            can_id, data = pdo.unpack(self.mine.recv(16))
            if wanted(can_id, data):
                return data
        raise AssertionError("it never came")

    def close(self) -> None:
        self._stopped = True
        self._thread.join()
        self.bridge.close()
        self.mine.close()


@pytest.fixture
def wire() -> Iterator[Wire]:
    made = Wire()
    yield made
    made.close()


def test_devices_boot_answer_and_report_on_the_interface(wire: Wire) -> None:
    wire.hear(lambda can_id, data: (can_id, data) == (0x709, b"\0"))
    wire.put(0x601, bytes.fromhex("4000100000000000"))
    assert wire.hear(lambda can_id, _: can_id == 0x581) == bytes.fromhex("4300100092010200")
    wire.put(0x000, bytes([1, 0]))
    wire.put(0x209, b"\x01\0\0\0")
    wire.put(0x080)
    assert wire.hear(lambda can_id, _: can_id == 0x181)[:2] == b"\x50\x02"


def test_frames_count_from_when_they_came_however_late_they_are_read() -> None:
    mine, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    bridge = CanBridge(theirs, sync_log=True)
    for _ in range(3):
        mine.send(pdo.frame(pdo.SYNC))
        time.sleep(0.1)
    bridge.turn(time.monotonic())
    first_s, second_s, third_s = bridge.syncs.times_s()
    assert second_s - first_s > 0.09 and third_s - second_s > 0.09
    bridge.close()
    mine.close()


def test_error_frames_stay_on_their_own_side(wire: Wire) -> None:
    wire.hear(lambda can_id, data: (can_id, data) == (0x709, b"\0"))
    wire.put(pdo.ERROR_FLAG | 0x40, bytes(8))
    wire.put(0x601, bytes.fromhex("4000100000000000"))
    wire.hear(lambda can_id, _: can_id == 0x581)
    assert wire.bridge.bus.frames < 10


def test_frames_wait_while_the_interface_takes_none_and_the_oldest_go_first() -> None:
    mine, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    theirs.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1)
    bridge = CanBridge(theirs)
    senders = [bridge.bus.connect(lambda _frame, _at_s: None) for _ in range(20)]  # each has its own queue
    for k in range(MAX_WAITING + 500):
        bridge.bus.submit(senders[k // 100], bridge.bus.now_s, 0x700, _frame(k))
    bridge.turn(bridge.bus.now_s)
    assert bridge.lost > 0
    mine.setblocking(False)
    got = []
    for _ in range(3000):
        try:
            got.append(int.from_bytes(mine.recv(16)[8:12], "little"))
        except BlockingIOError:
            bridge.turn(bridge.bus.now_s)
    assert got == sorted(got) and got[-1] == MAX_WAITING + 499
    bridge.close()
    mine.close()


@pytest.mark.skipif(not HAS_CAN, reason="this Python has no CAN sockets")
def test_an_interface_that_is_not_there_is_a_sentence() -> None:
    with pytest.raises(InterfaceError, match=r"no CAN sockets|ip link add nocan7 type vcan"):
        open_server(None, "nocan7")


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ([], "either the path"),
        (["p", "--socketcan", "c"], "either the path"),
        (["--socketcan", "nocan7"], "CAN"),
    ],
)
def test_the_command_line_says_what_it_cannot_do(options: list[str], sentence: str) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "drives.bench", *options], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode == 2 and sentence in done.stderr


def test_the_command_line_serves_axes_a_spindle_and_inputs(tmp_path: Path) -> None:
    path = tmp_path / "can"
    with served(path, "--nodes", "1", "--spindle", "10", "--io", "11") as process:
        assert [profile(path, node) for node in (1, 10, 11)] == [402, 402, 401]
        process.terminate()
        assert process.wait() == 0


def _frame(number: int) -> bytes:
    return bytes(pdo.frame(0x700, number.to_bytes(4, "little")))
