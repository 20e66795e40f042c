"""Slides that are not square: what each must travel for X, Y and Z, and where they then are.

A slide that travels s goes along its direction d, so X Y Z = h + D (s - h): the directions are the columns of
D, and h is where the slides are homed, so that homing says the same as of a square machine. Programs, limits
and pages know X Y Z; only what is sent to the drives, s = h + D^-1 (X Y Z - h), knows the slides.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from controller.geometry.vectors import Number, Vector, X, Y, Z, cross, dot, norm, scale, unit
from controller.machine.axes import Axis, Limits

SQUARE = 1e-12  # by which a direction may miss that of its axis and be it
LETTERS = "XYZ"


class Slides:
    """The three slides of a machine; stateless."""

    def __init__(self, axes: Sequence[Axis]) -> None:
        names = [axis.name for axis in axes]
        self._at = [names.index(letter) for letter in LETTERS if letter in names]
        directions = [unit(axes[i].direction) for i in self._at]
        square = zip(directions, (X, Y, Z), strict=False)
        off = max(norm((a[0] - b[0], a[1] - b[1], a[2] - b[2])) for a, b in square) if directions else 0.0
        self.are_square = off < SQUARE or len(directions) < len(LETTERS)
        if self.are_square:
            directions = [X, Y, Z]
        self._out: list[Vector] = [tuple(row) for row in zip(*directions, strict=True)]
        self._back = _inverse(directions)
        self._home = [axes[i].homing.position for i in self._at]

    def sent(self, joints: Sequence[Number]) -> list[Number]:
        """Where the drives go (mm, rad; floats or columns), for the axes to be at ``joints``."""
        return self._through(self._back, joints)

    def real(self, positions: Sequence[Number]) -> list[Number]:
        """Where the axes are where the drives are at ``positions``; the other way round than ``sent``."""
        return self._through(self._out, positions)

    def _through(self, rows: Sequence[Vector], values: Sequence[Number]) -> list[Number]:
        found = list(values)
        if not self.are_square:
            x, y, z = (values[i] - h for i, h in zip(self._at, self._home, strict=True))
            for i, h, (a, b, c) in zip(self._at, self._home, rows, strict=True):
                found[i] = h + (a * x + b * y + c * z)
        return found

    def shares(self, vector: Sequence[float]) -> Vector:
        """How far each slide goes for a way along X, Y and Z."""
        a, b, c = (dot(row, (vector[0], vector[1], vector[2])) for row in self._back)
        return a, b, c

    # ---- what is left of the slides for X, Y and Z

    def limited(self, axes: Sequence[Axis]) -> tuple[Axis, ...]:
        """The axes with limits under which no slide exceeds its own, whichever of X, Y and Z move."""
        if self.are_square:
            return tuple(axes)
        found = list(axes)
        for j, i in enumerate(self._at):
            rows = [(k, row) for k, row in enumerate(self._back) if row[j]]
            left = [
                min(getattr(axes[self._at[k]].limits, name) / self._sum(row, axes, name) for k, row in rows)
                for name in Limits.__slots__
            ]
            given = axes[i].limits
            part = Limits(given.velocity * left[0], given.acceleration * left[1], given.jerk * left[2])
            found[i] = replace(axes[i], limits=part)
        return tuple(found)

    def limits(self, axes: Sequence[Axis], index: int) -> Limits:
        """What one slide, or any other axis, is asked for at most where X, Y and Z keep to their limits."""
        if self.are_square or index not in self._at:
            return axes[index].limits
        row = self._back[self._at.index(index)]
        return Limits(*(self._sum(row, axes, name) for name in Limits.__slots__))

    def _sum(self, row: Vector, axes: Sequence[Axis], name: str) -> float:
        """Of one slide, with all of X, Y and Z at their limits."""
        return math.fsum(abs(w) * getattr(axes[i].limits, name) for w, i in zip(row, self._at, strict=True))

    def farthest(self, axes: Sequence[Axis], index: int) -> float:
        """The most (mm) by which a slide is elsewhere than its axis, within the travel of X, Y and Z."""
        if self.are_square or index not in self._at:
            return 0.0
        own = self._at.index(index)
        homed = zip(self._at, self._home, strict=True)
        ways = [max(abs(axes[i].travel_min - h), abs(axes[i].travel_max - h)) for i, h in homed]
        row = [w - (1.0 if j == own else 0.0) for j, w in enumerate(self._back[own])]
        return math.fsum(abs(w) * way for w, way in zip(row, ways, strict=True))


def _inverse(columns: Sequence[Vector]) -> list[Vector]:
    """Rows of the inverse of a matrix with these columns."""
    a, b, c = columns
    volume = dot(a, cross(b, c))
    return [scale(row, 1.0 / volume) for row in (cross(b, c), cross(c, a), cross(a, b))]
