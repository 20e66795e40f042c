"""The shipped trunnion with a spindle, inputs, outputs and rotary clamps on a bus of their own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from controller.ipc.handoff import Snapshot
from controller.machine import machine_file
from controller.machine.model import Machine
from controller.runtime import checked
from controller.runtime.bench import surroundings
from controller.runtime.events import Event
from controller.runtime.stepped import Run, SteppedMachine
from drives.bench.simulated.inverter import Inverter

SECOND_BUS = """
[[bus]]
name = "can1"
interface = "virtual"
bit_rate = 1_000_000
"""
SPINDLE = """
[spindle]
max_rev_min = 12000
bus = "can1"
node = 10
counts_per_rev = 4096
acceleration_rev_s2 = 400.0
spin_up_s = 1.0
"""
IO = """
[io]
bus = "can1"
node = 11
inputs = { estop = 0, door = 1, clamp_A_closed = 2, clamp_C_closed = 3 }
outputs = { coolant = 0, mist = 1, clamp_A = 2, clamp_C = 3 }
"""
SLOWER = "period_s = 0.002", "period_s = 0.004"  # a change of the text: half the ticks
ESTOP, DOOR, A_CLOSED, C_CLOSED = 0, 1, 2, 3  # inputs
COOLANT, MIST, A_OPEN, C_OPEN = 0, 1, 2, 3  # outputs


def inverters(monkeypatch: pytest.MonkeyPatch) -> list[Inverter]:
    """Of the machines that are made from now on."""
    made: list[Inverter] = []
    monkeypatch.setattr(surroundings, "Inverter", lambda *given: made.append(Inverter(*given)))
    return made


def without_spindle(machine: str) -> str:
    """A machine file without its table [spindle], which is not its last one."""
    before, _, after = machine.partition("[spindle]\n")
    return before + after[after.index("\n[") + 1 :] if after else machine


def text(spindle: str = SPINDLE, io: str = IO, clamps: str = "AC", *changes: tuple[str, str]) -> str:
    """The machine file, complete with its tools."""
    made = without_spindle((machine_file.SHIPPED / "trunnion.toml").read_text())
    for name, node in (("A", 4), ("C", 5)):
        if name in clamps:
            clamp = f'{{ output = "clamp_{name}", input = "clamp_{name}_closed", open_s = 0.1 }}'
            made = made.replace(f"\nnode = {node}\n", f"\nnode = {node}\nclamp = {clamp}\n")
    for old, new in changes:
        assert old in made, old
        made = made.replace(old, new, 1)
    return f"{made}\n{SECOND_BUS}{spindle}{io}\n{(machine_file.SHIPPED / 'tools.toml').read_text()}"


def mill(*parts: str, changes: tuple[tuple[str, str], ...] = ()) -> Machine:
    defaults = (SPINDLE, IO, "AC")
    return machine_file.read(text(*parts, *defaults[len(parts) :], *changes), "mill.toml")


class Mill:
    """A stepped machine that notes every change of what its peripherals do."""

    def __init__(self, machine: Machine | None = None, come_up: bool = True) -> None:
        self.machine = machine or mill(changes=(SLOWER,))
        self.bench = SteppedMachine(self.machine)
        self.seen: list[Snapshot] = []
        self.at: dict[int, Callable[[], Any]] = {}  # what happens to the machine, by tick of the run
        self._tick, self._n = self.bench.tick, 0
        if come_up:
            self.bench.come_up()
        self.bench.tick = self._noted  # type: ignore[method-assign]

    @property
    def io(self) -> Any:
        return self.bench.rig.io["io"]

    def input(self, number: int, on: bool) -> Callable[[], None]:
        """For ``at``: an input changes."""
        return lambda: self.io.set_input(number, on, self.bench.rig.now_s)

    def _noted(self) -> None:
        if (act := self.at.get(self._n)) is not None:
            act()
        self._n += 1
        self._tick()
        now = self.bench.board.read()
        assert now is not None
        self.seen.append(now)

    def run(self, program: str, *events: Event) -> Run:
        task = replace(checked.task(program.encode(), "part.ngc", self.machine), start=self.bench.joints)
        self._n = 0
        return self.bench.run(checked.walk_of(task, None, False), events)

    def ticks(self, count: int) -> Snapshot:
        for _ in range(count):
            self.bench.tick()
        return self.seen[-1]
