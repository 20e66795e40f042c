"""The two ends of the rulings of a chain of cells as functions of the way along, never too steep.

A bound that runs along the rulings (a step, the end of an arc) gives a cutter no way across them, so a
bound is never steeper than ``STEEPEST``: rulings are prolonged there, which changes nothing in the surface.
Where material is beyond their end it may be as steep as ``STEEPEST_AT_MATERIAL``, and they are shortened.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from controller.cad.arcs import Arc, Ruled, Scale, Trimmed, place
from controller.geometry.arrays import Array
from controller.messages import message

# Tangents of the angle between a bound and the way across the rulings.
STEEPEST, STEEPEST_AT_MATERIAL = 6.0, 10.0
SHORT_MM, SHORT_SHARE = 1.0, 0.2  # rulings are prolonged to this, or to so much of the longest
MIN_MM = 0.02  # shorter ones, with material at both ends, are left
NODES = 33  # of an arc
WITHIN = 1e-3  # share of an arc
PROBES = np.array([0.02, 0.1, 0.3, 0.6, 1.0])  # places of a prolongation, shares


@dataclass(frozen=True, eq=False)
class Bound:
    """b over a: between neighbouring ``nodes`` an arc, shifted, or a straight line."""

    nodes: Array  # (N,), a
    values: Array  # (N,), b
    pieces: tuple[Callable[[float], float] | None, ...]  # (N - 1)

    def __call__(self, a: float) -> float:
        i = int(np.clip(np.searchsorted(self.nodes, a, side="right") - 1, 0, len(self.pieces) - 1))
        piece = self.pieces[i]
        return piece(a) if piece else float(np.interp(a, self.nodes, self.values))

    @property
    def corners(self) -> Array:
        """Nodes at which one piece ends and another begins."""
        inner = [k for k in range(1, len(self.nodes) - 1) if self._turns(k)]
        return np.asarray(self.nodes[inner])

    def _turns(self, k: int) -> bool:
        before, after = self.pieces[k - 1], self.pieces[k]
        if before is not None or after is not None:
            return before is not after
        (a, b, c), (x, y, z) = self.nodes[k - 1 : k + 2], self.values[k - 1 : k + 2]
        return bool(abs((z - y) * (b - a) - (y - x) * (c - b)) > 1e-9 * (c - a) * (abs(z - x) + 1e-12))


class End:
    """One end of the rulings of a chain: ``sign`` is -1 for the high one, whose b is mirrored."""

    def __init__(
        self,
        face: Ruled,
        scale: Scale,
        parts: Sequence[tuple[float, float, Arc]],
        sign: float,
        prolong_mm: float,
        clear_mm: float,
    ) -> None:
        self._face, self._scale, self._sign, self._clear_mm = face, scale, sign, clear_mm
        self.wished_mm = self.prolonged_mm = self.left_mm = 0.0
        self._parts = [(a, b, self._prolonged(arc, (a, b), prolong_mm)) for a, b, arc in self._merged(parts)]

    @staticmethod
    def _merged(parts: Sequence[tuple[float, float, Arc]]) -> Iterator[tuple[float, float, Arc]]:
        """Slabs that the same arc runs through are one."""
        row = list(parts)
        while row:
            start, end, arc = row.pop(0)
            while row and row[0][2] is arc:
                end = row.pop(0)[1]
            yield start, end, arc

    def _prolonged(self, arc: Arc, over: tuple[float, float], mm: float) -> Callable[[float], float]:
        """An arc, farther out by ``mm`` or what is free of it over all of its length."""
        sign, scale = self._sign, self._scale
        if mm <= 0.0:
            return arc
        free = min(self.reach(a, arc(a), mm) for a in np.linspace(*over, 9))
        self.wished_mm = max(self.wished_mm, free)
        return (lambda a: arc(a) - sign * free / scale.at(a)) if free > 0.0 else arc

    def reach(self, a: float, b: float, mm: float) -> float:
        """How far (mm) a ruling may be prolonged from b without running into a body."""
        per = self._scale.at(a)
        free = 0.0
        for share in PROBES:
            if self._face.is_buried(a, b - self._sign * share * mm / per):
                return free if share > PROBES[1] else 0.0
            free = float(share) * mm
        return free

    def bound(self) -> Bound:
        """Never steeper than ``STEEPEST``."""
        nodes = [_nodes(start, end) for start, end, _ in self._parts]
        for _ in range(3):  # the places at which it leaves an arc, and comes back, are found and added
            a, f, piece = self._flat(nodes)
            outer = self._outer(a, f, STEEPEST)
            more = self._transitions(a, f, outer, piece)
            if not more:
                break
            for k, at in more:
                nodes[k] = np.unique(np.append(nodes[k], at))
        floor = self._floor(a, f, outer, piece)
        end = self._over(a, floor) if np.any(floor > outer) else outer
        per = np.array([self._scale.at(x) for x in a])
        self.prolonged_mm = self.wished_mm + float(((f - end) * per).max(initial=0.0))
        self.left_mm = float(((end - f) * per).max(initial=0.0))
        return self._bound(a, f, end, piece)

    def _flat(self, nodes: Sequence[Array]) -> tuple[Array, Array, Array]:
        """All nodes with b, mirrored for the high end, and the part of each; ends stand twice."""
        f = [
            np.array([self._sign * part[2](x) for x in row])
            for part, row in zip(self._parts, nodes, strict=True)
        ]
        piece = np.concatenate([np.full(len(row), k) for k, row in enumerate(nodes)])
        return np.concatenate(nodes), np.concatenate(f), piece

    def _outer(self, a: Array, f: Array, steepest: float) -> Array:
        """The highest function below f that is nowhere steeper."""
        found, step = f.copy(), steepest * self._scale.across_per_along * np.diff(a)
        for k in range(1, len(a)):
            found[k] = min(found[k], found[k - 1] + step[k - 1])
        for k in range(len(a) - 2, -1, -1):
            found[k] = min(found[k], found[k + 1] + step[k])
        return found

    def _over(self, a: Array, floor: Array) -> Array:
        """The lowest function above ``floor`` that is nowhere steeper than material allows.

        Beside a step it stays on the upper level for as long as the cutter is thick.
        """
        found = -self._outer(a, -floor, STEEPEST_AT_MATERIAL)
        falls = found > floor + 1e-12 * (1.0 + np.abs(floor))
        held, width = floor.copy(), self._clear_mm / self._scale.mm_a
        for k in np.flatnonzero(~falls):
            if k + 1 < len(a) and falls[k + 1]:
                beside = (a >= a[k]) & (a <= a[k] + width)
                held[beside] = np.maximum(held[beside], floor[k])
            if k > 0 and falls[k - 1]:
                beside = (a <= a[k]) & (a >= a[k] - width)
                held[beside] = np.maximum(held[beside], floor[k])
        return -self._outer(a, -held, STEEPEST_AT_MATERIAL)

    def _transitions(self, a: Array, f: Array, outer: Array, piece: Array) -> list[tuple[int, float]]:
        """(part, a) at which the bound leaves its arc on a tangent, or comes back to it."""
        found, on = [], f - outer <= 1e-12 * (1.0 + np.abs(f))
        for k in range(1, len(a) - 1):
            if not on[k] or piece[k - 1] != piece[k + 1]:
                continue
            part, steep = self._parts[piece[k]][2], STEEPEST * self._scale.across_per_along
            for there, slope in ((k + 1, steep), (k - 1, -steep)):
                if on[there] or abs(a[k + 1] - a[k - 1]) < 1e-7 * (a[-1] - a[0]):
                    continue
                if abs(outer[there] - (f[k] + slope * (a[there] - a[k]))) > 1e-9 * (1.0 + abs(f[k])):
                    place = self._landing(part, float(a[there]), float(a[k]), float(outer[there]), -slope)
                else:
                    place = self._tangent(part, float(a[k - 1]), float(a[k + 1]), slope)
                if place is not None:
                    found.append((int(piece[k]), place))
        return found

    def _tangent(
        self, part: Callable[[float], float], start: float, end: float, slope: float
    ) -> float | None:
        found = minimize_scalar(
            lambda x: self._sign * part(x) - slope * x,
            bounds=(start, end),
            method="bounded",
            options={"xatol": 1e-9 * (end - start)},
        )
        slack = 1e-6 * (end - start)
        return float(found.x) if start + slack < found.x < end - slack else None

    def _landing(
        self, part: Callable[[float], float], off: float, on: float, value: float, slope: float
    ) -> float | None:
        def above(x: float) -> float:
            return self._sign * part(x) - (value + slope * (x - off))

        if above(off) * above(on) >= 0.0:
            return None
        return float(brentq(above, off, on))

    def _floor(self, a: Array, f: Array, outer: Array, piece: Array) -> Array:
        """The lowest that material allows, (N,); asked within arcs, since their ends lie on other faces."""
        spans = np.array([(start, end) for start, end, _ in self._parts])[piece]
        inner = WITHIN * (spans[:, 1] - spans[:, 0])
        asked = np.clip(a, spans[:, 0] + inner, spans[:, 1] - inner)
        beyond = np.flatnonzero(f - outer > 1e-12 * (1.0 + np.abs(f)))
        floor = outer.copy()
        if not len(beyond):
            return floor
        probed = beyond[np.unique(np.linspace(0, len(beyond) - 1, 24).astype(int))]
        free = []
        for k in probed:
            per, b = self._scale.at(asked[k]), self._parts[piece[k]][2](float(asked[k]))
            free.append(self.reach(float(asked[k]), b, float(f[k] - outer[k]) * per) / per)
        wanted = f[probed] - outer[probed]
        blocked = np.array(free) < wanted * (1.0 - 1e-9)
        if blocked.any():
            near = np.abs(beyond[:, None] - probed[None, :]).argmin(axis=1)
            floor[beyond] = np.where(blocked[near], f[beyond] - np.array(free)[near], outer[beyond])
        return np.maximum(floor, outer)

    def _bound(self, a: Array, f: Array, end: Array, piece: Array) -> Bound:
        on = np.abs(f - end) <= 1e-12 * (1.0 + np.abs(f))
        nodes, values, pieces = [float(a[0])], [float(end[0])], []
        for k in range(1, len(a)):
            if a[k] <= nodes[-1]:
                continue
            exact = on[k] and on[k - 1] and piece[k] == piece[k - 1]
            pieces.append(self._parts[piece[k]][2] if exact else None)
            nodes.append(float(a[k]))
            values.append(float(end[k]))
        return _simplified(np.array(nodes), self._sign * np.array(values), pieces)


def _nodes(start: float, end: float) -> Array:
    """Denser towards both ends, where arcs may turn steep."""
    return np.asarray(start + (end - start) * 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, NODES))))


def _simplified(nodes: Array, values: Array, pieces: Sequence[Callable[[float], float] | None]) -> Bound:
    """Without the nodes at which nothing changes."""
    whole = Bound(nodes, values, tuple(pieces))
    keep = [0, *(k for k in range(1, len(nodes) - 1) if whole._turns(k)), len(nodes) - 1]
    return Bound(nodes[keep], values[keep], tuple(pieces[k] for k in keep[:-1]))


def long_enough(
    face: Ruled,
    scale: Scale,
    along: tuple[float, float],
    made: tuple[Bound, Bound],
    ends: tuple[End, End],
) -> tuple[tuple[float, float], tuple[Bound, Bound], float, float]:
    """The range and bounds with no ruling near no length, what was prolonged for it and what was left, mm."""
    a = np.unique(np.concatenate([_nodes(*along), made[0].nodes, made[1].nodes]))
    per = np.array([scale.at(x) for x in a])
    length = np.array([made[1](x) - made[0](x) for x in a]) * per
    wanted = min(SHORT_MM, SHORT_SHARE * float(length.max()))
    short = length < wanted * (1.0 - 1e-6)
    if not short.any():
        return along, made, 0.0, 0.0
    for which in (1, 0):
        if all(
            ends[which].reach(float(x), made[which](x), float(wanted - have)) >= 0.99 * (wanted - have)
            for x, have in zip(a[short][::4], length[short][::4], strict=True)
        ):
            moved = _widened(a, short, made, scale, wanted, which)
            new = (made[0], moved) if which else (moved, made[1])
            return along, new, float(wanted - length.min()), 0.0
    return _without_ends(face, along, made, a, length)


def _widened(
    a: Array, short: Array, made: tuple[Bound, Bound], scale: Scale, wanted: float, which: int
) -> Bound:
    """One bound, kept ``wanted`` mm away from the other over each range in which rulings are ``short``."""
    bound, other, sign = made[which], made[1 - which], (1.0 if which else -1.0)

    def away(x: float) -> float:
        return other(x) + sign * wanted / scale.at(x)

    def over(x: float) -> float:
        return sign * (bound(x) - away(x))

    ends = np.flatnonzero(np.diff(short.astype(int)))
    crossings = [_zero(over, float(a[k]), float(a[k + 1])) for k in ends]
    nodes = np.unique(np.concatenate([bound.nodes, other.nodes, crossings]))
    pieces: list[Callable[[float], float] | None] = []
    for x, y in pairwise(nodes):
        middle = 0.5 * (x + y)
        pieces.append(partial(away) if over(middle) < 0.0 else _piece(bound, middle))
    values = [sign * max(sign * bound(float(x)), sign * away(float(x))) for x in nodes]
    return _simplified(nodes, np.array(values), pieces)


def _zero(f: Callable[[float], float], a: float, b: float) -> float:
    """Where f crosses 0 between a and b; where that is rounding, the end at which it is nearer to 0."""
    if f(a) * f(b) >= 0.0:
        return a if abs(f(a)) < abs(f(b)) else b
    return float(brentq(f, a, b))


def _piece(bound: Bound, a: float) -> Callable[[float], float] | None:
    i = int(np.clip(np.searchsorted(bound.nodes, a, side="right") - 1, 0, len(bound.pieces) - 1))
    return bound.pieces[i]


def _without_ends(
    face: Ruled, along: tuple[float, float], made: tuple[Bound, Bound], a: Array, length: Array
) -> tuple[tuple[float, float], tuple[Bound, Bound], float, float]:
    """Ends whose rulings have next to no length are left; raises Trimmed where one inside has none."""
    sound = np.flatnonzero(length > MIN_MM)
    if not len(sound) or len(sound) < sound[-1] - sound[0] + 1:
        at = a[int(length.argmin())]
        raise Trimmed(message("cad.no_length_at", at=place(face.point(float(at), made[0](float(at))))))
    cut = float(a[sound[0]]), float(a[sound[-1]])
    left = max(float(length[: sound[0] + 1].max(initial=0.0)), float(length[sound[-1] :].max(initial=0.0)))
    bounds = [_over(bound, cut) for bound in made]
    return cut, (bounds[0], bounds[1]), 0.0, left if cut != along else 0.0


def _over(bound: Bound, along: tuple[float, float]) -> Bound:
    inner = bound.nodes[(bound.nodes > along[0]) & (bound.nodes < along[1])]
    nodes = np.concatenate([[along[0]], inner, [along[1]]])
    pieces = tuple(_piece(bound, 0.5 * (x + y)) for x, y in pairwise(nodes))
    return Bound(nodes, np.array([bound(float(x)) for x in nodes]), pieces)
