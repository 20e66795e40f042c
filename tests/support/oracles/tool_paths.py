"""Where the tool is and how far off its path, by other means than the controller's.

Forward kinematics by rotation matrices, NURBS by scipy's B-splines in homogeneous
coordinates, lines by projection. Of ``controller`` only the machine's data are used.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.interpolate import BSpline
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from controller.machine.model import Kind, Machine

Curve = Callable[[np.ndarray], np.ndarray]  # u (N,) -> points or unit vectors (N, 3)


def tool(
    joints: np.ndarray, machine: Machine, length_mm: float, offset: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """(tip, axis) of joints (N, 5) in the part frame of G54 + ``offset``, each (N, 3)."""
    joints = np.atleast_2d(joints)
    tip = joints[:, list(machine.linear())].astype(float)
    rotaries = [(i, machine.axes[i]) for i in machine.rotary()]
    vector = np.tile([0.0, 0.0, -length_mm], (len(joints), 1))
    axis = np.tile([0.0, 0.0, 1.0], (len(joints), 1))
    for i, row in reversed([r for r in rotaries if r[1].kind is Kind.HEAD]):
        turn, point = _turn(row.direction, joints[:, i]), np.asarray(row.point_mm, dtype=float)
        vector, axis = turn.apply(vector - point) + point, turn.apply(axis)
    tip = tip + vector
    for i, row in [r for r in rotaries if r[1].kind is Kind.TABLE]:
        turn, point = _turn(row.direction, -joints[:, i]), np.asarray(row.point_mm, dtype=float)
        tip, axis = turn.apply(tip - point) + point, turn.apply(axis)
    frame = machine.offsets[offset]
    columns = np.array([frame.x, frame.y, frame.z], dtype=float).T
    return (tip - np.asarray(frame.origin, dtype=float)) @ columns, axis @ columns


def _turn(direction: Sequence[float], angle: np.ndarray) -> Rotation:
    way = np.asarray(direction, dtype=float)
    return Rotation.from_rotvec(np.outer(angle, way / np.linalg.norm(way)))


def degrees_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angles between rows of unit vectors, exact for tiny ones."""
    sine, cosine = np.linalg.norm(np.cross(a, b), axis=1), np.einsum("ij,ij->i", a, b)
    return np.degrees(np.arctan2(sine, cosine))


# --- surfaces


class RuledNurbs:
    """Two rational B-spline curves over the same parameter, ruled at equal u from 0 to 1 of their knots."""

    def __init__(
        self,
        upper: np.ndarray,
        lower: np.ndarray,
        degree: tuple[int, int],
        knots: tuple[Sequence[float], Sequence[float]],
        weights: tuple[Sequence[float], Sequence[float]],
    ) -> None:
        self._upper = _rational(upper, degree[0], knots[0], weights[0])
        self._lower = _rational(lower, degree[1], knots[1], weights[1])

    def contact(self, u: np.ndarray) -> np.ndarray:
        return _point(self._lower, u, 0)

    def axis(self, u: np.ndarray) -> np.ndarray:
        ruling = _point(self._upper, u, 0) - self.contact(u)
        return ruling / np.linalg.norm(ruling, axis=1)[:, None]

    def tip(self, u: np.ndarray, offset: float) -> np.ndarray:
        normal = np.cross(-self.axis(u), _point(self._lower, u, 1))
        return self.contact(u) + offset * normal / np.linalg.norm(normal, axis=1)[:, None]

    @property
    def length(self) -> float:
        u = np.linspace(0.0, 1.0, 20001)
        return float(np.linalg.norm(np.diff(self.contact(u), axis=0), axis=1).sum())


def _rational(points: np.ndarray, degree: int, knots: Sequence[float], weights: Sequence[float]) -> BSpline:
    w = np.asarray(weights, dtype=float)[:, None]
    t = np.asarray(knots, dtype=float)
    first, last = t[degree], t[-degree - 1]
    return BSpline((t - first) / (last - first), np.hstack([np.asarray(points) * w, w]), degree)


