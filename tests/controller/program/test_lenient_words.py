"""What every control as Fanuc's takes though it is written loosely: done as there, and told of once."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from support.machines.traced_programs import mill

from controller.machine.model import Machine
from controller.program import blocks
from controller.program.program import Dwell, JointLine, ProgramError, Remark


def machine(dialect: str = "fanuc", **fields: Any) -> Machine:
    made = mill(unset=())
    tools = tuple(replace(tool, length_mm=mm) for tool, mm in zip(made.tools, (50.0, 60.0), strict=False))
    offsets = made.offsets + made.offsets[:1] * 9
    on = {"dialect": dialect, "without_point": "unit", "tools": tools, "offsets": offsets, **fields}
    return replace(made, **on)


def read(text: str, **fields: Any) -> tuple[list[JointLine], list[str]]:
    made = blocks.read(text.encode(), machine(**fields), "p").blocks
    moves = [block for block in made if isinstance(block, JointLine)]
    return moves, [block.sentence for block in made if isinstance(block, Remark)]


LOOSE = {
    "X1. Y2.": "at power-on G0 is active",
    "G53": "moves nothing",
    "G0 X1. N20": "the line's number",
    "G4 U1.": "as X",
    "G54 P2": "is G54.1 P2",
    "H2": "without G43",
    "F100. G0 X0.\nG81 X1. Z-1. R1. P500": "waits nowhere",
    "G81 F100.": "nothing is drilled",
    "G60 X1.": "no side is chosen",
}


@pytest.mark.parametrize(("text", "says"), LOOSE.items())
def test_it_is_taken_and_told_of_once(text: str, says: str) -> None:
    _, notes = read(f"{text}\n{text}\n")
    assert [says in note for note in notes] == [True], notes


@pytest.mark.parametrize("text", [text for text in LOOSE if "G81 X1." not in text])
def test_under_the_other_dialect_it_is_refused(text: str) -> None:
    with pytest.raises(ProgramError):
        blocks.read(f"{text}\n".encode(), machine("rs274"), "p")


def test_power_on_is_rapid_and_no_code_that_ends_a_motion_is() -> None:
    moves, _ = read("X1.\nY2.\n")
    assert [block.feed_mm_s for block in moves] == [None, None]
    with pytest.raises(ProgramError):
        blocks.read(b"G51 X0. Y15. Z0. I0. J0. K0. H10. R5. D90. F400.\nX1.\n", machine(), "p")


def test_h_alone_is_of_the_length_in_force_or_of_the_next_g43() -> None:
    lengths = lambda text: [block.modal.length_mm for block in read(text)[0]]  # noqa: E731
    assert lengths("G43 H1 G0 Z1.\nH2\nZ2.\nG49 Z3.\n") == [50.0, 60.0, 0.0]
    assert lengths("H2\nG0 Z1.\nG43 Z2.\nG43 H1 Z3.\nG43 Z4.\n") == [0.0, 60.0, 50.0, 50.0]
    assert lengths("G44 H1 G0 Z1.\nH2\nZ2.\n") == [-50.0, -60.0]
    assert lengths("G43.1 Z7.\nH2\nG0 Z2.\nG43 Z3.\n") == [7.0, 60.0]
    with pytest.raises(ProgramError):
        blocks.read(b"G43 H1\nH7\n", machine(), "p")


@pytest.mark.parametrize("text", ["G15 H1", "G56 H1", "G52 X1. H1", "G10 L2 P1 X0. H1"])
def test_h_beside_codes_that_are_of_other_controls_with_it_is_refused(text: str) -> None:
    with pytest.raises(ProgramError):
        blocks.read(f"{text}\n".encode(), machine(), "p")


def test_the_dwell_and_the_offset_are_those_of_their_plain_forms() -> None:
    made = blocks.read(b"G4 U1.5\nG4 U500\nG54 P2 G0 X1.\n", machine(), "p").blocks
    assert [block.seconds for block in made if isinstance(block, Dwell)] == [1.5, 0.5]
    assert [block.modal.offset for block in made if isinstance(block, JointLine)] == [10]
    with pytest.raises(ProgramError):
        blocks.read(b"G54 P49\n", machine(), "p")
    with pytest.raises(ProgramError):
        blocks.read(b"G55 P1\n", machine(), "p")


def test_p_of_g81_gives_way_to_a_code_that_takes_it() -> None:
    text = "G10 L20 P2 X100.\nG0 X0. Y0. Z5.\nG81 X1. Z-1. R1. F100.\nG54.1 P2 X2.\n"
    moves, notes = read(text)
    assert not notes and moves[-1].modal.offset == 10
    assert len([block for block in moves if block.feed_mm_s]) == 2


def test_g60_is_a_rapid_of_its_own_line() -> None:
    moves, _ = read("G1 X0. F100.\nG60 X1. Y1.\nX2.\nG60\nX3.\n")
    assert [block.feed_mm_s is None for block in moves] == [False, True, False, False]
    with pytest.raises(ProgramError):
        blocks.read(b"G60 G1 X1. F100.\n", machine(), "p")


def test_parameters_of_another_control_are_left_out() -> None:
    moves, notes = read("G0 X1.\nG10 L50\nN5115 R2000\nN3402 P1 R1\nG11\nX2.\n")
    assert [block.targets[0] for block in moves] == [1.0, 2.0]
    assert "up to G11 on line 5" in notes[0]
    with pytest.raises(ProgramError, match="has no G11"):
        blocks.read(b"G10 L50\nN5115 R2000\nG0 X1.\n", machine(), "p")


def test_an_order_of_2_is_one_of_3() -> None:
    _, notes = read("F100 G0 X0 Y0\nG5.2 X1 Y1 P1 L2\nX2 Y2 P1\nX3 Y0 P1\nG5.3\n", dialect="rs274")
    assert "is taken as L3" in notes[0]


OLDER = "G110 G111 G112 G113 G114 G115 G116 G117 G118 G119 G120 G121 G122 G123 G124 G125 G126 G127 G128 G129"


def test_older_names_of_offsets_of_haas() -> None:
    for number, code in enumerate(OLDER.split(), start=1):
        made = blocks.read(f"G10 L20 P{number} X{number}.\n{code} G0 X0.\n".encode(), machine(), "p").blocks
        line = made[-1]
        assert isinstance(line, JointLine)
        assert (line.modal.offset, line.modal.frame(machine()).origin[0]) == (8 + number, float(number))


def test_a_cycle_line_that_drills_nothing_leaves_its_words_or_is_told_of_what_lacks() -> None:
    moves, _ = read("G0 X0. Y0. Z5.\nF100.\nG81 X1. Z-1. R1.\nG81 F200.\nX2.\n")
    assert len([block for block in moves if block.targets[0] == 2.0]) == 1
    assert [round(block.feed_mm_s * 60) for block in moves if block.feed_mm_s] == [100, 200]


def test_heights_of_a_cycle_stay_where_they_are_between_g90_and_g91() -> None:
    """Fanuc's own example of polar coordinates has it so; under the other dialect the words count anew."""
    text = "G0 X0. Y0. Z20.\nG81 X1. Z-3. R2. F100.\nG91 X1.\nX1. Z-7.\nG90 X9.\nG80\n"
    heights = [block.targets[2] for block in read(text)[0] if block.feed_mm_s]
    assert heights == [-3.0, -3.0, -5.0, -5.0]
    retracts = [block.targets[2] for block in read(f"{text}G0 Z20.\n")[0] if block.targets[2] is not None]
    assert set(retracts) == {20.0, 2.0, -3.0, -5.0}


@pytest.mark.parametrize(
    ("text", "told"), [("G41", 1), ("G42", 1), ("G41 D1", 0), ("D1\nG42", 0), ("G40", 0)]
)
def test_a_side_without_d_tells_whose_radius_it_is(text: str, told: int) -> None:
    _, notes = read(f"{text}\nG0 X20.\n")
    assert sum("without D" in note for note in notes) == told
