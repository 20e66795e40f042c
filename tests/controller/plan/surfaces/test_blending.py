"""Joints within the tolerance: smooth, within it by a brute-force envelope, told, and what stays a corner."""

from __future__ import annotations

import itertools
import math
import random
import re
from dataclasses import replace

import numpy as np
import pytest
from support.machines.traced_programs import assert_whole, mill, named, sentences, trace
from support.oracles import ruled_surfaces
from support.oracles.swept_cylinder import _through
from support.parts import blu_compounds
from support.parts.paper_surfaces import POINTS, turned
from support.parts.random_surfaces import Pair

from controller.geometry.placement import Blended
from controller.geometry.vectors import Frame
from controller.machine import machine_file
from controller.machine.kinematics import Kinematics, kinematics_of
from controller.machine.model import Machine, Tool
from controller.plan.feed.course import FeedCourse
from controller.plan.feed.limits import JointLimits
from controller.plan.rotaries.branch import joints_along
from controller.plan.segment import ContinuousPath, Path, Segment, rotaries_of
from controller.program.program import ProgramError

RADII = (1.0, 1.5, 3.0, 5.0, 8.0)
FEED = 2000.0
CREASES = "G64 P0.005"  # blends what rounding does not explain


def with_cutter(radius: float, **changes: object) -> Machine:
    built = mill(gouge="warn", **changes)
    return replace(built, tools=(Tool(1, "end mill", radius, 0.0, 30.0),))


def compound(seed: int) -> tuple[list[Pair], Machine, str]:
    """Blocks that meet at less than 0.2 degrees at the contact and in no crease, a cutter, and a side."""
    rng = random.Random(seed)
    for attempt in itertools.count(100 * seed):
        kind = (blu_compounds.general, blu_compounds.like_the_papers)[attempt % 2]
        surfaces = kind(attempt, rng.choice((2, 2, 3, 4, 5)))
        if max(blu_compounds.angles(surfaces)) < 0.19 and max(blu_compounds.creases(surfaces)) < 0.5:
            break
    return surfaces, with_cutter(RADII[seed % 5]), ("G41", "G42")[seed // 5 % 2]


def program(surfaces: list[Pair], side: str, head: str = "") -> str:
    return blu_compounds.text(surfaces, FEED, side, "T1 M6", head)


def joints_between(traced: Path) -> list[tuple[Segment, Segment]]:
    """Every two cuts that follow each other without anything between them."""
    pairs = [
        p
        for item in traced.items
        if isinstance(item, ContinuousPath)
        for p in itertools.pairwise(item.segments)
    ]
    return [(a, b) for a, b in pairs if a.name == b.name == "cut"]


def traced_or_skipped(seed: int, head: str = "") -> tuple[list[Pair], Machine, Path]:
    surfaces, built, side = compound(seed)
    try:
        return surfaces, built, trace(program(surfaces, side, head), built)
    except ProgramError as error:
        if "concave corner" in str(error):
            raise
        pytest.skip(str(error))  # a hollow that is too narrow, a surface that folds


# ---- smooth ------------------------------------------------------------------------


def rates(segment: Segment, built: Machine, at_end: bool) -> tuple[np.ndarray, np.ndarray]:
    """First and second derivatives of the joints at an end, by differences of what the tick computes."""
    kinematics, surface = kinematics_of(built), segment.motion.surface
    widths = [1.0 / one.per_u for one in surface.blends] if isinstance(surface, Blended) else []
    h = min(0.004, *(0.01 * width * segment.motion.end for width in widths), 1.0)
    near = rotaries_of(segment.end if at_end else segment.start, kinematics)
    rows = []
    for k in range(7):
        found = segment.motion.joints(segment.motion.end - k * h if at_end else k * h, near, kinematics)
        assert found is not None
        near = rotaries_of(found, kinematics)
        rows.append(found)
    fit = np.polynomial.polynomial.polyfit(np.arange(7.0), np.array(rows), 6)
    return (-1.0 if at_end else 1.0) * fit[1] / h, 2.0 * fit[2] / h**2


@pytest.mark.parametrize(
    "seed", [*range(3), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(10, 60))]
)
def test_a_joint_of_rounding_runs_through_twice_smoothly(seed: int) -> None:
    surfaces, built, traced = traced_or_skipped(seed)
    assert not named(traced, "pivot"), sentences(traced)
    found = joints_between(traced)
    assert len(found) == len(surfaces) - 1
    for before, after in found:
        (a, aa), (b, bb) = rates(before, built, True), rates(after, built, False)
        assert np.abs(np.subtract(before.end, after.start)).max() < 1e-9
        assert np.abs(a - b).max() < 1e-6 * (1.0 + np.abs(a).max()), seed
        assert np.abs(aa - bb).max() < 1e-3 * (1.0 + np.abs(aa).max()), seed
        assert FeedCourse((before, after), built, kinematics_of(built)).junction(0) > 1e3, "mm/s"
    assert_whole(traced, built)


