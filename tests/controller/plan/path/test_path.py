"""Whole programs as paths: the paper's two parts, joining, branch and turns, refusals."""

from __future__ import annotations

import math
import random
from dataclasses import replace

import pytest
from support.machines.shipped_kinds import random_machine
from support.machines.stepped_runs import program
from support.machines.traced_programs import assert_whole, mill, named, names, segments, sentences, trace

from controller.geometry.vectors import Frame
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine
from controller.plan.segment import ContinuousPath, Pause
from controller.program.program import Act, ProgramError

CONE = "G51 X0. Y15. Z0. I0. J0. K0. H10. R10. D{} F100.\n"


def ruled(upper: str, lower: str, feed: str = "F100.") -> str:
    """A G52 from two rows of four points "x y z, x y z, ..."."""
    rows = [row.split() for row in (upper + "," + lower).split(",")]
    first, *rest = (f"X{float(x)} Y{float(y)} Z{float(z)}" for x, y, z in rows)
    return "\n".join([f"G52 {first} {feed}", *rest]) + "\n"


def flat(ax: float, ay: float, bx: float, by: float, top: str = "0 0") -> str:
    """A straight wall from a to b, 10 mm high, its ruling leaning by ``top``."""
    dx, dy = (float(v) for v in top.split())
    points = [(ax + (bx - ax) * k / 3.0, ay + (by - ay) * k / 3.0) for k in range(4)]
    lower = ", ".join(f"{x} {y} 0" for x, y in points)
    upper = ", ".join(f"{x + dx} {y + dy} 10" for x, y in points)
    return ruled(upper, lower)


def with_travel(built: Machine, index: int, low: float, high: float) -> Machine:
    """The machine with another travel of one axis, mm or degrees."""
    axes, k = list(built.axes), math.radians(1.0) if built.axes[index].is_rotary else 1.0
    axes[index] = replace(axes[index], travel_min=low * k, travel_max=high * k)
    return replace(built, axes=tuple(axes))


def turned_part(built: Machine, degrees: float) -> Machine:
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    frame = Frame(built.offsets[0].origin, (c, s, 0.0), (-s, c, 0.0))
    return replace(built, offsets=(frame, *built.offsets[1:]))


# ---- the paper's parts -------------------------------------------------------------


def test_example_1_is_one_cut_of_94_2478_mm_between_approach_and_departure() -> None:
    built = mill(gouge="warn")
    traced = trace(program("example1"), built)
    assert names(traced) == [
        ["position"],
        ["down"],
        ["plunge"],
        ["lead in", "cut", "lead out"],
        ["lift"],
        ["retract"],
    ]
    (cut,) = named(traced, "cut")
    assert round(cut.motion.end, 4) == 94.2478
    assert cut.feed_mm_s == pytest.approx(1000.0 / 60.0)
    assert_whole(traced, built)


def test_the_two_surfaces_of_example_2_run_through_in_one_chain() -> None:
    built = mill(gouge="warn")
    traced = trace(program("example2"), built)
    cuts = named(traced, "cut")
    assert [round(c.motion.end, 4) for c in cuts] == [50.5115, 36.7618]
    assert any(
        [s.name for s in item.segments].count("cut") == 2
        for item in traced.items
        if isinstance(item, ContinuousPath)
    )
    assert "Joins the block of line 1" in sentences(traced)
    assert_whole(traced, built)


def test_the_verbatim_example_2_is_warned_of_its_leads_and_refused_without_the_warning() -> None:
    assert "lead in" in sentences(trace(program("example2"), mill(gouge="warn")))
    with pytest.raises(ProgramError, match=r'the lead in of 3.000 mm would cut .* gouge = "warn"'):
        trace(program("example2"), mill())


def test_the_ready_example_2_passes_every_audit() -> None:
    built = mill()
    traced = trace(program("example2_ready"), built)
    assert "Gouge" not in sentences(traced)
    assert "cut rests at that ruling" not in sentences(traced)
    acts = [item.act for item in traced.items if isinstance(item, Pause)]
    assert acts[-1] is Act.END
    assert_whole(traced, built)


