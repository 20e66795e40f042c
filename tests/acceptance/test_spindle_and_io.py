"""A mill with spindle, coolant, doors and rotary clamps on the stepped clock: a program, what stops it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from support.machines.spindle_machine import (
    A_CLOSED,
    A_OPEN,
    C_CLOSED,
    C_OPEN,
    COOLANT,
    DOOR,
    ESTOP,
    SLOWER,
    Mill,
    mill,
)

from controller.ipc.handoff import Snapshot
from controller.machine.model import Machine
from controller.runtime.events import Event
from controller.runtime.startup import SessionError
from controller.state.modes import Fault, Mode, Request

PROGRAM = """G21 G90 G54 G40
S6000 M3 M8
G0 X5. Y-50.
G1 Z130. F6000
G1 C10. F2000
M9
G1 X40.
M5
G0 X0
M30
"""
CUTTING = range(4, 8)  # lines of G1
MOVED = 1e-12


def turned(before: Snapshot, now: Snapshot, axis: int) -> bool:
    return abs(now.joints[axis] - before.joints[axis]) > MOVED


def moves(before: Snapshot, now: Snapshot) -> bool:
    return any(turned(before, now, axis) for axis in range(5))


def pairs(mill: Mill) -> list[tuple[Snapshot, Snapshot]]:
    return list(zip(mill.seen[:-1], mill.seen[1:], strict=True))


def cuts(mill: Mill, *lines: int, first: int = 0) -> list[Snapshot]:
    """The ticks in which the machine moves on some lines."""
    rows = pairs(mill)[first:]
    return [
        now for before, now in rows if before.line == now.line and now.line in lines and moves(before, now)
    ]


def tick_of(mill: Mill, wanted: Callable[[Snapshot], bool]) -> int:
    """How many ticks after cycle start something is seen first."""
    return next(i for i, now in enumerate(mill.seen) if wanted(now))


@pytest.fixture(scope="module")
def whole() -> Mill:
    """The program, undisturbed."""
    made = Mill()
    assert made.run(PROGRAM).result == "completed"
    return made


def cutting_at(whole: Mill, line: int = 7, share: float = 0.5) -> int:
    """A tick in the middle of a line's motion."""
    ticks = [i for i, (a, b) in enumerate(pairs(whole)) if a.line == b.line == line and moves(a, b)]
    return ticks[int(share * len(ticks))]


# ---- a program ---------------------------------------------------------------------


def test_nothing_moves_before_the_spindle_is_at_speed_and_the_coolant_on(whole: Mill) -> None:
    cut = cuts(whole, *CUTTING)
    assert len(cut) > 100
    assert all(now.spindle_at_speed and now.spindle_rev_min == 6000.0 for now in cut)
    assert all(abs(now.spindle_actual_rev_min - 6000.0) <= 300.0 for now in cut)
    wet = [now.outputs >> COOLANT & 1 for now in cut]
    assert wet == [now.line < 6 for now in cut]


def test_a_clamp_is_open_whenever_its_axis_moves_and_the_other_stays_closed(whole: Mill) -> None:
    turning = [now for before, now in pairs(whole) if turned(before, now, 4)]
    assert len(turning) > 50
    assert not any(now.inputs >> C_CLOSED & 1 for now in turning)
    in_program = [now for now in whole.seen if now.mode is Mode.RUNNING]
    assert all(now.inputs >> A_CLOSED & 1 for now in in_program[60:])
    assert all(now.inputs >> C_CLOSED & 1 for now in cuts(whole, 7))


def test_at_the_end_of_the_program_everything_is_off(whole: Mill) -> None:
    now = whole.ticks(100)
    assert (now.mode, now.spindle_rev_min, now.coolant, now.outputs) == (Mode.READY, 0.0, 0, 0)
    assert abs(now.spindle_actual_rev_min) < 10.0


def test_the_same_program_gives_the_same_setpoints_with_and_without_peripherals(whole: Mill) -> None:
    plain = Mill(mill("", "", "", changes=(SLOWER,)))
    text = PROGRAM.replace("S6000 M3 M8\n", "").replace("M9\n", "").replace("M5\n", "")
    assert plain.run(text).result == "completed"

    def way(of: Mill) -> np.ndarray:
        moving = [now.joints for before, now in pairs(of) if moves(before, now)]
        return np.array(moving)

    # Without a spindle to wait for, the first tick moves, and nothing was seen before it.
    assert way(whole)[1:] == pytest.approx(way(plain), abs=1e-9)


