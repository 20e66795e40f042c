"""What must not be cut: refused before the start with place and depth, or told with gouge = "warn"."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest
from support.machines.stepped_runs import program

from controller.geometry.vectors import Frame
from controller.machine import machine_file
from controller.machine.model import Machine, Tool, WorkTable
from controller.program.program import ProgramError
from controller.runtime import checked

PROGRAMS = Path(__file__).parents[3] / "config" / "programs"
HEAD = "G21 G90 G54 G61\nT1 M6\nS9000 M3\n"


def trunnion(**changes: object) -> Machine:
    """The shipped machine; what a surface's form may cost is no matter here."""
    return replace(machine_file.load("trunnion"), **{"tolerance_mm": None, **changes})  # type: ignore[arg-type]


def held(machine: Machine, **shape: object) -> Machine:
    """The same machine with T1 in another shape."""
    first = replace(machine.tools[0], **shape)  # type: ignore[arg-type]
    return replace(machine, tools=(first, *machine.tools[1:]))


def told(text: str, machine: Machine) -> list[str]:
    """The gouges that a start without a stored check tells of."""
    task = checked.task(text.encode(), "part.ngc", replace(machine, gouge="warn"))
    notes = checked.walk_of(task, None, False).notes
    return [note.sentence for note in notes if note.sentence.startswith("Gouge: ")]


def refused(text: str, machine: Machine) -> ProgramError:
    task = checked.task(text.encode(), "part.ngc", replace(machine, gouge="refuse"))
    with pytest.raises(ProgramError) as refusal:
        checked.walk_of(task, None, False)
    return refusal.value


def test_a_check_refuses_and_tells_as_a_start_does(tmp_path: Path) -> None:
    text = HEAD + "G42\n" + wall(STRAIGHT)
    machine = held(trunnion(), holder=((6.0, 30.0, 8.0),))
    with pytest.raises(ProgramError) as refusal:
        checked.check(checked.task(text.encode(), "part.ngc", machine), tmp_path)
    assert refusal.value.sentence == refused(text, machine).sentence
    lenient = checked.task(text.encode(), "part.ngc", replace(machine, gouge="warn"))
    kept = checked.check(lenient, tmp_path)[1]
    assert [note.sentence for note in kept.notes if "Gouge" in note.sentence] == told(text, machine)
    found, _ = checked.find(lenient, tmp_path)
    assert found is not None and found.notes == kept.notes, "a start by the stored check tells it, too"


def corner(degrees: float, head: str = "G64\n") -> str:
    """Two upright walls that meet in a concave corner of so much."""
    way = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    second = [(30.0 + 10.0 * k * way[0], 10.0 * k * way[1]) for k in range(4)]
    return HEAD + head + "G41\n" + wall([(10.0 * k, 0.0) for k in range(4)]) + wall(second)


@pytest.mark.parametrize("degrees", [1.0, 2.0, 3.0])
def test_the_overcut_of_a_concave_corner_within_the_joint_tolerance_is_no_gouge(
    degrees: float, tmp_path: Path
) -> None:
    """Told, and judged by the form tolerance, though it is a tenth of a millimetre wide."""
    um = 3000.0 * (1.0 - math.cos(math.radians(degrees)))
    machine = trunnion(tolerance_mm=0.05)
    found = checked.check(checked.task(corner(degrees).encode(), "part.ngc", machine), tmp_path)[1]
    assert not [note.sentence for note in found.notes if note.sentence.startswith("Gouge")]
    assert any(f"up to {um:.3f} um of overcut" in note.sentence for note in found.notes)
    worst = max(one.overcut_mm for one in found.verdicts)
    assert 1000.0 * worst == pytest.approx(um, rel=0.01)
    tight = trunnion(tolerance_mm=0.9e-3 * um)
    assert "exceeds its form tolerance" in refused(corner(degrees), tight).sentence


