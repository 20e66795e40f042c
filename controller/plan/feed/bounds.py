"""The limits of a course as forms of a spline's coefficients: what the search must keep.

Knots are exactly where the course changes its manners, so every interval lies in one segment and
is judged by the derivatives of its own side. From and to rest, between the last knot and
the standstill, the law is one of constant jerk: there z goes with s^(4/3), so at
the knot z' = 4/3 z / s, which ties the spline's outermost coefficient to its neighbour. A rest inside
of a course is the same from both sides: the two intervals there are the spline's, too, but without limits or
time, so that several laws are sought as one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from controller.geometry.arrays import Array, Flags, within
from controller.plan.feed import tool_limits
from controller.plan.feed.barrier import PRICE, SOFT, Form, Limits, Ties
from controller.plan.feed.course import FeedCourse, Index
from controller.plan.feed.mesh import Parts
from controller.plan.feed.tool_limits import ToolRates
from controller.plan.junctions import JUMP_SHARE, MARGIN, SPREAD
from controller.plan.surfaces.rates import Derivatives

INNER = (0.25, 0.5, 0.75)  # shares of an interval where a law is checked besides its ends
GAUSS = (0.5 - 0.5 / 3.0**0.5, 0.5 + 0.5 / 3.0**0.5)  # shares of an interval at which time is weighed
NEAR_TICKS = 3.0  # a jump that is spread over ticks leaves less of the limits so long
SMOOTH = 1e-3  # of a limit: a jump that uses no more is none
FASTER = 1.5  # than about expected: no faster is a junction passed that follows another within ticks
DEAR = 5.0  # price above a lowered feed, in times of what may be gained there


@dataclass(frozen=True, slots=True)
class Grid:
    """Knots of a law, (n + 1,) from its beginning to its rest, and derivatives at them.

    ``starts``, ``inner`` and ``ends`` belong to the n intervals, each seen from inside; they have a column
    for each of ``axes``, the joints that move anywhere: one that stands keeps its limits whatever the law.
    """

    parts: Parts
    s: Array
    part: Index  # of each interval
    from_rest: bool
    rests: Index  # the knots inside at which it rests
    axes: Index
    starts: Derivatives
    ends: Derivatives
    inner: tuple[Derivatives, ...]
    tool: tuple[ToolRates, ...] = ()  # at starts, inner places and ends, where the machine has such limits

    @staticmethod
    def of(parts: Parts, s: Array, part: Index, from_rest: bool) -> Grid:
        n, width = len(part), np.diff(s)
        sides = np.flatnonzero(np.diff(part, append=-1))  # intervals whose end is not the next one's start
        places = [s[:-1], s[sides + 1], *(s[:-1] + share * width for share in INNER)]
        all_of = np.concatenate([part, part[sides], *[part] * len(INNER)])
        axes, d = _moving(parts.derivatives(np.concatenate(places), all_of))
        after = np.arange(n) + 1
        after[sides] = n + np.arange(len(sides))
        begin = n + len(sides)
        inner = tuple(_part(d, slice(begin + k * n, begin + (k + 1) * n)) for k in range(len(INNER)))
        rests = np.flatnonzero(np.diff(part) * np.isin(part[:-1], parts.rests)) + 1
        tool: tuple[ToolRates, ...] = ()
        if tool_limits.has_limits(parts.course.machine):
            shares = (1e-9, *INNER, 1.0 - 1e-9)
            tool = tuple(
                tool_limits.rates(parts.course, s[:-1] + x * width, parts.index[part]) for x in shares
            )
        return Grid(
            parts, s, part, from_rest, rests, axes, _part(d, slice(0, n)), _part(d, after), inner, tool
        )

    def under(self, parts: Parts) -> Grid:
        """The same knots on a course that only allows more or less."""
        return replace(self, parts=parts)

    @property
    def course(self) -> FeedCourse:
        return self.parts.course

    @property
    def index(self) -> Index:
        """Segment of each interval."""
        return self.parts.index[self.part]

    @property
    def spline_rests(self) -> Index:
        """The same as the spline counts knots: the intervals before and behind each are without limits."""
        return np.asarray(self.rests - self.own.start)

    def of_ways(self, which: Flags) -> Flags:
        """All intervals of the ways between two rests in which some are ``which``, (n,)."""
        way = np.searchsorted(self.rests, np.arange(len(which)), side="right")
        return np.isin(way, way[which])

    @property
    def own(self) -> slice:
        """The intervals that the spline covers: all but those of constant jerk at both ends."""
        return slice(1 if self.from_rest else 0, len(self.part) - 1)

    @property
    def knots(self) -> Array:
        """Of the spline, (m + 1,)."""
        return self.s[1:-1] if self.from_rest else self.s[:-1]


def _moving(d: Derivatives) -> tuple[Index, Derivatives]:
    """The joints that move at any of the places, or all where none does, and their derivatives alone."""
    orders = (d.first, d.second, d.third)
    moves = np.any([order.any(axis=0) for order in orders], axis=0)
    axes = np.flatnonzero(moves if moves.any() else ~moves)
    return axes, Derivatives(*(order[:, axes] for order in orders))


def _part(d: Derivatives, which: slice | Index) -> Derivatives:
    return Derivatives(d.first[which], d.second[which], d.third[which])


@dataclass(frozen=True, slots=True)
class Spline:
    """Forms of z and its derivatives at both ends of each interval, and of z at Gauss's two places."""

    width: Array
    z_start: Form
    z_end: Form
    slope_start: Form
    slope_end: Form
    bend: Form
    gauss: Form  # (2, m)
    starts: Ties
    ends: Ties

    @staticmethod
    def of(grid: Grid) -> Spline:
        t = grid.knots
        h = np.diff(t)
        before = np.concatenate([[t[0] - grid.s[0] if grid.from_rest else h[0]], h[:-1]])
        after = np.concatenate([h[1:], [grid.s[-1] - t[-1]]])
        none, a, b = np.zeros_like(h), before + h, h + after
        z_start, z_end = Form(h / a, before / a, none), Form(none, after / b, h / b)
        slope_start, slope_end = Form(-2.0 / a, 2.0 / a, none), Form(none, -2.0 / b, 2.0 / b)
        bend = _mix((1.0 / h, slope_end), (-1.0 / h, slope_start))
        places = [_mix((1.0, z_start), (x * h, slope_start), (0.5 * (x * h) ** 2, bend)) for x in GAUSS]
        gauss = Form(*(np.stack([getattr(form, name) for form in places]) for name in ("low", "mid", "high")))
        rests = grid.spline_rests
        first = np.append([0] if grid.from_rest else [], rests + 1).astype(
            np.intp
        )  # intervals behind rests ...
        last = np.append(rests - 2, len(h) - 1)  # ... and before them
        starts = Ties(first, 1.0 / (3.0 + 2.0 * (h[first] / before[first])))
        ends = Ties(last + 2, 1.0 / (3.0 + 2.0 * (h[last] / after[last])))
        width, gauss = h.copy(), _at(gauss, rests, 1.0)
        width[rests] = width[rests - 1] = 0.0
        return Spline(width, z_start, z_end, slope_start, slope_end, bend, gauss, starts, ends)

    def held(self, v: float, a: float) -> tuple[float, float]:
        """c[0] and c[1] of a law that begins in motion."""
        return v * v - a * float(self.width[0]), v * v + a * float(self.width[0])


