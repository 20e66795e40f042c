"""Limit switches on the I/O node of a whole machine: the motors stop by their promise, and go back off."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from support.machines.spindle_machine import IO, SLOWER, SPINDLE, Mill, mill

from controller.runtime.events import Event
from controller.state import fault_table, stop_times
from controller.state.modes import Fault, Mode, Request
from drives import cia402

LOWER, UPPER = 4, 5
LINES = IO.replace("estop", f"x_lower = {LOWER}, x_upper = {UPPER}, estop")
SWITCHES = 'name = "X"\n', 'name = "X"\nlimit_inputs = { lower = "x_lower", upper = "x_upper" }\n'
PROGRAM = "G21 G90 G54\nG1 X60. F6000\nX0\nM30\n"
PRESSED = 40  # a tick of the run, in which X goes up


class Watched(Mill):
    """It notes, too, what the drive of X was told last."""

    def __init__(self) -> None:
        self.words: list[int] = []
        super().__init__(mill(SPINDLE, LINES, changes=(SLOWER, SWITCHES)))

    def _noted(self) -> None:
        super()._noted()
        self.words.append(self.bench.rig.drives["X"].axis.controlword)


@pytest.mark.parametrize(
    ("bit", "stops", "asked"),
    [(UPPER, True, ()), (UPPER, True, (Event(PRESSED - 4, Request.HOLD),)), (LOWER, False, ())],
)
def test_motion_into_it_stops_within_the_promise_and_motion_off_it_goes_on(
    bit: int, stops: bool, asked: Sequence[Event]
) -> None:
    made = Watched()
    made.at[PRESSED] = made.input(bit, False)
    made.at[PRESSED + 30] = made.input(bit, True)
    run = made.run(PROGRAM, *asked)
    if not stops:
        assert run.result == "completed"
        return
    assert run.fault is Fault.LIMIT_SWITCH and made.bench.cycle.modes.fault_axis == 0
    first = next(i for i, one in enumerate(made.seen) if one.mode is Mode.FAULT)
    assert first - PRESSED <= 4, "noticed at once"
    quick = made.words.index(cia402.QUICK_STOP, first)
    assert quick - first <= 3, "whatever the pump plays: with its next period, and taken at the SYNC after it"
    made.ticks(100)
    stood = next(i for i in range(first, len(made.seen)) if made.seen[i].at_rest)
    times = stop_times.of(made.machine)
    promise = fault_table.stands_within_s(Fault.LIMIT_SWITCH, times)
    assert (stood - PRESSED) * made.machine.period_s <= promise
    assert made.seen[-1].untrusted == 1, "X alone is homed again"