@pytest.mark.parametrize("degrees", [0.0, 37.0])
def test_example_2_begins_and_ends_at_the_limits_of_c_from_inside(degrees: float) -> None:
    built = turned_part(mill(gouge="warn"), degrees)
    traced = trace(program("example2"), built)
    first, last = named(traced, "cut")
    # Turning the part by +d about Z is undone by C - d.
    assert math.degrees(first.start[4]) == pytest.approx(-degrees, abs=1e-4)
    assert math.degrees(last.end[4]) == pytest.approx(92.0826 - degrees, abs=1e-4)
    assert_whole(traced, built)


@pytest.mark.parametrize("kind", ["fig4a", "fig4b", "fig4c", "fig4d", "table_head", "head_head", "oblique"])
def test_both_parts_run_on_every_kind_of_machine(kind: str) -> None:
    built = with_travel(mill(kind, gouge="warn"), 3, -400.0, 400.0)
    for name in ("example1", "example2"):
        assert_whole(trace(program(name), built), built)


def test_random_machines_follow_a_cone_or_say_why_not() -> None:
    seed = 20240607
    rng = random.Random(seed)
    for _ in range(12):
        built = replace(random_machine(rng), gouge="warn")
        try:
            traced = trace(program("example1"), built)
        except ProgramError as error:
            assert "would reach" in error.sentence or "rotary axes" in error.sentence, seed
            continue
        assert_whole(traced, built)


# ---- joining -----------------------------------------------------------------------


def test_a_convex_corner_is_pivoted_about_the_shared_ruling() -> None:
    # The cutter is on the right: a turn to the left goes round the outside.
    built = mill()
    traced = trace(flat(0, 0, 30, 0) + flat(30, 0, 30, 30), built)
    assert ["lead in", "cut", "pivot", "cut", "lead out"] in names(traced)
    (pivot,) = named(traced, "pivot")
    assert pivot.motion.end == pytest.approx(3.0 * math.pi / 2.0)
    x, y = pivot.motion.joints(pivot.motion.end / 2.0, (0.0, 0.0), kinematics_of(built))[:2]  # type: ignore[index]
    origin = built.offsets[0].origin
    assert (x - origin[0], y - origin[1]) == pytest.approx((30 + 3 / math.sqrt(2), -3 / math.sqrt(2)))
    assert "Pivots by 90.0000 degrees" in sentences(traced)
    assert_whole(traced, built)


def test_a_pivot_on_a_leaning_ruling_keeps_the_contact() -> None:
    built = mill()
    corner = flat(0, 0, 30, 0, top="2 1") + flat(30, 0, 30, 30, top="2 1")
    traced = trace(corner, built)
    assert len(named(traced, "pivot")) == 1
    assert_whole(traced, built)


def test_a_concave_corner_is_refused_and_cut_on_the_other_side() -> None:
    corner = flat(0, 0, 30, 0) + flat(30, 0, 30, -30)
    with pytest.raises(ProgramError, match=r"part.ngc:9:1: .*line 1 in a concave corner of 90.0000 degrees"):
        trace(corner)
    assert len(named(trace("G41\n" + corner), "pivot")) == 1


def test_a_corner_of_rounding_is_no_concave_corner() -> None:
    corner = flat(0, 0, 30, 0) + flat(30, 0, 60, -0.01)
    assert "Joins the block of line 1 within the joint tolerance" in sentences(trace(corner))
    assert len(named(trace("G61\n" + corner), "pivot")) == 1


def test_blocks_apart_get_a_departure_and_an_approach_of_their_own() -> None:
    built = mill()
    traced = trace(flat(0, 0, 30, 0) + flat(0, 40, 30, 40), built)
    assert len(named(traced, "lead in")) == len(named(traced, "lift")) == 2
    assert "Departs from the block of line 1" in sentences(traced)
    assert_whole(traced, built)


def test_another_side_does_not_join() -> None:
    traced = trace(flat(0, 0, 30, 0) + "G41\n" + flat(30, 0, 60, 0))
    assert "another side" in sentences(traced)


def test_blocks_with_anything_between_them_do_not_join() -> None:
    traced = trace(flat(0, 0, 30, 0) + "G4 P1\n" + flat(30, 0, 60, 0))
    kinds = [type(item).__name__ for item in traced.items]
    assert len(named(traced, "lift")) == 2
    assert "Pause" in kinds


