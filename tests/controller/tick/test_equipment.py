"""Spindle, coolant, clamps and outputs by themselves: what they are told in which mode, what is found there.

In whole programs: ``test_peripherals.py`` and ``test_outputs.py``.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
from support.machines.shipped_kinds import machine as make_machine

from controller.ipc.handoff import Awaited, Piece, dwell
from controller.machine.model import BESIDE, Clamp, Io, Machine, Spindle
from controller.state.modes import Fault, Mode, Request, StaysOn
from controller.tick.peripherals import (
    FLOW_S,
    FRESH_TICKS,
    IN_POSITION_S,
    SPEED_LOST_S,
    STANDING_S,
    STANDING_SHARE,
    Clamped,
    Peripherals,
)

T = 0.002
INPUTS = ("estop", "door", "tool_clamped", "power", "coolant_flow", "x_closed", "a_closed", "there")
OUTPUTS = ("coolant", "mist", "x_open", "a_open", "air", "vacuum", "arm")
ESTOP, DOOR, TOOL, POWER, FLOW, X_CLOSED, A_CLOSED, THERE = (1 << bit for bit in range(8))
COOLANT, MIST, X_OPEN, A_OPEN, AIR, VACUUM, ARM = (1 << bit for bit in range(7))
X, A = 1 << 0, 1 << 3  # axes
HERE = [0.0] * 5
ALL = (1 << len(INPUTS)) - 1


def numbered(names: tuple[str, ...]) -> tuple[tuple[str, int], ...]:
    return tuple((name, bit) for bit, name in enumerate(names))


def equipped(**io: Any) -> Machine:
    built = make_machine(period_s=T)
    clamps = {"X": Clamp("x_open", "x_closed", 0.1), "A": Clamp("a_open", "a_closed", 0.1)}
    axes = tuple(replace(axis, clamp=clamps.get(axis.name)) for axis in built.axes)
    bits: dict[str, Any] = {"inputs": numbered(INPUTS), "outputs": numbered(OUTPUTS)}
    more: dict[str, Any] = {"digital_out": ("air", "vacuum"), "held": ("vacuum",), "changer_out": ("arm",)}
    spindle = Spindle(24000.0, "drive", bus="main", node=10, counts_per_rev=4096.0, spin_up_s=0.2)
    return replace(built, axes=axes, spindle=spindle, io=Io("main", 11, "", **{**bits, **more, **io}))


class Turning:
    """A spindle that is at speed when the test says so."""

    def __init__(self) -> None:
        self.told, self.at_speed, self.rev_min = 0.0, True, 0.0

    def want_speed(self, rev_min: float) -> None:
        self.told = rev_min


class Node:
    """Its clamps report at once, unless they are stuck."""

    def __init__(self) -> None:
        self.inputs, self.outputs, self.heard, self.stuck = ALL, 0, True, False

    def fresh(self, now_s: float, consumer_s: float) -> bool:
        return self.heard

    def write(self, outputs: int) -> None:
        self.outputs = outputs
        for out, closed in ((X_OPEN, X_CLOSED), (A_OPEN, A_CLOSED)) if not self.stuck else ():
            self.inputs = self.inputs & ~closed if outputs & out else self.inputs | closed

    def write_analogue(self, channel: int, counts: int) -> None: ...


class Told:
    """The mode, as the test says; notes what it was told."""

    def __init__(self, mode: Mode = Mode.OFF) -> None:
        self.mode, self.fault, self.on_path = mode, Fault.NONE, True
        self.interlock = Fault.NONE
        self.stays_on, self.ended = 0, False
        self.failed: list[tuple[Fault, int]] = []
        self.late = -1  # the axis that is not in position yet

    @property
    def running(self) -> bool:
        return self.mode is Mode.RUNNING

    def forbid(self, fault: Fault) -> None:
        self.interlock = fault

    def fail(self, fault: Fault, axis: int) -> None:
        self.failed.append((fault, axis))

    def not_in_position(self) -> int:
        return self.late


class Tie:
    """A thread that the test has as it likes."""

    def __init__(self) -> None:
        self.active = self.lags = self.deaf = False
        self.rev_s = 0.0

    def end(self) -> None:
        self.active = False

    def lead(self) -> None: ...


class Bench:
    def __init__(
        self, machine: Machine | None = None, mode: Mode = Mode.OFF, beside: tuple[str, ...] = ()
    ) -> None:
        made = machine or equipped()
        if beside:
            made = replace(made, changer=SimpleNamespace(beside=beside))  # type: ignore[arg-type]
        self.spindle, self.node, self.modes, self.tie = Turning(), Node(), Told(mode), Tie()
        self.all = Peripherals(made, self.spindle, (self.node,), self.tie)  # type: ignore[arg-type]

    def watch(
        self, count: int = 1, standing: bool = True, actual: list[float] = HERE, share: float = 1.0
    ) -> None:
        for _ in range(count):
            self.all.watch(0.0, self.modes, actual, standing, 1, share)  # type: ignore[arg-type]

    def run(self, **told: Any) -> None:
        """A program has said so, and all of it has come."""
        self.modes.mode = Mode.RUNNING
        self.all.tell(Piece(-1, 1, dwell(0.0).law, 0.0, sets=True, **told))
        self.watch(FRESH_TICKS + 1)


# ---- what is put out


def test_before_anything_was_said_nothing_is_on() -> None:
    bench = Bench()
    assert (bench.all.outputs, bench.all.rev_min, bench.all.coolant, bench.all.waiting) == (0, 0.0, 0, False)
    for mode in (Mode.OFF, Mode.READY, Mode.RUNNING, Mode.HOLD):
        bench = Bench(mode=mode)
        bench.watch(10)
        assert (bench.node.outputs, bench.spindle.told, bench.all.waiting) == (0, 0.0, False)
        assert not bench.modes.failed


def test_outputs_of_a_program_are_switched_by_their_number_each_by_itself() -> None:
    bench = Bench(mode=Mode.RUNNING)
    seen = []
    for on, off in ((1, 0), (2, 0), (0, 1), (1, 2), (4, 0), (0, 0), (0, 7)):
        bench.all.switch((on, off, ()))
        bench.watch()
        seen.append(bench.node.outputs)
    assert seen == [AIR, AIR | VACUUM, VACUUM, AIR, AIR | ARM, AIR | ARM, 0]


def test_an_error_of_our_own_switches_the_coolant_off_and_leaves_the_rest() -> None:
    for inverted in ((), ("coolant",), ("mist", "air")):
        bench = Bench(equipped(inverted=inverted))
        bench.run(coolant=3, open_clamps=A, outputs=(1, 0, ()))
        flip = sum(1 << OUTPUTS.index(name) for name in inverted)
        assert bench.node.outputs == (COOLANT | MIST | A_OPEN | AIR) ^ flip
        bench.all.coolant_off()
        assert bench.node.outputs == (A_OPEN | AIR) ^ flip


def test_a_machine_without_a_node_has_no_clamps_to_wait_for() -> None:
    alone = Peripherals(equipped(), Turning(), ())  # type: ignore[arg-type]
    assert alone.present and alone.opens_for(A) and alone.late_to_open() == -1
    alone.coolant_off()
    alone.watch(0.0, Told(), HERE, True, 1)  # type: ignore[arg-type]


def test_a_changer_is_prepared_by_all_outputs_of_a_step_or_none() -> None:
    bench = Bench(beside=("arm", "air"))

    def prepare(value: float) -> bool:
        return bench.all.by_hand(Request.PREPARE, value, Mode.RUNNING)

    bench.modes.mode = Mode.RUNNING
    seen = []
    for on, off in ((1, 0), (2, 0), (0, 1), (1, 2)):
        assert prepare(float(on + off * BESIDE))
        bench.watch()
        seen.append(bench.node.outputs)
    assert seen == [ARM, ARM | AIR, AIR, ARM]
    for value in (
        0.0,
        -1.0,
        0.5,
        1.5,
        4.0,
        5.0,
        4.0 * BESIDE,
        float(BESIDE) ** 2,
        float("nan"),
        float("inf"),
    ):
        assert not prepare(value)
    bench.watch()
    assert bench.node.outputs == ARM, "nothing of what was refused"


def test_at_a_fault_all_stays_until_the_axes_stand_or_are_given_up() -> None:
    for standing, on_path, off in ((False, True, False), (True, True, True), (False, False, True)):
        bench = Bench()
        bench.run(spindle_rev_min=800.0, coolant=2, open_clamps=X, outputs=(3, 0, ()))
        full = COOLANT | X_OPEN | AIR | VACUUM
        assert bench.node.outputs == full and bench.spindle.told == 800.0
        bench.modes.mode, bench.modes.on_path = Mode.FAULT, on_path
        bench.watch(60, standing=standing)
        assert bench.node.outputs == (VACUUM if off else full), "but for what is held"
        assert bench.spindle.told == (0.0 if off else 800.0)


def test_by_hand_a_program_that_is_over_leaves_nothing_and_one_that_runs_what_it_said() -> None:
    """In READY the hand begins anew; in a run it changes the coolant alone."""
    bench = Bench()
    bench.run(spindle_rev_min=800.0, coolant=2)
    assert bench.all.by_hand(Request.COOLANT, 1.0, Mode.RUNNING)
    bench.watch()
    assert (bench.spindle.told, bench.node.outputs) == (800.0, MIST)
    for clamps in (0, X, A, X | A):
        assert bench.all.by_hand(Request.CLAMPS, float(clamps), Mode.HOLD)
    for clamps in (1 << 1, A | 1 << 4, 1 << 5, -1):
        assert not bench.all.by_hand(Request.CLAMPS, float(clamps), Mode.HOLD), "there is none"
    bench.modes.mode = Mode.READY
    assert bench.all.by_hand(Request.COOLANT, 1.0, Mode.READY)
    bench.watch()
    assert (bench.spindle.told, bench.node.outputs) == (0.0, MIST)
    assert bench.all.by_hand(Request.SPINDLE, -500.0, Mode.READY)
    bench.watch()
    assert (bench.spindle.told, bench.node.outputs) == (-500.0, MIST), "one after the other"
    bench.modes.mode = Mode.RUNNING
    bench.watch()
    assert (bench.spindle.told, bench.node.outputs) == (0.0, 0), "a program begins with nothing"


def test_a_line_by_hand_begins_with_what_is_on_and_leaves_on_what_it_said() -> None:
    bench = Bench(mode=Mode.READY)
    assert bench.all.by_hand(Request.SPINDLE, 500.0, Mode.READY)
    assert bench.all.by_hand(Request.COOLANT, 1.0, Mode.READY)
    bench.watch()
    bench.modes.stays_on = StaysOn.BEFORE | StaysOn.AFTER
    bench.modes.mode = Mode.RUNNING
    bench.watch()
    assert (bench.spindle.told, bench.node.outputs) == (500.0, MIST)
    bench.run(spindle_rev_min=-800.0, coolant=2, open_clamps=A)
    bench.modes.mode, bench.modes.ended = Mode.READY, True
    bench.watch(100)
    assert (bench.spindle.told, bench.node.outputs) == (-800.0, COOLANT), "and the clamps are closed"
    bench.modes.mode = Mode.JOG
    bench.watch()
    assert bench.spindle.told == -800.0
    bench.modes.mode, bench.modes.stays_on = Mode.RUNNING, 0
    bench.watch()
    assert (bench.spindle.told, bench.node.outputs) == (0.0, 0), "a program begins with nothing"


def test_a_line_by_hand_that_is_stopped_leaves_nothing_on() -> None:
    bench = Bench(mode=Mode.READY)
    bench.modes.stays_on = StaysOn.BEFORE | StaysOn.AFTER
    bench.run(spindle_rev_min=800.0, coolant=2)
    bench.modes.mode = Mode.STOPPING
    bench.watch()
    assert bench.spindle.told == 800.0, "until it stands"
    bench.modes.mode = Mode.READY
    bench.watch()
    assert (bench.spindle.told, bench.node.outputs) == (0.0, 0)


@pytest.mark.parametrize("stuck", [False, True])
def test_motion_waits_for_a_clamp_that_is_told_to_open_and_for_one_that_is_told_to_close(stuck: bool) -> None:
    for was, wanted in ((0, A), (A, 0)):
        bench = Bench()
        bench.run(open_clamps=was)
        bench.watch(60)
        assert not bench.all.waiting
        bench.node.stuck = stuck
        bench.run(open_clamps=wanted)
        bench.watch(30)
        assert bench.all.waiting is stuck
        assert not bench.modes.failed


# ---- what is waited for


def test_motion_waits_until_the_spindle_has_answered_and_is_at_speed() -> None:
    """What it says at first is of the speed before."""
    bench = Bench()
    bench.modes.mode = Mode.RUNNING
    bench.all.tell(Piece(-1, 1, dwell(0.0).law, 0.0, sets=True, spindle_rev_min=800.0))
    waits = []
    for _ in range(6):
        bench.watch()
        waits.append(bench.all.waiting)
    assert waits == [n < FRESH_TICKS for n in range(1, 7)]


def test_a_spindle_that_does_not_come_to_speed_is_told_of_no_axis() -> None:
    bench = Bench()
    bench.spindle.at_speed = False
    bench.run(spindle_rev_min=800.0)
    bench.watch(round(0.2 / T) - FRESH_TICKS - 1)
    assert not bench.modes.failed
    bench.watch()
    assert bench.modes.failed == [(Fault.SPINDLE_NOT_AT_SPEED, -1)] and bench.all.waiting


def test_an_input_that_does_not_come_is_told_after_its_time_and_of_no_axis() -> None:
    bench = Bench()
    bench.node.inputs &= ~THERE
    bench.run(awaits=Awaited(THERE, True, False, 50))
    bench.watch(50 - FRESH_TICKS - 1)
    assert not bench.modes.failed
    bench.watch()
    assert bench.modes.failed == [(Fault.INPUT_MISSING, -1)] and bench.all.waiting
    bench.node.inputs |= THERE
    bench.watch()
    assert not bench.all.waiting


@pytest.mark.parametrize("on", [False, True])
@pytest.mark.parametrize("edge", [False, True])
def test_an_edge_counts_only_where_the_input_was_seen_to_be_otherwise(edge: bool, on: bool) -> None:
    bench = Bench()
    bench.node.inputs = ALL if on else ALL & ~THERE
    bench.run(awaits=Awaited(THERE, on, edge, 500))
    bench.watch(10)
    assert bench.all.waiting is edge
    bench.node.inputs ^= THERE
    bench.watch(2)
    assert bench.all.waiting is edge
    bench.node.inputs ^= THERE
    bench.watch()
    assert not bench.all.waiting


def test_what_is_said_counts_where_the_axes_have_come_to() -> None:
    bench = Bench()
    bench.modes.late = 2
    bench.run(spindle_rev_min=800.0)
    assert bench.spindle.told == 0.0 and bench.all.waiting
    bench.modes.late = -1
    bench.watch()
    assert bench.spindle.told == 800.0
    bench = Bench()
    bench.modes.late = 2
    bench.run(spindle_rev_min=800.0)
    bench.watch(round(IN_POSITION_S / T) - FRESH_TICKS - 1)
    assert not bench.modes.failed
    bench.watch()
    assert bench.modes.failed == [(Fault.FOLLOWING_ERROR, 2)]


def test_motion_waits_again_when_a_door_that_stopped_the_spindle_is_closed() -> None:
    bench = Bench()
    bench.run(spindle_rev_min=800.0)
    assert not bench.all.waiting
    bench.node.inputs &= ~DOOR
    bench.watch(3)
    assert bench.spindle.told == 0.0
    bench.watch(10)
    bench.node.inputs |= DOOR
    bench.spindle.at_speed = False
    bench.watch(3)
    assert bench.spindle.told == 800.0 and bench.all.waiting


# ---- what is found


@pytest.mark.parametrize(("lags", "fault"), [(True, Fault.SPINDLE_LAGS), (False, Fault.SPINDLE_LOST)])
def test_along_a_thread_a_spindle_that_lags_and_one_that_is_not_heard_are_two_faults(
    lags: bool, fault: Fault
) -> None:
    bench = Bench()
    bench.run(spindle_rev_min=800.0)
    bench.tie.active, bench.tie.lags, bench.tie.deaf = True, lags, not lags
    bench.watch()
    assert bench.modes.failed == [(fault, -1)]


def test_a_spindle_may_sag_for_half_a_second_and_then_is_told() -> None:
    bench = Bench()
    bench.run(spindle_rev_min=800.0)
    bench.watch(200)
    bench.spindle.at_speed = False
    bench.watch(round(SPEED_LOST_S / T))
    assert not bench.modes.failed
    bench.watch()
    assert bench.modes.failed == [(Fault.SPINDLE_NOT_AT_SPEED, -1)]


def test_coolant_that_does_not_flow_is_told_after_two_seconds() -> None:
    bench = Bench()
    bench.node.inputs &= ~FLOW
    bench.modes.mode = Mode.RUNNING
    bench.watch(2000)
    assert not bench.modes.failed, "none is wanted"
    bench.all.by_hand(Request.COOLANT, 2.0, Mode.RUNNING)
    bench.watch(round(FLOW_S / T))
    assert not bench.modes.failed
    bench.watch()
    assert bench.modes.failed == [(Fault.COOLANT_LOST, -1)]


@pytest.mark.parametrize("interlocked", [False, True])
def test_a_node_that_is_silent_forbids_motion_where_something_on_it_does(interlocked: bool) -> None:
    names = INPUTS if interlocked else ("a", "b", "c", "d", "e", "x_closed", "a_closed", "there")
    bench = Bench(equipped(inputs=numbered(names)))
    bench.modes.interlock = Fault.DOOR_OPEN
    bench.node.heard = False
    bench.watch()
    assert bench.modes.interlock is (Fault.IO_LOST if interlocked else Fault.NONE)


@pytest.mark.parametrize(
    ("mode", "rev_min", "fails"),
    [
        (Mode.RUNNING, 0.0, True),
        (Mode.JOG, 0.0, True),
        (Mode.HOMING, 0.0, True),
        (Mode.HOLD, 800.0, True),
        (Mode.HOLD, 0.0, False),
        (Mode.READY, 800.0, False),
        (Mode.READY, 0.0, False),
        (Mode.OFF, 0.0, False),
    ],
)
def test_an_open_door_is_a_fault_where_something_moves_and_else_only_forbids(
    mode: Mode, rev_min: float, fails: bool
) -> None:
    """Told by hand in READY the spindle is switched off, which needs no fault."""
    bench = Bench()
    if mode is Mode.READY:
        bench.modes.mode = mode
        assert bench.all.by_hand(Request.SPINDLE, rev_min, mode)
        bench.watch(3)
    elif rev_min:
        bench.run(spindle_rev_min=rev_min)
    bench.modes.mode = mode
    bench.watch()
    bench.node.inputs &= ~DOOR
    bench.watch()
    assert bench.modes.interlock is Fault.DOOR_OPEN
    assert bench.modes.failed == ([(Fault.DOOR_OPEN, -1)] if fails else [])
    assert bench.spindle.told == 0.0


# ---- clamps


def test_clamps_that_were_open_for_homing_close_after_it_and_open_again_for_the_next() -> None:
    bench = Bench()
    for _ in range(2):
        assert not bench.all.opens_for(A)
        bench.watch(FRESH_TICKS + 1)
        assert bench.all.opens_for(A)
        bench.watch(20)
        assert bench.node.outputs == A_OPEN, "in OFF, until homing begins"
        bench.modes.mode = Mode.HOMING
        bench.watch(20)
        assert bench.node.outputs == A_OPEN
        bench.modes.mode = Mode.OFF
        bench.watch(2)
        assert bench.node.outputs == 0, "its axis has stood"


def test_a_clamp_that_does_not_open_is_named_after_its_time() -> None:
    bench = Bench()
    bench.node.stuck = True
    assert not bench.all.opens_for(X)
    bench.watch(round(0.1 / T) + 1)
    assert bench.all.late_to_open() == -1
    bench.watch()
    assert bench.all.late_to_open() == 0


def clamped(report: bool = True) -> tuple[Clamped, float, int]:
    """With the most that its axis may move in a tick and stand, and the ticks for which it must."""
    built = equipped()
    assert built.io is not None
    clamp = Clamp("a_open", "a_closed" if report else "", 0.1)
    made = Clamped(3, built.axes[3], clamp, built.io, T)
    return made, STANDING_SHARE * built.axes[3].limits.velocity * T, round(STANDING_S / T)


def test_a_clamp_opens_at_once_and_closes_on_an_axis_that_has_stood_for_its_time() -> None:
    clamp, step, ticks = clamped()
    assert clamp.turn(True, 0.0, 1) == A_OPEN and clamp.is_open
    seen = [clamp.turn(False, 0.9 * step * n, 1) for n in range(1, ticks + 5)]
    assert seen == [A_OPEN] * (ticks - 2) + [0] * 6, "it stood in the tick before these, too"
    clamp.turn(True, 0.0, 1)
    for n in range(3 * ticks):
        assert clamp.turn(False, 1.1 * step * n * (-1) ** n, 1) == A_OPEN, "it moves"


def test_a_clamp_that_reports_is_done_when_it_says_so_and_one_that_does_not_after_its_time() -> None:
    clamp, _, _ = clamped()
    clamp.turn(True, 0.0, 1)
    done = [clamp.is_done(0)]
    for _ in range(5):
        clamp.turn(True, 0.0, 1)
        done.append(clamp.is_done(0))
    assert done == [n >= FRESH_TICKS for n in range(6)], "what it says at first is of before"
    assert not clamp.is_done(A_CLOSED)
    clamp, _, _ = clamped(report=False)
    clamp.turn(True, 0.0, 1)
    done = []
    for _ in range(60):
        clamp.turn(True, 0.0, 1)
        done.append(clamp.is_done(0))
        assert not clamp.is_late(0)
    assert done == [n >= round(0.1 / T) for n in range(1, 61)]
