"""The commissioning's network on a port whose queue is short, as every real one is."""

from __future__ import annotations

from collections import deque

import pytest

from drives import pdo
from drives.commissioning.network import Network

QUEUE = 20  # frames; what comes to a full queue is lost


class ShortPort:
    """Node 1 answers each SDO request at once, if there is room for the answer."""

    def __init__(self, late: list[bytes] | None = None) -> None:
        """``late``: answers that come between the next request and its own."""
        self.late = late or []
        self.queue: deque[bytes] = deque()

    def arrive(self, frame: bytes) -> None:
        if len(self.queue) < QUEUE:
            self.queue.append(frame)

    def send(self, frame: bytes | bytearray) -> bool:
        can_id, data = pdo.unpack(frame)
        if can_id == 0x601:
            for answer in self.late:
                self.arrive(bytes(pdo.frame(0x581, answer)))
            self.arrive(bytes(pdo.frame(0x581, b"\x4f" + bytes(data[1:4]) + b"\x08\0\0\0")))
        return True

    def receive_into(self, buffer: bytearray) -> bool:
        if self.queue:
            buffer[:] = self.queue.popleft()
            return True
        return False


def test_an_answer_is_not_lost_to_a_queue_that_heartbeats_have_filled_meanwhile() -> None:
    port, times = ShortPort(), iter(range(100))
    network = Network(port, lambda: float(next(times)))
    heard: list[int] = []
    network.hearer = lambda can_id, data: heard.append(can_id)
    for _ in range(3 * QUEUE):
        port.arrive(bytes(pdo.frame(pdo.HEARTBEAT + 1, b"\x05")))
    network.send_message(0x601, b"\x40\x61\x60\0\0\0\0\0")
    assert heard[-1] == 0x581


def test_only_a_plain_frame_of_a_node_tells_its_state() -> None:
    port, times = ShortPort(), iter(range(100))
    network = Network(port, lambda: float(next(times)))
    asked = bytes(pdo.frame(pdo.HEARTBEAT + 1 | pdo.REMOTE_FLAG, b"\0"))  # by the tick, of a drive it guards
    port.arrive(asked)
    port.arrive(bytes(pdo.frame(pdo.HEARTBEAT + 1 | pdo.EXTENDED_FLAG, b"\0")))
    network.receive()
    assert not network.booted and not network.nmt_states
    port.arrive(bytes(pdo.frame(pdo.HEARTBEAT + 1, b"\0")))
    network.receive()
    assert network.booted == {1}


LATE = {
    "another object": b"\x4b\x00\x10\0\x92\x01\0\0",
    "another sub-index": b"\x4f\x61\x60\x01\x07\0\0\0",
    "a download": b"\x60\x61\x60\0\0\0\0\0",
    "an abort": b"\x80\x40\x60\0\0\0\4\5",
}


@pytest.mark.parametrize("late", LATE.values(), ids=LATE)
@pytest.mark.parametrize("before", [False, True])
def test_a_late_answer_to_an_earlier_request_is_not_taken_for_one_to_this(late: bytes, before: bool) -> None:
    port, times = ShortPort([] if before else [late]), iter(range(100))
    network = Network(port, lambda: float(next(times)))
    if before:
        port.arrive(bytes(pdo.frame(0x581, late)))
    found: list[bytes] = []
    network.subscribe(0x581, lambda _can_id, data, _at: found.append(bytes(data)))
    network.send_message(0x601, b"\x40\x61\x60\0\0\0\0\0")
    assert found == [b"\x4f\x61\x60\0\x08\0\0\0"]


@pytest.mark.parametrize("names", [b"\x61\x60\0", b"\0\0\0"])
def test_an_abort_is_an_answer_also_from_a_drive_that_names_no_object_in_it(names: bytes) -> None:
    port, times = ShortPort([b"\x80" + names + b"\0\0\2\6"]), iter(range(100))
    network = Network(port, lambda: float(next(times)))
    found: list[bytes] = []
    network.subscribe(0x581, lambda _can_id, data, _at: found.append(bytes(data)))
    network.send_message(0x601, b"\x40\x61\x60\0\0\0\0\0")
    assert found[0][0] == 0x80