@pytest.mark.parametrize(
    ("seed", "decimals", "least_mm_s"), [(3000, 2, 18.0), (3006, 5, 33.0), (3016, 3, 18.0)]
)
def test_where_the_tool_turns_at_another_rate_the_joint_is_rounded(
    seed: int, decimals: int, least_mm_s: float
) -> None:
    """A way that stayed on one side of the joint, for as much deviation, would allow half of that."""
    built = with_cutter(5.0)
    traced = trace(program(blu_compounds.general(seed, decimals), "G41", CREASES), built)
    speeds = []
    for pair in joints_between(traced):
        course = FeedCourse(pair, built, kinematics_of(built))
        beside = pair[0].motion.end + np.array([-0.01, 0.01])
        speeds.append(float(JointLimits.of(built).path_speed(course.derivatives(beside)).min()))
    assert min(speeds) >= least_mm_s
    told = re.findall(r"deviates by ([\d.]+) um", sentences(traced))
    assert max(map(float, told)) <= 1000.0 * built.joint_tolerance_mm


def test_the_same_joints_are_corners_without_the_blend() -> None:
    """What the test above would find if nothing were blended."""
    jumps = []
    for seed in range(4):
        _, built, traced = traced_or_skipped(seed, "G61")
        cuts = named(traced, "cut")
        for before, after in itertools.pairwise(cuts):
            (a, _), (b, _) = rates(before, built, True), rates(after, built, False)
            jumps.append(float(np.abs(a - b).max()))
    assert max(jumps) > 2e-4


@pytest.mark.parametrize("seed", range(2))
def test_series_samples_and_floats_of_a_blended_cut_are_one(seed: int) -> None:
    _, built, traced = traced_or_skipped(seed)
    kinematics = kinematics_of(built)
    for before, after in joints_between(traced):
        course = FeedCourse((before, after), built, kinematics)
        h = 1e-3
        for s in before.motion.end + np.array([-3.0, -1.0, -0.1, 0.1, 1.0, 3.0]):
            if not 2.0 * h < s < course.length - 2.0 * h:
                continue
            segment, at = (before, s) if s < before.motion.end else (after, s - before.motion.end)
            if not 2.0 * h < at < segment.motion.end - 2.0 * h:
                continue
            q = joints_along(segment, at + h * np.arange(-2.0, 3.0), kinematics)
            first = (q[0] - 8.0 * q[1] + 8.0 * q[3] - q[4]) / (12.0 * h)
            told = course.derivatives(np.array([s])).first[0]
            assert np.abs(first - told).max() < 1e-6 * (1.0 + np.abs(told).max())


# ---- within the tolerance ------------------------------------------------------------


