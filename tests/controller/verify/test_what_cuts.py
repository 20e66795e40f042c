"""Only the flute cuts: nothing is held to be within its tolerance where something is not cut, or is hit.

Judged beside a tool of stacked discs (``oracles/stacked_discs``), which shares nothing with the verifier.
"""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest
from support.oracles import stacked_discs
from support.parts import walls
from support.parts.walls import TOLERANCE_MM, bands, machine, program, straight
from typer.testing import CliRunner

from controller.__main__ import app
from controller.machine import machine_file
from controller.machine.model import Machine, Tool
from controller.machine.tool_profile import flank_mm
from controller.program import blocks
from controller.program.program import ProgramError
from controller.runtime import checked
from controller.verify import fits, passes

HIGH = straight(12.0)


def refusal(text: str, built: Machine) -> str:
    """Of a start without a stored check, which is audited as a check is; "": it may begin."""
    try:
        checked.walk_of(checked.task(text.encode(), "wall.ngc", built), None, False)
    except ProgramError as refused:
        return refused.sentence
    return ""


def end_mill(flute: float, *held: tuple[float, float, float], **shape: object) -> Tool:
    return Tool(1, "end mill", 2.0, 0.0, flute, holder=held, **shape)  # type: ignore[arg-type]


CASES = {
    "a flute as high as the wall": (bands(HIGH, 1), end_mill(12.0), ""),
    "half a flute": (bands(HIGH, 1), end_mill(6.0), r"leaves 6\.000 mm of the surface uncut above"),
    "half a flute below a slim neck": (
        bands(HIGH, 1), end_mill(6.0, (6.0, 60.0, 1.5)), r"leaves 6\.000 mm .* a longer flute",
    ),
    "a flute that misses the upper edge": (bands(HIGH, 1), end_mill(11.8), "uncut"),
    "a ball whose flute is as long as the wall, and its end below it": (
        bands(HIGH, 1), end_mill(12.0, corner_mm=2.0), "uncut",
    ),
    "a ball with a flute for its end, too": (bands(HIGH, 1), end_mill(14.0, corner_mm=2.0), ""),
    "a flute that misses it by little": (bands(HIGH, 1), end_mill(11.97), r"leaves 0\.030 mm"),
    "two bands from the top down": (bands(HIGH, 2), end_mill(6.0), ""),
    "two bands from the top down, a neck": (bands(HIGH, 2), end_mill(6.0, (6.0, 60.0, 1.5)), ""),
    "two bands from the top down, a shank as thick as the cutter": (
        bands(HIGH, 2), end_mill(6.0, (6.0, 60.0, 2.0)), "",
    ),
    "two bands from the top down, a thicker shank": (
        bands(HIGH, 2), end_mill(6.5, (6.5, 60.0, 2.5)), r"holder of T1 is 0\.500 mm deep",
    ),
    "two bands from the bottom up": (bands(HIGH, 2, False), end_mill(6.0), "shank .* at stock"),
    "three bands, and a flute for a quarter": (bands(HIGH, 3), end_mill(3.0), "uncut"),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_what_is_not_cut_or_is_hit_is_refused_and_the_rest_begins(case: str) -> None:
    cuts, tool, expected = CASES[case]
    text, built = program(cuts), machine(tool)
    found = refusal(text, built)
    assert bool(re.search(expected, found)) if expected else found == ""
    points = [one.points(True, 5, 13) for one in cuts]
    seen = stacked_discs.judged(text, built, points, TOLERANCE_MM)
    assert not seen.is_bad if not expected else not seen.is_good


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(40))
def test_none_of_unseen_tools_and_walls_is_within_where_the_discs_find_something(seed: int) -> None:
    text, built, points = walls.drawn(seed)
    found, seen = refusal(text, built), stacked_discs.judged(text, built, points, TOLERANCE_MM)
    assert found or not seen.is_bad, seen
    assert not found or not seen.is_good, found


def tools_file(folder: Path, *tools: str) -> Path:
    """A machine file beside these tools; their T1 is in the spindle."""
    (folder / "tools.toml").write_text("".join(f"[[tool]]\n{one}\n" for one in tools))
    shipped = (machine_file.SHIPPED / "trunnion.toml").read_text()
    (folder / "machine.toml").write_text(shipped)
    return folder / "machine.toml"


def run(folder: Path, verb: str, text: str, *tools: str) -> tuple[int, dict]:
    (folder / "part.ngc").write_text(text)
    words = [verb, str(folder / "part.ngc"), "--machine", str(tools_file(folder, *tools)), "--json"]
    words += ["--store", str(folder / "checks")] if verb == "check" else []
    result = CliRunner().invoke(app, words)
    return result.exit_code, json.loads(result.stdout)


MILL = 'name = "T{0}"\nnumber = {0}\nradius_mm = {1}\nlength_mm = 80.0\nflute_mm = {2}\n'


@pytest.mark.parametrize("verb", ["check", "verify"])
def test_check_and_verify_refuse_a_wall_that_is_higher_than_the_flute(verb: str, tmp_path: Path) -> None:
    code, told = run(tmp_path, verb, program([HIGH]), MILL.format(1, 4.0, 5.0))
    assert code == 1 and not told["ok"]
    assert "the cut of line 5 leaves 7.000 mm of the surface uncut above the flute of T1" in told["error"]


def test_a_warning_tells_of_the_shank_and_of_what_is_left_standing() -> None:
    built = machine(end_mill(4.0), gouge="warn")
    notes = checked.walk_of(checked.task(program([HIGH]).encode(), "wall.ngc", built), None, False).notes
    told = "\n".join(note.sentence for note in notes)
    assert "The flute of T1 is 4.000 mm long" in told
    assert "the shank of T1, which does not cut, is at stock" in told
    assert "short of being cut" in told and "a tool with a longer flute" in told


