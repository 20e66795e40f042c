"""The process that talks to a spindle's inverter on a serial line, as the engine holds it."""

from __future__ import annotations

import contextlib
import importlib.util
import time
from pathlib import Path

from controller.ipc.inverter_slot import InverterSlot
from controller.machine.model import Machine
from controller.machine.spindle import Spindle
from controller.messages import message
from controller.runtime import children, inverter_process
from controller.runtime.startup import SessionError

AGAIN_S = 2.0  # from one start to the next


class SerialInverter:
    """Lives as long as the tick, whose end of the slot is at ``paths``."""

    def __init__(self, spindle: Spindle, simulated: bool, folder: Path, number: int) -> None:
        """``number``: of the tick."""
        wanted, reported = (str(folder / f"inverter_{name}.{number}") for name in ("wanted", "reported"))
        self.paths = (wanted, reported)
        InverterSlot(self.paths)
        self._job, self._folder = inverter_process.Job(spindle, self.paths, simulated), folder
        self._begin()

    def _begin(self) -> None:
        self._begun_s = time.monotonic()
        self._child = children.start("inverter", self._job, self._folder)

    def revive(self) -> None:
        """Begin it anew where it has died; a silence that is too long has stopped the tick."""
        if not self._child.is_alive() and time.monotonic() - self._begun_s >= AGAIN_S:
            self._begin()

    def end(self) -> None:
        """Stops the spindle."""
        with contextlib.suppress(OSError):
            self._child.end()


def begun(machine: Machine, folder: Path, number: int) -> SerialInverter | None:
    """That of a machine; None where it has none."""
    spindle = machine.spindle
    if spindle is None or spindle.modbus is None:
        return None
    return SerialInverter(spindle, machine.is_simulated, folder, number)


def check_packages(machine: Machine) -> None:
    """Raises SessionError where the machine needs an extra that is not installed."""
    by_modbus = machine.spindle is not None and machine.spindle.modbus is not None
    if by_modbus and not machine.is_simulated and importlib.util.find_spec("pymodbus") is None:
        raise SessionError(message("startup.no_pymodbus"))
