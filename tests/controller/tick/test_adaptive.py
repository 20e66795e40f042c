"""The law of adaptive feed alone: a table of cases, its bounds, and when it stays as it is."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as some
from support.machines.spindle_machine import SPINDLE, mill

from controller.machine.model import AdaptiveFeed, Machine
from controller.motion.pieces import STILL, Piece
from controller.state.modes import Binding, Fault, Mode
from controller.tick.adaptive import BAND, CUTS, DEAF_SYNCS, STEP, Adaptive, response, target_share

LAW = AdaptiveFeed(target=0.5, min_share=0.2, fall_s=0.3, rise_s=3.0, overload=1.2, overload_s=0.5)
FASTER = replace(LAW, max_share=1.5)


# --- the formulas


@pytest.mark.parametrize(
    ("law", "acting", "load", "share"),
    [
        (LAW, 1.0, 0.5, 1.0),  # at its target
        (LAW, 1.0, 1.0, 0.5),  # twice of it
        (LAW, 0.5, 0.5, 0.5),  # already slow, and right
        (LAW, 0.5, 0.25, 1.0),
        (LAW, 0.5, 0.1, 1.0),  # never above F
        (LAW, 1.0, 5.0, 0.2),  # never below the least
        (LAW, 1.0, 0.0, 1.0),
        (FASTER, 1.0, 0.4, 1.25),
        (FASTER, 1.0, 0.26, 1.5),
        (FASTER, 1.0, 0.24, 1.0),  # it may be air
        (FASTER, 1.0, 0.0, 1.0),
    ],
)
def test_the_share_that_is_wanted(law: AdaptiveFeed, acting: float, load: float, share: float) -> None:
    assert target_share(law, acting, load) == pytest.approx(share)


laws = some.builds(
    AdaptiveFeed,
    target=some.floats(0.05, 1.5),
    min_share=some.floats(0.05, 1.0),
    max_share=some.floats(1.0, 1.5),
    fall_s=some.floats(0.1, 10.0),
    rise_s=some.floats(0.1, 100.0),
)
shares, loads = some.floats(0.05, 1.5), some.floats(0.0, 4.0)


@given(laws, shares, loads)
def test_it_is_within_its_bounds(law: AdaptiveFeed, acting: float, load: float) -> None:
    assert law.min_share <= target_share(law, acting, load) <= law.max_share
    if load < CUTS * law.target:
        assert target_share(law, acting, load) <= 1.0


@given(laws, shares, loads, loads)
def test_more_load_is_never_answered_by_more_feed(
    law: AdaptiveFeed, acting: float, a: float, b: float
) -> None:
    less, more = sorted((a, b))
    if less >= CUTS * law.target or law.max_share == 1.0:
        assert target_share(law, acting, more) <= target_share(law, acting, less)


@given(laws, shares, shares, some.floats(1e-4, 1.0))
def test_the_response_goes_to_what_is_wanted_and_never_past_it(
    law: AdaptiveFeed, share: float, towards: float, seconds: float
) -> None:
    found = response(law, share, towards, seconds)
    low, high = sorted((share, towards))
    assert low - 1e-12 <= found <= high + 1e-12
    slow_s = law.fall_s if towards < share else law.rise_s
    assert abs(found - share) == pytest.approx(abs(towards - share) * min(1.0, seconds / slow_s), abs=1e-12)


# --- the law at work, on a plan that answers late


@dataclass
class Cut:
    """A cut whose load is ``per_share`` of the feed, told by a spindle."""

    per_share: float
    load: float = 0.0
    unheard: int = 1


def machine(law: AdaptiveFeed = LAW) -> Machine:
    made = mill(SPINDLE.replace("counts_per_rev = 4096", "counts_per_rev = 4096\nposition = { load = true }"))
    assert made.spindle is not None
    return replace(made, spindle=replace(made.spindle, adaptive=law))


class Run:
    """The law with a planner and a spindle that take their time."""

    def __init__(self, law: AdaptiveFeed = LAW, plan_s: float = 0.1, ramp_s: float = 0.05) -> None:
        self.machine = machine(law)
        self.cut = Cut(0.3)
        self.adaptive = Adaptive(self.machine, self.cut)
        self.failed: list[Fault] = []
        self.modes: Any = SimpleNamespace(
            mode=Mode.RUNNING, running=True, override=1.0, adaptive_feed=False, fail=self._fail
        )
        piece = Piece(1, 1, STILL, 1.0, override=1.0, adaptive=True)
        self.follow = SimpleNamespace(piece=piece, feed=10.0, limited_by=int(Binding.FEED))
        self.turns = True
        period_s = self.machine.period_s
        self._plan = [1.0] * max(1, round(plan_s / period_s))
        self._ramp = [1.0] * max(1, round(ramp_s / period_s))

    def _fail(self, fault: Fault, axis: int) -> None:
        self.failed.append(fault)

    def go(self, seconds: float) -> list[float]:
        """The loads of so much time."""
        found = []
        for _ in range(round(seconds / self.machine.period_s)):
            self._plan.append(self.adaptive.share * self.modes.override)
            planned = self._plan.pop(0)
            self.follow.piece = self.follow.piece._replace(override=planned)
            self._ramp.append(planned)
            self.cut.load = self.cut.per_share * self._ramp.pop(0)
            self.adaptive.watch(self.modes, self.follow, self.turns, 1)
            found.append(self.cut.load)
        return found


@pytest.mark.parametrize("plan_s", [0.05, 0.3, 1.0], ids="plan {} s".format)
@pytest.mark.parametrize("heavy", [0.6, 1.0, 2.0], ids="load {}".format)
def test_the_load_comes_to_its_target_without_a_swing(plan_s: float, heavy: float) -> None:
    """Within ``BAND`` after five of ``fall_s`` and the planner's own time, and it stays there."""
    run = Run(plan_s=plan_s)
    run.go(1.0)
    run.cut.per_share = heavy
    loads = run.go(12.0)
    settled = loads[round((5.0 * LAW.fall_s + plan_s + 0.3) / run.machine.period_s) :]
    assert max(settled) <= LAW.target * (1.0 + BAND) and min(settled) >= LAW.target * (1.0 - BAND)
    assert min(loads) >= LAW.target * (1.0 - 2.0 * BAND)
    run.cut.per_share = 0.3
    run.go(25.0)
    assert run.adaptive.share == 1.0


