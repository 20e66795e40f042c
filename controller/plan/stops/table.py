"""Stops worked out ahead: how to come to rest on the path from wherever the plan is.

    table = stops(course, profile, first_s, last_s, step_s)

The tick must be able to stop without the planner and without thinking. So for every few
milliseconds of a plan a stop is found (``search``), checked (``check``), and
handed over with the plan. Where the first search fails others follow: with other shares of the
limits, and with ramps up to where a search was stuck. Of the stops that pass the
shortest is taken.

Where nothing passes the table has an empty row: nearly always because the plan already brakes to
its rest as hard as it can, and a stop would end behind that rest.
"""

from __future__ import annotations

import math
from array import array

import numpy as np
import numpy.typing as npt

from controller.geometry.arrays import Array, Flags, distinct
from controller.ipc.handoff import StopTable
from controller.plan.feed import ticked
from controller.plan.feed.course import FeedCourse
from controller.plan.feed.profile import Profile
from controller.plan.stops.check import STANDSTILL, check
from controller.plan.stops.search import (
    AHEAD_OF_PLAN,
    CONTRADICTION,
    MAX_STEPS,
    MIN_LIFT,
    Found,
    Indices,
    Lanes,
    Motion,
    Ramps,
    Shares,
    Stuck,
    landing_of,
    search,
)
from controller.plan.stops.way import RowWay, Straight, Way

# Shares of the jerk, of the acceleration, and of the jerk on the landing.
FIRST = (1.004, 0.9995, 1.0)
# Where the plan itself is a little over the limits, the next; the others land more softly.
AGAIN = ((1.0138, 0.9997, 1.0), (1.0138, 0.9975, 0.85), (1.004, 0.9997, 0.7), (1.0, 0.9975, 0.5))
# Ramps to where a search was stuck: shares of the acceleration that it needed and of its jerk there,
# the steps for which they go on level, and the share of the acceleration's limits.
RAMPS = (
    (0.98, 0.9, 0, 0.9997),
    (0.85, 0.9, 4, 0.9997),
    (0.85, 0.45, 4, 0.9975),
    (0.65, 0.9, 10, 0.9997),
    (0.65, 0.45, 10, 0.9975),
    (0.4, 0.9, 16, 0.9997),
    (0.4, 0.45, 16, 0.9975),
    (0.1, 0.6, 30, 0.9975),
)
RAMP_JERK, RAMP_LANDING = 1.0138, 0.95  # shares of the jerk that go with them
RAMP_ROUNDS = 4
SURE = 6  # steps of a landing that a second search trusts in
LONGER = (1.0, 1.04, 1.08, 1.14, 1.2)  # times the plan's own last braking
EVEN = 0.01  # of the speed per second: no braking yet
SLOWER = 1.0 - 1e-9  # times an even speed: the plan brakes
LATER = 12  # starts whose stops are tried behind the plan's own braking
BRAKING_LOOKS = 400
AS_SOON = 1.15  # times a stop: a plan that rests so soon needs none
BEYOND = 1e-9  # of the profile's rest, by which a stop may end behind it (unit of s)

LONG_STEPS = 60  # a typical stop has about so many jerks at most
HORIZON_S = 0.4  # of the plan beyond the last start: enough for a stop of twice that


def stops(course: FeedCourse, profile: Profile, first_s: float, last_s: float, step_s: float) -> StopTable:
    """A stop from the plan's state at first_s, first_s + step_s ... up to last_s.

    Times are seconds from the profile's beginning, all of them whole numbers of periods.
    Every stop keeps each joint within 1.0003, 1.001 and 1.015 of its velocity, acceleration
    and jerk, never moves backwards and never beyond the profile's rest. A start at rest has
    a stop of one step without jerk.
    """
    times: Array = first_s + step_s * np.arange(int((last_s - first_s) / step_s + 1e-6) + 1.0)
    start = profile.along(times)[:3]
    h, horizon = _jerk_step(course, start), HORIZON_S
    kind = RowWay if ticked.is_row(course) else Way
    while True:
        until = min(profile.duration_s, last_s + horizon)
        seeker = _Seeker(kind(course, profile, first_s, until), start, h, profile.end_s)
        if seeker.seek(profile.duration_s - times) or until >= profile.duration_s:
            seeker.brake_as_before()
            seeker.brake_early(profile, times)
            seeker.brake_with_the_plan(profile, times)
            return StopTable(first_s, step_s, h, *seeker.rows())
        horizon *= 3.0


