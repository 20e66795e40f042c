"""A CAD face as a strip of rulings between two directrices, or the reason why it is none.

A face's surface is asked in both of its directions whether the curves that run across are
straight. What other bodies of the file hide of it is taken away, and its rulings are clipped to the
outline that is left (``clip``). The ends of the rulings are the directrices: the surface's own curves
where the face is a box of its parameters, else curves fitted to the outline, at the same parameter,
so that rulings stay rulings.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from controller.cad.arcs import Trimmed
from controller.cad.bound import Bound
from controller.cad.clip import Clip, clips
from controller.cad.curve import NoFit, Nurbs, fit
from controller.cad.outline import Outline, TurnedPlane
from controller.geometry.arrays import Array
from controller.geometry.defects import concave_radius, defect
from controller.geometry.surfaces import RuledSurface
from controller.geometry.vectors import Vector
from controller.messages import Message, TextError, message
from controller.plan.surfaces.cuts import describe

if TYPE_CHECKING:
    from controller.cad.kernel import Face, Spline


EXACT_MM = 1e-6  # rulings straighter than this are straight
KINK_SHARE, KINK_RAD = 1e-5, 2e-3  # a curve that turns by more over so little of it has a kink there
SAME_SHARE = 1e-5  # of the way along: corners that are nearer are one
STANDS = 12  # rulings that are asked what is beyond their ends,
STANDS_MM = np.array([0.1, 0.5])  # in these distances
STANDS_MORE, STANDS_MOSTLY = 0.1, 0.5  # shares of the way: rulings that stand on something before others
LOOKS_ALONG, LOOKS_ACROSS = 41, 9  # samples between two knots are at least these over a face
LEVEL = 1e-9  # sine of the angle between a cone's axis and Z
LEVEL_MM = 1e-9
FITTED = message("cad.fitted")


class Source(Protocol):
    """What a strip was made of: a face of a CAD file (``kernel.Face``), or a row of lines."""

    @property
    def number(self) -> int:
        """In its file, from 1."""

    @property
    def kind(self) -> str:
        """Of geometry."""


@dataclass(frozen=True, eq=False)
class Strip:
    """What is cut of one face: two directrices, upper and lower, in the direction of travel."""

    face: Source
    upper: Nurbs
    lower: Nurbs
    off_ruled_mm: float  # how far the face's own curves leave the rulings
    right: bool  # the material is on the left of the travel, the cutter on its right
    cone: Cone | None = None  # where G51 says it
    remarks: tuple[Message, ...] = ()
    is_whole_box: bool = False  # more than the face is cut
    base: RuledSurface | None = None  # the face's own surface, over the box about it
    prolonged_mm: float = 0.0  # of rulings beyond the face
    bridges: bool = False  # it leads over a hole
    covers: Callable[[float, float], bool] | None = None  # whether a place (u, v) is cut; None: all are
    stands: float = 0.0  # share of the way with material beyond the one end of the rulings alone
    joined: tuple[Strip, ...] = ()  # those of one face each that it was put together of

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

    def __init__(self, reason: Message, off_ruled_mm: float = math.inf) -> None:
        super().__init__(reason)
        self.off_ruled_mm = off_ruled_mm


@dataclass(frozen=True, slots=True)
class How:
    """What is wished of a face's strips.

    ``whole``: a face that is not cut as it is trimmed is cut as the whole box about it. ``prolong_mm``: so
    far are rulings prolonged where no material is. ``clear_mm``: the radius of the cutter, for which steps in
    the material under it are kept clear of. ``other``: of two families of rulings, the other one.
    """

    within_mm: float = 1e-3  # so far may its curves leave straight lines
    whole: bool = False
    prolong_mm: float = 0.0
    clear_mm: float = 3.0
    other: bool = False


def strips(face: Face, how: How = How()) -> list[Strip]:
    """The strips of ``face``, the largest first; several where other bodies cut it apart. Raises NotRuled."""
    try:
        straight = [] if face.kind == "plane" else _straight(face, how.within_mm)
        exposed = face.exposed()
        if not exposed:
            raise NotRuled(message("cad.covered"), 0.0)
        if how.other and len(straight) < 2:
            raise NotRuled(message("cad.one_family"), 0.0)
        return _of_parts(exposed, straight, how)
    except Trimmed as error:
        raise NotRuled(error.said, 0.0) from None


def strip(face: Face, how: How = How()) -> Strip:
    """The largest strip of ``face``; raises NotRuled."""
    return strips(face, how)[0]


def _of_parts(parts: Sequence[Face], straight: Sequence[bool], how: How) -> list[Strip]:
    """Of what is exposed of a face, the largest part first; raises Trimmed where none of it can be cut."""
    found: list[Strip] = []
    reasons: list[Trimmed] = []
    for part in sorted(parts, key=lambda one: -one.area_mm2):
        try:
            found += _strips(part, straight, how)
        except Trimmed as error:
            reasons.append(error)
    if not found:
        raise reasons[0]
    covered = parts[0].covered
    notes = [message("cad.covered_part", share=100.0 * covered)] if covered > 0.0 else []
    return [replace(one, remarks=(*notes, *one.remarks)) for one in found]


def _straight(face: Face, within_mm: float) -> list[bool]:
    """Whether rulings run across u, and across v, the better first; raises NotRuled where neither does."""
    outline = Outline(face)
    spline = face.spline(outline.box)
    found = [_Direction(face, face, spline, outline, along_u) for along_u in (True, False)]
    straight = [one for one in found if one.off_mm <= within_mm]
    if not straight:
        off = min(one.off_mm for one in found)
        raise NotRuled(message("cad.not_straight", off=_words(off)), off)
    # An exact ruling before a nearly straight one; the steeper of two, since tools stand rather than lie.
    straight.sort(key=lambda one: (one.off_mm > EXACT_MM, -one.steepness))
    return [one.along_u for one in straight]


def _strips(face: Face, straight: Sequence[bool], how: How) -> list[Strip]:
    """Of one part of a face; raises Trimmed."""
    outline = Outline(face)
    if face.kind == "plane":
        corners = outline.corners() if how.prolong_mm <= 0.0 else None
        return [_quadrangle(face, outline, corners)] if corners is not None else _plane(face, outline, how)
    spline = face.spline(outline.box)
    found: list[list[Strip]] = []
    reasons: list[Trimmed] = []
    for along_u in straight:
        one = _Direction(face, face, spline, outline, along_u)
        try:
            found.append([_sound(made) for made in one.strips(how)])
        except Trimmed as error:
            reasons.append(error)
    if not found:
        raise reasons[0]
    if len(found) == 1:
        return found[0]
    second = found[1][0].stands > found[0][0].stands + STANDS_MORE
    return found[second is not how.other]


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
        raise Trimmed(message("cad.inward_corner"))
    steep = np.abs(sides[:, 2]) / np.linalg.norm(sides, axis=1)
    a, b, c, d = np.roll(corners, -1, axis=0) if steep[0] + steep[2] > steep[1] + steep[3] else corners
    low, high = (_line(a, b), _line(d, c)) if a[2] + b[2] <= d[2] + c[2] else (_line(d, c), _line(a, b))
    travel, down = low.points[-1] - low.points[0], low.points[0] - high.points[0]
    # S_v x S_u, v down: Eq. 5's normal
    out = face.outward(*outline.box[::2])
    return Strip(face, high, low, 0.0, bool(np.cross(down, travel) @ out > 0.0))


def _plane(face: Face, outline: Outline, how: How) -> list[Strip]:
    """A plane face with any outline: rulings along its straight edges where they fill it.

    Else those of its straight edges, up its slope or level that stand on most material. Raises Trimmed, also
    where a level face would need that: it is a floor.
    """
    straight, up = outline.straight(), outline.steepest()
    found: list[list[Strip]] = []
    reasons: list[Trimmed] = []
    for way in [*straight, *([] if up is None else [up, np.array([-up[1], up[0]])])]:
        turned = TurnedPlane(face, way)
        one = _Direction(face, turned, None, Outline(turned), True)
        try:
            made = [_sound(each) for each in one.strips(how)]
        except Trimmed as error:
            reasons.append(error)
            continue
        if all(each.covers is None and each.prolonged_mm <= how.prolong_mm for each in made):
            return made
        found.append(made)
    if up is None:
        raise Trimmed(message("cad.level"))
    if not found:
        raise reasons[0]
    return max(found, key=lambda made: (made[0].stands, -max(each.prolonged_mm for each in made)))


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

    def _at(self, a: float, b: float) -> Array:
        return self.seen.point(a, b) if self.along_u else self.seen.point(b, a)

    def point(self, a: float, b: float) -> Array:
        """(3,) mm; beyond the box on the straight line of the ruling."""
        b0, b1 = self.across
        if b0 <= b <= b1:
            return self._at(a, b)
        low, high = self._at(a, b0), self._at(a, b1)
        return low + (b - b0) / (b1 - b0) * (high - low)

    def is_buried(self, a: float, b: float) -> bool:
        """Whether a place, prolonged or not, is inside of a body."""
        return self.face.is_buried(self.point(a, b))

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

    def strips(self, how: How) -> list[Strip]:
        """Raises Trimmed."""
        if self.outline.is_box and self.spline is not None and how.prolong_mm <= 0.0:
            return [self._strip(self.along, *self._edges(self.spline))]
        try:
            found = clips(self, self.outline.wires, 0 if self.along_u else 1, how.prolong_mm, how.clear_mm)
        except Trimmed as trimmed:
            if not how.whole:
                raise
            made = self._strip(self.along, *self._box())
            return [
                replace(made, is_whole_box=True, remarks=(message("cad.whole_box", trimmed=trimmed.said),))
            ]
        return [self._clipped(one) for one in found]

    def _clipped(self, clip: Clip) -> Strip:
        """The strip of one chain of rulings; raises Trimmed."""
        try:
            low, high = (self._fitted(bound, clip.along) for bound in (clip.low, clip.high))
        except NoFit as error:
            raise Trimmed(error.said) from error
        made = self._strip(clip.along, low, high)
        return replace(
            made,
            remarks=tuple(_remarks(clip)),
            base=RuledSurface(*(curve.spline for curve in self._box())),
            prolonged_mm=clip.prolonged_mm,
            bridges=clip.bridges,
            covers=self._covers(clip) if clip.left_mm > 0.0 else None,
        )

    def _fitted(self, bound: Bound, along: tuple[float, float]) -> Nurbs:
        """One end of the rulings, with corners only where it has kinks."""
        start, end = along

        def points(share: Array) -> Array:
            return np.array([self.point(a, bound(float(a))) for a in start + share * (end - start)])

        own = np.array([]) if self.spline is None else self.spline.knots(self.along_u, kinks=True)
        places = np.concatenate([bound.corners, own])
        shares = _once((places[(places > start) & (places < end)] - start) / (end - start))
        kinks = [share for share in shares[1:-1] if _turn_rad(points, share) > KINK_RAD]
        return fit(points, np.array([0.0, *kinks, 1.0]))

    def _covers(self, clip: Clip) -> Callable[[float, float], bool]:
        (start, end), turn = clip.along, getattr(self.seen, "mapped", None)

        def covers(u: float, v: float) -> bool:
            u, v = turn(u, v) if turn else (u, v)
            a, b = (u, v) if self.along_u else (v, u)
            return start <= a <= end and clip.low(a) <= b <= clip.high(a)

        return covers

    def _strip(self, along: tuple[float, float], low: Nurbs, high: Nurbs) -> Strip:
        """Between the low and the high ends of the rulings; raises Trimmed.

        Lower is the end at which they stand on material, else that with the lower Z.
        """
        share = np.linspace(0.02, 0.98, 25)
        way = high.at(share) - low.at(share)
        if float(np.linalg.norm(way, axis=1).max()) < LEVEL_MM:
            raise Trimmed(message("cad.no_length"))
        flipped = float(way[:, 2].mean()) < -1e-9 * float(np.linalg.norm(way, axis=1).mean())
        stands = _stand(self.face, low, high) - _stand(self.face, high, low)
        if abs(stands) > STANDS_MOSTLY:
            flipped = stands < 0.0
        upper, lower = (low, high) if flipped else (high, low)
        right, cone = self._right(flipped, along), self._cone(lower, upper)
        made = Strip(self.face, upper, lower, self.off_mm, right, cone, stands=abs(stands))
        if np.linalg.norm(made.lower.points - made.lower.points[0], axis=1).max() < LEVEL_MM:
            raise Trimmed(message("cad.lower_point"))
        return made

    def _box(self) -> tuple[Nurbs, Nurbs]:
        """The ends of the rulings of the whole box about the face."""
        if self.spline is not None:
            return self._edges(self.spline)
        corners = [[self.point(a, b) for a in self.along] for b in self.across]
        return _line(*corners[0]), _line(*corners[1])

    def _edges(self, spline: Spline) -> tuple[Nurbs, Nurbs]:
        ends = spline.box[2:] if self.along_u else spline.box[:2]
        low, high = (spline.edge(self.along_u, at).written() for at in ends)
        return low, high

    def _right(self, flipped: bool, along: tuple[float, float]) -> bool:
        """Whether Eq. 5's normal, right of the travel, points out of the material."""
        share = np.linspace(0.05, 0.95, 7)
        b = 0.5 * (self.across[0] + self.across[1])
        total = 0.0
        for s in share:
            a = along[0] + s * (along[1] - along[0])
            h = 1e-4 * (along[1] - along[0])
            travel = self.point(a + h, b) - self.point(a - h, b)
            down = self.point(a, self.across[0]) - self.point(a, self.across[1])
            normal = np.cross(-down if flipped else down, travel)
            out = self.seen.outward(*((a, b) if self.along_u else (b, a)))
            total += float(normal @ out) / (float(np.linalg.norm(normal) * np.linalg.norm(out)) or 1.0)
        return total > 0.0

    def _cone(self, lower: Nurbs, upper: Nurbs) -> Cone | None:
        """The words of G51 where the face is a whole segment of a cylinder or cone about Z."""
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


