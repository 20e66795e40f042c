"""Derivatives of the joints against differences of the joints, and what the limits allow."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Sequence

import numpy as np
import pytest
from support.machines.planned_laws import chains
from support.machines.shipped_kinds import machine, random_machine
from support.machines.slow_machines import published, two_rails
from support.machines.stepped_runs import shipped
from support.machines.traced_programs import mill, named, trace
from support.parts import blu_compounds
from support.parts.random_surfaces import compound

from controller.geometry import arc_length
from controller.geometry.curves import Arc, Bezier, Line
from controller.geometry.surfaces import RuledSurface, Surface
from controller.geometry.vectors import Frame
from controller.machine.kinematics import Kinematics, kinematics_of
from controller.machine.model import Machine
from controller.motion.motions import JointMove, SurfaceCut, ToolLine
from controller.plan.feed.course import FeedCourse
from controller.plan.feed.limits import JointLimits, ramp_length
from controller.plan.segment import Segment
from controller.plan.surfaces import rates
from controller.plan.surfaces.rates import Derivatives
from controller.program.program import Place

KINDS = ("fig4a", "fig4b", "fig4c", "fig4d", "table_head", "head_head", "oblique")


def cut_of(
    surface: Surface, built: Machine, kinematics: Kinematics, offset: float, length: float
) -> Segment | None:
    """The surface as a segment on the first branch that reaches both of its ends."""
    arc = arc_length.of(surface.lower)
    motion = SurfaceCut(surface, arc, offset, length, Frame((30.0, -20.0, 60.0)))
    axis = surface.axis(0.0)
    pair = kinematics.branches(axis)[0]
    if any(math.isnan(q) for q in pair):
        return None
    start = motion.joints(0.0, pair, kinematics)
    end = motion.joints(motion.end, pair, kinematics)
    if start is None or end is None:
        return None
    return Segment(motion, Place(1, 1), 20.0, True, start, end, True, "cut")


def surface_of(seed: int) -> RuledSurface:
    upper, lower = compound(seed, 1)[0]
    return RuledSurface(Bezier(tuple(map(tuple, upper))), Bezier(tuple(map(tuple, lower))))


def differences(segment: Segment, s: np.ndarray, kinematics: Kinematics, h: float) -> list[np.ndarray]:
    """First to third derivative by central differences of what the tick would send."""
    near = kinematics.rotaries(segment.start)
    rows = []
    for at in s:
        samples = []
        for k in range(-4, 5):
            q = segment.motion.joints(float(at + k * h), near, kinematics)
            assert q is not None
            near = kinematics.rotaries(q)
            samples.append(q)
        rows.append(samples)
    q = np.asarray(rows).transpose(1, 0, 2)
    first = (q[2] - 8.0 * q[3] + 8.0 * q[5] - q[6]) / (12.0 * h)
    second = (-q[2] + 16.0 * q[3] - 30.0 * q[4] + 16.0 * q[5] - q[6]) / (12.0 * h * h)
    third = (q[1] - 8.0 * q[2] + 13.0 * q[3] - 13.0 * q[5] + 8.0 * q[6] - q[7]) / (8.0 * h**3)
    return [first, second, third]


def assert_agree(segment: Segment, kinematics: Kinematics, label: object) -> None:
    s = np.linspace(0.2, 0.8, 13) * segment.motion.end
    exact = rates.derivatives(segment, s, kinematics)
    found = differences(segment, s, kinematics, 0.001 * segment.motion.end)
    for mine, theirs, share in zip(
        (exact.first, exact.second, exact.third), found, (1e-6, 1e-5, 1e-3), strict=True
    ):
        scale = np.abs(theirs).max(axis=0) + 1e-5 * np.abs(theirs).max() + 1e-9
        assert (np.abs(mine - theirs) <= share * scale + 1e-6).all(), label


@pytest.mark.parametrize("kind", KINDS)
def test_derivatives_of_a_cut_are_those_of_the_joints(kind: str) -> None:
    built = machine(kind)
    kinematics = kinematics_of(built)
    for seed in range(3):
        segment = cut_of(surface_of(seed), built, kinematics, (-1) ** seed * 2.0, 40.0)
        assert segment is not None
        assert_agree(segment, kinematics, (kind, seed))


def test_derivatives_of_a_cut_are_those_of_the_joints_on_random_oblique_machines() -> None:
    tried = 0
    for seed in range(40):
        built = random_machine(random.Random(seed))
        kinematics = kinematics_of(built)
        surface = surface_of(seed)
        reach = [kinematics.branches(surface.axis(u)) for u in np.linspace(0.0, 1.0, 41)]
        tilts = np.array([pair for pairs in reach for pair in pairs])
        if np.isnan(tilts).any():
            continue  # out of reach of this machine
        gaps = [
            abs(math.remainder(p[0][0] - p[1][0], math.tau))
            + abs(math.remainder(p[0][1] - p[1][1], math.tau))
            for p in reach
        ]
        segment = cut_of(surface, built, kinematics, 1.5, 30.0)
        if segment is None or min(gaps) < 0.3:
            continue  # beside a place where both branches meet differences are rough
        tried += 1
        assert_agree(segment, kinematics, seed)
    assert tried >= 5


def test_on_an_upright_wall_a_free_rotary_turns_the_derivatives_to_where_it_stands() -> None:
    """C stands at 50 degrees all along, so X and Y of the machine are not those of the part."""
    program = b"T2 M6\nS12000 M3\nG0 C50\nG51 X10. Y0. Z0. I0. J0. K0. H10. R10. D90. F300.\n"
    (segment,) = named(trace(program.decode(), shipped()), "cut")
    assert math.degrees(segment.start[4]) == pytest.approx(50.0)
    assert_agree(segment, kinematics_of(shipped()), "upright")


def test_at_a_pole_the_derivatives_are_those_of_the_limit_from_inside() -> None:
    from support.parts.paper_surfaces import example_2

    built = machine("fig4a")
    kinematics = kinematics_of(built)
    segment = cut_of(example_2()[0], built, kinematics, 3.0, 0.0)
    assert segment is not None
    at_pole = rates.derivatives(segment, np.array([0.0, 2e-6]), kinematics)
    beside = rates.derivatives(segment, np.array([2e-3, 3e-3]), kinematics)
    for mine, near in zip((at_pole.first, at_pole.second), (beside.first, beside.second), strict=True):
        assert np.isfinite(mine).all()
        np.testing.assert_allclose(mine, near, rtol=0.02, atol=0.02 * np.abs(near).max())


def jumps(segments: Sequence[Segment], built: Machine) -> list[np.ndarray]:
    """Of the joints' rates where one segment goes over into the next, as shares of the larger one."""
    kinematics, found = kinematics_of(built), []
    for before, after in itertools.pairwise(segments):
        left = rates.derivatives(before, np.array([before.motion.end]), kinematics).first[0]
        right = rates.derivatives(after, np.array([0.0]), kinematics).first[0]
        found.append(np.abs(right - left) / np.maximum(np.abs(left), np.abs(right)).max())
    return found


