"""What is told to be left of a program is what it then takes: at a start, after an override, with changes."""

from __future__ import annotations

import contextlib
import random
import sqlite3
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest
from support.machines.timed_runs import Timed, TimedRun

from controller.machine import machine_file
from controller.machine.model import Machine
from controller.plan.restart.program_position import Spot
from controller.plan.segment import Wait
from controller.plan.timetable import Event, Timetable
from controller.plan.waits import BY_HAND, CHANGE, OPTIONAL, STOP
from controller.program.modal import power_on
from controller.runtime.plan_messages import Program
from controller.service.durations import of_service, of_state
from controller.service.jobs import Job, settles_s
from controller.service.time_left import TimeLeft
from controller.state.modes import Request
from controller.store.service_store import ServiceStore

SLOW_S = 0.01  # a tick of the machines here: a fifth of what shipped ones cost
START, OVERRIDE, SHOP = 0.005, 0.001, 0.03  # shares of what is left by which it may be told wrong
SOON_S = 0.6  # after a start or an override the rest has been planned
TICKS_S = 0.1  # what a look, and the drives at the end, may add to it


@cache
def machine(name: str) -> Machine:
    return machine_file.with_period(machine_file.load(name), SLOW_S)


LINES = "\n".join(f"G1 X{3 * (k % 7)} Y{2 * (k % 5)} F{(900, 2500, 6000)[k % 3]}" for k in range(11, 30))
PLAIN = f"""G21 G90 G54 G94 G17 G64 P0.05
G0 X10 Y10 Z40
G1 Z30 F500
{LINES}
G4 P0.8
G0 Z60
G3 X23 Y8 I10 J0 F1800
G1 X0 F3000
M30
"""
MILLED = """G21 G90 G54 G94 G17
S6000 M3 M8
G0 X0 Y0 Z160
G1 X30 F1500
{middle}
Y20
G4 P0.5
G1 X0 F900
T{tool} M6
S8000 M3
G0 X10 Y10 Z170
G1 X40 F2000
S4000
M0
X10
M5 M9
M30
"""


# Nothing stops the spindle before its end: it runs down afterwards, in READY.
TURNING = """G21 G90 G54 G94 G17
G0 X0 Y0 Z160
{spindle}
G1 X30 F1500
Y20
G1 X0 F900
M30
"""


def text_of(tool: int, middle: str = "") -> str:
    return MILLED.format(tool=tool, middle=middle)


def assert_told(
    run: Timed, share: float, from_s: float = 0.0, to_s: float = 1e9, often_s: float = 0.5
) -> None:
    """At each of these times what was told is so near to what was then taken."""
    next_s, looked = from_s, 0
    for at_s, left in run.rows:
        if not next_s <= at_s <= run.took_s - 1.0:
            continue
        next_s, looked = at_s + often_s, looked + 1
        truly_s = run.took_s - at_s
        assert left.left_s == pytest.approx(truly_s, abs=max(share * truly_s, TICKS_S)), (at_s, truly_s)
    assert looked > 1


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> TimedRun:
    return TimedRun(tmp_path_factory.mktemp("plain"), machine("trunnion"))


@pytest.fixture(scope="module")
def shop(tmp_path_factory: pytest.TempPathFactory) -> TimedRun:
    return TimedRun(tmp_path_factory.mktemp("shop"), machine("shop"))


def test_a_start_is_told_its_time_before_it_and_on_the_way(plain: TimedRun) -> None:
    run = plain.run(PLAIN)
    assert run.loaded.left_s == pytest.approx(run.took_s, rel=START)
    assert_told(run, START)
    assert run.loaded.next_tool_s is None and run.loaded.next_stop_s is None


def test_a_start_inside_counts_the_way_there(plain: TimedRun) -> None:
    run = plain.run(PLAIN, Spot(20, 0.5))
    assert run.loaded.left_s == pytest.approx(run.took_s, rel=START)
    assert_told(run, START)


@pytest.mark.parametrize("share", [0.4, 1.2])
def test_an_override_is_told_as_it_will_be(share: float, plain: TimedRun) -> None:
    run = plain.run(PLAIN, overrides={2.0: share})
    assert_told(run, OVERRIDE, 2.0 + SOON_S)


