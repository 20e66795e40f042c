"""Rotary positions under tool vectors (G43.5): great circles from axis to axis, followed without a jump.

The axes of a row of lines give both branches of the rotaries up to whole turns. As in
``branch``, what lies between two axes is halved until no rotary turns far from one sample to
the next; a jump that is left is a passage through the pole, where the other branch goes
on, or, where two lines meet at the pole, a turn of the rotary next to the work under the
standing tool (a swivel).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from controller.geometry.arrays import Array, cross
from controller.geometry.vectors import Vector
from controller.machine.kinematics import Kinematics
from controller.motion.motions import Rotaries
from controller.plan.rotaries.turns import JUMP_RAD, NAN, SAME_AXIS_RAD, TURN, wrapped

Index = npt.NDArray[np.intp]

TURNED_OVER_RAD = math.pi - 1e-6  # between two axes this far apart no great circle is told
POLE_SINE = 1e-9  # as the kinematics: nearer to the pole the work's rotary is a limit
SWIVEL_RAD = 1e-7  # turns below, at the pole, are rounding of the axes


class AxisLost(Exception):
    """The rotaries cannot follow the axis on line ``line`` (index) of the row; ``reason``: a text's key."""

    def __init__(self, line: int, reason: str) -> None:
        super().__init__(reason)
        self.line, self.reason = line, reason


@dataclass(frozen=True, slots=True)
class GreatCircles:
    """Axes axis cos + across sin of N lines; ``axis`` and ``across`` (N, 3), ``angle`` (N,) rad."""

    axis: Array
    across: Array
    angle: Array

    @staticmethod
    def of(axes: Array) -> GreatCircles:
        """Between the rows of unit vectors ``axes`` (N + 1, 3), the short way round."""
        a, b = axes[:-1], axes[1:]
        side = cross(a, b)
        sine = np.sqrt((side * side).sum(axis=1))
        angle = np.arctan2(sine, (a * b).sum(axis=1))
        if len(angle) and angle.max() > TURNED_OVER_RAD:
            raise AxisLost(int(angle.argmax()), "reach.turned_over")
        across = cross(side, a) / np.maximum(sine, 1e-300)[:, None]
        return GreatCircles(a, across, angle)

    def at(self, line: Index, share: Array) -> tuple[Array, Array]:
        """Axis (M, 3) at ``share`` of each line, and the way from there into the line."""
        angle = self.angle[line] * share
        c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
        a, b = self.axis[line], self.across[line]
        way = np.where(share < 0.5, 1.0, -1.0) * self.angle[line]
        return a * c + b * s, (b * c - a * s) * way[:, None]


@dataclass(frozen=True, slots=True)
class Followed:
    """Rotaries (M, 2) at ``share`` of line ``line``, in order; every line's start and end are among them."""

    line: Index
    share: Array
    rotaries: Array
    sine: Array  # (M,) of the angle from the tool axis to the pole

    def swivels(self) -> Index:
        """Samples (share 0 of a line) before which the work's rotary turns at the pole, tool standing."""
        jump = np.abs(np.diff(self.rotaries, axis=0)).max(axis=1, initial=0.0)
        meet = np.diff(self.line) > 0
        return np.flatnonzero(meet & (self.share[:-1] == 1.0) & (jump > SWIVEL_RAD)) + 1


@dataclass(frozen=True, slots=True)
class _Samples:
    line: Index
    share: Array
    axis: Array  # (M, 3)
    sine: Array  # (M,) off the pole
    pairs: Array  # (2, M, 2), nan where the work's rotary is free

    def merged(self, other: _Samples) -> _Samples:
        line, share = np.concatenate((self.line, other.line)), np.concatenate((self.share, other.share))
        order = np.lexsort((share, line))
        parts = ((self.axis, other.axis), (self.sine, other.sine))
        axis, sine = (np.concatenate(pair)[order] for pair in parts)
        pairs = np.concatenate((self.pairs, other.pairs), axis=1)[:, order]
        return _Samples(line[order], share[order], axis, sine, pairs)


