"""The search for the fastest z(s): forms, optimum, and starts that no limit would allow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from controller.plan.feed import barrier
from controller.plan.feed.barrier import Form, Limits, Ties

SEEDS = range(6)


def forms(h: np.ndarray) -> tuple[Form, Form, Form, Form]:
    """z and z' at the ends of even intervals, z'' and z in the middle."""
    one, none = np.ones_like(h), np.zeros_like(h)
    return (
        Form(none, 0.5 * one, 0.5 * one),
        Form(none, -1.0 / h, 1.0 / h),
        Form(1.0 / h**2, -2.0 / h**2, 1.0 / h**2),
        Form(0.125 * one, 0.75 * one, 0.125 * one),
    )


def line(
    n: int = 80,
    acceleration: float = 1e3,
    jerk: float = 1e4,
    cap: float = 1e3,
    held: bool = False,
    scale: float = 30.0,
) -> Limits:
    """One joint that goes with s, over 10 mm, from a low speed (or a motion) to a low one."""
    h = np.full(n, 10.0 / n)
    z, slope, bend, middle = forms(h)
    straight = [_times(slope, 0.5 / acceleration), _times(slope, -0.5 / acceleration)]
    both = [_times(bend, 0.5 * scale / jerk), _times(bend, -0.5 * scale / jerk)]
    full = np.full(n + 2, cap)
    starts, ends = (
        Ties(np.array(of, dtype=np.intp), np.full(len(of), 0.2)) for of in ([] if held else [0], [n + 1])
    )
    prices = np.full(n + 2, barrier.PRICE)
    most = np.full((2, n), scale)
    return Limits(
        _stack([middle]), h, _stack(straight), _stack(both), _stack([z, z]), most, full, prices, starts, ends
    )


def _times(form: Form, k: float) -> Form:
    return Form(k * form.low, k * form.mid, k * form.high)


def _stack(parts: list[Form]) -> Form:
    return Form(*(np.stack([getattr(f, name) for f in parts]) for name in ("low", "mid", "high")))


def worst(limits: Limits, c: np.ndarray) -> float:
    """Largest share of any limit."""
    jerk = limits.jerk.of(c) * np.sqrt(limits.at.of(c)) / limits.most
    return float(max(limits.straight.of(c).max(), jerk.max(), (c[1:-1] / limits.cap[1:-1]).max()))


def duration(limits: Limits, c: np.ndarray) -> float:
    return float((limits.width / np.sqrt(limits.time.of(c))).sum())


@pytest.mark.parametrize("z", [1e-3, 1.0, 30.0, 300.0])
def test_from_any_start_the_answer_keeps_every_limit_and_is_the_same(z: float) -> None:
    limits = line()
    found = barrier.solve(limits, np.full(82, z))
    wanted = barrier.solve(limits, np.full(82, 10.0))
    assert not found.stuck and worst(limits, found.c) <= 1.0 + 1e-6
    assert duration(limits, found.c) == pytest.approx(duration(limits, wanted.c), rel=1e-4)


@pytest.mark.parametrize("seed", SEEDS)
def test_no_feasible_neighbour_of_the_answer_is_faster(seed: int) -> None:
    rng = np.random.default_rng(seed)
    limits = line(acceleration=10.0 ** rng.uniform(2, 4), jerk=10.0 ** rng.uniform(3, 5))
    c = barrier.solve(limits, np.full(82, 10.0)).c
    best, x = duration(limits, c), np.linspace(-3.0, 3.0, len(c))
    for _ in range(200):
        bump = np.exp(-(((x - rng.uniform(-3, 3)) / rng.uniform(0.1, 3.0)) ** 2))
        other = c * (1.0 + rng.normal() * 10.0 ** rng.uniform(-4, -1) * bump)
        other[0], other[-1] = 0.2 * other[1], 0.2 * other[-2]
        if worst(limits, other) <= 1.0:
            assert duration(limits, other) > best * (1.0 - 1e-4), seed


def test_where_only_the_cap_binds_the_answer_is_the_cap() -> None:
    limits = line(acceleration=1e9, jerk=1e12, cap=25.0)
    c = barrier.solve(limits, np.full(82, 1.0)).c
    np.testing.assert_allclose(c[2:-2], 25.0, rtol=1e-4)


