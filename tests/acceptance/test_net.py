"""What directrix did when the net was made, it does now: setpoints, answers, and what others build on.

``tests/README.md`` says how the net is remade where a difference is meant. Setpoints are compared on the
computer that runs the tests: where no code was changed, its mathematics may round otherwise than that of
whoever made the net.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from support.net import runs, sheets

DATA = Path(__file__).resolve().parents[1] / "data"
NET = DATA / "net"
INPUTS = runs.inputs(NET)
MAX_BYTES = 1_000_000  # of all captured data
COUNT = 200
FAST_RUNS = ("029", "044", "068", "091", "177")


def of(name: str) -> str:
    return next(one for one in INPUTS if one.startswith(name))


def whole(fast: tuple[str, ...], every: list[str]) -> list[object]:
    """All of them, the fast ones in every run of the tests."""
    return [one if one in fast else pytest.param(one, marks=pytest.mark.slow) for one in every]


@pytest.mark.parametrize("name", whole(tuple(map(of, FAST_RUNS)), sorted(INPUTS)))
def test_a_run_has_the_setpoints_of_before(name: str) -> None:
    came, _ = runs.carried_out(INPUTS[name])
    told = runs.difference(name, runs.known(NET)[name], came)
    assert not told, f"{told}\n{runs.MEANT.format(name=name.split()[0])}\n{runs.ELSEWHERE}"


@pytest.mark.parametrize("name", whole(sheets.FAST, sorted(sheets.entries(NET))))
def test_an_answer_is_that_of_before(name: str) -> None:
    told = sheets.difference(NET, name, sheets.entries(NET)[name]())
    assert not told, f"{told}\n{runs.MEANT.format(name=name)}"


def test_the_net_is_whole() -> None:
    assert set(runs.known(NET)) == set(INPUTS) and len(INPUTS) == COUNT
    assert set(sheets.stored(NET)) == set(sheets.entries(NET))


def test_the_runs_differ_in_all_that_runs_differ_in() -> None:
    """Most go their way, machines and programs are of every kind, and in a third somebody does something."""
    came = list(runs.known(NET).values())
    assert sum(one.ticks > 0 for one in came) > 0.9 * COUNT
    results = {one.result.partition(":")[0] for one in came}
    assert results >= {"completed", "stopped"}
    kinds, machines = ({name.split()[k] for name in INPUTS} for k in (1, 2))
    assert len(kinds) >= 20 and len(machines) >= 20
    asked = {event[1] for one in INPUTS.values() for event in one.events}
    assert asked >= {"HOLD", "RESUME", "OVERRIDE", "RAPID_OVERRIDE", "SINGLE_BLOCK", "STOP"}
    assert sum(bool(one.events) for one in INPUTS.values()) > COUNT / 3


def test_captured_data_stay_small() -> None:
    assert sum(file.stat().st_size for file in DATA.rglob("*") if file.is_file()) < MAX_BYTES
