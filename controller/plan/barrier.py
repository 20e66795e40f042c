"""The fastest w(x) under all limits: Newton's method on a logarithmic barrier.

Time is the sum over nodes of w^(-1/2), a convex function. In w(x) the limits are

    acceleration   | q_xx w + q_x w_x / 2 |                                <=  A
    jerk           | q_xxx w + 3/2 q_xx w_x + 1/2 q_x w_xx |  w^(1/2)      <=  J

with plain central differences for w_x and w_xx: each touches three neighbours, so
Newton's matrix has five diagonals and a step costs time proportional to the nodes.
Acceleration is linear. Jerk, written as |linear| <= J w^(-1/2), is not convex, but
J w^(-1/2) is a convex function and lies above its tangent: with the tangent in its
place every step stays feasible, and the tangent moves along with the iterate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

GAP = 1e-5  # share of the time that may be left on the table when the search ends
MAX_STEPS = 150


@dataclass(frozen=True, slots=True)
class Rows:
    """Limits at the nodes: q_x, q_xx, q_xxx and A, J as (n + 1, 5), the cap on w as (n + 1,).

    ``held`` nodes at the start keep their w (the state a new plan takes over).
    """

    q_x: Array
    q_xx: Array
    q_xxx: Array
    acceleration: Array
    jerk: Array
    cap: Array
    held: int = 0


Stencil = tuple[Array, Array, Array]  # coefficients of w[i-1], w[i], w[i+1]


def stencils(rows: Rows) -> tuple[Stencil, Stencil]:
    """The linear forms of acceleration and jerk; nothing reaches past the first and last node."""
    inner = np.ones((len(rows.cap), 1))
    inner[0] = inner[-1] = 0.0
    quarter, half = 0.25 * rows.q_x * inner, 0.5 * rows.q_x * inner
    bend = 0.75 * rows.q_xx * inner
    return (-quarter, rows.q_xx, quarter), (half - bend, rows.q_xxx - 2.0 * half, half + bend)


def apply(stencil: Stencil, w: Array) -> Array:
    """The linear form at every node, (n + 1, 5)."""
    before, after = np.empty_like(w), np.empty_like(w)
    before[1:], before[0] = w[:-1], 0.0
    after[:-1], after[-1] = w[1:], 0.0
    return stencil[0] * before[:, None] + stencil[1] * w[:, None] + stencil[2] * after[:, None]


def start(rows: Rows) -> Array:
    """A feasible w to begin with: constant, half of what the tightest limit allows."""
    return feasible(rows, np.ones(len(rows.cap)), 0.5)


def feasible(rows: Rows, w: Array, share: float) -> Array:
    """``w`` scaled evenly to ``share`` of what the tightest limit allows it."""
    acceleration, jerk = stencils(rows)
    tightest = min(
        float((rows.cap / w).min()),
        float((rows.acceleration / (np.abs(apply(acceleration, w)) + 1e-300)).min()),
        float(((rows.jerk / (np.abs(apply(jerk, w)) * np.sqrt(w)[:, None] + 1e-300)) ** (2 / 3)).min()),
    )
    return share * tightest * w


def solve(rows: Rows, w: Array, gap: float = 1.0) -> Array:
    """The fastest w from a strictly feasible one.

    ``gap`` is about how much time that start gives away, as a share; the search stops
    where no more than ``GAP`` is.
    """
    acceleration, jerk = stencils(rows)
    weight = np.ones(len(w))
    weight[0] = weight[-1] = 0.5
    constraints = 20 * len(w) + len(w)
    mu = gap * float((weight / np.sqrt(w)).sum()) / constraints
    for _ in range(MAX_STEPS):
        step, share = _newton(rows, acceleration, jerk, weight, w, mu)
        w = w + share * step
        if share < 0.2:
            mu *= 2.0  # too near a wall: back towards the middle first
        elif share > 0.5:
            if mu * constraints < GAP * float((weight / np.sqrt(w)).sum()):
                break
            mu *= 0.5 if share > 0.9 else 0.7
    return w


def _newton(
    rows: Rows, acceleration: Stencil, jerk: Stencil, weight: Array, w: Array, mu: float
) -> tuple[Array, float]:
    """One Newton step and the share of it that keeps every slack positive."""
    root = np.sqrt(w)
    gradient = -0.5 * weight / (w * root)
    d0 = 0.75 * weight / (w * w * root)
    d1, d2 = np.zeros_like(w), np.zeros_like(w)
    tangent = (0.5 * rows.jerk) / (w * root)[:, None]
    lin_a, lin_j = apply(acceleration, w), apply(jerk, w)
    room_j = rows.jerk / root[:, None]
    slacks: list[tuple[Array, Stencil]] = []
    for sign in (1.0, -1.0):
        a, j = acceleration, jerk
        slacks.append((rows.acceleration - sign * lin_a, (sign * a[0], sign * a[1], sign * a[2])))
        slacks.append((room_j - sign * lin_j, (sign * j[0], sign * j[1] + tangent, sign * j[2])))
    for slack, form in slacks:
        _add(form, mu / slack, gradient, d0, d1, d2, 1.0 / slack)
    over_cap = mu / (rows.cap - w)
    gradient += over_cap
    d0 += over_cap / (rows.cap - w)
    _hold(rows.held, gradient, d0, d1, d2)
    step = pentadiagonal(d0, d1[:-1], d2[:-2], -gradient)
    return step, _share(slacks, rows.cap - w, w, step)


def _add(form: Stencil, push: Array, g: Array, d0: Array, d1: Array, d2: Array, per_slack: Array) -> None:
    """Adds the barrier's gradient and curvature of one family of limits to the five diagonals."""
    low, mid, high = form
    g[:-1] += (push * low).sum(axis=1)[1:]
    g += (push * mid).sum(axis=1)
    g[1:] += (push * high).sum(axis=1)[:-1]
    curve = push * per_slack
    heavy_low, heavy_mid, heavy_high = curve * low, curve * mid, curve * high
    d0[:-1] += (heavy_low * low).sum(axis=1)[1:]
    d0 += (heavy_mid * mid).sum(axis=1)
    d0[1:] += (heavy_high * high).sum(axis=1)[:-1]
    d1[:-1] += (heavy_low * mid).sum(axis=1)[1:] + (heavy_mid * high).sum(axis=1)[:-1]
    d2[:-2] += (heavy_low * high).sum(axis=1)[1:-1]


