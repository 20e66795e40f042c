"""Holds, stops, overrides, a planner that dies: the tool stays on the path and the joints in their limits."""

from __future__ import annotations

import random
from functools import cache

import numpy as np
import pytest
from support.machines.stepped_runs import Cut, cut, largest, off_the_path, off_the_plan, program, shipped

from controller.ipc.handoff import Snapshot
from controller.plan.path import path
from controller.plan.planner import AHEAD_S
from controller.program import blocks
from controller.runtime.events import Event
from controller.runtime.stepped import Run, SteppedMachine
from controller.state.modes import Fault, Mode, Request
from controller.verify import trace

VELOCITY, ACCELERATION, JERK = 1.0005, 1.002, 1.02
STAND = 300  # ticks of a hold; every hold here is at rest by then
CONE = "1000. of the cone"
PERIOD_S = 0.004


def text(feed: str = "1000.") -> str:
    """Example 2 at a feed in mm/min, or the cone."""
    return program("example1_ready.ngc", "1000.") if feed == CONE else program("example2_ready.ngc", feed)


@cache
def undisturbed(feed: str = "1000.") -> Cut:
    return cut(text(feed), shipped(period_s=PERIOD_S))


def cutting_span(feed: str = "1000.") -> tuple[int, int]:
    rows = np.flatnonzero(undisturbed(feed).trace.cutting)
    return int(rows[0]), int(rows[-1])


def assert_in_limits(done: Cut, label: object) -> None:
    first, second, third = largest(done.joints, done.machine)
    print(f"\n{label}: velocity {first:.4f}, acceleration {second:.4f}, jerk {third:.4f}")
    assert first <= VELOCITY and second <= ACCELERATION and third <= JERK, label


def assert_on_the_path(done: Cut) -> None:
    """Every commanded pose is one of the path, and the path is gone along forwards only."""
    far_mm, turned_deg = off_the_path(done)
    assert far_mm < 1e-6 and turned_deg < 1e-6
    moving = done.column("motion_id") >= 0
    ids, s = done.column("motion_id")[moving], done.column("s")[moving]
    step, same = np.diff(ids), np.diff(ids) == 0
    assert (step >= 0).all() and (np.diff(s)[same] >= -1e-9).all()


def assert_all_is_cut(done: Cut, feed: str = "1000.") -> None:
    """The program is gone through to its end, every surface from end to end."""
    plain = undisturbed(feed)
    assert done.run.result == "completed", done.run.fault_text
    assert np.abs(done.joints[-1] - plain.joints[-1]).max() < 1e-9
    for motion in {int(m) for m in plain.column("motion_id")[plain.trace.cutting]}:
        s = done.column("s")[done.column("motion_id") == motion]
        step = np.diff(s).max()
        length = done.segments[motion].motion.end
        assert s[0] < 2.0 * step and s[-1] > length - 2.0 * step, motion


def left_the_plan(done: Cut, feed: str, tick: int) -> bool:
    """Within two ticks after ``tick`` (where the run was still undisturbed) the speed is another."""
    mine, plain = done.column("feed_mm_s"), undisturbed(feed).column("feed_mm_s")
    return bool(abs(mine[tick + 1] - plain[tick + 1]) > 0.0)


def holds(ticks: list[int]) -> list[Event]:
    """Hold at each of ``ticks`` of the undisturbed run (nearly: a hold shifts what follows), then go on."""
    events, shift = [], 0
    for tick in ticks:
        events += [Event(tick + shift, Request.HOLD), Event(tick + shift + STAND, Request.RESUME)]
        shift += STAND + 50
    return events


def run_with(events: list[Event], label: str, feed: str = "1000.") -> Cut:
    """A run that keeps the limits and the path and cuts all of the part in spite of ``events``."""
    done = cut(text(feed), shipped(period_s=PERIOD_S), events)
    assert_all_is_cut(done, feed)
    assert_on_the_path(done)
    assert_in_limits(done, f"{label} at {feed}")
    return done


def hold_run(seed: int, count: int, feed: str = "1000.") -> None:
    first, last = cutting_span(feed)
    rng = random.Random(seed)
    span = (first, last) if seed % 2 else (10, len(undisturbed(feed).rows) - 60)
    events = holds(sorted(rng.sample(range(*span), count)))
    done = run_with(events, f"{count} holds, seed {seed}", feed)
    # The last of a rapid's or a cut's own braking is no plan to be left.
    braking = done.column("feed_mm_s")[events[0].tick - 1] < 0.3 * undisturbed(feed).column("feed_mm_s").max()
    assert braking or left_the_plan(done, feed, events[0].tick)
    for resume in (event for event in events[1::2] if event.tick < len(done.joints)):
        joints = done.joints[resume.tick - 3 : resume.tick]
        assert (joints == joints[0]).all(), resume.tick


