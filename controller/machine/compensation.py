"""What axes miss of where they are told to be, as tables for the tick: pitch, backlash, straightness.

A deviation is that of ISO 230-2: where the axis really is, less where it was told to be. It is taken as 0
where the axis is homed, so that homing says the same with a table and without. What is sent to a drive is the
joint less its deviation.

Between its points a table is a monotone cubic (Fritsch and Carlson 1980: no overshoot, no corner), laid onto
an even grid once, so that a tick finds its place by one product. Reversal is not a step: half of what lies
between the two senses is put on, or taken off, along a quintic in time (``ramp``) whose velocity,
acceleration and jerk keep to a share of the axis' limits. That share, and what the slopes of the tables need,
is taken off the limits that the plan may use (``reserved``): together they keep what the machine file says.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

from controller.machine.deviation_tables import Straightness
from controller.machine.kinematics.slides import Slides
from controller.machine.model import PERIODS_S, Axis, Limits, Machine, Pitch

CELLS = 1024  # of a grid
REVERSAL_SHARE = 0.05  # of the limits of an axis that its reversal may use
MAX_SHARE = 0.15  # of its limits that tables may use in all
SLIGHT_CORNER = 0.001  # of an acceleration: what the tick's last check lets pass is no corner
# The quintic 10 s^3 - 15 s^4 + 6 s^5: the largest of its first three derivatives.
QUINTIC = (1.875, 10.0 / math.sqrt(3.0), 60.0)


class Grid(NamedTuple):
    """A function of a position at even steps, straight between them, constant beyond."""

    low: float
    per_step: float  # 1 / step
    last: float  # number of the last cell
    values: tuple[float, ...]
    rises: tuple[float, ...]  # from each to the next

    def at(self, q: float) -> float:
        x = (q - self.low) * self.per_step
        if x <= 0.0:
            return self.values[0]
        if x >= self.last:
            return self.values[-1]
        i = int(x)
        return self.values[i] + (x - i) * self.rises[i]


def grid(at: Sequence[float], values: Sequence[float], cells: int = CELLS) -> Grid:
    """The monotone cubic through points ``at`` (rising) on ``cells`` even steps."""
    low, high = at[0], at[-1]
    step = (high - low) / cells
    curve = _Cubic(at, values)
    found = [curve(low + k * step) for k in range(cells)] + [values[-1]]
    rises = tuple(b - a for a, b in pairwise(found))
    return Grid(low, 1.0 / step, float(cells), tuple(found), rises)


class _Cubic:
    """A monotone cubic through points."""

    def __init__(self, x: Sequence[float], y: Sequence[float]) -> None:
        self._x, self._y = x, y
        self._h = [b - a for a, b in pairwise(x)]
        self._d = [(b - a) / h for a, b, h in zip(y, y[1:], self._h, strict=False)]
        inner = [self._slope(i) for i in range(1, len(x) - 1)]
        self._m = [self._d[0], *inner, self._d[-1]]

    def _slope(self, i: int) -> float:
        before, after, h, g = self._d[i - 1], self._d[i], self._h[i - 1], self._h[i]
        if before * after <= 0.0:
            return 0.0
        a, b = 2.0 * g + h, g + 2.0 * h
        return (a + b) / (a / before + b / after)

    def __call__(self, q: float) -> float:
        i = min(max(bisect_right(self._x, q) - 1, 0), len(self._h) - 1)
        h, d, m, n = self._h[i], self._d[i], self._m[i], self._m[i + 1]
        s = q - self._x[i]
        c, e = (3.0 * d - 2.0 * m - n) / h, (m + n - 2.0 * d) / (h * h)
        return self._y[i] + s * (m + s * (c + s * e))


class Deviation(NamedTuple):
    """That of one axis on one grid: the mean of both senses, and half of up less down.

    Both with their rises to the next; the last is 0. Beyond the grid they stay as at its ends.
    """

    low: float
    per_step: float
    last: float
    mean: tuple[float, ...]
    mean_rise: tuple[float, ...]
    half: tuple[float, ...]
    half_rise: tuple[float, ...]

    def at(self, q: float, sense: float) -> float:
        """At a position come to in the positive (``sense`` = 1) or negative (-1) sense, or between them."""
        x = (q - self.low) * self.per_step
        x = 0.0 if x < 0.0 else self.last if x > self.last else x
        i = int(x)
        straight = self.mean_rise[i] + sense * self.half_rise[i]
        return self.mean[i] + sense * self.half[i] + (x - i) * straight


def deviation(axis: Axis) -> Deviation | None:
    """That of an axis, 0 where it is homed; None where it has no table."""
    pitch = axis.pitch
    if pitch is None:
        return None
    means = [0.5 * (u + d) for u, d in zip(pitch.up, pitch.down, strict=True)]
    halves = [0.5 * (u - d) for u, d in zip(pitch.up, pitch.down, strict=True)]
    home = grid(pitch.at, means).at(axis.homing.position)
    mean, half = grid(pitch.at, [value - home for value in means]), grid(pitch.at, halves)
    rises = (*mean.rises, 0.0), (*half.rises, 0.0)
    return Deviation(mean.low, mean.per_step, mean.last, mean.values, rises[0], half.values, rises[1])


def reversal(pitch: Pitch) -> float:
    """The largest way (mm, rad) from one sense to the other."""
    return max(abs(u - d) for u, d in zip(pitch.up, pitch.down, strict=True))


def ramp_s(pitch: Pitch, limits: Limits) -> float:
    """How long a reversal takes so that its derivatives keep to their share of the limits."""
    way = reversal(pitch) / REVERSAL_SHARE
    rows = zip(QUINTIC, (limits.velocity, limits.acceleration, limits.jerk), (1, 2, 3), strict=True)
    return max(float((way * peak / limit) ** (1.0 / order)) for peak, limit, order in rows)


def ramp(pitch: Pitch, limits: Limits, period_s: float) -> tuple[float, ...]:
    """The quintic from 0 to 1, tick by tick; its last is 1."""
    ticks = max(1, math.ceil(ramp_s(pitch, limits) / period_s))
    shares = [k / ticks for k in range(1, ticks + 1)]
    return tuple(s**3 * (10.0 - 15.0 * s + 6.0 * s * s) for s in shares)


@lru_cache(64)
def slopes(at: tuple[float, ...], *rows: tuple[float, ...]) -> tuple[float, float, float]:
    """The largest first and second derivative of tables over the position, and a step of their grid."""
    first = second = 0.0
    for values in rows:
        found = grid(at, values)
        rates = [rise * found.per_step for rise in found.rises]
        first = max(first, *(abs(rate) for rate in rates))
        second = max(second, *(abs(b - a) * found.per_step for a, b in pairwise(rates)))
    return first, second, (at[-1] - at[0]) / CELLS


def _share(table: tuple[float, float, float], along: Limits, limits: Limits) -> float:
    """Of an axis' limits, what tables with such ``slopes`` may need at most.

    ``along``: the limits of the axis whose position counts. Where a cell is longer than the way of a period,
    all of a corner between two of them is met within one.
    """
    first, second, step = table
    ratios: list[float] = [getattr(along, name) / getattr(limits, name) for name in Limits.__slots__]
    bend = second * along.velocity**2 / limits.acceleration
    turn = 3.0 * second * along.velocity * along.acceleration / limits.jerk
    corner = second * along.velocity * (step / PERIODS_S[0]) / limits.acceleration
    return first * max(ratios) + max(bend, turn, corner - SLIGHT_CORNER)


def own_share(pitch: Pitch, limits: Limits) -> float:
    """Of an axis' limits, what its own table may need at most: reversal, and the slopes at full speed."""
    need = _share(slopes(pitch.at, pitch.up, pitch.down), limits, limits)
    return (REVERSAL_SHARE if reversal(pitch) else 0.0) + need