def test_at_a_pole_between_two_blocks_the_rotary_turns_under_the_standing_tool() -> None:
    # The first wall rights itself about Y, the second leans away about X: C has to turn.
    built = mill()
    lower = "0 0 0, 10 0 0, 20 0 0, 30 0 0"
    rights = ruled("4 0 10, 12 0 10, 21 0 10, 30 0 10", lower)
    lower = "30 0 0, 40 0 0, 50 0 0, 60 0 0"
    leans = ruled("30 0 10, 40 1 10, 50 2 10, 60 3 10", lower)
    traced = trace(rights + leans, built)
    (swivel,) = named(traced, "swivel")
    assert abs(swivel.end[4] - swivel.start[4]) == pytest.approx(math.pi / 2.0, abs=1e-6)
    assert ["swivel"] in names(traced)
    assert_whole(traced, built)


# ---- branch and turns --------------------------------------------------------------


def test_the_branch_of_least_rotary_travel_with_its_approach_is_taken() -> None:
    built = mill(gouge="warn")
    near = trace(program("example1"), built)
    assert math.degrees(named(near, "cut")[0].start[3]) == pytest.approx(-26.565, abs=1e-3)
    start = (0.0, 0.0, 200.0, 0.5, math.radians(190.0))
    other = trace(program("example1"), built, start)
    assert math.degrees(named(other, "cut")[0].start[3]) == pytest.approx(26.565, abs=1e-3)
    assert math.degrees(named(other, "cut")[0].start[4]) == pytest.approx(180.0, abs=1e-6)


def test_equal_travel_is_decided_for_positive_tilt() -> None:
    # A ruling leaning along X: C = +90 with A < 0 or C = -90 with A > 0 are equally far.
    traced = trace(flat(0, 0, 0, 30, top="2 0"))
    assert named(traced, "cut")[0].start[3] > 0.0


def test_branch_and_turns_are_chosen_so_that_the_whole_block_stays_in_travel() -> None:
    # C runs 0 .. -270 or, on the other branch, 180 .. -90: only that fits, though it is farther.
    built = with_travel(mill(), 4, -100.0, 300.0)
    traced = trace(CONE.format("270."), built)
    (cut,) = named(traced, "cut")
    assert math.degrees(cut.start[4]) == pytest.approx(180.0)
    assert math.degrees(cut.end[4]) == pytest.approx(-90.0)
    assert_whole(traced, built)


def test_a_block_longer_than_the_travel_of_a_rotary_is_refused() -> None:
    with pytest.raises(ProgramError, match=r"C would reach .* at u = 1.0000"):
        trace(CONE.format("360."), with_travel(mill(), 4, -100.0, 100.0))


def test_many_turns_are_followed_without_a_bound() -> None:
    built = mill()
    traced = trace(CONE.format("1800."), built)
    (cut,) = named(traced, "cut")
    assert cut.end[4] - cut.start[4] == pytest.approx(-10.0 * math.pi)
    assert_whole(traced, built)


def test_a_cylinder_leaves_the_free_rotary_where_it_is() -> None:
    built = mill()
    start = (0.0, 0.0, 200.0, 0.0, 1.25)
    traced = trace("G51 X0. Y15. Z0. I0. J0. K0. H10. R15. D360. F100.\n", built, start)
    assert {s.start[4] for s in segments(traced)} == {1.25}
    assert_whole(traced, built, start)


def test_a_block_through_the_pole_goes_on_with_the_other_branch() -> None:
    built = mill()
    traced = trace(ruled("-4 0 10, 9 0 10, 21 0 10, 34 0 10", "0 0 0, 10 0 0, 20 0 0, 30 0 0"), built)
    (cut,) = named(traced, "cut")
    assert cut.start[3] * cut.end[3] < 0.0
    assert cut.start[4] == pytest.approx(cut.end[4])
    assert_whole(traced, built)


def test_a_block_past_the_pole_swings_the_rotary_half_a_turn() -> None:
    built = mill()
    traced = trace(ruled("-4 .01 10, 9 .01 10, 21 .01 10, 34 .01 10", "0 0 0, 10 0 0, 20 0 0, 30 0 0"), built)
    (cut,) = named(traced, "cut")
    assert cut.start[3] == pytest.approx(cut.end[3])
    assert abs(cut.start[4] - cut.end[4]) == pytest.approx(math.pi, abs=0.01)


# ---- chains ------------------------------------------------------------------------