def _jerk_step(course: FeedCourse, start: Motion) -> float:
    """One period, or more where stops are so long that one would make too many steps."""
    limits, period = course.stop_limits, course.machine.period_s
    s, v, _ = start
    some = distinct(np.linspace(0, len(s) - 1, 20).astype(int))
    rate = course.derivatives(s[some]).first * v[some, None]
    longest = float(limits.braking_s(rate).max(initial=0.0))
    return period * max(1, int(longest / (LONG_STEPS * period)))


class _Seeker:
    """Seeks a stop for every start (N,) and keeps the shortest of each."""

    def __init__(self, way: Way, start: Motion, h: float, rest: float) -> None:
        self._way, self._start, self._h, self._rest = way, start, h, rest
        self._steps: Indices = np.zeros(len(start[0]), dtype=np.intp)
        self._from: list[Array] = []
        self._place: Indices = np.zeros((2, len(start[0])), dtype=np.intp)  # in which array, which column

    def seek(self, left_s: Array) -> bool:
        """Search for all starts, with so much time left of the plan; False if the way is too short."""
        moving = np.flatnonzero(self._start[1] > STANDSTILL)
        if not len(moving):
            return True
        found = self._first(moving)
        good, beyond = self._judged(moving, found)
        if found.short.any():
            return False
        # A stop that only ends too far ends farther still with less.
        speeding = self._start[2][moving] >= 0.0
        failed = ~good & (~beyond | speeding) & (self._urgent(moving, left_s) | speeding)
        if failed.any() and not self._way.is_rough:
            self._again(moving[failed], found.stuck.of(failed))
        return True

    def _first(self, lanes: Indices) -> Found:
        begin = (self._start[0][lanes], self._start[1][lanes], self._start[2][lanes])
        if (even := self._way.straight) is not None:
            return search_straight(self._way, even, begin, self._h, FIRST)
        return search(self._way, begin, self._h, Shares(*np.tile(np.array(FIRST)[:, None], len(lanes))))

    def brake_as_before(self) -> None:
        """As from the start before, at the same even speed: it may still end before a junction ahead.

        The search leaves room for the jump of a junction as if it had to pass it.
        """
        same = self._start[1][:-1] * SLOWER < self._start[1][1:]
        for lane in self._even_and_without():
            if lane and same[lane - 1] and self._steps[lane - 1]:
                self._judged(np.array([lane]), self._as_from(lane - 1))

    def _as_from(self, lane: int) -> Found:
        """The stop of another start."""
        return _as_found(np.array(self._row(lane))[:, None], np.array([self._steps[lane]]))

    def brake_early(self, profile: Profile, times: Array) -> None:
        """Just before the plan's own last braking: that braking, begun at once and a little longer.

        It is the quickest there is from that speed, and nothing that a search finds step by step comes
        near it.
        """
        left, speed = profile.duration_s - times, self._start[1]
        lanes = self._even_and_without()
        if not len(lanes):
            return
        begun_s = _braking_from(profile, float(left[lanes].max()), float(speed[lanes[-1]]))
        for longer in LONGER:
            lanes = lanes[self._steps[lanes] == 0]
            n = math.ceil((profile.duration_s - begun_s) * longer / self._h - 1e-9)
            if not len(lanes) or n < 1:
                return
            share = np.arange(n + 1) / n
            a = profile.along(begun_s + share * (profile.duration_s - begun_s))[2]
            a[0] = a[-1] = 0.0
            self._try_braking(lanes, [a] * len(lanes))

    def brake_with_the_plan(self, profile: Profile, times: Array) -> None:
        """Just before the plan brakes for what lies ahead: that braking, begun at once, then a later stop.

        Tried with the stops of the next few starts from which one was found.
        """
        for lane in self._even_and_without():
            speed = float(self._start[1][lane])
            later = np.flatnonzero(
                (self._steps > 0) & (self._start[1] < speed * SLOWER) & (times > times[lane])
            )
            brakings: list[Array] = []
            for other in later[:LATER]:
                n = math.ceil((times[other] - times[lane]) / self._h - 1e-9)
                speeds, rates = profile.along(times[other] - self._h * np.arange(n, -1.0, -1.0))[1:3]
                before = rates[_last_as_fast(speeds, speed) :]
                behind = before[-1] + self._h * np.cumsum(self._row(int(other)))
                brakings.append(np.concatenate([[0.0], before[1:], behind[:-1], [0.0]]))
            if brakings:
                self._try_braking(np.full(len(brakings), lane), brakings)

    def _even_and_without(self) -> Indices:
        """The starts at an even speed from which no stop was found."""
        _, speed, rate = self._start
        return np.flatnonzero((self._steps == 0) & (speed > STANDSTILL) & (np.abs(rate) < EVEN * speed))

    def _try_braking(self, lanes: Indices, brakings: list[Array]) -> None:
        """Try the accelerations at the steps' ends, zero at first and last, of each lane.

        They are scaled so that the speed vanishes with them.
        """
        steps = np.array([len(a) - 1 for a in brakings])
        jerks = np.zeros((steps.max(), len(lanes)))
        for column, (lane, a) in enumerate(zip(lanes, brakings, strict=True)):
            falls = -self._h * float(a.sum())
            if falls > 0.0:
                jerks[: steps[column], column] = np.diff(a) / self._h * (self._start[1][lane] / falls)
            else:
                steps[column] = 0
        self._judged(lanes, _as_found(jerks, steps))

    def rows(self) -> tuple[array[int], array[float]]:
        """The jerks of all stops, one stop after the other, and where each begins, as of a ``StopTable``."""
        still = (self._start[1] <= STANDSTILL) & (np.abs(self._start[2]) <= STANDSTILL)
        steps = np.where(still, 1, self._steps)
        first = np.concatenate([[0], np.cumsum(steps)])
        found = np.zeros(first[-1])
        for k, jerks in enumerate(self._from):
            lanes = np.flatnonzero((self._place[0] == k) & (self._steps > 0) & ~still)
            lane, step = np.nonzero(np.arange(len(jerks)) < steps[lanes, None])
            found[first[lanes[lane]] + step] = jerks[step, self._place[1, lanes[lane]]]
        return array("i", first.astype(np.intc).tobytes()), array("d", found.tobytes())

    def _row(self, lane: int) -> list[float]:
        which, column = self._place[:, lane]
        found: list[float] = self._from[which][: self._steps[lane], column].tolist() if self._from else []
        return found

    def _urgent(self, lanes: Indices, left_s: Array) -> Flags:
        """Where the plan does not come to rest nearly as soon as the stops found thereabouts."""
        found = np.flatnonzero(self._steps > 0)
        if not len(found):
            return np.ones(len(lanes), dtype=bool)
        typical = np.interp(lanes, found, self._h * self._steps[found])
        return np.asarray(left_s[lanes] > AS_SOON * typical)

    def _again(self, lanes: Indices, stuck: Stuck) -> None:
        """Search with other shares, then with ramps to where a search was ``stuck``."""
        n = len(lanes)
        found, _, _ = self._tried(
            np.tile(lanes, len(AGAIN)), np.repeat(np.array(AGAIN).T, n, axis=1), sure=SURE
        )
        other = found.stuck.of(np.arange(n))
        stuck = Stuck(*(np.where(stuck.steps > 0, *pair) for pair in zip(stuck, other, strict=True)))
        left = (self._steps[lanes] == 0) & (stuck.steps > 0)
        if left.any():
            self._with_ramps(lanes[left], stuck.of(left))

    def _with_ramps(self, lanes: Indices, stuck: Stuck) -> None:
        """Search with a ramp to where each search was stuck, and another where it is stuck then."""
        ramps = Ramps(*np.zeros((4, 0, len(lanes))))
        for _ in range(RAMP_ROUNDS):
            n, many = len(lanes), _more_ramps(ramps, stuck)
            shares = np.array([(RAMP_JERK, ramp[3], RAMP_LANDING) for ramp in RAMPS]).T
            found, _, _ = self._tried(np.tile(lanes, len(RAMPS)), np.repeat(shares, n, axis=1), many, SURE)
            # Go on from the variant that came farthest.
            far = found.stuck.steps.reshape(len(RAMPS), n)
            still = np.flatnonzero((self._steps[lanes] == 0) & (far.max(axis=0) > 0))
            if not len(still):
                return
            chosen = far[:, still].argmax(axis=0) * n + still
            lanes, ramps, stuck = lanes[still], many.of(chosen), found.stuck.of(chosen)

    def _tried(
        self, lanes: Indices, shares: Array, ramps: Ramps | None = None, sure: int = MAX_STEPS
    ) -> tuple[Found, Flags, Flags]:
        """What was found for ``lanes`` with ``shares`` (3, N), whether it passes, or just ends too far."""
        begin = (self._start[0][lanes], self._start[1][lanes], self._start[2][lanes])
        found = search(self._way, begin, self._h, Shares(*shares), ramps, sure)
        return found, *self._judged(lanes, found)

    def _judged(self, lanes: Indices, found: Found) -> tuple[Flags, Flags]:
        """Keeps what passes; tells which do, and which just end too far."""
        begin = (self._start[0][lanes], self._start[1][lanes], self._start[2][lanes])
        good, ends = check(self._way, begin, self._h, found)
        inside = ends <= self._rest + BEYOND
        self._keep(lanes, found, good & inside)
        return good & inside, good & ~inside

    def _keep(self, lanes: Indices, found: Found, good: Flags) -> None:
        self._from.append(found.jerks)
        columns = np.flatnonzero(good)
        columns = columns[np.lexsort((found.steps[columns], lanes[columns]))]
        shortest = np.diff(lanes[columns], prepend=-1) > 0  # a lane may have been searched more than once
        columns = columns[shortest]
        lane, steps = lanes[columns], found.steps[columns]
        better = (self._steps[lane] == 0) | (steps < self._steps[lane])
        self._steps[lane[better]] = steps[better]
        self._place[0, lane[better]], self._place[1, lane[better]] = len(self._from) - 1, columns[better]


