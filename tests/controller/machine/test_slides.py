"""Slides that are not square: the tool is where X, Y and Z say, and no slide leaves its limits for it."""

from __future__ import annotations

import math
import random
from dataclasses import replace

import pytest
from support.machines.shipped_kinds import machine, random_machine

from controller.geometry.vectors import Pose, X, Y, Z, add, cross, norm, rotate, scale, subtract, unit
from controller.machine import machine_file, nodes, plausible
from controller.machine.kinematics import kinematics_of
from controller.machine.kinematics.slides import Slides
from controller.machine.model import Kind
from controller.machine.toml_table import ConfigError
from controller.tick.joints import Encoder

TEXT = (machine_file.SHIPPED / "trunnion.toml").read_text()


def leaning(rng, made, most_deg=20.0):
    """The same machine with slides that lean, homed anywhere; limits as read from a file with them."""
    axes = list(made.axes)
    for i, frame in zip(made.linear(), (X, Y, Z), strict=True):
        about = unit(cross(frame, [rng.gauss(0, 1) for _ in range(3)]))
        direction = rotate(about, math.radians(rng.uniform(0, most_deg)), frame)
        home = replace(axes[i].homing, position=rng.uniform(-50, 50))
        axes[i] = replace(axes[i], direction=direction, homing=home)
    return replace(made, axes=Slides(axes).limited(axes)), made.axes


def built(made, places, length_mm):
    """The tool in the part of a machine whose slides are at ``places``: each turned or moved by itself."""
    names = [axis.name for axis in made.axes]
    slides = [made.axes[names.index(one)] for one in "XYZ"]
    at = [axis.homing.position for axis in slides]
    for axis in slides:
        at = add(at, scale(axis.direction, places[names.index(axis.name)] - axis.homing.position))
    tip, axis_ = (0.0, 0.0, -length_mm), Z
    turning = [(a, q) for a, q in zip(made.axes, places, strict=True) if a.is_rotary]
    for axis, q in [row for row in turning if row[0].kind is Kind.HEAD][::-1]:
        tip = add(axis.point_mm, rotate(axis.direction, q, subtract(tip, axis.point_mm)))
        axis_ = rotate(axis.direction, q, axis_)
    tip = add(at, tip)
    for axis, q in [row for row in turning if row[0].kind is Kind.TABLE]:
        tip = add(axis.point_mm, rotate(axis.direction, -q, subtract(tip, axis.point_mm)))
        axis_ = rotate(axis.direction, -q, axis_)
    return Pose(tip, axis_)


def apart(a, b):
    return max(norm(subtract(a.tip, b.tip)), norm(subtract(a.axis, b.axis)))


def test_the_tool_is_where_it_is_told_to_be_and_found_where_it_is():
    seed = random.randrange(10**6)
    rng = random.Random(seed)
    for _ in range(60):
        made, _ = leaning(rng, random_machine(rng))
        kinematics, slides = kinematics_of(made), Slides(made.axes)
        joints = [rng.uniform(-300, 300) if not a.is_rotary else rng.uniform(-1, 1) for a in made.axes]
        pose = kinematics.forward(joints, 70.0)
        again = kinematics.inverse(pose, kinematics.rotaries(tuple(joints)), 70.0)
        sent = slides.sent(again)
        assert apart(built(made, sent, 70.0), pose) < 1e-10, seed
        assert apart(kinematics.forward(slides.real(sent), 70.0), pose) < 1e-10, seed


def test_drives_get_the_counts_of_their_slides_and_report_the_axes():
    rng = random.Random(4)
    made, _ = leaning(rng, machine("fig4a"))
    encoder = Encoder(made)
    for _ in range(50):
        joints = tuple(rng.uniform(-100, 100) if not a.is_rotary else rng.uniform(-1, 1) for a in made.axes)
        encoder.encode(joints)
        places = [c / a.counts_per_unit for c, a in zip(encoder.exact, made.axes, strict=True)]
        assert apart(built(made, places, 0.0), kinematics_of(made).forward(joints, 0.0)) < 1e-10
        assert encoder.real(encoder.exact) == pytest.approx(joints, abs=1e-10)
        for way in ((1.0, 0.0, 0.0), (0.36, 0.48, 0.8)):  # as along a thread
            further = [
                q + dict(zip(made.linear(), way, strict=True)).get(i, 0.0) for i, q in enumerate(joints)
            ]
            step = [b - a for a, b in zip(encoder.counts(joints), encoder.counts(further), strict=True)]
            assert encoder.per_mm(way) == pytest.approx(step, abs=1e-5)


def test_a_homed_machine_says_where_its_axes_are_homed():
    made, _ = leaning(random.Random(5), machine("fig4a"))
    home = [axis.homing.position for axis in made.axes]
    assert Slides(made.axes).real(home) == pytest.approx(home, abs=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_no_slide_leaves_its_limits_or_its_range_whatever_the_axes_do_within_theirs(seed):
    rng = random.Random(seed)
    made, before = leaning(rng, machine("fig4a"))
    slides, used = Slides(made.axes), 0.0
    settings = nodes.node_settings(made)
    for _ in range(300):
        for name in ("velocity", "acceleration", "jerk"):
            rates = [rng.choice((-1, 1)) * getattr(made.axes[i].limits, name) for i in made.linear()]
            for i, rate in zip(made.linear(), slides.shares(rates), strict=True):
                most = getattr(before[i].limits, name)
                assert abs(rate) <= most * (1 + 1e-12)
                used = max(used, abs(rate) / most)
                asked = getattr(slides.limits(made.axes, i), name)
                assert abs(rate) <= asked * (1 + 1e-12) and asked <= most * (1 + 1e-12)
        corner = [rng.choice((axis.travel_min, axis.travel_max)) for axis in made.axes]
        for node, axis, place in zip(settings, made.axes, slides.sent(corner), strict=True):
            assert node.counts_min - 1 <= place * axis.counts_per_unit <= node.counts_max + 1
    assert used > 0.999  # and no more is taken off than that


def test_a_square_machine_is_as_it_was():
    made = machine("fig4a")
    assert Slides(made.axes).limited(made.axes) == made.axes
    assert Encoder(made)._deviations is None


def with_x(direction):
    text = TEXT.replace("direction = [1, 0, 0]", f"direction = {direction}", 1)
    assert text != TEXT
    return text


def test_a_slide_may_lean_up_to_thirty_degrees():
    for by, doubts in ((0.01, 0), (1.5, 1), (30.0, 1)):
        lean = math.radians(by)
        text = with_x([math.cos(lean), 0.0, math.sin(lean)])
        made = machine_file.read(
            text.replace('file = "tools.toml"\n', "") + TOOL, "own.toml", machine_file.SHIPPED
        )
        found = [one for one in plausible.doubts(made) if "direction" in str(one)]
        assert len(found) == doubts, by
    for wrong in ("[1, 1, 0]", "[-1, 0, 0]", "[0, 1, 0]"):
        with pytest.raises(ConfigError, match=r"direction.*30 degrees.*\[1, 0, 0\]"):
            machine_file.read(with_x(wrong) + TOOL, "own.toml", machine_file.SHIPPED)


TOOL = '\n[[tool]]\nnumber = 1\nname = "one"\nradius_mm = 3.0\nlength_mm = 0.0\nflute_mm = 15.0\n'
