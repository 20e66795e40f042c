"""One simulated drive on a stepped bus, and a hand that puts frames on it, for tests."""

from __future__ import annotations

import struct
from pathlib import Path

from drives import pdo
from drives.bench.simulated import Parameters, SimulatedDrive
from drives.bench.simulated.data_sheet import EDS
from drives.bench.virtual.virtual_bus import SteppedBus

PERIOD_S = 0.002
START, STOP, PRE_OPERATIONAL, RESET_NODE, RESET_COMMUNICATION = 0x01, 0x02, 0x80, 0x81, 0x82


class Refused(Exception):
    """An SDO abort; ``code`` says which."""

    def __init__(self, code: int) -> None:
        super().__init__(f"{code:08x}")
        self.code = code


class Lone:
    """Node 5 unless told otherwise. ``heard`` has (identifier, data) of all it sent, ``at_s`` the times."""

    def __init__(self, parameters: Parameters | None = None, node: int = 5, eds: Path = EDS) -> None:
        self.bus = SteppedBus()
        self.drive = SimulatedDrive(node, parameters or Parameters(), eds)
        self.bus.attach(self.drive)
        self.heard: list[tuple[int, bytes]] = []
        self.at_s: list[float] = []
        self._source = self.bus.connect(self._hear)
        self.wait(0.03)

    @property
    def node(self) -> int:
        return self.drive.node

    def _hear(self, frame: bytes, at_s: float) -> None:
        can_id, data = pdo.unpack(frame)
        self.heard.append((can_id, bytes(data)))
        self.at_s.append(at_s)

    def wait(self, seconds: float) -> None:
        self.bus.advance(self.bus.now_s + seconds)

    def put(self, can_id: int, data: bytes = b"", wait_s: float = 0.001) -> list[tuple[int, bytes]]:
        """Send a frame; what came back within the wait."""
        before = len(self.heard)
        self.bus.submit(self._source, self.bus.now_s, can_id, bytes(pdo.frame(can_id, data)))
        self.wait(wait_s)
        return self.heard[before:]

    def nmt(self, command: int, wait_s: float = 0.03) -> None:
        self.put(pdo.NMT, bytes([command, self.node]), wait_s)

    def sync(self, data: bytes = b"", wait_s: float = PERIOD_S) -> list[tuple[int, bytes]]:
        return self.put(pdo.SYNC, data, wait_s)

    def of(self, can_id: int) -> list[bytes]:
        """Data of all frames heard with one identifier."""
        return [data for heard, data in self.heard if heard == can_id]

    def times(self, can_id: int) -> list[float]:
        return [at_s for (heard, _), at_s in zip(self.heard, self.at_s, strict=True) if heard == can_id]

    def emergencies(self) -> list[int]:
        return [int.from_bytes(data[:2], "little") for data in self.of(pdo.EMCY + self.node)]

    # -- SDO

    def sdo(self, request: bytes, wait_s: float = 0.002) -> list[bytes]:
        """The answers to one request frame."""
        came = self.put(0x600 + self.node, request.ljust(8, b"\0"), wait_s)
        return [data for can_id, data in came if can_id == pdo.SDO_ANSWER + self.node]

    def ask(self, request: bytes) -> bytes:
        """The one answer to a request frame. Raises Refused."""
        (answer,) = self.sdo(request)
        if answer[0] == 0x80:
            raise Refused(int.from_bytes(answer[4:], "little"))
        return answer

    def write(self, index: int, sub: int, value: int, size: int) -> None:
        """An expedited download. Raises Refused."""
        head = struct.pack("<BHB", 0x23 | (4 - size) << 2, index, sub)
        self.ask(head + (value & (1 << 8 * size) - 1).to_bytes(size, "little"))

    def read(self, index: int, sub: int = 0, signed: bool = False) -> int:
        """An expedited upload. Raises Refused."""
        answer = self.ask(struct.pack("<BHB", 0x40, index, sub))
        size = 4 - (answer[0] >> 2 & 3)
        return int.from_bytes(answer[4 : 4 + size], "little", signed=signed)

    def map(
        self, parameters: int, mapping: int, entries: list[int], kind: int, can_id: int, **times: int
    ) -> None:
        """Remap a PDO by CiA 301's procedure: off, type and times, count 0, entries, count, on."""
        self.write(parameters, 1, can_id | 0x8000_0000, 4)
        self.write(parameters, 2, kind, 1)
        for name, value in times.items():
            sub, size = {"inhibit": (3, 2), "event": (5, 2), "start": (6, 1)}[name]
            self.write(parameters, sub, value, size)
        self.write(mapping, 0, 0, 1)
        for sub, entry in enumerate(entries, 1):
            self.write(mapping, sub, entry, 4)
        self.write(mapping, 0, len(entries), 1)
        self.write(parameters, 1, can_id, 4)

    # -- the drive profile

    def command(self, word: int, wait_s: float = 0.03) -> int:
        """A controlword by SDO; the statusword after the wait."""
        self.write(0x6040, 0, word, 2)
        self.wait(wait_s)
        return self.status

    @property
    def status(self) -> int:
        return self.drive.axis.statusword

    def enable(self, mode: int = 8) -> None:
        self.write(0x6060, 0, mode, 1)
        for word in (0x06, 0x07, 0x0F):
            self.command(word)
        assert self.status & 0x6F == 0x27, hex(self.status)

    def run(self, seconds: float) -> None:
        """Time with a SYNC every period."""
        for _ in range(round(seconds / PERIOD_S)):
            self.sync()
