"""A simulated machine that is brought up, on the stepped clock: with the hands of its operator."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from controller.bringup.ticks import NotDone, Ticks
from controller.geometry.arrays import Array
from controller.ipc.handoff import of_axes
from controller.machine.model import Machine
from controller.messages import Message, message, of_error
from controller.program.program import ProgramError
from controller.runtime import checked
from controller.runtime.startup import SessionError
from controller.runtime.stepped import SteppedMachine
from controller.state.fault_table import fault_message
from controller.state.modes import Fault, Mode, Request

LONGEST_S = 10.0  # that a change of mode may take
ESTOP, STO = "estop", "sto"  # what is pressed, released; an axis after a dot


class SimulatedBench:
    """Homed and enabled from the start. Raises SessionError, CommissionError, BusError where that fails."""

    def __init__(self, machine: Machine, stepped: SteppedMachine | None = None) -> None:
        self.machine = machine
        self.stepped = stepped or SteppedMachine(machine)
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
        try:
            run = self.stepped.run(checked.path_of(task, dry_run_mm=dry_run_mm))
        except ProgramError as error:
            raise NotDone(error.placed) from error
        except SessionError as error:
            raise NotDone(of_error(error)) from error
        if run.result != "completed":
            why = self.stopped_by() or message("bringup.ended", result=run.result, line=run.line)
            raise NotDone(why)
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
        self.stepped.request(Request.ENABLE)
        self._until(lambda: self._is(Mode.READY))
        return self._ticks(np.concatenate(rows))

    def by_hand(self, action: str) -> bool:
        what, _, axis = action.partition(".")
        pressed = what.endswith("_press")
        if what.startswith(STO):
            self.stepped.rig.drives[axis].axis.set_sto(pressed, self.stepped.rig.now_s)
        elif what.startswith(ESTOP):
            self._turn_input(ESTOP)
        else:
            return False
        if pressed:
            self._until(lambda: self._is(Mode.FAULT))
            self.stepped.stand_still()
        return True

    def _turn_input(self, name: str) -> None:
        io = self.machine.io
        bit = None if io is None else io.input(name)
        if bit is None:
            return
        for node in self.stepped.rig.io.values():
            node.set_inputs(node.inputs ^ (1 << bit), self.stepped.rig.now_s)

    def stopped_by(self) -> Message | None:
        modes = self.stepped.cycle.modes
        if modes.fault is Fault.NONE:
            return None
        return fault_message(modes.fault, self.machine.axis_off(modes.fault_axis))

    def recover(self) -> None:
        self.stepped.go(round(0.1 / self.machine.period_s))
        self.stepped.request(Request.RESET)
        self._until(lambda: self._is(Mode.OFF))
        try:
            self.stepped.come_up()
        except SessionError as error:
            raise NotDone(of_error(error)) from error

    def _is(self, mode: Mode) -> bool:
        return self.stepped.cycle.modes.mode is mode

    def _until(self, done: Callable[[], bool]) -> Array:
        """The rows until then. Raises NotDone where it does not come."""
        rows = self.stepped.go(round(LONGEST_S / self.machine.period_s), done)
        if not done():
            raise NotDone(
                self.stopped_by() or message("bringup.mode", mode=self.stepped.cycle.modes.mode.name)
            )
        return rows