def test_rates_are_the_same_on_both_sides_where_a_surface_is_cut_in_two_at_a_knot() -> None:
    """Taken two microns apart they seemed to jump by 1e-4: a slow machine crept over every such joint."""
    built = published()
    cuts = [s for chain in chains(two_rails(), built) for s in chain.segments if s.cutting]
    assert len(cuts) == 5
    assert max(jump.max() for jump in jumps(cuts, built)) < 1e-9


def test_rates_are_the_same_on_both_sides_where_a_tool_line_is_cut_in_two() -> None:
    """Two lines along which the tool goes on turning about one axis at one rate."""
    built, lean = shipped(), [math.tan(math.radians(turn)) for turn in (20.0, 30.0, 40.0)]
    words = [f"X{10 * k}. Y0. Z0. I{x:.12f} J0. K1." for k, x in enumerate(lean)]
    source = "\n".join(["G21 G90 G54 G61", "G43.5 H2", f"G1 {words[0]} F500.", *words[1:], "M30", ""])
    lines = [s for chain in chains(source, built) for s in chain.segments if isinstance(s.motion, ToolLine)]
    lines = [line for line in lines if line.motion.angle_rad > 0.01][-2:]
    assert len(lines) == 2
    assert max(jump.max() for jump in jumps(lines, built)) < 1e-9


