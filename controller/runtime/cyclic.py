"""The nodes of a machine as its tick drives them; the same on every clock."""

from __future__ import annotations

from collections.abc import Mapping

from controller.machine import machine_file
from controller.machine.model import Machine
from drives.bus import Port
from drives.cyclic.drive import Drive
from drives.cyclic.group import Group
from drives.cyclic.io_node import IoNode
from drives.cyclic.power_stage import LOST_IN_A_ROW
from drives.cyclic.spindle import SpindleDrive
from drives.pump.plan_memory import Memory
from drives.pump.player import Player, beat_every


def group(machine: Machine, ports: Mapping[str, Port], patience_s: float = 0.0) -> Group:
    """Drives (in the axes' order), spindle, inputs and outputs on ``ports`` by name of the bus.

    ``patience_s``: feedback may stay away for so long, where that is more than two in a row.
    """

    def lost_after(every: int) -> int:
        return max(LOST_IN_A_ROW, round(patience_s / (machine.period_s * every)))

    spindle = machine_file.spindle_settings(machine)
    return Group(
        [Drive(node, lost_after(node.feedback_every)) for node in machine_file.node_settings(machine)],
        ports,
        machine_file.master_settings(machine),
        None if spindle is None else SpindleDrive(spindle, lost_after(spindle.feedback_every)),
        [IoNode(settings) for settings in machine_file.io_settings(machine)],
    )


def plans(machine: Machine) -> Memory | None:
    """Room for the plans of a pump of the same process; None where the tick sends by itself."""
    return Memory(len(machine.axes), thread=machine.has_threads) if machine.has_pump else None


def player(machine: Machine, group: Group, memory: Memory) -> Player:
    """The pump of a machine's group, without its clock."""
    master = group.master
    beats = beat_every(machine.period_s, master.heartbeat_s)
    return Player(memory, group.wires, machine.period_s, master.node_id, beats)
