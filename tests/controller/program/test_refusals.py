"""All refusals of a program in one answer, and who is blamed."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from support.machines.shipped_kinds import machine
from typer.testing import CliRunner

from controller.__main__ import app
from controller.messages import text
from controller.program import refusals
from controller.program.program import ProgramError

POST = "G21 G90\nG1 X1 F100\nG99.9 X2\nX1O\nM97\nG99.9 X3 E5\nX#<depth>\nG1 X4 E2\nX5\nM30\n"


def of(text: str) -> list[tuple[int, str]]:
    found = refusals.of(text.encode(), machine("fig4a"), "p")
    return [(one.line, one.about) for one in found]


def test_every_line_that_is_refused_is_told_once_with_what_is_to_blame() -> None:
    assert of(POST) == [(3, "G99.9"), (4, ""), (5, "M97"), (6, "G99.9"), (7, ""), (8, "E")]
    found = refusals.of(POST.encode(), machine("fig4a"), "p")
    assert refusals.counts(found) == {"G99.9": 2, "": 2, "M97": 1, "E": 1}
    assert text(refusals.summed(found)) == "6 refusals: G99.9 2, other 2, M97 1, E 1."


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("G1 X1 F100\nM30\n", []),
        ("o1 repeat [3]\nG1 X1\no1 endrepeat\n", [(2, "G1")]),
        ("o1 sub\nM97\no1 endsub\no1 call\no1 call\nM97\n", [(2, "M97"), (6, "M97")]),
        ("o1 if [1]\nM97\n", [(1, "")]),
        ("M97 E0 Q1\n", [(1, "M97")]),
        ("G1 X1\nG1 X1\nF5\nX2\n", [(1, "G1"), (2, "G1")]),
        ("G51 X1\nX2 Y2\nM97\n", [(1, "G51"), (3, "M97")]),
        ("", [(1, "")]),
    ],
)
def test_a_line_is_blamed_once_however_often_it_runs(text: str, expected: list[tuple[int, str]]) -> None:
    assert of(text) == expected


def test_a_loop_whose_counter_is_refused_ends_the_search(monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[int] = []
    monkeypatch.setattr(refusals, "MAX_REPEATED", 50)
    seen = refusals._Refused.append

    def watched(self: refusals._Refused, error: ProgramError) -> None:
        read.append(error.line)
        seen(self, error)

    monkeypatch.setattr(refusals._Refused, "append", watched)
    assert of("#1=1\no1 while [#1 LT 3]\n#1=[#1+#<step>]\no1 endwhile\nM97\n") == [(3, "")]
    assert read == [3] * 52


def test_check_tells_all_of_them(tmp_path: Path) -> None:
    (tmp_path / "part.ngc").write_text(POST)
    told = CliRunner().invoke(app, ["check", str(tmp_path / "part.ngc"), "--store", str(tmp_path)])
    assert told.exit_code == 1
    said = "".join(told.stderr.split())
    for line in (3, 4, 5, 6, 7, 8):
        assert f"part.ngc:{line}:" in said
    assert "6refusals:" in said
    facts = CliRunner().invoke(app, ["check", str(tmp_path / "part.ngc"), "--json"]).stdout
    found = json.loads(facts)
    assert [row["line"] for row in found["refusals"]] == [3, 4, 5, 6, 7, 8]
    assert found["counts"]["G99.9"] == 2 and found["line"] == 3


@pytest.mark.parametrize(
    ("text", "line", "told"),
    [
        ("#1=1\no1 if [#1]\nG0 X1\no1 elseif [1] D4\nG0 X2\no1 endif\n", 4, "D4 stands behind o1 elseif"),
        ("o1 repeat [2]\nG0 X1\no1 endrepeat J-4\n", 3, "J-4 stands behind o1 endrepeat"),
        ("o1 sub\no1 endsub\no2 if [0]\no2 else X1\no2 endif\nG0 X1\n", 4, "X1 stands behind o2 else"),
        ("M70\nM72 M72\nG0 X1\n", 2, "M72 and M72"),
        ("F100 S100 M3\nG85 G91\n", 2, "G85 has no place"),
        ("F100\nG2 G91\n", 2, "G2 has no place"),
        ("F100\nG10 L2 P2 X1\nG55 G41.1 D1\nG1 X5\n", 3, "G55 stands under the G41.1"),
    ],
)
def test_what_the_reference_refuses_is_not_passed_over(text: str, line: int, told: str) -> None:
    (found, *_) = refusals.of(text.encode(), machine("fig4a"), "p.ngc")
    assert (found.line, told in found.sentence) == (line, True), found


def test_a_word_in_a_sub_is_refused_with_who_called_it() -> None:
    text = b"o1 sub\nG1 X#<nope>\no1 endsub\no1 call\nG0 X1O\n"
    first, second = refusals.of(text, machine("fig4a"), "p")
    assert "called by o1 call on line 4" in first.sentence and "called" not in second.sentence


def test_a_refusal_is_shown_with_its_line_and_a_caret() -> None:
    source = "G0 X1\n\tG0 X1O\n"
    (found,) = refusals.of(source.encode(), machine("fig4a"), "p")
    sentence, line, caret = refusals.pointed(found, {"p": source.split("\n")}).split("\n")
    assert (sentence, line, line[caret.index("^")]) == (str(found), "     G0 X1O", "O")
    assert refusals.pointed(found, {"another": source.split("\n")}) == str(found)
    (row,) = refusals.facts([found], refusals.lines_of(source.encode(), "p"), "p")["refusals"]
    assert row["shown"] == [" G0 X1O", "      ^"] and row["key"] == found.said["key"]


def test_the_caret_of_a_long_line_and_of_a_called_file_is_shown() -> None:
    source = f"({'x' * 300}) G0 X1O\n"
    (found,) = refusals.of(source.encode(), machine("fig4a"), "p")
    line, caret = refusals.shown(found, refusals.lines_of(source.encode(), "p"))
    assert line[caret.index("^")] == "O" and len(line) <= refusals.MAX_WIDE


@pytest.mark.parametrize("options", [[], ["--language", "de"]])
def test_a_single_refusal_has_its_line_and_caret_too(tmp_path: Path, options: list[str]) -> None:
    (tmp_path / "part.ngc").write_text("G0 X1\nG0 X1O\n")
    told = CliRunner().invoke(app, ["check", str(tmp_path / "part.ngc"), *options])
    *_, line, caret = told.stderr.rstrip().split("\n")
    assert told.exit_code == 1 and line[caret.index("^")] == "O"
    assert ("ist das eine Null" if options else "is it a zero") in told.stderr


@pytest.mark.parametrize(
    ("line", "column", "about"),
    [
        ("M67 E5 Q1", 1, "M67"),
        ("G41 D99", 5, "G41"),
        ("G10 L2 P77 X1", 8, "G10"),
        ("G10 P1", 1, "G10"),
        ("G5.1 X1 I1 J1 Q3", 15, "G5.1"),
        ("G1 X1 Q7", 7, "Q"),
        ("G0 X[1/0]", 7, ""),
        ("G0 X[2 + 1 mod 0]", 12, ""),
        ("G0 X[1 + sqrt[-1]]", 10, ""),
        ("#1=[2**9999]", 6, ""),
    ],
)
def test_the_code_is_blamed_for_its_letters_and_the_operator_for_its_value(
    line: str, column: int, about: str
) -> None:
    (found, *_) = refusals.of(f"G21 F100\n{line}\n".encode(), machine("fig4a"), "p")
    assert (found.line, found.column, found.about) == (2, column, about), found


@pytest.mark.parametrize(
    ("code", "told"),
    [
        ("G43.7", "not known here: the codes of this control are G0 G1"),
        ("M333", "not known here: the codes of this control are M0 M1"),
        ("M777", "or name an output for it"),
        ("M33", 'a code of dialect = "fanuc"'),
        ("G12.1", "is not done here"),
    ],
)
def test_an_unknown_code_is_not_known_here(code: str, told: str) -> None:
    (found, *_) = refusals.of(f"{code}\n".encode(), machine("fig4a"), "p")
    assert told in found.sentence, found


@pytest.mark.parametrize(
    "line", ["G0 X1O", "G0 X1OY2", "G0 X10O", "G1X1 Y2O F100", "G0 X#1O", "G0 XO5", "G0 Z-O"]
)
def test_a_letter_o_behind_a_number_is_asked_after_and_never_to_be_removed(line: str) -> None:
    (found, *_) = refusals.of(f"{line}\n".encode(), machine("fig4a"), "p")
    assert "is it a zero" in found.sentence and "remove" not in found.sentence, found
