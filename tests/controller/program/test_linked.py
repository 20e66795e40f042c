"""Files of subs behind the program that calls them, and lines that block delete leaves out."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.machines.shipped_kinds import machine

from controller.machine.kinematics import kinematics_of
from controller.plan.path import path
from controller.program import blocks, linked
from controller.program.position import homed
from controller.program.program import JointLine, Program, ProgramError

SUB = "%\n(a sub)\no<pocket> sub\nG0 X#1\no<deep> call [#1 + 1]\no<pocket> endsub\n%\n"
DEEP = "o<deep> sub\nG0 Y#1\no<deep> endsub\n"
BY_NUMBER = "O1000\nG0 Z5\nM99\n"
MAIN = "G0 X0\no<pocket> call [3]\nM98 P1000\no<pocket> call [7]\nM30\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    files = {"pocket.ngc": SUB, "Deep.NGC": DEEP, "O1000": BY_NUMBER, "other.ngc": "G0 X9\n"}
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    return tmp_path


def whole(folder: Path, text: str) -> bytes:
    return linked.linked(text.encode(), linked.beside(folder / "main.ngc"))


def moves(data: bytes) -> list[tuple[int, str]]:
    found = []
    for block in blocks.stream(data, machine("fig4a"), "main.ngc"):
        if isinstance(block, JointLine):
            words = zip("XYZ", block.targets, strict=False)
            found.append((block.place.line, "".join(f"{a}{v:g}" for a, v in words if v is not None)))
    return found


def test_subs_of_files_run_where_they_are_called(folder: Path) -> None:
    expected = [(1, "X0"), (2, "X3"), (2, "Y4"), (3, "Z5"), (4, "X7"), (4, "Y8")]
    assert moves(whole(folder, MAIN)) == expected


def test_only_what_is_called_is_put_behind_the_program(folder: Path) -> None:
    program, files = linked.parts(whole(folder, MAIN))
    assert program == MAIN.encode()
    assert {label: name for label, (name, _) in files.items()} == {
        "pocket": "pocket.ngc",
        "deep": "Deep.NGC",
        "1000": "O1000",
    }
    alone = "o1 sub\nG0X1\no1 endsub\no1 call\nM98 P7\nM30\nO7\nM99\n"
    assert whole(folder, alone) == alone.encode()


def test_a_change_in_a_file_that_is_called_is_a_change_of_the_program(folder: Path) -> None:
    before = whole(folder, MAIN)
    (folder / "Deep.NGC").write_text(DEEP.replace("Y#1", "Y1"))
    assert whole(folder, MAIN) != before


@pytest.mark.parametrize(
    ("file", "text", "expected"),
    [
        ("pocket.ngc", "o<pocket> sub\nG1 X#1\no<pocket> endsub\n", "pocket.ngc:2:1: G1 has no feed"),
        ("pocket.ngc", "o<other> sub\no<other> endsub\n", "main.ngc:2:1: there is no sub pocket"),
        ("pocket.ngc", "o<pocket> sub\n", "pocket.ngc:1:1: o<pocket> sub has no end"),
    ],
)
def test_a_refusal_in_a_file_names_it_and_who_called(
    folder: Path, file: str, text: str, expected: str
) -> None:
    (folder / file).write_text(text)
    with pytest.raises(ProgramError) as caught:
        moves(whole(folder, MAIN))
    assert str(caught.value).startswith(expected)
    if "no feed" in expected:
        assert "called by o<pocket> call on line 2 of main.ngc" in str(caught.value)


@pytest.mark.parametrize(
    ("before", "line"),
    [
        ("", "G1 X9999 F500"),
        ("G64 P0.01\n", "G1 X9999 F500"),
        ("", "G2 X1 I4000 F500"),
        ("", "G52 X1 Y1 Z1 F5."),
    ],
    ids=["line", "row of lines", "arc", "surface"],
)
def test_what_the_path_refuses_in_a_file_names_it_and_who_called(
    folder: Path, before: str, line: str
) -> None:
    points = "\nX0 Y0 Z9" * 7 if "G52" in line else ""
    (folder / "pocket.ngc").write_text(
        f"o<pocket> sub\nG1 X1 F500\n  {line}{points}\nG1 X2\no<pocket> endsub\n"
    )
    on = machine("fig4a")
    read = Program("main.ngc", tuple(blocks.stream(whole(folder, before + MAIN), on, "main.ngc")))
    with pytest.raises(ProgramError) as caught:
        path.trace(read, on, kinematics_of(on), homed(on))
    assert str(caught.value).startswith("pocket.ngc:3:3: ")
    assert f"called by o<pocket> call on line {2 + bool(before)} of main.ngc" in str(caught.value)


def test_lines_that_block_delete_leaves_out_are_comments() -> None:
    text = b"/G0 X1\nG0 X2\r\n /N5 G0 X3\nG0 X[4/2]\n"
    assert [x for _, x in moves(linked.without_deleted(text))] == ["X2", "X2"]
    assert [line for line, _ in moves(text)] == [1, 2, 3, 4]