@dataclass(slots=True)
class Shares:
    """How much of each limit every interval may use, (n, axes) or (n,): less where a law was above it."""

    velocity: Array
    acceleration: Array
    jerk: Array
    tip: Array

    @staticmethod
    def full(n: int, axes: int) -> Shares:
        return Shares(np.ones(n), np.ones((n, axes)), np.ones((n, axes)), np.ones(n))


class Bounds:
    """Limits of a grid, for one set of shares after another."""

    def __init__(self, grid: Grid, about: Array | None = None) -> None:
        """``about``: the speed that is expected at the knots, (n + 1,); left out: any."""
        self.grid, self.spline = grid, Spline.of(grid)
        self._about = np.full(len(grid.s), np.inf) if about is None else FASTER * about
        course, n = grid.course, len(grid.part)
        self.velocity, self.acceleration, self.jerk = (
            course.least_limit(grid.s, which, grid.index)[:, grid.axes]
            for which in ("velocity", "acceleration", "jerk")
        )
        self.feed = self._feeds()
        rates = (np.abs(d.first) + 1e-30 for d in (grid.starts, grid.ends))
        self.speed = np.array([(self.velocity / rate).min(axis=1) for rate in rates])  # at both ends, (2, n)
        if grid.tool:
            sides = (grid.tool[0], grid.tool[-1])
            limits = [tool_limits.most_speed(course, side, n) for side in sides]
            self.speed = np.minimum(self.speed, MARGIN * np.array(limits))
        self._jump = np.zeros((2, *self.velocity.shape))  # of q' and q'' at the start of each interval
        self._jump_room = np.ones(self.velocity.shape)  # what the jump of acceleration there may be
        full = self.acceleration, self.jerk
        self.acceleration, self.jerk = full[0].copy(), full[1].copy()
        inner = np.setdiff1d(np.flatnonzero(np.diff(grid.index)), grid.rests - 1)
        gaps = np.diff(grid.s[inner + 1], prepend=-np.inf, append=np.inf)
        for i, gap in zip(inner.tolist(), np.minimum(gaps[1:], gaps[:-1]).tolist(), strict=True):
            self._at_junction(i, gap, full)
        # Jumps that follow each other within ticks do not add up: each has a tick of its own.
        self.acceleration = np.maximum(self.acceleration, (1.0 - JUMP_SHARE) * full[0])
        self.jerk = np.maximum(self.jerk, (1.0 - JUMP_SHARE) * full[1])
        self._forms()

    def _feeds(self) -> Array:
        """Lowest feed in each interval, (n,)."""
        s, part, parts = self.grid.s, self.grid.part, self.grid.parts
        places = (s[:-1], 0.5 * (s[:-1] + s[1:]), s[1:])
        return np.asarray(np.min([parts.feed(at, part) for at in places], axis=0))

    def _at_junction(self, i: int, gap: float, full: tuple[Array, Array]) -> None:
        """The speed between intervals ``i`` and ``i`` + 1, and what a jump there leaves of the limits.

        Where the next junction is but a ``gap`` away that is passed within ticks, as on short lines, the
        speed that the junction allows is often far from what is reached, and what a jump at it would
        take from the lines around is not taken at all.
        """
        grid, T = self.grid, self.grid.course.machine.period_s
        k = int(grid.index[i])
        low, jump = grid.course.junction(k), grid.course.jump(k)
        v = min(low, float(min(self.feed[i], self.feed[i + 1])))
        acceleration, jerk = self.acceleration[i], self.jerk[i]
        if gap < NEAR_TICKS * T * v:
            acceleration, jerk = (most[i] for most in full)
            low = min(low, float(self._about[i + 1]))
            v = min(v, low)
        self.speed[1, i] = self.speed[0, i + 1] = low
        rate, curve = jump.rate[grid.axes] * v, jump.curve[grid.axes] * v * v
        used = (rate / T + SPREAD * curve) / (T * jerk)
        if used.max() < SMOOTH:
            return
        # Signed, so that what the rate and the curve do can cancel out.
        self._jump[0, i + 1] = grid.starts.first[i + 1] - grid.ends.first[i]
        self._jump[1, i + 1] = grid.starts.second[i + 1] - grid.ends.second[i]
        self._jump_room[i + 1] = (JUMP_SHARE * jerk * T - rate / T) / SPREAD
        here = within(grid.s, float(grid.s[i + 1]), NEAR_TICKS * T * v)
        near = np.abs(grid.s[here] - grid.s[i + 1]) <= NEAR_TICKS * T * v
        which = here.start + np.flatnonzero(near[1:] | near[:-1])
        self.acceleration[which] *= 1.0 - np.minimum(rate / (T * acceleration), JUMP_SHARE)
        self.jerk[which] *= 1.0 - np.minimum(used, JUMP_SHARE)

    def _forms(self) -> None:
        f, own = self.spline, self.grid.own
        s, e = _part(self.grid.starts, own), _part(self.grid.ends, own)
        self._acceleration_start = _drive(s, f.z_start, f.slope_start)
        self._acceleration_end = _drive(e, f.z_end, f.slope_end)
        self._jerk_start = _jerk(s, f.z_start, f.slope_start, f.bend)
        self._jerk_end = _jerk(e, f.z_end, f.slope_end, f.bend)

    def limits(self, shares: Shares, z: Array) -> Limits:
        """All limits, scaled to 1 where the spline is about ``z`` (m,) in each interval."""
        f, own, root = self.spline, self.grid.own, np.sqrt(z)
        acceleration = (self.acceleration * shares.acceleration)[own].T
        jerk = (self.jerk * shares.jerk)[own].T / root
        drives = [_over(self._acceleration_end, acceleration), *self._behind_junctions(acceleration)]
        drives += self._tips(shares)
        # The first half of an interval jerks as at a quarter of it, the second as at three.
        early, late = _mix((0.75, f.z_start), (0.25, f.z_end)), _mix((0.25, f.z_start), (0.75, f.z_end))
        caps, none = self._caps(), self.grid.spline_rests
        return Limits(
            f.gauss,
            0.5 * f.width,
            _at(_stacked([*(_both(form) for form in drives), *self._speeds(shares)]), none),
            _at(_stacked([_both(_over(form, jerk)) for form in (self._jerk_start, self._jerk_end)]), none),
            _at(_stacked([_rows_of(form, 1) for form in (early, late)]), none, 1.0),
            np.tile(root, (2, 1)),
            caps,
            self._cap_prices(caps, z),
            f.starts,
            f.ends,
        )

    def _behind_junctions(self, acceleration: Array) -> list[Form]:
        """Acceleration behind a boundary and its jump there; elsewhere the interval before says the same."""
        own, f = self.grid.own, self.spline
        if not self._jump.any():
            return []
        jump = _mix((self._jump[1, own].T, f.z_start), (0.5 * self._jump[0, own].T, f.slope_start))
        return [_over(self._acceleration_start, acceleration), _over(jump, self._jump_room[own].T)]

    def _tips(self, shares: Shares) -> list[Form]:
        """The tip's acceleration at both ends of each interval, along the sides of a polygon."""
        most, f, own = self.grid.course.machine.tip_acceleration_mm_s2, self.spline, self.grid.own
        if most is None or not self.grid.tool:
            return []
        found = []
        limit = most * MARGIN * tool_limits.INSIDE * shares.tip[own]
        angles = np.pi * np.arange(tool_limits.DIRECTIONS)[:, None] / tool_limits.DIRECTIONS
        c, s = np.cos(angles), np.sin(angles)
        for tool, z, slope in (
            (self.grid.tool[0], f.z_start, f.slope_start),
            (self.grid.tool[-1], f.z_end, f.slope_end),
        ):
            bend = c * tool.bend_along[own] + s * tool.bend_across[own]
            found.append(_over(_mix((bend, z), (0.5 * c * tool.along[own], slope)), limit))
        return found

    def _speeds(self, shares: Shares) -> list[Form]:
        f, own = self.spline, self.grid.own
        start, end = ((speed * shares.velocity)[own] ** 2 for speed in self.speed)
        acceleration, jerk = self.acceleration * shares.acceleration, self.jerk * shares.jerk
        for of, z, side in ((f.starts.of, start, 1), (f.ends.of - 2, end, -1)):
            for k in of.tolist():  # the intervals of the grid begin one before those of a spline from rest
                i = k + self.grid.own.start - side
                z[k] = min(z[k], _rest_z(self.grid, i, side, acceleration[i], jerk[i]))
        return [_over(_rows_of(f.z_start, 1), start[None]), _over(_rows_of(f.z_end, 1), end[None])]

    def _caps(self) -> Array:
        """Largest coefficients: nowhere above the feed of any interval that they reach."""
        feed = self.feed[self.grid.own] ** 2
        rests = self.grid.spline_rests
        feed[rests] = feed[rests - 1] = np.inf
        cap = np.full(len(feed) + 2, np.inf)
        for shift in range(3):
            here = cap[shift : shift + len(feed)]
            np.minimum(here, feed, out=here)
        return cap

    def _cap_prices(self, caps: Array, z: Array) -> Array:
        """A motion that begins above the feed, as ``z`` does, is drawn down, never against other limits."""
        prices = np.full(len(caps), PRICE)
        over = np.maximum(np.concatenate([z[:1], z, z[-1:]]) / caps, 0.0)
        far = (
            (np.arange(len(caps)) < np.argmax(over <= 1.0))
            if (over <= 1.0).any()
            else np.ones_like(over, bool)
        )
        if not self.grid.from_rest and far.any():
            weight = np.concatenate([self.spline.width[:1], self.spline.width, self.spline.width[-1:]])
            soft = SOFT * weight / (weight * over)[far].sum()
            # Time that an interval would save above the cap is never worth it.
            saved = weight / np.sqrt(caps) / float((self.spline.width / np.sqrt(z)).sum())
            prices[far] = np.minimum(np.maximum(soft, DEAR * saved), PRICE)[far]
        return prices


