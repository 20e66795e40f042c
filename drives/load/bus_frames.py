"""Which frames a machine's nodes put on a bus, how often, and how long each is.

One row per identifier: the frames of every tick, those that come at intervals (heartbeats, guarding,
commands apart from the targets), and those that an event brings (emergencies, switches, SDO). What is
counted here is what ``drives.cyclic.group`` and the nodes send once they are commissioned.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

from drives import pdo
from drives.load import stuffing
from drives.profile import Supervision
from drives.settings import (
    MODE_EVERY_MS,
    TEMPERATURE_EVERY_MS,
    BusSettings,
    IoSettings,
    MasterSettings,
    NodeSettings,
    SpindleSettings,
)
from drives.texts import Message, english, message

CONTROLLER = "controller"

# What operation does not change, for typical lengths: controlword "enabled"; statusword "enabled, follows".
CONTROLWORD, STATUSWORD = (0x000F).to_bytes(2, "little"), (0x1237).to_bytes(2, "little")
OPERATIONAL = bytes([pdo.NMT_OPERATIONAL])
SDO_BYTES = EMERGENCY_BYTES = 8
CYCLIC_VELOCITY = 9


class Kind(Enum):
    """When a frame comes; the order is the budget's."""

    CYCLIC = "cyclic"  # with every SYNC, or every n-th
    BACKGROUND = "background"  # at intervals of many ticks
    OCCASIONAL = "occasional"  # with an event, and SDO


@dataclass(frozen=True, slots=True)
class Row:
    """One kind of frame on one bus. Times in us, of one frame with interframe space."""

    frame: str  # its text is ``frame.setpoint``, for one
    node: str  # the name of the node that it is to or from; "" = all
    sender: str  # "controller" or the name of the node
    can_id: int
    data_bytes: int  # of a remote frame: its length code
    per_tick: float  # frames per tick, mean; 0 for what an event brings
    kind: Kind
    bit_us: float  # 0 = a bus without bit timing
    fixed: bytes = b""  # the first data bytes, where operation does not change them
    remote: bool = False

    @property
    def text(self) -> Message:
        """What it is, and whose."""
        return text(self.frame, self.node)

    @property
    def worst_us(self) -> float:
        """By the rule of stuffing alone: what a period is judged by."""
        return stuffing.worst_bits(0 if self.remote else self.data_bytes) * self.bit_us

    @property
    def longest_us(self) -> float:
        """With this identifier, over all its payloads: exact, and never above ``worst_us``."""
        if self.remote:
            return self.typical_us
        return stuffing.longest_bits(self.can_id, self.data_bytes) * self.bit_us

    @property
    def typical_us(self) -> float:
        """The mean in operation, over all values of what changes (target, position)."""
        if self.remote:
            return stuffing.frame_bits(self.can_id, bytes(self.data_bytes), remote=True) * self.bit_us
        return stuffing.mean_bits(self.can_id, self.data_bytes - len(self.fixed), self.fixed) * self.bit_us

    @property
    def is_emergency(self) -> bool:
        return self.can_id & pdo.GROUP_MASK == pdo.EMCY and self.can_id != pdo.SYNC

    @property
    def is_sdo(self) -> bool:
        return self.can_id & pdo.GROUP_MASK in (pdo.SDO_QUESTION, pdo.SDO_ANSWER)

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return {
            "what": english(self.text),
            "sender": self.sender,
            "kind": self.kind.value,
            "can_id": self.can_id,
            "data_bytes": self.data_bytes,
            "remote": self.remote,
            "per_tick": self.per_tick,
            "worst_us": self.worst_us,
            "longest_us": self.longest_us,
            "typical_us": self.typical_us,
        }


def text(frame: str, names: str) -> Message:
    """What a frame is, and whose; ``names`` of one node or several."""
    return message(f"frame.{frame}", name=names)