def test_an_override_turned_while_the_spindle_speeds_up_loses_none_of_the_words_before_the_motion() -> None:
    made = Mill()
    events = [Event(40 * i, Request.OVERRIDE, 1.0 - 0.1 * i) for i in range(4)]
    program = "S6000 M3 M8\nG54 G1 X5. Y-50. F6000\nG1 Z130.\n"
    assert made.run(program, *events).result == "completed"
    cut = cuts(made, 2, 3)
    assert len(cut) > 100 and all(now.spindle_at_speed and now.outputs >> COOLANT & 1 for now in cut)


def test_a_hold_in_a_turn_keeps_clamp_and_spindle_and_resume_goes_on_at_once(whole: Mill) -> None:
    at = cutting_at(whole, 5)
    made = Mill()
    events = [Event(at, Request.HOLD), Event(at + 200, Request.RESUME)]
    assert made.run(PROGRAM, *events).result == "completed"
    held = made.seen[at + 190]
    assert (held.mode, held.at_rest, held.spindle_rev_min) == (Mode.HOLD, True, 6000.0)
    assert held.outputs >> C_OPEN & 1 and held.outputs >> COOLANT & 1
    assert any(turned(before, now, 4) for before, now in pairs(made)[at + 200 : at + 220])


# ---- doors and circuits ------------------------------------------------------------


def test_a_door_opened_in_a_cut_holds_on_the_path_and_stops_the_spindle_there(whole: Mill) -> None:
    at = cutting_at(whole)
    made = Mill()
    made.at[at] = made.input(DOOR, False)
    run = made.run(PROGRAM)
    now = made.ticks(800)
    assert (run.result, now.mode, now.fault) == ("held", Mode.HOLD, Fault.DOOR_OPEN)
    assert now.at_rest and now.interlock is Fault.DOOR_OPEN
    slowing = [now for before, now in pairs(made)[at + 5 :] if moves(before, now)]
    assert slowing and all(now.spindle_rev_min == 6000.0 for now in slowing)
    assert now.spindle_rev_min == 0.0 and abs(now.spindle_actual_rev_min) < 10.0 and not now.outputs


def test_resume_with_the_door_open_is_refused_and_after_it_the_spindle_comes_first(whole: Mill) -> None:
    at = cutting_at(whole)
    made = Mill()
    made.at |= {at: made.input(DOOR, False), at + 1000: made.input(DOOR, True)}
    events = [Event(at + 800, Request.RESUME), Event(at + 1100, Request.RESUME)]
    assert made.run(PROGRAM, *events).result == "completed"
    assert made.seen[at + 810].mode is Mode.HOLD, "the resume was refused"
    cut = cuts(made, 7, first=at + 1100)
    assert len(cut) > 20 and all(now.spindle_at_speed and now.spindle_rev_min == 6000.0 for now in cut)
    assert made.seen[-1].joints == pytest.approx(whole.seen[-1].joints)


def test_a_start_with_the_door_open_moves_nothing_and_says_so() -> None:
    made = Mill()
    made.at[0] = made.input(DOOR, False)
    made.ticks(60)
    with pytest.raises(SessionError, match="does not start: The door is open"):
        made.run(PROGRAM)
    assert not any(moves(before, now) for before, now in pairs(made))


def test_an_open_emergency_circuit_stops_all_at_once_and_until_it_is_closed(whole: Mill) -> None:
    at = cutting_at(whole, 5)
    made = Mill()
    made.at[at] = made.input(ESTOP, False)
    run = made.run(PROGRAM)
    assert (run.result, run.fault) == ("fault", Fault.ESTOP_INPUT)
    first = tick_of(made, lambda now: now.fault is Fault.ESTOP_INPUT)
    assert first - at <= 3
    assert made.seen[first].spindle_rev_min == 0.0 and not made.seen[first].outputs >> COOLANT & 1
    now = made.ticks(500)
    assert not now.outputs and now.inputs >> C_CLOSED & 1
    standing = tick_of(made, lambda now: not now.outputs >> C_OPEN & 1 and now.fault is Fault.ESTOP_INPUT)
    moved = [abs(b.actual[4] - a.actual[4]) for a, b in pairs(made)[standing - 5 : standing]]
    assert max(moved) < 1e-5
    made.bench.request(Request.RESET)
    assert made.ticks(20).mode is Mode.FAULT
    made.at.clear()
    made.input(ESTOP, True)()
    made.ticks(20)
    made.bench.request(Request.RESET)
    made.ticks(100)
    made.bench.come_up()
    assert made.run(PROGRAM).result == "completed"


