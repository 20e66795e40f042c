"""How full the bus was, tick by tick, in the flight recorder."""

from __future__ import annotations

import pytest

from controller.ipc.handoff import COLUMN
from controller.machine import machine_file
from controller.runtime.bus_load import budgets
from controller.runtime.stepped import SteppedMachine
from drives.cyclic.line import BITS
from drives.load.stuffing import worst_bits


def test_the_tick_counts_the_bits_that_the_budget_counts() -> None:
    assert [worst_bits(n) for n in range(9)] == list(BITS)


def test_the_row_of_a_tick_tells_the_share_that_was_budgeted_for_it() -> None:
    """SYNC, five setpoints, five answers; now and then a heartbeat on top."""
    machine = machine_file.load("trunnion")
    bench = SteppedMachine(machine)
    bench.come_up()
    bench.go(200)
    shares = bench.recorder.last(150)[:, COLUMN["bus_share"]]
    (budget,) = budgets(machine)
    cyclic = budget.total_us / budget.period_us
    assert shares.min() == pytest.approx(cyclic)
    assert cyclic < shares.max() < 1.5 * cyclic