def poses(
    segment: Segment, s: np.ndarray, kinematics: Kinematics, part: Frame | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Tips and axes in the part frame, of a motion that has none in ``part``."""
    tip, axis = kinematics.forward(tuple(joints_along(segment, s, kinematics).T), 0.0, np)
    part = part or segment.motion.part
    tip, axis = part.from_parent(tip), part.turn_back(axis)
    return tuple(np.stack([np.broadcast_to(c, s.shape) for c in v], axis=1) for v in (tip, axis))


def entered(points: np.ndarray, normals: np.ndarray, tips: np.ndarray, axes: np.ndarray, radius: float):
    """Where lines along the normals enter the endless flank, least over all poses."""
    found = []
    for p, n in zip(points, normals, strict=True):
        enter, leave = _through(p - tips, n, axes, radius)
        enter = np.where(enter < leave, enter, np.inf)
        found.append(enter.min())
    return np.array(found)


def by_hand_poses(surface: Pair, offset: float, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    ruled = ruled_surfaces.Ruled(*surface)
    return ruled.tip(u, offset), ruled.axis(u)


def points_beside(surface: Pair, side: float, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points at three heights and their normals to the cutter's side."""
    upper, lower = (ruled_surfaces.casteljau(p, u) for p in surface)
    du, dl = (ruled_surfaces.derivative(p, u) for p in surface)
    points, normals = [], []
    for v in (0.02, 0.5, 0.98):
        normal = np.cross((1.0 - v) * du + v * dl, upper - lower)
        points.append((1.0 - v) * upper + v * lower)
        normals.append(side * normal / np.linalg.norm(normal, axis=1)[:, None])
    return np.concatenate(points), np.concatenate(normals)


def added_mm(pairs: list[Pair], cuts: list[Segment], side: float, built: Machine, k: int) -> float:
    """Largest change of what the k-th joint leaves, by the poses of the plan and by those of Eq. 5."""
    kinematics, radius = kinematics_of(built), built.tools[0].radius_mm
    # All of both cuts: on a twisted surface what comes nearest may stand far along.
    whole = np.linspace(0.0, 1.0, 2501)
    planned = [poses(c, whole * c.motion.end, kinematics) for c in cuts[k : k + 2]]
    exact = [by_hand_poses(p, side * radius, whole) for p in pairs[k : k + 2]]
    worst = 0.0
    for i, u in ((0, np.linspace(0.6, 1.0, 13)), (1, np.linspace(0.0, 0.4, 13))):
        points, normals = points_beside(pairs[k + i], side, u)
        now = entered(points, normals, *(np.concatenate(c) for c in zip(*planned, strict=True)), radius)
        own = entered(points, normals, *exact[i], radius)
        both = np.minimum(own, entered(points, normals, *exact[1 - i], radius))
        worst = max(worst, float((both - now).max()), float((now - own).max()))
    return worst


@pytest.mark.parametrize(
    "seed", [0, 1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(2, 40))]
)
def test_a_blend_adds_less_than_the_tolerance_by_brute_force(seed: int) -> None:
    surfaces, built, traced = traced_or_skipped(seed)
    side = -1.0 if compound(seed)[2] == "G41" else 1.0
    told = [float(um) for um in re.findall(r"deviates by ([0-9.]+) um", sentences(traced))]
    assert told and max(told) <= 1000.0 * built.joint_tolerance_mm
    found = [added_mm(surfaces, named(traced, "cut"), side, built, k) for k in range(len(surfaces) - 1)]
    assert max(found) <= built.joint_tolerance_mm, (seed, found, told)
    assert max(found) <= 1.7e-3 * max(told) + 2e-4, "what check tells is what comes out"


@pytest.mark.parametrize(
    ("seed", "radius", "side"),
    [
        (3058, 5.0, "G42"),
        (98_228, 8.0, "G41"),  # the deepest within 0.2 mm, two millimetres beside the joint
        *(
            pytest.param(seed, radius, side, marks=pytest.mark.slow)
            for seed in (4006, 4014, 4052, 4090, 5100, 5172)
            for radius, side in ((1.5, "G41"), (8.0, "G42"))
        ),
    ],
)
def test_at_a_crease_it_does_so_too(seed: int, radius: float, side: str) -> None:
    """A ridge and a hollow, which are rounded otherwise; each as far as the tolerance lets it."""
    surfaces = blu_compounds.general(seed)
    built = with_cutter(radius)
    try:
        traced = trace(program(surfaces, side, CREASES), built)
    except ProgramError as error:
        pytest.skip(str(error))
    k = int(np.argmax(blu_compounds.creases(surfaces)))
    found = added_mm(surfaces, named(traced, "cut"), -1.0 if side == "G41" else 1.0, built, k)
    told = [float(um) for um in re.findall(r"deviates by ([0-9.]+) um", sentences(traced))]
    assert 2.0 < max(told) <= 1000.0 * built.joint_tolerance_mm, "a crease takes most of it"
    assert found <= built.joint_tolerance_mm, (seed, found, told)


