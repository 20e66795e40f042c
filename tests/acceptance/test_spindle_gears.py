"""A spindle with gears: S or a code chooses one, it is shifted at a standstill, S is the spindle's."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import pytest
from support.machines.spindle_machine import IO, SLOWER, SPINDLE, Mill, inverters, mill

from controller.machine.model import Machine
from controller.machine.toml_table import ConfigError
from controller.program.program import ProgramError
from controller.runtime.events import Event
from controller.state.modes import Fault, Request

LOW_IN, HIGH_IN, LOW, HIGH, RUN = 4, 5, 4, 5, 6
LINES = IO.replace("estop", f"low_in = {LOW_IN}, high_in = {HIGH_IN}, estop").replace(
    "coolant", f"low = {LOW}, high = {HIGH}, spindle_run = {RUN}, coolant"
)
GEARS = """
[[spindle.gear]]
high_rev_min = 1000
turns = 4.0
on = ["low"]
off = ["high"]
input = "low_in"
within_s = 0.4
[[spindle.gear]]
low_rev_min = 800
high_rev_min = 6000
turns = 1.0
on = ["high"]
off = ["low"]
input = "high_in"
within_s = 0.4
"""
BY_CODE = GEARS.replace("turns = 4.0", 'code = "M41"\nturns = 4.0').replace(
    "turns = 1.0", 'code = "M42"\nturns = 1.0'
)
INVERTER = """
[spindle]
max_rev_min = 6000
acceleration_rev_s2 = 400.0
spin_up_s = 2.0

