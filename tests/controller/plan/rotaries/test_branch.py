"""Rotaries followed along a cut, and ``joints_along`` for any places on it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from support.machines.shipped_kinds import machine
from support.machines.traced_programs import assert_whole, mill, trace
from support.parts.paper_surfaces import example_1, example_2

from controller.geometry import arc_length
from controller.geometry.curves import Bezier
from controller.geometry.surfaces import Cone, RuledSurface, Surface
from controller.geometry.vectors import Frame
from controller.machine.kinematics import kinematics_of
from controller.motion.motions import SurfaceCut
from controller.plan.rotaries.branch import BranchLost, field, joints_along
from controller.plan.segment import Segment, rotaries_of
from controller.program.program import Place, ProgramError

KINEMATICS = kinematics_of(machine())


def cut(surface: Surface, offset_mm: float = 3.0) -> SurfaceCut:
    return SurfaceCut(surface, arc_length.of(surface.lower), offset_mm, 0.0, Frame((8.0, 96.0, 120.0)))


def segment(motion: SurfaceCut, near: tuple[float, float]) -> Segment:
    joints = motion.joints(0.0, near, KINEMATICS)
    assert joints is not None
    return Segment(motion, Place(1, 1), 1.0, True, joints, joints, True, "cut")


def wall(upper_y: float, upper: tuple[float, float] = (-4.0, 34.0)) -> RuledSurface:
    """A wall along X whose ruling tips over from -X to +X, ``upper_y`` beside the pole."""
    top = tuple((upper[0] + (upper[1] - upper[0]) * k / 3.0, upper_y, 10.0) for k in range(4))
    return RuledSurface(Bezier(top), Bezier(tuple((10.0 * k, 0.0, 0.0) for k in range(4))))


def upright() -> RuledSurface:
    low = ((0.0, 0.0, 0.0), (10.0, 4.0, 0.0), (20.0, -3.0, 0.5), (30.0, 1.0, 0.0))
    return RuledSurface(Bezier(tuple((x, y, z + 10.0) for x, y, z in low)), Bezier(low))


SURFACES = [example_1(), example_2()[0], example_2(37.0)[1], wall(0.01), wall(0.0), upright()]


@pytest.mark.parametrize("surface", SURFACES)
def test_the_tick_going_in_small_steps_finds_the_same_joints(surface: Surface) -> None:
    motion = cut(surface)
    along = segment(motion, (0.3, 0.4))
    s = np.linspace(0.0, motion.end, 4001)
    joints = joints_along(along, s, KINEMATICS)
    near = rotaries_of(along.start, KINEMATICS)
    for at, row in zip(s, joints, strict=True):
        found = motion.joints(float(at), near, KINEMATICS)
        assert found is not None
        assert np.allclose(found, row, rtol=0.0, atol=1e-8), float(at)
        near = rotaries_of(found, KINEMATICS)


def test_places_in_any_order_and_number_give_what_all_of_them_give() -> None:
    motion = cut(Cone((0.0, 15.0, 0.0), (0.0, 0.0, 0.0), 10.0, 10.0, 9.0 * math.pi))
    along = segment(motion, (0.0, 0.0))
    s = np.linspace(0.0, motion.end, 50)
    whole = joints_along(along, s, KINEMATICS)
    assert np.ptp(whole[:, 4]) == pytest.approx(9.0 * math.pi)
    order = np.random.default_rng(5).permutation(50)
    assert np.array_equal(joints_along(along, s[order], KINEMATICS), whole[order])
    for k in (0, 7, 49):
        assert np.array_equal(joints_along(along, s[k : k + 1], KINEMATICS)[0], whole[k])


@pytest.mark.parametrize("beside_mm", [1.0, 1e-2, 1e-4, 1e-6])
def test_a_pole_passed_at_any_distance_swings_the_rotary_by_half_a_turn(beside_mm: float) -> None:
    found = field(cut(wall(beside_mm)), KINEMATICS)
    rotaries = found.follow((0.3, math.pi / 2.0))
    assert np.abs(np.diff(rotaries[:, 1])).max() < 0.51
    swing = math.pi - 2.0 * math.atan2(beside_mm, 4.0)
    assert abs(rotaries[-1, 1] - rotaries[0, 1]) == pytest.approx(swing, abs=1e-9)


def test_through_the_pole_itself_the_tilt_changes_its_sign() -> None:
    found = field(cut(wall(0.0)), KINEMATICS)
    rotaries = found.follow((0.3, math.pi / 2.0))
    assert rotaries[0, 0] == pytest.approx(-rotaries[-1, 0])
    assert np.ptp(rotaries[:, 1]) < 1e-9


def test_an_axis_out_of_reach_is_lost_at_its_place() -> None:
    oblique = kinematics_of(machine("oblique"))
    surface = wall(0.0, (0.0, 600.0))  # from upright to far beyond what a 45 degree head reaches
    with pytest.raises(BranchLost) as lost:
        field(cut(RuledSurface(_lowered(surface.upper), surface.lower)), oblique)
    assert 0.0 < lost.value.u <= 1.0


def _lowered(upper: Bezier) -> Bezier:
    return Bezier(tuple((x, y, z - 0.3 * x) for x, y, z in upper.points))


def test_a_cutter_straight_down_from_above_is_lost_to_a_head_that_tilts_to_the_level_only():
    hanging = RuledSurface(
        Bezier(tuple((10.0 * k, 0.0, 0.0) for k in range(4))),
        Bezier(tuple((10.0 * k, 0.0, 10.0) for k in range(4))),
    )
    with pytest.raises(BranchLost, match=r"reach\.none"):
        field(cut(hanging), kinematics_of(machine("oblique")))


# The limit of what the rotaries reach: told with its place, and nowhere else.

AT_LIMIT = "comes to the limit of what the rotary axes reach"


def wall_at_the_limit(rise: list[float]) -> str:
    """A wall_at_the_limit whose upper control points stand so much over the lower ones, 10 mm beside them."""
    upper = [f"X{5 * k + k}.0 Y10.0 Z{z:.9f}" for k, z in enumerate(rise)]
    lower = [f"X{5 * k}.0 Y0.0 Z0.0" for k in range(4)]
    return "\n".join(["T1 M6", "G42", f"G52 {upper[0]} F600.", *upper[1:], *lower, "G40", ""])


def touching(at: float, above: float = 0.0) -> list[float]:
    """Control values of 4 (u - at)^2 + above."""
    a, b, c = 4.0 * at * at + above, -8.0 * at, 4.0
    return [a, a + b / 3.0, a + 2.0 * b / 3.0 + c / 3.0, a + b + c]


@pytest.mark.parametrize("at", [0.0, 0.3, 0.5, 0.5017, 0.987, 1.0])
def test_a_ruling_that_lies_down_where_the_head_tilts_no_further_is_refused_there(at: float) -> None:
    with pytest.raises(ProgramError, match=f"{AT_LIMIT}.* at u = {at:.4f}"):
        trace(wall_at_the_limit(touching(at)), mill("oblique"))


def test_a_wall_that_lies_all_along_is_refused() -> None:
    with pytest.raises(ProgramError, match=AT_LIMIT):
        trace(wall_at_the_limit([0.0] * 4), mill("oblique"))


def test_beyond_the_limit_there_is_no_position() -> None:
    with pytest.raises(ProgramError, match="no position of the rotary axes gives this tool axis"):
        trace(wall_at_the_limit([1.0, -0.5, -0.5, 1.0]), mill("oblique"))


def test_a_wall_that_keeps_off_the_limit_is_followed() -> None:
    built = mill("oblique")
    assert_whole(trace(wall_at_the_limit(touching(0.5, 12.0)), built), built)
    with pytest.raises(ProgramError, match="beyond its travel"):  # of this machine
        trace(wall_at_the_limit(touching(0.5, 0.2)), built)


@pytest.mark.parametrize("kind", ["oblique", "fig4a", "table_head", "head_head"])
def test_how_far_the_limit_is_is_how_far_both_branches_are_from_where_they_meet(kind: str) -> None:
    kinematics = kinematics_of(machine(kind))
    axes = np.random.default_rng(5).normal(size=(3, 400))
    axes[2] = np.abs(axes[2])
    x, y, z = axes / np.sqrt((axes * axes).sum(axis=0))
    one, other = kinematics.branches((x, y, z), np)
    half = 0.5 * (one[kinematics.work] - other[kinematics.work])
    known = ~np.isnan(half)
    off = kinematics.off_limit((x, y, z))
    np.testing.assert_allclose(off[known], np.abs(np.sin(half))[known], atol=1e-7)
    assert np.all(off[~known] == 0.0)
    assert kinematics.is_bounded == (kind == "oblique")
    assert kinematics.is_bounded or math.isclose(off.min(), 1.0)