# ---- what holds where ------------------------------------------------------------------


def flat(ax: float, ay: float, bx: float, by: float) -> str:
    """A straight upright wall from a to b, 10 mm high."""
    rows = [(ax + (bx - ax) * k / 3.0, ay + (by - ay) * k / 3.0, z) for z in (10.0, 0.0) for k in range(4)]
    words = [f"X{x:.9f} Y{y:.9f} Z{z:.9f}" for x, y, z in rows]
    return "\n".join([f"G52 {words[0]} F100.", *words[1:]]) + "\n"


def walls(degrees: float, side: str = "G42") -> str:
    """Two straight walls that meet at so much, to the left positive."""
    a = math.radians(degrees)
    return f"{side}\n" + flat(0, 0, 30, 0) + flat(30, 0, 30 + 30 * math.cos(a), 30 * math.sin(a))


@pytest.mark.parametrize(("degrees", "sign"), [(0.01, 1.0), (0.1, -1.0), (0.19, 1.0), (0.19, -1.0)])
def test_a_corner_within_the_tolerance_is_blended_on_either_side(degrees: float, sign: float) -> None:
    built = mill()
    for side in ("G41", "G42"):
        traced = trace(walls(sign * degrees, side), built)
        assert len(joints_between(traced)) == 1 and not named(traced, "pivot")
        assert f"normals {degrees:.4f} degrees" in sentences(traced)
        assert_whole(traced, built)


@pytest.mark.parametrize("degrees", [0.21, 1.0, 5.0])
def test_a_corner_beyond_it_is_a_pivot_or_a_refusal_that_tells_both(degrees: float) -> None:
    built = mill(tools=(Tool(1, "end mill", 8.0, 0.0, 15.0),), lead_mm=9.0)
    assert len(named(trace(walls(degrees), built), "pivot")) == 1
    overcut = 8.0 * (1.0 - math.cos(math.radians(degrees)))
    for head in ("", "G61\n", "G64 P0.001\n"):
        allowed = {"": 0.005, "G61\n": 1e-4, "G64 P0.001\n": 0.001}[head]
        if overcut <= allowed:
            traced = trace(head + walls(degrees, "G41"), built)
            assert len(named(traced, "pivot")) == 1
            told = re.findall(
                r"concave corner, which costs either surface up to ([0-9.]+) um", sentences(traced)
            )
            assert told == ([f"{1000.0 * overcut:.3f}"] if overcut > 1e-4 else [])
            continue
        with pytest.raises(ProgramError, match=f"concave corner of {degrees:.4f} degrees") as refused:
            trace(head + walls(degrees, "G41"), built)
        assert f"{overcut:.6f} mm into" in str(refused.value)
        if head.startswith("G64"):
            assert "the joint tolerance is 0.001 mm and 0.2 degrees" in str(refused.value)


def turned_about(axis: np.ndarray, angle_rad: float, rows: np.ndarray) -> np.ndarray:
    """Vectors (..., 3) turned by the right hand about a unit vector."""
    along = (rows @ axis)[..., None] * axis
    return along + math.cos(angle_rad) * (rows - along) + math.sin(angle_rad) * np.cross(axis, rows)


def hollow(seed: int, upper_deg: float, lower_deg: float) -> tuple[list[Pair], str]:
    """Two twisted surfaces, turned into each other at the joint by so much above and below, and the side."""
    before, after = blu_compounds.general(seed, 6)[:2]
    made = [before, tuple(points.copy() for points in after)]
    ruling = before[0][3] - before[1][3]
    axis = ruling / np.linalg.norm(ruling)
    for before_points, points, degrees in zip(before, made[1], (upper_deg, lower_deg), strict=True):
        way = before_points[3] - before_points[2]
        way *= np.linalg.norm(points[1] - points[0]) / np.linalg.norm(way)
        points[1] = points[0] + turned_about(axis, -math.radians(degrees), way)
    return made, "G42"


