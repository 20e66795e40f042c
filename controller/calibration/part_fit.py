"""How a part lies on the table: the work offset that fits touches on it best, and what it then deviates by.

A touch is the ball's centre p in the part frame; its deviation is n . (p - r n - foot), n out of the material
towards the ball and r the ball's radius: above 0 there is too much of the part. Sought are moves and turns of
the part frame along and about its own axes, as many of the six as are free; least squares, repeated
(Gauss-Newton on the tangent planes, as point-to-plane registration: Chen and Medioni 1992).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.calibration import DOFS
from controller.calibration.features import Feature
from controller.calibration.refusal import Refusal
from controller.calibration.touch_table import Touches
from controller.geometry.arrays import Array
from controller.geometry.vectors import Frame
from controller.machine.changes import turned_deg
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine

ROUNDS, DONE_MM = 30, 1e-7
BOUND = 4.0  # standard deviations
BLIND = 1e-3  # of the best seen direction, at the size of the part: nothing tells of it


@dataclass(frozen=True, eq=False)
class PartFit:
    """The offset as found, and the touches as they are in it."""

    frame: Frame
    free: str  # of ``DOFS``
    deviations: Array  # (N,) mm, above 0: too much material
    before: Array  # (N,) likewise in the offset as it was
    points: Array  # (N, 3) where the surface was touched, part frame
    uv: Array  # (N, 2), nan where the feature has none
    beside: NDArray[np.bool_]  # (N,) nearest to an edge: left out of the fit
    scatter_mm: float
    bounds: Mapping[str, float]  # of every free one: mm, rad


def fit(
    touches: Touches, features: Mapping[str, Feature], machine: Machine, start: Frame, free: str = DOFS
) -> PartFit:
    """``features`` by the names in the table. Raises Refusal where the touches do not tell what is free."""
    centres, ways = on_table(touches, machine)
    rows = {
        name: np.flatnonzero(np.asarray(touches.features) == name) for name in dict.fromkeys(touches.features)
    }
    part = _Part(centres, ways, touches.radius_mm, [(features[name], own) for name, own in rows.items()])
    columns = [DOFS.index(one) for one in free]
    origin, axes = np.array(start.origin), np.array([start.x, start.y, start.z]).T
    before = part.seen(origin, axes)
    seen = before
    for _ in range(ROUNDS if free else 0):
        J = part.jacobian(seen)[:, columns]
        used = ~seen.beside
        if used.sum() < len(columns):
            raise Refusal("too_few_free", touches=int(used.sum()), free=free)
        _look(J[used], free, part.size)
        step = np.zeros(6)
        step[columns] = -np.linalg.lstsq(J[used], seen.deviations[used], rcond=None)[0]
        origin, axes = origin + axes @ step[:3], axes @ _turn(step[3:])
        seen = part.seen(origin, axes)
        if np.abs(step[:3]).max() + part.size * np.abs(step[3:]).max() < DONE_MM:
            break
    scatter, bounds = _spread(part.jacobian(seen)[:, columns], seen, free)
    x, y, z = (tuple(float(c) for c in axes[:, k]) for k in range(3))
    frame = Frame(_three(origin), _three(x), _three(y), _three(z))
    uv = np.column_stack([seen.u, seen.v])
    return PartFit(
        frame, free, seen.deviations, before.deviations, seen.points, uv, seen.beside, scatter, bounds
    )


def on_table(touches: Touches, machine: Machine) -> tuple[Array, Array]:
    """Centres of the ball and the ways that it went, both (N, 3), table frame."""
    kinematics, linear = kinematics_of(machine), list(machine.linear())
    back = touches.joints.copy()
    back[:, linear] -= touches.ways
    length: Any = touches.length_mm
    now, before = (
        np.column_stack([np.broadcast_to(c, len(q)) for c in kinematics.forward(list(q.T), length, np).tip])
        for q in (touches.joints, back)
    )
    return now, now - before


@dataclass(frozen=True, eq=False)
class _Seen:
    deviations: Array
    normals: Array
    points: Array
    u: Array
    v: Array
    beside: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class _Part:
    """The touches on the table, with the feature of each."""

    centres: Array
    ways: Array
    radius_mm: Array
    features: Sequence[tuple[Feature, NDArray[np.int64]]]

    @property
    def size(self) -> float:
        """How far the touches are apart, mm: a turn counts as much as it moves them."""
        return max(1.0, float(np.linalg.norm(np.ptp(self.centres, axis=0))))

    def seen(self, origin: Array, axes: Array) -> _Seen:
        """All touches in a part frame."""
        balls, ways = (self.centres - origin) @ axes, self.ways @ axes
        n = len(balls)
        made = _Seen(
            np.empty(n), np.empty((n, 3)), np.empty((n, 3)), np.empty(n), np.empty(n), np.empty(n, bool)
        )
        for feature, rows in self.features:
            out = -ways[rows]
            for _ in range(4):  # the ball touches where its own normal says
                contacts = balls[rows] - self.radius_mm[rows, None] * out
                feet = feature.feet(contacts)
                side = np.where((feet.normals * ways[rows]).sum(axis=1) > 0.0, -1.0, 1.0)
                out = feet.normals * side[:, None]
            contacts = balls[rows] - self.radius_mm[rows, None] * out
            made.deviations[rows] = (out * (contacts - feet.points)).sum(axis=1)
            made.normals[rows], made.points[rows] = out, contacts
            made.u[rows], made.v[rows], made.beside[rows] = feet.u, feet.v, feet.at_edge
        return made

    @staticmethod
    def jacobian(seen: _Seen) -> Array:
        """(N, 6): of the deviations by moves of the part frame (mm) and by its turns (rad)."""
        return np.hstack([-seen.normals, -np.cross(seen.points, seen.normals)])


def _look(J: Array, free: str, size: float) -> None:
    """Refuses what the touches do not tell, by the name of what they tell least of."""
    scaled = J / np.array([1.0 if one in "XYZ" else size for one in free])
    _, values, directions = np.linalg.svd(scaled)
    if values[-1] < BLIND * values[0]:
        raise Refusal("blind", name=free[int(np.argmax(np.abs(directions[-1])))], free=free)


def _spread(J: Array, seen: _Seen, free: str) -> tuple[float, dict[str, float]]:
    used = ~seen.beside
    r = seen.deviations[used]
    left = len(r) - len(free)
    scatter = math.sqrt(float(r @ r) / left) if left > 0 else math.nan
    if not free or left <= 0:
        return scatter, {}
    covariance = scatter**2 * np.linalg.inv(J[used].T @ J[used])
    return scatter, {one: BOUND * math.sqrt(covariance[k, k]) for k, one in enumerate(free)}


def _turn(v: Array) -> Array:
    """The rotation matrix of a small turn vector (Rodrigues)."""
    angle = float(np.linalg.norm(v))
    if angle < 1e-15:
        return np.eye(3)
    x, y, z = v / angle
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + math.sin(angle) * K + (1.0 - math.cos(angle)) * K @ K)


def _three(values: Any) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in values)
    return x, y, z


def report(found: PartFit, touches: Touches) -> dict[str, Any]:
    """Millimetres and degrees of the offset, micrometres of the deviations."""
    used = ~found.beside
    rows = [
        {
            "touch": k + 1,
            "feature": touches.features[k],
            "u": None if math.isnan(found.uv[k, 0]) else float(found.uv[k, 0]),
            "v": None if math.isnan(found.uv[k, 1]) else float(found.uv[k, 1]),
            "point_mm": [float(c) for c in found.points[k]],
            "deviation_um": 1e3 * float(found.deviations[k]),
            "beside": bool(found.beside[k]),
        }
        for k in range(len(touches))
    ]
    return {
        "origin_mm": list(found.frame.origin),
        "turned_deg": list(turned_deg(found.frame)),
        "free": found.free,
        "scatter_um": None if math.isnan(found.scatter_mm) else 1e3 * found.scatter_mm,
        "bounds": {
            one: 1e3 * value if one in "XYZ" else math.degrees(value) for one, value in found.bounds.items()
        },
        "before_um": _figures(found.before[used]),
        "after_um": _figures(found.deviations[used]),
        "touches": rows,
    }


def _figures(values: Array) -> dict[str, float]:
    return {
        "rms": 1e3 * float(np.sqrt(np.mean(values**2))),
        "most": 1e3 * float(values.max()),
        "least": 1e3 * float(values.min()),
    }
