"""G40 to G42 with D, G41.1 and G42.1: the cutter beside lines and arcs, and what is refused."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from support.machines.interrupted_runs import rest_of
from support.machines.traced_programs import mill, segments

from controller.machine import machine_file
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine
from controller.plan.path import path
from controller.plan.restart.program_position import Spot
from controller.plan.rotaries.branch import joints_along
from controller.program import blocks
from controller.program.position import homed
from controller.program.program import (
    Action,
    Block,
    CutBlock,
    CutRuled,
    JointArc,
    JointLine,
    ProgramError,
    Remark,
)

R = 2.0
SURFACE = (
    "G52 X0. Y0. Z10. F100.\n"
    + "X10. Y0. Z10.\nX20. Y0. Z10.\nX30. Y0. Z10.\n"
    + ("X0. Y0. Z0.\nX10. Y0. Z0.\nX20. Y0. Z0.\nX30. Y0. Z0.\n")
)


def bench(dialect: str = "rs274", **changes: object) -> Machine:
    made = mill()
    tools = tuple(replace(tool, radius_mm=r) for tool, r in zip(made.tools, (R, 5.0), strict=False))
    return replace(made, tools=tools, dialect=dialect, without_point="unit", **changes)


def read(text: str, on: Machine | None = None) -> tuple[Block, ...]:
    return blocks.read(text.replace(";", "\n").encode(), on or bench(), "p.ngc").blocks


def ends(text: str, on: Machine | None = None) -> list[tuple[str, tuple[float | None, ...]]]:
    """Kind and X Y Z of each motion, rounded to a picometre."""
    on, made = on or bench(), []
    for block in read(text, on):
        if isinstance(block, JointLine | JointArc):
            rapid = isinstance(block, JointLine) and block.feed_mm_s is None
            kind = "arc" if isinstance(block, JointArc) else "rapid" if rapid else "line"
            values = (block.targets[i] for i in on.linear())
            made.append((kind, tuple(None if v is None else round(v, 9) + 0.0 for v in values)))
    return made


def refusal(text: str, on: Machine | None = None) -> ProgramError:
    with pytest.raises(ProgramError) as refused:
        read(text, on)
    return refused.value


START = "G21 G90 F100;G0 X0 Y-20;"


def test_outside_corners_are_gone_round_and_inside_ones_cut_short() -> None:
    contour = START + "G41 D1 G1 X0 Y0;Y30;X30;Y50;G40 X10 Y60"
    assert ends(contour) == [
        ("rapid", (0.0, -20.0, None)),
        ("line", (-2.0, 0.0, None)),
        ("line", (-2.0, 30.0, None)),
        ("arc", (0.0, 32.0, None)),
        ("line", (28.0, 32.0, None)),
        ("line", (28.0, 50.0, None)),
        ("line", (10.0, 60.0, None)),
    ]
    around = next(block for block in read(contour) if isinstance(block, JointArc))
    assert around.clockwise and around.centre_mm == pytest.approx((2.0, 0.0))
    assert around.place.line == 5 and around.feed_mm_s == pytest.approx(100.0 / 60.0)


@pytest.mark.parametrize(
    "code", ["G41 D1", "G41", "G41 D0", "G41.1 D4", "G42.1 D-4", "G41.1 D4 L0", "G41 G61 D1"]
)
def test_the_radius_is_that_of_d_or_of_the_tool_in_the_spindle(code: str) -> None:
    assert ends(f"{START}{code};G1 X0 Y0;Y30")[1:] == [
        ("line", (-2.0, 0.0, None)),
        ("line", (-2.0, 30.0, None)),
    ]


def test_another_tool_and_inches() -> None:
    assert ends(f"{START}G42 D2 G1 X0 Y0;Y30")[1:] == [
        ("line", (5.0, 0.0, None)),
        ("line", (5.0, 30.0, None)),
    ]
    assert ends("G20 G90 F9;G0 X0 Y-2;G41.1 D0.2 G1 X0 Y0;Y3")[-1] == ("line", (-2.54, 76.2, None))


@pytest.mark.parametrize(("plane", "names", "order"), [("G18", "ZX", (2, 0)), ("G19", "YZ", (1, 2))])
def test_other_planes(plane: str, names: str, order: tuple[int, int]) -> None:
    a, b = names
    found = ends(f"G21 G90 F100 {plane};G0 {a}0 {b}-20;G41 D1 G1 {a}0 {b}0;{b}30;{a}30;G40 {b}50")
    assert [kind for kind, _ in found] == ["rapid", "line", "line", "arc", "line", "line"]
    assert [tuple(place[axis] for axis in order) for _, place in found[2:4]] == [(-2.0, 30.0), (0.0, 32.0)]


def test_distances_count_from_the_contour() -> None:
    absolute = ends(START + "G41 D1 G1 X0 Y0;Y30;X30;Y50;G40 X10 Y60")
    steps = ends(START + "G91;G41 D1 G1 Y20;Y30;X30;Y20;G40 X-20 Y10")
    assert steps == absolute


def test_full_circles_and_helices_keep_their_turns() -> None:
    text = START + "G41 D1 G1 X0 Y0;G3 X0 Y0 I-10 J0 Z-3 P2;G40 G1 X-10"
    arc = next(block for block in read(text) if isinstance(block, JointArc))
    assert arc.turns == 2 and arc.centre_mm == pytest.approx((-8.0, 0.0)) and arc.targets[2] == -3.0


def test_what_stands_between_two_moves_is_done_in_their_corner() -> None:
    made = read(START + "G41 D1 G1 X0 Y0;Y30;M8;Z-5;X0 Y30 Z-6;X-30;G40 Y0")
    kinds = [type(block).__name__ for block in made]
    assert kinds == ["JointLine", "JointLine", "JointLine", "Action", *["JointLine"] * 4]
    assert ends(START + "G41 D1 G1 X0 Y0;Y30;M8;Z-5;X0 Y30 Z-6;X-30;G40 Y0")[2:6] == [
        ("line", (-2.0, 28.0, None)),
        ("line", (None, None, -5.0)),
        ("line", (-2.0, 28.0, -6.0)),
        ("line", (-30.0, 28.0, None)),
    ]


def test_the_tool_comes_down_before_the_lead_in_and_up_after_g40_where_it_stands() -> None:
    found = ends(START + "G41 D1;G0 Z-5;G1 X0 Y0;Y30;G40;G0 Z50;X9")
    assert found == [
        ("rapid", (0.0, -20.0, None)),
        ("rapid", (None, None, -5.0)),
        ("line", (-2.0, 0.0, None)),
        ("line", (-2.0, 30.0, None)),
        ("rapid", (None, None, 50.0)),
        ("rapid", (9.0, 30.0, None)),
    ]


def test_after_g40_every_kind_of_move_leads_to_its_own_end() -> None:
    beside = START + "G41 D1 G1 X0 Y0;Y30;G40;"
    assert ends(beside + "G91 G0 X5")[-1] == ("rapid", (5.0, 30.0, None))
    assert ends(beside + "G91 G0 X5 Z1")[-1][1][:2] == (5.0, 30.0)
    assert ends(beside + "G53 G0 X5")[-1] == ("rapid", (5.0, 126.0, None))  # G54: Y96
    assert ends(beside + "G91 G28 Z0;G90 G0 Y7")[-1] == ("rapid", (0.0, 7.0, None))
    assert isinstance(read(beside + SURFACE)[-1], CutRuled)


def test_rapids_go_round_a_corner_outside_of_it() -> None:
    found = ends(START + "G41 D1 G0 X0 Y0;G0 Y30;G0 X30;G40 Y50")
    assert found[2:5] == [
        ("rapid", (-2.0, 30.0, None)),
        ("rapid", (-2.0, 32.0, None)),
        ("rapid", (30.0, 32.0, None)),
    ]


def test_g93_keeps_the_time_of_each_line() -> None:
    made = read(START + "G41 D1 G93 G1 X0 Y0 F10;Y30 F10;X30 F6;G40 Y50 F1")
    line, arc, after = made[2:5]
    assert isinstance(line, JointLine) and line.time_s == pytest.approx(6.0)
    assert isinstance(arc, JointArc) and arc.time_s is None and arc.feed_mm_s == pytest.approx(3.0)
    assert isinstance(after, JointLine) and after.time_s == pytest.approx(10.0)


@pytest.mark.parametrize("digits", [3, 4])
def test_tangents_rounded_as_cam_systems_write_them_are_no_corners(digits: int) -> None:
    """Fillets in the corner of two walls, one of them of the cutter's own radius."""
    for radius in (R, R + 0.5, 7.3):
        a = math.radians(37.0)
        back = radius * math.tan(a / 2.0)
        x, y = 30.0 + back * math.cos(a), back * math.sin(a)
        number = f"{{:.{digits}f}}".format
        text = (
            f"{START}G41 D1 G1 X0 Y0;X{number(30 - back)};G3 X{number(x)} Y{number(y)} I0 J{number(radius)};"
        )
        text += f"G1 X{number(x + 30 * math.cos(a))} Y{number(y + 30 * math.sin(a))};G40 Y90"
        kinds = [kind for kind, _ in ends(text.replace("X0 Y-20", "X-20 Y0"))]
        assert "arc" not in kinds[:2] and 4 <= len(kinds) <= 6, text


