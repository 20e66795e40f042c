"""A command line that is not understood is refused in the reader's language, in what typer says, too."""

from __future__ import annotations

import ast
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import typer

from controller import messages
from controller.cli import usage_errors
from controller.messages import LANGUAGES

# Of types that no command takes, open files and UUIDs; what a programmer did wrong; one made of two parts.
NOT_OURS = ("is not a valid UUID", "'x': x", "callback", "iterable", "requires x")
RAISES = ("fail", "UsageError", "BadParameter", "NoSuchOption", "BadOptionUsage", "BadArgumentUsage")

LINES = {
    "status --nonsense": "Diese Option gibt es nicht: --nonsense",
    "nonsense": "Den Befehl 'nonsense' gibt es nicht.",
    "statsu": "Gemeint ist vielleicht 'status'",
    "jog": "Es fehlt das Argument 'axis'.",
    "runs --most 0": "Ungültiger Wert für '--most': 0 ist außerhalb von 1<=x<=200.",
    "start --line x": "Ungültiger Wert für '--line': 'x' ist keine ganze Zahl.",
    "override 10 20": "Überzählige Argumente (20)",
    "alarms --acknowledge": "Die Option '--acknowledge' verlangt einen Wert.",
    "users add a --role x": "'x' ist keins von 'view', 'operate', 'set_up'.",
    "drives": " drives [OPTIONEN] BEFEHL [ARGUMENTE]...",
}


def directrix(*words: str, language: str = "de") -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "controller", *words],
        env={**os.environ, "DIRECTRIX_LANGUAGE": language, "COLUMNS": "120"},
        capture_output=True,
        text=True,
        timeout=60,
    )


@pytest.mark.parametrize("line", LINES)
def test_it_is_refused_in_german_with_all_that_is_around_it(line: str) -> None:
    found = directrix(*line.split())
    assert found.returncode == 2, found
    shown = found.stdout + found.stderr
    assert LINES[line] in shown
    for word in ("Usage", "Error", "Try ", "OPTIONS", "COMMAND", "Options", "Commands"):
        assert word not in shown, shown


def test_in_json_too_and_in_the_language_of_its_own_option() -> None:
    found = directrix("status", "--jsn", "--json", "--language", "de", language="en")
    assert json.loads(found.stdout)["error"].startswith(
        "Diese Option gibt es nicht: --jsn (möglich: --json);"
    )


def written() -> Iterator[str]:
    """The sentences of typer's refusals, as its source has them, with x at every place."""
    for file in sorted(Path(typer.__file__).parent.rglob("*.py")):
        for one in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(one, ast.Call) and ast.unparse(one.func).rpartition(".")[2] in RAISES:
                yield from filter(None, map(filled, one.args))


def filled(argument: ast.expr) -> str:
    """An f-string or a constant, or what a call around it has (gettext's, str.format)."""
    if isinstance(argument, ast.JoinedStr):
        parts = [part.value if isinstance(part, ast.Constant) else "x" for part in argument.values]
        return "".join(map(str, parts))
    found = (part for part in ast.walk(argument) if isinstance(argument, ast.Call))
    constants = [argument, *found]
    words = [part.value for part in constants if isinstance(part, ast.Constant)]
    return next((re.sub("{.*?}", "x", word) for word in words if isinstance(word, str) and " " in word), "")


def test_every_refusal_that_typer_has_is_recognised(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also after typer has become another: a sentence that it has anew would be English in all languages."""
    english = LANGUAGES["en"]
    marked = {key: f"⟦{text}⟧" for key, text in english.texts.items()}
    monkeypatch.setitem(LANGUAGES, "xx", english._replace(texts=marked))
    sentences = [one for one in written() if not any(words in one for words in NOT_OURS)]
    sentences = [one.replace("x x does not", "File x does not") for one in sentences]
    assert len(sentences) > 12
    for sentence in sentences:
        assert usage_errors.translated(sentence, "en") == sentence
        assert usage_errors.translated(sentence, "xx").startswith("⟦"), sentence


def test_a_sentence_inside_of_another_has_its_own_words() -> None:
    sentence = "Invalid value for '--line': 'it is not one of' is not a valid int."
    assert usage_errors.translated(sentence, "de") == (
        "Ungültiger Wert für '--line': 'it is not one of' ist keine ganze Zahl."
    )
    assert usage_errors.translated("Something else", "de") == "Something else"
    assert messages.of("de").texts["usage_frame.error"] == "Fehler"
