"""Tables of the desk in the reader's language, within 80 columns."""

from __future__ import annotations

import json
import re
import string
from pathlib import Path

import pytest
from typer.testing import CliRunner

from controller import messages
from controller.__main__ import app
from controller.messages import LANGUAGES
from controller.plan.report import tally
from controller.program.program import Act
from controller.state.modes import AXIS_KINDS, Binding, binding_text
from controller.verify import tables

CONTROLLER = Path(messages.__file__).parent.parent
PART = "G21 G54 S500 M3\nG0 X1 Y1\nG1 X5 F500\nX9\nG2 X9 I2\nG4 P0.1\nM5\nM30\n"


def in_german(*words: str) -> str:
    result = CliRunner().invoke(app, [*words, "--language", "de"])
    assert result.exit_code == 0, result.output
    return result.stdout


@pytest.fixture
def part(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setenv("COLUMNS", "80")
    (tmp_path / "part.ngc").write_text(PART)
    return str(tmp_path / "part.ngc")


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_word_of_a_table_is_there_in_every_language(language: str) -> None:
    files = [file for room in ("cli", "verify") for file in sorted((CONTROLLER / room).glob("*.py"))]
    source = "\n".join(file.read_text() for file in files)
    rows = re.findall(r'\(("line", "(?:what|where|cutter)[^)]*|"axis", "from[^)]*)\)', source)
    heads = {f"table.{head}" for row in rows for head in re.findall(r'"([\w ]+)"', row)}
    kinds = {f"table.kind.{act.name.lower().replace('_', ' ')}" for act in Act if act is not Act.PROBE}
    wanted = {*re.findall(r'"(table\.\w+)"[,)]', source), *heads, *kinds}
    assert len(wanted) > 60
    assert sorted(key for key in wanted if key not in LANGUAGES[language].texts) == []


def test_the_figures_of_a_text_are_the_same_in_german() -> None:
    def figures(words: str) -> set[tuple[str | None, str | None]]:
        return {(name, form) for _, name, form, _ in string.Formatter().parse(words) if name}

    tables = re.compile(r"(ended|table|drive_table|bus_table|tool_file)\.")
    for key, words in LANGUAGES["en"].texts.items():
        assert not tables.match(key) or figures(LANGUAGES["de"].texts[key]) == figures(words), key


@pytest.mark.parametrize("language", LANGUAGES)
def test_whatever_binds_has_its_word(language: str) -> None:
    axes, page = list("XYZAC"), LANGUAGES[language].page
    named = [binding_text(one, axes) for one in Binding if one is not Binding.AXIS]
    assert [one for one in (*named, *AXIS_KINDS) if f"bound.{one}" not in page] == []


def test_what_binds_is_said_in_the_words_of_the_page() -> None:
    found = tables.binding_texts([tally.Bound("feed", 0.9), tally.Bound("C jerk", 0.1, "C", "jerk")])
    assert found == ["programmed feed 90 %", "C jerk 10 %"]


def test_check_is_read_in_german_at_80_columns(part: str, tmp_path: Path) -> None:
    told = in_german("check", part, "--store", str(tmp_path))
    for words in (
        "Sätze: mm",
        "Zeile",
        "Verfahrweg",
        "Eilgang",
        "Kreisbogen",
        "kann auf trunnion laufen",
        "Vorschub",
    ):
        assert words in told, words
    assert max(map(len, told.splitlines())) <= 80


def test_explain_says_kinds_and_facts_in_german_and_keeps_its_json(part: str) -> None:
    told = in_german("explain", part)
    for words in ("Eilgang", "Gerade", "Kreisbogen", "Vorschub 500 mm/min", "Mitte X", "1/min 500"):
        assert words in told, words
    rows = [json.loads(line) for line in in_german("explain", part, "--json").splitlines()]
    assert [row["kind"] for row in rows][:4] == ["spindle", "rapid", "line", "line"]
    assert rows[2]["feed"] == pytest.approx(500.0)
