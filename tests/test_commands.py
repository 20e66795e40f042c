"""The table of commands: each exists, and one is imported without the others."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from controller.__main__ import COMMANDS, FILES, app
from controller.cli import declarations

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


@pytest.mark.parametrize("words", ["", "check", "calibrate part", "drives simulate", "jog X 1"])
def test_help_waits_for_nothing_that_plans_simulates_or_serves(words: str) -> None:
    """And the list of all commands has every file of them imported."""
    assert loaded(*words.split(), "--help") == ""


HELP = """
import contextlib, io, sys
from controller.__main__ import FILES, app
from controller.cli import declarations
if sys.argv[1] == "declared":
    sys.argv[1] = "--help"
assert declarations.asked_for() is (sys.argv[1] == "--help")
def shown(words):
    told = io.StringIO()
    with contextlib.redirect_stdout(told), contextlib.suppress(SystemExit):
        app([*words, "--help"], prog_name="directrix")
    print(told.getvalue())
    return told.getvalue()
import typer
top = typer.main.get_command(app)
for name in FILES[sys.argv[-1]]:
    shown([name])
    command = top.get_command(None, name)
    if getattr(command, "invoke_without_command", False):
        continue  # its own body runs before the help of those below it: that begins again, with all bodies
    for one in getattr(command, "commands", ()):
        shown([name, one])
"""


@pytest.mark.slow
@pytest.mark.parametrize("file", FILES)
def test_the_help_of_a_command_is_what_it_would_be_with_all_that_it_works_with(file: str) -> None:
    told = [
        subprocess.run([sys.executable, "-c", HELP, how, file], capture_output=True, text=True, timeout=120)
        for how in ("wholly", "declared")
    ]
    assert told[0].stdout == told[1].stdout and "Usage" in told[0].stdout, told[1].stderr
    assert [one.stderr for one in told] == ["", ""]


def test_what_is_kept_of_a_file_for_its_help_is_of_the_file_as_it_is(
    tmp_path: Path, monkeypatch: Any
) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    file = tmp_path / "verb.py"
    docs = []
    for text in ("Once.", "Later, and longer."):
        file.write_text(f'def verb() -> None:\n    """{text}"""\n    raise KeyError\n')
        for damaged in (False, True, False):
            kept = Path(importlib.util.cache_from_source(str(file), optimization="declared"))
            if damaged:
                kept.write_bytes(kept.read_bytes()[:-9])
            found: dict[str, Any] = {}
            exec(declarations._Loader("verb", str(file)).get_code("verb"), found)
            docs.append(found["verb"].__doc__)
    assert docs == ["Once."] * 3 + ["Later, and longer."] * 3


def test_help_that_is_the_value_of_an_option_is_none() -> None:
    asked = [sys.executable, "-m", "controller", "explain", "no.ngc", "--machine", "--help"]
    done = subprocess.run(asked, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout) == (1, "") and "--help: no such machine file" in done.stderr


@pytest.mark.parametrize("words", [["--help"], []])
def test_the_list_of_commands_is_what_it_would_be_with_their_options(words: list[str]) -> None:
    shown = {**os.environ, "COLUMNS": "120"}
    done = subprocess.run(
        [sys.executable, "-m", "controller", *words], env=shown, capture_output=True, text=True, timeout=60
    )
    whole = CliRunner(env=shown).invoke(app, ["--help"], prog_name="python -m controller").output
    assert done.stdout.split() == whole.split()


COMPLETED = [
    ("ch", "check"),
    ("drives sim", "simulate"),
    ("check --go", "--gouge"),
    ("demo --part c", "cone"),
]


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
    assert done.stdout.splitlines()[-1] == "loaded"
