"""Long rows of joined surfaces: what each costs a check does not grow with their number."""

from __future__ import annotations

import cProfile
import pstats
import tempfile
import tracemalloc
from pathlib import Path

import pytest
from support.machines.stepped_runs import shipped
from support.parts.surface_trains import program

from controller.plan.report.survey import Survey
from controller.runtime import checked

MAX_CALLS = 95_000  # of functions for one more surface: 144 000 took 180 ms, 63 000 take a third of it
MAX_KB = 80.0  # at the peak, for one more surface

KINDS = pytest.mark.parametrize(
    ("corners", "decimals"),
    [
        pytest.param(0, 9, id="smooth"),
        pytest.param(3, 9, id="upright"),  # the rotary next to the work has no place of its own anywhere
        pytest.param(0, 3, id="pivots"),  # at each joint, by some hundredths of a degree
    ],
)


def check(count: int, corners: int = 0, decimals: int = 9) -> Survey:
    """Each number of surfaces stands elsewhere, so that nothing is known of one from another."""
    source = program(count, 0.01 * count, corners, decimals=decimals)
    task = checked.task(source.encode(), "train.ngc", shipped())
    with tempfile.TemporaryDirectory() as folder:
        return checked.check(task, Path(folder))[0]


def calls(count: int, corners: int = 0, decimals: int = 9) -> int:
    profile = cProfile.Profile()
    profile.runcall(check, count, corners, decimals)
    return int(pstats.Stats(profile).total_calls)  # type: ignore[attr-defined]


def peak_kb(count: int) -> float:
    tracemalloc.start()
    try:
        check(count)
        return tracemalloc.get_traced_memory()[1] / 1000.0
    finally:
        tracemalloc.stop()


def test_joined_surfaces_are_one_path_with_as_many_cuts() -> None:
    found = check(7)
    assert len(found.cuts_mm) == 7 and sum(found.cuts_mm) == pytest.approx(28.4, abs=0.2)


@KINDS
def test_one_more_surface_costs_no_more_than_so_many_calls(corners: int, decimals: int) -> None:
    check(2, corners, decimals)  # what is made once is made
    assert calls(5, corners, decimals) - calls(3, corners, decimals) <= 2 * MAX_CALLS


@pytest.mark.slow
@KINDS
def test_the_cost_is_linear_in_the_number_of_surfaces(corners: int, decimals: int) -> None:
    """Counted from where the spiral has turned once: from there each has a neighbour on the turn before."""
    check(2, corners, decimals)
    few, some, many = (calls(count, corners, decimals) for count in (48, 60, 84))
    assert (many - some) / 24 <= 1.08 * (some - few) / 12


@pytest.mark.slow
def test_the_memory_of_one_more_surface_is_small() -> None:
    peak_kb(8)
    few, many = peak_kb(40), peak_kb(120)
    assert (many - few) / 80 <= MAX_KB