def test_g1_lines_in_one_direction_run_through_and_corners_stop() -> None:
    traced = trace("G55\nG1 X10. F600.\nX20.\nX30. Y10.\nG0 X0.\n")
    assert names(traced) == [["line", "line"], ["line"], ["line"]]


def test_rotaries_out_of_proportion_stop() -> None:
    assert names(trace("G55 G91\nG1 X10. C10. F600.\nX10. C10.\nX10. C20.\n")) == [["line", "line"], ["line"]]


def test_a_line_runs_through_into_a_tangent_arc() -> None:
    assert names(trace("G55\nG1 X10. F600.\nG3 X20. Y10. J10.\nG1 Y20.\n")) == [["line", "arc", "line"]]


def test_actions_and_dwells_come_at_rest_in_their_order() -> None:
    traced = trace("G1 X10. F600.\nG4 P0.5\nX20.\nM30\n")
    kinds = [item.seconds or item.act if isinstance(item, Pause) else "chain" for item in traced.items]
    assert kinds == ["chain", 0.5, "chain", Act.END]


def test_g64_without_p_is_noted_once() -> None:
    traced = trace("G64\nG1 X10. F600.\nX20. Y5.\n")
    assert sentences(traced).count("G64 without P blends") == 1


# ---- refusals ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (ruled("0 0 0, 1 0 0, 2 0 0, 3 0 0", "0 0 0, 1 0 0, 2 0 0, 3 0 0"), "directrix coincide"),
        (ruled("-5 0 10, -2 0 5, 2 0 -5, 5 0 -10", "-5 0 -10, -2 0 -5, 2 0 5, 5 0 10"), "G52: the .* u = "),
        (ruled("0 0 0, 1 0 3, 2 0 6, 3 0 9", "0 0 0, 1 0 0, 2 0 0, 3 0 0"), "no length"),
        (ruled("0 0 10, 3 0 10, 6 0 10, 9 0 10", "9 0 0, 6 0 0, 3 0 0, 0 0 0"), "folds"),
        (
            "G41\n" + "G51 X2. Y0. Z0. I0. J0. K0. H10. R10. D90. F100.\n",
            "radius 3.000 mm does not fit into the hollow",
        ),
        ("G55 G3 X10. Y0. I4. F100.\n", "begins 4.0000 mm from its centre and ends 6.0000 mm"),
        ("G55 G2 X10. R4. F100.\n", "cannot reach an end 10.0000 mm away"),
    ],
)
def test_a_block_that_cannot_be_cut_is_refused_with_its_place_and_reason(text: str, sentence: str) -> None:
    with pytest.raises(ProgramError, match=sentence) as refused:
        trace(text)
    assert refused.value.line == (2 if text.startswith("G41") else 1)


def test_a_gouge_is_only_noted_where_the_machine_file_says_warn() -> None:
    text = "G41\nG51 X2. Y0. Z0. I0. J0. K0. H10. R10. D90. F100.\n"
    assert "does not fit" in sentences(trace(text, mill(gouge="warn", lead_mm=0.0)))


def test_a_surface_outside_of_travel_names_axis_place_and_excess() -> None:
    with pytest.raises(
        ProgramError, match=r"X would reach .* mm at u = .* \(part X .* Y .* Z .* mm\)"
    ) as refused:
        trace(flat(0, 0, 2000, 0))
    assert refused.value.sentence.startswith("X would reach 2008.000 mm at u = 1.0000")
    assert "1008.000 mm beyond its travel of -1000.000 to 1000.000 mm" in refused.value.sentence


def test_a_tilt_beyond_the_travel_is_refused_in_degrees() -> None:
    with pytest.raises(ProgramError, match=r"A would reach -?26.565 deg at u = "):
        trace(CONE.format("90."), with_travel(mill(), 3, -5.0, 5.0))


def test_an_arc_bulging_out_of_travel_is_refused() -> None:
    with pytest.raises(ProgramError, match=r"Y would reach .* in the arc"):
        trace("G53 G0 X0. Y990.\nG91\nG2 X40. R20. F100.\n")


def test_a_move_out_of_travel_is_refused() -> None:
    with pytest.raises(ProgramError, match=r"part.ngc:2:\d+: Z would reach -1880.000 mm, 880.000 mm beyond"):
        trace("G0 X0.\nG1 Z-2000. F100.\n")