def test_beyond_the_joint_tolerance_it_is_refused_as_before() -> None:
    assert "concave corner of 3.5000 degrees" in refused(corner(3.5), trunnion()).sentence
    assert "concave corner of 1.0000 degrees" in refused(corner(1.0, "G61\n"), trunnion()).sentence


def ruled(upper: list[tuple[float, float, float]], lower: list[tuple[float, float, float]]) -> str:
    rows = [f"X{x:.6f} Y{y:.6f} Z{z:.6f}" for x, y, z in (*upper, *lower)]
    return "\n".join([f"G52 {rows[0]} F1000.", *rows[1:], ""])


def wall(points: list[tuple[float, float]], height: float = 10.0) -> str:
    """An upright wall over four control points."""
    return ruled([(x, y, height) for x, y in points], [(x, y, 0.0) for x, y in points])


def test_the_ready_examples_gouge_nowhere() -> None:
    for name in ("example1_ready.ngc", "example2_ready.ngc"):
        assert told((PROGRAMS / name).read_text(), trunnion()) == []


def test_the_corner_of_the_verbatim_example_is_found_with_place_and_depth() -> None:
    text = (PROGRAMS / "example2.ngc").read_text()
    sentences = told(text, trunnion())
    of_the_cuts = [s for s in sentences if "the cut of line" in s]
    assert len(of_the_cuts) == 2, "each surface's cut destroys the other one at (38, 22)"
    assert all("2.99" in s and "part X 3" in s for s in of_the_cuts)
    assert "the cut of line 1 cuts" in of_the_cuts[0] and "into the surface of line 9 at" in of_the_cuts[0]
    assert "the cut of line 9 cuts" in of_the_cuts[1] and "into the surface of line 1 at" in of_the_cuts[1]
    refused(text, trunnion())


def test_the_concave_upper_edge_of_the_second_surface_is_refused_on_the_left() -> None:
    """C1 alone does not show it: the surface is hollow at v = 0 only."""
    text = "g41\n" + (PROGRAMS / "example2.ngc").read_text()
    error = refused(text, trunnion())
    assert error.line == 10
    assert "hollow of radius 1.6" in error.sentence and "u = 1.0000, v = 0.000" in error.sentence
    assert "0.389 mm" in error.sentence
    assert any("hollow" in sentence for sentence in told(text, trunnion()))


def test_a_hollow_in_the_upper_edge_alone_is_refused() -> None:
    """The lower edge is straight; the upper one bends, by 2.3 mm across its leaning ruling."""
    upper = [(0.0, 0.0, 20.0), (10.0, 20.0, 20.0), (10.0, 20.0, 20.0), (20.0, 0.0, 20.0)]
    text = (
        HEAD + "G41\n" + ruled(upper, [(0.0, 0.0, 0.0), (7.0, 0.0, 0.0), (13.0, 0.0, 0.0), (20.0, 0.0, 0.0)])
    )
    made = held(trunnion(), flute_mm=30.0)
    bulge = told(text, made)
    other = told(text.replace("G41", "G42"), made)
    assert not any("hollow" in s for s in bulge) or not any("hollow" in s for s in other)
    assert any("hollow" in s for s in bulge + other)


def test_a_channel_narrower_than_the_cutter_is_cut_into_from_the_other_wall() -> None:
    """Two walls 5 mm apart, cut from between them with a cutter of 6 mm: 1 mm too much."""
    one = wall([(0.0, 0.0), (10.0, 0.0), (20.0, 0.0), (30.0, 0.0)])
    back = wall([(30.0, 5.0), (20.0, 5.0), (10.0, 5.0), (0.0, 5.0)])
    machine = trunnion()
    for wide, gouges in ((5.0, True), (9.0, False)):
        text = HEAD + "G41\n" + one + back.replace("Y5.", f"Y{wide:.0f}.")
        sentences = [s for s in told(text, machine) if "the cut of" in s]
        assert bool(sentences) == gouges, wide
        assert all("1.000 mm too deep" in s for s in sentences)


