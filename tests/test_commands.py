"""The table of commands: each exists, and one is imported without the others."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from importlib import metadata

import pytest
import typer
from typer.testing import CliRunner

from controller.__main__ import COMMANDS, FROM_A_CHECKOUT, app

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


COMPLETES = """
from controller.__main__ import main
try:
    main()
except SystemExit:
    pass
print("loaded", *(name for name in {heavy!r} if name in sys.modules))
"""


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_of_the_table_is_there_and_says_what_it_does(name: str) -> None:
    group = typer.main.get_command(app)
    listed = group.get_command(None, name)  # type: ignore[attr-defined]
    command = group.load(name)  # type: ignore[attr-defined]
    assert listed.name == command.name == name and listed.help == command.help
    assert command.params or command.commands


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
    assert re.fullmatch(rf"directrix {re.escape(metadata.version('directrix'))}\n", told)


def loaded(*words: str) -> str:
    """What of ``HEAVY`` a command line has imported."""
    asked = [sys.executable, "-c", LOADED.format(heavy=HEAVY), *words]
    done = subprocess.run(asked, capture_output=True, text=True, timeout=60)
    assert done.stdout, done.stderr
    return done.stdout.splitlines()[-1]


@pytest.mark.parametrize("words", ["hold", "status", "alarms"])
def test_a_client_verb_waits_for_nothing_that_plans_simulates_or_serves(words: str) -> None:
    assert loaded(*words.split(), "--url", "http://127.0.0.1:9") == ""


@pytest.mark.parametrize("words", ["", "hold", "jog X 1"])
def test_help_of_all_or_of_a_client_verb_waits_for_nothing_that_plans_simulates_or_serves(words: str) -> None:
    assert loaded(*words.split(), "--help") == ""


def test_help_that_is_the_value_of_an_option_is_none() -> None:
    asked = [sys.executable, "-m", "controller", "explain", "no.ngc", "--machine", "--help"]
    done = subprocess.run(asked, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout) == (1, "") and "--help: no such machine file" in done.stderr


def test_the_list_of_commands_is_shown_where_nothing_is_asked() -> None:
    shown = {**os.environ, "COLUMNS": "120"}
    run = CliRunner(env=shown).invoke
    bare, asked = (run(app, words, prog_name="directrix") for words in ([], ["--help"]))
    assert bare.output.split() == asked.output.split()
    assert {name for name in COMMANDS if f" {name} " not in asked.output} == set(FROM_A_CHECKOUT)


COMPLETED = [
    ("ch", "check"),
    ("drives sim", "simulate"),
    ("check --go", "--gouge"),
    ("demo --part c", "cone"),
]
LIGHT = ("ch",)  # the names of commands wait for none of them


@pytest.mark.parametrize(("words", "wanted"), COMPLETED)
def test_a_shell_completes_commands_options_and_choices(words: str, wanted: str) -> None:
    line = ["directrix", *words.split()]
    asked = {
        "_DIRECTRIX_COMPLETE": "complete_bash",
        "COMP_WORDS": " ".join(line),
        "COMP_CWORD": str(len(line) - 1),
    }
    ran = [sys.executable, "-c", "import sys; sys.argv[0] = 'directrix'\n" + COMPLETES.format(heavy=HEAVY)]
    done = subprocess.run(ran, env={**os.environ, **asked}, capture_output=True, text=True, timeout=60)
    assert wanted in done.stdout.split(), done.stdout + done.stderr
    assert words not in LIGHT or done.stdout.splitlines()[-1] == "loaded"
