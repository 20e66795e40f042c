"""A machine of X, Y and Z: a machine file, and a class that says where its tool is.

Its moves are judged by those of the trunnion with the rotaries at zero, whose tool stands along Z too.
"""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.live.replayed_runs import again, assert_same_setpoints
from support.machines.recording_bench import RecordedBench, sent
from support.machines.stepped_runs import Cut, cut, off_the_plan, shipped
from support.machines.traced_programs import named, trace
from support.oracles.trace_limits import BOUNDS, worst

from controller.ipc.handoff import Jog, of_axes
from controller.machine import kinematics, machine_file
from controller.machine.model import Machine
from controller.machine.toml_table import ConfigError
from controller.program.position import homed
from controller.program.program import ProgramError
from controller.runtime.events import Event
from controller.state.modes import MAX_AXES, Mode, Request
from controller.tick.stock import DELAY

PART = """\
G21 G90 G54 G17
T2 M6
S12000 M3
G0 X0 Y0 Z20
G1 Z2 F1800
G1 X20 Y0
G2 X30 Y10 I0 J10
G3 X40 Y20 I10 J0
G1 X40 Y40 Z5
G0 Z20
G81 X10 Y30 Z-3 R2 F600
X20
G80
G41 D2
G1 X0 Y0 F2400
G1 Z0
G1 X30
Y30
G40 X60
G0 Z30
M30
"""
WALL = """\
T2 M6
S12000 M3
G52 X10. Y0. Z20. F900.
X20. Y0. Z20.
X30. Y{lean} Z20.
X30. Y20. Z20.
X10. Y0. Z0.
X20. Y0. Z0.
X30. Y10. Z0.
X30. Y20. Z0.
M30
"""
CONE = "T2 M6\nS12000 M3\nG51 X10. Y0. Z0. I0. J0. K0. H10. R{upper} D90. F900.\nM30\n"


PERIOD_S = 0.008


def mill(**changes: object) -> Machine:
    """The shipped one; nobody is asked to switch its spindle."""
    made = shipped("three_axes", gouge="refuse")
    return replace(made, **{"period_s": PERIOD_S, **changes})  # type: ignore[arg-type]


def trunnion() -> Machine:
    """Its work offset is that of the machine of three axes."""
    return shipped(offsets=mill().offsets, gouge="refuse", period_s=PERIOD_S)


def corners(done: Cut) -> list[tuple[int, list[float]]]:
    """Line and X Y Z where each line of the program ends."""
    lines = done.column("line")
    ends = np.flatnonzero(np.diff(lines, append=-1.0))
    return [(int(lines[i]), done.joints[i, :3].tolist()) for i in ends]


@pytest.fixture(scope="module")
def part() -> Cut:
    return cut(PART, mill())


def test_lines_arcs_cycles_and_compensation_go_where_the_trunnion_goes(part: Cut) -> None:
    wanted = corners(cut(PART, trunnion()))
    assert [line for line, _ in corners(part)] == [line for line, _ in wanted]
    for (line, here), (_, there) in zip(corners(part), wanted, strict=True):
        assert here == pytest.approx(there, abs=0.08), line  # a tick at 40 mm/s is 0.16 mm
    assert part.joints[-1] == pytest.approx(wanted[-1][1], abs=1e-9)


def test_its_path_and_its_limits_are_kept(part: Cut) -> None:
    assert off_the_plan(part) < 1e-6
    assert part.joints.shape[1] == 3
    for share in worst(part):
        assert share.share < BOUNDS[share.kind], str(share)


def test_three_drives_get_the_setpoints_and_follow_them(part: Cut) -> None:
    counts = np.array([axis.counts_per_unit for axis in part.machine.axes])
    rows = part.rows
    assert (rows[:, of_axes("setpoint", 3)] == np.round(part.joints * counts)).all()
    assert len(part.stepped.rig.drives) == 3
    ticks = 2 + DELAY
    following = part.joints[:-ticks] - rows[ticks:, of_axes("actual", 3)]
    assert np.abs(following).max() < 4.0
    for _ in range(DELAY):
        part.stepped.tick()
    now = part.stepped.board.read()
    assert now is not None and now.actual == pytest.approx(part.joints[-1], abs=0.04)
    left = [rows[:, of_axes(name, MAX_AXES)][:, 3:] for name in ("joint_command", "setpoint", "actual")]
    assert not np.any(left), "places of axes that it has not"


def test_it_is_held_on_its_path_and_goes_on(part: Cut) -> None:
    events = (Event(500, Request.HOLD), Event(625, Request.RESUME))
    held = cut(PART, mill(), events)
    assert off_the_plan(held) < 1e-6
    assert held.joints[-1].tolist() == part.joints[-1].tolist()
    assert len(held.joints) > len(part.joints) + 100


def test_its_record_is_run_again_to_the_same_setpoints(tmp_path: Path) -> None:
    """With a jog aside, a hold and its end, as the service keeps it."""
    machine = mill()
    bench = RecordedBench(tmp_path, machine)
    bench.started(PART)
    bench.until_line(8)
    bench.request(Request.HOLD)
    bench.until(Mode.HOLD)
    bench.jogged_to_rest(Jog((0.0, 0.0, 1.0), 20.0, 3.0))
    assert bench.snapshot().away and len(bench.snapshot().joints) == 3
    bench.led("return")
    bench.until(Mode.HOLD)
    bench.request(Request.RESUME)
    bench.until(Mode.READY)
    folder = bench.ended()
    assert (sent(folder)[:, 3:] == 0).all() and sent(folder)[:, :3].any()
    assert_same_setpoints(again(folder, PART, machine))


