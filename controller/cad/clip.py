"""Where the rulings of a face begin and end: its outline, crossed by each of them.

In the plane of a face's parameters, a along the way and b across, a ruling is a line a = const. The
outline falls into arcs that rise or fall in a; between two neighbouring ends of arcs, in a slab, every
ruling crosses the same arcs, and two of them, low and high, bound a cell of the face. A chain of cells,
one in each slab, is what one pass of a cutter covers:

    b |    ____________        upper bound
      |   /      o     |       o: a hole with air in it is cut over; with other material in it,
      |  /_____________|       the cells above and below of it are two
      +------------------ a    lower bound
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from controller.cad.arcs import Arc, CurveOfPlane, Ruled, Scale, Trimmed, arcs_of, clustered, place
from controller.cad.bound import Bound, End, long_enough
from controller.messages import message

SLIVER_MM = 0.05  # what is left of a face is at most so wide


@dataclass(frozen=True, eq=False)
class Clip:
    """One chain: its range of a, the two ends of its rulings, and what it does beside the outline (mm)."""

    along: tuple[float, float]
    low: Bound
    high: Bound
    prolonged_mm: float  # at most, beyond the outline
    left_mm: float  # at most, of rulings that the face has and the chain has not
    bridges: bool  # it leads over a hole


@dataclass(frozen=True, eq=False)
class _Cell:
    slab: int
    low: Arc
    high: Arc
    bridges: bool = False


def clips(
    face: Ruled, wires: Sequence[Sequence[CurveOfPlane]], column: int, prolong_mm: float, clear_mm: float
) -> list[Clip]:
    """The chains of a face, the largest first; raises Trimmed where one would leave material in its middle.

    ``prolong_mm``: so far are rulings prolonged at both ends, where no material is. ``clear_mm``: so far
    keeps their end from a step in the material beyond it, the radius of the cutter.
    """
    scale = Scale(face)
    arcs, stands = arcs_of(wires, column, scale)
    ends = clustered(np.concatenate([[(arc.start, arc.end) for arc in arcs], stands], axis=None), scale)
    slabs = list(pairwise(ends))
    rows = [_cells(face, arcs, k, slab) for k, slab in enumerate(slabs)]
    found, left = _chains(rows, slabs, scale)
    if not found:
        raise Trimmed(message("cad.no_length"))
    thin = _audit(found, left, slabs, face, scale)
    return [_clip(face, chain, slabs, scale, (prolong_mm, clear_mm), thin) for chain in found]


# ---- cells ---------------------------------------------------------------------------


def _cells(face: Ruled, arcs: Sequence[Arc], k: int, slab: tuple[float, float]) -> list[_Cell]:
    """Of one slab, from below; those with air between them are one."""
    middle = 0.5 * (slab[0] + slab[1])
    crossed = sorted((arc for arc in arcs if arc.start < middle < arc.end), key=lambda arc: arc(middle))
    if len(crossed) % 2:
        raise Trimmed(message("cad.open_outline"))
    row: list[_Cell] = []
    for low, high in zip(crossed[::2], crossed[1::2], strict=True):
        if row and not _is_material(face, row[-1].high, low, slab):
            row[-1] = replace(row[-1], high=high, bridges=True)
        else:
            row.append(_Cell(k, low, high))
    return row


def _is_material(face: Ruled, below: Arc, above: Arc, slab: tuple[float, float]) -> bool:
    """Whether the gap between two cells is inside of a body."""
    for a in slab[0] + np.array([0.15, 0.5, 0.85]) * (slab[1] - slab[0]):
        b0, b1 = below(a), above(a)
        if any(face.is_buried(float(a), b0 + share * (b1 - b0)) for share in (0.2, 0.5, 0.8)):
            return True
    return False


# ---- chains --------------------------------------------------------------------------


def _chains(
    rows: list[list[_Cell]], slabs: Sequence[tuple[float, float]], scale: Scale
) -> tuple[list[list[_Cell]], list[_Cell]]:
    """Chains of cells that touch, the largest first, and the cells beside them."""
    left, found = [list(row) for row in rows], []
    taken: set[int] = set()
    while True:
        chain = _largest(left, slabs)
        if not chain or _size(chain, slabs, scale) <= SLIVER_MM:
            break
        if taken & {cell.slab for cell in chain}:
            break
        taken |= {cell.slab for cell in chain}
        found.append(_without_slivers(chain, slabs, scale))
        left = [[cell for cell in row if cell not in chain] for row in left]
    return found, [cell for row in left for cell in row]


def _without_slivers(chain: list[_Cell], slabs: Sequence[tuple[float, float]], scale: Scale) -> list[_Cell]:
    """Without cells at its ends that are slivers, as where two edges of a file nearly coincide."""
    thick = [k for k, cell in enumerate(chain) if _longest(cell, slabs, scale) > SLIVER_MM]
    return chain[thick[0] : thick[-1] + 1]


def _size(chain: Sequence[_Cell], slabs: Sequence[tuple[float, float]], scale: Scale) -> float:
    return max(_longest(cell, slabs, scale) for cell in chain)


def _longest(cell: _Cell, slabs: Sequence[tuple[float, float]], scale: Scale) -> float:
    """The longest ruling of a cell, mm."""
    start, end = slabs[cell.slab]
    places = np.linspace(start, end, 9)
    return max((cell.high(a) - cell.low(a)) * scale.at(a) for a in places)


def _largest(rows: list[list[_Cell]], slabs: Sequence[tuple[float, float]]) -> list[_Cell]:
    """The chain with the largest area in the plane: best way from the left, slab by slab."""
    best: list[_Cell] = []
    best_area = 0.0
    before: list[tuple[float, list[_Cell]]] = []
    for row in rows:
        here: list[tuple[float, list[_Cell]]] = []
        for cell in row:
            start, end = slabs[cell.slab]
            middle = 0.5 * (start + end)
            area = (cell.high(middle) - cell.low(middle)) * (end - start)
            led = max(
                (one for one in before if _touch(one[1][-1], cell, start)), key=lambda o: o[0], default=None
            )
            here.append((area + led[0], [*led[1], cell]) if led else (area, [cell]))
        before = here
        for area, chain in here:
            if area > best_area:
                best, best_area = chain, area
    return best


def _touch(one: _Cell, other: _Cell, a: float) -> bool:
    return min(one.high(a), other.high(a)) > max(one.low(a), other.low(a))


def _audit(
    found: Sequence[Sequence[_Cell]],
    left: Sequence[_Cell],
    slabs: Sequence[tuple[float, float]],
    face: Ruled,
    scale: Scale,
) -> float:
    """The longest ruling (mm) in what the chains leave; raises Trimmed where that is more than slivers."""
    most = 0.0
    for run in _runs(left, slabs):
        longest = _size(run, slabs, scale)
        width = (slabs[run[-1].slab][1] - slabs[run[0].slab][0]) * scale.mm_a
        if min(longest, width) > SLIVER_MM:
            cell = max(run, key=lambda one: _longest(one, slabs, scale))
            a = 0.5 * sum(slabs[cell.slab])
            beside = next((one for chain in found for one in chain if one.slab == cell.slab), cell)
            gap = 0.5 * (cell.high(a) + beside.low(a)) if beside.low(a) > cell.low(a) else cell.low(a)
            raise Trimmed(message("cad.interrupted", at=place(face.point(a, gap))))
        most = max(most, min(longest, width))
    return most


def _runs(cells: Sequence[_Cell], slabs: Sequence[tuple[float, float]]) -> list[list[_Cell]]:
    """Cells that touch, from slab to slab, together."""
    runs: list[list[_Cell]] = []
    for cell in sorted(cells, key=lambda one: one.slab):
        start = slabs[cell.slab][0]
        led = next(
            (run for run in runs if run[-1].slab == cell.slab - 1 and _touch(run[-1], cell, start)), None
        )
        if led is None:
            runs.append([cell])
        else:
            led.append(cell)
    return runs


# ---- bounds --------------------------------------------------------------------------


def _clip(
    face: Ruled,
    chain: Sequence[_Cell],
    slabs: Sequence[tuple[float, float]],
    scale: Scale,
    wished: tuple[float, float],
    left_mm: float,
) -> Clip:
    parts = [(*slabs[cell.slab], cell) for cell in chain]
    low = End(face, scale, [(a, b, cell.low) for a, b, cell in parts], 1.0, *wished)
    high = End(face, scale, [(a, b, cell.high) for a, b, cell in parts], -1.0, *wished)
    made = low.bound(), high.bound()
    along = parts[0][0], parts[-1][1]
    along, made, more, dropped = long_enough(face, scale, along, made, (low, high))
    left = max(left_mm, low.left_mm, high.left_mm, dropped)
    prolonged = max(low.prolonged_mm, high.prolonged_mm, more)
    return Clip(along, *made, prolonged, left, any(cell.bridges for cell in chain))
