"""A part from two opposite corners as SVG: faces shaded, numbered where they are seen, with their rulings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from controller.geometry.arrays import Array

Colour = tuple[int, int, int]

SIZE = 700.0  # of a view, in px
MARGIN = 30.0
ROW = 24.0  # of the legend, in px
FINE = 400.0  # a part's diagonal is so many times as long as a chord may be off
OTHER: Colour = (165, 165, 165)  # what cannot be cut along rulings
NO_TOOL: Colour = (214, 120, 86)  # what could be, by no tool of the table
OF_TOOLS: tuple[Colour, ...] = (
    (86, 156, 214),
    (106, 176, 98),
    (196, 168, 60),
    (160, 120, 200),
    (90, 180, 180),
)
LIGHT = 0.45  # of a face that is seen edge on
RULINGS, PIECES = 13, 8  # of a strip, and of each ruling
CELLS = 350  # of the picture that says which face is in front, each way
IN_FRONT = 8e-3  # share of the part's size: what is so little behind a face is on it


class Shown(NamedTuple):
    """One face: ``triangles`` (N, 3, 3) in mm, counter-clockwise from outside, and ``rulings`` (M, 2, 3)."""

    number: int
    triangles: Array
    rulings: Array
    colour: Colour
    is_of_body: bool  # its back is never seen


def middle(triangles: Array) -> tuple[Array, Array]:
    """A point of a face near its middle, (3,) mm, and the unit normal out of the material there."""
    if not len(triangles):
        return np.full(3, math.nan), np.full(3, math.nan)
    normals = _normals(triangles)
    areas, centres = np.linalg.norm(normals, axis=1), triangles.mean(axis=1)
    mean = (areas[:, None] * centres).sum(axis=0) / (areas.sum() or 1.0)
    sound = areas > 1e-9 * areas.max()
    near = np.where(sound, np.linalg.norm(centres - mean, axis=1), np.inf).argmin()
    return centres[near], normals[near] / (areas[near] or 1.0)


def colour_of(tool: int, tools: Sequence[int]) -> Colour:
    """Of what a tool of the table cuts, all tools by their numbers."""
    return OF_TOOLS[sorted(tools).index(tool) % len(OF_TOOLS)]


def drawn(faces: Sequence[Shown], legend: Sequence[tuple[Colour, str]]) -> str:
    """The SVG: from the front, right and above, and from the back, left and below; the legend under both."""
    width, height = 2 * SIZE, SIZE + ROW * (len(legend) + 1)
    views = [_View(faces, np.array(eye)).drawn() for eye in ((1.0, -1.3, 0.9), (-1.0, 1.3, -0.9))]
    body = [f'<g transform="translate({i * SIZE:g} 0)">{view}</g>' for i, view in enumerate(views)]
    for k, (colour, words) in enumerate(legend):
        y = SIZE + ROW * k
        body.append(f'<rect x="{MARGIN:g}" y="{y:g}" width="16" height="16" fill="{_hex(colour, 1.0)}"/>')
        body.append(f'<text x="{MARGIN + 26:g}" y="{y + 14:g}" font-size="16">{_plain(words)}</text>')
    box = f'viewBox="0 0 {width:g} {height:g}" font-family="sans-serif"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {box}>'
    paper = f'<rect width="{width:g}" height="{height:g}" fill="white"/>'
    return "\n".join([head, paper, *body, "</svg>", ""])


class _View:
    """The part as one eye far away sees it: right, up and depth of its points in px."""

    def __init__(self, faces: Sequence[Shown], eye: Array) -> None:
        self._faces, self._to_eye = faces, eye / np.linalg.norm(eye)
        right = np.cross([0.0, 0.0, 1.0], self._to_eye)
        right /= np.linalg.norm(right)
        self._base = np.array([right, np.cross(self._to_eye, right), self._to_eye])
        corners = np.concatenate([np.zeros((1, 3)), *(face.triangles.reshape(-1, 3) for face in faces)])[1:]
        seen = corners @ self._base.T if len(corners) else np.zeros((1, 3))
        self._low, high = seen.min(axis=0), seen.max(axis=0)
        self._top = float(high[1])
        self._scale = (SIZE - 2 * MARGIN) / max(*(high - self._low)[:2], 1e-9)

    def _flat(self, points: Array) -> Array:
        """Points (..., 3) as x, y and depth in px, the nearest with the largest."""
        seen = points @ self._base.T
        x = MARGIN + self._scale * (seen[..., 0] - self._low[0])
        y = MARGIN + self._scale * (self._top - seen[..., 1])
        return np.stack([x, y, self._scale * seen[..., 2]], axis=-1)

    def drawn(self) -> str:
        """What is far is painted first; numbers last."""
        painted = [one for face in self._faces for one in self._triangles(face)]
        front = self._front()
        lines = [line for face in self._faces for line in self._rulings(face, front)]
        marks = [self._number(face, front) for face in self._faces]
        return "\n".join([*(text for _, text in sorted(painted)), *lines, *filter(None, marks)])

    def _triangles(self, face: Shown) -> list[tuple[float, str]]:
        normals = _normals(face.triangles)
        lengths = np.linalg.norm(normals, axis=1)
        found = []
        for corners, normal, length in zip(self._flat(face.triangles), normals, lengths, strict=True):
            toward = float(normal @ self._to_eye)
            if length <= 0.0 or (face.is_of_body and toward < 0.0):
                continue
            bright = LIGHT + (1.0 - LIGHT) * abs(toward) / length
            colour = _hex(face.colour, bright)
            points = " ".join(f"{x:.1f},{y:.1f}" for x, y in corners[:, :2])
            depth = float(corners[:, 2].mean())
            found.append((depth, f'<polygon points="{points}" fill="{colour}" stroke="{colour}"/>'))
        return found

    def _rulings(self, face: Shown, front: Array) -> list[str]:
        """The pieces of them that are seen."""
        share = np.linspace(0.0, 1.0, PIECES + 1)[:, None]
        colour, found = _hex(face.colour, 0.4), []
        for start, end in face.rulings:
            row = self._flat(start + share * (end - start))
            seen = self._is_seen(0.5 * (row[:-1] + row[1:]), front)
            for a, b in (ends for ends, shows in zip(pairwise(row), seen, strict=True) if shows):
                ends = f'x1="{a[0]:.1f}" y1="{a[1]:.1f}" x2="{b[0]:.1f}" y2="{b[1]:.1f}"'
                found.append(f'<line {ends} stroke="{colour}"/>')
        return found

    def _is_seen(self, flat: Array, front: Array) -> Array:
        """Whether nothing is in front of places (N, 3) in px, (N,)."""
        cells = np.clip((flat[:, :2] * CELLS / SIZE).astype(int), 0, CELLS - 1)
        return np.asarray(flat[:, 2] >= front[cells[:, 1], cells[:, 0]] - IN_FRONT * SIZE)

    def _front(self) -> Array:
        """The depth of what is in front, (CELLS, CELLS)."""
        front = np.full((CELLS, CELLS), -np.inf)
        for face in self._faces:
            for corners in self._flat(face.triangles):
                _raise(front, corners * (CELLS / SIZE, CELLS / SIZE, 1.0))
        return front

    def _number(self, face: Shown, front: Array) -> str:
        """A face's number near the middle of what is seen of it, "" where nothing is."""
        centres = self._flat(face.triangles.mean(axis=1)) if len(face.triangles) else np.zeros((0, 3))
        toward = _normals(face.triangles) @ self._to_eye
        turned = toward > 0.0 if face.is_of_body else np.ones(len(toward), dtype=bool)
        seen = np.logical_and(turned, self._is_seen(centres, front))
        if not seen.any():
            return ""
        visible, weights = centres[seen], np.abs(toward[seen]) + 1e-12
        mean = (weights[:, None] * visible).sum(axis=0) / weights.sum()
        x, y, _ = visible[int(np.linalg.norm((visible - mean)[:, :2], axis=1).argmin())]
        look = 'text-anchor="middle" font-size="18" font-weight="bold" stroke="white" stroke-width="4"'
        return f'<text x="{x:.1f}" y="{y + 6:.1f}" {look} paint-order="stroke">{face.number}</text>'


