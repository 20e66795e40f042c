"""How far a cutter's way is from its contour, and what of a contour a cutter can touch: by distances alone.

Nothing here knows of corners or intersections: distances from points to lines and arcs are all it has.
"""

from __future__ import annotations

import cmath
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from support.parts.random_contours import Piece

from controller.geometry.arrays import Array

Points = npt.NDArray[np.complex128]
NEAR_MM = 1e-6


def distances(points: Points, piece: Piece) -> Array:
    """Of points from a line or an arc."""
    ends: Array = np.minimum(np.abs(points - piece.start), np.abs(points - piece.end))
    if piece.centre is None:
        along = piece.end - piece.start
        share = np.clip(((points - piece.start) * along.conjugate()).real / abs(along) ** 2, 0.0, 1.0)
        found: Array = np.abs(points - piece.start - share * along)
        return found
    spokes = points - piece.centre
    sense = math.copysign(1.0, piece.sweep)
    angles = np.angle(spokes / (piece.start - piece.centre)) * sense % (2.0 * math.pi)
    radial = np.abs(np.abs(spokes) - abs(piece.start - piece.centre))
    return np.where(angles <= abs(piece.sweep), np.minimum(radial, ends), ends)


def to_all(points: Points, pieces: Sequence[Piece]) -> Array:
    """To the nearest of all pieces."""
    found: Array = np.min([distances(points, piece) for piece in pieces], axis=0)
    return found


@dataclass(frozen=True, slots=True)
class Touched:
    """Samples of one piece of a contour: the cutter's centre when it touches there, and whether it can."""

    centres: Points
    free: npt.NDArray[np.bool_]
    hindered_by: set[int]  # numbers of the pieces that are too near


def touched(pieces: Sequence[Piece], off: float, step_mm: float) -> list[Touched]:
    """For each piece of a contour, with the cutter so far on its left."""
    return [_touched(number, piece, pieces, off, step_mm) for number, piece in enumerate(pieces)]


def _touched(number: int, piece: Piece, pieces: Sequence[Piece], off: float, step_mm: float) -> Touched:
    on = np.array(piece.points(step_mm)[1:-1] or [_middle(piece)])
    heading = np.full(on.shape, piece.heading(at_end=False))
    if piece.centre is not None:
        spokes = on - piece.centre
        heading = math.copysign(1.0, piece.sweep) * 1j * spokes / np.abs(spokes)
    centres = on + 1j * off * heading
    near = np.array([distances(centres, other) < abs(off) - NEAR_MM for other in pieces])
    return Touched(centres, ~near.any(axis=0), set(np.flatnonzero(near.any(axis=1)).tolist()))


def _middle(piece: Piece) -> complex:
    if piece.centre is None:
        return (piece.start + piece.end) / 2.0
    return piece.centre + (piece.start - piece.centre) * cmath.rect(1.0, piece.sweep / 2.0)


def hindrance(pieces: Sequence[Piece], off: float) -> str:
    """Why no unbroken way goes beside a whole contour; "" where only its inside corners cost some of it.

    What can be touched of each piece has to be one segment, which reaches its ends but for inside corners,
    and there the cutter has to stand in one place when it leaves one piece and comes to the next.
    """
    step = 0.02 * abs(off)
    samples = touched(pieces, off, step)
    for number, sample in enumerate(samples):
        changes = np.count_nonzero(np.diff(np.concatenate(([False], sample.free, [False])).astype(int)))
        if changes != 2:
            return f"piece {number} is touched in {changes // 2} segments"
    for number, (one, two) in enumerate(itertools.pairwise(samples)):
        turn = np.angle(pieces[number + 1].heading(at_end=False) / pieces[number].heading(at_end=True))
        if turn * off < 1e-9 and not (one.free[-1] and two.free[0]):
            return f"the outside corner behind piece {number} cannot be touched"
        leaves, comes = one.centres[one.free][-1], two.centres[two.free][0]
        if turn * off > 1e-9 and abs(leaves - comes) > 4.0 * step:
            return f"in the inside corner behind piece {number} the cutter cannot pass"
    return ""