def test_a_motion_that_begins_above_the_cap_is_brought_below_it_and_keeps_the_other_limits() -> None:
    limits = line(cap=100.0, held=True)
    limits.cap_price[:40] = 0.01
    start = np.full(82, 90.0)
    start[:2] = 400.0  # 20 mm/s where 10 are allowed
    c = barrier.solve(limits, start).c
    assert (c[:2] == 400.0).all()
    assert limits.straight.of(c).max() <= 1.0 + 1e-5
    assert (limits.jerk.of(c) * np.sqrt(limits.at.of(c)) / limits.most).max() <= 1.0 + 1e-5
    assert (c[30:-5] <= 100.0 * (1.0 + 1e-5)).all() and c[:20].max() == 400.0


def test_what_cannot_be_kept_is_exceeded_as_little_as_can_be() -> None:
    """Two held coefficients rise faster than the acceleration limit: only the first intervals exceed it."""
    limits = line(held=True)
    start = np.full(82, 60.0)
    start[:2] = 50.0, 50.0 + 2.0 * 1.05 * 1e3 * 10.0 / 80
    found = barrier.solve(limits, start)
    use = limits.straight.of(found.c).max(axis=0)
    assert not found.stuck and use[3:].max() <= 1.0 + 1e-4


def test_a_solution_under_similar_limits_saves_most_of_the_steps() -> None:
    cold = barrier.solve(line(), np.full(82, 10.0))
    other = line(jerk=0.98e4)
    warm = barrier.solve(other, cold.c, cold)
    assert worst(other, warm.c) <= 1.0 + 1e-6 and warm.steps <= 0.6 * cold.steps


@pytest.mark.parametrize(
    "where", [slice(30, 55), slice(0, 20), slice(60, 80)], ids=["inside", "first", "last"]
)
def test_what_is_sought_again_in_a_part_is_what_all_of_it_would_be(where: slice) -> None:
    """The feed is lowered in one place: far from there nothing changes, and near it as much as it must."""
    limits = line(jerk=1e5)
    begun = barrier.solve(limits, np.full(82, 10.0))
    k = (where.start + where.stop) // 2
    limits.cap[k : k + 3] *= 0.9
    near = np.zeros(80, dtype=bool)
    near[where] = near[22:24] = near[56:58] = True
    found = barrier.solve_near(limits, begun, near)
    wanted = barrier.solve(limits, begun.c, begun)
    assert not found.stuck and worst(limits, found.c) <= 1.0 + 1e-6
    others = ~(np.convolve(near, [1.0, 1.0, 1.0]) > 0.0)
    assert np.array_equal(found.c[others], begun.c[others])
    assert duration(limits, begun.c) < duration(limits, wanted.c)
    assert duration(limits, found.c) <= (1.0 + 1e-3) * duration(limits, wanted.c)


def test_limits_that_are_far_away_can_be_left_out_of_a_search_that_has_come_near() -> None:
    limits = line()
    shares = (1.0, 0.6, 0.3)
    wide = replace(
        limits, straight=_scaled(limits.straight, shares), jerk=_scaled(limits.jerk, shares), held=None
    )
    near = barrier.solve(wide, np.full(82, 10.0), gap=2e-2)
    few, every = (barrier.solve(wide, near.c, near, few=which) for which in (True, False))
    assert few.price.shape == every.price.shape
    assert ((few.price > barrier.MIN_PRICE).sum(axis=0) <= 3 * barrier.MOST_USED).all()
    assert worst(limits, few.c) <= 1.0 + 1e-6
    assert duration(limits, few.c) == pytest.approx(duration(limits, every.c), rel=2.0 * barrier.GAP)
    part = np.arange(80) > 20
    again = barrier.solve_near(wide, few, part, few=True)
    assert worst(limits, again.c) <= 1.0 + 1e-6 and (again.c[:22] == few.c[:22]).all()


def _scaled(form: Form, shares: tuple[float, ...]) -> Form:
    """Each row, and after it what is so much of it."""
    rows = [[k * row for row in value for k in shares] for value in (form.low, form.mid, form.high)]
    return Form(*(np.array(of) for of in rows))
