"""Joints from poses and back, on the paper's machines and on any others; poles as limits from inside."""

import math
import random
from dataclasses import fields, replace

import numpy as np
import pytest
from support.machines.shipped_kinds import ROTARIES, R, W, machine, random_machine, rotary_travel
from support.parts.paper_surfaces import example_1, example_2, turned
from support.suite.cases import each

from controller.geometry import arc_length
from controller.geometry import series as jets
from controller.geometry.surfaces import Cone
from controller.geometry.vectors import (
    Frame,
    Pose,
    X,
    Y,
    Z,
    add,
    angle_between,
    cross,
    norm,
    rotate,
    subtract,
    unit,
)
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Kind
from controller.motion.motions import SurfaceCut

PART = Frame(add(W, R))
kinds = pytest.mark.parametrize("kind", ROTARIES)


def apart(a: Pose, b: Pose) -> float:
    return max(norm(subtract(a.tip, b.tip)), norm(subtract(a.axis, b.axis)))


def random_joints(rng):
    return (*(rng.uniform(-100, 100) for _ in range(3)), rng.uniform(-3, 3), rng.uniform(-30, 30))


@kinds
def test_forward_of_inverse_is_the_pose_on_every_named_machine(kind):
    check_round_trips(kinematics_of(machine(kind)), 100)


def test_forward_of_inverse_is_the_pose_on_random_oblique_machines():
    seed = random.randrange(10**6)
    rng = random.Random(seed)
    for _ in range(40):
        check_round_trips(kinematics_of(random_machine(rng)), 10, seed)


def check_round_trips(kinematics, count, seed=1):
    rng = random.Random(seed)
    for _ in range(count):
        joints, length = random_joints(rng), rng.uniform(0, 150)
        pose = kinematics.forward(joints, length)
        assert abs(norm(pose.axis) - 1.0) < 1e-14
        near = (rng.uniform(-4, 4), rng.uniform(-40, 40))
        found = kinematics.inverse(pose, near, length)
        assert found is not None, f"seed {seed}"
        most = max(1e-9, 2.0 * kinematics.lean_rad)  # a hair that is missed at a pole of a random machine
        assert apart(kinematics.forward(found, length), pose) < most, f"seed {seed}"
        for pair in kinematics.branches(pose.axis):
            again = kinematics.forward((*kinematics.linear(pose.tip, pair, length), *pair), length)
            assert apart(again, pose) < most, f"seed {seed}"


def measured(kind, rng, most_deg=0.1):
    """A machine whose rotaries are not quite where the drawing has them."""
    made = machine(kind)
    axes = [
        replace(
            axis,
            direction=rotate(
                unit((rng.gauss(0, 1), rng.gauss(0, 1), rng.gauss(0, 1))),
                math.radians(rng.uniform(-most_deg, most_deg)),
                axis.direction,
            ),
        )
        if axis.is_rotary
        else axis
        for axis in made.axes
    ]
    return replace(made, axes=tuple(axes))


@kinds
def test_a_pole_that_is_missed_by_a_hair_is_a_pole_and_the_tool_leans_by_that_hair_beside_it_only(kind):
    rng = random.Random(3)
    for _ in range(10):
        kinematics = kinematics_of(measured(kind, rng))
        if not kinematics.lean_rad:
            continue  # this kind never had one
        assert kinematics.lean_rad < 2.2 * math.radians(0.2)
        one, other, pole = kinematics.work_frame()
        for off_rad in (0.0, 1e-12, 1e-6, 1e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3):
            turn = rng.uniform(-4, 4)
            across = add(tuple(math.cos(turn) * c for c in one), tuple(math.sin(turn) * c for c in other))
            axis = rotate(unit(cross(pole, across)), off_rad, pole)
            if axis[2] < 0.1:
                continue  # on some kinds the pole points down
            found = kinematics.inverse(Pose((1.0, 2.0, 3.0), axis), (0.1, 0.2), 80.0, across)
            back = kinematics.forward(found, 80.0)
            assert norm(subtract(back.tip, (1.0, 2.0, 3.0))) < 1e-9  # the tip gives way nowhere
            missed = angle_between(back.axis, axis)
            assert missed < 1.01 * kinematics.lean_rad + 1e-12
            assert off_rad < 0.09 or missed < 1e-5 * kinematics.lean_rad * (0.1 / off_rad) ** 8 + 1e-12


