"""What the path and its surfaces are refused for, and what a check notes, are texts of the catalogue."""

from __future__ import annotations

import ast
import json
import re
import string
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from support.machines.shipped_kinds import machine
from typer.testing import CliRunner

from controller import messages
from controller.__main__ import app
from controller.geometry.defects import Defect, DefectKind
from controller.messages import LANGUAGES, Message, message, text
from controller.plan.surfaces import cuts
from controller.program import code_table
from controller.program.code_rows import Fate
from controller.program.program import ProgramError
from controller.runtime import checked
from controller.verify.gouges import ADVICE, Gouge

CONTROLLER = Path(messages.__file__).parent.parent
# First parts of the keys: of the path and its surfaces, and of what a check notes.
PATH = "path|stored|note|travel|reach|curve|probing|cut|defect|gouge|form|lead|join|limit|row|restart|aside"
NOTES = "note|doubt|told|meaning"
ROOMS = ("plan", "geometry", "motion")
FILES = (
    "runtime/checked.py",
    "machine/kinematics/protocol.py",
    *(f"verify/{name}.py" for name in ("audit", "gouges", "looks", "forms")),
)
FOUND = [
    *(CONTROLLER / name for name in FILES),
    *(file for room in ROOMS for file in sorted((CONTROLLER / room).rglob("*.py"))),
]
# Of our own mistakes, which no program makes: they end as an internal error.
OWN = {"ValueError", "TypeError", "AssertionError", "LinAlgError", "NoLaw", "KeyError"}
SENTENCE = re.compile(r"[a-z]+ [a-z]+ [a-z]+")