def _braking_from(profile: Profile, longest_s: float, speed: float) -> float:
    """When the plan last leaves ``speed`` on its way to rest, no earlier than ``longest_s`` before that."""
    t = profile.duration_s - longest_s * np.arange(BRAKING_LOOKS + 1) / BRAKING_LOOKS
    as_fast = profile.along(t)[1] >= speed * SLOWER
    return float(t[int(np.argmax(as_fast))])


def _last_as_fast(speeds: Array, speed: float) -> int:
    """The last of the samples at which the plan has ``speed``; the first where none has.

    Steps of braking are no steps of the table: a plan that still gains a little, as a heavy machine
    does, may have its highest speed at the start itself, between the first sample and the second.
    """
    as_fast = np.flatnonzero(speeds >= speed * SLOWER)
    return int(as_fast[-1]) if len(as_fast) else 0


def _as_found(jerks: Array, steps: Indices) -> Found:
    """Stops that were not searched for."""
    none = np.zeros(jerks.shape[1])
    return Found(jerks, steps, Stuck(none.astype(np.intp), none, none), none.astype(bool))


def _more_ramps(ramps: Ramps, stuck: Stuck) -> Ramps:
    """Each start once for each of RAMPS, with one ramp more."""
    needed, jerk, level, _ = (np.repeat(np.array(x), len(stuck.steps)) for x in zip(*RAMPS, strict=True))
    many = len(RAMPS)
    new = (
        np.tile(stuck.steps + 1.0, many),
        np.tile(np.minimum(stuck.needed, 0.0), many) * needed,
        np.tile(stuck.lift, many) * jerk,
        np.tile(stuck.steps + 1.0, many) + level,
    )
    before = (np.tile(old, (1, many)) for old in ramps)
    return Ramps(*(np.concatenate([old, x[None]]) for old, x in zip(before, new, strict=True)))


