"""Which placement of the cutter a surface gets: found ahead, evaluated on every tick.

``double`` has two numbers, the ruling parameters of its two points: the pair with the least
largest deviation is taken. ``optimal`` is the free axis of a row of surfaces (``free_axis``) where that
leaves them less off than ``double`` and ``single``, with their ends and without; else the better of these.

``double`` is compared without the outermost 2 % at either end: there the flank reaches over the end of the
block, and what it leaves or cuts there hangs on the neighbour or the lead.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from controller.geometry.arrays import Array
from controller.geometry.placement import AT_LOWER, Barrel, Placed, Strategy
from controller.geometry.surfaces import Surface
from controller.machine.model import Tool
from controller.machine.tool_profile import flank
from controller.memory import remembered
from controller.plan.surfaces import deviation, free_axis, placements
from controller.plan.surfaces.axis_curves import joined
from controller.plan.surfaces.free_axis import FINE

ALONG, ACROSS = 97, 11  # points of the surface that are looked at
END = 0.02  # share of u at either end that does not count
GOOD_MM = 1e-4  # a surface that ``double`` cuts as well as this, with its ends, is not searched on
SAME_MM = 2e-5  # a surface that ``single`` cuts as well as this needs no other
EDGE_POINTS = 161  # of the lower edge, to see what cuts it
CLEAR_MM = 1e-3  # so much flank is left below it
HUNG_AT = (0.2, 0.8)  # of the ruling, upper and lower point
CLEARLY = 0.5  # so much less off than ``double`` is surely less than the best pairs of smaller parts
BELOW_UPPER = 0.02  # of the ruling: C0 may have a standstill or be a tip, where there is no normal
GRID = (65, 11)  # as ``ALONG``, ``ACROSS``, where placements are chosen from
MIN_COSINE = 0.3  # of the way from a point to the axis and its normal
CHOSEN_FROM = (Strategy.SINGLE, Strategy.DOUBLE, Strategy.OPTIMAL)  # by ``auto``, the plainest first


@dataclass(frozen=True, slots=True)
class Cutter:
    """What placing needs of a tool on one side of the surface: signed radius beside C1, mm and rad."""

    offset_mm: float
    taper_rad: float
    shift_mm: float  # of the tip below the foot of the contact
    flank_mm: float = 0.0  # above the tip, where the corner ends
    barrel: Barrel | None = None

    @staticmethod
    def of(tool: Tool, side: float, allowance_mm: float = 0.0, shift_mm: float = 0.0) -> Cutter:
        """The cutter with its tip so far below the contact that the flank cuts there, not the corner.

        ``shift_mm`` more than that; ``allowance_mm`` is what stays on the surface.
        """
        bare, taper = flank(tool), tool.taper_rad
        low = bare.begins_mm + shift_mm
        offset = bare.radius_mm(low) + allowance_mm * math.cos(taper)
        return Cutter(math.copysign(offset, side), taper, low, bare.begins_mm, bare.barrel)


@dataclass(frozen=True, slots=True)
class Row:
    """The surface of a block in parts that join, as its placements need them, and its cutter."""

    ruled: tuple[Surface, ...]  # for an axis that hangs on the surface: a derivative less smooth than that
    free: tuple[Surface, ...]  # for one through curves of its own: as smooth as the way of the contact
    cutter: Cutter

    @staticmethod
    def of(surface: Surface, cutter: Cutter) -> Row:
        """Of a surface that is smooth as a whole."""
        return Row((surface,), (surface,), cutter)

    def placed(self, strategy: Strategy) -> tuple[Surface, ...]:
        """The cutter placed (not ``AUTO``) on ``ruled``, or on ``free``; the paper's is a surface itself."""
        assert strategy is not Strategy.AUTO  # which is chosen with leads and joints: ``auto.build``
        if strategy is Strategy.OPTIMAL:
            return _optimal(self)
        better = [_double(one, self.cutter) if strategy is Strategy.DOUBLE else None for one in self.ruled]
        return tuple(
            _plain(one, self.cutter) if b is None else b for one, b in zip(self.ruled, better, strict=True)
        )

    @property
    def is_exact(self) -> bool:
        """Whether the paper's placement cuts all of it."""
        return all(_single_is_exact(one, self.cutter) for one in self.free)

    def known(self, strategy: Strategy, *asked: object) -> tuple[Placed, ...] | None:
        """What has been learnt of a placement."""
        for parts in (self.free, self.ruled):
            names = self.names(parts, strategy, *asked)
            found = [recipe for recipe in map(placements.known, names) if recipe is not None]
            if len(found) == len(names):
                each = zip(found, parts, names, strict=True)
                return tuple(recipe.on(base, name) for recipe, base, name in each)
        return None

    def names(self, parts: tuple[Surface, ...], strategy: Strategy, *asked: object) -> list[str]:
        """Under what the placement of each part is known: it hangs on all of them, and what is ``asked``."""
        whole = placements.name_of(parts[0], parts[1:], asked) if len(parts) > 1 or asked else ""
        return [placements.name_of(one, self.cutter, strategy, whole) for one in parts]

    def named(self, placed: Sequence[Surface], strategy: Strategy, *asked: object) -> tuple[Placed, ...]:
        """The parts of a placement with the names under which they are known."""
        bases = tuple(one.nominal for one in placed)
        made = [as_the_paper(one, self.cutter) for one in placed]
        names = self.names(bases, strategy, *asked)
        return tuple(replace(one, name=name) for one, name in zip(made, names, strict=True))


