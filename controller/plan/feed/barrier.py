"""The fastest z(s) = v^2 under all limits: an interior-point method on a quadratic spline.

z has coefficients c[0] .. c[m + 1] over m intervals, three to an interval, so that all
limits are linear forms of three neighbours:

    acceleration   | q'' z + q' z' / 2 |                      <=  A
    jerk           | q''' z + 3/2 q'' z' + q' z'' / 2 |       <=  J z^(-1/2)

Time, the integral of z^(-1/2), is convex. Jerk is not a convex limit, but J z^(-1/2) is
a convex function and lies above its tangent; with the tangent in its place no step leaves
what is allowed, and the tangent moves along with the iterate.

Every limit is elastic: it may be exceeded at a price that is far above what any time gained
is worth. So every start is a start, also one from a motion that a limit just touches,
and what cannot be helped (a feed that was lowered while moving) is done as quickly as can be.

Newton's matrix has five diagonals, and a step costs time proportional to the intervals.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from controller.geometry.arrays import Array, Flags
from controller.plan import banded

Index = npt.NDArray[np.intp]

GAP = 1e-5  # share of the time that may be left on the table when the search ends
MAX_STEPS = 150
PRICE = 10.0  # of exceeding one limit by its whole size in one interval, in times of the law
STEP_OF_NOTHING, MAX_IDLE = 2e-3, 6  # share of a step that is none, and how many of them in a row
MOST_USED = 2  # limits of an interval, and of jerk at a place of it, where there are to be few
MIN_PRICE = 1e-12  # of what is no limit
SOFT = 1.0  # the same of all of a cap that is exceeded to begin with
MAX_CHANGE = 0.15  # of z in one step, while the walls may come nearer
SLIGHT = 0.02  # of a limit: what exceeds it by more is outside
FLOOR = 3.0  # weight of keeping z positive, among all limits
MAX_GROWTH = 3.0  # of z in one step
TO_WALL = 0.95  # of the way to the nearest wall that a step may go


@dataclass(frozen=True, slots=True)
class Form:
    """Coefficients of c[i], c[i + 1], c[i + 2] in interval i; arrays (..., m)."""

    low: Array
    mid: Array
    high: Array

    def of(self, c: Array) -> Array:
        return self.low * c[:-2] + self.mid * c[1:-1] + self.high * c[2:]


class Ties(NamedTuple):
    """Coefficients ``of`` (k,), in order, that are ``factor`` (k,) times a neighbour."""

    of: Index
    factor: Array

    def among(self, which: Index, free: Flags) -> Ties:
        """Those of them that are ``free`` (n,) among the coefficients ``which`` (n,)."""
        here = np.flatnonzero(np.isin(which, self.of) & free)
        return Ties(here, self.factor[np.searchsorted(self.of, which[here])])

    def and_at(self, place: int, factor: float) -> Ties:
        """With one more, in front of the others or behind them."""
        at = 0 if place == 0 else len(self.of)
        return Ties(np.insert(self.of, at, place), np.insert(self.factor, at, factor))


@dataclass(frozen=True, slots=True)
class Limits:
    """What the spline must keep; all limits are scaled to 1 where they are linear.

    ``straight`` (R, m) and ``jerk`` (K, m) are one-sided: straight(c) <= 1, jerk(c) <= ``most`` z^(-1/2)
    with z = ``at``(c) and ``most`` (P, m): the rows of jerk belong to places of each interval, as many to
    the first as to each other one. ``cap`` (m + 2,) bounds the coefficients themselves; inf = no bound.
    """

    time: Form  # z at places of each interval, (P, m): time is the sum of width z^(-1/2)
    width: Array  # (m,) that each place stands for
    straight: Form
    jerk: Form
    at: Form
    most: Array
    cap: Array
    cap_price: Array  # (m + 2,) of exceeding it: PRICE, or less where it cannot be helped
    starts: Ties  # c[i] = factor * c[i + 1], where a law begins at rest; without c[0]: that and c[1] are held
    ends: Ties  # c[i] = factor * c[i - 1], where one comes to rest
    held: Flags | None = None  # (m + 2,) coefficients that stay as they are


class Left(NamedTuple):
    """What coefficients leave of each limit, without its excess, and z where jerk is looked at."""

    rows: Array
    cap: Array
    z: Array


@dataclass(slots=True)
class Point:
    """An iterate: coefficients, excesses and prices of all limits, rows of intervals and of the cap."""

    c: Array
    left: Left
    excess: Array
    price: Array
    cap_excess: Array
    cap_price: Array
    steps: int = 0
    gap: float = 1.0
    unit: float = 1.0  # s: the time that prices and the gap are shares of
    stuck: bool = False  # no step leads on


def solve(
    limits: Limits,
    c: Array,
    before: Point | None = None,
    gap: float = GAP,
    few: bool = False,
    unit: float | None = None,
) -> Point:
    """The fastest coefficients, from any positive ones; ``before`` is a solution under similar limits.

    ``few``: of each interval's limits only those that ``c``, nearly the solution, uses most are kept: most
    rows of all are limits far away. ``unit``: of the time, left out the time of ``c``.
    """
    if not few:
        return _Solver(limits).run(c, before, gap, unit)
    rows = _Rows.most_used(limits, c)
    if before is not None:
        before = replace(before, price=np.take_along_axis(before.price, rows.which, axis=0))
    point = _Solver(rows.limits).run(c, before, gap, unit)
    price = np.full((rows.many, len(limits.width)), MIN_PRICE)
    np.put_along_axis(price, rows.which, point.price, axis=0)
    return replace(point, price=price)


def solve_near(limits: Limits, before: Point, near: Flags, few: bool = False) -> Point:
    """As ``solve`` after ``before`` in the intervals ``near`` (m,) alone; all others stay as they are."""
    part = _Part.of(limits, before.c, near)
    inner, whole, found = part.which >= 0, _Solver(limits), _Solver(part.limits)
    cap_price = np.full(len(before.c), np.nan)
    cap_price[whole.capped] = before.cap_price
    price = np.where(inner, before.price[:, part.which], MIN_PRICE)
    begun = replace(before, price=price, cap_price=cap_price[part.coefficients][found.capped])
    point = solve(part.limits, before.c[part.coefficients], begun, GAP, few, before.unit)
    made = replace(before, c=before.c.copy(), price=before.price.copy(), stuck=point.stuck)
    made.c[part.coefficients] = point.c
    made.price[:, part.which[inner]] = point.price[:, inner]
    cap_price[part.coefficients[found.capped]] = point.cap_price
    made.cap_price = cap_price[whole.capped]
    return made


class _Rows(NamedTuple):
    """Of each interval some limits of so ``many``: ``which`` (r, m), in the order of a solution's prices."""

    limits: Limits
    which: Index
    many: int

    @staticmethod
    def most_used(limits: Limits, c: Array) -> _Rows:
        """``MOST_USED`` of the straight ones, and of those of jerk at each place."""
        count, places = len(limits.straight.low), len(limits.most)
        straight = _most_used(limits.straight.of(c))
        jerk = _most_used(_jerk_use(limits, c)).swapaxes(0, 1)
        jerk = jerk + len(limits.jerk.low) // places * np.arange(places)[:, None, None]
        jerk = jerk.reshape(-1, jerk.shape[-1])
        some = replace(limits, straight=_rows(limits.straight, straight), jerk=_rows(limits.jerk, jerk))
        return _Rows(some, np.concatenate([straight, count + jerk]), count + len(limits.jerk.low))