# ---- straight ways ---------------------------------------------------------------------
#
# The same stops as ``search`` finds, many steps at once: what the joints allow is the same everywhere there,
# so the braking of every start is known without its places. Where each one lands is looked up after that.


AT_ONCE = 16  # steps


def search_straight(
    way: Way, straight: Straight, start: Motion, h: float, shares: tuple[float, float, float]
) -> Found:
    """Stops from ``start``, with jerks held for ``h`` seconds each; all have the same ``shares``."""
    lanes, lane = Lanes(len(start[0])), np.arange(len(start[0]))
    joints = _Joints(straight, h, shares)
    s, v, a = start
    while len(lane) and len(lanes.rows) < MAX_STEPS:
        made = len(lanes.rows)
        a, low, high, j = joints.braked(a, min(AT_ONCE, MAX_STEPS - made))
        v = np.cumsum(np.concatenate([v[None], h * (a[:-1] + h * j / 2)]), axis=0)
        s = np.cumsum(np.concatenate([s[None], h * (v[:-1] + h * (a[:-1] / 2 + h * j / 6))]), axis=0)
        x = v[:-1] + 0.5 * h * a[:-1]
        first, rest, count = landing_of(x, a[:-1], h, joints.landing)
        s1, ahead = s[:-1] + h * x, x > 0.0
        lands = ahead & (first >= low) & (first <= high + 1e-9) & joints.fit(rest)
        late = ahead & (first > high) & (a[:-1] < 0.0) & ~lands
        stuck = (low - joints.most > CONTRADICTION * straight.still) & ~lands
        off = s1 > way.end
        ends = lands | off | stuck | ~ahead | (v[1:] > AHEAD_OF_PLAN * way.speed(s1))
        ended = ends.any(axis=0)
        last = np.where(ended, ends.argmax(axis=0), len(j) - 1)
        at, step = (last, np.arange(len(lane))), np.arange(len(j))[:, None]
        told = (stuck | late) & (step <= last) & (made + step > 0)
        where = np.flatnonzero(told.any(axis=0))
        at_first = (told[:, where].argmax(axis=0), where)
        needed = a[at_first] + h * np.where(late[at_first], first[at_first], low[at_first])
        lanes.stick(lane[where], made + at_first[0], needed, np.full(len(where), joints.lift))
        landed = lands[at]
        j[at] = np.where(landed, first[at], j[at])
        lanes.rows += [(lane, row) for row in j]
        lanes.landed(lane[landed], made + last[landed] + 1, count[at][landed], rest[at][landed])
        lanes.short[lane[(off & (step <= last)).any(axis=0)]] = True
        s, v, a, lane = s[-1][~ended], v[-1][~ended], a[-1][~ended], lane[~ended]
    return lanes.result()


