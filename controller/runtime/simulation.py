"""What stands around the simulated devices of a machine: closed doors, and clamps with their switches."""

from __future__ import annotations

from typing import NamedTuple

from controller.machine import nodes
from controller.machine.equipment import SENSORS
from controller.machine.model import Changer, Io, Machine
from drives.simulated import build
from drives.simulated.io_node import IoNode

QUICK_S = 0.3  # what a simulated step of a tool changer takes at most
SWITCH_SHARE = 0.5  # of the time that a clamp may take: a simulated one takes this


class Wire(NamedTuple):
    """An input that follows an output, ``delay_s`` later; ``inverted``: it is on when that is off."""

    output: int
    input: int
    delay_s: float
    inverted: bool


def healthy_inputs(machine: Machine) -> int:
    """The inputs' word, electrically: circuits, doors and clamps closed, no probe touched."""
    io = machine.io
    if io is None:
        return 0
    return sum(1 << bit for name, bit in io.inputs if (name in SENSORS) == (name in io.inverted))


def wires(machine: Machine) -> tuple[Wire, ...]:
    """From the valve of each clamp to its switch."""
    io = machine.io
    if io is None:
        return ()
    found = []
    for clamp in (axis.clamp for axis in machine.axes if axis.clamp is not None):
        valve, switch = io.output(clamp.output), io.input(clamp.input)
        if valve is not None and switch is not None:
            straight = (clamp.output in io.inverted) == (clamp.input in io.inverted)
            found.append(Wire(valve, switch, SWITCH_SHARE * clamp.open_s, straight))
    if io.orient is not None:
        asked, there = io.output(io.orient.output) or 0, io.input(io.orient.input) or 0
        turned = (io.orient.output in io.inverted) != (io.orient.input in io.inverted)
        found.append(Wire(asked, there, SWITCH_SHARE * io.orient.within_s, turned))
    return (*found, *_of_changer(machine.changer, io))


def _of_changer(changer: Changer | None, io: Io) -> list[Wire]:
    """Each switch of a tool changer follows the first output of the step that waits for it."""
    found: dict[int, Wire] = {}
    for step in (*changer.prepare, *changer.put_away, *changer.take) if changer is not None else ():
        rows = [(name, True) for name in step.on] + [(name, False) for name in step.off]
        output = io.output(rows[0][0]) if rows else None
        switch = io.input(step.input) if step.input else None
        if output is None or switch is None or switch in found:
            continue
        same = rows[0][1] is (step.level in ("rise", "on"))
        turned = (rows[0][0] in io.inverted) != (step.input in io.inverted)
        delay_s = min(SWITCH_SHARE * step.within_s, QUICK_S)
        found[switch] = Wire(output, switch, delay_s, same is turned)
    return list(found.values())


def surround(node: IoNode, machine: Machine) -> None:
    """All doors closed, and clamps that do as they are told."""
    node.set_inputs(healthy_inputs(machine), 0.0)
    for wire in wires(machine):
        node.wire(*wire)


def options(machine: Machine, bus: str) -> list[str]:
    """What ``drives.simulated`` is told to put on one bus."""
    axes = [axis for axis in machine.axes if axis.bus == bus]
    told = ["--nodes", *(str(axis.node) for axis in axes)]
    places = {a.node: round(a.homing.position * a.counts_per_unit) for a in axes if a.homing.absolute}
    motors = ((node.node, *build.needs(node)) for node in nodes.node_settings(machine) if node.bus == bus)
    told += ["--motor", *(f"{node}={speed}:{acceleration}" for node, speed, acceleration in motors)]
    told += ["--absolute", *(f"{node}={counts}" for node, counts in places.items())]
    spindle, io = machine.spindle, machine.io
    if spindle is not None and spindle.is_driven and spindle.bus == bus:
        told += ["--spindle", str(spindle.node), "--counts-per-rev", str(abs(spindle.counts_per_rev))]
    if io is not None and io.bus == bus:
        told += ["--io", str(io.node), "--inputs", str(healthy_inputs(machine))]
        told += ["--wire", *(f"{w.output}:{w.input}:{w.delay_s}:{w.inverted:d}" for w in wires(machine))]
    return told