def _rest_z(grid: Grid, i: int, sign: int, acceleration: Array, jerk: Array) -> float:
    """z that a constant jerk in interval ``i`` from (``sign`` 1) or to rest (-1) may reach at its other end.

    That is h away: v = 3 h / t, a = 2/3 v^2 / h, j = v^3 / (4.5 h^2).
    """
    inner, rest = (grid.ends, grid.starts) if sign > 0 else (grid.starts, grid.ends)
    h = float(grid.s[i + 1] - grid.s[i])
    drive = np.abs(inner.second[i] + sign * 2.0 / 3.0 * inner.first[i] / h)
    even = inner.first[i] / (4.5 * h * h)
    there = np.abs(inner.third[i] + sign * 2.0 * inner.second[i] / h + even)
    here = np.abs(rest.first[i]) / (4.5 * h * h)
    by_jerk = float((jerk / (np.maximum(there, here) + 1e-30)).min() ** (2.0 / 3.0))
    return min(by_jerk, float((acceleration / (drive + 1e-30)).min()))


def _drive(d: Derivatives, z: Form, slope: Form) -> Form:
    """Joints' acceleration, (axes, m)."""
    return _mix((d.second.T, z), (0.5 * d.first.T, slope))


def _jerk(d: Derivatives, z: Form, slope: Form, bend: Form) -> Form:
    """Joints' jerk over the speed, (axes, m)."""
    return _mix((d.third.T, z), (1.5 * d.second.T, slope), (0.5 * d.first.T, bend))


