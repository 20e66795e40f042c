"""A simulated machine's probe, the part that it touches, and what the machine file does not know.

    [probe]                     # what is true of it, where the tool table says something else
    length_error_mm = 0.0       # longer than the table has it
    radius_mm = 2.998           # of the ball; left out: as the table has it
    eccentric_mm = [0.0, 0.0]   # of the ball off the spindle's axis
    pretravel_mm = 0.004        # the stylus gives so far across its axis before it tells ...
    axial_mm = 0.001            # ... and along it
    lobes_mm = 0.001            # more or less of it three times round
    scatter_mm = 0.0005         # standard deviation from touch to touch
    seed = 1

    [tool]                      # the one that touches the tool setter, as it truly is: an end mill
    length_mm = 60.0
    radius_mm = 3.0

    [[axis]]                    # where the machine differs from its file
    name = "C"
    point_mm = [0.1, -0.2, 0.0] # its axis is so far off ...
    tilt_deg = [0.05, 0.0, 0.0] # ... and so far turned about X, Y, Z
    backlash_mm = 0.0           # (backlash_deg of a rotary) lost between motor and axis
    pitch_per_m = 0.0           # mm that a metre is too long (linear axes)

The contact is the place between two periods where the ball, less what the stylus gives, meets the part: so a
latch in hardware would see it.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

from controller.geometry.vectors import Frame, Vector, X, Y, Z, add, dot, norm, rotate, scale, subtract, unit
from controller.machine.kinematics import kinematics_of
from controller.machine.kinematics.slides import Slides
from controller.machine.model import Joints, Machine, Sensor
from controller.machine.toml_table import Table, parse, read_text
from controller.runtime.bench import cut as cuts
from controller.runtime.bench import part as parts
from controller.runtime.bench.cut import Cut
from controller.runtime.bench.part import Part
from drives.bench.simulated.drive import SimulatedDrive

NEAR_MM = 0.2  # nearer than that the direction of the contact is looked at
EXACT_MM = 1e-8
MAX_STEPS = 60
SETTER_MM = 30.0  # so far down the side of a tool setter is


@dataclass(frozen=True, slots=True)
class Nature:
    """A probe as it truly is; mm."""

    length_mm: float  # from the gauge line to the end of the ball
    radius_mm: float
    eccentric_mm: tuple[float, float] = (0.0, 0.0)
    pretravel_mm: float = 0.0
    axial_mm: float = 0.0
    lobes_mm: float = 0.0
    scatter_mm: float = 0.0
    seed: int = 1

    def gives(self, across: float, along: float, angle_rad: float) -> float:
        """How far the stylus gives before it tells: direction of the touch across and along its axis."""
        lobes = self.lobes_mm * math.cos(3.0 * angle_rad)
        return across * across * (self.pretravel_mm + lobes) + along * along * self.axial_mm


@dataclass(frozen=True, slots=True)
class Lost:
    """What one axis loses between motor and slide, mm or rad."""

    backlash: float = 0.0
    pitch: float = 0.0  # share of the way


@dataclass(frozen=True, slots=True)
class Bench:
    """All that a simulation file says."""

    part: Part
    probe: Nature
    machine: Machine  # as it truly is
    lost: tuple[Lost, ...]
    setter: Bench | None = None  # the tool setter and the tool that touches it
    cut: Cut | None = None  # what loads the spindle


def load(path: Path, machine: Machine) -> Bench:
    """The bench of a simulation file. Raises ConfigError."""
    return read(parse(read_text(path), path.name), machine, path.parent)


def read(top: Table, machine: Machine, folder: Path) -> Bench:
    probe = _nature(top.table("probe", "[probe]", optional=True), machine)
    true, lost = _hidden(top, machine)
    tool = _tool(top.table("tool", "[tool]"), machine.setter) if machine.setter and top.has("tool") else None
    part = parts.read(top, machine, folder)
    cut = cuts.read(top, part.frame)
    top.finish()
    setter = None if tool is None else Bench(*tool, true, lost)
    return Bench(part, probe, true, lost, setter, cut)


def _tool(table: Table, setter: Sensor) -> tuple[Part, Nature]:
    """The middle of its end face, and what that may not go into: the setter, wider by the tool's radius."""
    length, radius = table.positive("length_mm"), table.positive("radius_mm")
    table.finish()
    return on_setter(setter, length, radius)


def on_setter(setter: Sensor, length: float, radius: float) -> tuple[Part, Nature]:
    """A tool's end face, and what it may not go into."""
    wide = parts.cylinder(setter.point, Z, setter.radius_mm + radius, SETTER_MM)
    return Part("setter", Frame(), (wide,), ()), Nature(length, 0.0)