def follow(
    circles: GreatCircles,
    start: Rotaries,
    kinematics: Kinematics,
    tolerance_rad: float = math.inf,
    extra: tuple[Index, Array] | None = None,
) -> Followed:
    """Rotaries along the lines, next to ``start`` and without a jump but swivels; raises AxisLost.

    So many samples that rotaries turning evenly between them leave the axis by
    ``tolerance_rad`` at most, and those of ``extra`` (line, share).
    """
    found = _ends(circles, kinematics)
    if extra is not None and len(extra[0]):
        found = found.merged(_solve(circles, kinematics, *extra))
    while True:
        wide = _too_wide(found, kinematics, tolerance_rad)
        middle = 0.5 * (found.share[wide] + found.share[wide + 1])
        usable = (middle > found.share[wide]) & (middle < found.share[wide + 1])
        if not usable.any():
            break
        found = found.merged(_solve(circles, kinematics, found.line[wide][usable], middle[usable]))
    return Followed(found.line, found.share, _followed(found, start), found.sine)


def _ends(circles: GreatCircles, kinematics: Kinematics) -> _Samples:
    """Both ends of every line: one limit from inside each, which agree but at a pole."""
    count = len(circles.angle)
    line = np.repeat(np.arange(count), 2)
    return _solve(circles, kinematics, line, np.tile([0.0, 1.0], count))


def _solve(circles: GreatCircles, kinematics: Kinematics, line: Index, share: Array) -> _Samples:
    axis, inside = circles.at(line, share)
    columns: Vector = (axis[:, 0], axis[:, 1], axis[:, 2])
    ways: Vector = (inside[:, 0], inside[:, 1], inside[:, 2])
    pairs: Array = np.moveaxis(np.array(kinematics.branches(columns, np, ways, NAN)), 2, 1)
    lost = np.isnan(pairs).all(axis=(0, 2))
    if lost.any():
        raise AxisLost(int(line[lost.argmax()]), kinematics.unreached)
    return _Samples(line, share, axis, kinematics.off_pole(columns, np), pairs)


def _too_wide(found: _Samples, kinematics: Kinematics, tolerance_rad: float) -> Index:
    """Samples after which one more is needed before the next."""
    stay = np.nan_to_num(np.abs(wrapped(np.diff(found.pairs, axis=1))))
    turn = np.sqrt((np.diff(found.axis, axis=0) ** 2).sum(axis=1))
    jumps = stay.max(axis=(0, 2)) > JUMP_RAD
    # Half way between two positions of the rotaries the axis is off the great circle by at most this.
    tilt, spin = stay[..., 1 - kinematics.work].max(axis=0), stay[..., kinematics.work].max(axis=0)
    sine = np.maximum(found.sine[:-1], found.sine[1:])
    off = (tilt * tilt + 2.0 * tilt * spin + sine * spin * spin) / 8.0
    same = np.diff(found.line) == 0
    return np.flatnonzero(same & (turn > SAME_AXIS_RAD) & (jumps | (off > tolerance_rad)))


def _followed(found: _Samples, start: Rotaries) -> Array:
    pairs = _filled(found.pairs, start)
    begin = wrapped(pairs[:, 0] - np.array(start))
    first = int(np.argmin((begin * begin).sum(axis=1)))
    stay = np.abs(wrapped(np.diff(pairs, axis=1))).max(axis=(0, 2))
    swap = np.abs(wrapped(pairs[::-1, 1:] - pairs[:, :-1])).max(axis=(0, 2))
    switch = (stay > JUMP_RAD) & (swap < stay)
    meet, pole = np.diff(found.line) > 0, found.sine[1:] < POLE_SINE
    torn = (stay > JUMP_RAD) & (swap > JUMP_RAD) & ~(meet & pole)
    if torn.any():
        raise AxisLost(int(found.line[1:][torn.argmax()]), "reach.jump")
    index = (first + np.concatenate(([0], np.cumsum(switch)))) % 2
    values = pairs[index, np.arange(len(index))]
    # Whole turns are added to the exact values: no rounding piles up over many turns.
    rough = np.cumsum(wrapped(np.diff(values, axis=0)), axis=0)
    nearest = np.round((np.array(start) - values[0]) / TURN)
    values[1:] += TURN * np.round((values[0] + rough - values[1:]) / TURN)
    return np.asarray(values + TURN * nearest)


def _filled(pairs: Array, start: Rotaries) -> Array:
    """A free rotary (the axis stands on the pole for the whole line) stays where it was."""
    unknown = np.isnan(pairs).any(axis=(0, 2))
    if not unknown.any():
        return pairs
    known = np.flatnonzero(~unknown)
    source = np.searchsorted(known, np.arange(pairs.shape[1]), side="right") - 1
    before = pairs[:, known[np.maximum(source, 0)]] if len(known) else np.zeros_like(pairs)
    before = np.where((source < 0)[None, :, None], np.array(start), before)
    return np.where(np.isnan(pairs), before, pairs)
