"""Counts up what a part of a motion took: time, length, feed, and what bound for how long.

A tally takes moments (``binding.Motion``) as they come and keeps sums only, and one mark
per change of what binds; so a part of any length fits.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

from controller.geometry.arrays import Array
from controller.machine.model import Machine
from controller.plan.feed.binding import NUMBER_OF_CODES
from controller.state.modes import AXIS_KINDS, Binding, binding_text

MAX_SPANS = 200  # of what binds in one part; shorter ones are merged
KEPT_SPANS = 4 * MAX_SPANS


@dataclass(frozen=True, slots=True)
class Bound:
    """What bound, and for which share of the part's time."""

    what: str  # 'feed', 'corner', 'C acceleration', ...
    share: float
    axis: str | None = None
    kind: str | None = None  # 'velocity', 'acceleration', 'jerk'

    def to_dict(self) -> dict[str, Any]:
        return {"what": self.what, "axis": self.axis, "kind": self.kind, "share": _short(self.share)}


@dataclass(frozen=True, slots=True)
class Where:
    """From where to where something bound: seconds and mm (or degrees) from the part's beginning."""

    what: str
    from_s: float
    to_s: float
    from_mm: float
    to_mm: float

    def to_dict(self) -> dict[str, Any]:
        return {name: _short(getattr(self, name)) for name in self.__slots__}


@dataclass(frozen=True, slots=True)
class Part:
    """A part of a motion as the check reports it; feeds in mm/min (degrees/min where only rotaries turn)."""

    length_mm: float
    time_s: float
    feed: float | None  # the largest programmed; None where rapids are in it
    feed_mean: float
    feed_max: float
    binds: tuple[Bound, ...]  # the longest first
    where: tuple[Where, ...]  # in order
    max_ratio: dict[str, dict[str, float]]  # by axis and kind, to the machine's limits; {} of a standstill

    def to_dict(self) -> dict[str, Any]:
        return {
            "length_mm": _short(self.length_mm),
            "time_s": _short(self.time_s),
            "feed_mm_min": _short(self.feed),
            "feed_mean_mm_min": _short(self.feed_mean),
            "feed_max_mm_min": _short(self.feed_max),
            "binds": [bound.to_dict() for bound in self.binds],
            "where": [one.to_dict() for one in self.where],
            "max_ratio": {
                axis: {kind: _short(ratio) for kind, ratio in row.items()}
                for axis, row in self.max_ratio.items()
            },
        }


@dataclass(slots=True)
class Tally:
    """Sums of one part while it is looked at."""

    machine: Machine
    time_s: float = 0.0
    length_mm: float = 0.0
    feed_mm_s: float = 0.0  # inf with rapids
    fastest_mm_s: float = 0.0
    seconds: Array = field(default_factory=lambda: np.zeros(NUMBER_OF_CODES))
    ratio: Array = field(init=False)
    changes: list[tuple[float, float, int]] = field(default_factory=list)  # time, length, code from there on

    def __post_init__(self) -> None:
        self.ratio = np.zeros((len(self.machine.axes), 3))

    def moments(self, seconds: Array, fastest: float, feed: float, ratio: Array) -> None:
        """Take moments: seconds of each code, the largest speed, programmed feed and shares (axes, 3)."""
        self.seconds += seconds
        self.fastest_mm_s = max(self.fastest_mm_s, fastest)
        np.maximum(self.ratio, ratio, out=self.ratio)
        self.feed_mm_s = max(self.feed_mm_s, feed)

    def windows(self, dt: Sequence[float], ds: Sequence[float], codes: Sequence[int]) -> None:
        """Take windows of the display, after each other: duration, length, code."""
        last = self.changes[-1][2] if self.changes else -1
        for lasts, way, code in zip(dt, ds, codes, strict=True):
            if code != last:
                self.changes.append((self.time_s, self.length_mm, last := code))
            self.time_s += lasts
            self.length_mm += way
        if len(self.changes) > KEPT_SPANS:
            self.changes = _fewer(self.changes, self.time_s)

    def rest(self, seconds: float) -> None:
        """Stand still, as at the end of a run that is padded to a whole number of periods."""
        if not self.changes or self.changes[-1][2] != Binding.NOTHING:
            self.changes.append((self.time_s, self.length_mm, Binding.NOTHING))
        self.time_s += seconds
        self.seconds[Binding.NOTHING] += seconds

    def part(self) -> Part:
        mean = self.length_mm / self.time_s if self.time_s > 0.0 else 0.0
        return Part(
            self.length_mm,
            self.time_s,
            60.0 * self.feed_mm_s if 0.0 < self.feed_mm_s < math.inf else None,
            60.0 * mean,
            60.0 * self.fastest_mm_s,
            self._bounds(),
            self._where(),
            ratios(self.machine, self.ratio) if self.length_mm else {},
        )

    def _bounds(self) -> tuple[Bound, ...]:
        return bounds(self.seconds, self.machine)

    def _where(self) -> tuple[Where, ...]:
        changes = self.changes
        if len(changes) > MAX_SPANS:
            changes = _fewer(changes, self.time_s)
        ends = [*((t, s) for t, s, _ in changes[1:]), (self.time_s, self.length_mm)]
        names = self._names
        return tuple(
            Where(binding_text(code, names), t, to_t, s, to_s)
            for (t, s, code), (to_t, to_s) in zip(changes, ends, strict=False)
            if code != Binding.NOTHING
        )

    @property
    def _names(self) -> list[str]:
        return [axis.name for axis in self.machine.axes]


def _short(value: Any) -> Any:
    """A number as JSON gives it: to 1e-6, which is a micrometre's thousandth and no digit too many."""
    return round(value, 6) if isinstance(value, float) else value


def bounds(seconds: Array, machine: Machine) -> tuple[Bound, ...]:
    """Shares of the time by what bound, the longest first; without the time in which nothing did."""
    names, nothing = tuple(axis.name for axis in machine.axes), int(Binding.NOTHING)
    total, shares = float(seconds.sum()), seconds.tolist()
    codes = [code for code, share in enumerate(shares) if share and code != nothing]
    codes.sort(key=lambda code: -shares[code])
    return tuple(
        Bound(what, shares[code] / total, *of) for code in codes for what, *of in [_named(code, names)]
    )


@cache
def _named(code: int, axes: tuple[str, ...]) -> tuple[str, str | None, str | None]:
    """What bound, of which axis, and which kind of its limits."""
    what, first = binding_text(code, axes), int(Binding.AXIS)
    axis, kind = divmod(code - first, 3)
    return (what, None, None) if code < first else (what, axes[axis], AXIS_KINDS[kind])


def ratios(machine: Machine, most: Array) -> dict[str, dict[str, float]]:
    """Largest shares of the limits (axes, 3) by name."""
    return {
        axis.name: dict(zip(AXIS_KINDS, row, strict=True))
        for axis, row in zip(machine.axes, most.tolist(), strict=True)
    }


def _fewer(changes: list[tuple[float, float, int]], end_s: float) -> list[tuple[float, float, int]]:
    """The longest ``MAX_SPANS``; a shorter one goes to the one before it, neighbours that agree are one."""
    lasts = np.diff([*(t for t, _, _ in changes), end_s])
    least = np.partition(lasts, -MAX_SPANS)[-MAX_SPANS]
    kept = [changes[0]]
    for change, lasting in zip(changes[1:], lasts[1:], strict=True):
        if lasting >= least and change[2] != kept[-1][2]:
            kept.append(change)
    return kept