@kinds
def test_beside_such_a_pole_floats_arrays_and_series_say_the_same(kind):
    kinematics = kinematics_of(measured(kind, random.Random(5)))
    axes = [unit((0.003 * math.cos(t), 0.004 * math.sin(t), 1.0)) for t in np.linspace(0.1, 6.0, 50)]
    arrays = kinematics.branches(tuple(np.array(axes).T), np)
    for k, axis in enumerate(axes):
        for pair, columns in zip(kinematics.branches(axis), arrays, strict=True):
            assert all(abs(a - b[k]) < 1e-12 for a, b in zip(pair, columns, strict=True))


def test_inverse_stays_on_branch_and_turn_nearest_to_the_last_joints():
    seed = random.randrange(10**6)
    rng = random.Random(seed)
    for _ in range(40):
        kinematics = kinematics_of(random_machine(rng))
        joints = random_joints(rng)
        pose = kinematics.forward(joints, 10.0)
        (a, b), (c, d) = kinematics.branches(pose.axis)
        if math.hypot(math.remainder(a - c, math.tau), math.remainder(b - d, math.tau)) < 0.1:
            continue  # the branches meet: either is right
        found = kinematics.inverse(pose, (joints[3] + 0.01, joints[4] - 0.01), 10.0)
        assert found == pytest.approx(joints, abs=1e-6), f"seed {seed}"


@kinds
def test_floats_arrays_and_series_give_the_same_joints(kind):
    kinematics = kinematics_of(machine(kind))
    u = np.linspace(0.05, 0.95, 7)
    surface = example_2()[0]
    many = surface.pose(u, 3.0, np)
    series = surface.pose(jets.variable(u), 3.0, jets)
    for branch in (0, 1):
        pairs = kinematics.branches(many.axis, np)[branch]
        expanded = kinematics.branches(series.axis, jets)[branch]
        xyz = kinematics.linear(series.tip, expanded, 20.0, jets)
        for i, x in enumerate(u):
            tip, axis = surface.pose(float(x), 3.0)
            pair = kinematics.branches(axis)[branch]
            assert [p[i] for p in pairs] == pytest.approx(pair, abs=1e-13)
            assert [p.c[0][i] for p in expanded] == pytest.approx(pair, abs=1e-13)
            assert [p.c[0][i] for p in xyz] == pytest.approx(kinematics.linear(tip, pair, 20.0), abs=1e-12)


@kinds
def test_forward_serves_arrays(kind):
    kinematics = kinematics_of(machine(kind))
    rng = random.Random(5)
    rows = np.array([random_joints(rng) for _ in range(6)])
    tip, axis = kinematics.forward(tuple(rows.T), 12.0, np)
    for i, row in enumerate(rows):
        one = kinematics.forward(tuple(row), 12.0)
        assert [c[i] for c in tip] == pytest.approx(one.tip, abs=1e-12)
        assert [np.broadcast_to(c, 6)[i] for c in axis] == pytest.approx(one.axis, abs=1e-14)


def test_joints_stand_in_the_order_of_the_machine_file():
    x, y, z, a, c = machine().axes
    mixed = machine(axes=(a, z, x, c, y))
    assert kinematics_of(mixed).order == (3, 2, 0, 4, 1)
    pose = kinematics_of(mixed).forward((0.3, 1.0, 2.0, 0.2, 4.0), 5.0)
    assert kinematics_of(mixed).inverse(pose, (0.3, 0.2), 5.0) == pytest.approx((0.3, 1.0, 2.0, 0.2, 4.0))


# ---- the paper's equations as oracles ------------------------------------------------

