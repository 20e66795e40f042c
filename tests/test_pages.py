"""The pages beside the code name what exists: files, commands with their options, faults, inputs, outputs."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Any

import pytest
import typer

from controller.__main__ import app
from controller.machine.equipment import INPUTS, OUTPUTS
from controller.state.modes import Fault

ROOT = Path(__file__).resolve().parent.parent
ROOMS = (".", "config", "config/programs", "controller", "drives", "systemd", "tests")
FILES = {
    **{room: ROOT / room / "README.md" for room in ROOMS},
    "computer": ROOT / "systemd" / "COMPUTER.md",
    "first chip": ROOT / "config" / "TUTORIAL.md",
}
PAGES = {name: file.read_text(encoding="utf-8") for name, file in FILES.items()}
LONGEST = 150  # lines of the first page: what a person reads before deciding


BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)


def blocks(page: str, language: str) -> list[str]:
    return [text for named, text in BLOCK.findall(page) if named == language]


def in_backticks(page: str) -> list[str]:
    return [" ".join(found.split()) for found in re.findall(r"`([^`]+)`", BLOCK.sub("", page))]


def command_lines(page: str) -> list[str]:
    """What begins with ``directrix``, in shell blocks and in backticks."""
    lines = [part.strip() for block in blocks(page, "sh") for part in re.split(r"\n|&&", block)]
    found = [line.removeprefix("sudo ").removeprefix(".venv/bin/") for line in lines + in_backticks(page)]
    return [line for line in found if line.startswith("directrix ")]


COMMANDS = sorted({(room, line) for room, page in PAGES.items() for line in command_lines(page)})


def test_the_first_page_is_short() -> None:
    assert len(PAGES["."].splitlines()) <= LONGEST


@pytest.mark.parametrize("room", PAGES)
def test_every_link_leads_somewhere(room: str) -> None:
    links = re.findall(r"\]\(([^)#]+)\)", PAGES[room])
    assert not [link for link in links if "://" not in link and not (FILES[room].parent / link).exists()]


@pytest.mark.parametrize(("room", "line"), COMMANDS)
def test_every_command_exists_with_the_options_that_are_named(room: str, line: str) -> None:
    words = shlex.split(line, comments=True)[1:]
    command: Any = typer.main.get_command(app).load(words.pop(0))  # type: ignore[attr-defined]
    while words and hasattr(command, "get_command") and not words[0].startswith("-"):
        name = words.pop(0)
        within, command = command, command.get_command(None, name)
        assert command is not None, f"{within.name} has no {name}"
    known = {name for given in command.params for name in (*given.opts, *given.secondary_opts)}
    assert {word for word in words if word.startswith("--")} <= known


def test_every_path_in_the_tree_of_the_controller_exists() -> None:
    table = [row.split("|")[2] for row in PAGES["controller"].splitlines() if row.count("|") == 5]
    named = {name for cell in table for name in re.findall(r"`([a-z_/]+)(?:\.[a-z_]+)?`", cell)}
    assert len(named) > 10
    homes = (ROOT / "controller", ROOT)
    assert not [
        name
        for name in named
        if not any((home / name).exists() or (home / f"{name}.py").exists() for home in homes)
    ]


def test_every_fault_of_the_wiring_is_one() -> None:
    named = set(re.findall(r"\b[A-Z]+_[A-Z_]+\b", PAGES["config"])) - {"CAN_H", "CAN_L"}
    assert {"ESTOP_INPUT", "TORQUE_OFF", "LIMIT_SWITCH"} <= named
    assert {name for name in named if name in Fault.__members__ or f"`{name}`" not in PAGES["config"]} <= set(
        Fault.__members__
    )


@pytest.mark.parametrize("name", [*INPUTS, *OUTPUTS])
def test_every_input_and_output_is_described(name: str) -> None:
    assert f"`{name}`" in PAGES["config"]


@pytest.mark.parametrize("room", PAGES)
def test_drawings_are_not_cut_by_a_page_of_120_columns(room: str) -> None:
    assert all(len(line) <= 120 for drawing in blocks(PAGES[room], "") for line in drawing.splitlines())