def place(surface: Surface, cutter: Cutter, strategy: Strategy) -> Surface:
    """``surface`` with the cutter placed (not ``AUTO``); itself where that is what Eq. 5 and 8 say."""
    return Row.of(surface, cutter).placed(strategy)[0]


@dataclass(frozen=True, slots=True)
class RequiredPlacement:
    """A placement that has to be searched: what ``Row.placed`` is asked."""

    row: Row
    strategy: Strategy  # ``DOUBLE`` or ``OPTIMAL``

    @property
    def is_known(self) -> bool:
        if self.strategy is Strategy.DOUBLE:
            return all(map(placements.known, self.row.names(self.row.ruled, self.strategy)))
        return self.row.known(self.strategy) is not None


def searched(wanted: RequiredPlacement) -> Mapping[str, placements.Recipe]:
    """What ``Row.placed`` finds, to be learnt, by name; the paper's placement has none."""
    try:
        placed = wanted.row.placed(wanted.strategy)
    except ValueError:  # told by who reads the block
        return {}
    return {one.name: placements.Recipe.of(one) for one in placed if isinstance(one, Placed) and one.name}


def off_mm(row: Row, strategy: Strategy) -> float:
    """How far a placement (not ``AUTO``) leaves the surfaces of a row off at most but for their ends, mm."""
    placed = (as_the_paper(one, row.cutter) for one in row.placed(strategy))
    return max(_Judge(one, *(FINE if one.through is not None else ())).inner(one) for one in placed)


def as_the_paper(surface: Surface, cutter: Cutter) -> Placed:
    """Itself where a cutter is placed on it already."""
    if isinstance(surface, Placed):
        return surface
    lean, shift = cutter.taper_rad, cutter.shift_mm
    return Placed(surface, cutter.offset_mm, taper_rad=lean, shift_mm=shift, barrel=cutter.barrel)


def _plain(surface: Surface, cutter: Cutter) -> Surface:
    is_plain = cutter.taper_rad == cutter.shift_mm == 0.0 and cutter.barrel is None
    return surface if is_plain else as_the_paper(surface, cutter)


@remembered(256)
def _single_is_exact(surface: Surface, cutter: Cutter) -> bool:
    single = _Judge(as_the_paper(surface, cutter))
    return single.inner(single.placed) < SAME_MM


@remembered(256)
def _double(surface: Surface, cutter: Cutter) -> Placed | None:
    """The best pair of points, as a check has kept it, or found now; None where the paper's is exact."""
    name = placements.name_of(surface, cutter, Strategy.DOUBLE)
    kept = placements.known(name)
    if kept is not None:
        return kept.on(surface, name)
    if _single_is_exact(surface, cutter):
        return None
    single = _Judge(as_the_paper(surface, cutter))
    found = min(_doubles(single), key=single.inner)
    if single.inner(found) >= single.inner(single.placed):
        return replace(single.placed, name=name)
    return _lowered((replace(found, name=name),), cutter)[0]


@remembered(256)
def _optimal(row: Row) -> tuple[Surface, ...]:
    """The free axis of a row, as a check has kept it, or found now; else what is better."""
    kept = row.known(Strategy.OPTIMAL)
    if kept is not None:
        return kept
    near = tuple(_double(one, row.cutter) or as_the_paper(one, row.cutter) for one in row.free)
    if not any(one.name for one in near):  # the paper's is exact
        return row.placed(Strategy.SINGLE)
    found = _free(row, near) if _off(near)[1] > GOOD_MM else None
    if found is not None and found.whole_mm <= CLEARLY * _off(near)[0]:
        return row.named(_lowered(found.placed, row.cutter), Strategy.OPTIMAL)
    hung = [row.placed(kind) for kind in (Strategy.SINGLE, Strategy.DOUBLE)]
    hung_on = [tuple(as_the_paper(one, row.cutter) for one in way) for way in hung]
    best = min(hung_on, key=_off)
    if found is None or any(own > other for own, other in zip(found.off_mm, _off(best), strict=True)):
        return row.named(best, Strategy.OPTIMAL)
    return row.named(_lowered(found.placed, row.cutter), Strategy.OPTIMAL)