@pytest.mark.parametrize(("seed", "radius", "degrees"), [(14, 8.0, (1.2, 0.5)), (17, 1.5, (0.6, 0.6))])
def test_the_overcut_of_a_concave_corner_is_that_of_an_envelope(
    seed: int, radius: float, degrees: tuple[float, float]
) -> None:
    """Of both cuts and the turn between, against the surface's own and the other one if that ran on."""
    pairs, side = hollow(seed, *degrees)
    built = with_cutter(radius)
    traced = trace(program(pairs, side), built)
    assert len(named(traced, "pivot")) == 1, sentences(traced)
    (um,) = re.findall(r"concave corner, which costs either surface up to ([0-9.]+) um", sentences(traced))
    kinematics, s = kinematics_of(built), np.linspace(0.0, 1.0, 2501)
    way = [one for item in traced.items if isinstance(item, ContinuousPath) for one in item.segments]
    way = [one for one in way if one.name in ("cut", "pivot")]
    part = way[0].motion.part
    tips, axes = (
        np.concatenate(c)
        for c in zip(*(poses(c, s * c.motion.end, kinematics, part) for c in way), strict=True)
    )
    worst, edge = 0.0, pairs[0][1][3]
    ruling = (pairs[0][0][3] - edge) / np.linalg.norm(pairs[0][0][3] - edge)
    for i, pair in enumerate(pairs):
        near = np.linspace(0.0, 0.5 * radius, 101) / named(traced, "cut")[i].motion.end
        lines = points_beside(pair, 1.0, near if i else 1.0 - near)
        other_tips, other_axes = by_hand_poses(pairs[1 - i], radius, s)
        back = math.radians(degrees[1]) * (-1.0 if i else 1.0)
        run_on = edge + turned_about(ruling, back, other_tips - edge), turned_about(ruling, back, other_axes)
        smooth = [entered(*lines, *one, radius) for one in (by_hand_poses(pair, radius, s), run_on)]
        worst = max(worst, float((np.minimum(*smooth) - entered(*lines, tips, axes, radius)).max()))
    assert 1e-4 < worst <= built.joint_tolerance_mm
    assert float(um) == pytest.approx(1000.0 * worst, rel=0.05, abs=0.02)


@pytest.mark.parametrize("hollow_mm", [12.0, 16.0, 60.0])
def test_a_concave_corner_in_a_hollow_costs_more(hollow_mm: float) -> None:
    """Of two cylinders: from the one's centre to the cutter on the other one, by the law of cosines."""
    radius, a = 8.0, math.radians(0.8)
    away = math.sqrt(radius**2 + hollow_mm**2 - 2.0 * radius * hollow_mm * math.cos(a))
    overcut = away + radius - hollow_mm
    assert overcut > 1.1 * radius * (1.0 - math.cos(a))
    arc = "G51 X{:.9f} Y{:.9f} Z0. I{:.9f} J{:.9f} K0. H10. R{:.9f} D40. F100.\n".format
    first = arc(
        hollow_mm * math.cos(math.radians(40.0)),
        -hollow_mm * math.sin(math.radians(40.0)),
        0.0,
        0.0,
        hollow_mm,
    )
    centre = hollow_mm * (1.0 - math.cos(a)), -hollow_mm * math.sin(a)
    traced = trace("G41\n" + first + arc(hollow_mm, 0.0, *centre, hollow_mm), with_cutter(radius))
    (um,) = re.findall(r"concave corner, which costs either surface up to ([0-9.]+) um", sentences(traced))
    assert float(um) == pytest.approx(1000.0 * overcut, rel=0.03)


def test_g61_is_exact_and_g64_has_its_own_tolerances() -> None:
    built = mill()
    assert len(named(trace("G61\n" + walls(0.1), built), "pivot")) == 1
    assert len(joints_between(trace("G61\nG64\n" + walls(0.1), built))) == 1, "the machine's"
    assert len(named(trace("G64 P0.01 Q0.05\n" + walls(0.1), built), "pivot")) == 1
    wide = trace("G64 P0.02 Q2\n" + walls(1.0), built)
    assert len(joints_between(wide)) == 1 and "G64 without P blends" not in sentences(wide)
    (um,) = re.findall(r"deviates by ([0-9.]+) um", sentences(wide))
    assert float(um) <= 20.0
    (short,) = re.findall(
        r"deviates by ([0-9.]+) um", sentences(trace("G64 P0.0001 Q2\n" + walls(0.1), built))
    )
    assert float(short) <= 0.1


