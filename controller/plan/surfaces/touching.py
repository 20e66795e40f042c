"""Finds where the tool axis of a cut touches the pole, once, when the cut is planned.

A ruling between splines is a polynomial over each span (a rational one has the direction of
its numerator), so its parts across w2 are polynomials a(u), b(u), and contact of order m is a
common zero of that multiplicity. Written in decimals it is one only nearly: rounding at 1e-16
parts a triple zero by 1e-5. A zero of multiplicity m is a simple one of the derivative m - 1,
which rounding does not move; there the lower coefficients are dropped if they turn the axis by
less than ``SAME_AXIS_RAD``, and what is left is divided by (u - root)^m. Any other axis (placed,
of a cone) is first made a polynomial about the place where it comes nearest to the pole.

A contact of the first order needs nothing of this: there the axis' own rate tells the direction. One
that decimals let miss the pole by a hair does: passing by it, the rotary would turn by half a turn
within the hair, and by what a tick sees far beside it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.polynomial import Polynomial, chebyshev

from controller.geometry.arrays import Array
from controller.geometry.curves import Bezier, Curve
from controller.geometry.placement import Placed, Turn
from controller.geometry.rulings import difference
from controller.geometry.splines import BSpline
from controller.geometry.surfaces import Surface
from controller.geometry.touches import Touch, seen_at
from controller.machine.kinematics import NEAR_POLE, Kinematics
from controller.motion.motions import SurfaceCut

SAME_AXIS_RAD = 4e-9  # a touch is one if the axis need not turn by more to be exactly there
HIT_RAD = 1e-13  # a contact of the first order that misses by less turns the rotary by nothing
SAME_WAY_RAD = 1e-10  # where polynomials end inside a cut, by so much the rotary may jump
CLEAR = 1e3  # times what is dropped: the least that counts as the contact's own coefficient
MIN_SLOPE = 1e-7  # of the axis: a contact flatter than that stands on the pole
SAMPLES = 513
NEAR_RAD = 0.05  # a sample of an axis that comes near: zoomed into
BESIDE_RAD = 2e-3  # so near to the pole the rotary turns too quickly for samples that do not know
FINEST = 1e-13  # of u
MAX_DIPS = 32
_CLOSER = np.linspace(-1.0, 1.0, 41)
QUICK = 0.02  # of the largest
FIT_DEGREE, FITTED = 12, 1e-14
# Chebyshev's polynomials in powers, a column each: what a column repeats below its own end is cut off.
_POWERS = np.stack(
    [np.resize(chebyshev.cheb2poly([0.0] * k + [1.0]), FIT_DEGREE + 1) for k in range(FIT_DEGREE + 1)], axis=1
)
_POWERS = np.triu(_POWERS)
WINDOWS = tuple(0.25 * 0.5**k for k in range(8))  # of u, about a touch of an axis that is no polynomial


@dataclass(frozen=True, slots=True)
class _Part:
    """The axis (times a positive length) over low <= u <= high: ``rows`` (n, 3) of powers of u - about.

    Columns are the parts along e1, e2 and w2 of the machine.
    """

    low: float
    high: float
    about: float
    rows: Array

    def moved(self, about: float) -> Array:
        """The rows of powers of u - ``about``."""
        rows, by = self.rows.copy(), about - self.about
        for k in range(len(rows) - 1):  # Horner's scheme, once for each coefficient
            for i in range(len(rows) - 2, k - 1, -1):
                rows[i] += by * rows[i + 1]
        return rows

    def at(self, u: Array) -> Array:
        """(N, 3)."""
        x, value = (u - self.about)[:, None], np.zeros((len(u), 3))
        for row in self.rows[::-1]:
            value = value * x + row
        return np.asarray(value)


def touched(cut: SurfaceCut, kinematics: Kinematics) -> SurfaceCut:
    """``cut`` with the touches of its axis on the machine of ``kinematics``, and where it passes by."""
    if isinstance(cut.surface, Turn):
        return cut
    frame = np.array([cut.part.turn_back(v) for v in kinematics.work_frame()]).T
    curve = _ruling(cut.surface)
    axis = _axis_of(cut.surface if curve is None else curve, frame)
    dips = _dips(axis)
    if not dips:
        return cut
    parts = _polynomials(curve, frame) if curve is not None else iter(())
    if not isinstance(curve, Bezier | BSpline):
        parts = _fitted(axis, [u for u, off in dips if off <= SAME_AXIS_RAD])
    found = [_touch(part, kinematics) for part in parts]
    touches = tuple(touch for touch in found if touch is not None)
    beside = [u for u, off in dips if off > NEAR_POLE and seen_at(touches, u) is None]
    beside += [u for touch in touches for u in _turning(touch)]
    return replace(cut, touches=touches, beside_pole=tuple(beside)) if touches or beside else cut


def _turning(touch: Touch) -> list[float]:
    """Where the direction that is left turns quickly: what tells it comes near to nothing there."""

    def left(u: Array) -> Array:
        a, b, _, _ = touch.seen(u, np)
        return np.asarray(np.hypot(a, b) + 0.0 * u)

    u = np.linspace(touch.low, touch.high, SAMPLES)
    size = left(u)
    padded = np.concatenate(([np.inf], size, [np.inf]))
    low = (size <= padded[:-2]) & (size < padded[2:]) & (size < QUICK * size.max())
    return [_zoomed(left, float(one), touch.low, touch.high)[0] for one in u[low]]


def _zoomed(off: Callable[[Array], Array], at: float, low: float, high: float) -> tuple[float, float]:
    """(u, value) of the dip about one of ``SAMPLES`` places over low .. high."""
    least, half = float(off(np.array([at]))[0]), (high - low) / (SAMPLES - 1)
    while half > FINEST and least > 0.0:  # which it is where an end of a block is on the pole
        grid = np.clip(at + half * _CLOSER, low, high)
        values = off(grid)
        k, half = int(np.argmin(values)), 0.1 * half
        at, least = float(grid[k]), float(values[k])
    return at, least


# ---- the axis and its polynomials -----------------------------------------------------

Axis = Callable[[Array], Array]  # u (N,) to parts along e1, e2, w2 (N, 3), of a positive length


def _axis_of(source: Surface | Curve, frame: Array) -> Axis:
    way = source.axis if isinstance(source, Surface) else source.at

    def axis(u: Array) -> Array:
        return np.stack([np.broadcast_to(c, u.shape) for c in way(u, np)], axis=-1) @ frame

    return axis


def _dips(axis: Axis) -> list[tuple[float, float]]:
    """(u, sine of the angle to the pole) where the axis comes near to it, each dip zoomed into."""

    def off(u: Array) -> Array:
        a, b, h = axis(u).T
        square = a * a + b * b
        return np.asarray(np.sqrt(square / (square + h * h)))

    u = np.linspace(0.0, 1.0, SAMPLES)
    value = np.concatenate(([np.inf], off(u), [np.inf]))
    dips = np.flatnonzero((value[1:-1] <= value[:-2]) & (value[1:-1] < value[2:]) & (value[1:-1] < NEAR_RAD))
    if len(dips) > MAX_DIPS:  # rounding: the axis stands on the pole
        return []
    found = []
    for i in dips:
        at, least = _zoomed(off, float(u[i]), 0.0, 1.0)
        if least <= BESIDE_RAD:
            found.append((at, least))
    return found


def _polynomials(curve: Curve, frame: Array) -> Iterator[_Part]:
    if isinstance(curve, Bezier):
        yield _of_bernstein(0.0, 1.0, np.array(curve.points) @ frame)
    elif isinstance(curve, BSpline):
        points, weights = curve.weighted()
        for (low, high), p, w in zip(pairwise(curve.breaks), points, weights, strict=True):
            yield _of_bernstein(low, high, np.array(w)[:, None] * np.array(p) @ frame)


def _ruling(surface: Surface) -> Curve | None:
    """The curve that the tool axis is along, or None."""
    if not isinstance(surface, Placed):
        return surface.ruling_curve
    if surface.through is not None:
        return difference(*surface.through)
    alike = surface.normals_v[0] == surface.normals_v[1] and surface.taper_rad == 0.0
    return surface.ruling_curve if alike else None


def _of_bernstein(low: float, high: float, points: Array) -> _Part:
    """From control points (n, 3): c_k = binomial(n, k) times the k-th difference of the first points."""
    rows, degree, factor = [points[0]], len(points) - 1, 1.0
    for k in range(1, degree + 1):
        points = np.diff(points, axis=0)
        factor *= (degree - k + 1) / (k * (high - low))
        rows.append(factor * points[0])
    return _Part(low, high, low, np.array(rows))


def _fitted(axis: Axis, places: list[float]) -> Iterator[_Part]:
    """About each of the places, as far as a polynomial follows the axis."""
    for u in places:
        windows = ((max(0.0, u - half), min(1.0, u + half)) for half in WINDOWS)
        fits = (_interpolated(axis, low, high) for low, high in windows)
        yield from itertools.islice((part for part in fits if part is not None), 1)


def _interpolated(axis: Axis, low: float, high: float) -> _Part | None:
    """The axis over low .. high by its values at Chebyshev's nodes; None where that misses it."""
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    nodes = chebyshev.chebpts1(FIT_DEGREE + 1)
    series = np.linalg.solve(chebyshev.chebvander(nodes, FIT_DEGREE), axis(middle + half * nodes))
    part = _Part(low, high, middle, _POWERS @ series / half ** np.arange(FIT_DEGREE + 1)[:, None])
    check = np.linspace(low, high, 4 * FIT_DEGREE + 1)
    return part if np.abs(part.at(check) - axis(check)).max() <= FITTED else None