def test_a_load_that_no_feed_brings_down_ends_at_the_least_share() -> None:
    run = Run()
    run.cut.per_share = 10.0
    run.go(5.0)
    assert run.adaptive.share == LAW.min_share


def test_the_planner_is_told_of_steps_that_are_worth_a_plan() -> None:
    run = Run()
    run.cut.per_share = 1.0
    told = [run.adaptive.share]
    for _ in range(2000):
        run.go(run.machine.period_s)
        if run.adaptive.share != told[-1]:
            told.append(run.adaptive.share)
    assert all(abs(b - a) >= STEP * a for a, b in itertools.pairwise(told)) and 10 < len(told) < 30


@pytest.mark.parametrize(
    ("what", "change"),
    [
        ("rapid", {"rapid": True}),
        ("thread, M49", {"own_feed": True}),
        ("dwell", {"motion_id": -1}),
        ("not asked for", {"adaptive": False}),
    ],
)
def test_where_it_does_not_count_the_share_stays(what: str, change: dict[str, Any]) -> None:
    run = Run()
    run.cut.per_share = 1.0
    run.go(0.5)
    before = run.adaptive.share
    run.follow.piece = run.follow.piece._replace(**change)
    run.go(2.0)
    assert not run.adaptive.on and run.adaptive.share == before < 1.0