@pytest.mark.parametrize("feed", [10_000, 200_000])
@pytest.mark.parametrize("head", ["", "G61\n"])
def test_a_crease_that_is_meant_is_run_exactly_at_any_feed(head: str, feed: int) -> None:
    """Example 2: the poses agree, the upper curves meet at 2.4 degrees (slip 10)."""
    text = head + machine_file.shipped_program("example2").read_text().replace("f10000", f"f{feed}")
    traced = trace(text, mill(gouge="warn"))
    (told,) = re.findall("Joins the block of line .*", sentences(traced))
    assert "the poses agree and the cut runs through." in told
    assert ("differ by up to 2.388 degrees" in told and "slows down to about" in told) == (feed > 10_000)
    assert not any(isinstance(cut.motion.surface, Blended) for cut in named(traced, "cut"))


@pytest.mark.parametrize("decimals", [2, 3, 6])
def test_a_crease_is_exact_however_it_is_written(decimals: int) -> None:
    """Example 2 turned and elsewhere: rounding makes a pivot of a joint, but nothing is led over."""
    pairs = [
        tuple(np.round(np.array([turned(p, 37.0) for p in points]) + 1.2345678, decimals) for points in pair)
        for pair in POINTS
    ]
    traced = trace(program(pairs, "G41"), with_cutter(1.5))
    cuts = named(traced, "cut")
    assert len(cuts) == 2 and not any(isinstance(cut.motion.surface, Blended) for cut in cuts)
    assert "differ by up to 2." in sentences(traced) and not named(traced, "lift")[1:]


def test_a_crease_is_blended_as_far_as_g64_p_says() -> None:
    """At twenty times the feed, where to slow down for it takes long."""
    text = machine_file.shipped_program("example2").read_text().replace("f10000", "f200000")
    built = mill(gouge="warn")
    found = trace("G64 P0.004\n" + text, built)
    assert "within the joint tolerance: normals 0.0000 degrees" in sentences(found)
    (um,) = re.findall(r"deviates by ([0-9.]+) um", sentences(found))
    assert 0.0 < float(um) <= 4.0
    for before, after in joints_between(found):
        assert FeedCourse((before, after), built, kinematics_of(built)).junction(0) > 1e2, "mm/s"


@pytest.mark.parametrize("seed", [8, 16])
def test_rounding_to_the_papers_unit_is_no_crease(seed: int) -> None:
    """Where upper curves are short, half a hundredth of a millimetre turns the normals there by much more."""
    surfaces = blu_compounds.like_the_papers(seed)
    assert max(blu_compounds.angles(surfaces)) < 0.19 and max(blu_compounds.creases(surfaces)) > 0.3
    traced = trace(program(surfaces, "G42"), with_cutter(1.0))
    assert len(joints_between(traced)) == len(surfaces) - 1 and not named(traced, "pivot")
    assert all(isinstance(cut.motion.surface, Blended) for cut in named(traced, "cut"))


def test_a_crease_is_told_with_what_it_costs_and_what_binds() -> None:
    """The contact's normals agree; those at the upper end differ by 6.8 degrees."""
    built = with_cutter(5.0)
    surfaces = blu_compounds.general(3016, 3)
    traced = trace(program(surfaces, "G41", CREASES), built)
    (degrees, f, joint, limit) = re.findall(
        r"differ by up to ([\d.]+) degrees.*slows down to about (\d+) mm/min there \((\w+) (\w+)\)",
        sentences(traced),
    )[0]
    upper = max(blu_compounds.angles(surfaces, v=0.0))
    assert float(degrees) == pytest.approx(upper, rel=0.02)
    assert joint in {axis.name for axis in built.axes} and limit in ("velocity", "acceleration", "jerk")
    speeds = []
    for pair in joints_between(traced):
        course = FeedCourse(pair, built, kinematics_of(built))
        beside = pair[0].motion.end + np.linspace(-1.0, 1.0, 201)
        speeds.append(60.0 * float(JointLimits.of(built).path_speed(course.derivatives(beside)).min()))
    assert float(f) == pytest.approx(min(speeds), rel=0.02)


