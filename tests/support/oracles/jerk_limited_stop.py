"""The shortest jerk-limited stop on a path from a state of motion, by linear programs.

A second opinion on the controller's stops, by another method on purpose: the jerk of
the path is held on K equal steps of a horizon; place, speed and acceleration are then
linear in it. Joint velocity, acceleration and jerk are taken from splines through
sampled joints, linearised about the last try, and a linear program asks for the least
overstepping. The shortest horizon that oversteps nothing is found by halving.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.optimize import linprog

STEPS = 36
ROUNDS = 10  # of linearising
SHARES = (1.0, 0.6, 0.35, 0.15)  # of the way to a program's answer that are tried
OVER = 2e-3  # of overstepping is none
HALVINGS = 8

Joints = Callable[[np.ndarray], np.ndarray]  # places (N,) -> joints (N, 5)


class Way(NamedTuple):
    """Joints along a smooth path from ``begin`` to ``end``, as splines: value and five derivatives."""

    begin: float
    end: float
    orders: tuple[Callable[[np.ndarray], np.ndarray], ...]


class Limits(NamedTuple):
    velocity: np.ndarray
    acceleration: np.ndarray
    jerk: np.ndarray


def way(joints: Joints, begin: float, end: float, samples: int = 1201) -> Way:
    """The path between two places; nothing in it may have a corner."""
    x = np.linspace(begin, end, samples)
    spline = make_interp_spline(x, joints(x), k=5)
    return Way(begin, end, tuple(spline.derivative(n) for n in range(1, 5)))


def shortest(path: Way, limits: Limits, s: float, v: float, a: float) -> float | None:
    """Seconds of the shortest stop from (s, v, a); None where no horizon below 4 s will do."""
    high, tried = _first(path, limits, s, v, a), None
    if high is None:
        return None
    horizon, tried = high
    low = horizon / 1.3
    while _possible(path, limits, (s, v, a), low, tried) is not None and low > 1e-3:
        horizon, low = low, low / 1.3
    for _ in range(HALVINGS):
        middle = 0.5 * (low + horizon)
        jerk = _possible(path, limits, (s, v, a), middle, tried)
        if jerk is None:
            low = middle
        else:
            horizon, tried = middle, jerk
    return horizon


def _first(path: Way, limits: Limits, s: float, v: float, a: float) -> tuple[float, np.ndarray] | None:
    horizon = 0.01
    while horizon < 4.0:
        jerk = _possible(path, limits, (s, v, a), horizon, None)
        if jerk is not None:
            return horizon, jerk
        horizon *= 1.3
    return None


def _possible(
    path: Way, limits: Limits, state: tuple[float, float, float], horizon: float, guess: np.ndarray | None
) -> np.ndarray | None:
    """Jerks (K,) of a stop that takes ``horizon``, or None."""
    h = horizon / STEPS
    start, build = _motion(state, h)
    jerk = _smooth(state, horizon) if guess is None else guess
    over = _overstep(path, limits, start, build, jerk)
    for _ in range(ROUNDS):
        found = _improved(path, limits, start, build, jerk)
        if found is None:
            return None
        tries = [jerk + share * (found - jerk) for share in SHARES]
        oversteps = [_overstep(path, limits, start, build, tried) for tried in tries]
        k = int(np.argmin(oversteps))
        if oversteps[k] <= OVER:
            return tries[k]
        if oversteps[k] > 0.999 * over < np.inf:
            return None
        jerk, over = tries[k], oversteps[k]
    return None


def _smooth(state: tuple[float, float, float], horizon: float) -> np.ndarray:
    """Jerks of the cubic v(t) that starts in ``state`` and ends at rest."""
    _, v, a = state
    t = (np.arange(STEPS) + 0.5) * horizon / STEPS
    c2, c3 = -(3 * v / horizon + 2 * a) / horizon, (2 * v / horizon + a) / horizon**2
    return np.asarray(2 * c2 + 6 * c3 * t)


def _motion(state: tuple[float, float, float], h: float) -> tuple[np.ndarray, np.ndarray]:
    """(3, K + 1) of s, v, a without any jerk, and (3, K + 1, K): what each step's jerk adds."""
    k = np.arange(STEPS + 1)
    s, v, a = state
    t = k * h
    start = np.array([s + v * t + a * t * t / 2, v + a * t, np.full(len(t), a)])
    on = np.clip(t[:, None] - (np.arange(STEPS) * h)[None, :], 0.0, None)
    off = np.clip(on - h, 0.0, None)
    build = np.array([(on**3 - off**3) / 6, (on**2 - off**2) / 2, on - off])
    return start, build