@pytest.mark.parametrize("share", [0.5, 1.2])
def test_until_the_plan_has_heard_of_an_override_no_time_is_told(share: float, plain: TimedRun) -> None:
    """Neither the old one for a moment, nor one that is scaled though limits do not scale."""
    clicked_s = 2.0
    run = plain.run(PLAIN, overrides={clicked_s: share})
    after = [(run.took_s - at_s, left) for at_s, left in run.rows if clicked_s < at_s < run.took_s - 1.0]
    known = [(truly_s, left.left_s) for truly_s, left in after if left.left_s is not None]
    for truly_s, left_s in known:
        assert left_s == pytest.approx(truly_s, abs=max(START * truly_s, TICKS_S))
    assert run.took_s - clicked_s - known[0][0] < SOON_S
    assert len(after) - len(known) < SOON_S / SLOW_S, "once it is known it stays so"


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_overrides_at_random_moments_are_told_as_they_will_be(seed: int, plain: TimedRun) -> None:
    print(f"seed {seed}")
    random_ = random.Random(seed)
    first_s = random_.uniform(0.5, 4.0)
    last_s = first_s + random_.uniform(0.5, 4.0)
    shares = {first_s: random_.choice((0.25, 0.5, 1.2)), last_s: random_.choice((0.3, 0.8, 1.0, 1.1))}
    assert_told(plain.run(PLAIN, overrides=shares), OVERRIDE, last_s + SOON_S)


def test_spindle_and_changer_are_counted_on_the_way_to_tool_and_stop(shop: TimedRun) -> None:
    run = shop.run(text_of(2), waits_s=(1.0,))
    stopped_s = 1.0  # nobody knows how long the operator takes
    assert run.loaded.left_s == pytest.approx(run.took_s - stopped_s, rel=SHOP)
    (change_s,), (stop_s,) = run.changes_s, run.stops_s
    assert run.loaded.next_tool_s == pytest.approx(change_s, rel=SHOP)
    assert run.loaded.next_stop_s == pytest.approx(stop_s, rel=SHOP)
    for at_s, left in run.rows:
        if SOON_S < at_s < change_s - 0.5:
            assert left.next_tool_s == pytest.approx(change_s - at_s, abs=SHOP * run.took_s)
        elif change_s < at_s:
            assert left.next_tool_s is None
        if stop_s + 0.2 < at_s:
            assert left.next_stop_s is None
        told_s = left.left_s + (stopped_s if at_s < stop_s else 0.0)
        if not stop_s <= at_s <= stop_s + stopped_s:
            assert told_s == pytest.approx(run.took_s - at_s, abs=SHOP * run.took_s)


def test_m1_is_a_stop_where_it_is_switched_on_alone(shop: TimedRun) -> None:
    tool = shop.tool_store.spindle or 1 if shop.tool_store is not None else 1
    text = text_of(tool, "M1")
    off, on = shop.run(text), shop.run(text, optional=True)
    assert len(off.stops_s) == 1 and len(on.stops_s) == 2
    told = [next(left for at_s, left in run.rows if at_s > SOON_S).next_stop_s for run in (off, on)]
    assert told[0] == pytest.approx(off.stops_s[0] - SOON_S, abs=0.3)
    assert told[1] == pytest.approx(on.stops_s[0] - SOON_S, abs=0.3)


@pytest.mark.parametrize("before", ["S12000 M3", "S9000 M4"])
def test_a_start_waits_for_the_spindle_that_runs_down_from_the_last_program(
    before: str, shop: TimedRun
) -> None:
    shop.run(TURNING.format(spindle=before))
    turns = shop.snapshot().spindle_actual_rev_min
    assert abs(turns) > 5000.0 and (turns > 0.0) is before.endswith("M3")
    run = shop.run(TURNING.format(spindle="S6000 M3"))
    assert run.loaded.left_s == pytest.approx(run.took_s, rel=SHOP)
    assert_told(run, SHOP, often_s=0.05)


def test_a_start_waits_for_the_spindle_that_was_switched_on_by_hand(shop: TimedRun) -> None:
    shop.stepped.request(Request.SPINDLE, -9000.0)
    shop.stepped.go(round(1.5 / SLOW_S))
    assert shop.snapshot().spindle_actual_rev_min == pytest.approx(-9000.0, rel=0.05)
    run = shop.run(TURNING.format(spindle="S6000 M3"))
    assert run.loaded.left_s == pytest.approx(run.took_s, rel=SHOP)
    assert_told(run, SHOP, often_s=0.05)


