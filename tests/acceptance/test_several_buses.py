"""Axes spread over several buses: faster ticks than one bus can carry, on buses that take their time."""

from __future__ import annotations

import pytest
from support.machines.stepped_runs import Cut, cut, program, shipped
from support.oracles.bus_times import Wire, take_the_worst

from controller.runtime.bus_load import budgets
from controller.runtime.stepped import SteppedMachine

CASES = [("trunnion_two_buses", 0.001, [3, 2]), ("trunnion_five_buses", 0.0005, [1, 1, 1, 1, 1])]


@pytest.fixture(autouse=True)
def _at_worst(monkeypatch: pytest.MonkeyPatch) -> None:
    take_the_worst(monkeypatch)


def run(name: str, feed: str | None) -> tuple[Cut, list[Wire]]:
    """Example 2 on a shipped machine, with someone listening on every bus."""
    stepped = SteppedMachine(shipped(name))
    stepped.come_up()
    wires = [Wire(stepped.rig.buses[one.bus], one) for one in budgets(stepped.machine)]
    return cut(program("example2_ready.ngc", feed), stepped=stepped), wires


def assert_complete(done: Cut) -> None:
    assert done.run.result == "completed", done.run.fault_text
    assert done.run.skips == 0
    cutting = done.trace.cutting
    assert cutting.any()


def assert_no_overrun(done: Cut, wires: list[Wire]) -> None:
    for wire in wires:
        # The first ticks with a listener may have begun before it listened.
        assert len(wire.syncs_s) >= len(done.rows) - 2
        assert wire.overruns() == 0, wire.budget.bus
        assert wire.uncounted() == set()
        # These buses take every frame at its worst, so that the sums must agree, but for first and last.
        judged_us = wire.budget.total_us + wire.budget.background_us
        assert wire.busy_us_per_tick() == pytest.approx(judged_us, rel=0.002)
        print(f"\n{wire.budget.bus}: {len(wire.syncs_s)} ticks, {wire.busy_us_per_tick():.1f} us a tick")


@pytest.mark.parametrize(("name", "period_s", "drives"), CASES)
def test_the_shipped_machines_have_the_buses_they_are_named_for(
    name: str, period_s: float, drives: list[int]
) -> None:
    machine = shipped(name)
    found = budgets(machine)
    assert machine.period_s == period_s
    assert [one.drives for one in found] == drives
    assert all(one.bit_rate == 1_000_000 and one.fits(machine.max_bus_share) for one in found)


@pytest.mark.parametrize("name", [name for name, *_ in CASES])
def test_a_fast_cut_of_example_2_never_overruns_a_bus(name: str) -> None:
    done, wires = run(name, "12000.")
    assert_complete(done)
    assert_no_overrun(done, wires)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name, *_ in CASES])
def test_example_2_as_shipped_runs_to_its_end_on_several_buses(name: str) -> None:
    done, wires = run(name, None)
    assert_complete(done)
    assert_no_overrun(done, wires)