def test_a_cut_that_comes_back_to_itself_is_refused() -> None:
    """One surface like a hairpin, its legs 5 mm apart, cut on the inside."""
    hairpin = [(0.0, 0.0), (40.0, -14.0), (40.0, 19.0), (0.0, 5.0)]
    sentences = told(HEAD + "G41\n" + wall(hairpin), trunnion())
    assert any("comes back to its own surface" in s for s in sentences)
    outside = told(HEAD + "G42\n" + wall(hairpin), trunnion())
    assert not any("comes back" in s for s in outside)


def test_a_cutter_that_cuts_a_full_turn_is_not_taken_for_one_that_comes_back() -> None:
    text = HEAD + "G42\nG51 X0. Y15. Z0. I0. J0. K0. H10. R10. D400. F1000.\n"
    assert told(text, trunnion()) == []


STRAIGHT = [(0.0, 0.0), (10.0, 0.0), (20.0, 0.0), (30.0, 0.0)]


def test_a_holder_in_the_surface_is_refused() -> None:
    """6 mm of stick-out beside a wall of 10 mm, and a holder 5 mm thicker than the cutter."""
    text = HEAD + "G42\n" + wall(STRAIGHT)
    machine = held(trunnion(), holder=((6.0, 30.0, 8.0),))
    assert "the holder of T1 is 4.000 mm deep" in refused(text, machine).sentence
    assert told(text, held(trunnion(), holder=((11.0, 30.0, 8.0),))) == []


def test_a_holder_that_hits_the_table_is_refused() -> None:
    """A leaning wall on the table's face: the tool leans by 66 degrees, and its holder dips into the face."""
    lower = [(x, 0.0, 2.0) for x, _ in STRAIGHT]
    upper = [(x, 9.0, 6.0) for x, _ in STRAIGHT]
    text = HEAD + "G42\n" + ruled(upper, lower)
    table = WorkTable((0.0, 96.0, 120.0), (0.0, 0.0, 1.0), 150.0, 30.0)
    machine = held(trunnion(table=table), holder=((15.0, 40.0, 25.0),), radius_mm=0.5)
    error = refused(text, machine)
    assert "the holder of T1" in error.sentence and "in the machine's table" in error.sentence
    slim = held(trunnion(table=table), holder=((35.0, 40.0, 1.0),), radius_mm=0.5)
    assert not any("table" in s for s in told(text, slim))
    far = replace(machine, offsets=(Frame((8.0, 96.0, 160.0)),) * 6)
    assert not any("table" in s for s in told(text, far))


def test_overcut_by_twist_is_refused_where_the_machine_file_bounds_it() -> None:
    text = program("example2_ready")
    assert "max_overcut_mm" in refused(text, trunnion(max_overcut_mm=0.1)).sentence
    assert told(text, trunnion(max_overcut_mm=0.3)) == []


def test_lines_beside_a_surface_are_held_against_it() -> None:
    """A G1 in joints, tool upright, straight through the wall's middle."""
    through = "G0 Z40.\nG0 X15. Y-20. A0. C0.\nG1 Z5. F500.\nG1 Y20.\nG0 Z40.\n"
    text = HEAD + "G42\n" + wall(STRAIGHT) + "G40\n" + through
    sentences = told(text, trunnion())
    assert any("of line" in s and "3.000 mm too deep" in s for s in sentences)
    assert told(HEAD + "G42\n" + wall(STRAIGHT), trunnion()) == []


def test_a_tapered_ball_is_no_wider_than_it_is() -> None:
    tool = Tool(1, "tapered ball", 1.0, 0.0, 15.0, corner_mm=1.0, taper_rad=math.radians(5.0))
    machine = replace(trunnion(), tools=(tool,))
    one = wall(STRAIGHT)
    back = wall([(30.0, 8.0), (20.0, 8.0), (10.0, 8.0), (0.0, 8.0)])
    across = [s for s in told(HEAD + "G41\n" + one + back, machine) if "the cut of" in s]
    assert across == []