def share(axis: Axis, axes: Sequence[Axis], straightness: Sequence[Straightness]) -> float:
    """Likewise what all tables may need that move it."""
    along = {one.name: one.limits for one in axes}
    rows = [row for row in straightness if row.moves == axis.name]
    crossed = [_share(slopes(row.at, row.off), along[row.along], axis.limits) for row in rows]
    return math.fsum(crossed) + (0.0 if axis.pitch is None else own_share(axis.pitch, axis.limits))


def reserved(axes: Sequence[Axis], straightness: Sequence[Straightness] = ()) -> tuple[Axis, ...]:
    """The axes with the limits that their tables leave for the plan."""
    found = []
    for axis in axes:
        part, limits = 1.0 - share(axis, axes, straightness), axis.limits
        left = Limits(limits.velocity * part, limits.acceleration * part, limits.jerk * part)
        found.append(replace(axis, limits=left))
    return tuple(found)


class Crossing(NamedTuple):
    """By how much one axis moves another: straightness, and squareness as its slope."""

    along: int  # index of the axis whose position counts
    moves: int  # index of the one that is off
    off: Grid


def crossings(machine: Machine) -> tuple[Crossing, ...]:
    """The straightness tables of a machine, 0 where the axis is homed."""
    names, found = [axis.name for axis in machine.axes], []
    for row in machine.straightness:
        along = names.index(row.along)
        home = grid(row.at, row.off).at(machine.axes[along].homing.position)
        off = grid(row.at, [value - home for value in row.off])
        found.append(Crossing(along, names.index(row.moves), off))
    return tuple(found)


def largest(machine: Machine, index: int) -> float:
    """The most (mm, rad) by which an axis is sent elsewhere than to its joint."""
    axis, found = machine.axes[index], Slides(machine.axes).farthest(machine.axes, index)
    table = deviation(axis)
    if table is not None:
        found += max(map(abs, table.mean)) + max(map(abs, table.half))
    found += sum(max(map(abs, one.off.values)) for one in crossings(machine) if one.moves == index)
    if index in machine.linear():
        found += abs(machine.thermal_shift_mm[machine.linear().index(index)])
    return found