# ---- their common zeros ------------------------------------------------------------


def _touch(part: _Part, kinematics: Kinematics) -> Touch | None:
    """The touches of one polynomial, all zeros taken out; None where its own rates tell the direction."""
    values = part.at(np.linspace(part.low, part.high, SAMPLES))
    size = float(np.sqrt((values**2).sum(axis=1)).min())
    if not size > 0.0 or not _reached(values[:, 2], kinematics):
        return None
    left, roots, highest = part, list[float](), len(part.rows) - 1
    while (zero := _zero(left, size, highest, 0.0 if roots else HIT_RAD)) is not None:
        root, order = zero
        left = replace(left, about=root, rows=left.moved(root)[order:])
        roots += [root] * order
        highest = order
    if not roots or not _meets(part, left, roots):
        return None
    across = tuple((float(a), float(b)) for a, b in left.rows[:, :2])
    along = tuple(float(h) for h in part.moved(left.about)[:, 2])
    return Touch(part.low, part.high, tuple(map(float, roots)), float(left.about), across, along)


def _reached(along: Array, kinematics: Kinematics) -> bool:
    """Whether every pole that the axis may come to is one of this machine."""
    sides = [side for side in (1.0, -1.0) if (side * along > 0.0).any()]
    return all(kinematics.reaches_pole(side) for side in sides)


