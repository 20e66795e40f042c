"""The table of commands: each exists, and one is imported without the others."""

from __future__ import annotations

import subprocess
import sys

import pytest
import typer

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


@pytest.mark.parametrize("words", ["hold", "start", "jog X 1", "status", "alarms"])
def test_a_client_verb_waits_for_nothing_that_plans_simulates_or_serves(words: str) -> None:
    asked = [*words.split(), "--help"]
    done = subprocess.run(
        [sys.executable, "-c", LOADED.format(heavy=HEAVY), *asked], capture_output=True, text=True, timeout=60
    )
    assert done.stdout.splitlines()[-1] == "", done.stdout.splitlines()[-1] + done.stderr
