"""Every fault in every mode: all axes at rest within the table's promise, named, recorded, recovered from.

The slow part is the whole matrix (fault_cases x six modes) and prints it; the fast part is a slice.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from support.faults import matrix, spindle_scene
from support.faults.cases import CASES, Case
from support.faults.matrix import Cell

BY_NAME = {case.name: case for case in CASES}
SLICE = (
    ("TPDO dropped once", ("homing", "jog")),
    ("TPDO dropped twice", ("homing",)),
    ("SYNC dropped 10 times", ("idle", "jog")),
    ("node reset", ("idle",)),
    ("STO of one drive", ("jog",)),
    ("motor jammed", ("cutting",)),
    ("planner killed", ("resume",)),
)


@pytest.fixture(scope="module")
def cells(request: pytest.FixtureRequest) -> Iterator[list[Cell]]:
    """What this run has seen of the matrix; printed at its end."""
    found: list[Cell] = []
    yield found
    capture = request.config.pluginmanager.getplugin("capturemanager")
    if found:
        with capture.global_and_fixture_disabled():
            print(f"\n\n{matrix.table(found)}\n")


def judge(found: list[Cell]) -> None:
    wrong = [f"{cell.mode}: {problem}" for cell in found for problem in cell.problems]
    assert not wrong, "\n".join([found[0].case, *wrong])


@pytest.mark.parametrize(("name", "modes"), SLICE)
def test_a_fault_ends_in_rest_named_recorded_and_recovered_from(
    name: str, modes: tuple[str, ...], tmp_path: Path, cells: list[Cell]
) -> None:
    found = matrix.row(BY_NAME[name], tmp_path, modes)
    cells += found
    judge(found)


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_every_fault_in_every_mode(case: Case, tmp_path: Path, cells: list[Cell]) -> None:
    found = matrix.row(case, tmp_path)
    cells += found
    judge(found)


@pytest.mark.slow
@pytest.mark.parametrize("case", spindle_scene.CASES, ids=lambda case: case.name)
def test_every_fault_of_spindle_inputs_and_clamps_in_every_mode(
    case: Case, tmp_path: Path, cells: list[Cell]
) -> None:
    found = matrix.row(case, tmp_path, made=spindle_scene.MillScene)
    cells += found
    judge(found)
