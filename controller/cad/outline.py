"""What a CAD face is trimmed to, in the parameters of its surface."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import minimize_scalar

from controller.geometry.arrays import Array

if TYPE_CHECKING:
    from controller.cad.kernel import Box, Edge, Face


ON_SIDE_MM = 5e-4  # an edge this near to a side of the box is on it
STRAIGHT_MM = 1e-6


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


def _most(edge: Edge | TurnedEdge, column: int, sign: float) -> float:
    """The extreme of one edge: the farthest of its samples, or farther between its neighbours."""
    rows, t = sign * edge.rows[:, column], edge.t
    k = int(rows.argmax())
    if not 0 < k < len(t) - 1 or rows[k] - max(rows[k - 1], rows[k + 1]) <= 0.0:
        return sign * float(rows[k])
    between = sorted((float(t[k - 1]), float(t[k + 1])))
    found = minimize_scalar(
        lambda x: -sign * edge.at(x)[column],
        bounds=between,
        method="bounded",
        options={"xatol": 1e-10 * (between[1] - between[0])},
    )
    return sign * max(float(rows[k]), -float(found.fun))


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

    def mapped(self, u: float, v: float) -> tuple[float, float]:
        """The turned parameters of a place."""
        a, b = self._turn @ np.array([u, v])
        return float(a), float(b)

    def snapped(self, box: Box) -> Box:
        return box


class Outline:
    """The wires of a face, and the box of parameters about them."""

    def __init__(self, face: Face | TurnedPlane) -> None:
        self._face = face
        self.wires: Sequence[Sequence[Edge | TurnedEdge]] = face.outlines()
        u0, u1, v0, v1 = (self._extreme(column, sign) for column in (0, 1) for sign in (-1.0, 1.0))
        self.box: Box = face.snapped((u0, u1, v0, v1))
        sides = ((0, u0), (0, u1), (1, v0), (1, v1))
        self.is_box = len(self.wires) == 1 and all(
            any(self._is_at(edge.rows, *side) for side in sides) for edge in self.wires[0]
        )

    def _extreme(self, column: int, sign: float) -> float:
        """The largest (``sign`` 1) or smallest value of a parameter."""
        found = [_most(edge, column, sign) for wire in self.wires for edge in wire]
        return max(found) if sign > 0.0 else min(found)

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

    def straight(self) -> list[Array]:
        """Directions (2,) of its straight edges, each once, the steepest on the part first."""
        found: list[tuple[float, Array]] = []
        for edge in (edge for wire in self.wires for edge in wire):
            rows = edge.rows - edge.rows[0]
            way, size = rows[-1], float(np.linalg.norm(rows[-1]))
            if size == 0.0 or np.abs(rows @ np.array([way[1], -way[0]])).max() > STRAIGHT_MM * size:
                continue
            rise = self._face.point(*edge.rows[-1])[2] - self._face.point(*edge.rows[0])[2]
            if all(abs(float(way[0] * other[1] - way[1] * other[0])) > 1e-7 * size for _, other in found):
                found.append((abs(float(rise)) / size, way / size))
        return [way for _, way in sorted(found, key=lambda one: -one[0])]

    def steepest(self) -> Array | None:
        """The direction (2,) in which a plane face rises most; None of a level one."""
        origin = self._face.point(0.0, 0.0)[2]
        rise = np.array([self._face.point(1.0, 0.0)[2] - origin, self._face.point(0.0, 1.0)[2] - origin])
        size = float(np.linalg.norm(rise))
        return rise / size if size > STRAIGHT_MM else None

    def corners(self) -> Array | None:
        """The four corners (4, 3) of one wire of straight edges, mm; None where it is another outline."""
        if len(self.wires) != 1 or len(self.wires[0]) < 4:
            return None
        found: list[tuple[Array, Array]] = []
        for edge in self.wires[0]:
            rows = np.array([self._face.point(u, v) for u, v in edge.rows[::8]])
            way = (rows[-1] - rows[0]) / (float(np.linalg.norm(rows[-1] - rows[0])) or 1.0)
            if np.abs(np.cross(rows - rows[0], way)).max() > STRAIGHT_MM:
                return None
            found.append((rows[0], rows[-1]))
        row = _turns(_chained(found))
        return row if len(row) == 4 else None