def _raise(front: Array, corners: Array) -> None:
    """The depths of one triangle (3, 3) laid on those that are there."""
    (x0, y0), (x1, y1) = corners[:, :2].min(axis=0), corners[:, :2].max(axis=0)
    x, y = np.meshgrid(
        np.arange(math.floor(x0), math.floor(x1) + 1), np.arange(math.floor(y0), math.floor(y1) + 1)
    )
    a, b, c = corners
    det = (b[1] - c[1]) * (a[0] - c[0]) + (c[0] - b[0]) * (a[1] - c[1])
    if abs(det) < 1e-12:
        return
    u = ((b[1] - c[1]) * (x + 0.5 - c[0]) + (c[0] - b[0]) * (y + 0.5 - c[1])) / det
    v = ((c[1] - a[1]) * (x + 0.5 - c[0]) + (a[0] - c[0]) * (y + 0.5 - c[1])) / det
    inside = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (x >= 0) & (x < CELLS) & (y >= 0) & (y < CELLS)
    depth = (u * a[2] + v * b[2] + (1.0 - u - v) * c[2])[inside]
    rows, columns = y[inside], x[inside]
    front[rows, columns] = np.maximum(front[rows, columns], depth)


def _normals(triangles: Array) -> Array:
    """(N, 3), as long as twice their areas."""
    return np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])


def _hex(colour: Colour, bright: float) -> str:
    return "#" + "".join(f"{round(part * bright):02x}" for part in colour)


def _plain(words: str) -> str:
    return words.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


def fine(points: Sequence[Array]) -> float:
    """How far (mm) a chord may be off in a picture of a part with these points on its edges."""
    rows = np.concatenate([np.zeros((0, 3)), *points])
    return float(np.linalg.norm(np.ptp(rows, axis=0))) / FINE if len(rows) > 1 else 0.1