def _hold(held: int, gradient: Array, d0: Array, d1: Array, d2: Array) -> None:
    """Takes the first ``held`` nodes out of the system."""
    if held:
        gradient[:held], d0[:held], d1[:held], d2[:held] = 0.0, 1.0, 0.0, 0.0


def _share(slacks: Sequence[tuple[Array, Stencil]], cap_slack: Array, w: Array, step: Array) -> float:
    worst = max(float((step / cap_slack).max()), float((-step / w).max()), 1e-12)
    for slack, form in slacks:
        worst = max(worst, float((apply(form, step) / slack).max()))
    return min(1.0, 0.95 / worst)


def pentadiagonal(d0: Array, d1: Array, d2: Array, right: Array) -> Array:
    """Solves the symmetric positive definite system with diagonals d0 (n), d1 (n-1), d2 (n-2).

    L D L' in plain floats: for some thousand nodes this is as quick as loading a
    linear algebra library would be.
    """
    diagonal, one, two, y = d0.tolist(), [*d1.tolist(), 0.0], [*d2.tolist(), 0.0, 0.0], right.tolist()
    n = len(diagonal)
    first, second = [0.0] * n, [0.0] * n  # the two lower diagonals of L
    d_1 = d_2 = 1.0  # D one and two rows up
    l_1 = m_1 = m_2 = y_1 = y_2 = 0.0
    for i in range(n):
        d = diagonal[i] - l_1 * l_1 * d_1 - m_2 * m_2 * d_2
        value = y[i] - l_1 * y_1 - m_2 * y_2
        nxt = (one[i] - m_1 * l_1 * d_1) / d
        far = two[i] / d
        diagonal[i], y[i], first[i], second[i] = d, value, nxt, far
        d_2, d_1, y_2, y_1 = d_1, d, y_1, value
        m_2, m_1, l_1 = m_1, far, nxt
    x_1 = x_2 = 0.0
    for i in range(n - 1, -1, -1):
        x = y[i] / diagonal[i] - first[i] * x_1 - second[i] * x_2
        y[i] = x
        x_2, x_1 = x_1, x
    return np.array(y)
