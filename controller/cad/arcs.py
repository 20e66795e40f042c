"""The outline of a face as arcs that rise or fall along the way of its rulings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from controller.geometry.arrays import Array
from controller.messages import TextError

ONE_PLACE_MM = 5e-4  # ends of arcs that are nearer along the way are one


class Trimmed(TextError):
    """An outline that rulings do not fill."""


class CurveOfPlane(Protocol):
    """An edge in the two parameters of its surface."""

    t: Array
    rows: Array

    def at(self, t: float) -> tuple[float, float]: ...


class Ruled(Protocol):
    """A surface that is straight across, beyond what it is trimmed to, too."""

    along: tuple[float, float]
    across: tuple[float, float]

    def point(self, a: float, b: float) -> Array: ...

    def is_buried(self, a: float, b: float) -> bool: ...


class Scale:
    """Millimetres per unit of both parameters of a face."""

    def __init__(self, face: Ruled) -> None:
        (a0, a1), (b0, b1) = face.along, face.across
        self._face, self.across = face, face.across
        a = np.linspace(a0, a1, 33)
        rows = np.array([[face.point(x, y) for x in a] for y in (b0, 0.5 * (b0 + b1), b1)])
        self.mm_a = float(np.linalg.norm(np.diff(rows, axis=1), axis=2).sum(axis=1).mean()) / (a1 - a0)
        self.mm_b = float(np.linalg.norm(rows[2] - rows[0], axis=1).mean()) / (b1 - b0)
        self.across_per_along = self.mm_a / max(self.mm_b, 1e-12)  # b per a

    def at(self, a: float) -> float:
        """Millimetres per unit of b on one ruling."""
        b0, b1 = self.across
        size = float(np.linalg.norm(self._face.point(a, b1) - self._face.point(a, b0))) / (b1 - b0)
        return max(size, 1e-9 * self.mm_b)


@dataclass(frozen=True, eq=False)
class Arc:
    """A part of an edge over which a rises from ``start`` to ``end``."""

    edge: CurveOfPlane
    column: int  # of a: 0 is u, 1 is v
    t: Array
    a: Array  # rising

    @property
    def start(self) -> float:
        return float(self.a[0])

    @property
    def end(self) -> float:
        return float(self.a[-1])

    def __call__(self, a: float) -> float:
        """b where it has this a; beyond an end that of the end."""
        i = int(np.clip(np.searchsorted(self.a, a, side="right") - 1, 0, len(self.a) - 2))
        off = [self._a(self.t[k]) - a for k in (i, i + 1)]
        if off[0] >= 0.0 or off[1] <= 0.0:
            t = self.t[i] if abs(off[0]) < abs(off[1]) else self.t[i + 1]
        else:
            t = brentq(lambda x: self._a(x) - a, self.t[i], self.t[i + 1], xtol=1e-15, rtol=1e-14)
        return self.edge.at(t)[1 - self.column]

    def _a(self, t: float) -> float:
        return self.edge.at(t)[self.column]


def arcs_of(
    wires: Sequence[Sequence[CurveOfPlane]], column: int, scale: Scale
) -> tuple[list[Arc], list[float]]:
    """The arcs of an outline, and the places of edges that stand: that are rulings."""
    arcs: list[Arc] = []
    stands: list[float] = []
    for edge in (edge for wire in wires for edge in wire):
        a = edge.rows[:, column]
        if float(np.ptp(a)) * scale.mm_a <= ONE_PLACE_MM:
            stands.append(float(a.mean()))
            continue
        t = _turning(edge, column, 1e-9 * float(np.ptp(a)))
        arcs += [_arc(edge, column, start, end) for start, end in pairwise(t)]
    return [arc for arc in arcs if (arc.end - arc.start) * scale.mm_a > ONE_PLACE_MM], stands


def _turning(edge: CurveOfPlane, column: int, slack: float) -> list[float]:
    """Its own parameter where a turns, both ends among them; less than ``slack`` is noise."""
    a, found, last, way = edge.rows[:, column], [float(edge.t[0])], 0, 0.0
    for i in range(1, len(a)):
        if way == 0.0:
            way = float(np.sign(a[i] - a[0])) if abs(a[i] - a[0]) > slack else 0.0
            last = i
        elif (a[i] - a[last]) * way >= 0.0:
            last = i
        elif (a[last] - a[i]) * way > slack:
            around = edge.t[max(last - 1, 0)], edge.t[min(last + 1, len(a) - 1)]
            sign = way
            found.append(
                float(
                    minimize_scalar(
                        lambda t, sign=sign: -sign * edge.at(t)[column],
                        bounds=(min(around), max(around)),
                        method="bounded",
                        options={"xatol": 1e-10 * abs(around[1] - around[0])},
                    ).x
                )
            )
            way, last = -way, i
    return [*found, float(edge.t[-1])]


def _arc(edge: CurveOfPlane, column: int, start: float, end: float) -> Arc:
    t = np.concatenate([[start], edge.t[(edge.t > start) & (edge.t < end)], [end]])
    a = np.array([edge.at(x)[column] for x in t])
    if a[0] > a[-1]:
        t, a = t[::-1], a[::-1]
    return Arc(edge, column, t, np.maximum.accumulate(a))


def clustered(places: Array, scale: Scale) -> Array:
    """Sorted; those nearer than ``ONE_PLACE_MM`` to each other are one."""
    groups: list[list[float]] = []
    for at in np.sort(places).tolist():
        if groups and (at - groups[-1][-1]) * scale.mm_a <= ONE_PLACE_MM:
            groups[-1].append(at)
        else:
            groups.append([at])
    return np.array([float(np.mean(group)) for group in groups])


def place(point: Array) -> str:
    """A point of the part frame in words."""
    return "X{:.2f} Y{:.2f} Z{:.2f}".format(*(float(x) + 0.0 for x in point))