def _most_used(use: Array) -> Index:
    """Rows of the largest ``use`` (R, ...)."""
    return np.asarray(np.argpartition(-use, min(MOST_USED, len(use)) - 1, axis=0)[:MOST_USED])


def _rows(form: Form, which: Index) -> Form:
    return Form(*(np.take_along_axis(value, which, axis=0) for value in (form.low, form.mid, form.high)))


class _Part(NamedTuple):
    """Some runs of intervals behind each other, with two of no limits and no time between two runs.

    ``which`` (n,) are the intervals, -1 those between; ``coefficients`` (n + 2,) belong to them, and the two
    at both ends of each run are held.
    """

    limits: Limits
    which: Index
    coefficients: Index

    @staticmethod
    def of(limits: Limits, c: Array, near: Flags) -> _Part:
        firsts = np.flatnonzero(np.diff(near, prepend=False) & near)
        lasts = np.flatnonzero(np.diff(near, append=False) & near) + 1
        runs = list(zip(firsts.tolist(), lasts.tolist(), strict=True))
        of = np.concatenate([np.arange(a, b + 2) for a, b in runs])
        which = np.concatenate([np.append(np.arange(a, b), (-1, -1)) for a, b in runs])[:-2]
        held = np.concatenate([np.isin(np.arange(b - a + 2), (0, 1, b - a, b - a + 1)) for a, b in runs])
        if runs[0][0] == 0:
            held[:2] = False
        if runs[-1][1] == len(near):
            held[-2:] = False
        starts, ends = limits.starts.among(of, ~held), limits.ends.among(of, ~held)
        if held[0]:
            starts = starts.and_at(0, c[of[0]] / c[of[1]])
        if held[-1]:
            ends = ends.and_at(len(of) - 1, c[of[-1]] / c[of[-2]])
        time, at = (_columns(form, which, 1.0) for form in (limits.time, limits.at))
        straight, jerk = (_columns(form, which, 0.0) for form in (limits.straight, limits.jerk))
        width = np.where(which < 0, 0.0, limits.width[which])
        cap, price = limits.cap[of], limits.cap_price[of]
        most = limits.most[:, which]
        made = Limits(time, width, straight, jerk, at, most, cap, price, starts, ends, held)
        return _Part(made, which, of)