AXES = [
    unit((math.cos(f) * math.sin(t), math.sin(f) * math.sin(t), math.cos(t)))
    for f in np.arange(0.1, 6.2, 0.7)
    for t in (0.05, 0.6, 1.2)
]


@pytest.mark.parametrize("axis", AXES)
def test_equation_10_is_the_branch_with_positive_tilt(axis):
    first, second = kinematics_of(machine()).branches(axis)
    a, b = math.atan2(math.hypot(axis[0], axis[1]), axis[2]), math.atan2(axis[0], axis[1])
    assert first == pytest.approx((a, b), abs=1e-14)
    assert second[0] == pytest.approx(-a, abs=1e-14)
    assert math.cos(second[1] - b) == pytest.approx(-1.0, abs=1e-14)  # b + 180 deg


def test_equation_11_gives_the_linear_axes_of_the_trunnion():
    kinematics = kinematics_of(machine())
    p, length = (3.0, -4.0, 5.0), 60.0
    for axis in AXES:
        for a, b in kinematics.branches(axis):
            inner = add(rotate(Z, b, add(p, R)), W)
            # Eq. 11's OT is minus the tool vector: (0, 0, L).
            expected = add(rotate(X, a, inner), (0.0, 0.0, length))
            assert kinematics.linear(PART.to_parent(p), (a, b), length) == pytest.approx(expected, abs=1e-11)


# Table 1: the virtual turns about X, Y, Z and which of them is added to a.
TABLE_1 = {
    "fig4a": (0, 0, 0, 0),
    "fig4b": (0, 0, -90, 0),
    "fig4c": (0, -90, -90, -90),
    "fig4d": (90, 0, 0, 90),
}


@each("kind", TABLE_1)
@each("axis", AXES)
def test_table_1_and_equations_12_13_agree_up_to_branch(kind, axis):
    about_x, about_y, about_z, plus = map(math.radians, TABLE_1[kind])
    e, f, g = rotate(Z, about_z, rotate(Y, about_y, rotate(X, about_x, axis)))
    b = math.atan2(e, f)
    tilts = [
        (root * math.atan2(math.hypot(e, f), g) + plus, b if root > 0 else b + math.pi) for root in (1, -1)
    ]
    pairs = kinematics_of(machine(kind)).branches(axis)
    for tilt, turn in tilts:
        # Slip 3 and 4: the paper's angles hold up to the sign of b and up to branch.
        assert min(abs(math.remainder(tilt - p, math.tau)) for p, _ in pairs) < 1e-12
        assert min(abs(math.remainder(turn - q, math.pi)) for _, q in pairs) < 1e-12 or kind != "fig4a"


def test_slip_4_the_positive_root_of_figure_4d_tips_the_table_over():
    # With O near z, Table 1's positive root gives a near 180 deg; ours offers a near 0 as well.
    pairs = kinematics_of(machine("fig4d")).branches(unit((0.0, 1e-3, 1.0)))
    assert sorted(abs(a) for a, _ in pairs) == pytest.approx([1e-3, math.pi - 1e-3], abs=1e-6)


# ---- poles ---------------------------------------------------------------------------


def test_a_pole_out_of_reach_is_as_lost_as_any_other_axis():
    down = kinematics_of(machine("oblique")).branches((0.0, 0.0, -1.0), keep=(0.3, 0.3))
    assert all(math.isnan(q) for pair in down for q in pair), down
    many = (np.array([0.0, 0.6, 0.0]), np.zeros(3), np.array([-1.0, -0.8, 1.0]))
    for pair in kinematics_of(machine("oblique")).branches(many, np):
        for angles in pair:
            assert np.isnan(angles).tolist() == [True, True, False]


def cut(surface, radius=3.0, part=PART):
    return SurfaceCut(surface, arc_length.of(surface.lower), radius, 0.0, part)