def test_a_machine_without_a_tolerance_pivots() -> None:
    built = mill(joint_tolerance_mm=0.0)
    assert len(named(trace(walls(0.1), built), "pivot")) == 1


@pytest.mark.parametrize("head", ["", "G61\n"])
@pytest.mark.parametrize("off", [1e-6, -1e-6])
def test_a_gap_of_a_nanometre_is_no_departure(off: float, head: str) -> None:
    """As the issue has it: Y15.000001 for 15. between two surfaces, inside a narrow place."""
    built = mill()
    text = head + flat(0, 15, 30, 15) + flat(30, 15 + off, 60, 15)
    traced = trace(text, built)
    assert not named(traced, "pivot") and len(named(traced, "lift")) == 1, sentences(traced)
    assert len(joints_between(traced)) == 1


def test_a_gap_beyond_the_tolerance_is_told_with_both_figures() -> None:
    traced = trace(flat(0, 15, 30, 15) + flat(30, 15.01, 60, 15.01))
    assert "0.010000 mm and 0.0000 degrees apart; the joint tolerance is 0.005 mm" in sentences(traced)


def test_a_gap_within_the_tolerance_is_blended_and_counted() -> None:
    traced = trace(flat(0, 15, 30, 15) + flat(30, 15.002, 60, 15.002))
    (um,) = re.findall(r"deviates by ([0-9.]+) um", sentences(traced))
    assert len(joints_between(traced)) == 1 and 1.0 <= float(um) <= 5.0, "half of it on either side"


def test_a_gap_at_the_upper_end_leaves_the_blend_its_length() -> None:
    """Upper ends of three decimals above a lower curve that is one: 4 um apart, so 2 on either side."""
    first = [
        [(x, 0.0, 0.0) for x in (0.0, 10.0, 20.0, 30.0)],
        [(x, 2.0, 10.0) for x in (0.0, 10.0, 20.0, 30.0)],
    ]
    second = [[(x, 0.0, 0.0) for x in (30.0, 40.0, 50.0, 60.0)]]
    second.append([(x, 2.004, 10.0) for x in (30.0, 40.0, 50.0, 60.0)])
    pairs = [(np.array(upper), np.array(lower)) for lower, upper in (first, second)]
    built = with_cutter(5.0)
    traced = trace(program(pairs, "G42"), built)
    ((before, after),) = joints_between(traced)
    (told,) = re.findall(
        r"gap ([0-9.]+) mm; the blend over ([0-9.]+) mm .* by ([0-9.]+) um at most", sentences(traced)
    )
    gap, reach, um = map(float, told)
    assert gap == pytest.approx(0.004, abs=1e-4) and reach == pytest.approx(FEED / 600.0, abs=0.01)
    planned = [
        poses(c, np.linspace(0.0, 1.0, 801) * c.motion.end, kinematics_of(built)) for c in (before, after)
    ]
    tips, axes = (np.concatenate(column) for column in zip(*planned, strict=True))
    off = 0.0
    for pair, u in zip(pairs, (np.linspace(0.8, 1.0, 41), np.linspace(0.0, 0.2, 41)), strict=True):
        off = max(off, float(np.abs(entered(*points_beside(pair, 1.0, u), tips, axes, 5.0)).max()))
    assert 1.9 < 1000.0 * off < 1.05 * um + 0.05 < 3.0


@pytest.mark.parametrize("placement", ["double", pytest.param("optimal", marks=pytest.mark.slow)])
def test_placed_cutters_are_blended_too_or_pivot(placement: str) -> None:
    surfaces, _, side = compound(0)
    built = with_cutter(1.5, placement=placement)
    traced = trace(program(surfaces[:2], side), built)
    assert len(joints_between(traced)) + len(named(traced, "pivot")) == 1
    assert_whole(traced, built)


