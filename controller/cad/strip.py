"""A CAD face as a strip of rulings between two directrices, or the reason why it is none.

A face's surface is asked in both of its directions whether the curves that run across are
straight. What it is trimmed to must then begin and end on rulings; between them its edges are
the directrices: the surface's own curves where the face is a box of its parameters, else
curves fitted to the edges, at the same parameter, so that rulings stay rulings.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from controller.cad.curve import NoFit, Nurbs, fit
from controller.cad.outline import NOT_RULINGS, Outline, Side, Trimmed, TurnedPlane
from controller.geometry.defects import concave_radius, defect
from controller.geometry.surfaces import RuledSurface
from controller.geometry.vectors import Vector
from controller.messages import Said, TextError, said
from controller.plan.surfaces.cuts import describe

if TYPE_CHECKING:
    from controller.cad.kernel import Face, Spline

Array = NDArray[np.float64]

EXACT_MM = 1e-6  # rulings straighter than this are straight
SAME_SHARE = 1e-9  # of a side, far below what is built and far above its rounding
LOOKS_ALONG, LOOKS_ACROSS = 41, 9  # samples between two knots are at least these over a face
LEVEL = 1e-9  # sine of the angle between a cone's axis and Z
LEVEL_MM = 1e-9
FITTED = said("cad.fitted")


@dataclass(frozen=True, eq=False)
class Strip:
    """What is cut of one face: two directrices, upper and lower, in the direction of travel."""

    face: Face
    upper: Nurbs
    lower: Nurbs
    off_ruled_mm: float  # how far the face's own curves leave the rulings
    right: bool  # the material is on the left of the travel, the cutter on its right
    cone: Cone | None = None  # where G51 says it
    remark: Said | None = None
    is_whole_box: bool = False  # more than the face is cut

    def turned(self) -> Strip:
        """The same, run the other way: the cutter comes to be on the other side."""
        cone = self.cone.turned() if self.cone else None
        upper, lower = self.upper.turned(), self.lower.turned()
        return replace(self, upper=upper, lower=lower, right=not self.right, cone=cone)

    @property
    def surface(self) -> RuledSurface:
        return RuledSurface(self.upper.spline, self.lower.spline)

    def concave_mm(self) -> float:
        """The tightest hollow towards the cutter at either directrix; inf where there is none."""
        if self.face.kind == "plane":
            return math.inf
        side = 1.0 if self.right else -1.0
        upper, lower = self.upper.spline, self.lower.spline
        # Read upside down the normal points the other way.
        bottom = concave_radius(RuledSurface(upper, lower), side)[0]
        stands = len(np.unique(np.round(self.upper.points, 9), axis=0)) == 1  # the tip of a cone
        return min(bottom, math.inf if stands else concave_radius(RuledSurface(lower, upper), -side)[0])

    def size(self) -> tuple[float, float]:
        """(length of the lower directrix, longest ruling), mm."""
        share = np.linspace(0.0, 1.0, 401)
        low, high = self.lower.at(share), self.upper.at(share)
        way = np.linalg.norm(np.diff(low, axis=0), axis=1).sum()
        return float(way), float(np.linalg.norm(high - low, axis=1).max())

    def twist_rad(self) -> float:
        """The largest angle between the normals at both ends of a ruling; 0 where it can be developed."""
        if self.face.kind in ("plane", "cylinder", "cone"):
            return 0.0
        share = np.linspace(0.003, 0.997, 97)
        surface = self.surface
        ruling = _rows(surface.ruling(share, np))
        ends = [_rows(curve.derivative(share, 1, np)) for curve in (surface.upper, surface.lower)]
        a, b = (np.cross(end, ruling) for end in ends)
        sizes = np.linalg.norm(a, axis=1), np.linalg.norm(b, axis=1)
        sound = (sizes[0] > 1e-9) & (sizes[1] > 1e-9)
        sine = np.linalg.norm(np.cross(a, b), axis=1)[sound] / (sizes[0] * sizes[1])[sound]
        return float(np.arcsin(np.clip(sine, 0.0, 1.0)).max(initial=0.0))


@dataclass(frozen=True, slots=True)
class Cone:
    """The words of G51 (mm, degrees)."""

    start: Vector
    centre: Vector
    height_mm: float
    upper_radius_mm: float
    sweep_deg: float

    def turned(self) -> Cone:
        angle = math.radians(self.sweep_deg)
        x, y = self.start[0] - self.centre[0], self.start[1] - self.centre[1]
        c, s = math.cos(angle), math.sin(angle)
        start = (self.centre[0] + c * x - s * y, self.centre[1] + s * x + c * y, self.start[2])
        return replace(self, start=start, sweep_deg=-self.sweep_deg)


class NotRuled(TextError):
    """Why a face is not cut along rulings, and how far its curves leave straight lines."""

    def __init__(self, reason: Said, off_ruled_mm: float = math.inf) -> None:
        super().__init__(reason)
        self.off_ruled_mm = off_ruled_mm


def strip(face: Face, within_mm: float, whole: bool = False) -> Strip:
    """The strip of ``face``, its curves straight within ``within_mm``; raises NotRuled.

    ``whole``: a face whose outline does not follow rulings is cut as the whole box about it.
    """
    try:
        return _strip(face, within_mm, whole)
    except Trimmed as error:
        raise NotRuled(error.said, 0.0) from None


def _strip(face: Face, within_mm: float, whole: bool) -> Strip:
    outline = Outline(face)
    if face.kind == "plane" and (corners := outline.corners()) is not None:
        return _quadrangle(face, outline, corners)
    if face.kind == "plane":
        return _plane(face, outline, whole)
    spline = face.spline(outline.box)
    found = [_Direction(face, face, spline, outline, along_u) for along_u in (True, False)]
    straight = [one for one in found if one.off_mm <= within_mm]
    if not straight:
        off = min(one.off_mm for one in found)
        raise NotRuled(said("cad.not_straight", off=_words(off)), off)
    # An exact ruling before a nearly straight one; the steeper of two, since tools stand rather than lie.
    straight.sort(key=lambda one: (one.off_mm > EXACT_MM, -one.steepness))
    reasons = []
    for one in straight:
        try:
            return _sound(one.strip(whole))
        except Trimmed as error:
            reasons.append(error.said)
    raise NotRuled(reasons[0], straight[0].off_mm)


def _sound(made: Strip) -> Strip:
    """As it is; raises Trimmed where the reader would refuse its surface."""
    found = defect(made.surface)
    if found is not None:
        raise Trimmed(describe(found))
    return made


def _quadrangle(face: Face, outline: Outline, corners: Array) -> Strip:
    """A plane face with four corners (4, 3) and straight edges: the steeper two are rulings."""
    sides = np.roll(corners, -1, axis=0) - corners
    turns = np.cross(np.roll(sides, 1, axis=0), sides)
    if (turns @ turns[0]).min() <= 0.0:
        raise Trimmed(said("cad.inward_corner"))
    steep = np.abs(sides[:, 2]) / np.linalg.norm(sides, axis=1)
    a, b, c, d = np.roll(corners, -1, axis=0) if steep[0] + steep[2] > steep[1] + steep[3] else corners
    low, high = (_line(a, b), _line(d, c)) if a[2] + b[2] <= d[2] + c[2] else (_line(d, c), _line(a, b))
    travel, down = low.points[-1] - low.points[0], low.points[0] - high.points[0]
    # S_v x S_u, v down: Eq. 5's normal
    out = face.outward(*outline.box[::2])
    return Strip(face, high, low, 0.0, bool(np.cross(down, travel) @ out > 0.0))


def _plane(face: Face, outline: Outline, whole: bool) -> Strip:
    """A plane face between two straight edges of one direction; raises Trimmed."""
    for way in outline.straight():
        turned = TurnedPlane(face, way)
        try:
            return _sound(_Direction(face, turned, None, Outline(turned), True).strip(False))
        except Trimmed:
            continue
    if not whole:
        raise Trimmed(said("cad.hole") if outline.has_hole else NOT_RULINGS)
    spline = face.spline(outline.box)
    found = [_Direction(face, face, spline, outline, along_u) for along_u in (True, False)]
    return max(found, key=lambda one: one.steepness).strip(True)


def _line(start: Array, end: Array) -> Nurbs:
    return Nurbs(2, np.array([0.0, 0.0, 1.0, 1.0]), np.array([start, end]), np.ones(2))


class _Direction:
    """A face with its rulings taken to run across one of its two parameters."""

    def __init__(
        self, face: Face, seen: Face | TurnedPlane, spline: Spline | None, outline: Outline, along_u: bool
    ) -> None:
        self.face, self.seen, self.spline = face, seen, spline
        self.outline, self.along_u = outline, along_u
        u0, u1, v0, v1 = outline.box
        self.along, self.across = ((u0, u1), (v0, v1)) if along_u else ((v0, v1), (u0, u1))
        self.off_mm, self.steepness = self._straightness()

    def point(self, a: float, b: float) -> Array:
        return self.seen.point(a, b) if self.along_u else self.seen.point(b, a)

    def _breaks(self, along: bool) -> Array:
        """Where the surface itself may be less smooth, one way or the other, its ends among them."""
        if self.spline is None:
            return np.array(self.along if along else self.across)
        return self.spline.knots(self.along_u is along)

    def _straightness(self) -> tuple[float, float]:
        """(how far curves across leave the lines between their ends, mm; share of Z in them)."""
        off, steep = 0.0, []
        across = _between(self._breaks(False), LOOKS_ACROSS)
        for a in _between(self._breaks(True), LOOKS_ALONG):
            rows = np.array([self.point(a, b) for b in across])
            way = rows[-1] - rows[0]
            length = float(np.linalg.norm(way))
            if length < LEVEL_MM:
                off = max(off, float(np.linalg.norm(rows - rows[0], axis=1).max()))
                continue
            off = max(off, float(np.linalg.norm(np.cross(rows - rows[0], way / length), axis=1).max()))
            steep.append(abs(way[2]) / length)
        return off, float(np.mean(steep)) if steep else 0.0

    def strip(self, whole: bool) -> Strip:
        """Raises Trimmed and NoFit."""
        low, high, remark, is_whole = self._directrices(whole)
        share = np.linspace(0.02, 0.98, 25)
        way = high.at(share) - low.at(share)
        if float(np.linalg.norm(way, axis=1).max()) < LEVEL_MM:
            raise Trimmed(said("cad.no_length"))
        flipped = float(way[:, 2].mean()) < -1e-9 * float(np.linalg.norm(way, axis=1).mean())
        upper, lower = (low, high) if flipped else (high, low)
        made = Strip(
            self.face,
            upper,
            lower,
            self.off_mm,
            self._right(flipped),
            self._cone(lower, upper),
            remark,
            is_whole,
        )
        stands = np.linalg.norm(made.lower.points - made.lower.points[0], axis=1).max() < LEVEL_MM
        if stands:
            raise Trimmed(said("cad.lower_point"))
        return made

    def _directrices(self, whole: bool) -> tuple[Nurbs, Nurbs, Said | None, bool]:
        """Curves at the low and the high end of the rulings, what is told of them, whether it is a box."""
        if self.outline.is_box and self.spline is not None:
            return (*self._edges(self.spline), None, False)
        try:
            sides = self.outline.sides(self.along_u)
        except Trimmed as trimmed:
            if not whole or self.spline is None:
                raise
            return (*self._edges(self.spline), said("cad.whole_box", trimmed=trimmed), True)
        corners = _once(np.concatenate([sides[0].corners, sides[1].corners, self._knots()]))
        try:
            low, high = (fit(partial(self._points, side), corners) for side in sides)
        except NoFit as error:  # an edge that runs into a ruling at its end
            raise Trimmed(NOT_RULINGS) from error
        return low, high, FITTED, False

    def _points(self, side: Side, share: Array) -> Array:
        """Points (N, 3) of one end of the rulings."""
        a = self.along[0] + share * (self.along[1] - self.along[0])
        return np.array([self.point(x, y) for x, y in zip(a, side(share), strict=True)])

    def _knots(self) -> Array:
        """The same along the way, as shares."""
        knots = self._breaks(True)
        return np.asarray((knots - knots[0]) / (knots[-1] - knots[0]))

    def _edges(self, spline: Spline) -> tuple[Nurbs, Nurbs]:
        ends = spline.box[2:] if self.along_u else spline.box[:2]
        low, high = (spline.edge(self.along_u, at).written() for at in ends)
        return low, high

    def _right(self, flipped: bool) -> bool:
        """Whether Eq. 5's normal, right of the travel, points out of the material."""
        share = np.linspace(0.05, 0.95, 7)
        b = 0.5 * (self.across[0] + self.across[1])
        total = 0.0
        for s in share:
            a = self.along[0] + s * (self.along[1] - self.along[0])
            h = 1e-4 * (self.along[1] - self.along[0])
            travel = self.point(a + h, b) - self.point(a - h, b)
            down = self.point(a, self.across[0]) - self.point(a, self.across[1])
            normal = np.cross(-down if flipped else down, travel)
            out = self.seen.outward(*((a, b) if self.along_u else (b, a)))
            total += float(normal @ out) / (float(np.linalg.norm(normal) * np.linalg.norm(out)) or 1.0)
        return total > 0.0

    def _cone(self, lower: Nurbs, upper: Nurbs) -> Cone | None:
        """The words of G51 where the face is a whole stretch of a cylinder or cone about Z."""
        turned = self.face.turned()
        if turned is None or not self.along_u or not self.outline.is_box:
            return None
        at, axis = turned
        ends, tops = lower.at(np.array([0.0, 0.5, 1.0])), upper.at(np.array([0.0, 0.5, 1.0]))
        if math.hypot(axis[0], axis[1]) > LEVEL or max(np.ptp(ends[:, 2]), np.ptp(tops[:, 2])) > 1e-7:
            return None
        x, y = float(at[0]), float(at[1])
        sweep = math.degrees(self.along[1] - self.along[0]) * (1.0 if axis[2] > 0.0 else -1.0)
        low = float(ends[0, 2])
        radius = float(np.hypot(tops[:, 0] - x, tops[:, 1] - y).mean())
        start = (float(ends[0, 0]), float(ends[0, 1]), low)
        return Cone(start, (x, y, low), float(tops[0, 2]) - low, radius if radius > 1e-7 else 0.0, sweep)


def _once(shares: Array) -> Array:
    """Sorted; those that rounding alone tells apart are one: both sides of a regular part have the same."""
    found: Array = np.unique(shares)
    kept: Array = found[np.concatenate([[True], np.diff(found) > SAME_SHARE])]
    return kept


def _between(knots: Array, least: int) -> Array:
    """Samples over a range of knots, its ends and ``least`` or more of them, also inside each span."""
    per = max(2, math.ceil((least - 1) / (len(knots) - 1)))
    steps = np.linspace(knots[:-1], knots[1:], per + 1)[:-1]
    return np.append(steps.T.ravel(), knots[-1])


def _rows(vector: Sequence[Array]) -> Array:
    return np.stack(np.broadcast_arrays(*vector), axis=1)


def _words(mm: float) -> str:
    return f"{mm:.3g} mm" if mm >= 0.01 else f"{1e3 * mm:.3g} um"