@pytest.mark.parametrize("turn", [0.0, 37.0])
@pytest.mark.parametrize("by", ["points", "frame"])
def test_example_2_runs_from_its_pole_to_its_pole_without_a_jump(turn, by):
    """Slip 7: C starts at 0 deg and ends at 92.0826 deg, less what the part is turned by."""
    part = PART if by == "points" else Frame(PART.origin, turned(X, turn), turned(Y, turn))
    kinematics, near, degrees = kinematics_of(machine()), (0.0, math.radians(-turn)), []
    for surface in example_2(turn if by == "points" else 0.0):
        motion = cut(surface, part=part)
        for s in np.append(np.arange(0.0, motion.end, 0.02), motion.end):
            joints = motion.joints(float(s), near, kinematics)
            assert abs(joints[4] - near[1]) < math.radians(1.0) and joints[3] > -1e-9
            near = (joints[3], joints[4])
            degrees.append(math.degrees(joints[4]))
    assert degrees[0] == pytest.approx(-turn, abs=1e-9)
    assert degrees[-1] == pytest.approx(92.0826 - turn, abs=5e-5)


def test_third_differences_next_to_the_poles_are_free_of_noise():
    """At 2 ms; a thousandth of the axes' jerk limits would already be seen by no one."""
    kinematics, near = kinematics_of(machine()), (0.0, 0.0)
    for surface in example_2():
        motion, rows = cut(surface), []
        for end in (0.0, 1.0):
            rows = []
            for i in range(300):
                s = abs(end * motion.end - i * 1e-4)
                rows.append(motion.joints(s, near, kinematics))
                near = (rows[-1][3], rows[-1][4])
            jerk = np.diff(rows, 3, axis=0) / 0.002**3
            noise = np.abs(np.diff(jerk, axis=0)).max(axis=0)
            assert np.all(noise < (0.05, 0.05, 0.05, 1e-3, 1e-3))
        near = motion.joints(motion.end, near, kinematics)[3:]


def pole_limits(kind, turn=0.0):
    """Branches at the start of Example 2, in the limit, and at a ten-thousandth behind it."""
    kinematics, surface = kinematics_of(machine(kind)), example_2(turn)[0]
    axis = surface.axis(0.0)
    return kinematics.branches(axis, inside=surface.axis_rate(0.0)), kinematics.branches(surface.axis(1e-4))


@pytest.mark.parametrize("kind", ["fig4a", "fig4b", "table_head", "head_head", "oblique"])
@pytest.mark.parametrize("turn", [0.0, 37.0])
def test_the_angles_at_a_pole_are_those_just_inside(kind, turn):
    for limit, inside in zip(*pole_limits(kind, turn), strict=True):
        assert [math.remainder(a - b, math.tau) for a, b in zip(limit, inside, strict=True)] == pytest.approx(
            (0.0, 0.0), abs=2e-3
        )


def test_arrays_take_the_same_limit_as_floats():
    kinematics, surface = kinematics_of(machine()), example_2(37.0)[1]
    u = np.array([0.5, 1.0])
    inside = tuple(np.full(2, -c) for c in surface.axis_rate(1.0))
    for many, one in zip(
        kinematics.branches(surface.axis(u, np), np, inside),
        kinematics.branches(surface.axis(1.0), inside=tuple(c[1] for c in inside)),
        strict=True,
    ):
        assert [q[1] for q in many] == pytest.approx(one, abs=1e-13)


@pytest.mark.parametrize("end", [0, 1])
def test_series_at_a_pole_hold_the_derivatives_of_the_way_in(end):
    kinematics, surface = kinematics_of(machine()), example_2(37.0)[end]
    step = 1e-4
    rate = surface.axis_rate(float(end))
    inside = rate if end == 0 else tuple(-c for c in rate)
    at = np.array([float(end), abs(end - step)])
    series = kinematics.branches(surface.axis(jets.variable(at), jets), jets, inside)
    for tilt, turn in series:
        for q, orders in ((tilt, 3), (turn, 2)):
            for k in range(orders):
                change = (q.derivative(k)[1] - q.derivative(k)[0]) / (step if end == 0 else -step)
                expected = 0.5 * (q.derivative(k + 1)[0] + q.derivative(k + 1)[1])
                assert math.remainder(change, math.tau / step) == pytest.approx(expected, rel=1e-2, abs=1e-3)