def test_fit_names_only_tools_of_the_table_whose_flute_and_holder_let_them_cut(tmp_path: Path) -> None:
    thick = MILL.format(2, 3.0, 14.0) + "holder = [{ from_mm = 8.0, length_mm = 40.0, radius_mm = 9.0 }]\n"
    tools = [MILL.format(1, 4.0, 5.0), thick, MILL.format(3, 2.0, 12.5), MILL.format(4, 1.0, 30.0)]
    code, told = run(tmp_path, "fit", program([HIGH]), *tools)
    assert code == 0
    assert [best["tool"] for best in told["surfaces"][0]["fits"]] == [3]


def test_a_ball_is_fitted_with_a_flute_for_its_end_and_the_wall() -> None:
    ball = Tool(1, "ball", 1.0, 0.0, 5.0, corner_mm=1.0)
    long = fits.scaled(ball, 6.0, 20.0)
    assert (long.corner_mm, long.flute_mm, flank_mm(long)) == (6.0, 26.0, 20.0)


# ---- over its centre ---------------------------------------------------------------


@pytest.mark.parametrize("centre_cutting", [True, False])
def test_a_mill_that_does_not_cut_over_its_centre_is_not_plunged_along_stock(centre_cutting: bool) -> None:
    """Without a lead it comes down beside the ruling at which the cut begins; with one beside the part."""
    tool = end_mill(13.0, centre_cutting=centre_cutting)
    found = refusal(program([HIGH]), machine(tool, lead_mm=0.0))
    assert found == "" if centre_cutting else "the plunge of line 5 T1, which does not cut over its" in found
    assert refusal(program([HIGH]), machine(tool)) == ""


def test_where_an_earlier_cut_has_taken_the_stock_it_may_be_plunged() -> None:
    """Another tool has cut the wall before."""
    first, second = end_mill(13.0), end_mill(13.0, centre_cutting=False)
    built = machine(first, lead_mm=0.0)
    built = replace(built, tools=(first, replace(second, number=2), *built.tools[2:]))
    twice = program([HIGH]).replace("M30\n", "") + program([HIGH]).replace("T1", "T2").partition("\n")[2]
    assert refusal(twice, built) == ""
    assert "does not cut over its" in refusal(
        twice.replace("T2 M6", "T3 M6").replace("T1 M6", "T2 M6"), built
    )


@pytest.mark.parametrize(
    ("lines", "line"),
    [
        ("G0 Z5.\nG1 Z-2. F100.\nG1 Z-4.\n", 4),
        ("G81 X5. Y5. Z-6. R2. F100.\n", 3),
        ("G64 P0.01\nG1 X5. Z9. F600.\nX9. Z8.\nZ4.\nX30.\n", 6),
        ("G1 X30. Z-2. F100.\n", None),
        ("G1 X5. F600.\nG2 I3. Z6.\n", None),
        ("G0 Z5.\n", None),
    ],
)
def test_a_line_that_plunges_it_is_told_once_for_its_stock_is_not_known(lines: str, line: int | None) -> None:
    for centre_cutting in (True, False):
        built = machine(end_mill(13.0, centre_cutting=centre_cutting))
        text = f"G21 G90 G54 G0 Z10.\nT1 M6 S6000 M3\n{lines}M30\n"
        walk = checked.walk_of(checked.task(text.encode(), "lines.ngc", built), None, False)
        list(walk.items)
        told = [note.place.line for note in walk.notes if note.said["key"] == "note.plunge"]
        assert told == ([line] if line and not centre_cutting else [])


# ---- lines -------------------------------------------------------------------------


def test_a_gouge_of_blended_lines_names_the_line_that_cuts() -> None:
    """Eight lines with their corners rounded are one motion; the sixth goes through the wall."""
    ways = ["X-20. Y-30.", "X40. Y-30.", "X40. Y-20.", "X10. Y-20.", "X10. Y-12.", "X10. Y3.", "X10. Y-12."]
    lines = "\n".join(f"G1 {way} F600." for way in ways)
    text = program([HIGH]).replace("M30\n", f"G64 P0.01\nG0 X-20. Y-40.\nG0 Z4.\n{lines}\nG0 Z120.\nM30\n")
    number = 1 + next(k for k, line in enumerate(text.splitlines()) if "Y3." in line)
    task = checked.task(text.encode(), "wall.ngc", machine(end_mill(13.0)))
    with pytest.raises(ProgramError) as refused:
        checked.walk_of(task, None, False)
    assert refused.value.line == number
    assert f"of line {number} cuts" in refused.value.sentence


def test_a_probe_is_no_cutter() -> None:
    built, text = machine_file.load("machining_centre"), "T99 M6\nG0 X1.\nT2 M6\nG0 X2.\n"
    fitted = passes.Fitted.of(blocks.stream(text.encode(), built, "probe.ngc"), built)
    assert [(fitted.at(line).number, fitted.at(line).flute_mm) for line in (2, 4)] == [(99, 0.0), (2, 15.0)]


def test_a_probe_touches_a_wall_that_has_been_cut() -> None:
    built = machine_file.load("machining_centre")
    touches = "M5\nT99 M6\nG43 H99\nG0 Z40\nG0 X10 Y-10\nG0 Z10\nG38.2 Y2 F100\nG0 Z40\nM30\n"
    text = program([straight(12.0)]).replace("T1 M6", "T2 M6").replace("M30\n", touches)
    checked.looked_at(checked.task(text.encode(), "probe.ngc", built))
    with pytest.raises(ProgramError, match="shank of T99"):
        checked.looked_at(checked.task(text.replace("G38.2", "G1").encode(), "probe.ngc", built))