def of(
    bus: BusSettings,
    nodes: Sequence[NodeSettings],
    master: MasterSettings,
    period_s: float,
    others: Sequence[SpindleSettings | IoSettings] = (),
) -> list[Row]:
    """All rows of one bus; ``nodes`` and ``others`` are those on it, ``period_s`` is the tick."""
    rows = _Rows(1e6 / bus.bit_rate if bus.bit_rate else 0.0, period_s)
    rows.every_tick("SYNC", "", CONTROLLER, pdo.SYNC, 0)
    rows.at_interval(
        "controller_heartbeat",
        "",
        CONTROLLER,
        pdo.HEARTBEAT + master.node_id,
        master.heartbeat_s,
        OPERATIONAL,
    )
    for node in nodes:
        _drive(rows, node, master)
    for other in others:
        if isinstance(other, SpindleSettings):
            _spindle(rows, other, master)
        else:
            _io(rows, other, master)
    if everybody := [*nodes, *others]:
        _sdo(rows, everybody)
    return rows.rows


class _Rows:
    """The rows so far; its methods know when a frame comes."""

    def __init__(self, bit_us: float, period_s: float) -> None:
        self.rows: list[Row] = []
        self._bit_us, self._period_s = bit_us, period_s

    def every_tick(
        self,
        frame: str,
        node: str,
        sender: str,
        can_id: int,
        data_bytes: int,
        fixed: bytes = b"",
        every: int = 1,
    ) -> None:
        per_tick = 1.0 / every
        self.rows.append(
            Row(frame, node, sender, can_id, data_bytes, per_tick, Kind.CYCLIC, self._bit_us, fixed)
        )

    def at_interval(
        self,
        frame: str,
        node: str,
        sender: str,
        can_id: int,
        interval_s: float,
        fixed: bytes,
        more: int = 0,
        remote: bool = False,
    ) -> None:
        """``fixed`` bytes that stay, and so many ``more``."""
        per_tick = self._period_s / interval_s
        size, kind = len(fixed) + more, Kind.BACKGROUND
        self.rows.append(Row(frame, node, sender, can_id, size, per_tick, kind, self._bit_us, fixed, remote))

    def on_event(self, frame: str, node: str, sender: str, can_id: int, data_bytes: int) -> None:
        self.rows.append(Row(frame, node, sender, can_id, data_bytes, 0.0, Kind.OCCASIONAL, self._bit_us))


def _drive(rows: _Rows, node: NodeSettings, master: MasterSettings) -> None:
    profile, name = node.profile, node.name
    setpoint = pdo.rpdo(profile.rpdo, node.node)
    if node.feed_forward:
        rows.every_tick("setpoint", name, CONTROLLER, setpoint, pdo.TARGET.size)
        command = pdo.rpdo(profile.command_rpdo, node.node)
        rows.at_interval("command", name, CONTROLLER, command, master.heartbeat_s, CONTROLWORD)
    else:
        rows.every_tick("setpoint", name, CONTROLLER, setpoint, pdo.PDO_BYTES, CONTROLWORD)
    feedback = pdo.tpdo(profile.tpdo, node.node)
    rows.every_tick("feedback", name, name, feedback, pdo.PDO_BYTES, STATUSWORD, node.feedback_every)
    if node.temperature_tpdo:
        warmth, size = pdo.tpdo(node.temperature_tpdo, node.node), (node.temperature_entry & 0xFF) // 8
        rows.at_interval("temperature", name, name, warmth, TEMPERATURE_EVERY_MS / 1000, b"", more=size)
    if node.demand_tpdo:
        demand = pdo.tpdo(node.demand_tpdo, node.node)
        rows.every_tick("demand", name, name, demand, pdo.DEMAND.size, every=node.demand_every)
    if node.load_tpdo:
        size, every = pdo.DEMAND.size, node.load_every
        rows.every_tick("load_encoder", name, name, node.load_can_id, size, every=every)
    if node.mode_tpdo:
        mode = pdo.tpdo(node.mode_tpdo, node.node)
        rows.at_interval("mode", name, name, mode, MODE_EVERY_MS / 1000, bytes([profile.mode.value]))
    _supervised(rows, name, node.node, profile.supervision, master)
    rows.on_event("emergency", name, name, pdo.EMCY + node.node, EMERGENCY_BYTES)


