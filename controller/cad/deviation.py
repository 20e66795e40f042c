"""How far the surface that a program says is from the CAD face that it was made from, both ways.

The program's text is read again, so whatever it lost is in the figures. The places are those of
a low-discrepancy sequence: none of them is a place at which anything was fitted.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np
from scipy.spatial import cKDTree

from controller.cad.outline import Outline
from controller.geometry.arrays import Array
from controller.geometry.surfaces import Surface
from controller.program.program import Block, CutCone, CutNurbs, CutRuled

if TYPE_CHECKING:
    from controller.cad.kernel import Face
    from controller.cad.strip import Strip


ONTO_FACE = 240  # points of the written surface
ONTO_WRITTEN = 2000  # points of the face
PER_EDGE = 64
STEPS = np.array([0.7548776662466927, 0.5698402909980532])  # the plastic number's: even in two dimensions
FIRST_GRID = (257, 17)
ROUNDS = 25


@dataclass(frozen=True, slots=True)
class Deviation:
    """Largest distances, mm: of the written surface from the face, and of the face from it."""

    to_face_mm: float
    to_written_mm: float

    @property
    def largest_mm(self) -> float:
        return max(self.to_face_mm, self.to_written_mm)


def places(count: int) -> tuple[Array, Array]:
    """Shares of two parameters, each (count,)."""
    rows = np.mod(0.5 + np.arange(1, count + 1)[:, None] * STEPS, 1.0)
    return rows[:, 0], rows[:, 1]


def surfaces(blocks: Iterable[Block]) -> list[Surface]:
    """What a program cuts, in its order."""
    from controller.plan.surfaces.cuts import surface_of

    return [surface_of(block) for block in blocks if isinstance(block, CutCone | CutRuled | CutNurbs)]


def deviation(strip: Strip, written: Surface) -> Deviation:
    """Of one strip from its face.

    What it cuts more than the face is compared with the face's own rulings, prolonged; what it leaves on
    purpose is not looked at.
    """
    to_face = 0.0
    if not strip.is_whole_box:
        u, v = places(ONTO_FACE)
        # Corners and edges too: what is too long shows there.
        u, v = (
            np.concatenate([u, [0.0, 1.0, 0.0, 1.0], u[:20], u[:20]]),
            np.concatenate([v, [0.0, 0.0, 1.0, 1.0], np.zeros(20), np.ones(20)]),
        )
        points = _points(written, u, v)
        if strip.base is not None and (strip.prolonged_mm > 0.0 or strip.bridges):
            to_face = float(distances(strip.base, points, prolonged=True).max())
        else:
            of = [cast("Face", part.face) for part in strip.joined or (strip,)]
            to_face = max(min(face.distance(point) for face in of) for point in points)
    return Deviation(to_face, float(distances(written, face_points(strip)).max()))


def face_points(strip: Strip) -> Array:
    """Points (N, 3) of what a strip cuts of its faces, edges of the faces among them."""
    if strip.joined:
        return np.concatenate([face_points(part) for part in strip.joined])
    face = cast("Face", strip.face)
    outline = Outline(face)
    box = outline.box
    u, v = places(ONTO_WRITTEN)
    rows = [
        (a, b)
        for a, b in zip(box[0] + u * (box[1] - box[0]), box[2] + v * (box[3] - box[2]), strict=True)
        if face.holds(a, b)
    ]
    if strip.covers is None:
        inside = np.array([face.point(a, b) for a, b in rows]).reshape(-1, 3)
        return np.concatenate([inside, face.edge_points(PER_EDGE)])
    rows += [(float(a), float(b)) for wire in outline.wires for edge in wire for a, b in edge.rows]
    return np.array([face.point(a, b) for a, b in rows if strip.covers(a, b)]).reshape(-1, 3)


def _points(surface: Surface, u: Array, v: Array) -> Array:
    return np.stack([np.broadcast_to(c, u.shape) for c in surface.point(u, v, np)], axis=1)


def distances(surface: Surface, points: Array, prolonged: bool = False) -> Array:
    """From points (N, 3) to the whole of a ruled surface, (N,) mm: nearest of a grid, then Gauss-Newton.

    Both halves of the way along are tried: where a surface closes, its two ends are one place.
    ``prolonged``: its rulings do not end.
    """
    return np.minimum(*(_from_half(surface, points, half, prolonged) for half in (0.0, 0.5)))


def _from_half(surface: Surface, points: Array, half: float, prolonged: bool) -> Array:
    u, v = _nearest(surface, points, half)
    best = np.full(len(points), np.inf)
    for _ in range(ROUNDS):
        off = points - _points(surface, u, v)
        best = np.minimum(best, np.linalg.norm(off, axis=1))
        u, v = _stepped(surface, u, v, off, math.inf if prolonged else 0.0)
    return best


def _nearest(surface: Surface, points: Array, half: float) -> tuple[Array, Array]:
    along, across = np.linspace(half, half + 0.5, FIRST_GRID[0]), np.linspace(0.0, 1.0, FIRST_GRID[1])
    a, b = (m.ravel() for m in np.meshgrid(along, across, indexing="ij"))
    _, nearest = cKDTree(_points(surface, a, b)).query(points)
    return a[nearest], b[nearest]


def _stepped(surface: Surface, u: Array, v: Array, off: Array, more: float) -> tuple[Array, Array]:
    """One step of Gauss-Newton; a side of the square that a step would leave is kept to.

    Across the square is as much larger as ``more`` on both sides.
    """
    upper, lower = (_rows(c.derivative(u, 1, np), u) for c in (surface.upper, surface.lower))
    su = (1.0 - v)[:, None] * upper + v[:, None] * lower
    sv = -_rows(surface.ruling(u, np), u)
    for _ in range(2):
        uu, uv, vv = ((a * b).sum(axis=1) for a, b in ((su, su), (su, sv), (sv, sv)))
        fu, fv = (su * off).sum(axis=1), (sv * off).sum(axis=1)
        det = uu * vv - uv * uv
        sound = det > 1e-14 * uu * vv
        safe = np.where(sound, det, 1.0)
        du = np.where(sound, (vv * fu - uv * fv) / safe, fu / np.maximum(uu, 1e-30) * (uu > 0.0))
        dv = np.where(sound, (uu * fv - uv * fu) / safe, fv / np.maximum(vv, 1e-30) * (vv > 0.0))
        out_u, out_v = (u + du < 0.0) | (u + du > 1.0), (v + dv < -more) | (v + dv > 1.0 + more)
        # What is held at a side takes no part in the other's step.
        held_u, held_v = out_u & ((u <= 0.0) | (u >= 1.0)), out_v & ((v <= -more) | (v >= 1.0 + more))
        su, sv = np.where(held_u[:, None], 0.0, su), np.where(held_v[:, None], 0.0, sv)
        if not (held_u.any() or held_v.any()):
            break
    return np.clip(u + du, 0.0, 1.0), np.clip(v + dv, -more, 1.0 + more)


def _rows(vector: tuple[Array, Array, Array], like: Array) -> Array:
    return np.stack([np.broadcast_to(np.asarray(c, dtype=float), like.shape) for c in vector], axis=1)