def _point(spline: BSpline, u: np.ndarray, order: int) -> np.ndarray:
    h = spline(u)
    point = h[:, :3] / h[:, 3:]
    if order == 0:
        return np.asarray(point)
    d = spline.derivative()(u)
    return np.asarray((d[:, :3] - point * d[:, 3:]) / h[:, 3:])


def off_curve(
    tips: np.ndarray, axes: np.ndarray, tip: Curve, axis: Curve, guess: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(mm, degrees, u): distance from the curve of tips at its nearest place, and the axis' error there."""
    u, h = guess.astype(float).copy(), 1e-6
    for _ in range(6):
        low, high = np.clip(u - h, 0.0, 1.0), np.clip(u + h, 0.0, 1.0)
        d = (tip(high) - tip(low)) / (high - low)[:, None]
        u = np.clip(u + np.einsum("ij,ij->i", tips - tip(u), d) / np.einsum("ij,ij->i", d, d), 0.0, 1.0)
    return np.linalg.norm(tips - tip(u), axis=1), degrees_between(axes, axis(u)), u


# --- lines


def great_circle(a: np.ndarray, b: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Unit vectors turning evenly from a to b, (N, 3)."""
    angle = float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))
    if angle < 1e-12:
        return np.tile(a, (len(share), 1))
    wa, wb = np.sin((1.0 - share) * angle), np.sin(share * angle)
    return np.asarray((wa[:, None] * a + wb[:, None] * b) / np.sin(angle))


def off_polyline(
    tips: np.ndarray, nodes: np.ndarray, window: int = 40
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(mm, segment, share) of points (N, 3) that run along a polyline of nodes (M, 3) from its beginning.

    The search goes on from the last point's segment and never back by more than a few, so
    a path that crosses itself or doubles back is not cut short.
    """
    starts, ways = nodes[:-1], np.diff(nodes, axis=0)
    squares = np.maximum(np.einsum("ij,ij->i", ways, ways), 1e-300)
    off, segment, share = np.empty(len(tips)), np.empty(len(tips), dtype=int), np.empty(len(tips))
    at = 0
    for n, p in enumerate(tips):
        low, high = max(0, at - 5), min(len(starts), at + window)
        gap = p - starts[low:high]
        t = np.clip(np.einsum("ij,ij->i", gap, ways[low:high]) / squares[low:high], 0.0, 1.0)
        d = np.linalg.norm(gap - t[:, None] * ways[low:high], axis=1)
        k = int(d.argmin())
        off[n], segment[n], share[n] = d[k], low + k, t[k]
        at = max(at, low + k)
    return off, segment, share


def off_points(points: np.ndarray, way: np.ndarray) -> np.ndarray:
    """Distance (N,) of points (N, 3) from a dense polyline (M, 3), wherever on it they are nearest."""
    _, near = cKDTree(way).query(points)
    found = np.full(len(points), np.inf)
    for shift in (-1, 0):
        k = np.clip(near + shift, 0, len(way) - 2)
        chord, gap = way[k + 1] - way[k], points - way[k]
        square = np.maximum(np.einsum("ij,ij->i", chord, chord), 1e-300)
        share = np.clip(np.einsum("ij,ij->i", gap, chord) / square, 0.0, 1.0)
        found = np.minimum(found, np.linalg.norm(gap - share[:, None] * chord, axis=1))
    return found


def between_ticks(joints: np.ndarray, per_tick: int = 4) -> np.ndarray:
    """Joints (N, 5) with ``per_tick`` - 1 places between two ticks, by cubics through four ticks each."""
    inner = joints[1:-1]
    made = []
    for k in range(per_tick):
        x = k / per_tick
        w = np.array(
            [
                -x * (x - 1) * (x - 2) / 6,
                (x + 1) * (x - 1) * (x - 2) / 2,
                -(x + 1) * x * (x - 2) / 2,
                (x + 1) * x * (x - 1) / 6,
            ]
        )
        made.append(sum(w[i] * joints[i : len(inner) - 1 + i] for i in range(4)))
    return np.stack(made, axis=1).reshape(-1, joints.shape[1])