def _columns(form: Form, which: Index, mid: float) -> Form:
    """A form in some intervals, and ``mid`` times the middle coefficient in those of -1."""
    none = which < 0
    low, high = (np.where(none, 0.0, value[:, which]) for value in (form.low, form.high))
    return Form(low, np.where(none, mid, form.mid[:, which]), high)


def outside(limits: Limits, c: Array) -> float:
    """The share of intervals in which coefficients exceed a limit."""
    over = (limits.straight.of(c) > 1.0 + SLIGHT).any(axis=0)
    return float((over | (_jerk_use(limits, c) > 1.0 + SLIGHT).any(axis=(0, 1))).mean())


def inside(limits: Limits, c: Array) -> Array:
    """Coefficients of a law from rest, scaled evenly to where every limit leaves room."""
    most = max(
        float(limits.straight.of(c).max()),
        float(_jerk_use(limits, c).max()) ** (2.0 / 3.0),
        float((c[1:-1] / limits.cap[1:-1]).max()),
    )
    return np.asarray(c * (0.7 / max(most, 0.7)))


def _jerk_use(limits: Limits, c: Array) -> Array:
    return np.asarray(_by_place(limits.jerk.of(c), limits.most) * np.sqrt(limits.at.of(c)) / limits.most)


class _Solver:
    def __init__(self, limits: Limits) -> None:
        self.l = limits
        s, j = limits.straight, limits.jerk
        self.forms = Form(
            *(np.concatenate(pair) for pair in ((s.low, j.low), (s.mid, j.mid), (s.high, j.high)))
        )
        self.rows = len(s.low)
        self.free = np.ones(len(limits.cap), dtype=bool)
        self.free[0] = self.free[limits.starts.of] = self.free[limits.ends.of] = False
        if 0 not in limits.starts.of:
            self.free[1] = False
        if limits.held is not None:
            self.free[limits.held] = False
        self.capped = np.flatnonzero(self.free & np.isfinite(limits.cap))
        self.cap, self.cap_most = limits.cap[self.capped], limits.cap_price[self.capped]
        self.count = self.forms.low.size + len(self.capped)

    def closed(self, c: Array) -> Array:
        """The coefficients with those beside rests as they depend on their neighbours."""
        for (of, factor), side in ((self.l.starts, 1), (self.l.ends, -1)):
            c[of] = factor * c[of + side]
        return c

    def left(self, c: Array) -> Left:
        found, z = -self.forms.of(c), self.l.at.of(c)
        found[: self.rows] += 1.0
        by_place = _by_place(found[self.rows :], z)
        by_place += self.l.most / np.sqrt(z)
        return Left(found, 1.0 - c[self.capped] / self.cap, z)

    def start(self, c: Array, before: Point | None, unit: float | None) -> Point:
        c = self.closed(c.copy())
        left = self.left(c)
        self.unit = unit or float((self.l.width / np.sqrt(self.l.time.of(c))).sum())
        self.mu = (0.5 if before is None else 0.02) / self.count
        excess, price = self.centred(left.rows, before.price if before else None, PRICE)
        cap_excess, cap_price = self.centred(left.cap, before.cap_price if before else None, self.cap_most)
        return Point(c, left, excess, price, cap_excess, cap_price, unit=self.unit)

    def centred(self, room: Array, price: Array | None, most: Array | float) -> tuple[Array, Array]:
        """Excess and price of limits: small where there is room, what it takes where there is none."""
        out = room < 0.02
        excess = np.where(out, np.maximum(1.5 * np.abs(room), 0.04), self.mu / most)
        own = np.where(out, 0.5 * most, np.minimum(self.mu / (np.maximum(room, 0.02) + excess), 0.5 * most))
        if price is not None:
            excess = np.maximum(2e-3 - room, self.mu / most)
            own = np.clip(price, np.minimum(self.mu / (room + excess), 0.5 * most), 0.999 * most)
        return excess, own

    def run(self, c: Array, before: Point | None, gap: float, unit: float | None) -> Point:
        p, idle = self.start(c, before, unit), 0
        for p.steps in range(1, MAX_STEPS + 1):
            share, change = self.step(p)
            idle = idle + 1 if share < STEP_OF_NOTHING else 0
            if idle >= MAX_IDLE:
                p.stuck = True
                break
            aim = gap * float((self.l.width / np.sqrt(self.l.time.of(p.c))).sum()) / self.unit
            if share > 0.7 and p.gap < aim and change < 1e-3:
                break
            if change < MAX_CHANGE:
                fall = 0.2 if share > 0.9 else 0.4 if share > 0.5 else 1.0
                self.mu = max(self.mu * fall, 0.2 * aim / self.count)
        return p

    def step(self, p: Point) -> tuple[float, float]:
        """One Newton step; the share of it that was taken, and the largest relative change of z."""
        rows = _Pull.of(p.left.rows + p.excess, p.excess, p.price, PRICE, self.mu)
        cap = _Pull.of(p.left.cap + p.cap_excess, p.cap_excess, p.cap_price, self.cap_most, self.mu)
        low, mid, high = self.gradients(p.left.z)
        band, right = self.time(p)
        _add(band, right, rows.weight, p.price + rows.push, low, mid, high)
        band[2, self.capped] += cap.weight / self.cap**2
        right[self.capped] -= (p.cap_price + cap.push) / self.cap
        # z is positive: a barrier of its own keeps steps from running into the wall.
        band[2] += FLOOR * self.mu / p.c**2
        right += FLOOR * self.mu / p.c
        dc = self.newton(band, right)
        return self.move(
            p,
            dc,
            rows.moved(low * dc[:-2] + mid * dc[1:-1] + high * dc[2:], p.excess, p.price, self.mu),
            cap.moved(-dc[self.capped] / self.cap, p.cap_excess, p.cap_price, self.mu),
        )

    def gradients(self, z: Array) -> tuple[Array, Array, Array]:
        """Of what is left of each limit, with respect to the three coefficients."""
        low, mid, high = -self.forms.low, -self.forms.mid, -self.forms.high
        at = self.l.at
        tangent = -0.5 * self.l.most * z**-1.5
        for value, form in ((low, at.low), (mid, at.mid), (high, at.high)):
            by_place = _by_place(value[self.rows :], z)
            by_place += tangent * form
        return low, mid, high

    def time(self, p: Point) -> tuple[Array, Array]:
        """Band and right-hand side of the time alone, in units of the first law's time."""
        z = self.l.time.of(p.c)
        width = self.l.width / self.unit
        slope, bend = -0.5 * width * z**-1.5, 0.75 * width * z**-2.5
        band, right = np.zeros((3, len(p.c))), np.zeros(len(p.c))
        form = self.l.time
        _add(band, right, bend, -slope, form.low, form.mid, form.high)
        return band, right

    def newton(self, band: Array, right: Array) -> Array:
        """Solves for the free coefficients; those beside rests follow."""
        for (of, factor), side in ((self.l.starts, 1), (self.l.ends, -1)):  # put into the quadratic form
            beside, beyond = of + side, of + 2 * side
            right[beside] += factor * right[of]
            band[2, beside] += factor * factor * band[2, of] + 2.0 * factor * band[1, np.maximum(of, beside)]
            band[1, np.maximum(beside, beyond)] += factor * band[0, np.maximum(of, beyond)]
        fixed = ~self.free
        right[fixed] = 0.0
        band[2, fixed] = 1.0
        band[1, fixed] = band[0, fixed] = 0.0
        after = np.flatnonzero(fixed)
        band[1, after[after + 1 < len(right)] + 1] = 0.0
        band[0, after[after + 2 < len(right)] + 2] = 0.0
        scale = 1.0 / np.sqrt(band[2])
        band[2] = 1.0
        band[1, 1:] *= scale[1:] * scale[:-1]
        band[0, 2:] *= scale[2:] * scale[:-2]
        band[2] += 1e-13
        return self.closed(scale * banded.solve(band, scale * right))

    def move(self, p: Point, dc: Array, rows: _Moves, cap: _Moves) -> tuple[float, float]:
        change = dc / p.c
        primal = max(float(-change.min()), float(change.max()) / MAX_GROWTH, *rows.walls, *cap.walls)
        dual = max(0.0, *rows.price_walls, *cap.price_walls)
        primal = min(1.0, TO_WALL / max(primal, 1e-12))
        dual = min(1.0, TO_WALL / max(dual, 1e-12))
        p.c = self.closed(p.c + primal * dc)
        p.excess, p.cap_excess = p.excess + primal * rows.excess, p.cap_excess + primal * cap.excess
        p.price, p.cap_price = p.price + dual * rows.price, p.cap_price + dual * cap.price
        p.left = self.left(p.c)
        p.cap_excess = np.maximum(p.cap_excess, 1e-12 - p.left.cap)
        p.excess = np.maximum(p.excess, 1e-12 - p.left.rows)
        p.gap = float(((p.left.rows + p.excess) * p.price + p.excess * (PRICE - p.price)).sum())
        held = (p.left.cap + p.cap_excess) * p.cap_price + p.cap_excess * (self.cap_most - p.cap_price)
        p.gap += float(held.sum())
        return min(primal, dual), primal * float(np.abs(dc / p.c).max())