def _overstep(path: Way, limits: Limits, start: np.ndarray, build: np.ndarray, jerk: np.ndarray) -> float:
    """By how much of a limit the joints go over, at nodes with the jerk of both sides; inf off the way."""
    s, v, a = start + build @ jerk
    small = 1e-6 * max(float(v.max()), 1e-9)
    if s.max() > path.end + 1e-9 or v.min() < -small or v[-1] > small:
        return np.inf
    q1, q2, q3, _ = (d(np.clip(s, path.begin, path.end)) for d in path.orders)
    v_, a_ = v[:, None], a[:, None]
    over = max(
        np.abs(q1 * v_ / limits.velocity).max(), np.abs((q1 * a_ + q2 * v_**2) / limits.acceleration).max()
    )
    rest = 3 * q2 * v_ * a_ + q3 * v_**3
    for side in (slice(0, -1), slice(1, None)):
        over = max(over, np.abs((q1[side] * jerk[:, None] + rest[side]) / limits.jerk).max())
    return float(over) - 1.0


def _improved(
    path: Way, limits: Limits, start: np.ndarray, build: np.ndarray, jerk: np.ndarray
) -> np.ndarray | None:
    """The jerks that overstep least, everything linearised about ``jerk``."""
    s, v, a = start + build @ jerk
    inside = np.clip(s, path.begin, path.end)
    q1, q2, q3, q4 = (d(inside)[:, :, None] for d in path.orders)
    S, V, A = (b[:, None, :] for b in build)  # (K + 1, 1, K)
    v_, a_ = v[:, None, None], a[:, None, None]
    rows, values = [], []

    def add(gradient: np.ndarray, value: np.ndarray, limit: np.ndarray) -> None:
        gradient, value = gradient / limit[None, :, None], value[:, :, 0] / limit
        rows.append(gradient.reshape(-1, STEPS))
        values.append((value - np.einsum("kij,j->ki", gradient, jerk)).ravel())

    add(q2 * v_ * S + q1 * V, q1 * v_, limits.velocity)
    add((q2 * a_ + q3 * v_**2) * S + 2 * q2 * v_ * V + q1 * A, q1 * a_ + q2 * v_**2, limits.acceleration)
    own = np.eye(STEPS)[:, None, :]
    slope = (3 * q3 * v_ * a_ + q4 * v_**3, 3 * q2 * a_ + 3 * q3 * v_**2, 3 * q2 * v_)
    rest = slope[0] * S + slope[1] * V + slope[2] * A
    value = 3 * q2 * v_ * a_ + q3 * v_**3
    for side in (slice(0, -1), slice(1, None)):
        u = jerk[:, None, None]
        add(q2[side] * u * S[side] + q1[side] * own + rest[side], q1[side] * u + value[side], limits.jerk)
    return _solved(np.concatenate(rows), np.concatenate(values), start, build, path.end)


def _solved(
    rows: np.ndarray, values: np.ndarray, start: np.ndarray, build: np.ndarray, end: float
) -> np.ndarray | None:
    """min e with |values + rows u| <= 1 + e, rest at the horizon, never backwards, never past ``end``."""
    scale = float(np.abs(rows).max(axis=0).min())
    own = rows / scale
    ones = -np.ones((len(own), 1))
    matrix = [np.hstack([own, ones]), np.hstack([-own, ones])]
    bound = [1.0 - values, 1.0 + values]
    still = np.zeros((STEPS + 1, 1))
    size = max(float(start[1][0]), 1e-9)
    matrix.append(np.hstack([-build[1] / scale / size, still]))
    bound.append(start[1] / size)
    matrix.append(np.hstack([build[0][-1:] / scale, still[:1]]))
    bound.append(np.array([end - start[0][-1]]))
    equal = np.array([[*(build[1][-1] / scale / size), 0.0], [*(build[2][-1] / scale / size), 0.0]])
    answer = linprog(
        [0.0] * STEPS + [1.0],
        np.vstack(matrix),
        np.concatenate(bound),
        equal,
        [-start[1][-1] / size, -start[2][-1] / size],
        bounds=[(None, None)] * STEPS + [(0.0, None)],
        method="highs",
    )
    return answer.x[:-1] / scale if answer.success else None


def limits_of(axes: Sequence[object]) -> Limits:
    """Limits (5,) of the machine's axes in mm and radians."""
    rows = [axis.limits for axis in axes]  # type: ignore[attr-defined]
    return Limits(*(np.array([getattr(r, n) for r in rows]) for n in ("velocity", "acceleration", "jerk")))
