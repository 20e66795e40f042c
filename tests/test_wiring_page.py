"""The wiring page names what exists: faults, keys of machine files, inputs, commands."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from controller.__main__ import COMMANDS
from controller.equipment import INPUTS, OUTPUTS
from controller.state import Fault

PAGE = Path(__file__).resolve().parent.parent / "config" / "README.md"
TEXT = PAGE.read_text(encoding="utf-8")


def test_every_fault_that_it_names_is_one() -> None:
    named = set(re.findall(r"\b[A-Z]+_[A-Z_]+\b", TEXT)) - {"CAN_H", "CAN_L"}
    assert {"ESTOP_INPUT", "TORQUE_OFF", "LIMIT_SWITCH"} <= named <= set(Fault.__members__)


@pytest.mark.parametrize("name", [*INPUTS, *OUTPUTS])
def test_every_input_and_output_is_described(name: str) -> None:
    assert f"`{name}`" in TEXT


def test_every_command_that_it_names_exists() -> None:
    named = set(re.findall(r"`directrix (\w+)", TEXT))
    assert named <= COMMANDS.keys(), f"unknown: {named - COMMANDS.keys()}"


def test_its_drawings_are_not_cut_by_a_page_of_120_columns() -> None:
    drawings = re.findall(r"```\n(.*?)```", TEXT, re.DOTALL)
    assert len(drawings) == 3
    assert max(len(line) for drawing in drawings for line in drawing.splitlines()) <= 120