def test_upright_rulings_at_a_joint_are_left_upright() -> None:
    """Both walls lean away from an upright ruling that they share: the axis is not led past the pole."""
    built = mill()
    first = flat(0, 0, 30, 0)
    upper = "G52 X30. Y0. Z10. F100.\nX40. Y1. Z10.\nX50. Y2. Z10.\nX60. Y3. Z10.\n"
    leaning = upper + "X30. Y0. Z0.\nX40. Y0.02 Z0.\nX50. Y0. Z0.\nX60. Y0. Z0.\n"
    traced = trace(f"{CREASES}\nG42\n" + first + leaning, built)
    assert "within the joint tolerance" in sentences(traced)
    for before, after in itertools.pairwise(named(traced, "cut")):
        for segment, s in ((before, before.motion.end), (after, 0.0)):
            axis = segment.motion.pose(s).axis
            assert math.hypot(axis[0], axis[1]) < 1e-12
    assert_whole(traced, built)


def test_a_joint_on_the_pole_tells_no_feed_that_is_none() -> None:
    """Walls that come to the vertical and leave it otherwise: the rotary turns under a standing tool."""
    seed = 99_501
    surfaces = [(upper.copy(), lower) for upper, lower in blu_compounds.like_the_papers(seed)]
    for (upper, lower), (next_upper, next_lower) in itertools.pairwise(surfaces):
        upper[2:, :2], next_upper[:2, :2] = lower[2:, :2], next_lower[:2, :2]
    traced = trace(program(surfaces, "G41"), with_cutter(8.0))
    told = re.findall(
        r"Beside the pole .* slows down to about (\w+) mm/min there \((\w+) (\w+)\)", sentences(traced)
    )
    assert [one[1:] for one in told] == [("C", "jerk")] * 2, "its rate jumps there"
    assert all(0.0 < float(f) < 0.1 * FEED for f, _, _ in told)


SHORT_BETWEEN_LONG = """G64 P0.003
G42 P1 R5.
G52 X-5.013 Y2.412 Z8.387 F1690.
X-6.323 Y3.355 Z8.487
X-7.408 Y4.379 Z8.807
X-8.491 Y5.558 Z8.961
X-2.588 Y2.517 Z-0.276
X-3.789 Y3.685 Z-0.187
X-4.99 Y4.853 Z0.129
X-6.191 Y6.021 Z0.276
G52 X-8.491 Y5.558 Z8.961
X-8.669 Y5.752 Z8.986
X-8.847 Y5.95 Z9.007
X-9.026 Y6.153 Z9.021
X-6.191 Y6.021 Z0.276
X-6.389 Y6.213 Z0.3
X-6.586 Y6.406 Z0.319
X-6.784 Y6.598 Z0.332
G52 X-9.026 Y6.153 Z9.021
X-9.721 Y6.941 Z9.077
X-10.43 Y7.796 Z9.039
X-11.211 Y8.739 Z8.805
X-6.784 Y6.598 Z0.332
X-7.552 Y7.345 Z0.383
X-8.32 Y8.092 Z0.338
X-9.088 Y8.838 Z0.092
"""


def slowest(cut: Segment, built: Machine) -> float:
    """The least speed (mm/s) that the joints' limits allow along a cut."""
    s = np.linspace(0.0, cut.motion.end, 401)
    found = FeedCourse((cut,), built, kinematics_of(built)).derivatives(s)
    return float(JointLimits.of(built).path_speed(found).min())


def test_the_longer_side_of_a_joint_takes_more_of_what_it_differs_by() -> None:
    """A block of 0.8 mm between two of 5 mm: a half of it on its few tenths took 0.6 of the feed."""
    built = replace(machine_file.load("fig4d"), tools=(Tool(1, "end mill", 1.0, 0.0, 30.0),))
    axes = [
        replace(
            a, limits=replace(a.limits, acceleration=0.57 * a.limits.acceleration, jerk=0.213 * a.limits.jerk)
        )
        for a in built.axes
    ]
    built = replace(built, axes=tuple(axes))
    traced = trace("G21 G90 G54\nT1 M6\n" + SHORT_BETWEEN_LONG, built)
    cuts = named(traced, "cut")
    assert len(cuts) == 3 and all(isinstance(cut.motion.surface, Blended) for cut in cuts)
    bare = [replace(cut, motion=replace(cut.motion, surface=cut.motion.surface.base)) for cut in cuts]
    feed = cuts[0].feed_mm_s
    assert min(slowest(cut, built) for cut in bare) > feed
    assert min(slowest(cut, built) for cut in cuts) > 0.8 * feed
