"""The search for the fastest w(x): its linear algebra, its derivatives, its optimum."""

from __future__ import annotations

import numpy as np
import pytest

from controller.plan import barrier

SEEDS = range(8)


def dense(d0: np.ndarray, d1: np.ndarray, d2: np.ndarray) -> np.ndarray:
    upper = np.diag(d1, 1) + np.diag(d2, 2)
    return np.diag(d0) + upper + upper.T


def straight_rows(
    n: int = 40, acceleration: float = 1e3, jerk: float = 1e4, cap: float = 1e6
) -> barrier.Rows:
    """Joint 0 goes evenly along x, the others stand: q_x = 1."""
    q_x = np.zeros((n + 1, 5))
    q_x[:, 0] = 1.0
    none = np.zeros_like(q_x)
    full = np.ones_like(q_x)
    return barrier.Rows(q_x, none, none, acceleration * full, jerk * full, np.full(n + 1, cap))


def random_rows(rng: np.random.Generator, n: int = 60) -> barrier.Rows:
    x = np.linspace(0.0, 1.0, n + 1)[:, None]
    phase, speed = rng.uniform(0.0, 6.0, 5), rng.uniform(1.0, 8.0, 5)
    q_x = np.sin(speed * x + phase)
    q_xx, q_xxx = speed * np.cos(speed * x + phase) / n, -(speed**2) * q_x / n**2
    full = np.ones_like(q_x)
    limits = rng.uniform(50.0, 500.0), rng.uniform(500.0, 50000.0)
    return barrier.Rows(
        q_x, q_xx, q_xxx, limits[0] * full, limits[1] * full, np.full(n + 1, rng.uniform(10.0, 1e4))
    )


def excess(rows: barrier.Rows, w: np.ndarray) -> float:
    """Largest share of any limit."""
    a, j = barrier.stencils(rows)
    share_a = np.abs(barrier.apply(a, w)) / rows.acceleration
    share_j = np.abs(barrier.apply(j, w)) * np.sqrt(w)[:, None] / rows.jerk
    return float(max(share_a.max(), share_j.max(), (w / rows.cap).max()))


def duration(w: np.ndarray) -> float:
    weight = np.ones(len(w))
    weight[0] = weight[-1] = 0.5
    return float((weight / np.sqrt(w)).sum())


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("n", [3, 4, 5, 17, 200])
def test_five_diagonals_are_solved_as_numpy_solves_the_full_matrix(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    d1, d2 = rng.normal(size=n - 1), rng.normal(size=n - 2)
    d0 = np.abs(dense(np.zeros(n), d1, d2)).sum(axis=1) + rng.uniform(0.1, 1.0, n)  # dominant: definite
    right = rng.normal(size=n)
    found = barrier.pentadiagonal(d0, d1, d2, right)
    np.testing.assert_allclose(found, np.linalg.solve(dense(d0, d1, d2), right), rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_stencils_are_the_linear_forms_of_central_differences(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows = random_rows(rng)
    w = rng.uniform(1.0, 2.0, len(rows.cap))
    a, j = (barrier.apply(stencil, w)[1:-1] for stencil in barrier.stencils(rows))
    w_x, w_xx = 0.5 * (w[2:] - w[:-2])[:, None], (w[2:] - 2.0 * w[1:-1] + w[:-2])[:, None]
    inner, middle = slice(1, -1), w[1:-1, None]
    q_x, q_xx, q_xxx = rows.q_x[inner], rows.q_xx[inner], rows.q_xxx[inner]
    np.testing.assert_allclose(a, q_xx * middle + 0.5 * q_x * w_x, atol=1e-12)
    np.testing.assert_allclose(j, q_xxx * middle + 1.5 * q_xx * w_x + 0.5 * q_x * w_xx, atol=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_answer_keeps_every_limit_and_touches_one_nearly_everywhere(seed: int) -> None:
    rows = random_rows(np.random.default_rng(seed))
    first = barrier.start(rows)
    assert excess(rows, first) < 1.0, seed
    w = barrier.solve(rows, first)
    assert (w > 0.0).all() and excess(rows, w) < 1.0, seed
    assert duration(w) <= duration(first), seed


@pytest.mark.parametrize("seed", SEEDS)
def test_no_feasible_neighbour_of_the_answer_is_faster(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows = random_rows(rng)
    w = barrier.solve(rows, barrier.start(rows))
    best = duration(w)
    x = np.linspace(-3.0, 3.0, len(w))
    for _ in range(300):
        bump = np.exp(-(((x - rng.uniform(-3, 3)) / rng.uniform(0.1, 3.0)) ** 2))
        other = w * (1.0 + rng.normal() * 10.0 ** rng.uniform(-4, -1) * bump)
        if (other > 0.0).all() and excess(rows, other) <= 1.0:
            assert duration(other) > best * (1.0 - 1e-4), seed


def test_where_only_the_cap_binds_the_answer_is_the_cap() -> None:
    rows = straight_rows(acceleration=1e6, jerk=1e8, cap=25.0)
    w = barrier.solve(rows, barrier.start(rows))
    assert (w < 25.0).all()
    np.testing.assert_allclose(w, 25.0, rtol=1e-4)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_an_even_scaling_reaches_just_the_share_that_was_asked_for(share: float) -> None:
    rows = random_rows(np.random.default_rng(5))
    wild = np.random.default_rng(6).uniform(0.5, 1.5, len(rows.cap))
    a, j = barrier.stencils(rows)
    w = barrier.feasible(rows, wild, share)
    shares = [
        (np.abs(barrier.apply(a, w)) / rows.acceleration).max(),
        ((np.abs(barrier.apply(j, w)) * np.sqrt(w)[:, None] / rows.jerk) ** (2 / 3)).max(),
        (w / rows.cap).max(),
    ]
    assert max(shares) == pytest.approx(share)


def test_newtons_step_is_downhill_and_solves_its_own_linear_system() -> None:
    """Differences of the barrier function along the step agree with the direction taken."""
    rows = random_rows(np.random.default_rng(9))
    a, j = barrier.stencils(rows)
    w = barrier.feasible(rows, np.ones(len(rows.cap)), 0.5)
    weight = np.ones(len(w))
    mu = 1e-3 * duration(w) / (21 * len(w))
    step, share = barrier._newton(rows, a, j, weight, w, mu)

    def value(at: np.ndarray) -> float:
        root = np.sqrt(at)[:, None]
        rooms = [rows.cap - at]
        for sign in (1.0, -1.0):
            rooms += [
                rows.acceleration - sign * barrier.apply(a, at),
                rows.jerk / root - sign * barrier.apply(j, at),
            ]
        return float((weight / np.sqrt(at)).sum()) - mu * sum(float(np.log(room).sum()) for room in rooms)

    assert 0.0 < share <= 1.0
    assert value(w + 1e-4 * step) < value(w)


def test_held_nodes_at_the_start_keep_their_speed() -> None:
    rows = straight_rows()
    held = barrier.Rows(rows.q_x, rows.q_xx, rows.q_xxx, rows.acceleration, rows.jerk, rows.cap, held=3)
    w = barrier.start(held)
    assert (barrier.solve(held, w)[:3] == w[:3]).all()