@pytest.mark.parametrize("kind", ["fig4a", "oblique"])
def test_on_a_cylinder_the_works_rotary_keeps_its_place(kind):
    cylinder = Cone((5.0, 0.0, 0.0), (0.0, 0.0, 0.0), 10.0, 5.0, 2.0)
    kinematics, motion = kinematics_of(machine(kind)), cut(cylinder)
    for s in np.linspace(0.0, motion.end, 9):
        assert motion.joints(float(s), (0.0, 0.7), kinematics)[3:] == pytest.approx((0.0, 0.7), abs=1e-12)
    u = np.linspace(0.0, 1.0, 5)
    for m, variable in ((np, u), (jets, jets.variable(u))):
        tilt, turn = kinematics.branches(cylinder.axis(variable, m), m, keep=(0.0, 0.7))[0]
        for angle, value in ((tilt, 0.0), (turn, 0.7)):
            rows = angle.c if m is jets else angle[None]
            np.testing.assert_allclose(rows[0], value, atol=1e-12)
            np.testing.assert_allclose(rows[1:], 0.0, atol=1e-12)


def test_a_whole_cone_counts_its_turns():
    # The first ruling leans to -Y: with positive tilt C starts at 180 deg.
    kinematics, motion, near = kinematics_of(machine()), cut(example_1()), (0.4, 3.0)
    turns = []
    for s in np.linspace(0.0, motion.end, 200):
        joints = motion.joints(float(s), near, kinematics)
        near = (joints[3], joints[4])
        turns.append(joints[4])
    assert abs(turns[-1] - turns[0]) == pytest.approx(math.tau, abs=1e-9)
    assert joints[3] == pytest.approx(math.atan2(5.0, 10.0), abs=1e-12)


# ---- reach, travel, refusals ---------------------------------------------------------


def test_an_axis_out_of_reach_has_no_joints():
    kinematics = kinematics_of(machine("oblique"))  # 45 deg: tilts to 90 deg and no further
    down = unit((0.3, 0.2, -0.9))
    assert kinematics.inverse(Pose((0.0, 0.0, 0.0), down), (0.0, 0.0), 0.0) is None
    assert all(map(math.isnan, kinematics.branches(down)[0]))
    assert kinematics.candidates(down, None, rotary_travel(machine("oblique"))) == []
    many = kinematics.branches(tuple(np.array([a, b]) for a, b in zip(down, Z, strict=True)), np)
    assert np.isnan(many[0][0]).tolist() == [True, False]


def test_the_edge_of_the_reach_is_reached():
    kinematics = kinematics_of(machine("oblique"))
    level = unit((1.0, 0.5, -1e-17))
    pose = Pose((1.0, 2.0, 3.0), level)
    found = kinematics.inverse(pose, (math.pi, 0.0), 5.0)
    assert found is not None
    assert apart(kinematics.forward(found, 5.0), pose) < 1e-9


def test_candidates_are_all_branches_in_all_turns_inside_the_travel():
    kinematics, axis = kinematics_of(machine()), unit((0.3, 0.2, 0.9))
    travel = ((-1.0, 1.0), (-10.0, 10.0))
    found = kinematics.candidates(axis, None, travel)
    assert len({round(a, 9) for a, _ in found}) == 2 and len(found) == len(set(found)) >= 6
    for pair in found:
        assert all(low <= q <= high for q, (low, high) in zip(pair, travel, strict=True))
        again = kinematics.forward((0.0, 0.0, 0.0, *pair), 0.0)
        assert angle_between(again.axis, axis) < 1e-14
    assert kinematics.candidates(axis, None, ((-0.1, 0.1), (-10.0, 10.0))) == []


