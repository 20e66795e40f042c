"""Where on a course the motion law is sought: places close together where much happens in time.

First the course is sampled: how fast every joint limit lets it be run at each place. From
an estimate of the speed follows the time, and knots are put evenly in *time*: a ramp from
rest, where s grows with t^3, then has as many as any other tenth of a second, however
short it is. Where the feed alone holds the speed, knots lie further and further apart.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from controller.geometry import arc_length
from controller.geometry.arrays import Array
from controller.geometry.curves import Arc, Even
from controller.geometry.vectors import ROUNDING
from controller.motion.motions import JointMove, SurfaceCut, ToolLine
from controller.plan.feed import tool_limits
from controller.plan.feed.course import FeedCourse, Index
from controller.plan.feed.limits import JointLimits, ramp_length
from controller.plan.rotaries.branch import beside_pole
from controller.plan.segment import Segment
from controller.plan.surfaces.rates import Derivatives

SPACING = 0.1  # of samples on anything but lines and arcs, mm
SAMPLES = (60, 4000)  # on one segment, at least and at most
NEAR_ENDS = 24  # samples on a ramp
SHORT_MM = 0.25  # lines no longer than this have ...
SHORT_SAMPLES, SHORT_NEAR_ENDS = 4, 2  # ... so many samples, and on a ramp so many
ROUGH = 1.2  # neighbouring samples may differ by this factor in what they allow ...
FINEST_S = 5e-4  # ... unless they are this close in time
HEADROOM = 1.15  # the limits allow so much more than the feed: it holds the speed alone
GROWTH = 0.25  # of a knot's interval per time from where something happens
STEP_OF_SPEED = 0.15  # change of ln(allowed speed) per interval
INSET = 1e-9  # of a part's length: what lies inside is not at its mark
EVEN_TIMES = 4000  # at which an estimate is smoothed
MAX_CLOSER = 4.0  # times as many knots at narrow places
FROM_REST = 4  # intervals of time in one: a law from rest begins with constant jerk
BRAKING_SAMPLES = 16  # of each phase of slowing down to a lower feed
BRAKING_S = 0.2  # what the first so many seconds of it allow is taken for the whole
NO_TIME_S = 1e-9
EASY_SHARE = 0.7  # share of acceleration that the estimate counts on


@dataclass(frozen=True, slots=True)
class Samples:
    """A part of a course, sampled; all (N,). Marks are sampled twice, from both sides."""

    s: Array
    part: Index  # number of the part between two marks
    feed: Array
    allowed: Array  # speed that the joints' limits allow where path acceleration and jerk are none
    acceleration: Array  # along the path, from standstill
    jerk: Array


@dataclass(frozen=True, slots=True)
class Parts:
    """A course between ``ends`` (n + 1,), cut at its marks; part i lies in segment ``index[i]``."""

    course: FeedCourse
    ends: Array
    index: Index

    @staticmethod
    def of(course: FeedCourse, first: float, last: float) -> Parts:
        # A mark that is off an end by rounding alone would make a part in which there is no way.
        marks = course.marks[(course.marks > first + ROUNDING) & (course.marks < last - ROUNDING)]
        ends = np.concatenate([[first], marks, [last]])
        return Parts(course, ends, course.index(0.5 * (ends[1:] + ends[:-1])))

    @property
    def rests(self) -> Index:
        """The parts after which the motion rests, but for the last."""
        return np.flatnonzero(np.diff(self.index) * np.isin(self.index[:-1], [*self.course.rests]))

    def feed(self, s: Array, part: Index) -> Array:
        """Feed at places of parts; at a mark that of the part that is named."""
        return self.course.feed(self._inside(s, part), self.index[part])

    def derivatives(self, s: Array, part: Index) -> Derivatives:
        """First to third of the joints at places of parts; at a mark those of the part that is named."""
        return self.course.derivatives(self._inside(s, part), self.index[part])

    def _inside(self, s: Array, part: Index) -> Array:
        low, high = self.ends[part], self.ends[part + 1]
        inset = INSET * (high - low)
        return np.clip(s, low + inset, high - inset)


def survey(parts: Parts, v: float = 0.0, a: float = 0.0) -> Samples:
    """Every part sampled closely enough to see narrow places, and what a motion at its beginning does."""
    rough = _near_ends(parts, _sampled(parts, *_even(parts)))
    if v > 0.0:
        way, _ = braking(rough, v, a)
        s = way[(way > parts.ends[0]) & (way < parts.ends[-1])]
        rough = _with(parts, rough, s, np.searchsorted(parts.ends, s) - 1)
    return _refined(parts, rough)


def _even(parts: Parts) -> tuple[Array, Index]:
    """Places evenly in every part, and the part of each; they gather where an axis passes by the pole."""
    course, (low, high) = parts.course, (parts.ends[:-1], parts.ends[1:])
    rows = zip(parts.index.tolist(), low.tolist(), high.tolist(), strict=True)
    counts = np.array([_spaces(course.segments[k], b - a) for k, a, b in rows])
    part, ends = np.repeat(np.arange(len(counts)), counts + 1), np.cumsum(counts + 1)
    s = (np.arange(len(part)) - (ends - counts - 1)[part]) * ((high - low) / counts)[part] + low[part]
    s[ends - 1] = high
    for k, n in enumerate(parts.index.tolist()):
        motion = course.segments[n].motion
        if isinstance(motion, SurfaceCut) and motion.beside_pole:
            near = float(course.zeros[n]) + arc_length.s_at(motion.arc, beside_pole(motion))
            more = np.setdiff1d(near[(near > low[k]) & (near < high[k])], s[part == k])
            at = np.searchsorted(s, more)
            s, part = np.insert(s, at, more), np.insert(part, at, k)
    return s, part


def _spaces(segment: Segment, length: float) -> int:
    """Between the places on so long a part of it."""
    motion = segment.motion
    if isinstance(motion, JointMove) and not isinstance(motion.curve, Even):
        turn = motion.curve.sweep_rad if isinstance(motion.curve, Arc) else 0.0
        return 5 + math.ceil(16.0 * abs(turn) * length / motion.end)
    if _is_short(segment):
        return SHORT_SAMPLES
    return 2 + int(min(max(length / SPACING, SAMPLES[0] * (length / motion.end)), SAMPLES[1]))


def _is_short(segment: Segment) -> bool:
    """Whether it is one of the many lines of a row: its ends say nearly all of it."""
    return isinstance(segment.motion, ToolLine) and segment.motion.end <= SHORT_MM


def _sampled(parts: Parts, s: Array, part: Index) -> Samples:
    course, index = parts.course, parts.index[part]
    d, feed = parts.derivatives(s, part), parts.feed(s, part)
    limit = JointLimits(*(course.limit(s, which, index) for which in ("velocity", "acceleration", "jerk")))
    rates = np.abs(d.first) + 1e-30
    tool = tool_limits.rates_in(course, s, index)
    return Samples(
        s,
        part,
        feed,
        np.minimum(limit.path_speed(d), tool_limits.most_speed(course, tool, len(s))),
        np.asarray((limit.acceleration / rates).min(axis=1)),
        np.asarray((limit.jerk / rates).min(axis=1)),
    )


def _with(parts: Parts, found: Samples, s: Array, part: Index) -> Samples:
    """More samples among the ones that there are, in order."""
    if len(s) == 0:
        return found
    more = _sampled(parts, s, part)
    both = [np.concatenate(pair) for pair in zip(_columns(found), _columns(more), strict=True)]
    order = np.lexsort((both[0], both[1]))
    return Samples(*(value[order] for value in both))


def _columns(found: Samples) -> tuple[Array, Index, Array, Array, Array, Array]:
    return found.s, found.part, found.feed, found.allowed, found.acceleration, found.jerk


def _near_ends(parts: Parts, found: Samples) -> Samples:
    """Samples that gather as t^3 at both ends of every part, where a law may begin or end at rest."""
    cubes, few = ((np.arange(1, n + 1) / n) ** 3 for n in (NEAR_ENDS, SHORT_NEAR_ENDS))
    short = [_is_short(parts.course.segments[k]) for k in parts.index.tolist()]
    places, part = [], []
    firsts = np.searchsorted(found.part, np.arange(len(parts.index) + 1))
    outer = np.append(np.append(True, np.diff(parts.index) != 0), True)
    for n, (low, high) in enumerate(zip(parts.ends[:-1], parts.ends[1:], strict=True)):
        if not (outer[n] or outer[n + 1]):
            continue
        for at, sign, end in ((firsts[n], 1.0, low), (firsts[n + 1] - 1, -1.0, high)):
            speed = min(found.allowed[at], found.feed[at])
            reach = min(2.0 * ramp_length(float(speed), float(found.jerk[at])), 0.49 * (high - low))
            gathered = few if short[n] and parts.ends[0] < end < parts.ends[-1] else cubes
            places.append(end + sign * reach * gathered)
            part.append(np.full(len(gathered), n))
    return _with(parts, found, np.concatenate(places), np.concatenate(part))


def _refined(parts: Parts, found: Samples) -> Samples:
    for _ in range(12):
        ratio = np.abs(np.diff(np.log(found.allowed)))
        step = np.diff(found.s)
        matters = np.minimum(found.allowed[1:], found.allowed[:-1]) < 3.0 * found.feed[1:]
        slower = np.minimum(np.minimum(found.allowed[1:], found.allowed[:-1]), found.feed[1:])
        rough = (ratio > math.log(ROUGH)) & matters & (step > FINEST_S * slower)
        rough &= found.part[1:] == found.part[:-1]
        at = np.flatnonzero(rough)
        if len(at) == 0:
            break
        found = _with(parts, found, 0.5 * (found.s[at] + found.s[at + 1]), found.part[at])
    return found


def estimate(parts: Parts, found: Samples, v: float = 0.0, a: float = 0.0) -> Array:
    """A speed at each sample that a law might have from ``v`` and ``a`` to rest at the end, (N,)."""
    most = np.minimum(found.allowed, found.feed)
    firsts = np.searchsorted(found.part, np.arange(1, len(parts.index)))
    for n, at in enumerate(firsts):
        if parts.index[n] != parts.index[n + 1]:
            low = parts.course.junction(int(parts.index[n]))
            most[at - 1 : at + 1] = np.minimum(most[at - 1 : at + 1], low)
    for at in firsts[parts.rests].tolist():
        most[at - 1 : at + 1] = 0.0
    if v > 0.0:
        most = np.maximum(most, np.interp(found.s, *braking(found, v, a), right=0.0))
    most[-1] = 0.0
    most[0] = v
    forth = _grown(found, most)
    back = _grown(_reversed(found), most[::-1])[::-1]
    return np.minimum(forth, back)


def braking(found: Samples, v: float, a: float) -> tuple[Array, Array]:
    r"""Places and speeds of a motion that slows from ``v`` and ``a`` at the first sample to the feed there.

     a  \                 jerk -j until the acceleration is -b,
     0   \       /        then +j until it is none
    -b    \_____/
    """
    near = found.s <= found.s[0] + v * BRAKING_S
    j, most = EASY_SHARE * float(found.jerk[near].min()), EASY_SHARE * float(found.acceleration[near].min())
    target = min(float(found.feed[0]), v)
    drop = max(v + max(a, 0.0) ** 2 / (2.0 * j) - target, 0.0)
    b = min(most, math.sqrt(j * drop))
    if b <= 0.0:
        return found.s[:1], np.array([v])
    times = ((max(a, 0.0) + b) / j, max(drop / b - b / j, 0.0), b / j)
    places, speeds, acceleration = [float(found.s[0])], [v], max(a, 0.0)
    for time, jerk in zip(times, (-j, 0.0, j), strict=True):
        t = time * np.arange(1, BRAKING_SAMPLES + 1) / BRAKING_SAMPLES
        s, speed = places[-1], speeds[-1]
        if time > NO_TIME_S:
            places += (s + t * (speed + t * (acceleration / 2.0 + t * jerk / 6.0))).tolist()
            speeds += (speed + t * (acceleration + t * jerk / 2.0)).tolist()
        acceleration += time * jerk
    return np.array(places), np.maximum(np.array(speeds), 0.0)


def _reversed(found: Samples) -> Samples:
    back = slice(None, None, -1)
    return Samples(
        -found.s[back],
        found.part[back],
        found.feed[back],
        found.allowed[back],
        found.acceleration[back],
        found.jerk[back],
    )


def _grown(found: Samples, most: Array) -> Array:
    """The speed gained along the samples, never above ``most``; a start from rest goes with t^3."""
    speeds = [v := float(most[0])]
    step = np.diff(found.s)
    acceleration, jerk = EASY_SHARE * found.acceleration[:-1], EASY_SHARE * found.jerk[:-1]
    starts = map(math.cbrt, (4.5 * jerk * step * step).tolist())
    rows = (x.tolist() for x in (step, most[1:], acceleration, 2.0 * jerk))
    for start, length, limit, most_a, per_v in zip(starts, *rows, strict=True):
        a = min(most_a, math.sqrt(per_v * v))
        v = min(limit, max(math.sqrt(v * v + 2.0 * a * length), start))
        speeds.append(v)
    return np.array(speeds)


def smoothed(found: Samples, v: Array, a: float, over_s: float) -> Array:
    """The speeds averaged twice over so much time: no kinks that would ask for any jerk, (N,)."""
    t = times(found.s, v)
    n = 2 * max(1, math.ceil(over_s / 2.0 / (t[-1] / EVEN_TIMES))) + 1
    even = np.linspace(0.0, t[-1], EVEN_TIMES + 1)
    speed, step = np.interp(even, t, v), t[-1] / EVEN_TIMES
    before = np.maximum(v[0] + a * step * np.arange(-n, 0), 0.0)
    speed = np.concatenate([before, speed, np.zeros(n)])
    for _ in range(2):
        speed = np.convolve(speed, np.full(n, 1.0 / n), mode="same")
    return np.interp(t, even, speed[n:-n])


def times(s: Array, v: Array) -> Array:
    """Time at which each sample is passed at the speeds ``v``; from rest s goes with t^3, so t = 3 s / v."""
    step = np.diff(s)
    t = 2.0 * step / np.maximum(v[1:] + v[:-1], 1e-30)
    t = np.where((v[1:] == 0.0) ^ (v[:-1] == 0.0), 1.5 * t, t)
    return np.concatenate([[0.0], np.cumsum(np.where(step > 0.0, t, 0.0))])


def knots(
    found: Samples, v: Array, step_s: Array | float, most: float = math.inf, widest: float = 1.0
) -> tuple[Array, Index]:
    """Knots (n + 1,) from the first sample to the last, and the part of each interval (n,).

    ``v`` is the speed expected at the samples, ``step_s`` the time between knots where something happens.
    At rests the first interval takes ``FROM_REST`` of these times. Were there more than ``most`` knots, the
    times are longer, up to ``widest`` times: marks are knots, too, and where these are most, little is won.
    """
    ends = np.append(np.flatnonzero(np.diff(found.part)), len(found.s) - 1)
    firsts = np.append(0, ends[:-1] + 1)

    def intervals(step_s: Array | float) -> tuple[Array, Index, Index, Index]:
        """Intervals between samples, those of each part, and how many go into its first and its last."""
        count = _count(found, v, step_s)
        n = np.maximum(1, np.ceil(np.add.reduceat(count, np.append(0, ends[:-1])) - 0.2)).astype(np.intp)
        begin = np.where(v[firsts] == 0.0, _joined_at_rest(n), 0)
        return count, n, begin, np.where(v[ends] == 0.0, _joined_at_rest(n - begin), 0)

    count, per_part, begin, end = intervals(step_s)
    if (many := 1 + int(per_part.sum() - begin.sum() - end.sum())) > most:
        count, per_part, begin, end = intervals(step_s * min(many / most, widest))
    places, upto = [found.s[:1]], 0
    for k in np.flatnonzero(per_part > 1).tolist():  # most parts of rows of many short ones have one interval
        first, last, n = firsts[k], ends[k], per_part[k]
        places.append(found.s[ends[upto:k]])
        so_far = np.concatenate([[0.0], np.cumsum(count[first:last])])
        made = np.interp(np.linspace(0.0, so_far[-1], n + 1), so_far, found.s[first : last + 1])
        places.append(made[1 + begin[k] : n - end[k]])
        upto = k
    places.append(found.s[ends[upto:]])
    return np.concatenate(places), np.repeat(found.part[ends], per_part - begin - end)


def _joined_at_rest(count: Index) -> Index:
    """How many of the first ``count`` intervals of parts go into the one after them."""
    return np.clip(count - 3, 0, FROM_REST - 1)


def _count(found: Samples, v: Array, step_s: Array | float) -> Array:
    """Intervals wanted between neighbouring samples, (N - 1,); ``step_s`` at each, or everywhere."""
    t, step_s = times(found.s, v), np.broadcast_to(step_s, len(v))
    busy = (v < 0.999 * found.feed) | (found.allowed < HEADROOM * found.feed)
    busy[0] = busy[-1] = True
    quiet = time_away(t, busy) - 4.0 * step_s
    span = step_s + GROWTH * np.maximum(quiet, 0.0)
    matters = np.minimum(found.allowed[1:], found.allowed[:-1]) < 1.5 * HEADROOM * found.feed[1:]
    bends = np.abs(np.diff(np.log(found.allowed))) / STEP_OF_SPEED * matters
    bends = np.minimum(bends, MAX_CLOSER * np.diff(t) / step_s[1:])
    # Between samples the span goes over evenly from one's to the other's.
    ratio = np.log(span[1:] / span[:-1])
    mean = np.where(np.abs(ratio) > 1e-6, np.diff(span) / np.where(ratio == 0.0, 1.0, ratio), span[1:])
    return np.asarray(np.diff(t) / mean + bends)


def time_away(t: Array, busy: npt.NDArray[np.bool_]) -> Array:
    """Time from each sample to the nearest busy one."""
    before = np.maximum.accumulate(np.where(busy, t, -np.inf))
    after = np.minimum.accumulate(np.where(busy, t, np.inf)[::-1])[::-1]
    return np.asarray(np.minimum(t - before, after - t))
