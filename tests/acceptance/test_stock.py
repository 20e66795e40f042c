"""A late tick is not felt by the motors: what the pump plays, against the same run in time.

Played is what goes out on the bus; a period's row is what its tick has computed. Judged by what was played.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import count

import numpy as np
import pytest
from support.machines.stepped_runs import SHIPPED, Cut, cut, largest, off_the_path, program, shipped

from controller.ipc.handoff import BRAKED, COLUMN, PLAYED, Jog, of_axes
from controller.runtime.events import Event
from controller.runtime.stepped import SteppedMachine
from controller.state.modes import Fault, Mode, Request
from controller.tick.stock import DELAY
from drives.pump.plan_memory import Phase
from drives.pump.stepped import SteppedPump

STOCK_S = 0.016
ROUNDED = 1.002  # of an acceleration: counts, and what the limits are held by in a healthy run
Lateness = Callable[[int], float]
QUICK = ("trunnion", "head_head")
SOME = [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in SHIPPED]
WITH_MARKS = """G21 G90 G54 G61 G94
T2 M6
S12000 M3
G0 X0 Y0 Z50
G1 X5 F6000
M8
G1 X10
M0
G1 Y5
G4 P0.05
G1 X0
M9
G1 X3
M5
G1 X7
M0
G1 Y0
M30
"""


def seeds(quick: int, count: int) -> list[object]:
    """The first of them in every run, the others among the slow ones."""
    return [n if n < quick else pytest.param(n, marks=pytest.mark.slow) for n in range(count)]


class Listening(SteppedMachine):
    """Notes what the pump plays in each period."""

    def __init__(self, *given: object, **how: object) -> None:
        self.played: dict[int, tuple[Phase, tuple[int, ...]]] = {}
        self.refused = 0  # steps that were not sent, since their plan came too late
        super().__init__(*given, **how)  # type: ignore[arg-type]

    def be_slow(self, slow: Lateness) -> None:
        """The n-th tick from here on takes ``slow(n)`` seconds from its look at the pump to its plan."""
        stock, clock, ticks = self.cycle.stock, self.clock, count()
        assert stock is not None
        look, publish = stock.look, stock.publish

        def looked() -> Sequence[int]:
            found = look()
            self.refused += stock.refused
            return found

        def published(anew: bool) -> None:
            clock._now_s += slow(next(ticks))
            for step in clock.steppers:
                step(clock._now_s)
            publish(anew)

        stock.look, stock.publish = looked, published  # type: ignore[method-assign]

    def _pump(self, plans: object) -> SteppedPump:
        made = super()._pump(plans)  # type: ignore[arg-type]
        player, send = made._player, made._player.send

        def noted(due_ns: int, late_ns: int) -> None:
            self.played[player.period] = player.phase, tuple(player._counts)
            send(due_ns, late_ns)

        player.send = noted  # type: ignore[method-assign]
        return made


@dataclass(frozen=True, eq=False)
class Ran:
    """A run with what was played of it."""

    cut: Cut
    first: int  # period in which its first row went out

    @property
    def rows(self) -> np.ndarray:
        return self.cut.run.rows

    @property
    def setpoints(self) -> np.ndarray:
        """As the ticks computed them, a row a period (N, axes)."""
        return self.rows[:, of_axes("setpoint", len(self.cut.machine.axes))].astype(np.int64)

    def played(self) -> np.ndarray:
        """What went out for these rows, as far as it did, (N, axes) counts."""
        listening = self.cut.stepped
        assert isinstance(listening, Listening)
        found = (listening.played.get(self.first + n) for n in range(len(self.rows)))
        return np.array([one[1] for one in found if one is not None])

    def phases(self) -> set[Phase]:
        listening = self.cut.stepped
        assert isinstance(listening, Listening)
        return {phase for period, (phase, _) in listening.played.items() if period >= self.first}


def ran(
    name: str,
    text: str,
    lateness: Lateness | None = None,
    events: Sequence[Event] = (),
    slow: Lateness | None = None,
) -> Ran:
    """``lateness`` counts the ticks of the run, from 0; ``slow``: see ``Listening.be_slow``."""
    begin: list[int] = []
    stepped = Listening(
        shipped(name, stock_s=STOCK_S),
        lateness=None if lateness is None else lambda n: lateness(n - begin[0]) if begin else 0.0,
    )
    stepped.come_up()
    begin.append(stepped.clock.waits)
    if slow is not None:
        stepped.be_slow(slow)
    done = cut(text, stepped=stepped, events=events)
    return Ran(done, int(done.run.rows[0, COLUMN["tick"]]) + DELAY)


@cache
def in_time(name: str, feed: str) -> Ran:
    return ran(name, program("example2_ready", feed))


def trains(seed: int, longest_s: float, share: float) -> Lateness:
    """Late by up to so much at random places, now and then several in a row."""
    rng = random.Random(seed)
    left = [0]

    def late(n: int) -> float:
        if not left[0] and rng.random() < share:
            left[0] = rng.choice((1, 1, 1, 2, 5))
        if not left[0]:
            return 0.0
        left[0] -= 1
        return rng.uniform(0.0, longest_s)

    return late


def holds_and_overrides(seed: int) -> list[Event]:
    """At random ticks, and all of it over in the end."""
    rng = random.Random(seed)
    ticks = sorted(rng.sample(range(20, 1200), 8))
    words = (Event(t, Request.HOLD if i % 2 == 0 else Request.RESUME) for i, t in enumerate(ticks))
    turns = (Event(t, Request.OVERRIDE, rng.choice((0.0, 0.4, 1.5))) for t in rng.sample(range(20, 1200), 3))
    back = Event(1300, Request.OVERRIDE, 1.0)
    return sorted([*words, *turns, back], key=lambda event: event.tick)


def assert_within_limits(ran: Ran) -> None:
    """What was played is no harder for any axis than the limits, a count of rounding apart."""
    machine = ran.cut.machine
    units = np.array([1.0 / axis.counts_per_unit for axis in machine.axes])
    velocity, acceleration, _ = largest(ran.played() * units, machine)
    T = machine.period_s
    count = max(
        4.0 * abs(unit) / (axis.limits.acceleration * T**2)
        for unit, axis in zip(units, machine.axes, strict=True)
    )
    assert velocity <= ROUNDED and acceleration <= ROUNDED + count


# ---- in time


@pytest.mark.parametrize("name", SOME)
def test_in_time_the_setpoints_are_those_of_a_tick_that_sends_by_itself(name: str) -> None:
    """And each goes out two periods after its tick."""
    with_pump = in_time(name, "12000.")
    by_itself = cut(program("example2_ready", "12000."), shipped(name, stock_s=0.0))
    alone = by_itself.run.rows[:, of_axes("setpoint", len(by_itself.machine.axes))].astype(np.int64)
    assert (with_pump.setpoints == alone).all()
    assert (with_pump.played() == with_pump.setpoints[: len(with_pump.played())]).all()


# ---- late, within the stock


@pytest.mark.parametrize("feed", [pytest.param("1000.", marks=pytest.mark.slow), "12000."])
@pytest.mark.parametrize("name", SOME)
def test_ticks_late_within_the_stock_are_not_felt(name: str, feed: str) -> None:
    late = ran(name, program("example2_ready", feed), trains(len(name), STOCK_S - 2.1e-3, 0.05))
    whole = in_time(name, feed)
    assert late.cut.run.result == "completed" and late.cut.run.fault is Fault.NONE
    assert np.array_equal(late.setpoints, whole.setpoints)
    assert (late.played() == whole.setpoints[: len(late.played())]).all()
    marks = late.rows[:, COLUMN["switches"]].astype(int)
    assert (marks & PLAYED).any() and not (marks & BRAKED).any()
    assert late.cut.stepped.cycle.sync.played >= np.count_nonzero(marks & PLAYED)


@pytest.mark.parametrize("seed", seeds(1, 6))
def test_holds_and_overrides_with_late_ticks_keep_the_path_and_the_limits(seed: int) -> None:
    """When they act depends on when the tick comes; how does not."""
    lateness = trains(seed, STOCK_S - 2.1e-3, 0.05)
    late = ran("trunnion", program("example2_ready", "6000."), lateness, holds_and_overrides(seed))
    assert late.cut.run.result == "completed", late.cut.run.fault_text
    assert_within_limits(late)
    assert off_the_path(late.cut)[0] < 1e-6
    assert (late.played() == late.setpoints[: len(late.played())]).all()


# ---- beyond the stock


@pytest.mark.parametrize("seed", seeds(1, 6))
def test_ticks_late_beyond_the_stock_brake_on_the_path_and_go_on_from_there(seed: int) -> None:
    late = ran("trunnion", program("example2_ready", "12000."), trains(seed, 0.1, 0.01))
    assert late.cut.run.result == "completed", late.cut.run.fault_text
    assert (late.rows[:, COLUMN["switches"]].astype(int) & BRAKED).any()
    assert Phase.BRAKING in late.phases() and late.cut.stepped.cycle.sync.braked > 0
    assert late.cut.stepped.cycle.modes.warning is Fault.TICK_LATE
    assert_within_limits(late)
    assert off_the_path(late.cut)[0] < 1e-6
    apart = np.abs(late.played() - late.setpoints[: len(late.played())])
    assert apart.max() <= 1, "the pump's stop is the path's own, rounded"
    assert (late.setpoints[-1] == in_time("trunnion", "12000.").setpoints[-1]).all()


def test_a_stock_that_is_used_up_is_a_fault_and_nothing_begins_by_itself() -> None:
    late = ran("trunnion", program("example2_ready", "6000."), lambda n: 0.5 if n == 1000 else 0.0)
    assert late.cut.run.result == "fault" and late.cut.run.fault is Fault.STOCK_USED_UP
    assert {Phase.BRAKING, Phase.HOLDING, Phase.SILENT} <= late.phases()
    modes = late.rows[:, COLUMN["mode"]]
    assert modes[-1] == Mode.FAULT
    before = late.played()[: np.flatnonzero(modes == Mode.FAULT)[0]]
    units = np.array([1.0 / axis.counts_per_unit for axis in late.cut.machine.axes])
    assert largest(before * units, late.cut.machine)[1] <= 1.01


# ---- slow between the look at the pump and the plan: the plan comes too late, or just in time


@pytest.mark.parametrize("words", [pytest.param(False, marks=pytest.mark.slow), True])
@pytest.mark.parametrize("seed", seeds(1, 6))
def test_a_plan_that_comes_too_late_is_as_if_its_tick_had_not_been(seed: int, words: bool) -> None:
    events = holds_and_overrides(seed) if words else ()
    lateness, slow = trains(seed, 0.02, 0.03), trains(seed + 100, 0.02, 0.03)
    late = ran("trunnion", program("example2_ready", "12000."), lateness, events, slow)
    assert late.cut.run.result == "completed", late.cut.run.fault_text
    assert_within_limits(late)
    assert off_the_path(late.cut)[0] < 1e-6
    stepped = late.cut.stepped
    assert isinstance(stepped, Listening) and stepped.refused > 10
    assert (late.setpoints[-1] == in_time("trunnion", "12000.").setpoints[-1]).all()


@pytest.mark.parametrize("seed", range(4))
def test_what_only_a_tick_decides_waits_for_it(seed: int) -> None:
    """At M0, at M8 and in a dwell the axes rest, whatever of it falls between two ticks."""
    lateness, slow = trains(seed, 0.014, 0.15), trains(seed + 100, 0.014, 0.1 * (seed % 2))
    late = ran("trunnion", WITH_MARKS, lateness, (), slow)
    assert late.cut.run.result == "completed", late.cut.run.fault_text
    assert_within_limits(late)
    mode, played = late.rows[:, COLUMN["mode"]], late.played()
    held = np.flatnonzero(mode[: len(played)] == Mode.HOLD)
    stops = np.split(held, np.flatnonzero(np.diff(held) > 1) + 1)
    assert len(stops) == 2 and all((played[one] == played[one[0]]).all() for one in stops)


# ---- by hand


def changing_its_mind(seed: int, lateness: Lateness, slow: Lateness) -> Listening:
    """Jogs in other directions and at other speeds, let go now and then, and at the end."""
    rng, begin = random.Random(seed), list[int]()
    stepped = Listening(
        shipped("trunnion", stock_s=STOCK_S), lateness=lambda n: lateness(n - begin[0]) if begin else 0.0
    )
    stepped.come_up()
    begin.append(stepped.clock.waits)
    stepped.be_slow(slow)
    stepped.played.clear()
    first, direction, speed = stepped.cycle.tick, (1.0, 0.0, 0.0, 0.0, 0.0), 30.0
    while stepped.cycle.tick < first + 1500:
        if rng.random() < 0.02:
            speed = rng.choice((10.0, 30.0, 80.0))
        if rng.random() < 0.01:
            x, y = rng.choice(((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.7, -0.7)))
            direction = x, y, 0.0, 0.0, 0.0
        if rng.random() < 0.01 or 0 <= stepped.cycle.tick - first - 1200 < 20:
            stepped.request(Request.JOG_STOP)
        elif stepped.cycle.tick < first + 1200:
            stepped.send(Event(0, Request.JOG, jog=Jog(direction, speed)))
        stepped.tick()
    return stepped


@pytest.mark.parametrize("seed", seeds(2, 16))
def test_jogs_that_change_with_late_and_slow_ticks_keep_the_limits(seed: int) -> None:
    stepped = changing_its_mind(seed, trains(seed, 0.02, 0.05), trains(seed + 99, 0.02, 0.05))
    machine, T = stepped.machine, stepped.machine.period_s
    assert stepped.cycle.modes.fault is Fault.NONE and stepped.refused
    units = np.array([1.0 / axis.counts_per_unit for axis in machine.axes])
    played = np.array([stepped.played[period][1] for period in sorted(stepped.played)]) * units
    most = np.array([axis.limits.acceleration * T**2 for axis in machine.axes])
    assert (np.abs(np.diff(played, 2, axis=0)) <= ROUNDED * most + 4.0 * np.abs(units)).all()
    assert np.ptp(played[:, 0]) > 1.0
    assert stepped.cycle.modes.mode is Mode.READY and stepped.cycle.follow.at_rest


def jogged(lateness: Lateness | None) -> Listening:
    """X for a while, renewed as a page does, then let go."""
    begin: list[int] = []
    stepped = Listening(
        shipped("trunnion", stock_s=STOCK_S),
        lateness=None if lateness is None else lambda n: lateness(n - begin[0]) if begin else 0.0,
    )
    stepped.come_up()
    begin.append(stepped.clock.waits)
    first = stepped.cycle.tick
    while stepped.cycle.tick < first + 500:
        if stepped.cycle.tick < first + 300:
            stepped.send(Event(0, Request.JOG, jog=Jog((1.0, 0.0, 0.0, 0.0, 0.0), 30.0)))
        elif stepped.cycle.tick < first + 310:
            stepped.request(Request.JOG_STOP)
        stepped.tick()
    return stepped


def of(stepped: Listening) -> np.ndarray:
    """X of what was played, in mm."""
    first = min(stepped.played)
    counts = [stepped.played[first + n][1] for n in range(len(stepped.played))]
    return np.array([one[0] for one in counts if one]) / stepped.machine.axes[0].counts_per_unit


@pytest.mark.parametrize("longest_s", [STOCK_S - 2.1e-3, 0.08])
@pytest.mark.parametrize("seed", range(2))
def test_a_jog_with_late_ticks_keeps_the_limits_and_comes_to_rest(seed: int, longest_s: float) -> None:
    stepped = jogged(trains(seed, longest_s, 0.03))
    assert stepped.cycle.modes.fault is Fault.NONE
    x, limits, T = of(stepped), stepped.machine.axes[0].limits, stepped.machine.period_s
    count = 1.0 / abs(stepped.machine.axes[0].counts_per_unit)
    assert x.max() - x.min() > 1.0
    assert np.abs(np.diff(x, 2)).max() <= ROUNDED * limits.acceleration * T**2 + 4.0 * count
    assert stepped.cycle.modes.mode is Mode.READY and stepped.cycle.follow.at_rest
