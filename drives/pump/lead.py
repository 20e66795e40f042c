"""How axes and spindle of a thread are led beside its law: by one correction in each period.

The rows of a plan that have theirs are complete. Behind them a row has the law alone, and is led by what is
left of the last correction, which dies away: so a correction that is new changes no row that is not its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple


class Correction(NamedTuple):
    """How one tick leads the axes and the spindle beside the law."""

    off_rev: float = 0.0  # the axes stay behind by so much of the spindle's turn, ...
    step_rev: float = 0.0  # ... which is so much more than in the tick before
    added_rev_s: float = 0.0  # of the spindle
    turned_rev: float = 0.0  # what has been added by it so far
    drift_rev_s: float = 0.0  # by which the spindle would fall behind, if nothing were added
    slip: float = 0.0  # of the spindle's answer, as far as it is known ...
    lag_s: float = 0.0
    axis_s: float = 0.0  # ... and of the axes'

    def ahead_mm(self, v: float, a: float) -> float:
        """How far the axes are sent ahead at ``v`` and ``a`` of the law, since their drives lag."""
        return self.axis_s * (v + 0.5 * self.axis_s * a)

    def rev_s(self, asked_rev_s: float, asked_rev_s2: float) -> float:
        """How fast the spindle is led, where the law asks for a speed and an acceleration of it."""
        return asked_rev_s * (1.0 + self.slip) + self.lag_s * asked_rev_s2 + self.added_rev_s

    def prolonged(self, bend: float, period_s: float) -> Correction:
        """The tick after it, where nothing is known of the spindle: what the axes went by dies away."""
        step = math.copysign(max(0.0, abs(self.step_rev) - bend), self.step_rev)
        drift, turned_rev = self.drift_rev_s, self.turned_rev + period_s * self.drift_rev_s
        return self._replace(
            off_rev=self.off_rev + step, step_rev=step, added_rev_s=drift, turned_rev=turned_rev
        )

    def approach(self, off_rev: float, bend: float, most: float) -> tuple[float, float]:
        """(off, step) of the tick after it, nearer to ``off_rev``.

        No step bends by more than ``bend`` or is larger than ``most``, and it can stop.
        """
        gap = off_rev - self.off_rev
        if -bend <= gap - self.step_rev <= bend and -most <= gap <= most:
            return off_rev, gap
        # n steps of bend, 2 bend .. n bend stop within n (n + 1) / 2 bend.
        far = 0.5 * (math.sqrt(1.0 + 8.0 * abs(gap) / bend) - 1.0) * bend
        step = math.copysign(min(far, most), gap)
        step = max(self.step_rev - bend, min(self.step_rev + bend, step))
        return self.off_rev + step, step


class Lead(NamedTuple):
    """How the rows of a plan are led behind those that have their correction."""

    known: int  # rows that have it
    bend_rev: float  # by which a step of the axes dies away in each period
    last: Correction  # of the last of them
    per_mm: Sequence[float]  # counts of each axis in one mm along the thread


class LedRows:
    """The rows of a plan as they are sent: each (s, counts of each drive, and the columns of a thread)."""

    __slots__ = ("_chain", "_lead", "_row")

    def __init__(self, row: Callable[[int], Sequence[float]], lead: Lead | None) -> None:
        self._row, self._lead = row, lead
        self._chain: list[Correction] = []  # behind the rows that are known

    def __call__(self, i: int) -> Sequence[float]:
        row, lead, chain = self._row(i), self._lead, self._chain
        if lead is None or i < lead.known:
            return row
        s, counts, thread = row[0], row[1 : 1 + len(lead.per_mm)], row[1 + len(lead.per_mm) :]
        rev_s, turn, _, rev_s2, v, a = thread
        if not turn:
            return row
        while len(chain) <= i - lead.known:
            before = chain[-1] if chain else lead.last
            chain.append(before.prolonged(lead.bend_rev, 0.0))  # how far the spindle turns is not asked
        by = chain[i - lead.known]
        ahead_mm = by.ahead_mm(v, a)
        led_mm = ahead_mm - by.off_rev / turn
        led = [count + led_mm * one for count, one in zip(counts, lead.per_mm, strict=True)]
        return (s, *led, by.rev_s(rev_s, rev_s2), turn, ahead_mm, 0.0, 0.0, 0.0)
