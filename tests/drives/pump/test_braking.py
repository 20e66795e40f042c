"""The stop at the end of a plan, against the path that its rows were taken from."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence

import pytest

from drives.pump.braking import Braking
from drives.pump.plan_memory import Stop

T = 0.002
A_MAX, J_MAX = 500.0, 20_000.0


def path(s: float) -> tuple[float, float, float]:
    """Counts of three drives on a curve of some 5 mm of radius at 1000 counts a mm."""
    return 5e3 * math.sin(s / 5.0), 5e3 * math.cos(s / 5.0), 1e3 * s + 40.0 * math.sin(s)


def stop_from(v: float, a: float = 0.0, held: int = 4) -> Stop:
    """An S-shaped stop in whole steps of ``held`` periods: to rest exactly."""
    h = held * T
    n = max(2, math.ceil(math.sqrt(v / J_MAX) / h), math.ceil(v / (A_MAX * h)))
    if a:
        first = -a / h  # a step in which the acceleration ends
        v += h * (a + 0.5 * h * first)
    jerk = v / (n * n * h * h)
    ramp = (-jerk,) * n + (jerk,) * n
    return Stop(((first, *ramp) if a else ramp), held, 0, v if not a else v - h * (a - 0.5 * a), a)


def places(stop: Stop, s: float) -> list[float]:
    """s after each period, by the jerks alone."""
    v, a, used, found = stop.v, stop.a, stop.used, []
    for jerk in stop.jerks:
        while used < stop.held:
            s += T * v + T * T * a / 2.0 + T**3 * jerk / 6.0
            v += T * a + T * T * jerk / 2.0
            a += T * jerk
            used += 1
            found.append(s)
        used = 0
    return found


def rows_at(step: float, many: int, begin: float = 0.0) -> Callable[[int], Sequence[float]]:
    rows = [(begin + i * step, *path(begin + i * step)) for i in range(many)]
    return rows.__getitem__


@pytest.mark.parametrize("v", [2.0, 20.0, 100.0, 200.0])
@pytest.mark.parametrize("begin", [0.0, 3.7, 100.0])
def test_a_stop_leaves_the_path_by_less_than_a_quarter_of_a_count(v: float, begin: float) -> None:
    stop, at = stop_from(v), 3
    wanted = places(stop, begin + at * v * T)
    many = at + 3 + math.ceil((wanted[-1] - begin) / (v * T))
    braking = Braking(stop, T, rows_at(v * T, many, begin), at, many)
    for s in wanted:
        assert not braking.over
        braking.step()
        assert max(abs(a - b) for a, b in zip(braking.counts, path(s), strict=True)) < 0.25
    assert braking.over


def test_it_comes_to_rest_without_going_back() -> None:
    v = 100.0
    stop = stop_from(v)
    braking = Braking(stop, T, lambda i: (i * v * T, 1e3 * i * v * T), 0, 400)
    seen = [0.0]
    while not braking.over:
        seen.append(braking.step()[0])
    steps = [b - a for a, b in itertools.pairwise(seen)]
    assert min(steps) >= -1e-9 and steps[-1] < 0.05 * steps[0]
    changes = [b - a for a, b in itertools.pairwise(steps)]
    assert max(map(abs, changes)) <= 1.001 * 1e3 * T * T * A_MAX


def test_a_stop_that_is_under_way_goes_on_in_the_middle_of_a_step() -> None:
    whole = stop_from(50.0, held=4)
    rows = rows_at(0.1, 300)
    first = Braking(whole, T, rows, 0, 300)
    for _ in range(6):
        first.step()
    v, a = whole.v, whole.a
    for k in range(6):
        jerk = whole.jerks[k // 4]
        v, a = v + T * a + T * T * jerk / 2.0, a + T * jerk
    s = places(whole, 0.0)[5]
    shifted = [(s, *path(s)), *((i * 0.1, *path(i * 0.1)) for i in range(300) if i * 0.1 > s + 1e-6)]
    rest = Stop(whole.jerks[1:], 4, 2, v, a)
    second = Braking(rest, T, shifted.__getitem__, 0, len(shifted))
    while not first.over:
        assert not second.over
        a_counts, b_counts = first.step(), second.step()
        assert max(abs(x - y) for x, y in zip(a_counts, b_counts, strict=True)) < 0.25
    assert second.over


@pytest.mark.parametrize("many", [1, 2, 3])
def test_rows_that_end_too_soon_or_stand_still_are_no_error_and_nothing_runs_beyond_them(many: int) -> None:
    stop = stop_from(100.0)
    rows = [(i * 0.2, 1000.0 * i * 0.2) for i in range(many)]
    braking = Braking(stop, T, rows.__getitem__, 0, many)
    while not braking.over:
        (counts,) = braking.step()
        assert 0.0 <= counts <= rows[-1][1] + 1e-9
    standing = Braking(stop, T, lambda _: (1.0, 7.0), 0, 5)
    while not standing.over:
        assert standing.step() == (7.0,)
