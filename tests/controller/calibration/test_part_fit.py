"""How a part lies, from touches on its surfaces, planes and bores; and what does not tell it."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest
from support.machines.probed_parts import moved, touched
from support.parts.paper_surfaces import example_1, example_2

from controller.calibration import DOFS, features, part_fit
from controller.calibration.features import Ball, Cylinder, Plane, Ruled
from controller.calibration.refusal import Refusal
from controller.geometry.vectors import Frame, angle_between, norm, subtract
from controller.machine import machine_file

TRUNNION = machine_file.load("trunnion")
START = TRUNNION.offset(0).frame
SURFACES = {8: example_1(), 10: example_2()[0], 19: example_2()[1]}
TILTS = ((0.0, 0.0), (-0.3, 0.7), (0.4, -2.0))


def on(line, along=6, across=3, side=1.0):
    for _, _, point, normal in features.places(SURFACES[line], along, across):
        yield f"line {line}", point, side * normal


def named(touches):
    return {name: features.named(name, SURFACES, "own.csv") for name in dict.fromkeys(touches.features)}


def fitted(touches, free=DOFS, start=START):
    return part_fit.fit(touches, named(touches), TRUNNION, start, free)


def off(found: Frame, real: Frame) -> tuple[float, float]:
    """(mm, deg)."""
    turns = (angle_between(getattr(found, n), getattr(real, n)) for n in "xyz")
    return norm(subtract(found.origin, real.origin)), math.degrees(max(turns))


@pytest.mark.parametrize("seed", range(3))
def test_a_part_on_two_twisted_surfaces_is_found_as_it_lies(seed):
    rng = random.Random(seed)
    shift, turn = ([rng.uniform(-most, most) for _ in range(3)] for most in (0.8, 0.5))
    real = moved(START, shift, turn)
    touches = touched(TRUNNION, real, [*on(10), *on(19)], rng, tilts=TILTS)
    found = fitted(touches)
    mm, deg = off(found.frame, real)
    assert mm < 1e-4 and deg < 1e-4
    assert np.abs(found.deviations[~found.beside]).max() < 1e-5


@pytest.mark.parametrize("seed", range(3))
def test_with_scatter_it_is_found_within_the_bounds_that_are_told(seed):
    rng = random.Random(100 + seed)
    real = moved(
        START, [rng.uniform(-0.5, 0.5) for _ in range(3)], [rng.uniform(-0.2, 0.2) for _ in range(3)]
    )
    touches = touched(TRUNNION, real, [*on(10, 8), *on(19, 8)], rng, scatter_mm=2e-3, tilts=TILTS)
    found = fitted(touches)
    apart = np.array(subtract(found.frame.origin, real.origin)) @ np.array([real.x, real.y, real.z]).T
    for k, name in enumerate("XYZ"):
        assert abs(apart[k]) < found.bounds[name]
    assert off(found.frame, real)[1] < math.degrees(math.hypot(*(found.bounds[name] for name in "ABC")))
    assert 1e-3 < found.scatter_mm < 3e-3


def test_planes_and_a_bore_tell_a_part_too():
    rng, real = random.Random(3), moved(START, (0.4, -0.3, 0.2), (0.2, -0.1, 0.4))
    top = [("plane 0 0 1 5", (x, y, 5.0), (0, 0, 1)) for x, y in ((0, 0), (30, 0), (0, 30))]
    side = [("plane 1 0 0 -2", (-2.0, y, 1.0), (-1, 0, 0)) for y in (0, 30)]
    turn = np.arange(4) * math.pi / 2 + 0.2
    bore = [
        ("bore 15 15 8", (15 + 8 * math.cos(t), 15 + 8 * math.sin(t), 2.0), (-math.cos(t), -math.sin(t), 0))
        for t in turn
    ]
    touches = touched(TRUNNION, real, [*top, *side, *bore], rng)
    mm, deg = off(fitted(touches).frame, real)
    assert mm < 1e-4 and deg < 1e-4


def test_what_is_not_free_stays_and_what_is_not_told_is_refused_by_name():
    rng = random.Random(4)
    real = moved(START, (0.0, 0.0, 0.3), (0.0, 0.0, 0.0))
    top = [("plane 0 0 1 5", (x, y, 5.0), (0, 0, 1)) for x, y in ((0, 0), (30, 0), (0, 30), (30, 30))]
    touches = touched(TRUNNION, real, top, rng)
    found = fitted(touches, "Z")
    assert found.frame.origin == pytest.approx(real.origin, abs=1e-6) and found.frame.x == START.x
    with pytest.raises(Refusal, match=r"nothing of [XYC]"):
        fitted(touches, "XYZ")
    with pytest.raises(Refusal, match="not enough"):
        fitted(touches.chosen(np.array([0, 1])), "ZAB")


def test_a_cone_does_not_tell_how_it_is_turned_about_itself():
    rng = random.Random(5)
    places = list(on(8, 8, 3))
    touches = touched(TRUNNION, START, places, rng)
    with pytest.raises(Refusal, match="nothing of"):
        fitted(touches)
    assert off(fitted(touches, "XYZAB").frame, START)[0] < 1e-4


def test_deviations_are_told_above_0_where_there_is_too_much_on_either_side_of_a_surface():
    for side in (1.0, -1.0):
        touches = touched(
            TRUNNION, START, list(on(10, side=side)), random.Random(6), off_mm=0.02, tilts=TILTS
        )
        found = fitted(touches, "")
        told = part_fit.report(found, touches)
        assert found.deviations[~found.beside] == pytest.approx(0.02, abs=1e-4)
        assert told["after_um"]["most"] == pytest.approx(20.0, abs=0.1)
        assert {row["feature"] for row in told["touches"]} == {"line 10"}


def test_feet_are_the_nearest_points_of_a_surface():
    surface, rng = SURFACES[10], np.random.default_rng(7)
    u, v = rng.uniform(0.05, 0.95, 40), rng.uniform(0.05, 0.95, 40)
    place, along, across = Ruled(surface).at(u, v)
    normal = np.cross(along, across)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    feet = Ruled(surface).feet(place + 0.05 * rng.uniform(-1, 1, (40, 1)) * normal)
    assert np.abs(feet.u - u).max() < 1e-6 and np.abs(feet.v - v).max() < 1e-6
    assert np.abs(np.abs((feet.normals * normal).sum(axis=1)) - 1.0).max() < 1e-9


def test_a_touch_beside_a_surface_is_left_out_and_told():
    rng = random.Random(8)
    real = moved(START, (0.1, 0.0, 0.0), (0.0, 0.0, 0.0))
    _, _, point, normal = next(iter(features.places(SURFACES[10], 1, 1)))
    beside = ("line 10", point + np.array([200.0, 0.0, 0.0]), normal)
    touches = touched(TRUNNION, real, [*on(10), *on(19), beside], rng)
    found = fitted(touches)
    assert found.beside[-1] and off(found.frame, real)[0] < 1e-3


WRONG = ["line 11", "line", "plane 0 0 1", "plane 0 0 0 1", "bore 1 2 -3", "hole 1 2 3", "", "line x"]


@pytest.mark.parametrize("name", WRONG)
def test_a_feature_that_is_none_is_refused_with_what_there_is(name):
    with pytest.raises(Refusal, match="8, 10, 19"):
        features.named(name, SURFACES, "own.csv")


def test_features_by_name():
    assert isinstance(features.named("plane 0 0 2 4", {}, ""), Plane)
    assert features.named("plane 0 0 2 4", {}, "").height_mm == 2.0
    assert isinstance(features.named("boss 1 2 3", {}, ""), Cylinder)
    assert isinstance(features.named("sphere 1 2 3 4", {}, ""), Ball)
