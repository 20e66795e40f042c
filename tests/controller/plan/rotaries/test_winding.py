"""The choice of branch and turns over rows, against trying everything."""

from __future__ import annotations

import itertools
import math
import random
from dataclasses import replace

import pytest
from support.machines.shipped_kinds import machine

from controller.machine.model import Machine
from controller.motion.motions import Rotaries
from controller.plan.rotaries.winding import TURN, Row, Turned, Way, apart, choose

HERE = (0.0, 0.0)


def with_travels(tilt_deg: float, turn_deg: float) -> Machine:
    built = machine()
    axes = list(built.axes)
    for index, travel in zip(built.rotary(), (tilt_deg, turn_deg), strict=True):
        axes[index] = replace(axes[index], travel_min=-math.radians(travel), travel_max=math.radians(travel))
    return replace(built, axes=tuple(axes))


def way(tilt: float, start: float, end: float, inside: bool = True) -> Way:
    """A row on which A stands at ``tilt`` and C turns evenly; degrees."""
    a, c, d = map(math.radians, (tilt, start, end))
    return Way((a, c), (a, d), (a, min(c, d)), (a, max(c, d)), abs(d - c), tilt < 0.0, inside, 0)


def both(tilt: float, start: float, end: float) -> list[Way]:
    return [way(tilt, start, end), way(-tilt, start + 180.0, end + 180.0)]


def row(line: int, ways: list[Way]) -> Row:
    return Row(line, lambda near: ways)


def cost(now: Rotaries, starts: list[Rotaries], ways: list[Way]) -> tuple[float, float]:
    """By how much the cuts are slower (s), and the travel (rad)."""
    slower = total = 0.0
    for start, chosen in zip(starts, ways, strict=True):
        slower += chosen.slower_s
        total += apart(now, start) + chosen.travel
        now = (start[0] + chosen.end[0] - chosen.start[0], start[1] + chosen.end[1] - chosen.start[1])
    return slower, total


def everything(rows: list[list[Way]], built: Machine) -> tuple[float, float]:
    """The least cost of all branches and turns, by trying them all."""
    limit = built.axes[built.rotary()[1]].travel_max + 1e-9
    best = (math.inf, math.inf)
    options = []
    for ways in rows:
        turned = [(w, n * TURN) for w in ways for n in range(-4, 5)]
        options.append([(w, by) for w, by in turned if w.low[1] + by >= -limit and w.high[1] + by <= limit])
    for chosen in itertools.product(*options):
        starts = [(w.start[0], w.start[1] + by) for w, by in chosen]
        best = min(best, cost(HERE, starts, [w for w, _ in chosen]))
    return best


@pytest.mark.parametrize("slower_s", [0.0, 0.25])
@pytest.mark.parametrize("turn_deg", [200.0, 400.0, 800.0])
def test_no_sequence_of_branches_and_turns_is_faster_or_has_less_travel(
    turn_deg: float, slower_s: float
) -> None:
    """The branch of each row on which it is slower, if one is, is drawn."""
    seed = random.randrange(10**6)
    rng, built = random.Random(seed), with_travels(120.0, turn_deg)
    for _ in range(12):
        rows = []
        for _ in range(3):
            start = rng.uniform(-180.0, 180.0)
            made = both(rng.uniform(5.0, 60.0), start, start + rng.uniform(-350.0, 350.0))
            slow = rng.randrange(3)
            rows.append([replace(one, slower_s=slower_s * (k == slow)) for k, one in enumerate(made)])
        found = choose([row(n, ways) for n, ways in enumerate(rows)], HERE, built)
        best = everything(rows, built)
        if math.isinf(best[0]):
            assert len(found) < 3, f"seed {seed}"
            continue
        starts = [found[n] for n in range(3)]
        taken = [
            next(w for w in ways if abs(w.start[0] - start[0]) < 1e-9)
            for ways, start in zip(rows, starts, strict=True)
        ]
        assert cost(HERE, starts, taken) == pytest.approx(best, abs=1e-9), f"seed {seed}"


def test_the_nearest_start_is_not_taken_where_it_leads_to_the_farther_end() -> None:
    built = with_travels(120.0, 400.0)
    rows = [row(1, both(10.0, 80.0, 80.0)), row(2, both(10.0, -100.0, -100.0))]
    # C 80 then -100 or -100 (A -10) all along: more to the first start, less over all.
    found = choose([rows[0]], HERE, built)
    assert found[1][1] == pytest.approx(math.radians(80.0))
    found = choose([*rows, Turned((None, math.radians(-100.0)), False)], HERE, built)
    assert found[1] == pytest.approx((math.radians(-10.0), math.radians(-100.0)))
    assert found[2] == pytest.approx((math.radians(10.0), math.radians(-100.0)))


def test_a_named_position_between_rows_decides_for_the_row_before_it() -> None:
    built = with_travels(120.0, 400.0)
    rows = row(1, both(10.0, 100.0, 100.0))
    assert choose([rows], HERE, built)[1][1] == pytest.approx(math.radians(-80.0))
    after = Turned((math.radians(20.0), math.radians(200.0)), False)
    assert choose([rows, after], HERE, built)[1][1] == pytest.approx(math.radians(100.0))


def test_a_distance_that_would_leave_the_travel_asks_for_another_turn_before() -> None:
    built = with_travels(120.0, 400.0)
    rows = row(1, both(10.0, 170.0, 170.0))
    far = Turned((None, math.radians(-395.0)), True)
    assert choose([rows], HERE, built)[1][1] == pytest.approx(math.radians(-10.0))
    assert choose([rows, far], HERE, built)[1][1] == pytest.approx(math.radians(170.0))


def test_a_way_outside_of_the_linear_travel_is_never_taken() -> None:
    ways = [way(10.0, 5.0, 5.0, inside=False), way(-10.0, 185.0, 185.0)]
    assert choose([row(7, ways)], HERE, with_travels(120.0, 400.0))[7][0] < 0.0


def test_what_cannot_be_taken_ends_the_choice_and_keeps_what_was_before() -> None:
    built = with_travels(120.0, 100.0)
    rows = [row(1, both(10.0, 20.0, 20.0)), row(2, both(10.0, 0.0, 300.0)), row(3, both(10.0, 0.0, 0.0))]
    assert list(choose(rows, HERE, built)) == [1]


def test_a_row_that_leaves_a_rotary_free_begins_where_the_rotaries_stand() -> None:
    def ways(near: Rotaries) -> list[Way]:
        return [Way((0.0, near[1]), (0.0, near[1]), (0.0, near[1]), (0.0, near[1]), 0.0, False, True, 0)]

    built = with_travels(120.0, 400.0)
    steps = [Turned((None, 1.25), False), Row(4, ways), Turned((None, 0.5), True)]
    assert choose(steps, HERE, built)[4] == (0.0, 1.25)


def test_many_rows_that_wind_up_stay_inside_travel() -> None:
    built = with_travels(120.0, 400.0)
    rows = [row(n, both(10.0, 0.0, 300.0)) for n in range(60)]
    found = choose(rows, HERE, built)
    assert len(found) == 60
    for start in found.values():
        assert -math.radians(400.0) <= start[1] <= math.radians(100.0) + 1e-9
