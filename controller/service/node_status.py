"""What the nodes on the buses say of themselves: the last frame of each kind, beside the log of all."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any

from controller.machine import machine_file
from controller.machine.model import Machine, Temperature
from controller.messages import Key, Message, message
from controller.state.live_state import DriveRow, Snapshot
from controller.state.modes import Mode
from drives import emergency_codes, pdo
from drives.cia402 import State
from drives.log.frame_log import FrameLog
from drives.settings import NodeSettings

_ID = slice(0, 4)  # of a frame as it lies in memory


class LastFrames(FrameLog):
    """A log that also knows the newest frame of each identifier."""

    def __init__(self) -> None:
        super().__init__()
        self.last: dict[bytes, tuple[float, bytes]] = {}

    def __call__(self, frame: bytes | bytearray, at_s: float) -> None:
        one = bytes(frame)
        self.keep((at_s, one))
        self.last[one[_ID]] = (at_s - _wall_s(), one)

    def extend(self, heard: Sequence[tuple[float, bytes]]) -> None:
        super().extend(heard)
        wall_s = _wall_s()
        self.last |= {frame[_ID]: (at_s - wall_s, frame) for at_s, frame in heard}

    def of(self, can_id: int) -> tuple[float, bytes] | None:
        """When the last frame of an identifier came (s, monotonic), and its data."""
        found = self.last.get(can_id.to_bytes(4, "little"))
        return None if found is None else (found[0], pdo.unpack(found[1])[1])


def _wall_s() -> float:
    """What the wall's clock is ahead by now: frames have its time, and it may be set later."""
    return time.time() - time.monotonic()


def drives(
    machine: Machine, now: Snapshot, logs: Mapping[str, FrameLog], homing: Sequence[int] = ()
) -> list[dict[str, Any]]:
    """A row per axis: where its drive is, what it said last, and how long ago it showed life.

    ``homing``: the axes that were asked to home and have not all done it yet. "heard": within the time
    after which the bus takes a node for dead.
    """
    nodes = machine_file.node_settings(machine)
    moving, silent_s = _homing_now(machine, now, homing), machine_file.master_settings(machine).consumer_s
    found = []
    for i, (node, axis) in enumerate(zip(nodes, machine.axes, strict=True)):
        log = logs.get(node.bus)
        row = _drive(node, now, i, log, i in moving, silent_s)._asdict()
        if axis.temperature is None:
            del row["temperature_c"]
        else:
            row["temperature_c"] = _temperature(axis.temperature, axis.node, log)
        if axis.load_encoder is None:
            del row["load_off"]
        else:
            row["load_off"] = now.load_off[i] * axis.shown_per_unit
        found.append(row)
    return found


def _homing_now(machine: Machine, now: Snapshot, asked: Sequence[int]) -> tuple[int, ...]:
    """Of the axes that were asked to home: the first group that is not done. Others keep their mode."""
    if not asked or now.mode is not Mode.HOMING:
        return ()
    left = [i for i in asked if not now.homed >> i & 1]
    first = min((machine.axes[i].homing.group for i in left), default=0)
    return tuple(i for i in left if machine.axes[i].homing.group == first)


def _temperature(told: Temperature, node: int, log: FrameLog | None) -> float | None:
    """As it was told last; None where it never was."""
    last = log.of(pdo.tpdo(told.tpdo, node)) if isinstance(log, LastFrames) else None
    size = told.bits // 8
    if last is None or len(last[1]) < size:
        return None
    return int.from_bytes(last[1][:size], "little", signed=True) / told.per_degree


def _drive(
    node: NodeSettings, now: Snapshot, i: int, log: FrameLog | None, homing: bool, silent_s: float
) -> DriveRow:
    """Of axis ``i``; after ``silent_s`` without a sign of life it is not heard."""
    heard = log if isinstance(log, LastFrames) else LastFrames()
    feedback = heard.of(pdo.tpdo(node.profile.tpdo, node.node))
    alive = heard.of(pdo.HEARTBEAT + node.node)
    emergency = heard.of(pdo.EMCY + node.node)
    code = int.from_bytes(emergency[1][:2], "little") if emergency else 0
    word = int.from_bytes(feedback[1][:2], "little") if feedback else None
    age_s = max(0.0, time.monotonic() - alive[0]) if alive else None
    return DriveRow(
        axis=node.name,
        node=node.node,
        bus=node.bus,
        state=State(now.drive_states[i]).name,
        cyclic_mode=node.profile.mode.name,
        statusword=word,
        error=_emergency(code) if code else None,
        heartbeat_age_s=age_s,
        emcy=code or None,
        homing=homing,
        heard=age_s is not None and age_s <= silent_s,
        malformed=now.malformed[i],
        missed_setpoints=None if now.missed[i] < 0 else now.missed[i],
        overdue_setpoints=now.overdue[i],
        temperature_c=None,
        load_off=None,
    )


def _emergency(code: int) -> Message:
    """A code by its text, or its class's."""
    known = emergency_codes.listed(code)
    what = Key("emcy.unlisted" if known is None else f"emcy.{known:04X}")
    return message("emcy", code=f"{code:04X}", what=what)
