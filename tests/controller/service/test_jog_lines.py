"""Lines to jog along: checked against where the tool goes by forward kinematics."""

from __future__ import annotations

import math
import random
from dataclasses import replace

import pytest
from support.machines.shipped_kinds import ROTARIES, machine, random_machine

from controller.geometry.vectors import Frame, norm, rotate, scale, subtract
from controller.machine import machine_file
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine, Sense
from controller.messages import text
from controller.service import jogging
from controller.service.jogging import JogError, Stance
from controller.state.modes import ALL_AXES

LETTERS = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}
NO_OFFSET = Frame()
TURNED = Frame(
    (10.0, -5.0, 30.0),
    *(rotate((0.0, 0.6, 0.8), 0.7, letter) for letter in LETTERS.values()),
)


def at(
    built: Machine, joints: tuple[float, ...] = (0.0,) * 5, part: Frame = NO_OFFSET, homed: int = ALL_AXES
) -> Stance:
    return Stance(built, kinematics_of(built), joints, part, homed)


def some_machines(rng: random.Random) -> list[Machine]:
    return [machine(kind) for kind in ROTARIES] + [random_machine(rng) for _ in range(10)]


def some_joints(rng: random.Random) -> tuple[float, ...]:
    return (*(rng.uniform(-200, 200) for _ in range(3)), rng.uniform(-1.5, 1.5), rng.uniform(-7, 7))


@pytest.mark.parametrize("axis", "XYZ")
def test_a_line_of_the_part_moves_the_tip_along_the_axis_of_its_offset(axis: str) -> None:
    seed = random.randrange(2**32)
    rng = random.Random(seed)
    for built in some_machines(rng):
        kinematics, joints = kinematics_of(built), some_joints(rng)
        line = at(built, joints, TURNED).direction("part", axis)
        there = [q + 7.0 * d for q, d in zip(joints, line, strict=True)]
        before, after = kinematics.forward(joints, 80.0), kinematics.forward(there, 80.0)
        moved = TURNED.turn_back(subtract(after.tip, before.tip))
        assert moved == pytest.approx(scale(LETTERS[axis], 7.0), abs=1e-9), f"seed {seed}, {built.name}"
        assert after.axis == pytest.approx(before.axis, abs=1e-12)


def test_z_of_the_tool_retracts_along_the_tool_axis_and_x_and_y_stand_across_it() -> None:
    seed = random.randrange(2**32)
    rng = random.Random(seed)
    for built in some_machines(rng):
        kinematics, joints = kinematics_of(built), some_joints(rng)
        before = kinematics.forward(joints, 80.0)
        ways = []
        for axis in "XYZ":
            line = at(built, joints, TURNED).direction("tool", axis)
            there = [q + 7.0 * d for q, d in zip(joints, line, strict=True)]
            ways.append(subtract(kinematics.forward(there, 80.0).tip, before.tip))
        assert ways[2] == pytest.approx(scale(before.axis, 7.0), abs=1e-9), f"seed {seed}, {built.name}"
        for one, other in ((0, 1), (0, 2), (1, 2)):
            assert sum(a * b for a, b in zip(ways[one], ways[other], strict=True)) == pytest.approx(
                0.0, abs=1e-8
            )
        assert [norm(way) for way in ways] == pytest.approx([7.0] * 3)


def test_an_axis_that_is_nothing_in_a_line_stands_altogether() -> None:
    built = machine("fig4a")
    joints = (1.0, 2.0, 3.0, 0.0, math.pi / 2)
    line = at(built, joints).direction("part", "X")
    assert line[0] == line[2] == line[3] == line[4] == 0.0 and abs(line[1]) == pytest.approx(1.0)


def test_a_joint_is_jogged_in_the_sense_that_is_shown() -> None:
    built = machine("fig4a")
    iso = replace(built, axes=(*built.axes[:4], replace(built.axes[4], sense=Sense.ISO)))
    carried, flipped = (at(one, homed=0).step("joint", "C", 90.0) for one in (built, iso))
    assert carried.direction[4] == 1.0 and flipped.direction[4] == -1.0
    assert carried.length == flipped.length == pytest.approx(math.radians(90.0))


