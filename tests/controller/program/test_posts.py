"""Heads, tails and safety lines as posts for Fanuc-like controls write them: they run unedited."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from controller.machine import machine_file
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine
from controller.machine.spindle import unasked
from controller.plan.path import path
from controller.plan.report import explained
from controller.plan.segment import ContinuousPath
from controller.program import blocks
from controller.program.position import homed
from controller.program.program import JointLine, ProgramError

POSTS = sorted((Path(__file__).parents[2] / "programs/posts").glob("*.nc"))
HOME = (0.0, 0.0, 260.0, 0.0, 0.0)  # where the shipped trunnion is homed

# Axes at the end, lowest Z of a feed move in program coordinates, how many feed moves.
ENDS = {
    "fusion_fanuc": (HOME, -12.0, 33),
    "mastercam_fanuc": (HOME, -8.0, 7),
    "hsmworks_haas": ((38.0, 0.0, 0.0, 0.0, 0.0), 0.0, 4),
    "nx_fanuc": ((39.75, 121.4, 170.8, 0.0, 0.0), -3.175, 4),
    "freecad_fanuc": ((28.0, 122.0, 135.0, 0.0, 0.0), -2.0, 4),
    "haas_ngc": ((0.0, 0.0, 0.0, 0.0, 0.0), -10.16, 7),
    "mazak_iso": ((-2.0, 96.0, 260.0, 0.0, 0.0), 0.0, 2),
    "okuma_like": (HOME, -1.0, 5),
    "five_axis_fanuc": (HOME, 49.0, 3),
    "bobcad_haas": ((28.0, 0.0, 0.0, 0.0, 0.0), -1.0, 8),
    "brother_speedio": ((20.0, 108.0, 260.0, 0.0, 0.0), -8.0, 24),
    "camworks_fanuc": (HOME, -3.0, 6),
    "doosan_fanuc_tapping": (HOME, -10.0, 6),
    "esprit_fanuc": (HOME, -2.0, 9),
    "estlcam": ((22.5, 104.0, 125.0, 0.0, 0.0), -3.0, 3),
    "freecad_linuxcnc": ((18.0, 110.0, 135.0, 0.0, 0.0), -6.0, 4),
    "fusion_haas_five_axis": ((0.0, 0.0, 0.0, 0.0, 0.0), 19.0, 4),
    "fusion_mazak": (HOME, -0.5, 4),
    "fusion_okuma": (HOME, -1.5, 10),
    "hypermill_fanuc": (HOME, -6.0, 10),
    "mastercam_fanuc_five_axis": (HOME, 50.0, 3),
    "mastercam_haas_four_axis": (HOME, -1.0, 3),
    "matsuura_macro_free": (HOME, -1.0, 3),
    "nx_five_axis": ((22.416787962745634, 103.26053727537393, 260.0, 0.0, 0.0), 29.5, 2),
    "powermill_fanuc": (HOME, 0.5, 6),
    "solidcam_fanuc": (HOME, -1.0, 15),
    "vectric_mm": ((8.0, 96.0, 140.0, 0.0, 0.0), -2.0, 3),
}


def machine() -> Machine:
    return replace(machine_file.load("trunnion"), dialect="fanuc", spindle=unasked(None))


@pytest.mark.parametrize("post", POSTS, ids=lambda post: post.stem)
def test_a_post_runs_unedited(post: Path) -> None:
    on = machine()
    read = blocks.read(post.read_bytes(), on, post.name)
    told = list(explained.steps(read.blocks, on, post.name, homed(on)))
    ends, lowest, feeds = ENDS[post.stem]
    assert tuple(told[-1].axes.values()) == pytest.approx(ends)
    cut = [step for step in told if step.kind in (*explained.LINES, "arc")]
    assert min(step.program["Z"] or 0.0 for step in cut) == pytest.approx(lowest)
    assert len(cut) == feeds
    traced = path.trace(read, on, kinematics_of(on), homed(on))
    assert on.shown(traced.end) == pytest.approx(ends)
    assert any(isinstance(item, ContinuousPath) for item in traced.items)


def test_every_post_has_its_row() -> None:
    assert {post.stem for post in POSTS} == ENDS.keys()


@pytest.mark.parametrize(
    ("without_point", "x"), [("unit", 10.0), ("thousandth", 0.01)], ids=["unit", "thousandth"]
)
def test_a_word_without_a_point_is_what_the_machine_file_says(without_point: str, x: float) -> None:
    on = replace(machine(), without_point=without_point)
    for text in ("G0 X10", "F100. G1 Y1. X10", "G1 F100. X0\nX10"):
        step = list(explained.steps(blocks.stream(text.encode(), on, "p"), on, "p", homed(on)))[-1]
        assert step.program["X"] == pytest.approx(x)
        read = blocks.stream(("G20\n" + text).encode(), on, "p")
        step = list(explained.steps(read, on, "p", homed(on)))[-1]
        assert step.program["X"] == pytest.approx(25.4 * (10.0 if x == 10.0 else 0.001))


@pytest.mark.parametrize("text", ["G0 X10", "G1 F100. X0\nX10", "G1 X1. F9.\nG83 X1. Z0 R1. Q500", "G0 C90"])
def test_a_word_without_a_point_is_refused_where_nobody_says_what_it_counts(text: str) -> None:
    with pytest.raises(ProgramError, match=r"has no decimal point: .* without_point"):
        list(blocks.stream(text.encode(), machine(), "p"))
    list(blocks.stream(b"G0 X0 Y0\nG1 X1. F100\nX0\nG4 P100\nG81 Z0 R1. K2\n", machine(), "p"))


def last(text: str, dialect: str = "fanuc") -> dict[str, float | None]:
    on = replace(machine(), dialect=dialect, without_point="unit")
    return list(explained.steps(blocks.stream(text.encode(), on, "p"), on, "p", homed(on)))[-1].program


def test_what_was_modal_before_a_cycle_is_so_again_behind_g80() -> None:
    cycle = "G0 X1. Y1. Z20.\nM3 S100\nG98 G81 X5. Z-1. R2. F100.\nX6.\n"
    assert last(f"{cycle}G80 Z25.\n")["Z"] == last(f"{cycle}G80\nZ25.\n")["Z"] == 25.0
    read = blocks.read(f"{cycle.replace('G0', 'G1 F50.')}G80 Z25.\n".encode(), machine(), "p")
    assert isinstance(read.blocks[-1], JointLine) and read.blocks[-1].feed_mm_s == pytest.approx(100.0 / 60.0)
    for text in (f"{cycle}G80 Z25.\n", f"{cycle}G80\nZ25.\n"):
        with pytest.raises(ProgramError, match=r"Z25\. has no motion"):
            last(text, "rs274")
    with pytest.raises(ProgramError, match="no motion"):
        last("G80\nX1.\n")


def test_zeros_that_posts_write_without_need() -> None:
    arc = "G1 X0. Y0. F100.\nG2 X10. Y0. I5. J0. K0.\n"
    assert last(arc)["X"] == 10.0
    with pytest.raises(ProgramError, match="not in the plane"):
        last(arc.replace("K0.", "K1."))
    with pytest.raises(ProgramError, match="not in the plane"):
        last(arc, "rs274")
    assert last("G49 H0 G0 X1.\n")["X"] == 1.0
    with pytest.raises(ProgramError, match="H1 stands beside G49"):
        last("G49 H1\n")


def test_the_safety_line_in_both_dialects() -> None:
    for dialect in ("rs274", "fanuc"):
        on = replace(machine(), dialect=dialect)
        made = blocks.read(b"G0 G17 G40 G49 G80 G90\nX1.\nG80 G0\nX2.\n", on, "p").blocks
        assert len(made) == 2


def test_haas_writes_tool_centre_control_its_own_way() -> None:
    moves = "G0 X1. Y2. Z50. A10. C20.\nG1 X2. C30. F100.\nG49\n"
    ours, theirs = (
        [block for block in blocks.read(f"{code} H1\n{moves}".encode(), machine(), "p").blocks]
        for code in ("G43.4", "G234")
    )
    assert ours == theirs


def test_haas_writes_work_offsets_beyond_g59_its_own_way() -> None:
    lines = "G10 L20 P1 X7.\n{} P1\nG0 X1.\n"
    ours, theirs = (
        blocks.read(lines.format(code).encode(), machine(), "p").blocks[-1] for code in ("G54.1", "G154")
    )
    assert ours == theirs and ours.modal.frame(machine()).origin[0] == 7.0


@pytest.mark.parametrize(("line", "x"), [("/2 G0 X5.", 5.0), ("/ G0 X5.", 5.0), ("/9N10 G0 X5.", 5.0)])
def test_a_block_skip_may_have_a_number(line: str, x: float) -> None:
    assert last(f"G0 X1.\n{line}\n")["X"] == x
    deleted = blocks.read(f"G0 X1.\n{line}\n".encode(), machine(), "p", block_delete=True).blocks
    assert len(deleted) == 1


def test_of_two_tools_beside_a_change_the_second_comes_next() -> None:
    made = blocks.read(b"T001 T002 M6\nG0 X1.\nM6\nG0 X2.\n", machine(), "p").blocks
    assert [block.modal.tool for block in made if isinstance(block, JointLine)] == [1, 2]
    with pytest.raises(ProgramError, match="T1 and T2 stand on one line"):
        blocks.read(b"T1 T2 M6\n", replace(machine(), dialect="rs274"), "p")
    with pytest.raises(ProgramError, match="stand on one line"):
        blocks.read(b"T1 T2 T1 M6\n", machine(), "p")