@pytest.mark.parametrize(("keeps", "takes_s"), [(False, 0.75), (True, 0.0)])
def test_of_a_spindle_that_stays_on_nothing_is_waited_for(
    keeps: bool, takes_s: float, shop: TimedRun
) -> None:
    turns = shop.snapshot()._replace(spindle_rev_min=-9000.0, spindle_actual_rev_min=-8990.0)
    kept = replace(shop.machine, start_state="keep" if keeps else shop.machine.start_state)
    job = Job(Program(b"M30\n", "part.ngc", kept), "")
    assert settles_s(job, turns) == pytest.approx(takes_s, abs=0.01)
    by_hand = replace(job.program, begin=power_on()) if keeps else job.program
    assert settles_s(Job(by_hand, ""), turns) == pytest.approx(takes_s, abs=0.01)


# ---- what is told of a timetable


def left_of(events: list[Event]) -> TimeLeft:
    made = TimeLeft()
    made.stands(Timetable(0.0, 10.0, tuple(events)))
    return made


def test_what_is_waited_for_is_counted_to_what_comes_behind_it() -> None:
    events = [
        Event(2.0, 3, Wait("spindle 0 to 100", 1.5)),
        Event(4.0, 5, Wait("journal", 0.25, CHANGE)),
        Event(4.0, 5, Wait("Grip", 0.5)),
        Event(6.0, 8, Wait(stops=OPTIONAL)),
        Event(7.0, 9, Wait(stops=STOP)),
    ]
    left = left_of(events).before_start(0.0)
    assert left == (10.0 + 2.25, 5.5, 7.0 + 2.25)


def test_before_a_start_the_override_of_the_moment_counts() -> None:
    made = TimeLeft()
    made.check(20.0, (), (Event(5.0, 3, Wait("Grip", 0.5)),), None)
    assert made.before_start(0.0).left_s == 20.5
    assert made.before_start(0.0, 0.5).left_s == 40.5
    assert made.before_start(0.0, 0.0).left_s == 20.5, "at no feed at all nobody knows"


def test_a_change_by_hand_is_a_tool_and_a_stop() -> None:
    left = left_of([Event(3.0, 3, Wait(BY_HAND, 60.0, BY_HAND))]).before_start(0.0)
    assert left == (70.0, 3.0, 3.0)


def test_what_a_wait_took_last_is_expected_of_the_next_of_its_name(tmp_path: Path) -> None:
    """Of the service after its next start, and of who only reads."""
    durations, event = of_service(ServiceStore(tmp_path)), Event(2.0, 3, Wait("Grip", 0.5))
    assert durations.of(event) == of_state(tmp_path / "none").of(event) == 0.5
    for seconds in (0.7, 9.0, 0.8):
        durations.learn("Grip", seconds)
    durations.save()
    for again in (of_service(ServiceStore(tmp_path)), of_state(tmp_path)):
        assert again.of(event) == 0.8
        assert again.of(event._replace(wait=event.wait._replace(name="Swing"))) == 0.5


def test_durations_that_are_damaged_are_not_expected(tmp_path: Path) -> None:
    with contextlib.closing(ServiceStore(tmp_path)) as store:
        store.put("durations", {"Grip": [0.8]})
        event = Event(0.0, 1, Wait("Grip", 0.5))
        assert of_state(tmp_path).of(event) == 0.8
        with contextlib.closing(sqlite3.connect(store.file)) as sql:  # which keeps no sums, as a bad bit
            sql.execute("UPDATE documents SET value = replace(value, '0.8', '0.9')")
            sql.commit()
        assert of_state(tmp_path).of(event) == 0.5


@pytest.mark.slow
def test_of_a_machine_that_is_slower_than_its_file_a_change_is_told_right_that_it_has_done_before(
    tmp_path: Path,
) -> None:
    """The drawbar, say: the steps of the changer take three times what is expected of them."""
    shipped = machine("shop")
    changer = shipped.changer
    assert changer is not None
    run = TimedRun(tmp_path, shipped)
    node = next(iter(run.stepped.rig.io.values()))
    assert shipped.io is not None
    clamps = {shipped.io.input(axis.clamp.input) for axis in shipped.axes if axis.clamp}  # they have no time
    for output, switch, delay_s, inverted in list(node._wires):
        if switch in clamps:
            continue
        node.unwire(switch)
        node.wire(output, switch, delay_s if delay_s > 1.0 else 3.0 * delay_s, inverted)
    first, *_, second = [run.run(text_of(tool)) for tool in (2, 3, 2, 3)]
    assert first.loaded.left_s is not None and second.loaded.left_s is not None
    assert abs(first.loaded.left_s / first.took_s - 1.0) > SHOP
    assert second.loaded.left_s == pytest.approx(second.took_s, rel=SHOP)
