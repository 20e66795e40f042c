"""Holds, stops, overrides, a planner that dies: the tool stays on the path and the joints in their limits."""

from __future__ import annotations

import random
from functools import cache

import numpy as np
import pytest
from cutting import Cut, cut, largest, off_the_plan, program, shares, shipped

from controller.handoff import Snapshot
from controller.plan import blocks, path
from controller.session.events import Event
from controller.session.stepped import Run, SteppedMachine
from controller.state import Fault, Mode, Request
from controller.verify import trace

VELOCITY, ACCELERATION = 1.0005, 1.002
STAND = 300  # ticks of a hold; every hold here is at rest by then


@cache
def undisturbed(feed: str) -> Cut:
    return cut(program("example2_ready.ngc", feed))


def text() -> str:
    return program("example2_ready.ngc", "1000.")


def cutting_span(feed: str = "1000.") -> tuple[int, int]:
    rows = np.flatnonzero(undisturbed(feed).trace.cutting)
    return int(rows[0]), int(rows[-1])


def assert_in_limits(done: Cut, label: object) -> None:
    """Velocity and acceleration hold; the jerk that came is printed."""
    first, second, third = largest(done.joints, done.machine)
    cutting = done.trace.cutting
    in_cut = float(shares(done.joints, done.machine)[2][cutting[3:]].max()) if cutting[3:].any() else 0.0
    jerk = f"jerk {third:.3f}, in the cut {in_cut:.3f}"
    print(f"\n{label}: velocity {first:.4f}, acceleration {second:.4f}, {jerk}")
    assert first <= VELOCITY and second <= ACCELERATION, label


def assert_on_the_path(done: Cut, feed: str = "1000.") -> None:
    """The commanded tip on its stretch, and in the cut on the tip path of the undisturbed run."""
    assert off_the_plan(done) < 1e-6
    here, there = done.trace, undisturbed(feed).trace
    for line in np.unique(here.line[here.cutting]):
        mine, other = here.cutting & (here.line == line), there.cutting & (there.line == line)
        u = here.u[mine]
        inside = (u >= there.u[other][0]) & (u <= there.u[other][-1])
        # The surface's pose at the same u must be the same one; between ticks of the other run by a cubic.
        tip = _interpolated(there.u[other], there.tool_tip[other], u[inside])
        assert np.linalg.norm(tip - here.tool_tip[mine][inside], axis=1).max() < 1e-4


def _interpolated(u: np.ndarray, tips: np.ndarray, at: np.ndarray) -> np.ndarray:
    return np.stack([np.interp(at, u, tips[:, i]) for i in range(3)], axis=1)


def with_holds(ticks: list[int]) -> list[Event]:
    """Hold at each of ``ticks`` of the undisturbed run (nearly: a hold shifts what follows), then go on."""
    events, shift = [], 0
    for tick in ticks:
        events += [Event(tick + shift, Request.HOLD), Event(tick + shift + STAND, Request.RESUME)]
        shift += STAND + 50
    return events


def assert_held(done: Cut, events: list[Event]) -> None:
    """Slower within two ticks of each hold, and standing before it is resumed."""
    rate = done.column("rate")
    for hold, resume in zip(events[::2], events[1::2], strict=True):
        if rate[hold.tick - 1] > 0.0:
            assert rate[hold.tick + 1] < rate[hold.tick - 1], hold.tick
        joints = done.joints[resume.tick - 3 : resume.tick]
        assert (joints == joints[0]).all(), hold.tick


def hold_run(seed: int, count: int) -> None:
    first, last = cutting_span()
    rng = random.Random(seed)
    span = (first, last) if seed % 2 else (10, len(undisturbed("1000.").rows) - 60)
    events = with_holds(sorted(rng.sample(range(*span), count)))
    done = cut(text(), events=events)
    assert done.run.result == "completed", (seed, done.run.fault_text)
    assert_held(done, events)
    assert_on_the_path(done)
    assert_in_limits(done, f"{count} holds, seed {seed}")


def test_holds_at_random_ticks_of_the_cut_leave_the_tool_on_the_path() -> None:
    hold_run(1, 4)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2, 8))
def test_holds_at_any_tick_of_the_program_leave_the_tool_on_the_path(seed: int) -> None:
    hold_run(seed, 8)