def _stand(face: Face, at: Nurbs, other: Nurbs) -> float:
    """The share of the way with material beyond one end of the rulings; 0 of a face without a body."""
    share = (np.arange(STANDS) + 0.5) / STANDS
    ends = at.at(share)
    way = ends - other.at(share)
    size = np.linalg.norm(way, axis=1)[:, None]
    steps = STANDS_MM[:, None, None] * way / np.maximum(size, LEVEL_MM)
    buried = [any(face.is_buried(point) for point in row) for row in np.swapaxes(ends + steps, 0, 1)]
    return sum(buried) / STANDS


def _remarks(clip: Clip) -> list[Message]:
    """What a chain does beside the outline of its face."""
    found = [FITTED]
    if clip.bridges:
        found.append(message("cad.bridged"))
    if clip.prolonged_mm > EXACT_MM:
        found.append(message("cad.prolonged", by=_words(clip.prolonged_mm)))
    if clip.left_mm > EXACT_MM:
        found.append(message("cad.left", by=_words(clip.left_mm)))
    return found


def _turn_rad(points: Callable[[Array], Array], share: float) -> float:
    """By how much a curve turns at a share of it."""
    before, at, after = points(share + KINK_SHARE * np.array([-1.0, 0.0, 1.0]))
    one, other = at - before, after - at
    return math.atan2(float(np.linalg.norm(np.cross(one, other))), float(one @ other))


def _once(shares: Array) -> Array:
    """Sorted, from 0 to 1; those nearer than ``SAME_SHARE`` are one."""
    found: Array = np.unique(shares)
    inner = found[(found > SAME_SHARE) & (found < 1.0 - SAME_SHARE)]
    apart = inner[np.concatenate([[True], np.diff(inner) > SAME_SHARE])] if len(inner) else inner
    return np.concatenate([[0.0], apart, [1.0]])


def _between(knots: Array, least: int) -> Array:
    """Samples over a range of knots, its ends and ``least`` or more of them, also inside each span."""
    per = max(2, math.ceil((least - 1) / (len(knots) - 1)))
    steps = np.linspace(knots[:-1], knots[1:], per + 1)[:-1]
    return np.append(steps.T.ravel(), knots[-1])


def _rows(vector: Sequence[Array]) -> Array:
    return np.stack(np.broadcast_arrays(*vector), axis=1)


def _words(mm: float) -> str:
    return f"{mm:.3g} mm" if mm >= 0.01 else f"{1e3 * mm:.3g} um"