def test_a_candidate_on_the_limit_of_travel_counts():
    kinematics, axis = kinematics_of(machine()), unit((0.0, 1.0, 1.0))
    limit = math.radians(45.0)
    found = kinematics.candidates(axis, None, ((-limit, limit), (-0.1, 0.1)))
    assert found and all(abs(a) <= limit for a, _ in found)


@pytest.mark.parametrize(
    ("tool_side", "reason"), [(Z, "parallel to"), (unit((0.0, 1.0, 1.0)), None), (X, None)]
)
def test_a_pair_that_cannot_tilt_the_tool_is_refused(tool_side, reason):
    built = machine()
    axes = list(built.axes)
    axes[3] = type(axes[3])(**{**_fields(axes[3]), "direction": tool_side})
    if reason is None:
        kinematics_of(machine(axes=tuple(axes)))
        return
    with pytest.raises(ValueError, match=reason):
        kinematics_of(machine(axes=tuple(axes)))


def _fields(axis):
    return {one.name: getattr(axis, one.name) for one in fields(axis)}


def test_heads_turn_the_tool_and_tables_the_work():
    heads = kinematics_of(machine("head_head"))
    assert all(a.kind is Kind.HEAD for a in machine("head_head").axes[3:])
    # B = 90 deg lays the tool along +X; the gauge point stands the tool's length behind the tip.
    pose = heads.forward((0.0, 0.0, 0.0, 0.0, math.pi / 2), 50.0)
    assert pose.axis == pytest.approx(X, abs=1e-15)
    # The head's line lies 120 mm above the gauge point: the tip swings about it, 170 mm away.
    assert pose.tip == pytest.approx((-170.0, 0.0, 120.0), abs=1e-12)
    tables = kinematics_of(machine("fig4a"))
    # A = 90 deg turns the work's +Y up, so the tool stands along +Y of the work.
    assert tables.forward((0.0, 0.0, 0.0, math.pi / 2, 0.0), 50.0).axis == pytest.approx(Y, abs=1e-15)


# ---- with one rotary: as with two of which the other stands at zero ------------------


@pytest.mark.parametrize("left", [0, 1])
@kinds
def test_a_machine_without_one_of_its_rotaries_is_the_same_with_that_at_zero(kind, left):
    whole, rng = machine(kind), random.Random(7)
    gone = whole.rotary()[left]
    axes = tuple(axis for i, axis in enumerate(whole.axes) if i != gone)
    two, one = kinematics_of(whole), kinematics_of(replace(whole, axes=axes, kinematics="one_rotary"))
    for _ in range(50):
        joints = (*(rng.uniform(-200.0, 200.0) for _ in range(3)), rng.uniform(-1.5, 1.5))
        pose = one.forward(joints, 40.0)
        assert apart(two.forward((*joints[:gone], 0.0, *joints[gone:]), 40.0), pose) < 1e-9
        assert one.inverse(pose, (joints[3], 0.0), 40.0) == pytest.approx(joints, abs=1e-9)
        q, _ = one.branches(pose.axis, keep=(0.3, 0.0))[0]
        many = tuple(np.array([c, c]) for c in pose.axis)
        series = tuple(jets.Jet(np.array([[c], [0.0], [0.0], [0.0]])) for c in pose.axis)
        assert one.branches(many, np, keep=(0.3, 0.0))[0][0] == pytest.approx([q, q], abs=1e-12)
        assert one.branches(series, jets, keep=(0.3, 0.0))[0][0].c[:, 0] == pytest.approx(
            [q, 0, 0, 0], abs=1e-12
        )


@kinds
def test_what_one_rotary_does_not_reach_is_told(kind):
    whole = machine(kind)
    one = kinematics_of(replace(whole, axes=whole.axes[:4], kinematics="one_rotary"))
    off = one.forward((0.0, 0.0, 0.0, 0.4), 0.0).axis
    beside = rotate(unit((1.0, 2.0, 3.0)), 0.01, off)
    assert one.inverse(Pose((0.0, 0.0, 0.0), beside), (0.0, 0.0), 0.0) is None
    assert np.isnan(one.branches(tuple(np.array([c]) for c in beside), np)[0]).all()
