"""A spindle whose inverter is on a serial line: it reaches S, is waited for, stops on faults and silences."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import pytest
from support.machines.spindle_machine import IO, Mill, mill

from controller.ipc.handoff import Snapshot
from controller.machine.model import Machine
from controller.machine.toml_table import ConfigError
from controller.program.modal import power_on
from controller.runtime.bench.inverter import SteppedInverter
from controller.runtime.events import Event
from controller.service import status
from controller.state.modes import Fault, Mode, Request

MODBUS = """
[spindle]
max_rev_min = 12000
acceleration_rev_s2 = 400.0
spin_up_s = 1.0

[spindle.modbus]
port = "/dev/serial/by-id/usb-rs485"
profile = "hitachi_wj200"
silent_s = 0.6
"""
PROGRAM = "G21 G90 G54\nS6000 M3 M8\nG1 Z130. F6000\nG1 X90.\nM5\nG0 X0\nM30\n"
BACK = "G21 G90 G54\nS3000 M3\nG1 Z150. F6000\nM4\nG1 Z149.\nM5\nM30\n"
CUTTING = 450  # a tick of the run in which it moves at feed


class Turned(Mill):
    """A mill that notes how the spindle really turns, signed."""

    def __init__(self, machine: Machine) -> None:
        self.real: list[float] = []
        super().__init__(machine)
        self.real.clear()

    @property
    def far(self) -> SteppedInverter:
        """The inverter."""
        assert self.bench.inverter is not None
        return self.bench.inverter

    def _noted(self) -> None:
        super()._noted()
        self.real.append(self.far.inverter.ramp.speed(self.bench.rig.now_s))


@cache
def machine() -> Machine:
    return mill(MODBUS)


def moving(made: Mill) -> list[int]:
    """The ticks of the run in which it moves at feed."""
    seen = made.seen
    return [i for i in range(1, len(seen)) if seen[i].joints != seen[i - 1].joints and seen[i].line in (3, 4)]


@pytest.mark.parametrize("io", [IO, ""])
def test_it_turns_as_told_before_anything_moves_and_stands_at_the_end(io: str) -> None:
    made = Turned(mill(MODBUS, io, "AC" if io else ""))
    made.seen.clear()
    assert made.run(PROGRAM if io else PROGRAM.replace(" M8", "")).result == "completed"
    cut = moving(made)
    assert len(cut) > 100
    assert all(abs(made.real[i] - 6000.0) <= 0.05 * 6000.0 for i in cut)
    assert all(made.seen[i].spindle_at_speed and made.seen[i].spindle_rev_min == 6000.0 for i in cut)
    told = status.machine_values(made.machine, made.seen[cut[-1]], None, power_on(), 1)["spindle"]
    assert told["actual_rev_min"] == pytest.approx(6000.0), "it reports it"
    made.ticks(400)
    assert made.real[-1] == 0.0 and made.seen[-1].spindle_actual_rev_min == 0.0


def test_it_turns_back_out_of_a_standstill_and_what_it_reports_has_a_sign() -> None:
    made = Turned(machine())
    made.seen.clear()
    assert made.run(BACK).result == "completed"
    last = [i for i in range(1, len(made.seen)) if made.seen[i].line == 5 and made.seen[i].rate]
    assert last and all(abs(made.real[i] + 3000.0) < 150.0 for i in last)
    assert all(made.seen[i].spindle_actual_rev_min == pytest.approx(-3000.0, abs=150.0) for i in last)
    turns = [(a, b) for a, b in zip(made.real, made.real[1:], strict=False) if a >= 0.0 > b]
    assert len(turns) == 1 and turns[0][0] == 0.0, "through a standstill"


def _fails(what: Callable[[Turned], None]) -> tuple[Turned, Snapshot]:
    """Something happens in the cut; the machine a second later."""
    made = Turned(machine())
    made.at[CUTTING] = lambda: what(made)
    made.seen.clear()
    made.real.clear()
    run = made.run(PROGRAM)
    assert run.result in ("fault", "held"), run.result
    return made, made.ticks(700)


def _break(made: Turned) -> None:
    made.far.inverter.fault = True


def _cut_off(made: Turned) -> None:
    made.far.mute = True


def test_a_fault_of_its_own_stops_the_path_and_is_reset_with_the_machine() -> None:
    made, now = _fails(_break)
    assert (now.mode, now.fault, now.at_rest) == (Mode.FAULT, Fault.SPINDLE_LOST, True)
    assert made.real[-1] == 0.0 and made.far.slot.commanded()[0].rev_min == 0.0
    made.bench.request(Request.RESET)
    made.ticks(200)
    assert not made.far.inverter.fault and made.real[-1] == 0.0, "it does not turn again by itself"
    made.bench.come_up()
    made.at.clear()
    assert made.run(PROGRAM).result == "completed"


def test_a_silence_longer_than_silent_s_stops_the_path_and_a_shorter_one_does_not() -> None:
    made, now = _fails(_cut_off)
    assert (now.mode, now.fault, now.at_rest) == (Mode.FAULT, Fault.SPINDLE_LOST, True)
    first = next(i for i, one in enumerate(made.seen) if one.fault is Fault.SPINDLE_LOST)
    assert 0.4 <= (first - CUTTING) * made.machine.period_s <= 0.7
    assert made.far.slot.commanded()[0].rev_min == 0.0, "where it still hears"
    short = Turned(machine())
    short.at = {CUTTING: lambda: _cut_off(short), CUTTING + 150: lambda: setattr(short.far, "mute", False)}
    assert short.run(PROGRAM).result == "completed"


def test_one_that_never_answers_does_not_let_a_program_begin() -> None:
    made = Turned(machine())
    made.far.mute = True
    made.ticks(400)
    assert made.seen[-1].mode is Mode.READY, "while it stands nobody minds"
    run = made.run(PROGRAM)
    assert (run.result, run.fault) == ("held", Fault.SPINDLE_NOT_AT_SPEED), "that it stands is not known"
    assert not moving(made)
    made.bench.request(Request.STOP)
    made.ticks(100)
    made.bench.request(Request.SPINDLE, 3000.0)
    assert made.ticks(50).fault is Fault.SPINDLE_LOST, "by hand, too"


def test_an_emergency_stop_and_a_door_stop_it() -> None:
    made, now = _fails(lambda made: made.input(0, False)())
    assert now.fault is Fault.ESTOP_INPUT and made.real[-1] == 0.0
    made, now = _fails(lambda made: made.input(1, False)())
    assert (now.mode, now.fault) == (Mode.HOLD, Fault.DOOR_OPEN) and made.real[-1] == 0.0


def test_one_that_does_not_reach_its_speed_holds_the_machine() -> None:
    made = Turned(mill(MODBUS.replace("400.0", "30.0")))
    run = made.run(PROGRAM)
    assert (run.result, run.fault) == ("held", Fault.SPINDLE_NOT_AT_SPEED)
    assert not moving(made)


def test_an_override_turns_it_while_the_path_goes_on() -> None:
    made = Turned(machine())
    made.seen.clear()
    assert made.run(PROGRAM, Event(400, Request.SPINDLE_OVERRIDE, 0.5)).result == "completed"
    assert any(abs(one - 3000.0) < 1.0 for one in made.real)
    assert all(made.seen[i].mode is Mode.RUNNING for i in moving(made))


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ('"hitachi_wj200"', '"hitachi_wj20"', "no_choice"),
        ('"hitachi_wj200"', '"delta_c2000"\nrev_min_per_hz = 10', "speed_beyond_register"),
        ('port = "/dev/serial/by-id/usb-rs485"\n', "", "missing"),
        ("silent_s = 0.6", 'silent_s = 0.6\nframe = "7N2"', "no_choice"),
    ],
)
def test_what_cannot_be_is_refused(old: str, new: str, key: str) -> None:
    assert old in MODBUS
    with pytest.raises(ConfigError) as refused:
        mill(MODBUS.replace(old, new))
    assert refused.value.said["values"]["what"]["key"] == f"file.{key}"
