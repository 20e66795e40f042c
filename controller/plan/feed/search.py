"""The search for the fastest law on a course, from rest or from a state of motion.

Knots by an estimate of the speed, the fastest z = v^2 on them (``barrier``), finer knots by
the times of that law, the fastest z again; then a law of constant jerks through the knots and a
dense check of it. Where a limit is exceeded between knots it is tightened there
and the search goes on from where it was.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from controller.geometry.arrays import Array, Flags, distinct
from controller.plan.feed import barrier, mesh
from controller.plan.feed.bounds import INNER, Bounds, Grid, Shares
from controller.plan.feed.course import FeedCourse, Index
from controller.plan.feed.law import straight, through
from controller.plan.junctions import MARGIN
from controller.plan.surfaces.rates import Derivatives

Law = tuple[Array, Array]  # times (n + 1,) and pieces (n, 6)
Way = tuple[Array, Array]  # places and speeds along a law, (N,) each

ROUNDS = 8
FAR = 0.1  # of the intervals: if an estimate exceeds limits in more, the search begins with another one
# Sought again alone is what is no more than such a share of all intervals: what is not good enough, and so
# many swings of an acceleration before and behind it, in which a law can become another.
FEW, BESIDE = 0.35, 5.0
TIGHTEN_POWER = 1.3
PER_SWING = 12.0  # knots in the time that an axis needs to swing its acceleration up
MIN_KNOTS, MAX_KNOTS = 60, 4000  # between two rests
WIDEST = 3.0  # times as far apart at most, to be no more
MORE_KNOTS = 240  # the least where they are no closer than ...
CLOSE_S = 5e-3  # ... that: the dips of a machine with little jerk are short beside its swings
COARSE = 4.0  # times fewer knots in the first search
COARSE_GAP = 2e-2
SMOOTHING = 1.5  # of the first estimate, in coarse steps
FINE = (1.0018, 1.0025, 1.0135)  # of velocity, acceleration, jerk as the bounds allow them: good enough
LAST = (1.0022, 1.0028, 1.0160)  # the same after all rounds
LEEWAY = (1.0015, 1.0015, 1.008)  # the same, just behind a state of motion that may touch a limit ...
LEEWAY_S = 0.15  # ... for so long
REACH = 0.74  # of (v0 + v1)^2 / ds, as an acceleration that changes: at 3/4 the duration stops being real
AT_FEED = 3e-5  # closer to the feed than this share is the feed ...
STEP_TO_FEED = 0.03  # ... and than this share of what the jerk does between two knots


@dataclass(frozen=True, slots=True)
class Excess:
    """Largest share of each limit in each interval, (n,) and (n, axes); 1.0 is the limit itself."""

    velocity: Array
    acceleration: Array
    jerk: Array
    tip: Array  # of its acceleration

    def over(self, fine: tuple[float, float, float]) -> float:
        """At most 1.0 where everything is as ``fine`` as that."""
        return max(float(use.max()) / most for use, most in zip(self._all(), fine, strict=True))

    @property
    def slowing(self) -> float:
        """Factor on time that would bring everything inside."""
        shares = [float(use.max()) / most for use, most in zip(self._all(), FINE, strict=True)]
        return float(max(share ** (1.0 / (k + 1)) for k, share in enumerate(shares)))

    def exceeds(self, fine: tuple[float, float, float]) -> Flags:
        """The intervals in which something is not as ``fine``, (n,)."""
        velocity, acceleration, jerk = fine
        over = (self.velocity > velocity) | (self.tip > acceleration)
        over |= (self.acceleration > acceleration).any(axis=1)
        return np.asarray(over | (self.jerk > jerk).any(axis=1))

    def _all(self) -> tuple[Array, Array, Array]:
        return self.velocity, np.append(self.acceleration, self.tip), self.jerk


class Looked(NamedTuple):
    """A law, and how much of each limit it uses."""

    law: Law
    excess: Excess

    @property
    def over(self) -> float:
        """At most 1.0 where it is good enough."""
        return self.excess.over(FINE)

    def near(self, reach_s: float) -> Flags:
        """The intervals that begin within such a time of one that is not good enough, (n,)."""
        return np.asarray(mesh.time_away(self.law[0][:-1:2], self.excess.exceeds(FINE)) <= reach_s)


class Search:
    """The search for the fastest law from a state to rest."""

    def __init__(
        self, course: FeedCourse, s: float, v: float, a: float, last: float, way: Way | None = None
    ) -> None:
        """``way``: of a law that goes on from the same state, if one is known."""
        self.course, self.v, self.a, self._way = course, v, a, way
        self.parts = mesh.Parts.of(course, s, last)
        self.samples = mesh.survey(self.parts, v, a)
        self.from_rest = v == 0.0

    def law(self) -> Law | None:
        """None where the state of motion cannot be continued; from rest there is always a law.

        But for ways that rest between them: None where they are not to be sought as one.
        """
        speed = mesh.estimate(self.parts, self.samples, self.v, self.a)
        step_s = COARSE * self._step(speed)
        estimated, knots = speed, self._knots(speed, step_s)
        smooth = mesh.smoothed(self.samples, speed, self.a, SMOOTHING * float(np.min(step_s)))
        speed = np.minimum(smooth, speed) if self.from_rest else smooth
        bounds = self._bounds_at(*knots, estimated) if len(knots[0]) <= self._most else None
        found = self._of_row(speed) if bounds is None else self._sought(bounds, speed)
        if found is None and self._has_start:
            found = self._sought(bounds or self._bounds_at(*knots, estimated), speed, slowly=True)
        careful = found is None and self.from_rest and not self.course.rests
        return self._careful() if careful else found

    def _sought(self, bounds: Bounds, speed: Array, slowly: bool = False) -> Law | None:
        """``slowly``: from a law inside all limits, which takes more steps and cannot fail to lead on."""
        found = self._coarse(bounds, speed, slowly)
        if found is None or (found.stuck and self.from_rest and not slowly):
            return None
        speed = self._speed(bounds, found.c)
        bounds = self._bounds(speed, self._step(speed))
        begun = self._begun(bounds, speed, slowly)
        return None if begun is None else self._refine(bounds, begun[1])

    def _of_row(self, speed: Array) -> Law | None:
        """Of so many short parts that no knots are coarse: those of a fine search from the beginning.

        Most parts are one wide interval, so what is found coarsely tells already where it is too fast.
        """
        bounds = self._bounds(speed, self._step(speed))
        found = self._coarse(bounds, speed)
        return None if found is None or found.stuck else self._refine(bounds, found.c, found, few=True)

    def _coarse(self, bounds: Bounds, speed: Array, slowly: bool = False) -> barrier.Point | None:
        """What is found from about ``speed`` to a coarse gap."""
        begun = self._begun(bounds, speed, slowly)
        return None if begun is None else barrier.solve(*begun, None, COARSE_GAP)

    def _begun(self, bounds: Bounds, speed: Array, slowly: bool) -> tuple[barrier.Limits, Array] | None:
        """All of the limits, and coefficients of about ``speed`` or, where those are too far outside, inside.

        Out of motion the first of these are those of the law so far.
        """
        c = self._coefficients(bounds, speed)
        if not (c > 0.0).all():
            return None  # it brakes so hard that it would stand before the first knot
        limits = bounds.limits(Shares.full(*bounds.velocity.shape), c[1:-1])
        if self._has_start and (slowly or barrier.outside(limits, c) > FAR):
            held, c = c[:2], barrier.inside(limits, c)
            if self._way is not None and not self.from_rest:
                before = np.interp(self.samples.s, *self._way, right=0.0)
                c = np.maximum(c, self._coefficients(bounds, before))
                c[:2] = held
        return limits, c

    @property
    def _has_start(self) -> bool:
        return self.from_rest or self._way is not None

    def _careful(self) -> Law:
        """The closed form for the worst place of all: each part of a limit's sum may use a share of it."""
        d = self.parts.derivatives(self.samples.s, self.samples.part)
        m1, m2, m3 = (np.abs(q).max(axis=0) + 1e-30 for q in (d.first, d.second, d.third))
        some = [self.course.limits[k] for k in distinct(self.parts.index)]
        velocity, most_a, most_j = (
            np.min([getattr(limit, which) for limit in some], axis=0)
            for which in ("velocity", "acceleration", "jerk")
        )
        inner = self.parts.index[:-1][np.diff(self.parts.index) != 0]
        low = min((self.course.junction(int(k)) for k in inner), default=np.inf)
        by_joints = np.minimum(
            np.minimum(velocity / m1, np.sqrt(most_a / m2 / 2.0)), np.cbrt(most_j / m3 / 4.0)
        )
        v = float(min(by_joints.min(), self.samples.feed.min(), low))
        a = float(np.minimum(most_a / m1 / 2.0, most_j / m2 / v / 12.0).min())
        s = self.samples.s
        made = straight(float(s[-1] - s[0]), v, a, float((most_j / m1).min()) / 4.0)
        pieces = np.array(made.coefficients)
        pieces[:, 0] += s[0]
        return np.array(made.knots_s), pieces

    def _refine(
        self, bounds: Bounds, c: Array, point: barrier.Point | None = None, few: bool = False
    ) -> Law | None:
        """From about ``c``, in all intervals and then only where a limit is exceeded, if that is in few.

        ``point``: what was found there to a coarse gap. ``few``: as ``barrier.solve`` has it, while it helps.
        """
        shares, z = self._shares(bounds, c), c[1:-1].copy()
        if point is not None:
            _tighten(shares, self._looked(bounds, c).excess)
            if self.from_rest:
                c, point = barrier.inside(bounds.limits(shares, z), c), None
        best: Looked | None = None
        near, reach_s = np.ones(len(z), dtype=bool), BESIDE * self._swing_s
        for _ in range(ROUNDS):
            limits = bounds.limits(shares, z)
            if point is not None and near.mean() < FEW:
                point = barrier.solve_near(limits, point, near, few)
            else:
                point = barrier.solve(limits, c, point, few=few)
            if point.stuck:
                break
            c = point.c
            looked = self._looked(bounds, c)
            helped = best is None or looked.over < best.over
            best = looked if best is None or helped else best
            if looked.over <= 1.0:
                break
            again = bounds.grid.of_ways(looked.excess.exceeds(FINE))
            _tighten(shares, looked.excess, again)
            few = few and helped
            near = (looked.near(reach_s) & again if helped else again)[bounds.grid.own]
            rests = bounds.grid.spline_rests  # what is near one of its sides is near both
            near[rests - 1] = near[rests] = near[rests - 2] | near[rests + 1]
        if best is None or best.excess.over(LAST) <= 1.0:
            return None if best is None else best.law
        slower = self.from_rest and not self.course.rests  # one way should not slow down all
        return _slowed(best.law, best.excess.slowing) if slower else None

    def _looked(self, bounds: Bounds, c: Array) -> Looked:
        law = self._law(bounds, c)
        return Looked(law, self._excess(bounds, *law))

    def _shares(self, bounds: Bounds, c: Array) -> Shares:
        """All of every limit, and a little more just behind a state of motion."""
        shares = Shares.full(*bounds.velocity.shape)
        if not self.from_rest:
            s, v, _ = self._states(bounds, c)
            near = mesh.times(s, v)[:-1] < LEEWAY_S
            for share, more in zip((shares.velocity, shares.acceleration, shares.jerk), LEEWAY, strict=True):
                share[near] *= more
        return shares

    def _step(self, speed: Array) -> Array | float:
        """Time between knots at each sample: it depends on how long the whole way between two rests takes."""
        way = np.searchsorted(self.parts.rests, self.samples.part)
        ends = np.append(np.flatnonzero(np.diff(way)), len(way) - 1)
        duration = np.diff(mesh.times(self.samples.s, speed)[ends], prepend=0.0)
        least = np.minimum(np.maximum(duration / MORE_KNOTS, CLOSE_S), duration / MIN_KNOTS)
        return np.asarray(np.minimum(max(self._swing_s / PER_SWING, mesh.FINEST_S), least)[way])

    @cached_property
    def _swing_s(self) -> float:
        """The time that the quickest swing of an acceleration to its limit takes."""
        return float((self.samples.acceleration / self.samples.jerk).min())

    @property
    def _most(self) -> int:
        """Knots, of all ways between rests."""
        return MAX_KNOTS * (1 + len(self.course.rests))

    def _bounds(self, speed: Array, step_s: Array | float) -> Bounds:
        return self._bounds_at(*self._knots(speed, step_s), speed)

    def _bounds_at(self, s: Array, part: Index, speed: Array) -> Bounds:
        about = np.interp(s, self.samples.s, speed)
        return Bounds(Grid.of(self.parts, s, part, self.from_rest), about)

    def _knots(self, speed: Array, step_s: Array | float) -> tuple[Array, Index]:
        return mesh.knots(self.samples, speed, step_s, self._most, WIDEST)

    def _coefficients(self, bounds: Bounds, speed: Array) -> Array:
        """Coefficients of about ``speed`` at the samples."""
        t = bounds.grid.knots
        middles = np.concatenate([t[:1], 0.5 * (t[1:] + t[:-1]), t[-1:]])
        c = np.maximum(np.interp(middles, self.samples.s, speed), 1e-6 * speed.max()) ** 2
        if not self.from_rest:
            c[0], c[1] = bounds.spline.held(self.v, self.a)
        return np.asarray(c)

    def _speed(self, bounds: Bounds, c: Array) -> Array:
        """Speed at the samples of the law of ``c``; from and to rest v goes with s^(2/3)."""
        at, s, f = self.samples.s, bounds.grid.s, bounds.spline
        i = np.clip(np.searchsorted(bounds.grid.knots, at, side="right") - 1, 0, len(f.width) - 1)
        x = at - bounds.grid.knots[i]
        z = f.z_start.of(c)[i] + x * (f.slope_start.of(c)[i] + x * 0.5 * f.bend.of(c)[i])
        found = np.sqrt(np.maximum(z, 0.0))
        _, v, _ = self._states(bounds, c)
        inner = bounds.grid.rests.tolist()
        for k in ([0] if self.from_rest else []) + inner:
            near = (at >= s[k]) & (at < s[k + 1])
            found[near] = v[k + 1] * ((at[near] - s[k]) / (s[k + 1] - s[k])) ** (2 / 3)
        for k in (*inner, len(s) - 1):
            near = (at > s[k - 1]) & (at <= s[k])
            found[near] = v[k - 1] * ((s[k] - at[near]) / (s[k] - s[k - 1])) ** (2 / 3)
        return found

    # --- the law

    def _states(self, bounds: Bounds, c: Array) -> tuple[Array, Array, Array]:
        """s, v and a at the knots."""
        f, s = bounds.spline, bounds.grid.s
        z = np.append(f.z_start.of(c), f.z_end.of(c)[-1])
        slope = np.append(f.slope_start.of(c), f.slope_end.of(c)[-1])
        rests = bounds.grid.spline_rests
        z[rests - 1], slope[rests - 1] = (f.of(c)[rests - 2] for f in (f.z_end, f.slope_end))
        z[rests] = slope[rests] = 0.0
        v, a = np.sqrt(z), 0.5 * slope
        if self.from_rest:
            v, a = np.append(0.0, v), np.append(0.0, a)
        else:
            v[0], a[0] = self.v, self.a
        return s, np.append(v, 0.0), np.append(a, 0.0)

    def _law(self, bounds: Bounds, c: Array) -> Law:
        """The law through the knots; where the feed is nearly met, it is met to the last bit."""
        s, v, a = self._states(bounds, c)
        feed = np.full(len(s), np.inf)
        feed[1:] = bounds.feed
        feed[:-1] = np.minimum(feed[:-1], bounds.feed)
        even = np.append(True, np.isclose(bounds.feed[1:], bounds.feed[:-1], rtol=1e-12, atol=0.0))
        near = self._near_feed(bounds, v, feed)
        met = (v >= feed - near) & (v <= feed + near)
        met[:-1] &= even
        if not self.from_rest:
            met[0] = False
        v[met], a[met] = feed[met], 0.0
        return through(s, v, _within_reach(s, v, _without_overshoot(s, v, a, met)))

    def _near_feed(self, bounds: Bounds, v: Array, feed: Array) -> Array:
        """How near to the feed a speed is the feed, (n + 1,).

        Knots may be so close together that the step to it would take more than all of the jerk.
        """
        grid = bounds.grid
        jerk = (bounds.jerk / (np.abs(grid.starts.first) + 1e-30)).min(axis=1)
        step = jerk * (np.diff(grid.s) / np.maximum(v[1:], v[:-1])) ** 2
        step = np.minimum(np.append(step, np.inf), np.append(np.inf, step))
        near = AT_FEED * np.where(np.isfinite(feed), feed, 0.0)
        return np.asarray(np.minimum(near, STEP_TO_FEED * step))

    # --- the check between knots

    def _excess(self, bounds: Bounds, times: Array, pieces: Array) -> Excess:
        """How much of each limit the law uses: at both ends of each interval and inside it."""
        grid = bounds.grid
        most = [np.zeros_like(bounds.velocity) for _ in range(3)]
        limits = bounds.velocity, bounds.acceleration, bounds.jerk
        width = np.diff(grid.s)
        shares = (0.0, *INNER, 1.0)
        for share, d in zip(shares, (grid.starts, *grid.inner, grid.ends), strict=True):
            v, a, j = _at_place(times, pieces, grid.s[:-1] + share * width, share)
            for k, asked in enumerate((d.velocity(v), d.acceleration(v, a), d.jerk(v, a, j))):
                most[k] = np.maximum(most[k], np.abs(asked) / limits[k])
        d, (v, half_a) = _where_jerk_steps(bounds, pieces), pieces[1::2, 1:3].T
        for j in (6.0 * pieces[0::2, 3], 6.0 * pieces[1::2, 3]):
            most[2] = np.maximum(most[2], np.abs(d.jerk(v, 2.0 * half_a, j)) / limits[2])
        return Excess(most[0].max(axis=1), most[1], most[2], self._tip_use(bounds, times, pieces))

    def _tip_use(self, bounds: Bounds, times: Array, pieces: Array) -> Array:
        """The largest share of the tip's acceleration limit in each interval, (n,)."""
        grid, limit = bounds.grid, self.course.machine.tip_acceleration_mm_s2
        use = np.zeros(len(grid.part))
        if limit is None:
            return use
        for share, tool in zip((0.0, *INNER, 1.0), grid.tool, strict=True):
            v, a, _ = _at_place(times, pieces, grid.s[:-1] + share * np.diff(grid.s), share)
            use = np.maximum(use, tool.tip_acceleration(v, a) / (MARGIN * limit))
        return use


