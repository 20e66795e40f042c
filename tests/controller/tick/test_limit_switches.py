"""Limit switches on the I/O node: motion into one that is pressed stops, and away from it an axis may go."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from support.machines.shipped_kinds import machine as make_machine
from support.machines.tick_bench import Bench

from controller.ipc.handoff import Jog
from controller.machine import machine_file
from controller.machine.axes import LimitInputs
from controller.machine.model import Io, Sense
from controller.machine.toml_table import ConfigError
from controller.state.modes import Fault, Mode, Request
from controller.tick.limit_switches import GIVE, End, LimitSwitches
from drives.cia402 import Wanted

HERE = (0.0, 0.0, 0.0, 0.0, 0.0)
LOWER, UPPER, A_UPPER = 1, 2, 4
FREE = LOWER | UPPER | A_UPPER
X, A = 0, 3


class Node:
    def __init__(self) -> None:
        self.inputs, self.outputs, self.heard = FREE, 0, True

    def fresh(self, now_s, consumer_s):
        return self.heard

    def write(self, outputs):
        self.outputs = outputs


class Switched(Bench):
    """X with both switches, A with one; every axis is homed."""

    def __init__(self, sense=Sense.CARRIED) -> None:
        made, self.node = make_machine(), Node()
        axes = list(made.axes)
        axes[X] = replace(axes[X], limit_inputs=LimitInputs("x_lower", "x_upper"))
        axes[A] = replace(axes[A], limit_inputs=LimitInputs("", "a_upper"), sense=sense)
        io = Io("main", 11, "", (("x_lower", 0), ("x_upper", 1), ("a_upper", 2)), ())
        super().__init__(replace(made, axes=tuple(axes), io=io), io=(self.node,))
        self.cycle.modes.homed = made.every_axis

    def go(self, there) -> None:
        self.enable()
        self.start_line(HERE, there)
        self.tick(60)
        assert self.snapshot.mode is Mode.RUNNING and not self.cycle.follow.at_rest

    def press(self, bits) -> None:
        self.node.inputs = FREE & ~bits

    def fault(self):
        return self.snapshot.fault, self.snapshot.fault_axis

    def jog(self, sign, axis=X) -> None:
        line = [0.0] * 5
        line[axis] = sign
        super().jog(Jog(tuple(line), 5.0 if axis == X else 0.05, math.inf))
        self.tick(20)


def test_motion_into_a_pressed_switch_stops_and_costs_that_axis_its_zero() -> None:
    bench = Switched()
    bench.go((80.0, 30.0, 0.0, 0.0, 0.0))
    bench.press(UPPER)
    bench.tick()
    assert bench.fault() == (Fault.LIMIT_SWITCH, X) and bench.snapshot.mode is Mode.FAULT
    assert bench.cycle.modes.untrusted == 1 << X
    at = bench.cycle.follow.joints[X]
    bench.until_rest()
    assert bench.cycle.follow.joints[X] - at < 100.0 * 100.0 / 1900.0
    bench.close()


def test_an_axis_that_brakes_on_its_path_for_another_fault_is_stopped_by_its_switch() -> None:
    bench = Switched()
    bench.go((80.0, 30.0, 0.0, 0.0, 0.0))
    bench.cycle.modes.fail(Fault.CLAMP, A)
    bench.tick(2)
    assert not bench.cycle.follow.at_rest and bench.group.drives[X].wanted is Wanted.ENABLED
    bench.press(UPPER)
    bench.tick()
    assert bench.fault() == (Fault.CLAMP, A) and bench.snapshot.warning is Fault.LIMIT_SWITCH
    assert [drive.wanted is Wanted.QUICK_STOP for drive in bench.group.drives] == [i == X for i in range(5)]
    assert bench.cycle.modes.untrusted == 1 << X
    bench.until_rest()
    bench.close()


@pytest.mark.parametrize("later", [0, 1, 3])
def test_each_axis_that_comes_to_its_switch_is_stopped_also_while_another_one_is(later) -> None:
    bench = Switched()
    bench.go((80.0, 30.0, 0.0, 0.5, 0.0))
    bench.press(UPPER)
    if later:
        bench.tick(later)
    bench.press(UPPER | A_UPPER)
    bench.tick()
    assert bench.fault() == (Fault.LIMIT_SWITCH, X)
    assert [i for i, drive in enumerate(bench.group.drives) if drive.wanted is Wanted.QUICK_STOP] == [X, A]
    assert bench.cycle.modes.untrusted == 1 << X | 1 << A
    bench.close()


def test_motion_away_from_a_pressed_switch_and_across_it_goes_on() -> None:
    bench = Switched()
    bench.press(LOWER | A_UPPER)
    bench.go((40.0, 30.0, 0.0, 0.0, 0.0))
    bench.until(Mode.READY)
    assert bench.fault()[0] is Fault.NONE
    bench.close()


def test_the_axis_is_jogged_off_its_switch_but_not_on() -> None:
    bench = Switched()
    bench.press(UPPER)
    bench.cycle.modes.homed = 0
    bench.enable()
    bench.jog(-1.0)
    assert bench.snapshot.mode is Mode.JOG and bench.cycle.follow.joints[X] < 0.0
    bench.ask(Request.JOG_STOP)
    bench.until(Mode.READY)
    bench.jog(1.0)
    assert bench.fault() == (Fault.LIMIT_SWITCH, X)
    bench.close()


@pytest.mark.parametrize(("bits", "lean"), [(UPPER, -1.0), (LOWER, 1.0), (UPPER, 1.0), (UPPER, 0.0)])
def test_a_slide_that_is_not_square_goes_into_its_switch_where_another_axis_moves(bits, lean) -> None:
    """Y's own slide leads X along, so that of X goes back, or not at all."""
    made = make_machine()
    y = replace(made.axes[1], direction=(lean * 0.1, 1.0, 0.0))
    x = replace(made.axes[X], limit_inputs=LimitInputs("x_lower", "x_upper"))
    io = Io("main", 11, "", (("x_lower", 0), ("x_upper", 1)), ())
    switches, modes = LimitSwitches(replace(made, axes=(x, y, *made.axes[2:]), io=io)), Bench().cycle.modes
    modes.mode = Mode.RUNNING
    switches.watch((LOWER | UPPER) & ~bits, modes, (0.0, 1.0, 0.0, 0.0, 0.0), HERE, HERE, 1)
    assert (modes.fault is Fault.LIMIT_SWITCH) is (lean * (-1.0 if bits == UPPER else 1.0) > 0.0)