class _Moves(NamedTuple):
    """What a step of 1 does to excess and price of limits, and how many times the way to each wall it is."""

    excess: Array
    price: Array
    walls: tuple[float, float]  # of slack and excess: none of them
    price_walls: tuple[float, float]  # of the price: none, and the most there is


class _Pull(NamedTuple):
    """What limits do to a step: in Newton's matrix, and before the step is known to their own prices."""

    weight: Array  # in the matrix
    push: Array  # of the price
    slack: Array
    per_price: Array  # the slack, over the price
    spare: Array  # by which the price may rise
    short: Array  # of the slack that goes with the price

    @staticmethod
    def of(slack: Array, excess: Array, price: Array, most: Array | float, mu: float) -> _Pull:
        spare, per_price, short = most - price, slack / price, mu / price - slack
        weight = 1.0 / (per_price + excess / spare)
        return _Pull(weight, weight * (short - mu / spare + excess), slack, per_price, spare, short)

    def moved(self, forward: Array, excess: Array, price: Array, mu: float) -> _Moves:
        """``forward``: how the step changes what is left of each."""
        more = self.push - self.weight * forward
        slack = self.short - self.per_price * more
        more_excess = (mu + excess * more) / self.spare - excess
        walls = -(slack / self.slack).min(initial=0.0), -(more_excess / excess).min(initial=0.0)
        prices = -(more / price).min(initial=0.0), (more / self.spare).max(initial=0.0)
        return _Moves(more_excess, more, walls, prices)


def _by_place(rows: Array, places: Array) -> Array:
    """The same rows (K, m) as (K / P, P, m), seen beside ``places`` (P, m)."""
    return rows.reshape(len(places), -1, rows.shape[1]).swapaxes(0, 1)


def _add(band: Array, right: Array, weight: Array, push: Array, low: Array, mid: Array, high: Array) -> None:
    """Adds weight g g' to the upper band and push g to the right-hand side, over rows and intervals."""
    wl, wm = weight * low, weight * mid
    right[:-2] += np.einsum("rm,rm->m", push, low)
    right[1:-1] += np.einsum("rm,rm->m", push, mid)
    right[2:] += np.einsum("rm,rm->m", push, high)
    band[2, :-2] += np.einsum("rm,rm->m", wl, low)
    band[2, 1:-1] += np.einsum("rm,rm->m", wm, mid)
    band[2, 2:] += np.einsum("rm,rm,rm->m", weight, high, high)
    band[1, 1:-1] += np.einsum("rm,rm->m", wl, mid)
    band[1, 2:] += np.einsum("rm,rm->m", wm, high)
    band[0, 2:] += np.einsum("rm,rm->m", wl, high)
