"""What a CAD face is trimmed to, in the parameters of its surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from controller.messages import TextError, said

if TYPE_CHECKING:
    from controller.cad.kernel import Box, Edge, Face

Array = NDArray[np.float64]

ON_SIDE_MM = 5e-4  # an edge this near to a side of the box is on it
STRAIGHT_MM = 1e-6
NOT_RULINGS = said("cad.not_rulings")


class Trimmed(TextError):
    """An outline that rulings do not fill."""


@dataclass(frozen=True, eq=False)
class Side:
    """One end of the rulings: edges one behind the other, over shares of the way along."""

    edges: tuple[Edge | TurnedEdge, ...]  # rising
    column: int  # of the parameter along the way: 0 is u, 1 is v
    low: float
    high: float  # its range

    @property
    def corners(self) -> Array:
        """Shares at which one edge ends and the next begins."""
        ends = [edge.rows[[0, -1], self.column].max() for edge in self.edges[:-1]]
        return (np.array(ends, dtype=float) - self.low) / (self.high - self.low)

    def __call__(self, share: Array) -> Array:
        """The parameter across at shares (N,)."""
        return np.array([self._across(self.low + s * (self.high - self.low)) for s in share])

    def _across(self, along: float) -> float:
        column = self.column
        edge = next((e for e in self.edges if along <= e.rows[:, column].max()), self.edges[-1])
        way, t = edge.rows[:, column], edge.t
        if way[0] > way[-1]:
            way, t = way[::-1], t[::-1]
        i = int(np.clip(np.searchsorted(way, along, side="right") - 1, 0, len(way) - 2))
        a, b = edge.at(t[i])[column] - along, edge.at(t[i + 1])[column] - along
        if a >= 0.0 or b <= 0.0:
            at = t[i] if abs(a) < abs(b) else t[i + 1]
        else:
            at = brentq(lambda x: edge.at(x)[column] - along, t[i], t[i + 1], xtol=1e-15, rtol=1e-14)
        return edge.at(at)[1 - column]


def _chained(pairs: Sequence[tuple[Array, Array]]) -> Array:
    """The starts of edges (start, end) as a wire passes them; each may stand the wrong way round."""
    (start, end), after = pairs[0], pairs[1]
    if min(_gap(start, at) for at in after) < min(_gap(end, at) for at in after):
        start, end = end, start
    row, at = [start], end
    for start, end in pairs[1:]:
        forward = _gap(start, at) <= _gap(end, at)
        row.append(start if forward else end)
        at = end if forward else start
    return np.array(row)


def _gap(a: Array, b: Array) -> float:
    return float(np.linalg.norm(a - b))


def _turns(row: Array) -> Array:
    """Without the points at which a wire goes straight on."""
    before, after = row - np.roll(row, 1, axis=0), np.roll(row, -1, axis=0) - row
    size = np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
    return np.asarray(row[np.linalg.norm(np.cross(before, after), axis=1) > 1e-7 * size])


class TurnedEdge:
    """An edge of a plane face in turned parameters."""

    def __init__(self, edge: Edge, turn: Array) -> None:
        self._edge, self._turn = edge, turn
        self.t, self.rows = edge.t, edge.rows @ turn.T

    def at(self, t: float) -> tuple[float, float]:
        u, v = self._turn @ np.array(self._edge.at(t))
        return float(u), float(v)


class TurnedPlane:
    """A plane face whose second parameter runs along ``way`` (2,), a direction of its own two."""

    def __init__(self, face: Face, way: Array) -> None:
        a, b = way / np.linalg.norm(way)
        self._face, self._turn = face, np.array([[b, -a], [a, b]])

    def point(self, u: float, v: float) -> Array:
        return self._face.point(*(self._turn.T @ np.array([u, v])))

    def outward(self, u: float, v: float) -> Array:
        return self._face.outward(*(self._turn.T @ np.array([u, v])))

    def outlines(self) -> list[list[TurnedEdge]]:
        return [[TurnedEdge(edge, self._turn) for edge in wire] for wire in self._face.outlines()]

    def snapped(self, box: Box) -> Box:
        return box


class Outline:
    """The wires of a face, and the box of parameters about them."""

    def __init__(self, face: Face | TurnedPlane) -> None:
        self._face = face
        self._wires: Sequence[Sequence[Edge | TurnedEdge]] = face.outlines()
        rows = np.concatenate([edge.rows for wire in self._wires for edge in wire])
        (u0, v0), (u1, v1) = rows.min(axis=0), rows.max(axis=0)
        self.box: Box = face.snapped((float(u0), float(u1), float(v0), float(v1)))
        sides = ((0, u0), (0, u1), (1, v0), (1, v1))
        self.is_box = len(self._wires) == 1 and all(
            any(self._is_at(edge.rows, *side) for side in sides) for edge in self._wires[0]
        )

    def _is_at(self, rows: Array, column: int, value: float) -> bool:
        """Whether all of an edge is at one value of a parameter, within ``ON_SIDE_MM`` on the surface."""
        if np.all(rows[:, column] == value):
            return True
        onto = rows.copy()
        onto[:, column] = value
        return self._apart(rows[::8], onto[::8]) <= ON_SIDE_MM

    def _apart(self, rows: Array, others: Array) -> float:
        pairs = zip(rows, others, strict=True)
        return max(float(np.linalg.norm(self._face.point(*a) - self._face.point(*b))) for a, b in pairs)

    @property
    def has_hole(self) -> bool:
        return len(self._wires) > 1

    def straight(self) -> list[Array]:
        """Directions (2,) of its straight edges, each once, the steepest on the part first."""
        found: list[tuple[float, Array]] = []
        for edge in (edge for wire in self._wires for edge in wire):
            rows = edge.rows - edge.rows[0]
            way, size = rows[-1], float(np.linalg.norm(rows[-1]))
            if size == 0.0 or np.abs(rows @ np.array([way[1], -way[0]])).max() > STRAIGHT_MM * size:
                continue
            rise = self._face.point(*edge.rows[-1])[2] - self._face.point(*edge.rows[0])[2]
            if all(abs(float(way[0] * other[1] - way[1] * other[0])) > 1e-7 * size for _, other in found):
                found.append((abs(float(rise)) / size, way / size))
        return [way for _, way in sorted(found, key=lambda one: -one[0])]

    def corners(self) -> Array | None:
        """The four corners (4, 3) of one wire of straight edges, mm; None where it is another outline."""
        if len(self._wires) != 1 or len(self._wires[0]) < 4:
            return None
        found: list[tuple[Array, Array]] = []
        for edge in self._wires[0]:
            rows = np.array([self._face.point(u, v) for u, v in edge.rows[::8]])
            way = (rows[-1] - rows[0]) / (float(np.linalg.norm(rows[-1] - rows[0])) or 1.0)
            if np.abs(np.cross(rows - rows[0], way)).max() > STRAIGHT_MM:
                return None
            found.append((rows[0], rows[-1]))
        row = _turns(_chained(found))
        return row if len(row) == 4 else None

    def sides(self, along_u: bool) -> tuple[Side, Side]:
        """The ends of the rulings, low and high, where one wire leads there and back; raises Trimmed."""
        if self.has_hole:
            raise Trimmed(said("cad.hole"))
        column = 0 if along_u else 1
        low, high = self.box[2 * column], self.box[2 * column + 1]
        there: list[Edge | TurnedEdge] = []
        back: list[Edge | TurnedEdge] = []
        for edge in self._wires[0]:
            if self._is_at(edge.rows, column, low) or self._is_at(edge.rows, column, high):
                continue  # a ruling
            steps = np.diff(edge.rows[:, column])
            if not (np.all(steps > 0.0) or np.all(steps < 0.0)):
                raise Trimmed(NOT_RULINGS)
            (there if self._is_low(edge, column) else back).append(edge)
        found = [self._side(edges, column, low, high) for edges in (there, back)]
        return found[0], found[1]

    def _is_low(self, edge: Edge | TurnedEdge, column: int) -> bool:
        """Whether the face is above an edge: the other edges over the same place tell."""
        along, across = edge.rows[len(edge.rows) // 2, [column, 1 - column]]
        others = []
        for other in self._wires[0]:
            way = other.rows[:, column]
            if other is not edge and way.min() < along < way.max():
                order = np.argsort(way)
                others.append(float(np.interp(along, way[order], other.rows[order, 1 - column])))
        if len(others) != 1:
            raise Trimmed(NOT_RULINGS)
        return bool(across < others[0])

    def _side(self, edges: Sequence[Edge | TurnedEdge], column: int, low: float, high: float) -> Side:
        """Edges put in order; they must lead from one end to the other without a gap."""
        row = sorted(edges, key=lambda edge: float(edge.rows[:, column].min()))
        ends = [(float(e.rows[:, column].min()), float(e.rows[:, column].max())) for e in row]
        reached, slack = low, 1e-6 * (high - low)
        for start, end in ends:
            if abs(start - reached) > slack:
                raise Trimmed(NOT_RULINGS)
            reached = end
        if abs(reached - high) > slack:
            raise Trimmed(NOT_RULINGS)
        return Side(tuple(row), column, low, high)