def test_a_machine_does_not_come_up_with_an_open_circuit() -> None:
    made = Mill(come_up=False)
    made.input(ESTOP, False)()
    with pytest.raises(SessionError, match="emergency-stop circuit"):
        made.bench.come_up()


def test_a_silent_node_with_the_inputs_stops_the_machine(whole: Mill) -> None:
    made = Mill()
    made.at[cutting_at(whole)] = lambda: setattr(made.io, "link", None)
    run = made.run(PROGRAM)
    assert (run.result, run.fault) == ("fault", Fault.IO_LOST)


def test_a_silent_spindle_drive_stops_the_machine(whole: Mill) -> None:
    made = Mill()
    made.at[cutting_at(whole)] = lambda: setattr(made.bench.rig.spindle, "link", None)
    run = made.run(PROGRAM)
    assert (run.result, run.fault) == ("fault", Fault.SPINDLE_LOST)


def test_a_door_opened_while_the_spindle_speeds_up_stops_it_and_nothing_has_moved() -> None:
    made = Mill()
    made.at[60] = made.input(DOOR, False)
    run = made.run(PROGRAM)
    now = made.ticks(300)
    assert (run.result, run.fault) == ("held", Fault.DOOR_OPEN)
    assert now.spindle_rev_min == 0.0 and not any(moves(before, now) for before, now in pairs(made))


# ---- what does not do as it is told ------------------------------------------------


def test_a_spindle_that_does_not_come_to_speed_in_time_is_a_fault_before_the_first_cut() -> None:
    slow = replace(mill(), spindle=replace(mill().spindle, acceleration_rev_s2=20.0, spin_up_s=0.3))  # type: ignore[type-var]
    made = Mill(slow)
    run = made.run(PROGRAM)
    assert (run.result, run.fault) == ("held", Fault.SPINDLE_NOT_AT_SPEED)
    assert not any(moves(before, now) for before, now in pairs(made))


@pytest.mark.parametrize(("stuck", "axis"), ((C_OPEN, 4),))
def test_a_clamp_that_does_not_open_is_a_fault_and_its_axis_is_not_moved(stuck: int, axis: int) -> None:
    made = Mill()
    made.io._wires = [wire for wire in made.io._wires if wire[0] != stuck]
    run = made.run(PROGRAM)
    assert (run.result, run.fault, run.fault_axis) == ("fault", Fault.CLAMP, axis)
    assert not any(turned(before, now, axis) for before, now in pairs(made))


def test_no_axis_homes_before_its_clamp_is_open() -> None:
    made = Mill(come_up=False)
    made.io._wires = [wire for wire in made.io._wires if wire[0] != A_OPEN]
    with pytest.raises(SessionError, match="clamp"):
        made.bench.come_up()


# ---- homing ------------------------------------------------------------------------


def only_z(text: str) -> Machine:
    old = "homing = { method = 37, group = 0, position_mm = 260.0 }"
    return mill(changes=((old, f"homing = {text}"),))


def test_an_axis_with_an_absolute_encoder_is_where_it_is_and_is_not_homed() -> None:
    made = Mill(only_z("{ absolute = true, position_mm = 260.0 }"), come_up=False)
    made.bench.come_up()
    now = made.ticks(1)
    assert now.homed == 0b11111 and now.joints[2] == pytest.approx(260.0)
    assert now.untrusted == 0


def test_axes_of_a_group_home_side_by_side_and_the_command_follows_each_while_it_moves() -> None:
    switched = mill(
        "",
        "",
        "",
        changes=tuple(
            (
                f'node = {node}\nprofile = "simulated"\nhoming = {{ method = 37, group = 1,',
                f'node = {node}\nprofile = "simulated"\nhoming = {{ method = 24, fast_mm_s = 20.0, '
                "slow_mm_s = 4.0, acceleration_mm_s2 = 500.0, group = 1,",
            )
            for node in (1, 2)
        ),
    )
    made = Mill(switched, come_up=False)
    made.bench.come_up()
    homing_now = [now for now in made.seen if now.mode is Mode.HOMING]
    moved = [(turned(a, b, 0), turned(a, b, 1)) for a, b in pairs(made) if b.mode is Mode.HOMING]
    assert any(x and y for x, y in moved)
    assert all(now.joints == now.actual for now in homing_now)
    order = [now.homed for now in made.seen]
    assert order.index(0b00100) < order.index(0b11111)


def test_what_is_homed_already_is_not_homed_again() -> None:
    made = Mill()
    made.bench.request(Request.DISABLE)
    made.ticks(200)
    made.bench.come_up()
    assert made.seen[-1].mode is Mode.READY
    assert not any(now.mode is Mode.HOMING for now in made.seen)
