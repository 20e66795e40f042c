"""A part from two opposite corners as SVG, every face with its number: which is which before any is cut."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SIZE = 700.0  # of a view, in px
MARGIN = 30.0
FINE = 400.0  # a part's diagonal is so many times as long as a chord may be off
CUT, OTHER = (86, 156, 214), (150, 150, 150)  # what can be cut along rulings, and what cannot
LIGHT = 0.45  # of a face that is seen edge on


class Shown(NamedTuple):
    """One face: ``triangles`` (N, 3, 3) in mm, counter-clockwise from outside."""

    number: int
    triangles: Array
    cuttable: bool


def middle(triangles: Array) -> tuple[Array, Array]:
    """A point of a face near its middle, (3,) mm, and the unit normal out of the material there."""
    if not len(triangles):
        return np.full(3, math.nan), np.full(3, math.nan)
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    areas, centres = np.linalg.norm(normals, axis=1), triangles.mean(axis=1)
    mean = (areas[:, None] * centres).sum(axis=0) / (areas.sum() or 1.0)
    sound = areas > 1e-9 * areas.max()
    near = np.where(sound, np.linalg.norm(centres - mean, axis=1), np.inf).argmin()
    return centres[near], normals[near] / (areas[near] or 1.0)


def drawn(faces: Sequence[Shown]) -> str:
    """The SVG: from the front, right and above, and from the back, left and below."""
    views = [_view(faces, np.array(eye)) for eye in ((1.0, -1.3, 0.9), (-1.0, 1.3, -0.9))]
    width = 2 * SIZE
    body = "\n".join(f'<g transform="translate({i * SIZE:g} 0)">{view}</g>' for i, view in enumerate(views))
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {SIZE:g}" font-family="sans-serif">'
    )
    paper = f'<rect width="{width:g}" height="{SIZE:g}" fill="white"/>'
    return f"{head}\n{paper}\n{body}\n</svg>\n"


def _view(faces: Sequence[Shown], eye: Array) -> str:
    """What is far is painted first; a number stands on every face that is turned to the eye."""
    to_eye = eye / np.linalg.norm(eye)
    right = np.cross([0.0, 0.0, 1.0], to_eye)
    right /= np.linalg.norm(right)
    base = np.array([right, np.cross(to_eye, right), to_eye])
    corners = (
        np.concatenate([np.zeros((1, 3)), *(face.triangles.reshape(-1, 3) for face in faces)])[1:] @ base.T
    )
    low, high = corners.min(axis=0), corners.max(axis=0)
    scale = (SIZE - 2 * MARGIN) / max(*(high - low)[:2], 1e-9)

    def flat(points: Array) -> Array:
        xy = (points @ base.T)[..., :2]
        return np.stack(
            [MARGIN + scale * (xy[..., 0] - low[0]), MARGIN + scale * (high[1] - xy[..., 1])], axis=-1
        )

    painted = [(depth, text) for face in faces for depth, text in _triangles(face, to_eye, flat)]
    marks = [_number(face, to_eye, flat) for face in faces]
    return "\n".join([*(text for _, text in sorted(painted)), *filter(None, marks)])


def _triangles(face: Shown, to_eye: Array, flat: Callable[[Array], Array]) -> list[tuple[float, str]]:
    normals = np.cross(
        face.triangles[:, 1] - face.triangles[:, 0], face.triangles[:, 2] - face.triangles[:, 0]
    )
    lengths = np.linalg.norm(normals, axis=1)
    found = []
    for corners, normal, length in zip(face.triangles, normals, lengths, strict=True):
        if length <= 0.0:
            continue
        bright = LIGHT + (1.0 - LIGHT) * abs(float(normal @ to_eye)) / length
        colour = "#" + "".join(f"{round(part * bright):02x}" for part in (CUT if face.cuttable else OTHER))
        points = " ".join(f"{x:.1f},{y:.1f}" for x, y in flat(corners))
        depth = float((corners @ to_eye).mean())
        found.append((depth, f'<polygon points="{points}" fill="{colour}" stroke="{colour}"/>'))
    return found


def _number(face: Shown, to_eye: Array, flat: Callable[[Array], Array]) -> str:
    at, normal = middle(face.triangles)
    if not math.isfinite(at[0]) or float(normal @ to_eye) < -1e-12:
        return ""
    x, y = flat(at)
    look = 'text-anchor="middle" font-size="20" font-weight="bold" stroke="white" stroke-width="4"'
    return f'<text x="{x:.1f}" y="{y + 7:.1f}" {look} paint-order="stroke">{face.number}</text>'


def fine(points: Sequence[Array]) -> float:
    """How far (mm) a chord may be off in a picture of a part with these points on its edges."""
    rows = np.concatenate([np.zeros((0, 3)), *points])
    return float(np.linalg.norm(np.ptp(rows, axis=0))) / FINE if len(rows) > 1 else 0.1