# ---- which of the two meanings -------------------------------------------------------


def test_a_g41_that_does_not_say_is_for_what_comes_first() -> None:
    surface = read("G41;G0 X0 Y-20 Z20;" + SURFACE.replace("\n", ";") + "G40;G0 Z50")
    assert next(block.targets[0] for block in surface if isinstance(block, JointLine)) == 0.0
    assert all(block.modal.planar is None for block in surface)
    lines = ends("G21 F100;G0 X0 Y-20;G41;G0 X0 Y0;G1 Y30;G40;")
    assert lines[1:] == [("rapid", (-2.0, 0.0, None)), ("line", (-2.0, 30.0, None))]


def test_a_surface_program_is_read_as_it_was() -> None:
    """G41 with P, Q or R, or with a surface behind it: nothing is compensated, and nothing stays behind."""
    for code in ("G41", "G42", "G41 P2", "G42 Q0.1 R0.02"):
        made = read(f"G0 X1 Y1 Z60;{code};G0 X2 Y2;M8;{SURFACE};G0 X3;G40".replace("\n", ";"))
        rapids = [block.targets[0] for block in made if isinstance(block, JointLine)]
        assert rapids == [1.0, 2.0, 3.0] and sum(isinstance(block, CutBlock) for block in made) == 1
        assert [type(block).__name__ for block in made][1:3] == ["JointLine", "Action"]


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("G41 D1;" + SURFACE.replace("\n", ";"), 4, "G52 is a surface, and the G41 of line 3"),
        ("G41 P1;G1 X9", 4, "G1 runs under G41, which is for surfaces here"),
        (f"G41;{SURFACE};G1 X9 Z40".replace("\n", ";"), 13, "a surface came after it; write G40"),
        ("G41 D1 P1;G1 X9", 3, "D1 and P1 stand beside G41"),
        ("G41 D7;G1 X9", 3, "D7 names no tool"),
        ("G41 D-1;G1 X9", 3, "D-1 is not a count"),
        ("G41.1;G1 X9", 3, "G41.1 has no D"),
        ("G41.1 D3 L2;G1 X9", 3, "L2 is the edge of a turning tool"),
        ("G40 D1", 3, "no code on this line takes D1: G40 takes P Q R; D belongs to G51 G41 G42 G41.1 G42.1"),
        ("G43.4;G41 D1;G1 X9", 5, "G1 runs under G41 and tool-centre control"),
        ("G43.4;G41 D1;G0 X9", 5, "tool-centre control"),
    ],
)
def test_which_of_the_two_is_refused_where_it_does_not_fit(text: str, line: int, words: str) -> None:
    error = refusal(START + text)
    assert error.line == line and words in error.sentence


