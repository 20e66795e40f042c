"""A program's path as a small picture: lines on a plane, as it is seen obliquely from above.

    svg(shape, height_px, guilty)       # a list's thumbnail, or what is looked at before it is loaded

It is drawn so finely as its size shows, so that a list of many programs is light. What is fed and cut fills
the picture; rapids, which lead far away, are cut off at its edges.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.geometry.arrays import Array
from controller.plan.report.picture import FEED, RAPID, SURFACE, Shape, points_of, thin

Places = NDArray[np.bool_]  # of each point: whether the way to it is meant

EYE = (-0.9, -1.2, 0.9)  # from what is looked at: as the 3-D view begins
WIDE = 4.0 / 3.0  # width over height
MARGIN = 0.07  # of the height, on each side
FINE_PX = 0.35  # so far a line may be off
RING = 0.045  # of the height: half of the ring's width
MAX_RINGS = 20
# Of the middle between dark and light: they are read on either.
STYLE = (
    "path{fill:none;stroke-linejoin:round;stroke-linecap:round}"
    ".rapid{stroke:#808c96;stroke-width:1;stroke-dasharray:3 3}"
    ".feed{stroke:#2f8fd8;stroke-width:1.5}"
    ".cut{stroke:#8b6be0;stroke-width:1.5}"
    ".wall{fill:#8b6be0;fill-opacity:.3;stroke:#8b6be0;stroke-width:.7}"
    ".guilty{stroke:#e5383b;stroke-width:2.5}"
)


def svg(shape: Shape, height_px: int, guilty: Places | None = None) -> str:
    """The picture; ``guilty``: points of the shape that are to stand out, the way to each in red.

    An empty shape gives an empty picture.
    """
    found = np.zeros(len(shape.tips), dtype=bool) if guilty is None else guilty
    to_screen = _screen(shape, found, height_px)
    points, walls = to_screen(shape.tips), to_screen(shape.rulings.reshape(-1, 3))
    drawn = "".join([*_walls(walls, shape), *_ways(points, shape, found), *_rings(points, found, height_px)])
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDE * height_px:.0f} {height_px}">'
    return f"{head}<style>{STYLE}</style>{drawn}</svg>\n"


def guilty_of(shape: Shape, result: Mapping[str, Any]) -> Places:
    """Which points of a refused program's shape show where; ``result``: what its check found."""
    found = np.zeros(len(shape.tips), dtype=bool)
    for line in result.get("guilty_lines") or ():
        found |= points_of(line, shape, "refusals" in result)
    return found


def _screen(shape: Shape, guilty: Places, height_px: int) -> Any:
    """A function from points (N, 3) of the table to such of the picture (N, 2), y downwards."""
    ahead = -np.array(EYE) / np.linalg.norm(EYE)
    right = np.cross(ahead, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    plane = np.stack([right, -np.cross(right, ahead)])
    shown = shape.tips[(shape.kinds != RAPID) | guilty]
    looked_at = np.concatenate([shown if len(shown) else shape.tips, shape.rulings.reshape(-1, 3)]) @ plane.T
    if not len(looked_at):
        return lambda points: np.empty((len(points), 2))
    low, high = looked_at.min(axis=0), looked_at.max(axis=0)
    room = height_px * (np.array([WIDE, 1.0]) - 2.0 * MARGIN)
    scale = float((room / np.maximum(high - low, 1e-6)).min())
    middle = 0.5 * height_px * np.array([WIDE, 1.0])
    return lambda points: middle + scale * (points @ plane.T - 0.5 * (low + high))


def _walls(points: Array, shape: Shape) -> Iterator[str]:
    """Each surface between its two edges, of which ``points`` has the ends of the rulings in turn."""
    first = 0
    for count in shape.surfaces:
        ends = points[2 * first : 2 * (first + count)]
        edges = _line(_thinned(ends[::2])), _line(_thinned(ends[:0:-2]))
        yield f'<path class="wall" d="{edges[0]}L{edges[1][1:]}Z"/>'
        first += count


def _thinned(points: Array) -> Array:
    return points[thin(points, np.zeros(len(points), dtype=np.int64), FINE_PX)[0]]


def _ways(points: Array, shape: Shape, guilty: Places) -> Iterator[str]:
    """The ways of each kind, what is guilty last so that nothing lies over it."""
    marks = shape.kinds + 4 * guilty
    kept, _ = thin(points, marks, FINE_PX)
    points, marks = points[kept], marks[kept]
    for name, kinds in (
        *(("rapid", (RAPID,)), ("feed", (FEED,)), ("cut", (SURFACE,))),
        ("guilty", (4 + RAPID, 4 + FEED, 4 + SURFACE)),
    ):
        drawn = "".join(_line(points[first:last]) for first, last in _runs(np.isin(marks, kinds)))
        if drawn:
            yield f'<path class="{name}" d="{drawn}"/>'


def _runs(wanted: Places) -> Iterator[tuple[int, int]]:
    """From where to where the points go on whose ways are wanted, with the point before them."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], wanted, [False]]).astype(np.int8)))
    for first, last in edges.reshape(-1, 2):
        if last > 1:
            yield max(0, first - 1), last


def _rings(points: Array, guilty: Places, height_px: int) -> Iterator[str]:
    """A ring round the end of each guilty way: what is short is seen, too."""
    ends = np.flatnonzero(guilty & ~np.append(guilty[1:], False)[: len(guilty)])
    for x, y in points[ends[:MAX_RINGS]]:
        yield f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{RING * height_px:.1f}" class="guilty" fill="none"/>'


def _line(points: Array) -> str:
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points) if len(points) else ""