[spindle.inverter]
channel = 2
settle_s = 0.1
"""
DRIVEN = SPINDLE.replace("12000", "6000")
HEAD = "G21 G90 G54\n"
PROGRAM = f"{HEAD}S500 M3\nG1 Z130. F6000\nS900\nG1 X95.\nS3000\nG1 X90.\nS850\nG1 X85.\nM5\nM30\n"
# By line: S, and the turns of what turns it. S900 stays in the low gear, S850 in the high one.
TURNS = {3: (500.0, 4.0), 5: (900.0, 4.0), 7: (3000.0, 1.0), 9: (850.0, 1.0)}


@cache
def machine(way: str, gears: str = GEARS) -> Machine:
    lines = LINES if way == "inverter" else LINES.replace(f"spindle_run = {RUN}, ", "")
    return mill((INVERTER if way == "inverter" else DRIVEN) + gears, lines, changes=(SLOWER,))


class Turned(Mill):
    """What turns the spindle, tick by tick; 1/min."""

    def __init__(self, made: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
        self.motor: list[float] = []
        self.inverters = inverters(monkeypatch)
        super().__init__(made)
        self.motor.clear()
        self.seen.clear()

    def _noted(self) -> None:
        super()._noted()
        if self.inverters:
            self.motor.append(self.inverters[0].speed(self.bench.rig.now_s))
        else:
            counts_s = self.bench.rig.spindle.axis.servo.velocity
            self.motor.append(60.0 * counts_s / 4096.0)


@pytest.mark.parametrize("way", ["inverter", "drive"])
def test_s_chooses_the_gear_and_is_that_of_the_spindle(way: str, monkeypatch: pytest.MonkeyPatch) -> None:
    made = Turned(machine(way), monkeypatch)
    assert made.run(PROGRAM).result == "completed"
    seen = made.seen
    for line, (rev_min, turns) in TURNS.items():
        cut = [
            i for i in range(1, len(seen)) if seen[i].line == line and seen[i].joints != seen[i - 1].joints
        ]
        assert len(cut) > 10
        for i in cut:
            assert seen[i].spindle_rev_min == rev_min and seen[i].spindle_at_speed
            assert made.motor[i] == pytest.approx(turns * rev_min, rel=0.06), (line, made.motor[i])
            assert seen[i].outputs >> LOW & 1 == (turns == 4.0) != seen[i].outputs >> HIGH & 1
    if way == "drive":
        assert seen[cut[-1]].spindle_actual_rev_min == pytest.approx(850.0, rel=0.06)
    for i in range(1, len(seen)):
        if (seen[i].outputs ^ seen[i - 1].outputs) & (1 << LOW | 1 << HIGH):
            assert abs(made.motor[i]) < 60.0, "it is shifted at a standstill"
    shifts = sum((a.outputs ^ b.outputs) >> LOW & 1 for a, b in pairwise(seen))
    assert shifts == 2, "into the low gear, and out of it"
    assert made.ticks(5).outputs >> HIGH & 1, "it stays in"


def test_a_gear_that_does_not_go_in_holds_the_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    made = Turned(machine("inverter"), monkeypatch)
    made.io.unwire(HIGH_IN)
    made.io.set_input(HIGH_IN, False, made.bench.rig.now_s)
    run = made.run(PROGRAM)
    assert (run.result, run.fault) == ("held", Fault.INPUT_MISSING)
    assert made.seen[-1].line <= 6 and abs(made.motor[-1]) < 60.0


def test_codes_shift_and_s_stays_within_the_gear(monkeypatch: pytest.MonkeyPatch) -> None:
    made = Turned(machine("inverter", BY_CODE), monkeypatch)
    program = f"{HEAD}M42 S900 M3\nG1 Z130. F6000\nM41\nG1 X95.\nM5\nM30\n"
    assert made.run(program).result == "completed"
    for line, turns in ((3, 1.0), (5, 4.0)):
        at = [made.motor[i] for i, one in enumerate(made.seen) if one.line == line and one.rate == 1.0]
        assert at and at[-1] == pytest.approx(900.0 * turns, rel=0.06)


@pytest.mark.parametrize(
    ("gears", "lines", "line"),
    [(BY_CODE, "M41\nS3000 M3\n", 3), (BY_CODE, "M42 S400 M3\n", 2), (BY_CODE, "M41 M42\n", 2)],
)
def test_what_no_gear_can_is_refused(gears: str, lines: str, line: int) -> None:
    with pytest.raises(ProgramError) as why:
        Mill(machine("inverter", gears)).run(f"{HEAD}{lines}G1 X1 F100\nM30\n")
    assert why.value.line == line and why.value.said["key"] in ("spindle.no_gear", "code.two_of_a_group")


def test_an_override_does_not_lead_beyond_the_gear(monkeypatch: pytest.MonkeyPatch) -> None:
    made = Turned(machine("inverter"), monkeypatch)
    fast = Event(1, Request.SPINDLE_OVERRIDE, 1.2)
    assert made.run(f"{HEAD}S900 M3\nG1 Z130. F3000\nM5\nM30\n", fast).result == "completed"
    assert max(made.motor) == pytest.approx(4000.0, rel=0.01)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("low_rev_min = 800", "low_rev_min = 7000", "high_rev_min.*not above low_rev_min"),
        ("high_rev_min = 6000", "high_rev_min = 9000", "high_rev_min.*above max_rev_min"),
        ('on = ["high"]\noff = ["low"]', 'on = ["low"]', "do not tell it from the gear"),
        ("turns = 4.0", 'code = "M43"\nturns = 4.0', "m_codes or own_codes"),
        ("turns = 4.0", "turns = 400.0", "full_rev_min|full_counts|speed"),
    ],
)
def test_gears_that_cannot_be_are_refused(old: str, new: str, sentence: str) -> None:
    assert old in GEARS
    spindle = INVERTER.replace("settle_s", "full_rev_min = 6000\nsettle_s")
    if "M43" in new:
        with pytest.raises(ConfigError, match=sentence):
            own = f'{LINES}digital_out = ["air"]\nm_codes = {{ M43 = {{ output = "air" }} }}\n'
            mill(spindle + GEARS.replace(old, new), own.replace("coolant =", "air = 9, coolant ="))
        return
    with pytest.raises(ConfigError, match=sentence):
        mill(spindle + GEARS.replace(old, new), LINES)
