"""A commissioned set of simulated drives on a stepped bus, with a bare master, for tests."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from drives import commission, pdo
from drives.bench.simulated import LostSync, Parameters, SimulatedDrive, rig
from drives.settings import BusSettings, MasterSettings, NodeSettings

EDS = str(Path(__file__).parents[3] / "config" / "eds" / "simulated_drive.eds")
PERIOD_S = 0.002
ENABLE = (0x06, 0x07, 0x0F)


def nodes(names: str = "XYZAC", **changes: object) -> list[NodeSettings]:
    made = [NodeSettings(name, "can", number, EDS) for number, name in enumerate(names, 1)]
    return [replace(node, **changes) for node in made]  # type: ignore[arg-type]


class Bench:
    """``tick`` is one period of a master: SYNC, then a controlword and target for every drive."""

    def __init__(
        self,
        names: str = "X",
        parameters: Parameters | None = None,
        lost_sync: LostSync = LostSync.HOLD,
        stiffness: dict[str, float] | None = None,
        bit_rate: int = 1_000_000,
        **settings: object,
    ) -> None:
        self.nodes = nodes(names, **settings)
        buses = [BusSettings("can", "virtual", "", bit_rate)]
        nature = parameters or Parameters()
        self.rig = rig(self.nodes, buses, stiffness=stiffness, lost_sync=lost_sync, parameters=nature)
        self.service = self.rig.port(pdo.SERVICE_FILTERS)
        self.network = commission.Network(self.service, commission.stepped_pump(self.rig))
        commission.commission(self.network, self.nodes, MasterSettings())
        self.port = self.rig.port(pdo.TICK_FILTERS)
        self.frames = {node.name: pdo.command_frame(node.node) for node in self.nodes}
        self.statuswords = dict.fromkeys(names, 0)
        self.actual = dict.fromkeys(names, 0)
        self.emergencies: list[tuple[int, int]] = []  # node, code
        self.start_s = self.rig.now_s
        self.ticks = 0
        self.beats = True

    @property
    def drive(self) -> SimulatedDrive:
        return next(iter(self.rig.drives.values()))

    def wait(self, ticks: float = 1) -> None:
        """Let periods pass without sending anything."""
        self.ticks += ticks  # type: ignore[assignment]
        self.rig.advance(self.start_s + self.ticks * PERIOD_S)
        self._receive()

    def tick(self, word: int = 0x0F, targets: Sequence[int] | None = None, rpdo: bool = True) -> None:
        self.wait()
        if self.beats and self.ticks % 25 == 0:
            self.port.send(pdo.frame(pdo.HEARTBEAT + 127, b"\x05"))
        self.port.send(pdo.frame(pdo.SYNC))
        chosen = list(self.actual.values()) if targets is None else targets
        for frame, target in zip(self.frames.values(), chosen, strict=True):
            pdo.COMMAND.pack_into(frame, pdo.DATA_AT, word, target)
            if rpdo:
                self.port.send(frame)

    def enable(self) -> None:
        for word in ENABLE:
            for _ in range(15):
                self.tick(word)
        assert all(word & 0x6F == 0x27 for word in self.statuswords.values()), self.statuswords

    def write(self, index: int, sub: int, data: bytes) -> None:
        """SDO download to the first drive by hand, in the course of ticks."""
        head = bytes([0x23 | (4 - len(data)) << 2]) + struct.pack("<HB", index, sub)
        self.service.send(pdo.frame(0x600 + self.nodes[0].node, head + data.ljust(4, b"\0")))

    def _receive(self) -> None:
        buffer = bytearray(16)
        names = {node.node: node.name for node in self.nodes}
        while self.port.receive_into(buffer):
            can_id, data = pdo.unpack(buffer)
            node = can_id & 0x7F
            if can_id & pdo.GROUP_MASK == pdo.TPDO1:
                self.statuswords[names[node]], self.actual[names[node]] = pdo.FEEDBACK.unpack(data)
            elif can_id & pdo.GROUP_MASK == pdo.EMCY and node:
                self.emergencies.append((node, int.from_bytes(data[:2], "little")))
