"""M48 to M53 on the stepped clock: where override and the input feed_stop count."""

from __future__ import annotations

import itertools

import pytest
from support.machines.interrupted_runs import Items, rest_of
from support.machines.spindle_machine import SLOWER, SPINDLE, Mill, mill

from controller.machine.model import Machine
from controller.plan.restart.program_position import ENTRY_ID, Spot
from controller.runtime.events import Event
from controller.state.modes import Mode, Request

FEED_STOP = 2  # bit of the input
X0 = 8.0  # of G54
WITH = """
[io]
bus = "can1"
node = 11
inputs = { estop = 0, door = 1, feed_stop = 2 }
outputs = { coolant = 0 }
"""
SWITCHED = "G21 G90 G54 G61\nG1 X10. F1200\nM49\nG1 X20.\nM48\nG1 X30.\nM30\n"


def machine() -> Machine:
    return mill(SPINDLE, WITH, "", changes=(SLOWER,))


def set_to(made: Mill, request: Request, share: float) -> None:
    """Before the start."""
    made.bench.request(request, share)
    made.ticks(5)
    made.seen.clear()


def fastest(made: Mill, line: int) -> float:
    """Of X on a line, mm/s."""
    period_s = made.machine.period_s
    pairs = itertools.pairwise(made.seen)
    return max(abs(b.joints[0] - a.joints[0]) / period_s for a, b in pairs if a.line == b.line == line)


@pytest.mark.parametrize("override", [0.5, 1.5])
def test_an_override_counts_on_all_lines_but_those_under_m49(override: float) -> None:
    made = Mill(machine())
    set_to(made, Request.OVERRIDE, override)
    assert made.run(SWITCHED).result == "completed"
    assert [fastest(made, line) for line in (2, 4, 6)] == pytest.approx(
        [20.0 * override, 20.0, 20.0 * override], rel=0.02
    )
    shown = {now.line: now.own_feed for now in made.seen if now.mode is Mode.RUNNING}
    assert (shown[2], shown[4], shown[6]) == (False, True, False)


def test_an_override_given_in_the_middle_counts_from_m48_on() -> None:
    made = Mill(machine())
    text = "G21 G90 G54 G61\nM50 P0\nG1 X20. F1200\nM50 P1\nG1 X40.\nM30\n"
    assert made.run(text, Event(150, Request.OVERRIDE, 0.5)).result == "completed"
    assert fastest(made, 3) == pytest.approx(20.0, rel=0.02)
    (*_, slow) = [b.joints[0] - a.joints[0] for a, b in itertools.pairwise(made.seen) if b.joints[0] < 43.0]
    assert slow / made.machine.period_s == pytest.approx(10.0, rel=0.02)


def test_an_override_of_nothing_stands_before_m49_and_not_behind_it() -> None:
    made = Mill(machine())
    run = made.run("G21 G90 G54\nM49\nG1 X20. F1200\nM30\n", Event(100, Request.OVERRIDE, 0.0))
    assert run.result == "completed"
    made = Mill(machine())
    run = made.run("G21 G90 G54\nM49\nM48\nG1 X20. F1200\nM30\n", Event(100, Request.OVERRIDE, 0.0))
    assert run.result == "held" and 0.0 < made.seen[-1].joints[0] < 27.0


def test_rapids_and_hold_stay_with_the_operator_under_m49() -> None:
    made = Mill(machine())
    text = "G21 G90 G54\nM49\nG0 X40.\nG0 X0.\nM30\n"
    full, slow = Mill(machine()), Mill(machine())
    full.run(text)
    set_to(slow, Request.RAPID_OVERRIDE, 0.25)
    slow.run(text)
    assert fastest(slow, 3) < 0.5 * fastest(full, 3)
    made.run(SWITCHED, Event(200, Request.HOLD), Event(600, Request.RESUME))
    held = [now for now in made.seen if now.mode is Mode.HOLD and now.at_rest]
    assert held and all(now.joints == held[0].joints for now in held)


BEHIND = "G21 G90 G54 G61\n{}\nG1 X10. F1200\n{}\nG1 X20.\nM30\n"


def tick_at(program: str, x: float) -> int:
    """In which an undisturbed run comes by, of the joint."""
    made = Mill(machine())
    made.run(program)
    return next(i for i, now in enumerate(made.seen) if now.joints[0] > x + X0)


def stopped(program: str, x: float, for_ticks: int = 400) -> tuple[Mill, set[float]]:
    """The input goes off at X and comes back; where X stood before it did."""
    made, at = Mill(machine()), tick_at(program, x)
    made.at[at], made.at[at + for_ticks] = made.input(FEED_STOP, False), made.input(FEED_STOP, True)
    assert made.run(program).result == "completed"
    return made, {now.joints[0] - X0 for now in made.seen[at + for_ticks - 100 : at + for_ticks]}


@pytest.mark.parametrize("before", ["M53 P1", "M53", ""])
def test_the_input_stops_motion_on_the_path_and_it_goes_on_by_itself(before: str) -> None:
    made, stood = stopped(BEHIND.format(before, ""), 5.0)
    assert len(stood) == 1 and 5.0 < min(stood) < 6.5
    still = [now for now in made.seen if now.joints[0] - X0 in stood]
    assert any(now.feed_stopped for now in still) and {now.mode for now in still} == {Mode.RUNNING}
    assert made.seen[-1].joints[0] - X0 == pytest.approx(20.0, abs=1e-6)


def test_under_m53_p0_it_does_not() -> None:
    made, _ = stopped(BEHIND.format("M53 P0", ""), 5.0)
    moved = [b.joints[0] - a.joints[0] for a, b in itertools.pairwise(made.seen) if 9.0 < a.joints[0] < 27.0]
    assert min(moved) > 0.0


def test_it_counts_in_the_tick_in_which_the_line_behind_begins() -> None:
    _, stood = stopped(BEHIND.format("M53 P0", "M53 P1"), 5.0)
    assert len(stood) == 1 and 10.0 < min(stood) < 11.0, "the length in which it brakes from 20 mm/s"


def test_it_stops_rapids_too() -> None:
    _, stood = stopped("G21 G90 G54\nG0 X60.\nM30\n", 10.0)
    assert len(stood) == 1 and 10.0 < min(stood) < 55.0


def test_a_restart_behind_m49_runs_as_the_program_has_it() -> None:
    made = Mill(machine())
    set_to(made, Request.OVERRIDE, 0.5)
    rest = rest_of(SWITCHED, Spot(4, 0.0), made.machine)
    made.bench.run(Items(rest.entered(made.bench.joints, 1)))
    made.seen = [now for now in made.seen if 0 <= now.motion_id < ENTRY_ID]
    assert [fastest(made, line) for line in (4, 6)] == pytest.approx([20.0, 10.0], rel=0.02)
