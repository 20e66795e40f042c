"""Shipped machines with a probe, inputs on a bus of their own, and something to be touched."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from controller.machine import machine_file
from controller.machine.model import Machine
from controller.machine.toml_table import parse
from controller.runtime import checked
from controller.runtime.bench import probe
from controller.runtime.stepped import Run, SteppedMachine

BUS_AND_IO = """
[[bus]]
name = "io"
interface = "virtual"
bit_rate = 1_000_000

[io]
bus = "io"
node = 11
inputs = { probe = 0, setter = 1 }
"""
PROBE = """
[probe]
tool = 99
latency_ms = 4.0          # a simulated node looks at the end of a period, and tells with the next
overtravel_mm = 3.0
"""
LATCHED = "latch_tpdo = 3\n"
SETTER = """
[setter]
point_mm = [-80.0, -40.0, 60.0]
radius_mm = 8.0
latency_ms = 4.0
"""
TOOL = """
[[tool]]
number = 99
name = "touch probe"
radius_mm = 3.0
length_mm = 60.0
flute_mm = 10.0
"""


def machine(name: str = "trunnion", latched: bool = True, **changes: str) -> Machine:
    """``changes``: texts of the machine file that take the place of others."""
    made = (machine_file.SHIPPED / f"{name}.toml").read_text()
    made += BUS_AND_IO + PROBE + LATCHED * latched + SETTER
    made += (machine_file.SHIPPED / "tools.toml").read_text() + TOOL
    for old, new in changes.items():
        made = made.replace(old, new)
    return machine_file.read(made, f"{name}.toml")


@dataclass
class Probed:
    """A run on a machine that can touch something."""

    stepped: SteppedMachine
    run: Run
    error: str
    said: list[str]

    @property
    def touched(self) -> probe.Touched:
        assert self.stepped.touch is not None
        return self.stepped.touch.touched


def up(part: str, made: Machine | None = None) -> SteppedMachine:
    """A machine that has come up; ``part``: the text of its simulation file."""
    made = made or machine()
    bench = probe.read(parse(part, "part.toml"), made, Path())
    stepped = SteppedMachine(made, bench=bench)
    stepped.come_up()
    return stepped


def run(text: str, stepped: SteppedMachine) -> Probed:
    """Read as it is run; ``said`` are its messages."""
    asked = checked.task(text.encode(), "probe.ngc", stepped.machine)
    said: list[str] = []
    walk = checked.path_of(asked, in_spindle=None)
    done = stepped.run(walk)
    said += [note.sentence for note in walk.notes]
    error = stepped.planner.error
    return Probed(stepped, done, "" if error is None else str(error), said)