def _zero(part: _Part, size: float, highest: int, hit_rad: float) -> tuple[float, int] | None:
    """(u, order) of a common zero of both parts across w2, of the highest order that there is.

    One of the first order counts where it misses by ``hit_rad`` and more.
    """
    width = part.high - part.low
    for order in range(min(highest, len(part.rows) - 1), 0, -1):
        for u in _candidates(part, order):
            c = np.sqrt((part.moved(u)[:, :2] ** 2).sum(axis=1))
            dropped = float((c[:order] * max(u - part.low, part.high - u) ** np.arange(order)).sum())
            own = float(c[order]) * width**order
            if order == 1 and dropped < hit_rad * size:
                continue
            if dropped <= SAME_AXIS_RAD * size and own >= max(MIN_SLOPE * size, CLEAR * dropped):
                return u, order
    return None


def _candidates(part: _Part, order: int) -> Iterator[float]:
    """Both ends, and where the derivatives of order - 1 are least: there their product with the next is 0."""
    yield from (part.low, part.high)
    width = part.high - part.low
    scaled = part.moved(part.low)[:, :2] * (width ** np.arange(len(part.rows)))[:, None]
    columns = [Polynomial(column).deriv(order - 1) for column in scaled.T]
    product = sum((p * p.deriv() for p in columns), start=Polynomial([0.0]))
    slope = product.deriv()
    largest = float(np.abs(product.coef).max())
    if largest == 0.0:
        return
    for root in product.trim(1e-14 * largest).roots():
        t = float(np.real(root))
        for _ in range(3):  # Newton's, on the real line
            steep = float(slope(t))
            t -= float(product(t)) / steep if steep else 0.0
        if 0.0 < t < 1.0:
            yield float(part.low + width * t)


def _meets(part: _Part, left: _Part, roots: list[float]) -> bool:
    """Whether, where the polynomial ends inside the cut, the direction is that of the axis itself."""
    for end in (part.low, part.high):
        if 0.0 < end < 1.0 and end not in roots:
            u = np.array([end])
            a, b = part.at(u)[0, :2]
            p, q = left.at(u)[0, :2]
            if abs(a * q - b * p) > SAME_WAY_RAD * math.hypot(a, b) * math.hypot(p, q):
                return False
    return True