def test_derivatives_of_a_line_are_constant_and_those_of_an_arc_turn() -> None:
    built = machine("fig4a")
    kinematics = kinematics_of(built)
    s = np.linspace(0.0, 10.0, 5)
    line = JointMove(Line((0, 0, 0), (6.0, 8.0, 0.0)), 10.0, (0.0, 0.0), (1.0, -2.0))
    arc = JointMove(Arc((0, 0, 0), (5.0, 0, 0), (0, 5.0, 0), 2.0, (0, 0, 0)), 10.0, (0, 0), (0, 0))
    rows = [Segment(m, Place(1, 1), 10.0, False, (0,) * 5, (0,) * 5, True, "line") for m in (line, arc)]
    straight, curved = (rates.derivatives(row, s, kinematics) for row in rows)
    values = [(0.6, 0.8, 0.0, 0.1, -0.2)[i] for i in kinematics.order]
    np.testing.assert_allclose(straight.first, [values] * 5, atol=1e-15)
    assert not straight.second.any() and not straight.third.any()
    x, y = kinematics.order.index(0), kinematics.order.index(1)
    np.testing.assert_allclose(np.hypot(curved.first[:, x], curved.first[:, y]), 1.0, atol=1e-14)
    np.testing.assert_allclose(np.hypot(curved.second[:, x], curved.second[:, y]), 1 / 5, atol=1e-14)
    np.testing.assert_allclose(np.hypot(curved.third[:, x], curved.third[:, y]), 1 / 25, atol=1e-14)