@pytest.mark.slow
def test_a_hold_and_a_resume_in_quick_succession_do_no_harm() -> None:
    rng = random.Random(5)
    first, last = cutting_span()
    ticks = sorted(rng.sample(range(first, last), 60))
    events = [Event(t + i * 5, Request.HOLD if i % 2 == 0 else Request.RESUME) for i, t in enumerate(ticks)]
    done = cut(text(), events=events)
    assert done.run.result == "completed", done.run.fault_text
    assert off_the_plan(done) < 1e-6
    assert_in_limits(done, "60 requests in quick succession")


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_a_stop_ends_in_standstill_on_the_path_and_the_machine_is_ready_again(seed: int) -> None:
    first, last = cutting_span()
    tick = random.Random(seed).randrange(first, last)
    done = cut(text(), events=[Event(tick, Request.STOP)])
    assert done.run.result == "stopped" and done.stepped.cycle.modes.mode is Mode.READY
    assert off_the_plan(done, np.flatnonzero(done.column("mode") != Mode.READY)) < 1e-6
    assert_in_limits(done, f"stop at {tick}")
    # From here another program runs.
    again = cut("G0 Z140.\nM30\n", stepped=done.stepped)
    assert again.run.result == "completed", again.run.fault_text
    assert_in_limits(again, "the program after the stop")


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_override_steps_between_0_and_200_percent_keep_the_path_and_the_limits(seed: int) -> None:
    rng = random.Random(seed)
    first, last = cutting_span()
    steps = [0.0, 2.0, 0.5, 1.0, 0.1, 1.5, *(rng.uniform(0.0, 2.0) for _ in range(6)), 1.0]
    places = sorted(rng.sample(range(first, last), len(steps) - 1))
    events, shift = [], 0
    for tick, share in zip([*places, last + 1], steps, strict=True):
        events.append(Event(tick + shift, Request.OVERRIDE, share))
        shift += 60
    done = cut(text(), events=events)
    assert done.run.result == "completed", (seed, done.run.fault_text)
    assert_on_the_path(done)
    assert_in_limits(done, f"override steps, seed {seed}")
    rate = done.column("rate")
    for event in events:
        k = event.tick
        if k + 1 < len(rate) and rate[k - 2] == rate[k - 1] and event.value < 0.95 * rate[k - 1]:
            assert rate[k + 1] < rate[k - 1], k  # it leaves the plan within two ticks


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.0, 0.25, 1.0, 2.0])
def test_a_rapid_override_acts_on_rapids_only(share: float) -> None:
    first, last = cutting_span()
    events = [Event(60, Request.RAPID_OVERRIDE, share), Event(1500, Request.RAPID_OVERRIDE, 1.0)]
    done = cut(text(), events=events)
    assert done.run.result == "completed", done.run.fault_text
    assert off_the_plan(done) < 1e-6
    assert_in_limits(done, f"rapid override {share}")
    cutting = done.trace.cutting
    assert int(cutting.sum()) == pytest.approx(last - first + 1, abs=2)
    assert (done.column("rate")[np.flatnonzero(cutting)[200:]] == 1.0).all()
    if share == 0.0:
        assert (np.diff(done.joints[1000:1500], axis=0) == 0.0).all()


@pytest.mark.slow
def test_an_override_raised_again_is_followed_within_the_cut() -> None:
    """50 % before the start, 100 % in the middle of the cut: the feed comes up while cutting."""
    first, _ = cutting_span()
    events = [Event(0, Request.OVERRIDE, 0.5), Event(first + 1200, Request.OVERRIDE, 1.0)]
    done = cut(text(), events=events)
    feed = done.trace.feed_mm_s[done.trace.cutting] * 60.0
    assert feed[300] == pytest.approx(500.0, rel=0.01)
    assert feed.max() == pytest.approx(1000.0, rel=0.01)


@pytest.mark.slow
def test_an_override_of_nothing_before_the_start_waits_and_does_not_fail() -> None:
    events = [Event(0, Request.OVERRIDE, 0.0), Event(2500, Request.OVERRIDE, 1.0)]
    done = cut(text(), events=events)
    assert done.run.result == "completed", done.run.fault_text
    assert_in_limits(done, "override 0 before the start")


# --- a planner that dies


class Dying(SteppedMachine):
    """The planner says and does nothing from tick ``dies_at`` of the program on."""

    dies_at = 1 << 30
    _calls_from = 0

    def _plan(self) -> None:
        if self.cycle.tick - self._calls_from < self.dies_at:
            super()._plan()


def die_at(tick: int) -> tuple[Cut, Run]:
    stepped = Dying(shipped())
    stepped.come_up()
    stepped._calls_from, stepped.dies_at = stepped.cycle.tick, tick
    known = blocks.read(text().encode(), stepped.machine, "part.ngc")
    run = stepped.run(path.trace(known, stepped.machine, stepped.kinematics, stepped.joints))
    made = trace.from_rows(run.rows, stepped.machine, stepped.kinematics, stepped.planner.stretches)
    return Cut(stepped, run, made, run.rows[len(run.rows) - len(made.time_s) :]), run


def assert_stands_on_the_path(tick: int) -> None:
    done, run = die_at(tick)
    assert run.result == "fault" and run.fault is Fault.PLANNER_GONE, (tick, run)
    assert off_the_plan(done) < 1e-6, tick
    assert_in_limits(done, f"planner dead at tick {tick}")
    assert (done.joints[-1] == done.joints[-2]).all() and (done.joints[-1] == done.joints[-3]).all()
    fault = int(np.flatnonzero(done.column("fault"))[0])
    assert tick <= fault <= tick + 16 + round(0.1 / done.machine.period_s) + 2
    snapshot = done.stepped.board.read()
    assert isinstance(snapshot, Snapshot) and snapshot.at_rest and snapshot.mode is Mode.FAULT


def test_a_silent_planner_ends_in_standstill_on_the_path_and_is_named() -> None:
    first, last = cutting_span()
    assert_stands_on_the_path((first + last) // 2)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_a_planner_silent_from_any_tick_on_ends_in_standstill_on_the_path(seed: int) -> None:
    first, last = cutting_span()
    assert_stands_on_the_path(random.Random(seed).randrange(first, last - 100))
