"""The table of commands: each exists, and one is imported without the others."""

from __future__ import annotations

import re
import subprocess
import sys
from importlib import metadata

import pytest
import typer
from typer.testing import CliRunner

from controller.__main__ import COMMANDS, app

HEAVY = ("scipy", "numpy", "can", "canopen", "matplotlib", "fastapi", "sqlite3", "controller.plan")
LOADED = """
import sys
from controller.__main__ import app
try:
    app(sys.argv[1:], standalone_mode=False)
except SystemExit:
    pass
print(*(name for name in {heavy!r} if name in sys.modules))
"""


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_of_the_table_is_there_and_says_what_it_does(name: str) -> None:
    group = typer.main.get_command(app)
    command = group.get_command(None, name)  # type: ignore[attr-defined]
    assert command.name == name and command.help


CHOICES = [
    ("check p.ngc --gouge", "refuse warn"),
    ("simulate p.ngc --gouge", "refuse warn"),
    ("simulate p.ngc --faults-from", "program home"),
    ("verify p.ngc --gouge", "refuse warn"),
    ("demo --part", "cone ruled"),
    ("import p.step --direction", "climb conventional"),
    ("import p.step --placement", "single double optimal machine"),
    ("serve --late", "stop count"),
    ("dnc receive --port x --format", "7E2 7E1 8N1"),
    ("dnc receive --port x --flow", "xon rts none"),
    ("dnc send O1 --port x --line-end", "own lf crlf cr lfcrcr"),
    ("users add anna --role", "view operate set_up"),
    ("tokens add cam --role", "view operate set_up"),
]


@pytest.mark.parametrize(("words", "allowed"), CHOICES, ids=[words for words, _ in CHOICES])
def test_a_word_that_is_none_of_an_options_is_refused_with_those_that_are(words: str, allowed: str) -> None:
    done = CliRunner(env={"COLUMNS": "200"}).invoke(app, [*words.split(), "elsewhere"])
    assert done.exit_code == 2
    said = " ".join(done.output.split())
    assert words.split()[-1] in said and all(f"'{word}'" in said for word in allowed.split()), said


def test_the_version_is_that_of_the_package() -> None:
    told = CliRunner().invoke(app, ["--version"]).output
    assert re.fullmatch(rf"directrix {re.escape(metadata.version('directrix'))}, (not )?compiled\n", told)


@pytest.mark.parametrize("words", ["hold", "start", "jog X 1", "status", "alarms"])
def test_a_client_verb_waits_for_nothing_that_plans_simulates_or_serves(words: str) -> None:
    asked = [*words.split(), "--help"]
    done = subprocess.run(
        [sys.executable, "-c", LOADED.format(heavy=HEAVY), *asked], capture_output=True, text=True, timeout=60
    )
    assert done.stdout.splitlines()[-1] == "", done.stdout.splitlines()[-1] + done.stderr
