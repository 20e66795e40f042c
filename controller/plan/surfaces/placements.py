"""Placements that have been found, as plain numbers: a check keeps them, so that no start searches again.

Finding the best placement of one surface takes seconds, more than the motion that a moving machine
has in its queue. The search is done by the check; what it found goes with it, exactly, and whoever
reads the program again takes it from here. Nothing is lost where it is not: then it is searched.
"""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from controller.geometry.placement import Barrel, Placed
from controller.geometry.splines import BSpline, simplest, splined
from controller.geometry.surfaces import Surface
from controller.geometry.vectors import Vector
from controller.motion.motions import SurfaceCut
from controller.plan.segment import ContinuousPath, PathItem
from controller.plan.surfaces.axis_curves import SMOOTH

FORMAT = 4  # another one where the same numbers would mean another pose
MAX_PLACEMENTS = 20_000  # that are known at once, of 4 kB each at most
NAME = 32  # letters
Pair = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Recipe:
    """A ``Placed`` without its surface, mm and rad; ``upper`` and ``lower`` where its axis is free."""

    offset_mm: float
    points_v: Pair
    normals_v: Pair
    taper_rad: float
    shift_mm: float
    breaks: tuple[float, ...] = ()  # of both curves that the axis goes through
    upper: tuple[tuple[Vector, ...], ...] = ()  # their spans
    lower: tuple[tuple[Vector, ...], ...] = ()
    barrel: Pair | None = None  # radius and height of its middle

    @staticmethod
    def of(placed: Placed) -> Recipe:
        values = placed.offset_mm, placed.points_v, placed.normals_v, placed.taper_rad, placed.shift_mm
        barrel = None if placed.barrel is None else (*placed.barrel,)
        if placed.through is None:
            return Recipe(*values, barrel=barrel)
        upper, lower = map(splined, placed.through)  # on the same knots, as placing makes them
        return Recipe(*values, upper.breaks, upper.spans, lower.spans, barrel)

    def on(self, base: Surface, name: str) -> Placed:
        """The cutter on that surface again, to the last bit."""
        through = None
        if self.breaks:
            smooth = (SMOOTH,) * (len(self.breaks) - 2)
            upper, lower = (BSpline(self.breaks, spans, (), smooth) for spans in (self.upper, self.lower))
            through = simplest(upper), simplest(lower)
        points, normals = self.points_v, self.normals_v
        parts = self.offset_mm, points, normals, self.taper_rad, self.shift_mm, through, name
        return Placed(base, *parts, None if self.barrel is None else Barrel(*self.barrel))

    def to_dict(self) -> dict[str, Any]:
        return asdict(self)

    @staticmethod
    def from_dict(values: Mapping[str, Any]) -> Recipe:
        """Raises ValueError, KeyError or TypeError for anything but what ``to_dict`` makes."""
        (va, vb), (na, nb) = values["points_v"], values["normals_v"]
        offset, taper, shift = (float(values[key]) for key in ("offset_mm", "taper_rad", "shift_mm"))
        breaks = tuple(map(float, values["breaks"]))
        upper, lower = _spans(values["upper"]), _spans(values["lower"])
        if {len(upper), len(lower)} != {max(0, len(breaks) - 1)} or len({*map(len, (*upper, *lower))}) > 1:
            raise ValueError("spans and breaks do not fit")
        pairs = (float(va), float(vb)), (float(na), float(nb))
        radius, middle = values["barrel"] or (0.0, 0.0)
        barrel = (float(radius), float(middle)) if radius else None
        return Recipe(offset, *pairs, taper, shift, breaks, upper, lower, barrel)


def _spans(values: Any) -> tuple[tuple[Vector, ...], ...]:
    return tuple(tuple(_vector(point) for point in span) for span in values)


def _vector(values: Any) -> Vector:
    x, y, z = values
    return float(x), float(y), float(z)


def name_of(surface: Surface, *asked: object) -> str:
    """Under what a placement is known: a hash of the surface's curves and of what was ``asked`` for."""
    text = repr((FORMAT, surface, asked))
    return hashlib.sha256(text.encode()).hexdigest()[:NAME]


_known: dict[str, bytes] = {}  # pickled: a process that runs for weeks has met many a part


def learn(found: Mapping[str, Recipe]) -> None:
    """What a check has found, by name; those that were learnt first are forgotten."""
    for name, recipe in found.items():
        _known.pop(name, None)
        _known[name] = pickle.dumps(recipe, pickle.HIGHEST_PROTOCOL)
    over = len(_known) - max(MAX_PLACEMENTS, len(found))
    for name in list(_known)[:over] if over > 0 else ():
        _known.pop(name, None)


def known(name: str) -> Recipe | None:
    """What was found under that name, if it has been learnt."""
    kept = _known.get(name)
    found: Recipe | None = None if kept is None else pickle.loads(kept)
    return found


class Noted:
    """A path as it is walked over, and the placements seen on it."""

    def __init__(self, items: Iterable[PathItem]) -> None:
        self._items = items
        self.recipes: dict[str, Recipe] = {}

    def __iter__(self) -> Iterator[PathItem]:
        for item in self._items:
            if isinstance(item, ContinuousPath):
                self._note(item)
            yield item

    def _note(self, chain: ContinuousPath) -> None:
        for segment in chain.segments:
            surface = segment.motion.surface if isinstance(segment.motion, SurfaceCut) else None
            if isinstance(surface, Placed) and surface.name:
                self.recipes[surface.name] = Recipe.of(surface)
