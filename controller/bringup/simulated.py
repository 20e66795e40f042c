"""A simulated machine that is brought up, on the stepped clock: with the hands of its operator."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from controller.bringup.by_hand import SWITCHES
from controller.bringup.ticks import NotDone, Stop, Ticks
from controller.faults import Recovery
from controller.geometry.arrays import Array
from controller.geometry.vectors import add
from controller.ipc.handoff import of_axes
from controller.machine.kinematics import kinematics_of
from controller.machine.model import TOOL_AT_POWER_ON, Machine
from controller.messages import Message, message, of_error, several
from controller.program import modal
from controller.program.program import ProgramError
from controller.runtime import checked, simulation, touch_table
from controller.runtime.startup import SessionError
from controller.runtime.stepped import SteppedMachine
from controller.state.fault_table import FAULTS, fault_message
from controller.state.modes import Fault, Mode, Request
from controller.state.queue_refusals import refusal_message

LONGEST_S = 10.0  # that a change of mode may take
ESTOP, STO = "estop", "sto"  # what is pressed, released; an axis after a dot

SPHERE_MM, SPHERE_AT_MM = 12.5, 60.0  # its radius, and its centre above the first work offset
SPHERE = f"""
name = "sphere"
[probe]
pretravel_mm = 0.003
scatter_mm = 0.0005
[[solid]]
kind = "sphere"
centre_mm = [0.0, 0.0, {SPHERE_AT_MM}]
radius_mm = {SPHERE_MM}
"""


def _sphere(machine: Machine) -> simulation.Bench | None:
    """What stands on the table of a machine that has a probe."""
    return None if machine.probe is None else simulation.bench_of(SPHERE, machine)


def over_sphere(machine: Machine, above_mm: float = 3.0) -> str:
    """The program that brings the probe, its ball so far above that sphere as an operator jogs it there."""
    tool = None if machine.probe is None else machine.tool(machine.probe.tool)
    assert tool is not None  # there is no sphere else
    place = add(machine.offsets[0].origin, (0.0, 0.0, SPHERE_AT_MM + SPHERE_MM + above_mm))
    q = kinematics_of(machine).linear(place, (0.0, 0.0), tool.length_mm)
    names = [machine.axes[i].name for i in machine.linear()]
    x, y, z = (f"{name}{at:.4f}" for name, at in zip(names, q, strict=True))
    turned = " ".join(f"{machine.axes[i].name}0" for i in machine.rotary())
    retracted = f"G53 G0 {names[2]}{machine.retract_mm:.4f}"
    return "\n".join(("G21 G90", retracted, f"G53 G0 {turned}", f"G53 G0 {x} {y}", f"G53 G0 {z}", "M30", ""))


class SimulatedBench:
    """Homed and enabled from the start. Raises SessionError, CommissionError, BusError where that fails."""

    def __init__(self, machine: Machine, stepped: SteppedMachine | None = None) -> None:
        self.machine = machine
        self._tool = TOOL_AT_POWER_ON
        self.stepped = stepped or SteppedMachine(machine, bench=_sphere(machine))
        if not self._is(Mode.READY):
            self.stepped.come_up()

    def positions(self) -> tuple[float, ...]:
        last = self.stepped.recorder.last(1)[-1, of_axes("actual", len(self.machine.axes))]
        return tuple(
            float(at) * axis.shown_per_unit for at, axis in zip(last, self.machine.axes, strict=True)
        )

    def run(self, text: str, name: str, dry_run_mm: float = 0.0) -> Ticks:
        task = checked.task(text.encode(), name, self.machine)
        task = checked.standing(task, self.stepped.joints)
        if self._tool != TOOL_AT_POWER_ON:
            begun = modal.begun(self.machine)
            task = replace(task, begin=begun._replace(modal=begun.with_tool(self._tool, self.machine)))
        try:
            run = self.stepped.run(checked.path_of(task, dry_run_mm=dry_run_mm))
        except ProgramError as error:
            raise NotDone(error.placed) from error
        except SessionError as error:
            raise NotDone(of_error(error)) from error
        if run.result != "completed":
            ended = message("bringup.ended", result=run.result, line=run.line)
            if run.result == "stuck":
                ended = several(message("ended.stuck", line=run.line), refusal_message(run.refusal))
            raise NotDone(self._why() or ended)
        return self._ticks(run.rows)

    def _ticks(self, rows: Array) -> Ticks:
        return Ticks.of_rows(rows, self.machine, self.stepped.cycle.sync.latency)

    def switched_off(self, seconds: float) -> Ticks:
        self.stepped.recorder.drain()
        self.stepped.request(Request.DISABLE)
        rows = [
            self._until(lambda: self._is(Mode.OFF)),
            self.stepped.go(round(seconds / self.machine.period_s)),
        ]
        self.power(True)
        return self._ticks(np.concatenate(rows))

    def power(self, on: bool) -> None:
        self.stepped.request(Request.ENABLE if on else Request.DISABLE)
        self._until(lambda: self._is(Mode.READY if on else Mode.OFF))

    def wait(self, seconds: float) -> None:
        self.stepped.go(max(1, round(seconds / self.machine.period_s)))

    def by_hand(self, action: str) -> bool:
        what, _, of = action.partition(".")
        pressed = what.endswith("_press")
        if what == "turn":
            self._turn_input(of)
        elif what == "switch":
            axis, _, name = of.partition(".")
            terminals = self.stepped.rig.drives[axis].inputs
            terminals.set(terminals.word ^ SWITCHES[name], self.stepped.rig.now_s)
        elif what == "over_sphere":
            if self.machine.changer is None and self.machine.probe is not None:
                self._tool = self.machine.probe.tool  # put in by hand
            self.run(over_sphere(self.machine), "over_sphere")
        elif what.startswith(STO):
            self.stepped.rig.drives[of].axis.set_sto(pressed, self.stepped.rig.now_s)
        elif what.startswith(ESTOP):
            self._turn_input(ESTOP)
        elif what != "stand_clear":
            return False
        if pressed:
            self._until(lambda: self._is(Mode.FAULT))
            self.stepped.stand_still()
        return True

    def inputs(self) -> dict[str, bool]:
        now, io = self.stepped.board.read(), self.machine.io
        if io is None or now is None:
            return {}
        return {name: bool(now.inputs >> bit & 1) for name, bit in io.inputs}

    def switches(self, axis: str) -> int | None:
        return int(self.stepped.rig.drives[axis].axis.sensors.digital_inputs())

    def clamp(self, axis: str, is_open: bool) -> None:
        index = [one.name for one in self.machine.axes].index(axis)
        self.stepped.request(Request.CLAMPS, float(is_open << index))

    def tool(self) -> int:
        return self._tool

    def touches(self) -> str:
        return touch_table.text(self.stepped.planner.touches, self.machine)

    def _turn_input(self, name: str) -> None:
        io = self.machine.io
        bit = None if io is None else io.input(name)
        if bit is None:
            return
        for node in self.stepped.rig.io.values():
            node.set_inputs(node.inputs ^ (1 << bit), self.stepped.rig.now_s)

    def stopped_by(self) -> Stop | None:
        modes = self.stepped.cycle.modes
        if modes.fault is Fault.NONE:
            return None
        axis = self.machine.axis_off(modes.fault_axis)
        return Stop(axis, fault_message(modes.fault, axis))

    def _why(self) -> Message | None:
        stop = self.stopped_by()
        return None if stop is None else stop.why

    def recover(self) -> None:
        self.stepped.go(round(0.1 / self.machine.period_s))
        needs = FAULTS[self.stepped.cycle.modes.fault].recovery
        self.stepped.request(Request.RESET)
        self._until(lambda: self._is(Mode.OFF))
        try:
            if needs >= Recovery.COMMISSION:
                self.stepped.commission_again()
            self.stepped.come_up()
        except SessionError as error:
            raise NotDone(of_error(error)) from error

    def _is(self, mode: Mode) -> bool:
        return self.stepped.cycle.modes.mode is mode

    def _until(self, done: Callable[[], bool]) -> Array:
        """The rows until then. Raises NotDone where it does not come."""
        rows = self.stepped.go(round(LONGEST_S / self.machine.period_s), done)
        if not done():
            raise NotDone(self._why() or message("bringup.mode", mode=self.stepped.cycle.modes.mode.name))
        return rows