def _mix(*terms: tuple[Array | float, Form]) -> Form:
    """The sum of forms, each times its factor."""
    low, mid, high = (
        sum((factor * value for factor, value in zip(factors, values, strict=True)), start=np.zeros(1))
        for factors, values in (
            ([k for k, _ in terms], [getattr(form, name) for _, form in terms])
            for name in ("low", "mid", "high")
        )
    )
    return Form(low, mid, high)


def _at(form: Form, rests: Index, mid: float = 0.0) -> Form:
    """The same form, but in the intervals beside ``rests`` ``mid`` times the middle coefficient alone."""
    for i in (rests - 1, rests):
        form.low[..., i], form.mid[..., i], form.high[..., i] = 0.0, mid, 0.0
    return form


def _over(form: Form, limit: Array) -> Form:
    return Form(form.low / limit, form.mid / limit, form.high / limit)


def _both(form: Form) -> Form:
    """The form and its negative: two one-sided limits."""
    return _stacked([form, Form(-form.low, -form.mid, -form.high)])


def _rows_of(form: Form, n: int) -> Form:
    return Form(np.tile(form.low, (n, 1)), np.tile(form.mid, (n, 1)), np.tile(form.high, (n, 1)))


def _stacked(forms: list[Form]) -> Form:
    return Form(
        np.concatenate([form.low for form in forms]),
        np.concatenate([form.mid for form in forms]),
        np.concatenate([form.high for form in forms]),
    )