def test_holds_at_random_ticks_of_the_cut_leave_the_tool_on_the_path() -> None:
    hold_run(1, 3)


@pytest.mark.slow
@pytest.mark.parametrize("feed", ["100.", "1000.", "3000.", CONE])
@pytest.mark.parametrize("seed", [2])
def test_holds_at_any_tick_of_the_program_leave_the_tool_on_the_path(seed: int, feed: str) -> None:
    hold_run(seed, 8, feed)


@pytest.mark.slow
@pytest.mark.parametrize("feed", ["1000.", "3000."])
def test_a_hold_and_a_resume_in_quick_succession_do_no_harm(feed: str) -> None:
    rng = random.Random(5)
    first, last = cutting_span(feed)
    ticks = sorted(rng.sample(range(first, last), 30))
    events = [Event(t + i * 5, Request.HOLD if i % 2 == 0 else Request.RESUME) for i, t in enumerate(ticks)]
    run_with(events, "30 requests in quick succession", feed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_a_stop_ends_in_standstill_on_the_path_and_the_machine_is_ready_again(seed: int) -> None:
    first, last = cutting_span()
    tick = random.Random(seed).randrange(first, last)
    done = cut(text(), shipped(period_s=PERIOD_S), [Event(tick, Request.STOP)])
    assert done.run.result == "stopped" and done.stepped.cycle.modes.mode is Mode.READY
    assert off_the_plan(done, np.flatnonzero(done.column("mode") != Mode.READY)) < 1e-6
    assert_in_limits(done, f"stop at {tick}")
    assert left_the_plan(done, "1000.", tick)
    # From here another program runs.
    again = cut("G0 Z140.\nM30\n", stepped=done.stepped)
    assert again.run.result == "completed", again.run.fault_text
    assert_in_limits(again, "the program after the stop")


# --- overrides


def reached(done: Cut, from_tick: int, to_tick: int) -> float:
    """Largest feed while cutting between two ticks, mm/min."""
    return float((done.trace.feed_mm_s * done.trace.cutting)[from_tick:to_tick].max() * 60.0)


@pytest.mark.parametrize("share", [0.4, 1.6])
def test_an_override_shows_in_the_motion_soon_and_is_reached_within_the_cut(share: float) -> None:
    first, _ = cutting_span()
    tick = first + 300
    done = run_with([Event(tick, Request.OVERRIDE, share)], f"override {share}")
    soon = tick + round(0.15 / done.machine.period_s)
    mine, plain = done.trace.feed_mm_s, undisturbed().trace.feed_mm_s
    assert (mine[soon] - plain[soon]) * (share - 1.0) > 0.0
    settled = soon + 150
    assert mine[settled] * 60.0 == pytest.approx(1000.0 * share, rel=1e-3)


def override_steps(rng: random.Random, ticks: int, count: int, shares: list[float]) -> list[Event]:
    events = [
        Event(tick, Request.OVERRIDE, rng.choice(shares)) for tick in sorted(rng.sample(range(ticks), count))
    ]
    return [*events, Event(events[-1].tick + 400, Request.OVERRIDE, 1.0)]


@pytest.mark.slow
@pytest.mark.parametrize("feed", ["1000.", "3000.", CONE])
@pytest.mark.parametrize("seed", [0])
def test_override_steps_at_any_tick_keep_the_path_and_the_limits(seed: int, feed: str) -> None:
    rng = random.Random(seed)
    shares = [0.1, 0.3, 0.5, 0.8, 1.0, 1.2, 1.5, 2.0]
    events = override_steps(rng, len(undisturbed(feed).rows), 12, shares)
    run_with(events, f"override steps, seed {seed}", feed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_overrides_of_nothing_stand_and_go_on(seed: int) -> None:
    rng = random.Random(seed)
    events = override_steps(rng, len(undisturbed().rows), 8, [0.0, 0.0, 1.0, 2.0])
    run_with(events, f"override 0 and back, seed {seed}")


@pytest.mark.slow
@pytest.mark.parametrize("begin", [0.0, 0.3, 0.6, 0.9])
def test_quick_changes_of_the_override_are_all_survived(begin: float) -> None:
    """From a share of the cut on, one every 9 ticks."""
    rng = random.Random(f"{begin}")
    first, last = cutting_span()
    at = first + round(begin * (last - first))
    events = [Event(t, Request.OVERRIDE, rng.uniform(0.1, 2.0)) for t in range(at, last, 9)[:25]]
    run_with([*events, Event(events[-1].tick + 9, Request.OVERRIDE, 1.0)], f"quick overrides from {begin} on")


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.0, 0.25, 1.0, 2.0])
def test_a_rapid_override_acts_on_rapids_only(share: float) -> None:
    first, last = cutting_span()
    events = [Event(60, Request.RAPID_OVERRIDE, share), Event(1500, Request.RAPID_OVERRIDE, 1.0)]
    done = run_with(events, f"rapid override {share}")
    assert int(done.trace.cutting.sum()) == pytest.approx(last - first + 1, abs=2)
    if share == 0.0:
        assert (np.diff(done.joints[1000:1500], axis=0) == 0.0).all()