@pytest.mark.parametrize("text", [WALL.format(lean="10."), CONE.format(upper="10.")])
def test_surfaces_with_upright_rulings_are_cut(text: str) -> None:
    done = cut(text, mill(gouge="warn"))
    ours, theirs = done.trace, cut(text, shipped(offsets=mill().offsets, period_s=PERIOD_S)).trace
    assert done.run.fault.name == "NONE" and ours.cutting.any()
    assert off_the_plan(done) < 1e-6
    assert (ours.tool_axis == (0.0, 0.0, 1.0)).all()
    for share in worst(done):
        assert share.share < BOUNDS[share.kind], str(share)
    for u in np.linspace(0.02, 0.98, 25):  # the same tip at the same place of the surface
        tips = [_tip_at(one, u) for one in (ours, theirs)]
        assert tips[0] == pytest.approx(tips[1], abs=1e-3)


def _tip_at(one: object, u: float) -> list[float]:
    here = one.cutting & np.isfinite(one.u)  # type: ignore[attr-defined]
    return [float(np.interp(u, one.u[here], one.tool_tip[here, i])) for i in range(3)]  # type: ignore[attr-defined]


LEANS = "stands along Z and cannot lean"
REFUSED = [
    (WALL.format(lean="11."), 3, LEANS),
    (CONE.format(upper="8."), 3, LEANS),
    ("G0 X1 A10\nM30\n", 1, "A10 moves an axis that this machine does not have: its axes are X Y Z"),
    ("G1 X1 C10 F100\nM30\n", 1, "C10 moves an axis that this machine does not have"),
    ("G68.2 X0 Y0 Z0 I0 J30 K0\nG53.1\nM30\n", 2, "it stands along Z, and no axis of this machine turns it"),
    ("T2 M6\nG43.5 H2\nG1 X1 I0 J0.1 K1 F100\nM30\n", 3, LEANS),
]


@pytest.mark.parametrize(("text", "line", "sentence"), REFUSED)
def test_what_it_cannot_do_is_refused_in_one_sentence(text: str, line: int, sentence: str) -> None:
    with pytest.raises(ProgramError) as refused:
        trace(text, mill(), homed(mill()))
    assert str(refused.value).startswith(f"part.ngc:{line}:") and sentence in str(refused.value)
    assert str(refused.value).count(". ") == 0


def test_planes_turned_about_z_and_tool_centre_control_upright_are_as_they_were() -> None:
    turned = "G68.2 X0 Y0 Z0 I30 J0 K0\nG53.1\nG0 X0 Y0\nG1 X10 F600\nM30\n"
    (line,) = [s for s in named(trace(turned, mill(), homed(mill())), "line") if s.place.line == 4]
    x, y = math.cos(math.radians(30.0)), math.sin(math.radians(30.0))
    assert np.subtract(line.end, line.start) == pytest.approx((10.0 * x, 10.0 * y, 0.0))
    upright = "T2 M6\nG43.5 H2\nG1 X5 I0 J0 K1 F600\nX10\nG43.4 H2\nG1 X20 Y5 Z-5\nM30\n"
    done = cut(upright, mill())
    length = next(tool.length_mm for tool in mill().tools if tool.number == 2)
    assert done.joints[-1] == pytest.approx(np.add(mill().offsets[0].origin, (20.0, 5.0, -5.0 + length)))


SKEWED = """\
from controller.geometry.vectors import Pose, Z
from controller.machine.kinematics.no_rotary import NoRotary


class Skewed(NoRotary):
    axes = "X, Y and Z, with Y leaning to X by 3 in 5"

    def linear(self, tip, rotaries, length_mm, m=None):
        x, y, z = tip
        return x - 0.75 * y, 1.25 * y, z + length_mm

    def forward(self, joints, length_mm, m=None):
        x, y, z, _, _ = self.spread(joints)
        return Pose((x + 0.6 * y, 0.8 * y, z - length_mm), Z)
"""


def test_a_machine_of_another_build_is_a_class_and_a_file(tmp_path, monkeypatch) -> None:
    """What a newcomer writes: one module in the room of the kinematics, one machine file that names it."""
    (tmp_path / "skewed.py").write_text(SKEWED)
    (tmp_path / "mill.toml").write_text(
        (machine_file.SHIPPED / "three_axes.toml").read_text().replace('"no_rotary"', '"skewed"', 1)
    )
    monkeypatch.setattr(kinematics, "__path__", [*kinematics.__path__, str(tmp_path)])
    kinematics.builds.cache_clear()
    try:
        skewed = machine_file.with_period(machine_file.load(tmp_path / "mill.toml"), PERIOD_S)
        of_the_tip = "T2 M6\nG43.4 H2\nG1 X20 Y10 Z5 F900\nX30 Y20\nM30\n"
        programs = (of_the_tip, WALL.format(lean="10."))
        ends = [(cut(text, skewed).joints[-1], cut(text, mill()).joints[-1]) for text in programs]
    finally:
        kinematics.builds.cache_clear()
        sys.modules.pop("controller.machine.kinematics.skewed")
    for there, (x, y, z) in ends:
        assert there == pytest.approx([x - 0.75 * y, 1.25 * y, z], abs=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ('kinematics = "no_rotary"', "", "allowed: X, Y, Z and two of A, B, C, each once"),
        (
            '"no_rotary"',
            '"no_rotaries"',
            "kinematics = .no_rotaries.: is not known; allowed: ",
        ),
        ('name = "Y"', 'name = "X"', "an axis above has this name; allowed: each axis once; rename one"),
    ],
)
def test_a_file_whose_axes_do_not_fit_is_refused(tmp_path, old: str, new: str, sentence: str) -> None:
    file = tmp_path / "mill.toml"
    file.write_text((machine_file.SHIPPED / "three_axes.toml").read_text().replace(old, new, 1))
    with pytest.raises(ConfigError, match=sentence):
        machine_file.load(file)
