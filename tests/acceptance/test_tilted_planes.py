"""A part on a tilted plane on the stepped machine: what the servos are told, seen through plain matrices."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from support.machines.stepped_runs import SHIPPED, cut, shipped
from support.machines.traced_programs import segments, trace
from support.oracles import tilted_planes
from support.oracles.tilted_planes import Bench

from controller.geometry.arrays import Array
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine
from controller.plan.rotaries.branch import joints_along
from controller.program.position import homed

LENGTH = 12.5
COUNT_MM = 2e-5  # what counts of the drives leave of a position, at the lever of the rotaries
# G53.6 at line 7, over the plane, a line, an arc of 7 mm about (4, -3), two holes
PART = """G21 G90 G54 G61
S1000 M3
G43.1 Z12.5
G0 Z60.
G0 X0 Y0
{plane}
{turn}
G0 X1. Y2. Z20.
G1 X11. Y-3. Z5. F2000.
G3 X4. Y4. I-7. J0.
{hole} X3. Y4. Z-2. R3. F600.
X5.
G80
G0 Z20.
G69
M30
"""
PLANES = {
    "fanuc": ("G68.2 P1 Q123 X5. Y6. Z7. I20. J15. K30.", {"Q": 123.0}),
    "rs274": ("G68.2 P1 Q321 X5. Y6. Z7. I20. J15. K30. R10.", {"Q": 321.0, "R": 10.0}),
}


def plane_of(dialect: str) -> Array:
    make = tilted_planes.fanuc if dialect == "fanuc" else tilted_planes.linuxcnc
    words = {"X": 5.0, "Y": 6.0, "Z": 7.0, "I": 20.0, "J": 15.0, "K": 30.0}
    return make(1, {0: words | PLANES[dialect][1]})


class Gone(NamedTuple):
    """Joints (N, 5) in mm and rad, and the line of each."""

    machine: Machine
    joints: Array
    lines: Array


def run(name: str, dialect: str, hole: str = "G98 G81", turn: str = "G53.6") -> Gone:
    """What the drives were told at every tick."""
    machine = shipped(name, dialect=dialect, without_point="unit", period_s=0.004)
    done = cut(PART.format(plane=PLANES[dialect][0], turn=turn, hole=hole), machine)
    assert done.run.result == "completed", done.run.fault_text
    return Gone(machine, done.joints, done.trace.line)


def planned(name: str, dialect: str, hole: str) -> Gone:
    """The path, sampled evenly."""
    machine = shipped(name, dialect=dialect, without_point="unit", period_s=0.004)
    made = trace(PART.format(plane=PLANES[dialect][0], turn="G53.6", hole=hole), machine, homed(machine))
    rows, lines, kinematics = [], [], kinematics_of(machine)
    for segment in segments(made):
        rows.append(joints_along(segment, np.linspace(0.0, segment.motion.end, 41), kinematics))
        lines += [segment.place.line] * 41
    return Gone(machine, np.vstack(rows), np.array(lines))


def seen(done: Gone, name: str, line: int) -> tuple[Array, Array]:
    """Tips and axes on a line, table frame."""
    where, axes, machine = Bench.of(name), [], done.machine
    tips = []
    for row in done.joints[np.flatnonzero(done.lines == line)]:
        shown = zip(machine.axes, row, strict=True)
        tip, axis = where.tool({a.name: q * a.shown_per_unit for a, q in shown}, LENGTH)
        tips.append(tip)
        axes.append(axis)
    assert len(tips) > 10, line
    return np.array(tips), np.array(axes)


def in_plane(tips: Array, name: str, dialect: str) -> Array:
    """Places of the table frame as places of the tilted plane."""
    part = tips - Bench.of(name).origin
    plane = plane_of(dialect)
    return (part - plane[:3, 3]) @ plane[:3, :3]


def assert_part(done: Gone, name: str, dialect: str) -> None:
    tips, _ = seen(done, name, 7)
    assert np.abs(tips - tips[0]).max() < COUNT_MM  # the tip stands while the tool turns
    for line in range(8, 13):
        tips, axes = seen(done, name, line)
        assert np.abs(axes - plane_of(dialect)[:3, 2]).max() < 1e-6, line
    line, _ = seen(done, name, 9)
    way = in_plane(line, name, dialect)
    start, end = np.array([1.0, 2.0, 20.0]), np.array([11.0, -3.0, 5.0])
    along = (end - start) / np.linalg.norm(end - start)
    off = (way - start) - np.outer((way - start) @ along, along)
    assert np.abs(off).max() < COUNT_MM
    assert np.abs(way[-1] - end).max() < 1e-2
    arc, _ = seen(done, name, 10)
    bow = in_plane(arc, name, dialect)
    assert np.abs(np.hypot(bow[:, 0] - 4.0, bow[:, 1] + 3.0) - 7.0).max() < COUNT_MM
    assert np.abs(bow[:, 2] - 5.0).max() < COUNT_MM
    for number, x in ((11, 3.0), (12, 5.0)):
        hole, _ = seen(done, name, number)
        place = in_plane(hole, name, dialect)
        deep = place[place[:, 2] < 3.0 - COUNT_MM]
        assert len(deep) > 20
        assert np.abs(deep[:, :2] - [x, 4.0]).max() < COUNT_MM  # straight along the tool
        assert deep[:, 2].min() == pytest.approx(-2.0, abs=COUNT_MM)


@pytest.mark.parametrize("dialect", ["fanuc", "rs274"])
@pytest.mark.parametrize("name", SHIPPED)
def test_the_path_is_the_one_of_the_plane(name: str, dialect: str) -> None:
    assert_part(planned(name, dialect, "G99 G83 Q1.5"), name, dialect)


@pytest.mark.parametrize(("name", "dialect"), [("trunnion", "fanuc"), ("head_head", "rs274")])
def test_servos_are_told_what_the_plane_asks_for(name: str, dialect: str) -> None:
    assert_part(run(name, dialect), name, dialect)


@pytest.mark.slow
@pytest.mark.parametrize("dialect", ["fanuc", "rs274"])
@pytest.mark.parametrize("name", ["trunnion", "fig4b", "table_head", "head_head", "oblique45"])
def test_on_every_kind_of_machine(name: str, dialect: str) -> None:
    for hole in ("G98 G83 Q1.5", "G99 G73 Q2."):
        assert_part(run(name, dialect, hole), name, dialect)


def test_x_y_z_stand_while_g53_1_turns_the_tool() -> None:
    done = run("table_head", "fanuc", turn="G53.1")
    rows = done.joints[np.flatnonzero(done.lines == 7)][:, list(done.machine.linear())]
    assert len(rows) > 10 and np.abs(rows - rows[0]).max() < 1e-9