# ---- what the cutter cannot do -------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("G1 X0 Y-18.5;Y30", 4, "the first move is 1.5 mm long in the plane"),
        ("G1 X0 Y0;G3 X-3 Y0 I-1.5 J0", 5, "inside of an arc of radius 1.5000 mm"),
        ("G1 X0 Y0;Y30;X-3;Y0;G40 X-9", 6, "vanishes behind the cutter"),
        ("G1 X0 Y0;Y30;X-1;Y60;G40 X-9", 6, "the corner of lines 5 and 6 cannot be reached"),
        ("G1 X0 Y0;X10 Y1.5;X0 Y3", 6, "the corner of lines 5 and 6 cannot be reached"),
        ("G1 X0 Y0;Y30;G40;G2 X9 Y9 R20", 7, "the first move after G40 is an arc"),
        ("G1 X0 Y0;Y30;G18", 6, "G18 stands under the G41 of line 3"),
        ("G1 X0 Y0;Y30;G55", 6, "G55 stands under"),
        ("G1 X0 Y0;Y30;G43.1 Z5", 6, "G43.1 stands under"),
        ("G1 X0 Y0;Y30;G43.4", 6, "G43.4 stands under"),
        ("G1 X0 Y0;Y30;T2 M6", 6, "M6 stands under"),
        ("G1 X0 Y0;Y30;G92 X5", 6, "G92 stands under"),
        ("G1 X0 Y0;Y30;G10 L2 P1 X1", 6, "G10 stands under"),
        ("G1 X0 Y0;Y30;G68 R10", 6, "G68 stands under"),
        ("G1 X0 Y0;Y30;G28", 6, "G28 stands under"),
        ("G1 X0 Y0;Y30;G53 G0 X0", 6, "G53 stands under"),
        ("G1 X0 Y0;Y30;G81 X1 Z-5 R2", 6, "G81 stands under G41"),
        ("G1 X0 Y0;Y30;G42 D1", 6, "G42 stands under the G41 of line 3, which is on until G40"),
    ],
)
def test_what_does_not_go_is_refused_where_it_stands(text: str, line: int, words: str) -> None:
    error = refusal(START.replace("F100", "F100 M3 S100") + "G41 D1;" + text, bench(unset=()))
    assert (error.line, words in error.sentence) == (line, True), error