@pytest.mark.parametrize(("sense", "into"), ((Sense.CARRIED, 1.0), (Sense.ISO, -1.0)))
def test_the_ends_of_a_rotary_are_those_of_its_sense(sense, into) -> None:
    for sign in (1.0, -1.0):
        bench = Switched(sense)
        bench.press(A_UPPER)
        bench.cycle.modes.homed = 0
        bench.enable()
        bench.jog(sign, A)
        assert (bench.fault()[0] is Fault.LIMIT_SWITCH) is (sign == into)
        bench.close()


def test_a_drive_that_homes_into_a_pressed_switch_is_stopped() -> None:
    bench = Switched()
    bench.press(UPPER)
    bench.tick(3)
    bench.group.drives[X]._homing = 0
    bench.ask(Request.HOME, 1 << X)
    bench.tick(2)
    drive, per_mm = bench.group.drives[X], bench.machine.axes[X].counts_per_unit
    drive._homing = 10**6
    for _ in range(40):
        drive.position -= round(0.02 * per_mm)  # away from it
        bench.tick()
    assert bench.snapshot.mode is Mode.HOMING
    ticks = 0
    while bench.snapshot.mode is Mode.HOMING and ticks < 40:
        drive.position += round(0.02 * per_mm)
        bench.tick()
        ticks += 1
    assert bench.fault() == (Fault.LIMIT_SWITCH, X) and 0.02 * ticks <= 0.2
    bench.close()


def test_a_new_zero_is_no_motion_into_the_switch() -> None:
    end = End(X, UPPER, 1.0, GIVE, 1.0)
    assert not end.follow(False, 5.0, 1)
    assert not end.follow(False, 300.0, 1)  # homed here
    assert not end.follow(False, 300.0 + 0.9 * GIVE, 1)
    assert end.follow(False, 300.0 + 1.1 * GIVE, 1)
    assert not end.follow(True, 300.0 + 1.2 * GIVE, 1)


def test_a_drive_that_tells_its_position_seldom_is_seen_to_go_on_at_its_speed() -> None:
    made = make_machine()
    axis = replace(made.axes[X], limit_inputs=LimitInputs("", "x_upper"), feedback_every=10)
    made = replace(made, axes=(axis, *made.axes[1:]), io=Io("main", 11, "", (("x_upper", 1),), ()))
    switches, modes = LimitSwitches(made), Bench(made).cycle.modes
    modes.mode = Mode.HOMING
    moved = axis.limits.velocity * made.period_s * axis.feedback_every
    for tick in range(21):
        switches.watch(0, modes, HERE, HERE, (tick // 10 * moved, 0.0, 0.0, 0.0, 0.0), 1)
    assert (modes.fault, modes.fault_axis) == (Fault.LIMIT_SWITCH, X)


def test_nothing_moves_while_nobody_knows_the_switches() -> None:
    bench = Switched()
    bench.node.heard = False
    bench.enable()
    bench.jog(1.0)
    assert bench.cycle.follow.joints[X] == 0.0 and bench.cycle.modes.interlock is Fault.IO_LOST
    bench.close()


TRUNNION = (machine_file.SHIPPED / "trunnion.toml").read_text().replace('file = "tools.toml"\n', "")
END = (
    "\n[io]\nnode = 20\ninputs = {{ {inputs} }}\n"
    '[[tool]]\nnumber = 1\nname = "one"\nradius_mm = 3.0\nlength_mm = 0.0\nflute_mm = 15.0\n'
)


@pytest.mark.parametrize(
    ("x", "y", "inputs", "sentence"),
    [
        ('lower = "a", upper = "b"', "", "a = 0, b = 1", ""),
        ('upper = "b"', 'lower = "a"', "a = 0, b = 1", ""),
        ("", "", "a = 0", "X.*limit_inputs.*lower, upper or both"),
        ('lower = "a", upper = "a"', "", "a = 0", "upper.*X lower has this input"),
        ('lower = "a"', 'upper = "a"', "a = 0", "upper.*X lower has this input"),
        ('lower = "c"', "", "door = 0", "lower.*no such input"),
    ],
)
def test_each_switch_is_an_input_of_its_own(x, y, inputs, sentence) -> None:
    text = TRUNNION
    for name, switches in (("X", x), ("Y", y)):
        if switches or name == "X":
            text = text.replace(
                f'name = "{name}"\n', f'name = "{name}"\nlimit_inputs = {{ {switches} }}\n', 1
            )
    tail = END.format(inputs=inputs)
    if not sentence:
        made = machine_file.read(text + tail, "own.toml", machine_file.SHIPPED)
        assert made.axes[0].limit_inputs is not None
        return
    with pytest.raises(ConfigError, match=sentence):
        machine_file.read(text + tail, "own.toml", machine_file.SHIPPED)
