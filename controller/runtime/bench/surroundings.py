"""The simulated devices of a machine, and what is around them: closed doors, clamps with their switches.

They take as long as such devices are expected to (``usual_s`` of the machine).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

from controller.machine import nodes, spindle
from controller.machine.equipment import SENSORS
from controller.machine.model import Changer, Io, Machine
from drives.bench.simulated import build
from drives.bench.simulated.drive import SimulatedDrive
from drives.bench.simulated.inverter import Inverter, Line, Measured, Wiring
from drives.bench.simulated.io_node import IoNode
from drives.bench.simulated.parameters import LostSync, Parameters
from drives.bench.simulated.rig import Rig, rig
from drives.bench.simulated.spindle_motor import MotorParameters
from drives.settings import SpindleSettings


class Wire(NamedTuple):
    """An input that follows an output, ``delay_s`` later; ``inverted``: it is on when that is off."""

    output: int
    input: int
    delay_s: float
    inverted: bool


def _healthy_inputs(machine: Machine) -> int:
    """The inputs' word, electrically: circuits, doors and clamps closed, no probe touched."""
    io = machine.io
    if io is None:
        return 0
    return sum(1 << bit for name, bit in io.inputs if (name in SENSORS) == (name in io.inverted))


def _wires(machine: Machine) -> tuple[Wire, ...]:
    """From the valve of each clamp to its switch."""
    io = machine.io
    if io is None:
        return ()
    found = []
    for clamp in (axis.clamp for axis in machine.axes if axis.clamp is not None):
        valve, switch = io.output(clamp.output), io.input(clamp.input)
        if valve is not None and switch is not None:
            straight = (clamp.output in io.inverted) == (clamp.input in io.inverted)
            found.append(Wire(valve, switch, clamp.usual_s, straight))
    if io.orient is not None:
        asked, there = io.output(io.orient.output) or 0, io.input(io.orient.input) or 0
        turned = (io.orient.output in io.inverted) != (io.orient.input in io.inverted)
        found.append(Wire(asked, there, io.orient.usual_s, turned))
    return (*found, *_of_changer(machine.changer, io), *_of_gears(machine.spindle, io))


def _of_gears(turned: spindle.Spindle | None, io: Io) -> list[Wire]:
    """The switch of each gear follows the first output of its fork."""
    found = []
    for gear in () if turned is None else turned.gears:
        rows = [(one, True) for one in gear.on] + [(one, False) for one in gear.off]
        name, is_on = rows[0] if rows else ("", True)
        output, switch = io.output(name), io.input(gear.input)
        if output is not None and switch is not None:
            straight = ((name in io.inverted) == (gear.input in io.inverted)) is is_on
            found.append(Wire(output, switch, gear.usual_s, not straight))
    return found


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
        found[switch] = Wire(output, switch, step.usual_s, same is turned)
    return list(found.values())


def surround(node: IoNode, machine: Machine) -> None:
    """All doors closed, and clamps that do as they are told."""
    node.set_inputs(_healthy_inputs(machine), 0.0)
    for wire in _wires(machine):
        node.wire(*wire)
    if (wiring := _wiring(machine)) is not None:
        Inverter(node, wiring)


def _wiring(machine: Machine) -> Wiring | None:
    """How the inverter of its spindle is wired to the node; None where it has none."""
    spindle, io = machine.spindle, machine.io
    if spindle is None or spindle.inverter is None or io is None:
        return None
    told, bits = spindle.inverter, {**dict(io.inputs), **dict(io.outputs)}
    lines = {name: Line(bit, name in io.inverted) for name, bit in bits.items()}
    return Wiring(
        told.channel,
        lines["spindle_run"],
        told.full_rev_min / (told.full_counts - told.zero_counts),
        told.zero_counts,
        told.signed,
        60.0 * spindle.acceleration_rev_s2,
        lines.get("spindle_reverse"),
        lines.get("spindle_at_speed"),
        told.index,
        _measured(told),
    )


def _measured(told: spindle.Inverter) -> Measured | None:
    """What the node shows of its speed."""
    if (one := told.feedback) is None:
        return None
    per = (one.full_counts - one.zero_counts) / told.full_rev_min
    return Measured((one.index, one.channel), one.bits, one.zero_counts, per, one.pulses_per_rev)


def devices(
    machine: Machine, bus: str, nature: Parameters, motor: MotorParameters | None = None
) -> list[SimulatedDrive | IoNode]:
    """A device for each node of a bus, of its data sheet and profile, with what stands around it.

    ``motor``: how a spindle lags and slips; None = it does not. Raises OSError where a data sheet is missing.
    """
    its = [node for node in nodes.all_settings(machine) if node.bus == bus]
    natures = (replace(nature, motor=motor if isinstance(one, SpindleSettings) else None) for one in its)
    made = [build.device(node, one) for node, one in zip(its, natures, strict=True)]
    for device in made:
        if isinstance(device, IoNode):
            surround(device, machine)
    return made


def rig_of(
    machine: Machine,
    stiffness: Mapping[str, float] | None,
    lost_sync: LostSync,
    motor: MotorParameters | None,
) -> Rig:
    """Buses for the stepped clock with a machine's devices, and what stands around them.

    ``stiffness``: factor on the position gain by axis name; ``motor``: as for ``devices``.
    """
    made = rig(
        nodes.node_settings(machine),
        nodes.bus_settings(machine),
        spindle=nodes.spindle_settings(machine),
        io=nodes.io_settings(machine),
        stiffness=stiffness,
        lost_sync=lost_sync,
        motor=motor,
    )
    for node in made.io.values():
        surround(node, machine)
    return made