@pytest.mark.slow
def test_an_override_raised_again_is_followed_within_the_cut() -> None:
    """50 % before the start, 100 % in the middle of the cut: the feed comes up while cutting."""
    first, _ = cutting_span()
    events = [Event(0, Request.OVERRIDE, 0.5), Event(first + 1200, Request.OVERRIDE, 1.0)]
    done = run_with(events, "50 %, then 100 %")
    assert reached(done, 0, first + 1200) == pytest.approx(500.0, rel=1e-3)
    assert reached(done, 0, len(done.rows)) == pytest.approx(1000.0, rel=1e-3)


@pytest.mark.slow
def test_an_override_of_nothing_before_the_start_waits_and_does_not_fail() -> None:
    run_with(
        [Event(0, Request.OVERRIDE, 0.0), Event(2500, Request.OVERRIDE, 1.0)], "override 0 before the start"
    )


# --- single block and optional stop


def stands_between(done: Cut) -> list[int]:
    """Ticks at which HOLD begins."""
    held = done.column("mode") == Mode.HOLD
    return [int(i) + 1 for i in np.flatnonzero(held[1:] & ~held[:-1])]


BLOCKS = "G21 G90 G54 G61\nG0 X10. Y0.\nG1 F2000. X40.\nX70. Y0.\nX100. Y0.\nM1\nX100. Y30.\nM30\n"


def held_at(done: Cut) -> list[int]:
    """X of the program (mm) where HOLD begins; the program ends at 100."""
    x = done.joints[:, 0] - done.joints[-1, 0] + 100.0
    return [round(float(x[t])) for t in stands_between(done)]


def blocks_run(events: list[Event]) -> Cut:
    done = cut(BLOCKS, shipped(period_s=PERIOD_S), events)
    assert done.run.result == "completed", done.run.fault_text
    assert_on_the_path(done)
    assert_in_limits(done, "single block")
    return done


def test_single_block_stops_after_each_block_of_a_course_and_switched_off_runs_through() -> None:
    plain = blocks_run([])
    assert stands_between(plain) == []
    done = blocks_run([Event(0, Request.SINGLE_BLOCK, 1.0)])
    assert held_at(done) == [10, 40, 70, 100, 100]
    x = plain.joints[:, 0] - plain.joints[-1, 0] + 100.0
    middle = int(np.flatnonzero((x[:-1] < 50.0) & (x[1:] >= 50.0))[0])
    # Switched on in the middle of a block of a running course: it stops at that block's end, or the next.
    done = blocks_run(
        [Event(middle, Request.SINGLE_BLOCK, 1.0), Event(middle + 5000, Request.SINGLE_BLOCK, 0.0)]
    )
    assert held_at(done)[0] in (70, 100)


@pytest.mark.parametrize("wanted", [False, True])
def test_an_optional_stop_holds_only_where_it_is_wanted(wanted: bool) -> None:
    done = blocks_run([Event(20, Request.OPTIONAL_STOP, float(wanted))])
    assert held_at(done) == [100] * wanted