def _nature(table: Table, machine: Machine) -> Nature:
    tool = machine.tool(machine.probe.tool) if machine.probe is not None else None
    length, radius = (tool.length_mm, tool.radius_mm) if tool is not None else (0.0, 1.0)
    across = table.numbers("eccentric_mm", 2, (0.0, 0.0))
    found = Nature(
        length + table.number("length_error_mm", default=0.0),
        table.positive("radius_mm", radius),
        (across[0], across[1]),
        table.number("pretravel_mm", 0.0, 1.0, 0.0),
        table.number("axial_mm", 0.0, 1.0, 0.0),
        table.number("lobes_mm", 0.0, 1.0, 0.0),
        table.number("scatter_mm", 0.0, 1.0, 0.0),
        table.integer("seed", 0, 1 << 30, 1),
    )
    table.finish()
    return found


def _hidden(top: Table, machine: Machine) -> tuple[Machine, tuple[Lost, ...]]:
    axes, lost = list(machine.axes), [Lost() for _ in machine.axes]
    names = [axis.name for axis in axes]
    for table in top.tables("axis"):
        i = names.index(table.text("name", names))
        axis = axes[i]
        direction = axis.direction
        for about, angle in zip((X, Y, Z), table.vector("tilt_deg", (0.0, 0.0, 0.0)), strict=True):
            direction = rotate(about, math.radians(angle), direction)
        point = add(axis.point_mm, table.vector("point_mm", (0.0, 0.0, 0.0)))
        axes[i] = replace(axis, direction=direction, point_mm=point)
        unit_name, size = ("deg", math.radians(1.0)) if axis.is_rotary else ("mm", 1.0)
        backlash = table.number(f"backlash_{unit_name}", 0.0, 5.0, 0.0) * size
        pitch = 0.0 if axis.is_rotary else table.number("pitch_per_m", -10.0, 10.0, 0.0) * 1e-3
        lost[i] = Lost(backlash, pitch)
        table.finish()
    return replace(machine, axes=tuple(axes)), tuple(lost)


class Touched:
    """Whether the probe touches, period by period.

    ``look`` takes the joints as the motors have them, mm and rad, and gives the share of the period in which
    the contact closed or opened. Read: ``closed``, and of the last touch ``point`` (of the part, table
    frame), ``normal``.
    """

    def __init__(self, bench: Bench) -> None:
        self._part, self._probe, self._lost = bench.part, bench.probe, bench.lost
        self._kinematics = kinematics_of(bench.machine)
        self._x = bench.machine.linear()[0]
        self._random = random.Random(bench.probe.seed)
        self._scatter = self._random.gauss(0.0, bench.probe.scatter_mm)
        self._motors: Joints | None = None
        self._slides: list[float] = []
        self._centre: Vector = (0.0, 0.0, 0.0)
        self._room = -math.inf  # so far the centre of the ball may go before there is anything to see
        self.closed = False
        self.point: Vector = (0.0, 0.0, 0.0)
        self.normal: Vector = Z

    def look(self, motors: Joints) -> float | None:
        """The share of the period, 0 to 1, at which the contact changed; None where it did not."""
        before = self._slides
        if self._motors is None:
            self._slides = [q * (1.0 + one.pitch) for q, one in zip(motors, self._lost, strict=True)]
            before = self._slides
        elif motors == self._motors:
            return None
        else:
            self._slides = [
                _played(q * (1.0 + one.pitch), at, 0.5 * one.backlash)
                for q, at, one in zip(motors, before, self._lost, strict=True)
            ]
        self._motors = motors
        centre = self.centre(self._slides)
        moved = norm(subtract(centre, self._centre))
        self._centre = centre
        self._room -= moved
        if self._room > 0.0 and not self.closed:
            return None
        return self._changed(before)

    def centre(self, slides: Sequence[float]) -> Vector:
        """Of the ball, table frame."""
        tip, axis = self._kinematics.forward(slides, self._probe.length_mm)
        centre = add(tip, scale(axis, self._probe.radius_mm))
        if self._probe.eccentric_mm != (0.0, 0.0):
            first, second = self._across(slides, axis)
            a, b = self._probe.eccentric_mm
            centre = add(centre, add(scale(first, a), scale(second, b)))
        return centre

    def _across(self, slides: Sequence[float], axis: Vector) -> tuple[Vector, Vector]:
        """Two directions across the probe's axis, the first along the machine's X where that is possible."""
        moved = list(slides)
        moved[self._x] += 1.0
        x = subtract(self._kinematics.forward(moved, 0.0).tip, self._kinematics.forward(slides, 0.0).tip)
        first = subtract(x, scale(axis, dot(axis, x)))
        if norm(first) < 1e-3:
            first = subtract(Y, scale(axis, dot(axis, Y)))
        first = unit(first)
        a, f = axis, first
        return first, (a[1] * f[2] - a[2] * f[1], a[2] * f[0] - a[0] * f[2], a[0] * f[1] - a[1] * f[0])

    def _changed(self, before: Sequence[float]) -> float | None:
        now = self._slides
        far = self._part.distance(self._centre) - self._probe.radius_mm
        if far > NEAR_MM:
            self._room = far
            return self._opened_far()
        given = self._gives(now)

        def gap(share: float) -> float:
            here = [a + share * (b - a) for a, b in zip(before, now, strict=True)]
            return self._part.distance(self.centre(here)) - self._probe.radius_mm + given

        end = gap(1.0)
        self._room = end
        if (end <= 0.0) == self.closed:
            return None
        share = _root(gap, end)
        self.closed = not self.closed
        here = [a + share * (b - a) for a, b in zip(before, now, strict=True)]
        if self.closed:
            centre = self.centre(here)
            self.normal = self._part.normal(centre)
            self.point = subtract(centre, scale(self.normal, self._part.distance(centre)))
        else:
            self._scatter = self._random.gauss(0.0, self._probe.scatter_mm)
        return share

    def _opened_far(self) -> float | None:
        """Lifted off by more than a period's way."""
        if not self.closed:
            return None
        self.closed = False
        self._scatter = self._random.gauss(0.0, self._probe.scatter_mm)
        return 0.0

    def _gives(self, slides: Sequence[float]) -> float:
        axis = self._kinematics.forward(slides, 0.0).axis
        normal = self._part.normal(self._centre)
        along = float(dot(normal, axis))
        first, second = self._across(slides, axis)
        angle = math.atan2(float(dot(normal, second)), float(dot(normal, first)))
        return self._probe.gives(math.sqrt(max(1.0 - along * along, 0.0)), along, angle) + self._scatter


