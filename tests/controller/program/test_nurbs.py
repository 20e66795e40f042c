"""G6.2 from its text to the path: against G52, G51 and scipy's B-splines; what it refuses."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.interpolate import BSpline as Reference
from support.machines.traced_programs import assert_whole, mill, named, names, sentences, trace
from support.parts.nurbs_text import Written, bezier, blade, clamped, nurbs

from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine
from controller.motion.motions import SurfaceCut
from controller.plan.rotaries.branch import joints_along
from controller.plan.segment import Path
from controller.program import blocks
from controller.program.program import CutNurbs, ProgramError

UPPER = ((38.0, 22.0, 10.0), (21.5, -5.5, 10.0), (5.0, 5.0, 10.0), (10.5, 11.0, 10.0))
LOWER = ((38.0, 22.0, 0.0), (21.5, -11.0, 0.0), (-1.58, 3.3, 0.0), (3.6, 11.0, 0.0))


def as_g52(upper: tuple, lower: tuple) -> str:
    first, *rest = (f"X{x} Y{y} Z{z}" for x, y, z in (*upper, *lower))
    return "\n".join([f"G52 {first} F600.", *rest]) + "\n"


def along(path: Path, built: Machine, count: int = 601) -> tuple[np.ndarray, np.ndarray]:
    """Even places over all cuts of a path as (s, joints)."""
    cuts, kinematics = named(path, "cut"), kinematics_of(built)
    starts = np.concatenate([[0.0], np.cumsum([c.motion.end for c in cuts])])
    s = np.linspace(0.0, starts[-1], count)
    index = np.clip(np.searchsorted(starts, s, side="right") - 1, 0, len(cuts) - 1)
    joints = np.empty((count, 5))
    for i, cut in enumerate(cuts):
        local = np.clip(s[index == i] - starts[i], 0.0, cut.motion.end)
        joints[index == i] = joints_along(cut, local, kinematics)
    return s, joints


def test_a_g52_written_as_nurbs_gives_the_same_joints_everywhere() -> None:
    built = mill(gouge="warn")
    wanted = along(trace(as_g52(UPPER, LOWER), built), built)
    path = trace(nurbs(bezier(UPPER), bezier(LOWER)), built)
    assert len(named(path, "cut")) == 1
    for found, expected in zip(along(path, built), wanted, strict=True):
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-12)


def halved(points: tuple) -> Written:
    """A Bezier with the knot 1 put into 0 .. 2: the same curve in two spans."""
    p = np.array(points)
    return Written(4, clamped(4, 5), [p[0], *(p[:-1] + p[1:]) / 2.0, p[3]])


def test_a_knot_put_into_a_g52_changes_nothing_but_the_number_of_parts() -> None:
    built = mill(gouge="warn")
    s, wanted = along(trace(as_g52(UPPER, LOWER), built), built)
    path = trace(nurbs(halved(UPPER), halved(LOWER)), built)
    assert len(named(path, "cut")) == 2
    found_s, found = along(path, built)
    np.testing.assert_allclose(found_s, s, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-9)
    assert_whole(path, built)


def circle(radius: float, height: float, quarters: int) -> Written:
    """Quarters of a circle about Z from (0, radius), counter-clockwise, as rational quadratics."""
    root = math.sqrt(0.5)
    angles = np.arange(2 * quarters + 1) * math.pi / 4.0 + math.pi / 2.0
    far = np.where(np.arange(len(angles)) % 2 == 1, radius / root, radius)
    points = np.column_stack([far * np.cos(angles), far * np.sin(angles), np.full(len(angles), height)])
    inner = [k for k in range(1, quarters) for _ in (0, 1)]
    weights = [1.0, *[root, 1.0] * quarters]
    return Written(3, [0, 0, 0, *inner, *[quarters] * 3], points, weights)


@pytest.mark.parametrize("quarters", [1, 4])
def test_arcs_of_circles_written_as_nurbs_are_the_cone_of_g51(quarters: int) -> None:
    built = mill()
    cone = f"G51 X0. Y15. Z0. I0. J0. K0. H10. R10. D{90 * quarters}. F600.\n"
    s, wanted = along(trace(cone, built), built)
    path = trace(nurbs(circle(10.0, 10.0, quarters), circle(15.0, 0.0, quarters)), built)
    assert len(named(path, "cut")) == quarters
    found_s, found = along(path, built)
    np.testing.assert_allclose(found_s, s, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-9)


def _scipy(curve: Written) -> Reference:
    return Reference(np.array(curve.knots) / curve.knots[-1], np.array(curve.points), curve.order - 1)


def test_a_blade_is_one_block_that_runs_through_and_keeps_contact_on_its_lower_curve() -> None:
    built, (upper, lower) = mill(gouge="warn"), blade()
    path = trace(nurbs(upper, lower), built)
    (chain,) = [names_of for names_of in names(path) if "cut" in names_of]
    assert chain.count("cut") == 9 and "pivot" not in chain
    assert "Joins" not in sentences(path)
    assert_whole(path, built)
    top, bottom = _scipy(upper), _scipy(lower)
    kinematics = kinematics_of(built)
    for number, cut in enumerate(named(path, "cut")):
        assert isinstance(cut.motion, SurfaceCut)
        s = np.linspace(0.0, cut.motion.end, 41)
        u = (number + cut.motion.arc.u_along(s)) / 9.0
        for joints, at in zip(joints_along(cut, s, kinematics), u, strict=True):
            pose = kinematics.forward(tuple(map(float, joints)), cut.motion.length_mm)
            tip, axis = np.array(pose.tip) - built.offsets[0].origin, np.array(pose.axis)
            contact, way, ruling = bottom(at), bottom(at, 1), top(at) - bottom(at)
            out = np.cross(way, ruling)
            assert np.allclose(axis, ruling / np.linalg.norm(ruling), atol=1e-9)
            assert np.allclose(tip - contact, 3.0 * out / np.linalg.norm(out), atol=1e-8)


def test_the_arc_length_of_a_blade_is_that_of_its_curve() -> None:
    upper, lower = blade()
    path = trace(nurbs(upper, lower), mill(gouge="warn"))
    rate = _scipy(lower).derivative()
    nodes, weights = np.polynomial.legendre.leggauss(40)
    u = (np.arange(9)[:, None] + 0.5 + 0.5 * nodes) / 9.0
    length = float((np.linalg.norm(rate(u), axis=-1) @ weights).sum() / 18.0)
    assert sum(c.motion.end for c in named(path, "cut")) == pytest.approx(length, abs=1e-9)


def test_curves_of_different_order_and_knots_are_ruled_at_equal_shares_of_their_knots() -> None:
    upper, lower = blade()
    other = Written(6, clamped(6, 9), np.array(upper.points)[[0, 1, 3, 4, 5, 7, 8, 10, 11]])
    path = trace(nurbs(other, lower), mill(gouge="warn"))
    assert len(named(path, "cut")) == 9  # the quintic is smooth at its knots, the cubic asks for parts
    top, bottom = _scipy(other), _scipy(lower)
    for number, cut in enumerate(named(path, "cut")):
        for t in (0.0, 0.3, 1.0):
            u = (number + t) / 9.0
            assert cut.motion.surface.ruling(t) == pytest.approx(top(u) - bottom(u), abs=1e-11)


def test_a_quintic_is_one_motion_over_all_of_its_knots() -> None:
    upper, lower = (Written(6, clamped(6, 12), curve.points) for curve in blade())
    built = mill(gouge="warn")
    path = trace(nurbs(upper, lower), built)
    assert len(named(path, "cut")) == 1
    assert_whole(path, built)


def test_at_a_kink_of_the_lower_curve_the_cut_pivots() -> None:
    points = [(0.0, 0.0, 0.0), (20.0, 0.0, 0.0), (40.0, 10.0, 0.0)]
    lower = Written(2, [0, 0, 1, 2, 2], points)
    upper = Written(2, [0, 0, 1, 2, 2], [(x, y, 10.0) for x, y, _ in points])
    path = trace(nurbs(upper, lower), mill())
    (chain,) = [names_of for names_of in names(path) if "cut" in names_of]
    assert chain[1:4] == ["cut", "pivot", "cut"]
    assert (
        "Pivots by 26.5651 degrees about the ruling it shares with its own part before u = 0.5"
        in sentences(path)
    )
    with pytest.raises(
        ProgramError, match=r"the two parts of this block meet at u = 0.5000 in a concave corner"
    ):
        trace("G41\n" + nurbs(upper, lower), mill())


def test_two_blocks_of_different_words_join() -> None:
    lower = [(3.6, 11.0, 0.0), (8.78, 18.7, 0.0), (28.1, 18.7, 0.0), (38.0, 22.0, 0.0)]
    upper = [(10.5, 11.0, 10.0), (16.0, 16.5, 10.0), (35.8, 18.42, 10.0), (38.0, 22.0, 10.0)]
    path = trace(as_g52(UPPER, LOWER) + nurbs(bezier(upper), bezier(lower), ""), mill(gouge="warn"))
    assert "Joins the block of line 1" in sentences(path)


# ---- words -------------------------------------------------------------------------

P = [(0, 0, 10), (10, 3, 10), (20, 3, 10), (30, 0, 10)]
GOOD = "G6.2 P4 Q2 F1000\n" + "".join(
    [f"K0 X{x}00 Y{y}00 Z1000 R1.5\n" for x, y, _ in P]
    + ["K1\n"] * 4
    + ["K0 X0 Y0 Z0\nK0 X3000 Y0 Z0\nK1\nK1\n"]
)


def read(text: str) -> CutNurbs:
    (block,) = blocks.read(text.encode(), mill(), "part.ngc").blocks
    assert isinstance(block, CutNurbs)
    return block


def refused(text: str) -> ProgramError:
    with pytest.raises(ProgramError) as error:
        blocks.read(text.encode(), mill(), "part.ngc")
    return error.value


def test_words_without_a_point_are_in_blu_but_knots_and_weights_are_numbers() -> None:
    block = read(GOOD)
    assert block.upper.at(1.0) == pytest.approx((30.0, 0.0, 10.0))
    assert block.lower.at(1.0) == (30.0, 0.0, 0.0)
    assert block.feed_mm_s == pytest.approx(10.0 / 60.0)
    assert (block.place.line, block.place.column) == (1, 1)
    written = GOOD.replace("00 ", ". ").replace("00\n", ".\n").replace("F10.", "F10.").replace(" R1.5", "")
    assert read(written).lower == block.lower


def test_a_modal_feed_serves_and_the_motion_mode_is_cleared() -> None:
    program = blocks.read(("G1 X1. F600.\n" + GOOD.replace(" F1000", "")).encode(), mill(), "part.ngc")
    assert program.blocks[1].feed_mm_s == 10.0
    for surplus in ("K1\n", "X1. Y1. Z1.\n"):
        error = refused("G1 X1. F600.\n" + GOOD + surplus)
        assert error.line == 15
        assert "surplus after the two whole curves of G6.2 on line 2" in error.sentence


def test_comments_blank_lines_and_line_numbers_may_stand_between() -> None:
    text = GOOD.replace("K1\n", "(tail)\n\nN70 K1\n")
    assert read(text).upper == read(GOOD).upper


HOW = "G6.2 cuts a ruled surface between two NURBS curves"
LINES = GOOD.splitlines()


def changed(number: int, line: str) -> str:
    """The good program with another line, counted from 1."""
    return "\n".join([*LINES[: number - 1], line, *LINES[number:]]) + "\n"


def without(number: int) -> str:
    return "\n".join([*LINES[: number - 1], *LINES[number:]]) + "\n"


REFUSED = [
    ("G6.2\n", 1, ("P Q missing", HOW)),
    ("G6.2 X0. Y0. Z0.\n", 1, ("found X0.", HOW)),
    (changed(1, "G6.2 P4 F1000"), 1, ("Q missing", HOW)),
    (changed(1, "G6.2 P4 Q2"), 1, ("G6.2 has no feed",)),
    (
        changed(1, "G6.2 P9 Q2 F1000"),
        1,
        ("P9 is no order of the upper curve", "from 2 (straight lines) to 8"),
    ),
    (changed(1, "G6.2 P4 Q1 F1000"), 1, ("Q1 is no order of the lower curve",)),
    (changed(1, "G6.2 P4.5 Q2 F1000"), 1, ("P4.5 is not a count",)),
    (changed(1, "G6.2 P4 Q2 F1000 G41"), 1, ("found G41", "stands alone")),
    (changed(1, "G6.2 P4 Q2 F1000 S100"), 1, ("found S100",)),
    (changed(1, "G6.2 P4 Q2 F1000 M30"), 1, ("found M30",)),
    (changed(1, "G64 G6.2 P4 Q2 F1000"), 1, ("both take P",)),
    (changed(1, "G91\nG6.2 P4 Q2 F1000"), 2, ("G6.2 stands under G91",)),
    (changed(3, "K0 X1. Y1."), 3, ("Z missing in control point 2 of the upper curve",)),
    (
        changed(3, "X1. Y1. Z1."),
        3,
        ("K missing in control point 2 of the upper curve of the G6.2 on line 1",),
    ),
    (changed(3, "K0 X1. Y1. Z1. F5"), 3, ("found F5 where control point 2",)),
    (changed(3, "G1 X1."), 3, ("found G1 where control point 2",)),
    (changed(3, "K0 X1. Y1. Z1. R0"), 3, ("the weight is 0: every weight is greater than 0", "upper")),
    (changed(3, "K0 X1. Y1. Z1. R-1."), 3, ("the weight is -1",)),
    (changed(3, "K2 X1. Y1. Z1."), 4, ("the knots fall from 2 to 0",)),
    (changed(3, "K-1 X1. Y1. Z1."), 3, ("the knots fall from 0 to -1",)),
    (without(3), 5, ("3 control points are too few: order 4 takes 4 or more",)),
    (without(6), 9, ("found X0 where knot 4 of the 4 that follow the points of the upper curve",)),
    (changed(6, "K1\nK1"), 10, ("found K1 alone where control point 1 of the lower curve",)),
    ("\n".join(LINES[:7]) + "\n", 1, ("the program ends where knot 3 of the 4",)),
    ("\n".join(LINES[:9]) + "\n", 1, ("the program ends where control point 1 of the lower curve",)),
    (changed(9, "K2"), 9, ("the last knot 2 stands 1 times: order 4 takes it 4 times",)),
    (GOOD.replace("K1\n", "K0\n"), 9, ("all knots are 0: the last must be greater than the first",)),
    (changed(5, "K0.5 X1. Y1. Z1."), 5, ("the first knot 0 stands 3 times",)),
]


@pytest.mark.parametrize(("text", "line", "phrases"), REFUSED)
def test_an_incomplete_or_wrong_surface_is_refused_with_its_line(
    text: str, line: int, phrases: tuple
) -> None:
    error = refused(text)
    for phrase in phrases:
        assert phrase in error.sentence
    assert error.line == line
    assert "\n" not in error.sentence


def test_the_program_with_any_one_line_lost_is_refused() -> None:
    for number in range(1, len(LINES) + 1):
        refused(without(number))


def test_defects_of_the_surface_are_found_in_the_blocks_own_parameter() -> None:
    upper, lower = blade()
    high = [(x, y, 10.0) for x, y, _ in lower.points]
    crossing = Written(4, lower.knots, [*high[:6], *lower.points[6:]])
    with pytest.raises(ProgramError, match=r"G6.2: the ruling at u = .* has no length"):
        trace(nurbs(crossing, lower), mill())
    with pytest.raises(
        ProgramError, match=r"G6.2: the cutter T1 of radius 3.000 mm does not fit into the hollow"
    ):
        trace(
            nurbs(*(Written(4, c.knots, np.array(c.points) * (0.1, 1.0, 1.0)) for c in (upper, lower))),
            mill(),
        )


def test_exchanged_curves_are_refused_as_such() -> None:
    text = f"G21 G90\n{nurbs(bezier(LOWER), bezier(UPPER))}".encode()
    with pytest.raises(ProgramError, match="exchange the two curves"):
        blocks.read(text, mill(), "part.ngc")