class _Joints:
    """What the joints allow along the path: jerks, and by their accelerations."""

    def __init__(self, straight: Straight, h: float, shares: tuple[float, float, float]) -> None:
        self._h, rates = h, straight.rates
        jerk, acceleration, lift = shares
        room = jerk * straight.jerk_room
        self.most = float((room / np.abs(rates)).min())
        self._bends = h * rates, rates
        self._half = straight.acceleration * (acceleration * straight.acceleration_room)
        self._half = self._half / np.abs(self._bends[0])
        self.landing = max(min(self.most, room * straight.still) * lift, 1e-9)
        self.lift = max(self.most, MIN_LIFT * straight.still)
        self._rate, self._room = float(np.abs(rates).max()), room * (1.0 + 1e-6)

    def braked(self, a: Array, steps: int) -> tuple[Array, Array, Array, Array]:
        """Accelerations (steps + 1, N) from ``a`` on, bounds of each step's jerk, and the jerk (steps, N)."""
        found, low, high, jerks = [a], [], [], []
        slope, rates = self._bends
        for _ in range(steps):
            middle = rates * a / slope  # with its sign turned
            low.append(np.maximum(0.0 - (middle + self._half).min(axis=0), -self.most))
            high.append(np.minimum((self._half - middle).min(axis=0), self.most))
            jerks.append(np.minimum(low[-1], self.most))
            a = a + self._h * jerks[-1]
            found.append(a)
        return np.array(found), np.array(low), np.array(high), np.array(jerks)

    def fit(self, rest: Array) -> npt.NDArray[np.bool_]:
        """Whether they allow the jerk of a landing."""
        return np.asarray(self._rate * rest <= self._room)