LINES = "G0 X0. Y0.\nG1 F4000. X30.\nM1\nX60.\nX60.\nM1\nX100.\nM1\nX140.\nM30\n"  # one moves nothing
MARKED = {"exact": "G21 G90 G54 G61\n" + LINES, "a row": "G21 G90 G54 G64 P0.05\n" + LINES}
MARKED["a loop"] = (
    "G21 G90 G54 G64 P0.05\n#1=0\nG0 X0. Y0.\nF4000.\nG91\no1 while [#1 LT 3]\n"
    "#1=[#1+1]\nG1 X30.\nM1\nG1 X5.\no1 endwhile\nG1 X35.\nM30\n"
)
AT = {
    "exact": [30, 60, 100],
    "a row": [30, 60, 100],
    "a loop": [30, 65, 100],
}  # X of the places with an M1; all end at 140


def switched_at(done: Cut) -> list[int]:
    x = done.joints[:, 0] - done.joints[-1, 0] + 140.0
    return [round(float(x[t])) for t in stands_between(done)]


@cache
def marked(path: str, *events: Event, without: bool = False) -> Cut:
    text = MARKED[path].replace("M1\n", "") if without else MARKED[path]
    done = cut(text, shipped(period_s=PERIOD_S), events=list(events))
    assert done.run.result == "completed", done.run.fault_text
    assert_in_limits(done, (path, events))
    return done


@pytest.mark.parametrize("path", MARKED)
def test_an_optional_stop_between_lines_costs_nothing_where_it_is_switched_off(path: str) -> None:
    assert np.array_equal(marked(path).joints, marked(path, without=True).joints)


@pytest.mark.parametrize("path", MARKED)
@pytest.mark.parametrize("passed", [0, 2])
@pytest.mark.parametrize("on", [True, False])
def test_an_optional_stop_counts_from_where_it_is_switched(path: str, passed: int, on: bool) -> None:
    """Switched 3 mm after the last one, or at the begin."""
    plain = marked(path) if on else marked(path, Event(1, Request.OPTIONAL_STOP, 1.0))
    x = plain.joints[:, 0] - plain.joints[-1, 0] + 140.0
    tick = int(np.argmax(x > AT[path][passed - 1] + 3.0)) if passed else 1
    events = [Event(tick, Request.OPTIONAL_STOP, float(on))]
    if not on:
        events.insert(0, Event(1, Request.OPTIONAL_STOP, 1.0))
    assert switched_at(marked(path, *events)) == (AT[path][passed:] if on else AT[path][:passed])


# --- a planner that dies


class Dying(SteppedMachine):
    """The planner says and does nothing from tick ``dies_at`` of the program on."""

    dies_at = 1 << 30
    _calls_from = 0

    def _plan(self) -> None:
        if self.cycle.tick - self._calls_from < self.dies_at:
            super()._plan()


def die_at(tick: int) -> tuple[Cut, Run]:
    stepped = Dying(shipped(period_s=PERIOD_S))
    stepped.come_up()
    stepped._calls_from, stepped.dies_at = stepped.cycle.tick, tick
    known = blocks.read(text().encode(), stepped.machine, "part.ngc")
    run = stepped.run(path.trace(known, stepped.machine, stepped.kinematics, stepped.joints))
    made = trace.from_rows(run.rows, stepped.machine, stepped.kinematics, stepped.planner.segments)
    return Cut(stepped, run, made, run.rows[len(run.rows) - len(made.time_s) :]), run


def assert_stands_on_the_path(tick: int) -> None:
    done, run = die_at(tick)
    assert run.result == "fault" and run.fault is Fault.PLANNER_GONE, (tick, run)
    assert off_the_plan(done) < 1e-6, tick
    assert_in_limits(done, f"planner dead at tick {tick}")
    assert (done.joints[-1] == done.joints[-2]).all() and (done.joints[-1] == done.joints[-3]).all()
    fault = int(np.flatnonzero(done.column("fault"))[0])
    assert tick <= fault and (done.joints[fault] == done.joints[fault - 2]).all(), "at the queue's end"
    snapshot = done.stepped.board.read()
    assert isinstance(snapshot, Snapshot) and snapshot.at_rest and snapshot.mode is Mode.FAULT


def test_a_silent_planner_ends_in_standstill_on_the_path_and_is_named() -> None:
    first, last = cutting_span()
    assert_stands_on_the_path((first + last) // 2)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_a_planner_silent_from_any_tick_on_ends_in_standstill_on_the_path(seed: int) -> None:
    first, last = cutting_span()
    planned = round((AHEAD_S + 0.5) / PERIOD_S)  # it must not have sent the program's end
    assert_stands_on_the_path(random.Random(seed).randrange(first, last - planned))
