"""Another tool than the one that has cut a program up to a place: which are refused, in a sentence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.machines.interrupted_runs import LINES, rest_of, with_tool
from support.machines.stepped_runs import shipped

from controller.machine import tool_profile
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Joints, Tool
from controller.plan.restart import other_tool
from controller.plan.restart.program_position import Spot
from controller.plan.restart.reentry import NotPossible, along_axis
from controller.plan.restart.restart import Rest

HELD = (10.0, 60.0, 100.0, 0.3, 0.4)


def rest(text: str, line: int = 4, **tool: float) -> Rest:
    return rest_of(text, Spot(line, 0.5), with_tool(shipped(), 2, **tool))


def test_a_tool_that_is_longer_than_it_stands_off_is_refused() -> None:
    machine = shipped()
    before, left = machine.tool(2), rest(LINES.replace("S8000", "G43 H2 S8000"), 4, length_mm=5.0)
    after = with_tool(machine, 2, length_mm=5.0).tool(2)
    assert before is not None and after is not None
    with pytest.raises(NotPossible, match="retract by more"):
        other_tool.see_fits(HELD, HELD, before, after, left)
    other_tool.see_fits(along_axis(HELD, 5.1, kinematics_of(machine)), HELD, before, after, left)


def test_a_thicker_tool_is_refused_on_lines_that_are_not_compensated_for_it() -> None:
    machine = shipped()
    before = machine.tool(2)
    thick, thin = (with_tool(machine, 2, radius_mm=r).tool(2) for r in (2.0, 1.0))
    assert before is not None and thick is not None and thin is not None
    left = rest(LINES, 5)
    held = left.target.joints
    with pytest.raises(NotPossible, match=r"0\.500 mm thicker .* line 5 .* at most 1\.500 mm"):
        other_tool.see_fits(held, held, before, thick, left)
    other_tool.see_fits(held, held, before, thin, left)


def test_a_thicker_tool_must_stand_above_what_compensated_lines_have_left() -> None:
    machine = shipped()
    before, thick = machine.tool(2), with_tool(machine, 2, radius_mm=2.0).tool(2)
    assert before is not None and thick is not None
    text = "G21 G90 G54 T2 M6\nG0 X0 Y-5 Z40\nG1 Z20 F900\nG41 D2 G1 X0 Y0\nX30\nG40 Y-5\nG0 Z40\nM30\n"
    left = rest(text, 5)
    held, kinematics = left.target.joints, kinematics_of(machine)
    with pytest.raises(NotPossible, match=r"stands 8\.000 mm lower"):
        other_tool.see_fits(along_axis(held, 12.0, kinematics), held, before, thick, left)
    other_tool.see_fits(along_axis(held, 20.1, kinematics), held, before, thick, left)


def tool(**size: object) -> Tool:
    found = with_tool(shipped(), 2).tool(2)
    assert found is not None
    return replace(found, **size)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "one",
    [
        tool(),
        tool(corner_mm=0.5),
        tool(corner_mm=1.5),
        tool(taper_rad=0.1),
        tool(corner_mm=1.0, taper_rad=0.2),
        tool(holder=((15.0, 20.0, 1.0), (20.0, 40.0, 9.0))),
    ],
)
def test_a_tool_is_as_thick_at_a_height_as_its_body_is(one: Tool) -> None:
    heights = np.arange(0.05, 30.0, 0.37)
    radii = other_tool.radii(one, heights)
    for off, inside in ((-1e-3, True), (1e-3, False)):
        out = np.min([b.distance(radii + off, heights) for b in tool_profile.whole(one, 50.0)], axis=0)
        assert ((out < 0.0) == inside).all()


def above(left: Rest) -> Joints:
    return along_axis(left.target.joints, 100.0, left.source.kinematics)


G41 = """G21 G90 G54 T2 M6
G43 H2
G0 X-14 Y12 Z40
G1 Z20 F900
G41 D2 G1 X-8 Y0
X30
G40 X40 Y12
G1 Z40
M30
"""
WIDE = ((10.0, 30.0, 8.0),)


@pytest.mark.parametrize(
    ("size", "words"),
    [
        ({"radius_mm": 1.5}, ""),
        ({"radius_mm": 1.505}, ""),
        ({"radius_mm": 1.0, "length_mm": 7.0}, ""),
        ({"radius_mm": 1.5, "corner_mm": 1.0}, ""),
        ({"radius_mm": 2.5}, ""),  # its path is another
        ({"radius_mm": 1.5, "taper_rad": 0.1}, r"1\.505 mm further out .* line 6.*same corner and taper"),
        ({"radius_mm": 1.0, "holder": ((30.0, 50.0, 20.0),)}, ""),
        (
            {"radius_mm": 1.0, "flute_mm": 9.0, "holder": WIDE},
            r"holder .* 7\.000 mm wider .* from 10\.000 mm",
        ),
    ],
)
def test_along_compensated_lines_the_shape_of_a_tool_counts(size: dict[str, object], words: str) -> None:
    after = tool(**size)
    left = rest(G41, 6, **size)  # type: ignore[arg-type]
    if not words:
        other_tool.see_cuts_no_deeper(tool(), after, left, above(left))
        return
    with pytest.raises(NotPossible, match=words):
        other_tool.see_cuts_no_deeper(tool(), after, left, above(left))


@pytest.mark.parametrize(
    ("lines", "line"),
    [
        ("G1 X40 Y3", 8),
        ("G1 Z2", 8),  # a hole
        ("G0 X50\nG1 Z2\nG0 Z60", 9),
        ("G2 X40 Y5 I5 J0", 8),
        ("G43.4 H2\nG1 X40 Y3 Z20 A5 C3", 9),
        (
            "G0 X60 Y-30\nG1 Z2\nG41 D2 X52 Y-20\nX30\nG40 X20 Y-30\nG1 Z60",
            0,
        ),  # down beside a compensated line
        ("G53 G0 Z200\nT1 M6\nG1 X40 F100", 0),  # another tool
    ],
)
def test_the_first_line_that_a_thicker_tool_would_cut_deeper_is_named(lines: str, line: int) -> None:
    text = G41.replace("G40 X40 Y12\nG1 Z40\n", f"G40 X40 Y12\n{lines}\n")
    left = rest(text, 6, radius_mm=2.5)
    if not line:
        other_tool.see_cuts_no_deeper(tool(), tool(radius_mm=2.5), left, above(left))
        return
    with pytest.raises(NotPossible, match=rf"1\.000 mm thicker .* line {line} .* at most 1\.500 mm"):
        other_tool.see_cuts_no_deeper(tool(), tool(radius_mm=2.5), left, above(left))


@pytest.mark.parametrize("code", ["", "G43 H2\n"])
def test_a_longer_tool_is_refused_where_the_lines_do_not_follow_its_length(code: str) -> None:
    left = rest("G21 G90 G54 T2 M6\n" + (code or "G49\n") + "G1 X0 Y0 Z20 F900\nX30\nM30\n", 4, length_mm=5.0)
    after = tool(length_mm=5.0)
    if code:
        other_tool.see_cuts_no_deeper(tool(), after, left, above(left))
        return
    with pytest.raises(NotPossible, match=r"5\.000 mm longer .* line 4 .* at most 0\.000 mm, or program G43"):
        other_tool.see_cuts_no_deeper(tool(), after, left, above(left))


def test_a_ball_is_not_followed_by_a_flat_end_along_lines() -> None:
    left = rest(LINES, 5)
    with pytest.raises(NotPossible, match=r"1\.500 mm further out .* from 0\.000 mm above the tip .* line 5"):
        other_tool.see_cuts_no_deeper(tool(corner_mm=1.5), tool(), left, above(left))
    other_tool.see_cuts_no_deeper(tool(), tool(corner_mm=1.5), left, above(left))


def beside(*lines: tuple[float, float, float]) -> str:
    """Straight walls under G41, each (y, from x, to x), down to Z0 and from above again."""
    text = "G21 G90 G54 T2 M6\nG43 H2\n"
    for y, begin, end in lines:
        on = 1.0 if end > begin else -1.0
        text += f"G0 X{begin - 20 * on} Y{y + 6 * on} Z40\nG1 Z0 F900\nG41 D2 G1 X{begin - 9 * on} Y{y}\n"
        text += f"X{end}\nG40\nG0 Z40\n"
    return text + "M30\n"


@pytest.mark.parametrize(
    ("walls", "radius_mm", "deep"),
    [
        (((0.0, 0.0, 30.0), (4.0, 30.0, 0.0)), 1.9, ""),
        (
            ((0.0, 0.0, 30.0), (4.0, 30.0, 0.0)),
            2.5,
            r"1\.000 mm deeper than the one before along line (6|12)",
        ),
        (((2.0, 0.0, 30.0), (0.0, 0.0, 30.0)), 2.5, ""),  # the second takes what the first leaves
        (((0.0, 0.0, 30.0), (9.0, 30.0, 0.0)), 4.4, ""),
    ],
)
def test_a_thicker_tool_beside_its_own_contour_is_kept_off_those_of_others(
    walls: tuple[tuple[float, float, float], ...], radius_mm: float, deep: str
) -> None:
    left = rest(beside(*walls), 6, radius_mm=radius_mm)
    if not deep:
        other_tool.see_cuts_no_deeper(tool(), tool(radius_mm=radius_mm), left, above(left))
        return
    with pytest.raises(NotPossible, match=deep):
        other_tool.see_cuts_no_deeper(tool(), tool(radius_mm=radius_mm), left, above(left))


@pytest.mark.parametrize(
    ("up_mm", "aside_mm", "refused"), [(5.0, -1.0, True), (21.0, -1.0, False), (5.0, 0.0, False)]
)
def test_a_thicker_tool_does_not_start_where_it_may_stand_in_the_wall_of_a_contour(
    up_mm: float, aside_mm: float, refused: bool
) -> None:
    left = rest(G41, 6, radius_mm=2.5)
    x, *others = along_axis(left.target.joints, up_mm, left.source.kinematics)
    now = (x, others[0] + aside_mm, *others[1:])
    after = tool(radius_mm=2.5)
    if refused:
        words = r"stands where it may be (0\.99\d|1\.000) mm in the wall that line [56]"
        with pytest.raises(NotPossible, match=words):
            other_tool.see_cuts_no_deeper(tool(), after, left, now)
    else:
        other_tool.see_cuts_no_deeper(tool(), after, left, now)
