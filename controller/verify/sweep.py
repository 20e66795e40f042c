"""The way of a tool in the frame of the table, as poses that can be had anywhere between samples.

A pass is the tool's way along one motion: smooth, so that a cubic through four samples gives
the pose between two of them. A sweep is all passes of one tool, cut into short runs of samples
with a bound on where their axes are; with the bounds whole runs need not be looked at.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from controller.geometry.arrays import Array, distinct

Index = NDArray[np.int64]
Poses = Callable[[Array], tuple[Array, Array]]  # places s (N,) -> tips (N, 3), unit axes (N, 3)

RUN = 32  # samples of a run
FEWEST = 9  # samples of a pass
MIN_SAMPLES = 4  # of them: a cubic needs them
MAX_SAMPLES = 200_000  # samples of a pass
FIT_MM = 2e-6  # what the cubic may miss at half height between two samples, at tip and top


@dataclass(frozen=True, eq=False, slots=True)
class Pass:
    """The tool along one motion: places ``s`` rising (N,), tips and axes (N, 3), table frame."""

    s: Array
    tips: Array
    axes: Array
    line: int  # of the program
    name: str  # 'cut', 'lead in', 'line', ...
    motion: int = -1  # which segment of the path
    feeding: bool = True
    lines: tuple[int, ...] = ()  # of the program, where one motion is of many ...
    lines_s: tuple[float, ...] = ()  # ... and where each begins

    @property
    def order(self) -> float:
        """Rises from pass to pass of a run; of those of a trace by its rows."""
        return float(self.motion) if self.motion >= 0 else float(self.s[0])

    def line_at(self, s: float) -> int:
        """The line of the program whose motion is at ``s``."""
        return self.lines[max(0, bisect_right(self.lines_s, s) - 1)] if self.lines else self.line

    def lifted(self, by_mm: float) -> Pass:
        """The way of the point so far above the tip."""
        return replace(self, tips=self.tips + by_mm * self.axes)

    def plunges(self) -> Iterator[Pass]:
        """What of it leads down the tool axis more than across it."""
        way = np.diff(self.tips, axis=0)
        down = -(way * self.axes[:-1]).sum(axis=1)
        across = np.linalg.norm(way + down[:, None] * self.axes[:-1], axis=1)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], down > across, [False]])))
        for first, behind in edges.reshape(-1, 2).tolist():
            part = self.part(first, behind)
            if part is not None:
                yield part

    def part(self, first: int, last: int) -> Pass | None:
        """Samples ``first`` to ``last``, some more where a cubic needs them; None where there are too few."""
        last = min(max(last, first + MIN_SAMPLES - 1), len(self.s) - 1)
        first = max(0, min(first, last - MIN_SAMPLES + 1))
        here = slice(first, last + 1)
        if last - first + 1 < MIN_SAMPLES:
            return None
        return replace(self, s=self.s[here], tips=self.tips[here], axes=self.axes[here])


def sampled(
    poses: Poses, end: float, step_mm: float, height_mm: float, fit_mm: float = FIT_MM
) -> tuple[Array, Array, Array]:
    """Places, tips and axes over 0 <= s <= ``end``, so close that the cubic between them holds.

    Neighbours are at most ``step_mm`` apart, at the tip and ``height_mm`` above it, and at half
    way between them the cubic misses by no more than ``fit_mm``.
    """
    s = np.linspace(0.0, end, FEWEST)
    tips, axes = poses(s)
    closest = float(_step(np.hstack([tips, tips + height_mm * axes])).min())
    if closest >= 2.0 * step_mm:  # all of them are to be halved, and so are the halves
        while closest >= 2.0 * step_mm and 2 * len(s) < MAX_SAMPLES:
            s, closest = _halved(s), 0.5 * closest
        tips, axes = poses(s)
    while len(s) < MAX_SAMPLES:
        ends = np.hstack([tips, tips + height_mm * axes])
        wide = _step(ends) > step_mm
        middle = 0.5 * (s[:-1] + s[1:])
        between = poses(middle)
        exact = np.hstack([between[0], between[0] + height_mm * between[1]])
        missed = np.abs(_lagrange(s, ends, np.arange(len(middle)), middle) - exact).max(axis=1) > fit_mm
        split = np.flatnonzero((wide | missed) & (middle > s[:-1]) & (middle < s[1:]))
        if not len(split):
            break
        s = np.insert(s, split + 1, middle[split])
        tips = np.insert(tips, split + 1, between[0][split], axis=0)
        axes = np.insert(axes, split + 1, between[1][split], axis=0)
    return s, tips, axes


def _halved(s: Array) -> Array:
    """The places with one half way between each and the next."""
    found = np.empty(2 * len(s) - 1)
    found[::2], found[1::2] = s, 0.5 * (s[:-1] + s[1:])
    return found


def _step(ends: Array) -> Array:
    d = np.diff(ends, axis=0)
    return np.asarray(np.sqrt(np.maximum((d[:, :3] ** 2).sum(axis=1), (d[:, 3:] ** 2).sum(axis=1))))


def _lagrange(s: Array, values: Array, left: Index, at: Array) -> Array:
    """Cubics through four neighbours of ``values`` (N, k), at ``at`` (M,) right of sample ``left`` (M,)."""
    four = np.clip(left - 1, 0, len(s) - 4)[:, None] + np.arange(4)
    return np.asarray(np.einsum("mi,mik->mk", Knots(s[four]).weights(at), values[four]))


class Knots:
    """Four knots each (..., 4), and Lagrange's weights of them."""

    def __init__(self, knots: Array) -> None:
        a, b, c, d = self._knots = [knots[..., i] for i in range(4)]
        self._apart = (
            (a - b) * (a - c) * (a - d),
            (b - a) * (b - c) * (b - d),
            (c - a) * (c - b) * (c - d),
            (d - a) * (d - b) * (d - c),
        )

    def weights(self, at: Array) -> Array:
        """Of the four (..., 4), at places (...)."""
        g0, g1, g2, g3 = (at - knot for knot in self._knots)
        made = np.empty((*g0.shape, 4))
        rises = (g1 * g2 * g3, g0 * g2 * g3, g0 * g1 * g3, g0 * g1 * g2)
        for i, (rise, apart) in enumerate(zip(rises, self._apart, strict=True)):
            np.divide(rise, apart, out=made[..., i])
        return made