@pytest.mark.parametrize("what", ["standing", "spindle", "hold", "ramp"])
def test_it_stays_while_nothing_is_cut_at_an_even_speed(what: str) -> None:
    run = Run()
    run.cut.per_share = 1.0
    run.go(0.5)
    before = run.adaptive.share
    if what == "standing":
        run.follow.feed = 0.0
    elif what == "spindle":
        run.turns = False
    elif what == "hold":
        run.modes.mode, run.modes.running = Mode.HOLD, False
    else:
        run.follow.limited_by = int(Binding.NOTHING)
    run.go(2.0)
    assert run.adaptive.share == before < 1.0


def test_where_an_axis_binds_it_may_fall_and_not_rise() -> None:
    run = Run()
    run.follow.limited_by = int(Binding.AXIS)
    run.cut.per_share = 1.0
    run.go(1.0)
    low = run.adaptive.share
    assert low < 0.9
    run.cut.per_share = 0.1
    run.go(3.0)
    assert run.adaptive.share == low


def test_the_switch_lets_it_count_without_m52() -> None:
    run = Run()
    run.follow.piece = run.follow.piece._replace(adaptive=False)
    run.modes.adaptive_feed = True
    run.cut.per_share = 1.0
    run.go(2.0)
    assert run.adaptive.on and run.adaptive.share < 0.6


def test_a_light_cut_is_made_faster_only_where_the_machine_says_so_and_it_cuts() -> None:
    plain, fast = Run(), Run(FASTER)
    for run in (plain, fast):
        run.cut.per_share = 0.4
        run.go(20.0)
    assert plain.adaptive.share == 1.0
    assert 0.5 * (1.0 - BAND) <= fast.cut.load <= 0.5 * (1.0 + BAND)
    fast.follow.piece = fast.follow.piece._replace(rapid=True)
    fast.go(0.1)
    assert fast.adaptive.share == 1.0, "what comes next may be another cut"


def test_an_overridden_feed_is_led_as_well() -> None:
    """The operator's half leaves half of the load: the share goes back to all of that half."""
    run = Run()
    run.cut.per_share = 0.8
    run.go(3.0)
    run.modes.override = 0.5
    run.go(20.0)
    assert run.adaptive.share == 1.0 and run.cut.load == pytest.approx(0.4)


def test_a_program_begins_at_its_own_feed() -> None:
    run = Run()
    run.cut.per_share = 1.0
    run.go(2.0)
    run.modes.mode, run.modes.running = Mode.READY, False
    run.go(0.01)
    assert run.adaptive.share == 1.0


def test_an_old_load_is_one_that_may_be_too_high() -> None:
    run = Run()
    run.go(1.0)
    run.cut.unheard = DEAF_SYNCS
    run.go(1.0)
    assert run.adaptive.share == 1.0 and not run.failed
    run.cut.unheard = DEAF_SYNCS + 1
    run.go(6.0 * LAW.fall_s)
    assert run.adaptive.share == LAW.min_share and run.failed == [Fault.LOAD_UNKNOWN]
    run.cut.unheard = 1
    run.go(30.0)
    assert run.adaptive.share == 1.0, "it is told again"


def test_an_overload_holds_after_its_time_and_not_before() -> None:
    run = Run(replace(LAW, min_share=1.0))
    run.cut.per_share = 1.3
    run.go(LAW.overload_s)
    assert not run.failed
    run.cut.per_share = 0.3
    run.go(0.2)
    run.cut.per_share = 1.3
    run.go(LAW.overload_s)
    assert not run.failed
    run.go(0.2)
    assert run.failed == [Fault.SPINDLE_OVERLOADED]


def test_a_spindle_that_turns_the_other_way_has_a_load_too() -> None:
    run = Run()
    run.cut.per_share = -1.0
    run.go(3.0)
    assert run.cut.load == pytest.approx(-0.5, rel=BAND)


def test_a_run_that_is_made_again_takes_the_share_of_its_record() -> None:
    run = Run()
    run.adaptive.take(run.modes, run.follow, 0.37)
    assert run.adaptive.share == 0.37 and run.adaptive.on


def test_without_a_law_there_is_nothing_to_watch() -> None:
    assert not Adaptive(mill(), Cut(1.0)).present and not Adaptive(machine(), None).present