NECK = "G1 X0 Y0;X20;Y-10;X0 Y-30;X24 Y-50;X60 Y-30;X23 Y-10;Y0;X50;G40 Y20"


def test_a_neck_that_is_narrower_than_the_cutter_is_refused() -> None:
    text = "G21 G90 F100;G0 X-20 Y0;G41 D1;" + NECK
    error = refusal(text)
    assert error.line == 11 and "cuts into what line" in error.sentence
    wide = text.replace("X23", "X24.5").replace("X24 ", "X23 ")
    assert ends(wide)[-1] == ("line", (50.0, 20.0, None))
    told = [block for block in read(text, bench(gouge="warn")) if isinstance(block, Remark)]
    assert told and "leaves standing" in told[0].sentence


def test_a_contour_that_crosses_itself_is_meant_so() -> None:
    assert len(ends(START + "G41 D1 G1 X0 Y0;Y30;X30;Y10;X-30;G40 Y0")) > 6


@pytest.mark.parametrize("last", ["X0 Y15;X-10 Y21.25", "X-10 Y21.25", "X4 Y12.5;X1 Y14.5;X-1 Y15.5;X-9 Y16"])
def test_a_last_line_that_cuts_the_first_is_no_neck(last: str) -> None:
    """Also where a corner lies on the first line, and where it comes in short lines."""
    assert len(ends(START + "G41 D1 G1 X0 Y-10;Y50;X60;Y0;X20;" + last + ";G40 X-30")) > 6


def test_a_contour_that_touches_itself_and_turns_back_is_a_neck() -> None:
    text = START + "G41 D1 G1 X0 Y-30;Y50;X-60;Y15;X0;X-60 Y-10;G40 X-80"
    assert "narrower than the cutter" in refusal(text).sentence


def test_all_refusals_of_a_program_come_in_one_answer() -> None:
    text = START + "G41 D1 G1 X0 Y-19;Y30;G40 G0 X0 Y-20;G42 D1 G1 X0 Y0;G2 X1 Y0 I.5;G1 Y9;G40 X9;Q5"
    refused: list[ProgramError] = []
    list(blocks.stream(text.replace(";", "\n").encode(), bench(), "p.ngc", refused=refused))
    assert [error.line for error in refused] == [3, 7, 10]


def test_a_sub_is_blamed_with_who_called_it() -> None:
    text = "o1 sub;G1 X0 Y-19;o1 endsub;" + START + "G41 D1;o1 call"
    assert "called" in refusal(text).sentence and refusal(text).line == 2


# ---- the fanuc dialect ---------------------------------------------------------------


def test_a_lead_in_may_be_as_long_as_the_radius_and_no_shorter() -> None:
    text = "G20 G0 X{} Y0 F4;G41.1 D.125;G1 X0;G1 Y.5;G40"  # inches, as LinuxCNC's useful-subroutines.ngc
    assert ends(text.format("-.0625"))[1] == ends(text.format("-.1"))[1]
    with pytest.raises(ProgramError, match="not be shorter than the cutter's radius") as error:
        read(text.format("-.0624"))
    assert error.value.line == 3


def test_fanucs_lead_in_ends_beside_what_follows() -> None:
    found = ends("G21 G90 F100.;G0 X0. Y0.;G41 D1 G1 X10.;G3 I-10.;G40 G1 X0.", bench("fanuc"))
    assert found[1:] == [("line", (8.0, 0.0, None)), ("arc", (8.0, 0.0, None)), ("line", (0.0, 0.0, None))]