class Around:
    """Samples (M,) with their neighbours on their own pass: poses can be had anywhere between them."""

    def __init__(self, sweep: Sweep, sample: Index) -> None:
        first, last = sweep.first[sample], sweep.last[sample]
        four = np.clip(sample - 1, first, np.maximum(last - 3, first))[:, None] + np.arange(4)
        self._knots = Knots(sweep.s[four][:, None, :])
        self._values = np.concatenate([sweep.tips[four], sweep.axes[four]], axis=2)
        self.low = sweep.s[np.maximum(sample - 1, first)]
        self.high = sweep.s[np.minimum(sample + 1, last)]

    def poses(self, s: Array) -> tuple[Array, Array]:
        """Tips and axes (M, K, 3) at places ``s`` (M, K) near each sample."""
        both = self._knots.weights(s) @ self._values
        tips, axes = both[..., :3], both[..., 3:]
        return tips, axes / np.sqrt(np.einsum("mki,mki->mk", axes, axes))[..., None]


class Sweep:
    """All passes of one tool, one after the other; sample j belongs to pass ``owner[j]``."""

    def __init__(self, passes: Sequence[Pass], height_mm: float) -> None:
        self.passes, self.height_mm = tuple(passes), height_mm
        counts = np.array([len(one.s) for one in passes], dtype=np.int64)
        ends = np.cumsum(counts)
        self.owner = np.repeat(np.arange(len(passes)), counts)
        self.first, self.last = np.repeat(ends - counts, counts), np.repeat(ends - 1, counts)
        self.s = _joined([one.s for one in passes])
        self.tips = _joined([one.tips for one in passes], 3)
        self.axes = _joined([one.axes for one in passes], 3)

    def __len__(self) -> int:
        return len(self.s)

    @cached_property
    def runs(self) -> Runs:
        """Runs of samples that never reach over the end of a pass."""
        return Runs.of(self)

    def lifted(self, low_mm: float, top_mm: float) -> Sweep:
        """The way of what is between two heights above the tip, as seen from its lower end."""
        return Sweep([one.lifted(low_mm) for one in self.passes], top_mm - low_mm)

    def only(self, keep: Iterable[int]) -> Sweep:
        """The sweep of some of the passes."""
        return Sweep([self.passes[i] for i in keep], self.height_mm)


def _joined(parts: Sequence[Array], width: int = 0) -> Array:
    return np.concatenate(parts) if parts else np.zeros((0, width) if width else 0)


@dataclass(frozen=True, eq=False, slots=True)
class Runs:
    """Runs of neighbouring samples: from ``start`` (K,) to before ``stop``.

    The axis from tip to top of every pose of a run lies within ``slack`` (K,) of the segment
    from ``foot`` to ``foot + way`` (K, 3), that of its middle pose.
    """

    start: Index
    stop: Index
    foot: Array
    way: Array
    slack: Array

    @classmethod
    def of(cls, sweep: Sweep) -> Runs:
        start = np.concatenate(
            [np.arange(sweep.first[a], sweep.last[a] + 1, RUN) for a in _firsts(sweep)] or [np.zeros(0, int)]
        ).astype(np.int64)
        stop = np.minimum(start + RUN, sweep.last[start] + 1) if len(start) else start
        middle = (start + stop - 1) // 2
        run = np.repeat(np.arange(len(start)), stop - start)
        tops = sweep.tips + sweep.height_mm * sweep.axes
        off = np.maximum(
            np.linalg.norm(sweep.tips - sweep.tips[middle[run]], axis=1),
            np.linalg.norm(tops - tops[middle[run]], axis=1),
        )
        slack = np.maximum.reduceat(off, start) if len(start) else np.zeros(0)
        return cls(start, stop, sweep.tips[middle], sweep.height_mm * sweep.axes[middle], slack)

    def samples(self, wanted: Index) -> Index:
        """All samples of the wanted runs, one run after the other."""
        counts = self.stop[wanted] - self.start[wanted]
        ends = np.cumsum(counts)
        return np.asarray(np.arange(ends[-1]) + np.repeat(self.start[wanted] - (ends - counts), counts))

    def distance(self, points: Array) -> Array:
        """Distance (P, K) of ``points`` (P, 3) to the middle segments."""
        origin = points.mean(axis=0)  # near it nothing is lost by the squares
        q, foot = points - origin, self.foot - origin
        along = q @ self.way.T - (foot * self.way).sum(axis=1)
        square = (self.way * self.way).sum(axis=1)
        share = np.clip(along / np.maximum(square, 1e-300), 0.0, 1.0)
        away = (q * q).sum(axis=1)[:, None] - 2.0 * (q @ foot.T) + (foot * foot).sum(axis=1)
        away += share * (share * square - 2.0 * along)
        return np.asarray(np.sqrt(np.maximum(away, 0.0)))


def _firsts(sweep: Sweep) -> Index:
    """The first sample of every pass."""
    return distinct(sweep.first)