def _supervised(rows: _Rows, name: str, node: int, supervision: Supervision, master: MasterSettings) -> None:
    """The node's own sign of life; guarding asks for it with a remote frame."""
    can_id = pdo.HEARTBEAT + node
    if supervision is Supervision.GUARDING:
        rows.at_interval("guarding", name, CONTROLLER, can_id, master.heartbeat_s, OPERATIONAL, remote=True)
        rows.at_interval("answer", name, name, can_id, master.heartbeat_s, OPERATIONAL)
    else:
        rows.at_interval("heartbeat", name, name, can_id, master.heartbeat_s, OPERATIONAL)


def _spindle(rows: _Rows, spindle: SpindleSettings, master: MasterSettings) -> None:
    """Its speed goes out on change: on the ramp of mode 9 that is every tick."""
    name, profile = spindle.name, spindle.profile
    speed = pdo.rpdo(profile.rpdo, spindle.node)
    if spindle.mode == CYCLIC_VELOCITY:
        rows.every_tick("speed", name, CONTROLLER, speed, pdo.PDO_BYTES, CONTROLWORD)
    else:
        rows.at_interval("speed", name, CONTROLLER, speed, master.heartbeat_s, CONTROLWORD, more=4)
    feedback = pdo.tpdo(profile.tpdo, spindle.node)
    rows.every_tick("feedback", name, name, feedback, pdo.PDO_BYTES, STATUSWORD, spindle.feedback_every)
    if spindle.position_tpdo:
        turned, size = pdo.tpdo(spindle.position_tpdo, spindle.node), 6 if spindle.tells_load else 4
        rows.every_tick("position", name, name, turned, size)
    _supervised(rows, name, spindle.node, profile.supervision, master)
    rows.on_event("emergency", name, name, pdo.EMCY + spindle.node, EMERGENCY_BYTES)


def _io(rows: _Rows, io: IoSettings, master: MasterSettings) -> None:
    """Inputs and outputs go on change, and are repeated at intervals."""
    name, inputs, outputs = io.name, pdo.tpdo(1, io.node), pdo.rpdo(1, io.node)
    if io.inputs_every_s > 0.0:
        rows.at_interval("inputs", name, name, inputs, io.inputs_every_s, b"", more=io.inputs)
    else:
        rows.on_event("inputs", name, name, inputs, io.inputs)
    rows.at_interval("outputs", name, CONTROLLER, outputs, master.heartbeat_s, b"", more=io.outputs)
    if io.feedback_entry:
        measured, more = pdo.tpdo(io.feedback_tpdo, io.node), (io.feedback_entry & 0xFF) // 8
        rows.at_interval("spindle", name, name, measured, io.feedback_every_s / 2.0, b"", more=more)
    if size := 2 * len(io.analogue) + (io.speed_entry & 0xFF) // 8:
        rows.at_interval(
            "analogue", name, CONTROLLER, pdo.rpdo(2, io.node), master.heartbeat_s, b"", more=size
        )
    rows.at_interval("heartbeat", name, name, pdo.HEARTBEAT + io.node, io.heartbeat_s, OPERATIONAL)
    rows.on_event("emergency", name, name, pdo.EMCY + io.node, EMERGENCY_BYTES)


def _sdo(rows: _Rows, everybody: Sequence[NodeSettings | SpindleSettings | IoSettings]) -> None:
    """One question at a time on a bus; by the rule all nodes' are equally long, the last stands for it."""
    node = max(everybody, key=lambda one: one.node)
    rows.on_event("sdo_question", node.name, CONTROLLER, pdo.SDO_QUESTION + node.node, SDO_BYTES)
    rows.on_event("sdo_answer", node.name, node.name, pdo.SDO_ANSWER + node.node, SDO_BYTES)
