"""G and M codes of the machine's own, subs by line and by file, and folders of subs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from support.machines.traced_programs import mill

from controller.machine import machine_file
from controller.machine.model import Machine
from controller.machine.toml_table import ConfigError
from controller.program import blocks, linked
from controller.program.program import JointLine, ProgramError, Tip, TipLine


def machine(dialect: str, **fields: object) -> Machine:
    return replace(mill(unset=()), dialect=dialect, without_point="unit", **fields)  # type: ignore[arg-type]


def xs(text: str, on: Machine, folder: Path | None = None) -> list[float | None]:
    data = text.encode()
    if folder is not None:
        data = bytes(linked.linked(data, linked.beside(folder / "p.nc"), on))
    made = blocks.read(data, on, "p.nc").blocks
    return [block.targets[0] for block in made if isinstance(block, JointLine)]


SUB = "o<bore> sub\nG0 X#<x>\nG0 X[#<x> + #<p>]\no<bore> endsub\n"


@pytest.mark.parametrize("dialect", ["rs274", "fanuc"])
def test_an_own_code_calls_a_sub_with_the_words_of_its_line(dialect: str) -> None:
    on = machine(dialect, own_codes=(("G200", "bore"),))
    assert xs(f"{SUB}G0 X1.\nG200 X5. P2.\nN20 g200 p1. x7.\nG0 X2.\nM30\n", on) == [1, 5, 7, 7, 8, 2]


def test_under_fanuc_its_words_are_numbered_too() -> None:
    on = machine("fanuc", own_codes=(("M201", "9020"),))
    text = "G0 X1.\nM201 X5. A2. I3. J4. I6.\nG0 X9.\nM30\nO9020\nG0 X#24\nX[#1+#4+#5+#7]\nX#<a>\nM99\n"
    assert xs(text, on) == [1, 5, 15, 2, 9]


def test_a_sub_of_an_own_code_is_found_in_the_folders_of_the_machine(tmp_path: Path) -> None:
    (tmp_path / "subs").mkdir()
    (tmp_path / "other").mkdir()
    (tmp_path / "subs" / "bore.ngc").write_text(SUB)
    (tmp_path / "other" / "bore.ngc").write_text("o<bore> sub\nG0 X99.\no<bore> endsub\n")
    folders = (str(tmp_path / "nowhere"), str(tmp_path / "subs"), str(tmp_path / "other"))
    on = machine("rs274", own_codes=(("M200", "bore"),), sub_folders=folders)
    assert xs("M200 X5 P1\nM2\n", on, tmp_path) == [5, 6]
    (tmp_path / "bore.ngc").write_text("o<bore> sub\nG0 X3.\no<bore> endsub\n")
    assert xs("o<bore> call\nM200\nM2\n", on, tmp_path) == [3, 3]  # that of the program comes first


def test_an_own_code_may_be_a_name_of_another() -> None:
    on = machine("rs274", own_codes=(("M428", "G43.4"), ("M430", "G49")))
    made = blocks.read(b"M428 H1\nG0 X1. Y2. Z3.\nM430\nG0 X4.\n", on, "p").blocks
    moves = [block for block in made if isinstance(block, TipLine | JointLine)]
    assert [block.modal.tip for block in moves] == [Tip.ROTARIES, Tip.OFF]
    with pytest.raises(ProgramError, match=r"M428 and M430|G43.4 and G49"):
        blocks.read(b"M428 M430\n", on, "p")


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("M200 X5. G1", "flow.own_alone"),
        ("M200 M8", "flow.own_alone"),
        ("M200 X1.", "flow.no_sub"),
        ("M201", "code.unknown_m"),
    ],
)
def test_what_an_own_code_cannot_do_is_refused_with_its_place(text: str, key: str) -> None:
    on = machine("fanuc", own_codes=(("M200", "nothing"),))
    with pytest.raises(ProgramError) as refused:
        blocks.read(f"G0 X1.\n{text}\nM30\n".encode(), on, "p")
    assert (refused.value.said["key"], refused.value.line) == (key, 2)


COMPLETE = machine_file.alone(machine_file.load("trunnion"))


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ('own_codes = { M6 = "change" }', "no code that a machine may have of its own"),
        ('own_codes = { G43 = "change" }', "no code that a machine may have of its own"),
        ('own_codes = { M200 = "Change It" }', "neither a sub nor a code"),
        ('sub_folders = ["subs"]', "no list of folders"),
        ("sub_folders = 3", "sub_folders"),
    ],
)
def test_keys_that_say_nothing_are_refused(line: str, says: str) -> None:
    with pytest.raises(ConfigError, match=says):
        machine_file.read(COMPLETE.replace("[machine]", f"[machine]\n{line}", 1), "m.toml")


# ---- subs of Fanuc and Haas


def test_m97_calls_the_lines_from_n_on() -> None:
    text = "G0 X1.\nM97 P100 L2\nG0 X2.\nM30\nN100 G0 X3.\nG91 X1.\nG90\nM99\n"
    assert xs(text, machine("fanuc")) == [1, 3, 1, 3, 1, 2]


def test_m97_calls_lines_of_its_own_program_or_sub() -> None:
    text = "M98 P1000\nG0 X2.\nM30\nN5 X9.\nM99\nO1000\nM97 P5\nM99\nN5 G0 X4.\nM99\n"
    assert xs(text, machine("fanuc")) == [4, 2]


def test_m99_with_p_goes_on_at_that_line_of_the_caller() -> None:
    text = "G0 X1.\nM98 P1000\nG0 X2.\nN50 G0 X3.\nM30\nO1000\nG0 X4.\nM99 P50\n"
    assert xs(text, machine("fanuc")) == [1, 4, 3]


def test_m99_with_p_of_the_program_itself_is_a_jump() -> None:
    text = "#1=0\nN10 #1=#1+1\nG0 X#1\nIF [#1 GE 3] GOTO 20\nM99 P10\nN20 M30\n"
    assert xs(text, machine("fanuc")) == [1, 2, 3]
    with pytest.raises(ProgramError, match="for ever"):
        blocks.read(b"G0 X1.\nM99\n", machine("fanuc"), "p")
    with pytest.raises(ProgramError):
        blocks.read(b"G0 X1.\nN5 M99 P5\n", machine("fanuc", program_passes=50), "p")


def test_m98_calls_a_file_by_its_name_and_m198_one_by_its_number(tmp_path: Path) -> None:
    (tmp_path / "side a.nc").write_text("O0777 (SIDE)\nG0 X5.\nM99\n")
    (tmp_path / "O1234.nc").write_text("O1234\nG0 X6.\nM99\n")
    text = "M98 (SIDE A.NC)\nM98 L2 (Side A)\nM198 P1234\nM98 P1234 (O1234 HERE)\nM30\nO1234\nG0 X7.\nM99\n"
    assert xs(text, machine("fanuc"), tmp_path) == [5, 5, 5, 6, 7]


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("M98 (NOWHERE.NC)", "flow.no_file"),
        ("M97 P7", "flow.no_block_of"),
        ("M97", "flow.m98_alone"),
        ("M198 P1000", "flow.no_number"),
        ("M99 P3", "flow.no_block_of"),
    ],
)
def test_calls_that_lead_nowhere_are_refused(text: str, key: str) -> None:
    with pytest.raises(ProgramError) as refused:
        blocks.read(f"G0 X1.\n{text}\nM30\nO1000\nM99\n".encode(), machine("fanuc"), "p")
    assert (refused.value.said["key"], refused.value.line) == (key, 2)


@pytest.mark.parametrize("written", ["elseif", "else if", "ELSE  IF", "else\tif"])
def test_else_if_is_elseif(written: str) -> None:
    text = f"#1=2\no1 if [#1 EQ 1]\nG0 X1.\no1 {written} [#1 EQ 2]\nG0 X2.\no1 else\nG0 X3.\no1 endif\nM2\n"
    assert xs(text, machine("rs274")) == [2]
