"""What the faces of a part are to each other: blades, the hub they stand on, the fillets between, the rest.

- *turned*: of revolution about the axis of the part, that of most of its cylinders and cones;
- *fillet*: goes over into two neighbours smoothly and turns between them; one is ruled across the edge;
- *blade*: ruled, and stands with one end of its rulings on something turned, or on a fillet beside it;
- *hub*: turned, and a blade stands on it;
- *wall*: any other that is ruled and stands on something.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from controller.cad.kernel import Failure, failures
from controller.cad.strip import STANDS_MOSTLY, Strip
from controller.geometry.arrays import Array

if TYPE_CHECKING:
    from controller.cad.kernel import Face, Meeting


SMOOTH = math.cos(math.radians(2.0))  # normals of two faces at an edge that is none
TURNS = math.cos(math.radians(15.0))  # a fillet turns by more
ACROSS = math.cos(math.radians(30.0))  # an edge that is no ruling
ON_MM = 1e-2  # a blade's lower edge is on its hub
SKEW_MM = 1e-3  # normals of a face of revolution pass its axis so near
SAME_AXIS = 1e-6

ROLES = ("blade", "fillet", "hub", "turned", "wall")


def roles(
    faces: Sequence[Face], strips: Mapping[int, Sequence[Strip]], meetings: Sequence[Meeting]
) -> dict[int, str]:
    """Number of a face -> one of ``ROLES``, or "" where it is none of them."""
    axis = _axis(faces)
    turned = {face.number for face in faces if axis is not None and _is_turned(face, *axis)}
    fillets = {face.number for face in faces if _is_fillet(face, strips, meetings)} - turned
    smooth = _smooth_neighbours(meetings)
    found = {face.number: "" for face in faces}
    found |= {number: "turned" for number in turned} | {number: "fillet" for number in fillets}
    for face in faces:
        made = strips.get(face.number, ())
        if found[face.number] or not made or made[0].stands <= STANDS_MOSTLY:
            continue
        hubs = {n for n in turned if _stands_on(made[0], faces[n - 1])}
        hubs |= {n for fillet in smooth[face.number] & fillets for n in smooth[fillet] & turned}
        found[face.number] = "blade" if hubs else "wall"
        found |= {n: "hub" for n in hubs}
    return found


def _axis(faces: Sequence[Face]) -> tuple[Array, Array] | None:
    """A point and the direction of the axis that most of the area of cylinders and cones is about."""
    groups: list[tuple[Array, Array, float]] = []
    for face in faces:
        made = face.turned()
        if made is None:
            continue
        at, way = made
        for k, (point, direction, area) in enumerate(groups):
            aside = np.linalg.norm(np.cross(at - point, direction))
            if np.linalg.norm(np.cross(way, direction)) < SAME_AXIS and aside < SKEW_MM:
                groups[k] = (point, direction, area + face.area_mm2)
                break
        else:
            groups.append((at, way, face.area_mm2))
    best = max(groups, key=lambda group: group[2], default=None)
    return None if best is None else (best[0], best[1])


def _is_turned(face: Face, at: Array, way: Array) -> bool:
    """Whether the normals of a face meet an axis; of a plane, whether it is square to it."""
    try:
        with failures():
            points, normals = face.samples()
    except Failure:
        return False
    if not len(points):
        return False
    if face.kind == "plane":
        return bool(np.linalg.norm(np.cross(normals, way), axis=1).max() < SAME_AXIS)
    skew = np.abs(np.cross(points - at, normals) @ way)
    return bool(skew.max() < SKEW_MM)


def _is_fillet(face: Face, strips: Mapping[int, Sequence[Strip]], meetings: Sequence[Meeting]) -> bool:
    smooth: dict[int, Array] = {}
    across = False
    for one in meetings:
        if face not in one.faces or not _is_smooth(one):
            continue
        other = one.faces[0] if one.faces[1] is face else one.faces[1]
        smooth[other.number] = one.normals[0][1]
        made = strips.get(other.number, ())
        across |= bool(made) and abs(float(one.ways[1] @ _ruling(made[0], one.points[1]))) < ACROSS
    ways = list(smooth.values())
    return across and any(float(a @ b) < TURNS for k, a in enumerate(ways) for b in ways[:k])


def _ruling(strip: Strip, point: Array) -> Array:
    """The unit direction of the ruling of a strip that is nearest to a point (3,)."""
    share = np.linspace(0.0, 1.0, 201)
    low, high = strip.lower.at(share), strip.upper.at(share)
    ways = (high - low) / np.maximum(np.linalg.norm(high - low, axis=1), 1e-12)[:, None]
    off = np.linalg.norm(np.cross(point - low, ways), axis=1)
    return np.asarray(ways[int(off.argmin())])


def _stands_on(strip: Strip, face: Face) -> bool:
    low = strip.lower.at(np.array([0.3, 0.5, 0.7]))
    return any(face.distance(point) < ON_MM for point in low)


def _is_smooth(one: Meeting) -> bool:
    return bool((one.normals[0] * one.normals[1]).sum(axis=1).min() >= SMOOTH)


def _smooth_neighbours(meetings: Sequence[Meeting]) -> defaultdict[int, set[int]]:
    """Numbers of faces -> those that they go over into without an edge."""
    found: defaultdict[int, set[int]] = defaultdict(set)
    for one in filter(_is_smooth, meetings):
        a, b = (face.number for face in one.faces)
        found[a].add(b)
        found[b].add(a)
    return found
