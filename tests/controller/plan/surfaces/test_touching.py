"""Touches of the pole found in a cut, and what the rotaries do there: smooth, the same in tick and plan."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
from support.machines.shipped_kinds import machine
from support.parts.paper_surfaces import example_1, example_2
from support.parts.vertical_rulings import leaning, powers, straight

from controller.geometry import arc_length
from controller.geometry.curves import Bezier
from controller.geometry.placement import Placed
from controller.geometry.splines import BSpline
from controller.geometry.surfaces import RuledSurface, Surface
from controller.geometry.vectors import Frame
from controller.machine.kinematics import Kinematics, kinematics_of
from controller.motion.motions import SurfaceCut
from controller.plan.rotaries.branch import joints_along
from controller.plan.segment import Segment, rotaries_of
from controller.plan.surfaces.rates import derivatives
from controller.plan.surfaces.touching import touched
from controller.program.program import Place

PART = Frame((8.0, 96.0, 120.0))
C, S = math.cos(math.radians(37.0)), math.sin(math.radians(37.0))
TURNED = Frame(PART.origin, (C, S, 0.0), (-S, C, 0.0))


def wall(
    place: float, orders: tuple[int, int], degree: int = 3, turned_deg: float = 0.0, off_mm: float = 0.0
) -> RuledSurface:
    x, y = powers(place, orders[0], 3.0), powers(place, orders[1], -5.0) + off_mm
    lower = straight(degree=degree)
    upper = lower + leaning(x, y, 10.0, degree, turned_deg)
    return RuledSurface(*(Bezier(tuple(map(tuple, points.tolist()))) for points in (upper, lower)))


def cut(surface: Surface, kind: str = "fig4a", part: Frame = PART) -> SurfaceCut:
    motion = SurfaceCut(surface, arc_length.of(surface.lower), 3.0, 0.0, part)
    return touched(motion, kinematics_of(machine(kind)))


def segment(motion: SurfaceCut, kinematics: Kinematics) -> Segment:
    joints = motion.joints(0.0, (0.2, 0.3), kinematics)
    assert joints is not None
    return Segment(motion, Place(1, 1), 1.0, True, joints, joints, True, "cut")


@pytest.mark.parametrize("turned_deg", [0.0, 12.3456])
@pytest.mark.parametrize("place", [0.0, 1.0 / 3.0, 0.57, 1.0])
@pytest.mark.parametrize(
    ("orders", "degree"), [((2, 2), 3), ((3, 3), 3), ((2, 3), 3), ((5, 4), 5), ((7, 2), 7)]
)
def test_a_contact_is_found_with_its_place_and_its_order(
    orders: tuple[int, int], degree: int, place: float, turned_deg: float
) -> None:
    (touch,) = cut(wall(place, orders, degree, turned_deg)).touches
    assert len(touch.roots) == min(orders)
    assert touch.roots == pytest.approx([place] * min(orders), abs=1e-12)


def test_a_zero_of_the_first_order_beside_a_touch_is_taken_out_too() -> None:
    """(u - 0.25)^2 (u - 0.75): both zeros are of both parts."""
    x = powers(0.25, 2, -0.75 * 4.0, 4.0)
    upper = straight() + leaning(x, 2.0 * x, 10.0, 3, 0.0)
    points = (tuple(map(tuple, p.tolist())) for p in (upper, straight()))
    (touch,) = cut(RuledSurface(*map(Bezier, points))).touches
    assert sorted(touch.roots) == pytest.approx([0.25, 0.25, 0.75])
    assert np.allclose(touch.across, [(4.0, 8.0)])


@pytest.mark.parametrize(
    "surface", [example_1(), *example_2(), *example_2(37.0), wall(0.5, (1, 1)), wall(0.5, (2, 1))]
)
def test_what_only_passes_through_the_pole_or_stays_off_is_left_as_it_is(surface: Surface) -> None:
    motion = SurfaceCut(surface, arc_length.of(surface.lower), 3.0, 0.0, PART)
    assert touched(motion, kinematics_of(machine())) is motion


def test_where_the_direction_beside_a_touch_turns_is_told_to_the_last_digit() -> None:
    """Two passages by the pole, at 0.25 +- 4.5e-4: one is taken out, at the other C turns within 1e-7."""
    found = cut(wall(0.25, (3, 2), off_mm=1e-6))
    ((root,), away) = found.touches[0].roots, math.sqrt(1e-6 / 5.0)
    assert abs(root - 0.25) == pytest.approx(away, rel=1e-4)
    assert found.beside_pole == (pytest.approx(0.5 - root, abs=1e-9),)


def test_a_contact_missed_by_more_than_rounding_is_a_wall_that_passes_by() -> None:
    motion = cut(wall(0.3, (2, 2), off_mm=1e-6))
    assert motion.touches == () and motion.beside_pole == pytest.approx([0.3], abs=1e-3)
    assert len(cut(wall(0.3, (2, 2), off_mm=1e-9)).touches) == 1


@pytest.mark.parametrize("off_mm", [1e-11, 5e-9, 2e-8])
@pytest.mark.parametrize("orders", [(1, 3), (1, 2)])
def test_what_passes_by_the_pole_within_a_hair_turns_no_quicker_than_what_passes_through(
    orders: tuple[int, int], off_mm: float
) -> None:
    kinematics = kinematics_of(machine())
    through, by = (segment(cut(wall(0.5, orders, off_mm=off)), kinematics) for off in (0.0, off_mm))
    assert len(by.motion.touches) == 1 and by.motion.touches[0].roots == pytest.approx([0.5], abs=1e-6)
    middle = arc_length.s_at(by.motion.arc, 0.5)
    s = middle + np.concatenate([sign * np.logspace(-8, 0.5, 60) for sign in (-1.0, 1.0)])
    rows, wanted = (joints_along(along, np.sort(s), kinematics) for along in (by, through))
    apart = np.remainder(rows - wanted + math.pi, 2.0 * math.pi)[:, 3:] - math.pi
    assert np.abs(apart - np.round(apart / math.pi) * math.pi).max() < 1e-7
    _, axes = kinematics.forward(rows.T, 0.0, np)
    ruling = np.array(PART.turn(by.motion.surface.axis(by.motion.arc.u_along(np.sort(s)), np)))
    assert np.abs(np.array(axes) - ruling).max() < 4e-9  # nothing that a machine could show


@pytest.mark.parametrize(
    ("kind", "orders", "place", "part"),
    [
        ("fig4a", (2, 2), 1.0 / 3.0, PART),
        ("fig4a", (3, 3), 0.0, TURNED),
        ("fig4b", (3, 2), 1.0, PART),
        ("table_head", (3, 3), 1.0 / 3.0, TURNED),
        ("head_head", (2, 2), 0.0, PART),
        ("head_head", (3, 3), 1.0 / 3.0, PART),
        ("oblique", (2, 2), 1.0, TURNED),
        ("oblique", (3, 3), 1.0 / 3.0, PART),
    ],
)
def test_tick_and_plan_go_through_a_touch_alike_smoothly_and_along_the_ruling(
    kind: str, orders: tuple[int, int], place: float, part: Frame
) -> None:
    kinematics, surface = kinematics_of(machine(kind)), wall(place, orders, turned_deg=20.0)
    motion = cut(surface, kind, part)
    along = segment(motion, kinematics)
    middle = arc_length.s_at(motion.arc, place)
    near_touch = middle + np.concatenate([sign * np.logspace(-9, 0, 30) for sign in (-1.0, 1.0)])
    s = np.unique(
        np.clip(np.concatenate([np.linspace(0.0, motion.end, 201), near_touch, [middle]]), 0.0, motion.end)
    )
    rows = joints_along(along, s, kinematics)
    _, axes = kinematics.forward(rows.T, 0.0, np)
    wanted = np.array(part.turn(surface.axis(motion.arc.u_along(s), np)))
    assert np.abs(np.array(axes) - wanted).max() < 1e-12
    near = rotaries_of(along.start, kinematics)
    for at, row in zip(s, rows, strict=True):
        found = motion.joints(float(at), near, kinematics)
        assert found is not None and np.allclose(found, row, rtol=0.0, atol=1e-9), (at, found, row)
        near = rotaries_of(found, kinematics)
    rate = np.abs(np.diff(rows, axis=0)) / np.diff(s)[:, None]
    steep = np.abs(derivatives(along, s, kinematics).first).max(axis=0)
    assert (rate[np.diff(s) > 1e-6] < 1.02 * steep + 1e-3).all()


@pytest.mark.parametrize("place", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("orders", [(2, 2), (3, 3), (3, 2), (2, 3)])
def test_the_derivatives_at_a_touch_are_those_of_the_joints(orders: tuple[int, int], place: float) -> None:
    """Against a polynomial through the joints: fitted over half a millimetre it knows nothing of poles."""
    kinematics = kinematics_of(machine())
    along = segment(cut(wall(place, orders, turned_deg=20.0)), kinematics)
    middle = arc_length.s_at(along.motion.arc, place)
    s = np.linspace(max(0.0, middle - 0.25), min(along.motion.end, middle + 0.25), 81)
    fit = [np.polynomial.Chebyshev.fit(s, column, 8) for column in joints_along(along, s, kinematics).T]
    at = np.array([*s[10:70:10], middle, middle + 1e-7, middle - 1e-5])
    at = at[(at >= s[0]) & (at <= s[-1])]
    found = derivatives(along, at, kinematics)
    for order, values in enumerate((found.first, found.second, found.third), start=1):
        wanted = np.stack([one.deriv(order)(at) for one in fit], axis=1)
        assert np.allclose(values, wanted, rtol=1e-4, atol=(1e-8, 1e-6, 1e-3)[order - 1]), order


def test_a_cut_that_touches_the_pole_travels_whole_to_the_tick() -> None:
    motion, kinematics = cut(wall(0.4, (3, 2))), kinematics_of(machine())
    there = pickle.loads(pickle.dumps(motion))
    assert there == motion and all(type(x) is float for touch in there.touches for x in touch.roots)
    for s in np.linspace(0.0, motion.end, 50):
        assert there.joints(float(s), (0.0, 0.0), kinematics) == motion.joints(
            float(s), (0.0, 0.0), kinematics
        )


@pytest.mark.parametrize("knot", [0.3, 0.5])
def test_a_touch_in_a_span_and_at_a_knot_of_a_b_spline_is_found(knot: float) -> None:
    whole = wall(0.5, (2, 3), turned_deg=20.0)
    upper = BSpline((0.0, 1.0), (whole.upper.points,)).refined((knot,))
    motion = cut(RuledSurface(upper, whole.lower))
    assert all(touch.roots == pytest.approx([0.5, 0.5]) for touch in motion.touches)
    assert len(motion.touches) == (2 if knot == 0.5 else 1)
    kinematics = kinematics_of(machine())
    s = np.linspace(0.0, motion.end, 1001)
    rows = joints_along(segment(motion, kinematics), s, kinematics)
    wanted = joints_along(segment(cut(whole), kinematics), s, kinematics)
    assert np.abs(np.remainder(rows[:, 4] - wanted[:, 4] + 0.5, math.pi) - 0.5).max() < 1e-9


def test_the_touch_of_a_placed_axis_is_followed_by_a_polynomial_of_its_own() -> None:
    """A tapered cutter whose axis leans by the taper: it is vertical where the wall leans as much."""
    taper = math.radians(5.0)
    lean = 10.0 * math.tan(taper)
    x, y = powers(0.4, 3, 0.0), powers(0.4, 2, 6.0)
    best = None
    for side in (1.0, -1.0):  # which side is found by trying: the axis must come to the vertical
        upper = straight() + leaning(x, y + side * lean, 10.0, 3, 0.0)
        points = (tuple(map(tuple, p.tolist())) for p in (upper, straight()))
        placed = Placed(RuledSurface(*map(Bezier, points)), 3.0, taper_rad=taper)
        tilt = math.hypot(*placed.axis(0.4)[:2])
        best = min(best or (tilt, placed), (tilt, placed), key=lambda pair: pair[0])
    assert best[0] < 1e-9
    motion, kinematics = cut(best[1]), kinematics_of(machine())
    s = np.linspace(0.0, motion.end, 2001)
    rows = joints_along(segment(motion, kinematics), s, kinematics)
    _, axes = kinematics.forward(rows.T, 0.0, np)
    wanted = np.array(PART.turn(best[1].axis(motion.arc.u_along(s), np)))
    assert np.abs(np.array(axes) - wanted).max() < 1e-9
    assert np.abs(np.diff(rows[:, 3:], axis=0)).max() < 0.05