def _where_jerk_steps(bounds: Bounds, pieces: Array) -> Derivatives:
    """Where in each interval the second piece begins: by the parabolas through the inner places."""
    s, (p, q, r) = bounds.grid.s, INNER
    x = np.clip((pieces[1::2, 0] - s[:-1]) / np.diff(s), 0.0, 1.0)[:, None]
    shares = (
        (x - q) * (x - r) / ((p - q) * (p - r)),
        (x - p) * (x - r) / ((q - p) * (q - r)),
        (x - p) * (x - q) / ((r - p) * (r - q)),
    )
    rows = ([d.first, d.second, d.third] for d in bounds.grid.inner)
    orders = zip(*rows, strict=True)
    return Derivatives(*(sum(w * q for w, q in zip(shares, one, strict=True)) for one in orders))


def _slowed(law: Law, factor: float) -> Law:
    """Everything slower: scales velocity, acceleration and jerk by 1, 2 and 3 powers."""
    times, pieces = law
    return times * factor, pieces / factor ** np.arange(6)[None, :]


def _without_overshoot(s: Array, v: Array, a: Array, met: npt.NDArray[np.bool_]) -> Array:
    """Beside a knot that meets the feed, no more acceleration than can end there: 2 dv / dt."""
    most = 2.0 * np.abs(np.diff(v)) * np.maximum(v[1:], v[:-1]) / np.diff(s)
    a = a.copy()
    into, out = met[1:] & ~met[:-1], met[:-1] & ~met[1:]
    a[:-1][into] = np.clip(a[:-1][into], -most[into], most[into])
    a[1:][out] = np.clip(a[1:][out], -most[out], most[out])
    return a