def _free(row: Row, near: Sequence[Placed]) -> free_axis.Found | None:
    """The free axis of each row of parts that join; None where there is none on the right side."""
    pairs = sorted(one.points_v for one in near if one.normals_v != AT_LOWER)
    high, low = pairs[len(pairs) // 2] if pairs else HUNG_AT
    found = list[free_axis.Found]()
    for surfaces in joined(row.free):
        singles = [as_the_paper(one, row.cutter) for one in surfaces]
        hung = [
            replace(one, points_v=(high, low), normals_v=(max(high, BELOW_UPPER), low)) for one in singles
        ]
        edges = [replace(one, points_v=HUNG_AT, normals_v=(BELOW_UPPER, 1.0)) for one in singles]
        axis = free_axis.best(singles, (hung, singles, edges))
        if axis is None:
            return None
        found.append(axis)
    placed = tuple(one for axis in found for one in axis.placed)
    return free_axis.Found(placed, *(max(off) for off in zip(*(axis.off_mm for axis in found), strict=True)))


def _off(placed: Sequence[Placed]) -> tuple[float, float]:
    """How far parts are off at most by their own cuts, but for the ends of each and with them, mm."""
    judges = [_Judge(one) for one in placed]
    inner = max(judge.inner(judge.placed) for judge in judges)
    return inner, max(judge.whole(judge.placed) for judge in judges)


def _lowered(placed: Sequence[Placed], cutter: Cutter) -> tuple[Placed, ...]:
    """``placed`` so far down that the flank, not the corner, cuts all of the lower edge.

    As the axis leans against the ruling, what comes nearest to a point of C1 stands a little further
    along and may have its end above it. The tool slides along itself by micrometres; a tapered one
    is thicker there then, and makes room for it.
    """
    u, short = _cosine(EDGE_POINTS), 0.0
    for one in placed:
        seen = deviation.of(one, deviation.points(one, u, np.ones(u.shape)))
        short = max(short, cutter.flank_mm - float(seen.height.min()))
    if short <= 0.0:
        return tuple(placed)
    down = short + CLEAR_MM
    wider = math.copysign(down * math.tan(cutter.taper_rad), cutter.offset_mm)
    return tuple(
        replace(one, offset_mm=one.offset_mm + wider, shift_mm=one.shift_mm + down) for one in placed
    )


class _Judge:
    """The points at which placements of one surface are compared."""

    def __init__(self, placed: Placed, along: int = ALONG, across: int = ACROSS) -> None:
        self.placed = placed
        u = np.sort(np.concatenate((_cosine(along), (END, 1.0 - END))))
        u, v = (a.ravel() for a in np.meshgrid(u, _cosine(across), indexing="ij"))
        self.at = deviation.points(placed, u, v)
        self._inside = np.minimum(u, 1.0 - u) >= END * (1.0 - 1e-9)

    def inner(self, placed: Placed) -> float:
        """Largest deviation but for the ends, mm."""
        return float(np.abs(deviation.of(placed, self.at).left[self._inside]).max())

    def whole(self, placed: Placed) -> float:
        """Largest deviation with the ends, mm."""
        return float(np.abs(deviation.of(placed, self.at).left).max())


@dataclass(frozen=True, slots=True)
class Grid:
    """Points of a surface at which whole placements of it are compared, along its normals."""

    single: Placed
    u: Array  # (N,)
    at: Array  # (3, N)
    normals: Array  # (3, N) unit vectors to the cutter's side

    @staticmethod
    def of(placed: Placed) -> Grid:
        u, v = (a.ravel() for a in np.meshgrid(*map(_cosine, GRID), indexing="ij"))
        return Grid(placed, u, deviation.points(placed, u, v), deviation.normals(placed, u, v))

    def left(self, placed: Placed) -> Array:
        """What a cut leaves along the normals (mm, negative: overcut), (N,)."""
        seen = deviation.of(placed, self.at)
        return self._along(seen.left, seen.away)

    def left_by(self, tips: Array, axes: Array, flank: deviation.Standing) -> Array:
        """The same of poses (M, 3), inf where the flank is nowhere beside; see ``deviation.at_poses``."""
        left = deviation.at_poses(tips, axes, flank, self.at)
        k = np.argmin(left, axis=0)
        away = tips[k].T - self.at
        away -= axes[k].T * (axes[k].T * away).sum(axis=0)
        least = left[k, np.arange(left.shape[1])]
        return self._along(least, away / np.maximum(np.sqrt((away * away).sum(axis=0)), 1e-12))

    def _along(self, left: Array, away: Array) -> Array:
        cosine = np.abs((self.normals * away).sum(axis=0))
        return np.asarray(left / np.maximum(cosine, MIN_COSINE))


def _cosine(n: int) -> Array:
    return np.asarray(0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, n)))


def _doubles(judge: _Judge) -> Iterator[Placed]:
    """``double`` with the pairs of a coarse grid, then of finer ones about the best."""
    rough = _Judge(judge.placed, 33, 7)
    pair, width = (0.2, 0.8), 0.15
    for _ in range(4):
        pairs = [
            (pair[0] + i * width, pair[1] + j * width) for i in (-1.0, 0.0, 1.0) for j in (-1.0, 0.0, 1.0)
        ]
        sound = [p for p in pairs if BELOW_UPPER <= p[0] <= p[1] - 0.2 and p[1] <= 1.0]
        made = [replace(judge.placed, points_v=p, normals_v=p) for p in sound]
        best = min(made, key=rough.inner)
        yield best
        pair, width = best.points_v, 0.5 * width
