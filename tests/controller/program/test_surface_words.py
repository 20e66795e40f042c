"""G51 and G52 that hardly mean what they say: half their words in another unit, or upside down."""

from __future__ import annotations

import pytest
from support.machines.stepped_runs import shipped

from controller.machine.setup_data import with_offset
from controller.messages import text
from controller.program import blocks
from controller.program.program import CutCone, CutRuled, ProgramError
from controller.runtime import checked

MACHINE = shipped()
CONE = "G51 X{0} Y0 Z0 I0 J0 K0 H{1} R{2} D{3} F800.\n"
FLAT = [(0, 0, 10), (5, 0, 10), (10, 0, 10), (15, 0, 10), (0, 1, 0), (5, 1, 0), (10, 1, 0), (15, 1, 0)]


def ruled(points: list[tuple[float, ...]], form: str = "{:.3f}") -> str:
    lines = [" ".join(f"{a}{form.format(v)}" for a, v in zip("XYZ", p, strict=True)) for p in points]
    return "G52 F800. " + "\n".join(lines) + "\n"


def doubt(program: str) -> str:
    (block,) = blocks.read(f"G21 G90\n{program}".encode(), MACHINE, "part.ngc").blocks
    assert isinstance(block, CutCone | CutRuled)
    return text(block.doubt)


def test_words_of_one_kind_are_not_doubted() -> None:
    assert doubt(CONE.format("15.", "10.", "5.", "90")) == ""
    assert doubt(CONE.format("1500", "1000", "500", "90000")) == ""
    assert doubt(ruled(FLAT)) == ""
    assert doubt(ruled([tuple(100 * v for v in p) for p in FLAT], "{:.0f}")) == ""


@pytest.mark.parametrize(
    "text",
    [CONE.format("1500", "10.", "5.", "90."), ruled(FLAT).replace("X15.000 Y0.000", "X1500 Y0.000")],
)
def test_words_of_both_kinds_are(text: str) -> None:
    assert "mixes words" in doubt(text) and "1500 is 15 mm" in doubt(text)


def test_a_feed_without_a_point_beside_lengths_with_points_is_told_in_mm_a_minute() -> None:
    for program, code in ((CONE.format("15.", "10.", "5.", "90."), "G51"), (ruled(FLAT), "G52")):
        assert doubt(program.replace("F800.", "F800")).startswith(f"{code}: F800 is 8 mm/min, for without")
    assert doubt(CONE.format("1500", "1000", "500", "90000").replace("F800.", "F80000")) == ""


WALL = [(0, 0, 20), (10, 0, 20), (20, 0, 20), (30, 0, 20), (0, 1, 0), (10, 1, 0), (20, 1, 0), (30, 1, 0)]


def test_a_cut_of_hundredths_is_told_with_its_feed() -> None:
    said = doubt(CONE.format("15", "10", "5", "90"))
    assert said.startswith("G51 cuts 0.00024 mm at 800 mm/min: X15 is 0.15 mm")
    assert doubt(CONE.format("0.15", "0.1", "0.05", "0.09")) == "", "written with points it is meant"
    wall = doubt(ruled(WALL, "{:.0f}").replace("F800.", "F900"))
    assert wall.startswith("G52 cuts 0.3 mm at 9 mm/min: Z20 is 0.2 mm")
    assert doubt(ruled([tuple(v / 100 for v in p) for p in WALL])) == "", "so is a wall"
    assert doubt(ruled([tuple(20 * v for v in p) for p in WALL], "{:.0f}")) == "", "6 mm are a wall"


def test_check_asks_once_for_surfaces_that_follow_each_other() -> None:
    walls = [ruled([(x + 30 * k, y, z) for x, y, z in WALL], "{:.0f}") for k in range(3)]
    walk = checked.path_of(checked.task(f"G21 G90 G40\n{''.join(walls)}M30\n".encode(), "part.ngc", MACHINE))
    list(walk.items)
    assert [note.place.line for note in walk.notes if "decimal points if" in note.sentence] == [2]


def test_check_notes_a_doubt_at_its_block() -> None:
    text = "G21 G90\n" + CONE.format("15", "10", "5", "90000")
    text = text.replace("X15 ", "X15. ")
    walk = checked.path_of(checked.task((text + "M30\n").encode(), "part.ngc", MACHINE))
    list(walk.items)
    assert [note.place.line for note in walk.notes if "mixes words" in note.sentence] == [2]


def test_exchanged_curves_are_refused_as_such_but_not_on_a_part_that_is_turned_over() -> None:
    text = f"G21 G90\n{ruled(FLAT[4:] + FLAT[:4])}".encode()
    with pytest.raises(ProgramError, match="exchange the two curves"):
        blocks.read(text, MACHINE, "part.ngc")
    over = with_offset(MACHINE, "G54", {"origin_mm": [0, 0, 0], "turned_deg": [180, 0, 0]})
    assert blocks.read(text, over, "part.ngc").blocks