def written(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Every text that is no docstring and no error of our own, with its line."""
    raised = tree.exc if isinstance(tree, ast.Raise) else None
    if isinstance(raised, ast.Call) and ast.unparse(raised.func).split(".")[-1] in OWN:
        return
    if isinstance(tree, ast.Constant) and isinstance(tree.value, str):
        yield tree.lineno, tree.value
    for child in ast.iter_child_nodes(tree):
        is_docstring = isinstance(child, ast.Expr) and isinstance(child.value, ast.Constant)
        if not is_docstring:
            yield from written(child)


@cache
def rows() -> list[tuple[str, int, str]]:
    """Of all files: the file, and what is written in it."""
    trees = {str(file.relative_to(CONTROLLER)): ast.parse(file.read_text()) for file in FOUND}
    return [(file, *one) for file, tree in trees.items() for one in written(tree)]


def test_no_sentence_is_written_where_it_is_raised_or_noted() -> None:
    assert len(FOUND) > 80
    found = [row for row in rows() if SENTENCE.search(row[2])]
    assert found == []


def of_topics(topics: str) -> dict[str, str]:
    return {key: words for key, words in LANGUAGES["en"].texts.items() if re.match(rf"({topics})\.", key)}


@cache
def keys() -> set[str]:
    """All texts of these rooms that look like keys of the catalogue."""
    key = re.compile(rf"({PATH})\.[\w.]*\w")
    begun = {"form.motion", "gouge.body", "defect", "limit", "aside"}  # of keys that are put together
    return {words for _, _, words in rows() if key.fullmatch(words)} - begun


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_key_of_these_rooms_has_its_text(language: str) -> None:
    assert len(keys()) > 80
    assert sorted(keys() - LANGUAGES[language].texts.keys()) == []


def test_every_text_is_said_somewhere() -> None:
    """By its key, or by one that is put together."""
    made = {f"defect.{kind.value}" for kind in DefectKind}
    made |= {f"gouge.{kind.replace(' ', '_')}" for kind in ADVICE}
    made |= {f"gouge.{one}" for one in ("left", "right", "body.cutter", "body.shank", "body.holder")}
    made |= {"aside.retract", "aside.return", "limit.velocity", "limit.acceleration", "limit.jerk"}
    made |= of_topics("form|meaning").keys()  # of verdicts, and of codes that another dialect has
    rest = of_topics(f"{PATH}|{NOTES}").keys() - made
    source = "\n".join(f.read_text() for f in CONTROLLER.rglob("*.py") if f.parent.name != "messages")
    rows = [row.noted_with()["values"] for row in code_table.ROWS if row.fate is Fate.NOTED]
    said_of_codes = {value["key"] for row in rows for value in (row["meaning"], row["told"])}
    assert len(said_of_codes) > 50
    assert [key for key in sorted(rest - said_of_codes) if f'"{key}"' not in source] == []


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_figures_of_a_text_are_written_alike_in_every_language(language: str) -> None:
    def figures(words: str) -> set[tuple[str, str | None]]:
        return {(name, form) for _, name, form, _ in string.Formatter().parse(words) if name}

    for key, words in of_topics(f"{PATH}|{NOTES}").items():
        assert figures(LANGUAGES[language].texts[key]) == figures(words), key


def told(one: Message) -> dict[str, str]:
    """A text in every language; each is whole, and no two are the same."""
    found = {language: text(one, language) for language in ("en", "de")}
    assert found["en"] != found["de"]
    for words in found.values():
        assert "{" not in words and one["key"] not in words, words
    return found


@pytest.mark.parametrize("kind", DefectKind)
def test_every_defect_of_a_surface_is_said_in_german_too(kind: DefectKind) -> None:
    told(cuts.describe(Defect(kind, 0.25, 0.5, 91.0)))


@pytest.mark.parametrize("kind", ADVICE)
@pytest.mark.parametrize("u", [0.25, None])
def test_every_gouge_is_said_in_german_too(kind: str, u: float | None) -> None:
    body = "holder" if kind in ("table", "stock") else ""
    one = Gouge(kind, 4, 9, "lead in", 2, 0.125, u, u, (1.0, 2.0, 3.0), 3.5, body)
    found = told(one.with_advice("gouge.refused", more=message("gouge.more", more=2)))
    assert all("0.125 mm" in words for words in found.values())


RULED = "M3 S9000\nG52 X0. Y{y}. Z10. F500.\nX5. Y{y}. Z10.\nX10. Y{y}. Z10.\nX15. Y{y}. Z10.\n"
LOWER = "X0. Y0. Z{z}.\nX5. Y0. Z{z}.\nX10. Y0. Z{z}.\nX15. Y0. Z{z}.\n"


@pytest.mark.parametrize(
    ("program", "german"),
    [
        ("G0 X9999\n", "außerhalb des Verfahrwegs"),
        ("G43.4 G0 X9999\n", "außerhalb des Verfahrwegs"),
        (RULED.format(y=0) + LOWER.format(z=10), "Leitkurve"),
        (RULED.format(y=0) + LOWER.format(z=0).replace("X15. Y0.", "X15. Y0."), ""),
        ("T77 M6\nG0 X1\n", ""),
        ("G1 F0.001 X50\n", "longest_program_h"),
        ("G38.2 X0 F100\n", ""),
    ],
)
def test_what_a_path_is_refused_for_is_said_in_german_too(program: str, german: str) -> None:
    asked = checked.task(program.encode(), "part.ngc", machine("fig4a"))
    try:
        _, kept = checked.looked_at(asked)
    except ProgramError as error:
        assert german in told(error.said)["de"]
    else:
        assert german == ""
        assert all(told(note.said)["de"] for note in kept.notes)


@pytest.mark.parametrize(
    ("language", "words"), [("en", "G64 without P blends"), ("de", "G64 ohne P verrundet nur")]
)
@pytest.mark.parametrize("verb", ["check", "simulate"])
def test_notes_are_told_in_the_language_that_is_asked_for(
    tmp_path: Path, verb: str, language: str, words: str
) -> None:
    part = tmp_path / "part.ngc"
    part.write_text("G21 G64 G1 X0.1 F500\nM2\n")
    options = ["--language", language, "--store", str(tmp_path), "--json"]
    (note,) = json.loads(CliRunner().invoke(app, [verb, str(part), *options]).stdout)["notes"]
    assert note["note"].startswith(words) and note["key"] == "note.exact" and note["line"] == 1


def test_what_comes_of_numpy_is_a_figure_of_a_text() -> None:
    """A number of another kind would be kept as words, which no figure can be made of."""
    assert text(message("travel.in", motion=np.float64(1.5))) == " in the 1.5"
    assert text(message("cut.form_tolerance", most=np.float64(0.25))).endswith("0.25 mm)")
