"""The commissioning's network on a port whose queue is short, as every real one is."""

from __future__ import annotations

from collections import deque

from drives import pdo
from drives.commissioning.network import Network

QUEUE = 20  # frames; what comes to a full queue is lost


class ShortPort:
    """Node 1 answers each SDO request at once, if there is room for the answer."""

    def __init__(self) -> None:
        self.queue: deque[bytes] = deque()

    def arrive(self, frame: bytes) -> None:
        if len(self.queue) < QUEUE:
            self.queue.append(frame)

    def send(self, frame: bytes | bytearray) -> bool:
        can_id, data = pdo.unpack(frame)
        if can_id == 0x601:
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