@pytest.mark.parametrize("share", [1.0, -1.0, 0.25, -0.01])
def test_the_speed_is_a_share_of_what_the_slowest_axis_may_have(share: float) -> None:
    built = machine("fig4a")
    jog = at(built, (0.0, 0.0, 0.0, 0.4, 0.3)).continuous("part", "Y", share)
    speeds = [abs(d) * jog.speed / a.limits.velocity for d, a in zip(jog.direction, built.axes, strict=True)]
    assert max(speeds) == pytest.approx(abs(share) * built.rapid_share)
    assert math.isinf(jog.length) and jog.is_sound


@pytest.mark.parametrize(("axes", "sign"), [("X+Y", 1.0), ("Z-X", -1.0)])
@pytest.mark.parametrize("frame", ["part", "tool", "joint"])
def test_a_diagonal_is_as_long_as_a_line_and_has_as_much_of_both_axes(
    frame: str, axes: str, sign: float
) -> None:
    rng = random.Random(7)
    for built in some_machines(rng):
        here = at(built, some_joints(rng), TURNED)
        one, other, both = (here.direction(frame, axis) for axis in (axes[0], axes[2], axes))
        wanted = [(a + sign * b) / math.sqrt(2.0) for a, b in zip(one, other, strict=True)]
        assert both == pytest.approx(wanted, abs=1e-12), built.name
        assert math.hypot(*both) == pytest.approx(1.0)


def test_a_jog_is_no_faster_than_it_is_asked_for_in_mm_or_degrees_a_minute() -> None:
    built = machine_file.load("trunnion")
    for axis, feed, per_s in (("X", 600.0, 10.0), ("A", 600.0, math.radians(10.0)), ("X+Y", 60.0, 1.0)):
        line = at(built).continuous("joint", axis, 1.0)
        assert jogging.slowed(built, line, "joint", axis, feed).speed == pytest.approx(per_s)
        assert jogging.slowed(built, line, "joint", axis, 1e6) == line
        assert jogging.slowed(built, line, "joint", axis, None) == line


def test_a_step_knows_its_side_and_its_length() -> None:
    built = machine("fig4a")
    jog = at(built).step("joint", "X", -0.5)
    assert jog.direction == (-1.0, 0.0, 0.0, 0.0, 0.0) and jog.length == 0.5
    assert jog.speed == pytest.approx(built.rapid_share * built.axes[0].limits.velocity)


@pytest.mark.parametrize(
    ("frame", "axis", "homed", "share", "said"),
    [
        ("joint", "Q", ALL_AXES, 1.0, "allowed are X, Y, Z, A, C"),
        ("world", "X", ALL_AXES, 1.0, "allowed are joint, part, tool"),
        ("part", "A", ALL_AXES, 1.0, "allowed are X, Y and Z"),
        ("tool", "Z", ALL_AXES & ~0b10010, 1.0, "before Y, C is homed"),
        ("joint", "X", ALL_AXES, 0.0, "a share from -1 to 1"),
        ("joint", "X", ALL_AXES, 1.1, "a share from -1 to 1"),
        ("joint", "X", ALL_AXES, math.nan, "a share from -1 to 1"),
    ],
)
def test_what_cannot_be_jogged_is_said_in_a_sentence(
    frame: str, axis: str, homed: int, share: float, said: str
) -> None:
    built = machine("fig4a")
    with pytest.raises(JogError) as caught:
        at(built, homed=homed).continuous(frame, axis, share)
    assert said in str(caught.value) and str(caught.value).endswith(".")
    german = text(caught.value.said, "de")
    assert german.endswith(".") and german != str(caught.value)


@pytest.mark.parametrize("distance", [0.0, math.nan, math.inf])
def test_a_step_of_no_length_is_refused(distance: float) -> None:
    built = machine("fig4a")
    with pytest.raises(JogError):
        at(built).step("joint", "X", distance)