class Inputs(Protocol):
    """What is needed of the node with the inputs."""

    def set_input(self, number: int, on: bool, now_s: float, /) -> None: ...


class Wired:
    """Drives and inputs that see what the probe touches; call ``watch`` when the motors have moved."""

    def __init__(
        self,
        bench: Bench,
        machine: Machine,
        drives: Sequence[SimulatedDrive],
        io: Inputs | None,
        sensor: Sensor | None,
    ) -> None:
        """``drives`` in the order of the axes; ``sensor``: the machine's probe, or its tool setter."""
        self.touched = Touched(bench)
        self.stuck: bool | None = None  # what the input shows, whatever is touched; None: the touch
        self._drives, self._io = drives, io
        self._counts = tuple(axis.counts_per_unit for axis in machine.axes)
        self._from_motors = Slides(machine.axes).real
        self._before = [drive.motor_counts for drive in drives]
        self._latched = sensor is machine.probe or (sensor is not None and sensor.latch_tpdo > 0)
        self._bit = machine.io.input(sensor.input) if sensor is not None and machine.io is not None else None
        self._inverted = sensor is not None and machine.io is not None and sensor.input in machine.io.inverted

    def watch(self, now_s: float) -> None:
        now = [drive.motor_counts for drive in self._drives]
        if now == self._before:
            return
        motors = [
            counts * drive.units_per_count / per
            for counts, drive, per in zip(now, self._drives, self._counts, strict=True)
        ]
        share = self.touched.look(tuple(self._from_motors(motors)))
        if share is not None and self.stuck is None:
            if self._latched:
                for drive, a, b in zip(self._drives, self._before, now, strict=True):
                    drive.strike(self.touched.closed, a + share * (b - a), now_s)
            self.show(self.touched.closed, now_s)
        self._before = now

    def show(self, closed: bool, now_s: float) -> None:
        """What the input of the node is."""
        if self._io is not None and self._bit is not None:
            self._io.set_input(self._bit, closed is not self._inverted, now_s)

    def hang(self, closed: bool | None, now_s: float) -> None:
        """From now on the probe shows this, whatever it touches; None: it is sound again."""
        self.stuck = closed
        self.show(self.touched.closed if closed is None else closed, now_s)


def _played(motor: float, slide: float, half: float) -> float:
    """Where a slide is that the motor takes along once the play is used up."""
    return min(max(slide, motor - half), motor + half)


def _root(gap: Callable[[float], float], end: float) -> float:
    """Where ``gap`` changes its sign between 0 and 1; 0 where it has done so before."""
    low, high = 0.0, 1.0
    at_low, at_high = gap(0.0), end
    if (at_low <= 0.0) == (at_high <= 0.0):
        return 0.0
    for _ in range(MAX_STEPS):
        share = low + (high - low) * at_low / (at_low - at_high)
        share = min(max(share, low + 0.01 * (high - low)), high - 0.01 * (high - low))
        here = gap(share)
        if abs(here) < EXACT_MM:
            return share
        if (here <= 0.0) == (at_low <= 0.0):
            low, at_low = share, here
        else:
            high, at_high = share, here
    return high
