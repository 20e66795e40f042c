"""A spindle that an inverter turns by an analogue output: it reaches S, is waited for, stops on faults."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import pytest
from support.machines.spindle_machine import IO, SLOWER, Mill, inverters, mill

from controller.ipc.handoff import Snapshot
from controller.machine.model import Machine
from controller.program.modal import power_on
from controller.program.program import ProgramError
from controller.runtime.bench.fault_file import MachineScript
from controller.runtime.events import Event
from controller.service import status
from controller.state.modes import Fault, Mode, Request
from drives.bench.simulated.data_sheet import key

INVERTER = """
[spindle]
max_rev_min = 12000
acceleration_rev_s2 = 400.0
spin_up_s = 1.0

[spindle.inverter]
channel = 2
zero_counts = 200
full_counts = 30200
full_rev_min = 15000
"""
SIGNED = f"{INVERTER}signed = true\n"
READY, AT_SPEED, RUN, REVERSE, RESET = 4, 5, 4, 5, 6
ALL_LINES = IO.replace("estop", f"spindle_ready = {READY}, spindle_at_speed = {AT_SPEED}, estop").replace(
    "coolant", f"spindle_run = {RUN}, spindle_reverse = {REVERSE}, spindle_reset = {RESET}, coolant"
)
BY_TIME = ALL_LINES.replace(f"spindle_at_speed = {AT_SPEED}, ", "")
RUN_ALONE = IO.replace("coolant", f"spindle_run = {RUN}, coolant")
PROGRAM = "G21 G90 G54\nS6000 M3 M8\nG1 Z130. F6000\nG1 X90.\nM5\nG0 X0\nM30\n"
CUTTING = 225  # a tick of the run in which it moves at feed
COUNTS_6000 = 200 + 30000 * 6000 // 15000

MEASURED = INVERTER.replace("spin_up_s", "at_speed_share = 0.03\nspin_up_s")
BY_VOLTAGE = f"{MEASURED}feedback = {{ channel = 1, zero_counts = 300, full_counts = 30300 }}\n"
BY_PULSES = f"{MEASURED}feedback = {{ channel = 0, index = 0x2011, bits = 32, pulses_per_rev = 60 }}\n"
BY_FREQUENCY = BY_PULSES.replace("channel = 2\n", "channel = 0\nindex = 0x2010\nbits = 32\n").replace(
    "30200", "1_000_200"
)

WAYS: dict[str, tuple[str, str]] = {
    "0 to 10 V, at speed by an input": (INVERTER, ALL_LINES),
    "0 to 10 V, at speed by time": (INVERTER, BY_TIME),
    "-10 to 10 V": (SIGNED, ALL_LINES),
    "0 to 10 V, measured by a voltage": (BY_VOLTAGE, BY_TIME),
    "-10 to 10 V, measured by a voltage": (f"{BY_VOLTAGE}signed = true\n", BY_TIME),
    "0 to 10 V, measured by pulses": (BY_PULSES, ALL_LINES),
    "a frequency, measured by pulses": (BY_FREQUENCY, BY_TIME),
    "run alone, inverted wires": (
        INVERTER,
        f'{RUN_ALONE}inverted = ["spindle_run"]\n',
    ),
}


class Turned(Mill):
    """A mill with the inverter itself beside it."""

    def __init__(self, machine: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
        made = inverters(monkeypatch)
        self.real: list[float] = []
        super().__init__(machine)
        (self.inverter,) = made
        self.real.clear()

    def _noted(self) -> None:
        super()._noted()
        self.real.append(self.inverter.speed(self.bench.rig.now_s))


@cache
def machine(way: str) -> Machine:
    """A mill by one of the ways."""
    return mill(*WAYS[way], changes=(SLOWER,))


def _ways(names: list[str]) -> list[object]:
    """Of those that are measured one in every run."""
    quick = [one for one in names if "measured" not in one or "frequency" in one]
    return [one if one in quick else pytest.param(one, marks=pytest.mark.slow) for one in names]


def moving(made: Mill) -> list[int]:
    """The ticks of the run in which it moves at feed."""
    seen = made.seen
    return [i for i in range(1, len(seen)) if seen[i].joints != seen[i - 1].joints and seen[i].line in (3, 4)]


@pytest.mark.parametrize("way", _ways([*WAYS]))
def test_it_turns_as_told_before_anything_moves_and_stands_at_the_end(
    way: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = Turned(machine(way), monkeypatch)
    made.seen.clear()
    assert made.run(PROGRAM).result == "completed"
    cut = moving(made)
    assert len(cut) > 50
    assert all(abs(made.real[i] - 6000.0) <= 0.05 * 6000.0 for i in cut)
    assert all(made.seen[i].spindle_at_speed and made.seen[i].spindle_rev_min == 6000.0 for i in cut)
    place = key(0x2010) if "frequency" in way else key(0x6411, 2)
    assert made.io.dictionary.values[place] == 200, "it is told to stand"
    made.ticks(200)
    assert made.real[-1] == 0.0 and made.seen[-1].spindle_rev_min == 0.0


def test_what_the_output_is_told_is_what_was_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    made = Turned(machine("0 to 10 V, at speed by an input"), monkeypatch)
    at: list[int] = []
    made.at[150] = lambda: at.append(made.io.analogue(2))
    made.run(PROGRAM)
    assert at == [COUNTS_6000]
    told = status.machine_values(made.machine, made.seen[150], None, power_on(), 1)["spindle"]
    assert told["actual_rev_min"] is None and told["rev_min"] == 6000.0, "nobody measures it"


BACK = "G21 G90 G54\nS3000 M3\nG1 Z150. F6000\nM4\nG1 Z149.\nM5\nM30\n"


@pytest.mark.parametrize("way", _ways([one for one in WAYS if one != "run alone, inverted wires"]))
def test_it_turns_back_out_of_a_standstill(way: str, monkeypatch: pytest.MonkeyPatch) -> None:
    made = Turned(machine(way), monkeypatch)
    flips: list[float] = []
    made.io.watchers.append(
        lambda word, now_s: flips.append(made.inverter.speed(now_s)) if word >> REVERSE & 1 else None
    )
    made.seen.clear()
    assert made.run(BACK).result == "completed"
    last = [i for i in range(1, len(made.seen)) if made.seen[i].line == 5 and made.seen[i].rate]
    assert last and all(abs(made.real[i] + 3000.0) < 150.0 for i in last)
    assert way.startswith("-10") or (flips and abs(flips[0]) < 200.0), "not while it still turns"


def test_without_a_line_that_turns_it_back_m4_is_refused() -> None:
    with pytest.raises(ProgramError) as why:
        Mill(machine("run alone, inverted wires")).run(BACK)
    assert (why.value.line, why.value.said["key"]) == (4, "spindle.one_way")


def _fails(
    what: Callable[[Turned], None],
    monkeypatch: pytest.MonkeyPatch,
    way: str = "0 to 10 V, at speed by an input",
    program: str = PROGRAM,
) -> tuple[Turned, Snapshot]:
    """Something happens in the cut; the machine a second later."""
    made = Turned(machine(way), monkeypatch)
    made.at[CUTTING] = lambda: what(made)
    made.seen.clear()
    made.real.clear()
    run = made.run(program)
    assert run.result in ("fault", "held"), run.result
    return made, made.ticks(250)


def test_a_fault_of_its_own_stops_the_path_and_it_does_not_turn_again_by_itself(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made, now = _fails(lambda made: made.input(READY, False)(), monkeypatch)
    assert (now.mode, now.fault, now.at_rest) == (Mode.FAULT, Fault.SPINDLE_LOST, True)
    first = next(i for i, one in enumerate(made.seen) if one.fault is Fault.SPINDLE_LOST)
    assert first - CUTTING <= 4 and not made.seen[first + 2].outputs >> RUN & 1
    made.input(READY, True)()
    now = made.ticks(150)
    assert made.real[-1] == 0.0 and not now.outputs >> RUN & 1
    made.bench.request(Request.RESET)
    resets = [one.outputs >> RESET & 1 for one in [made.ticks(1) for _ in range(200)]]
    assert 0.4 <= sum(resets) * made.machine.period_s <= 0.6, "a pulse that resets it, too"
    made.bench.come_up()
    made.at.clear()
    assert made.run(PROGRAM).result == "completed"


ALL_FAULTS = [
    one if one == "0 to 10 V, at speed by an input" else pytest.param(one, marks=pytest.mark.slow)
    for one in WAYS
    if "alone" not in one
]


@pytest.mark.parametrize("way", ALL_FAULTS)
def test_an_emergency_stop_and_a_silent_node_switch_it_off(way: str, monkeypatch: pytest.MonkeyPatch) -> None:
    made, now = _fails(lambda made: made.input(0, False)(), monkeypatch, way)
    assert now.fault is Fault.ESTOP_INPUT and made.real[-1] == 0.0 and not now.outputs
    made, now = _fails(_cut_off, monkeypatch, way)
    assert now.fault is Fault.IO_LOST and made.real[-1] == 0.0, "by the node itself (6207h)"


def _cut_off(made: Turned) -> None:
    """The wire to the node breaks: neither side hears the other."""
    made.io.link = None
    made.io._lose_connection(made.bench.rig.now_s)


by_measurement = pytest.mark.parametrize("way", _ways([one for one in WAYS if "measured" in one]))


@by_measurement
def test_what_is_measured_is_told_and_what_is_no_more_measured_is_lost(
    way: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    made, now = _fails(_deafen, monkeypatch, way)
    assert (now.mode, now.fault) == (Mode.FAULT, Fault.SPINDLE_LOST) and made.real[-1] == 0.0
    before = made.seen[CUTTING - 1]
    told = status.machine_values(made.machine, before, None, power_on(), 1)["spindle"]
    assert abs(told["actual_rev_min"] - 6000.0) < 0.03 * 6000.0 and told["at_speed"]
    first = next(i for i, one in enumerate(made.seen) if one.fault is Fault.SPINDLE_LOST)
    assert (first - CUTTING) * made.machine.period_s <= 0.4


def _deafen(made: Turned) -> None:
    """The node sends no measurement any more."""
    script = MachineScript.read("at 0 s: drop tpdo2 io x 500", made.machine)
    script.inject(made.bench.rig.buses, made.machine.period_s)


def _slow_down(made: Turned) -> None:
    """It slips."""
    whole = made.inverter.speed
    made.inverter.speed = lambda now_s: 0.8 * whole(now_s)  # type: ignore[method-assign]


@by_measurement
def test_one_that_slows_down_in_the_cut_is_seen_though_it_is_told_its_speed(
    way: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    _, now = _fails(_slow_down, monkeypatch, way, PROGRAM.replace("F6000", "F1000"))
    assert now.fault is Fault.SPINDLE_NOT_AT_SPEED and now.mode is Mode.HOLD


@pytest.mark.parametrize("way", ALL_FAULTS)
def test_a_door_stops_it_at_rest(way: str, monkeypatch: pytest.MonkeyPatch) -> None:
    made, now = _fails(lambda made: made.input(1, False)(), monkeypatch, way)
    assert (now.mode, now.fault) == (Mode.HOLD, Fault.DOOR_OPEN) and made.real[-1] == 0.0


def test_one_that_does_not_reach_its_speed_holds_the_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    made = Turned(machine("0 to 10 V, at speed by an input"), monkeypatch)
    monkeypatch.setattr(made.inverter, "_arrive", lambda *_: None)
    run = made.run(PROGRAM)
    assert (run.result, run.fault) == ("held", Fault.SPINDLE_NOT_AT_SPEED)
    assert not moving(made)


@pytest.mark.parametrize("way", ALL_FAULTS)
def test_an_override_turns_it_while_the_path_goes_on(way: str, monkeypatch: pytest.MonkeyPatch) -> None:
    made = Turned(machine(way), monkeypatch)
    made.seen.clear()
    assert made.run(PROGRAM, Event(200, Request.SPINDLE_OVERRIDE, 0.5)).result == "completed"
    assert any(abs(one - 3000.0) < 1.0 for one in made.real)
    assert all(made.seen[i].mode is Mode.RUNNING for i in moving(made))