def _within_reach(s: Array, v: Array, a: Array) -> Array:
    """Beside a knot that is passed all but at rest: no change of acceleration for which there is no duration.

    From rest v goes with s^(2/3), z not with a parabola: the square root in ``through`` must be real.
    """
    most = REACH * (v[1:] + v[:-1]) ** 2 / np.diff(s)
    over = np.flatnonzero(np.diff(a) > most)
    if not len(over):
        return a
    a = a.copy()
    up = v[over + 1] > v[over]
    fast, slow = np.where(up, over + 1, over), np.where(up, over, over + 1)
    a[fast] = a[slow] + np.where(up, 1.0, -1.0) * most[over]
    return a


def _at_place(times: Array, pieces: Array, s: Array, share: float) -> tuple[Array, Array, Array]:
    """v, a and jerk in each interval, two pieces each, at the place ``s``."""
    second = np.full(len(s), share > 0.5) if share in (0.0, 1.0) else s >= pieces[1::2, 0]
    row = np.where(second[:, None], pieces[1::2], pieces[0::2]).T
    span = np.where(second, np.diff(times)[1::2], np.diff(times)[0::2])
    t = span * share if share in (0.0, 1.0) else 0.5 * span
    for _ in range(0 if share in (0.0, 1.0) else 7):
        far = row[0] + t * (row[1] + t * (row[2] + t * row[3])) - s
        speed = row[1] + t * (2.0 * row[2] + t * 3.0 * row[3])
        t = np.clip(t - far / np.maximum(speed, 1e-30), 0.0, span)
    return row[1] + t * (2 * row[2] + t * 3 * row[3]), 2 * row[2] + t * 6 * row[3], 6 * row[3]


def _tighten(shares: Shares, excess: Excess, here: Flags | None = None) -> None:
    """Limits lowered where they were exceeded, and a little at the neighbours, to which it would move.

    ``here`` (n,): in no other intervals.
    """

    def less(over: Array) -> Array:
        over = over if here is None else (over.T * here).T
        wide = np.maximum(over, 1.0)
        wide[1:] = np.maximum(wide[1:], over[:-1] ** 0.3)
        wide[:-1] = np.maximum(wide[:-1], over[1:] ** 0.3)
        return np.asarray(wide**TIGHTEN_POWER)

    shares.velocity /= less(excess.velocity)
    shares.acceleration /= less(excess.acceleration)
    shares.jerk /= less(excess.jerk)
    shares.tip /= less(excess.tip)
