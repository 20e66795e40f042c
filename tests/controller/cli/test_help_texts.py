"""``--help`` is made of the catalogue: by the paths of the commands and the names of what they take."""

from __future__ import annotations

import ast
import inspect
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer

from controller import messages
from controller.__main__ import COMMANDS, app
from controller.cli import help_texts

ROOT = Path(messages.__file__).parent.parent.parent


def every() -> Iterator[tuple[str, Any]]:
    """Every command with its path."""
    top: Any = typer.main.get_command(app)
    left = [(name, top.load(name)) for name in COMMANDS]
    while left:
        path, command = left.pop()
        yield path, command
        left += [(f"{path}.{name}", one) for name, one in getattr(command, "commands", {}).items()]


def test_no_text_of_the_catalogue_is_of_a_command_or_an_option_that_is_gone() -> None:
    wanted = {"help", "help.--version", "help.--install-completion", "help.--show-completion"}
    for path, command in every():
        wanted.add(f"help.{path}")
        for one in command.params:
            name = next((option for option in one.opts if option.startswith("--")), one.name)
            wanted |= {f"help.{path}.{name}", f"help.{name}"}
    texts = {key for key in messages.LANGUAGES["en"].texts if key.split(".")[0] == "help"}
    assert len(texts) > 300 and texts - wanted == set()


def test_what_the_function_of_a_command_says_of_itself_is_what_its_help_says() -> None:
    for path, command in every():
        said = inspect.getdoc(inspect.unwrap(command.callback)) if command.callback else None
        if said and not hasattr(command, "commands"):
            assert said.split() == messages.LANGUAGES["en"].texts[f"help.{path}"].split(), path


def test_no_text_of_help_is_written_in_a_command() -> None:
    for file in sorted(Path(help_texts.__file__).parent.glob("*.py")):
        for call in ast.walk(ast.parse(file.read_text())):
            if isinstance(call, ast.Call) and ast.unparse(call.func).startswith("typer."):
                assert "help" not in {one.arg for one in call.keywords}, (file.name, call.lineno)


@pytest.mark.parametrize("words", [["--help"], ["home", "--help"], ["demo", "--help"]])
def test_a_language_that_is_dropped_into_the_folder_is_that_of_help(tmp_path: Path, words: list[str]) -> None:
    """No line of it is English then: neither ours nor what typer says around."""
    shutil.copytree(ROOT / "controller", tmp_path / "controller", ignore=shutil.ignore_patterns("*.pyc"))
    for folder in ("drives", "config"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    english = json.loads((messages.FOLDER / "en.json").read_text(encoding="utf-8"))
    third = {key: "".join("ж" if one.islower() else one for one in text) for key, text in english.items()}
    keep = {key: english[key] for key in ("help.--language",)}  # it has a place for a value
    (tmp_path / "controller/messages/xx.json").write_text(json.dumps({**third, **keep}), encoding="utf-8")
    found = subprocess.run(
        [sys.executable, "-m", "controller", *words],
        cwd=tmp_path,
        env={**os.environ, "DIRECTRIX_LANGUAGE": "xx", "COLUMNS": "200", "PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert found.returncode == 0, found.stderr
    assert found.stdout.count("жж") > 10 and (words == ["--help"] or "en, de, xx" in found.stdout)
    for phrase in ("Show this", "Options", "Usage:", "default:", "Machine file", "Name of", "required"):
        assert phrase not in found.stdout, found.stdout
    assert not {"<str>", "<path>", "<float>", "<int"} & set(found.stdout.split()), found.stdout