def test_fanucs_d_stays_and_g41_may_be_said_again() -> None:
    text = "G21 G90 F100.;G0 X0. Y-20. D2;G41 G1 X0. Y0.;G41 Y30.;G40 X-9."
    assert ends(text, bench("fanuc"))[1:3] == [("line", (-5.0, 0.0, None)), ("line", (-5.0, 30.0, None))]
    assert ends(text.replace("D2", "D0"), bench("fanuc"))[2] == ("line", (0.0, 30.0, None))
    assert ends(text.replace("G41 Y30", "G41 D2 Y30"), bench("fanuc")) == ends(text, bench("fanuc"))
    for other in ("G42 Y30", "G41 D1 Y30"):
        assert "which is on until G40" in refusal(text.replace("G41 Y30", other), bench("fanuc")).sentence


def test_nothing_is_held_without_bound() -> None:
    many = "G41 D1 G1 X0 Y0;" + "Z1;Z2;" * 600
    assert "more than 1000 lines move nothing in the plane" in refusal(START + many).sentence
    assert sum(isinstance(block, Action) for block in read("G41;" + "M8;" * 1200)) == 1200
    assert (
        "has no D, and more than 1000 lines" in refusal(START + "G41;" + "M8;" * 1200 + "G1 X0 Y0").sentence
    )
    surface = read("G41;" + "M8;" * 1200 + SURFACE.replace("\n", ";"))
    assert isinstance(surface[-1], CutRuled) and len(surface) == 1201


def test_a_g41_that_moves_nothing_leaves_the_way_home_as_it_was() -> None:
    beside = START + "G41 D1 G1 X0 Y0;Y30;G40;"
    assert ends(beside + "G41 D1;G40;G0 X9")[-1] == ("rapid", (9.0, 30.0, None))
    error = refusal(beside + "G18;G41 D1;G1 X9 Z9")
    assert error.line == 8 and "still stands beside a contour in G17" in error.sentence


# ---- a whole program -----------------------------------------------------------------


@pytest.mark.parametrize("dialect", ["rs274", "fanuc"])
def test_the_shipped_contour_keeps_its_distance_from_the_plate_on_the_machine(dialect: str) -> None:
    """Traced as it runs: 1.5 mm from the plate's edge all around, and on the edge's outside."""
    on = replace(machine_file.load("trunnion"), dialect=dialect)
    read = blocks.read(machine_file.shipped_program("contour").read_bytes(), on, "contour.ngc")
    traced = path.trace(read, on, kinematics_of(on), homed(on))
    frame, kinematics, away = on.offsets[0], kinematics_of(on), []
    for segment in segments(traced):
        if segment.feed_mm_s is not None and 11 <= segment.place.line <= 24:
            joints = joints_along(segment, np.linspace(0.0, segment.motion.end, 50), kinematics)
            for row in joints:
                x, y, _ = frame.from_parent((row[0], row[1], row[2]))
                away.append(_PLATE.exterior.distance(shapely.Point(x, y)))
                assert not _PLATE.contains(shapely.Point(x, y))
    assert len(away) > 600 and max(abs(d - 1.5) for d in away) < 1e-3


def _plate() -> shapely.Polygon:
    whole = shapely.box(6.0, 6.0, 54.0, 34.0).buffer(6.0, quad_segs=720)
    slot = shapely.box(40.0, 14.0, 70.0, 26.0).union(shapely.Point(40.0, 20.0).buffer(6.0, quad_segs=720))
    return whole.difference(slot)


_PLATE = _plate()


@pytest.mark.parametrize(("line", "at"), [(13, (30.0, 41.5)), (17, None), (23, None)])
def test_a_restart_enters_beside_the_contour(line: int, at: tuple[float, float] | None) -> None:
    on = machine_file.load("trunnion")
    text = machine_file.shipped_program("contour").read_text(encoding="utf-8")
    rest = rest_of(text, Spot(line, 0.5), on)
    x, y, _ = on.offsets[0].from_parent((rest.target.joints[0], rest.target.joints[1], rest.target.joints[2]))
    assert _PLATE.exterior.distance(shapely.Point(x, y)) == pytest.approx(1.5, abs=1e-4)
    assert at is None or (x, y) == pytest.approx(at)
