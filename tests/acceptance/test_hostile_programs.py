"""Programs that mean harm: planned, or refused with a place in the program and a reason; nothing else."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import pytest
from support.parts.hostile_programs import MACHINES, outcome, program

from controller.machine import machine_file
from controller.machine.model import Machine

FEW, MANY = range(8, 20), 40


@pytest.fixture(scope="module")
def machines() -> dict[str, Machine]:
    return {name: machine_file.load(name) for name in MACHINES}


def checked(seeds: range, machines: dict[str, Machine], folder: Path) -> list[str]:
    found = []
    for seed in seeds:
        name, text = program(seed)
        try:
            found.append(outcome(machines[name], text, folder))
        except Exception as error:
            raise AssertionError(f"seed {seed} on {name}") from error
    return found


def test_hostile_programs_are_planned_or_refused_with_a_place(
    machines: dict[str, Machine], tmp_path: Path
) -> None:
    found = checked(FEW, machines, tmp_path)
    assert len(set(found)) > len(FEW) / 3, "they are refused for many reasons"


def test_a_placed_ruling_that_passes_by_the_pole_is_judged_by_its_surface(
    machines: dict[str, Machine], tmp_path: Path
) -> None:
    """A rotary turns all but at once where a ruling of P2 passes 40 nm by the pole: slow, but a way."""
    name, text = program(331)
    long = replace(machines[name], tools=tuple(replace(one, flute_mm=40.0) for one in machines[name].tools))
    assert "line 5 exceeds its form tolerance of 0.05 mm" in outcome(long, text, tmp_path)
    assert outcome(replace(machines[name], gouge="warn"), text, tmp_path) == "planned"


def test_rulings_that_lie_down_under_a_nutating_head(machines: dict[str, Machine], tmp_path: Path) -> None:
    """The upper curve lies a micron beside the lower one, so the axis is at the limit of reach."""
    (found,) = checked(range(50420, 50421), machines, tmp_path)
    assert "the limit of what the rotary axes reach" in found


@pytest.mark.slow
@pytest.mark.parametrize("batch", range(12))
def test_more_hostile_programs(batch: int, machines: dict[str, Machine], tmp_path: Path) -> None:
    first = 1000 + batch * MANY + 10_000 * int(os.environ.get("HOSTILE_SEED", "0"))
    checked(range(first, first + MANY), machines, tmp_path)
