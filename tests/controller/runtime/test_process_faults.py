"""Processes killed and stopped in every mode: rest in time, named, recorded, and back to work.

The rows of the fault matrix (tests/acceptance/test_fault_matrix.py) that the stepped clock cannot show.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from support.faults import process_cases
from support.faults.process_cases import CASES, Cell

pytestmark = [pytest.mark.slow, pytest.mark.live]


@pytest.fixture(scope="module")
def cells(request: pytest.FixtureRequest) -> Iterator[list[Cell]]:
    """What this run has seen of the matrix; printed at its end."""
    found: list[Cell] = []
    yield found
    capture = request.config.pluginmanager.getplugin("capturemanager")
    if found:
        with capture.global_and_fixture_disabled():
            print(f"\n\n{process_cases.table(found)}\n")


@pytest.mark.parametrize("case", CASES)
def test_a_process_fault_in_every_mode_ends_in_rest_named_recorded_and_recovered_from(
    case: str, tmp_path: Path, cells: list[Cell]
) -> None:
    found = process_cases.row(case, tmp_path)
    cells += found
    wrong = [f"{cell.case}, {cell.mode}: {problem}" for cell in found for problem in cell.problems]
    assert not wrong, "\n".join(wrong)