def test_joint_motion_is_what_a_law_in_time_makes_of_the_derivatives() -> None:
    """Differences of q(s(t)) in time against the chain rule."""
    rng = np.random.default_rng(4)
    c = rng.normal(size=(4, 5))

    def q(s: float) -> np.ndarray:
        return c[0] + s * (c[1] + s * (c[2] + s * c[3]))

    def s_of(t: float) -> float:
        return 0.3 + 0.7 * t - 0.4 * t * t + 0.2 * t**3

    t, h = 0.5, 1e-3
    s, v, a, j = s_of(t), 0.7 - 0.8 * t + 0.6 * t * t, -0.8 + 1.2 * t, 1.2
    one = [
        np.atleast_2d(x) for x in (c[1] + 2 * s * c[2] + 3 * s * s * c[3], 2 * c[2] + 6 * s * c[3], 6 * c[3])
    ]
    d, at = Derivatives(*one), [np.array([x]) for x in (v, a, j)]
    f = [q(s_of(t + k * h)) for k in (-2, -1, 0, 1, 2)]
    np.testing.assert_allclose(d.velocity(at[0])[0], (f[3] - f[1]) / (2 * h), rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(
        d.acceleration(at[0], at[1])[0], (f[3] - 2 * f[2] + f[1]) / h**2, rtol=1e-4, atol=1e-4
    )
    third = (f[4] - 2 * f[3] + 2 * f[1] - f[0]) / (2 * h**3)
    np.testing.assert_allclose(d.jerk(*at)[0], third, rtol=1e-3, atol=1e-3)


def test_path_speed_is_where_the_first_limit_is_met() -> None:
    rng = np.random.default_rng(2)
    d = Derivatives(*(rng.normal(size=(50, 5)) for _ in range(3)))
    limit = JointLimits.of(machine("fig4a"))
    v = limit.path_speed(d)
    zero = np.zeros_like(v)
    worst = np.maximum(
        (np.abs(d.velocity(v)) / limit.velocity).max(axis=1),
        np.maximum(
            (np.abs(d.acceleration(v, zero)) / limit.acceleration).max(axis=1),
            (np.abs(d.jerk(v, zero, zero)) / limit.jerk).max(axis=1),
        ),
    )
    np.testing.assert_allclose(worst, 1.0, rtol=1e-12)


def test_a_ramp_takes_the_length_that_two_jerks_take() -> None:
    v, j = 12.0, 300.0
    t = math.sqrt(v / j)
    length = j * t**3 / 6 + (j * t * t / 2 * t + j * t**3 / 2 - j * t**3 / 6)
    assert ramp_length(v, j) == pytest.approx(length)


@pytest.mark.parametrize("kind", KINDS)
def test_cuts_of_one_kind_taken_together_are_what_they_are_alone(kind: str) -> None:
    built = machine(kind)
    kinematics = kinematics_of(built)
    found = (cut_of(surface_of(seed), built, kinematics, 1.5, 80.0) for seed in range(8))
    cuts = [cut for cut in found if cut is not None]
    course = FeedCourse(cuts, built, kinematics)
    s = np.sort(np.append(np.random.default_rng(1).uniform(0.0, course.length, 300), course.starts))
    index = course.index(s)
    assert len(course._alike(index)) < len(cuts)
    row = course.derivatives(s)
    for k, cut in enumerate(cuts):
        here = index == k
        alone = rates.derivatives(cut, s[here] - course.starts[k], kinematics)
        for name in ("first", "second", "third"):
            one, other = getattr(alone, name), getattr(row, name)[here]
            np.testing.assert_allclose(other, one, rtol=1e-9, atol=1e-10 * np.abs(one).max())


@pytest.mark.parametrize("seed", [3, 8])
def test_blended_cuts_taken_together_are_what_they_are_alone(seed: int) -> None:
    """Joints of rounding: all cuts but the first and the last are blended at both ends."""
    surfaces = blu_compounds.parts(compound(seed, 1)[0], 6, 4)
    built = mill(gouge="warn")
    cuts = named(trace(blu_compounds.text(surfaces, 1000.0, "G41", "T1 M6"), built), "cut")
    kinematics = kinematics_of(built)
    inner = [cut for cut in cuts if len(getattr(cut.motion.surface, "blends", ())) == 2]
    course = FeedCourse(inner, built, kinematics)
    s = np.linspace(0.0, course.length, 400)
    index = course.index(s)
    assert len(inner) >= 3 and len(course._alike(index)) == 1
    row = course.derivatives(s)
    for k, cut in enumerate(inner):
        here = index == k
        alone = rates.derivatives(cut, s[here] - course.starts[k], kinematics)
        for name in ("first", "second", "third"):
            one, other = getattr(alone, name), getattr(row, name)[here]
            np.testing.assert_allclose(other, one, rtol=1e-9, atol=1e-10 * np.abs(one).max())


def test_a_joint_alone_comes_to_rest_in_the_time_of_its_jerk_and_deceleration() -> None:
    """Told back: what a deceleration that rises, maybe lasts, and falls takes off in that time."""
    rng = np.random.default_rng(3)
    limits = JointLimits(np.full(5, 1e3), rng.uniform(100.0, 5e3, 5), rng.uniform(1e3, 1e5, 5))
    speeds = rng.uniform(0.0, 4.0, (200, 5)) * limits.acceleration**2 / limits.jerk
    seconds = limits.braking_s(np.where(rng.random((200, 5)) < 0.5, -speeds, speeds))
    t = np.linspace(0.0, 1.0, 4001)[:, None, None] * seconds
    deceleration = np.minimum(np.minimum(t, seconds - t) * limits.jerk, limits.acceleration)
    taken_off = np.trapezoid(deceleration, t, axis=0)
    assert taken_off == pytest.approx(speeds, rel=1e-5)
    assert (deceleration.max(axis=0) < limits.acceleration).any() and (seconds > 0.0).all()
