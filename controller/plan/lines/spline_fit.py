"""A polyline of five values becomes one C2 cubic spline within a tolerance of it (G64).

**Knots.** The row's length is cut into spans of ``BASE_MM``; a span that leaves the polyline by
more than the tolerance is halved, and neighbours are halved until none is more than twice
as long as the other. So spans stay long where the lines are smooth (the fit averages the
rounding of their decimals, which must not become jerk) and are short at corners.

**Values.** Least squares over the length of the row: banded, some ten operations per point.
The spline is C2 whatever its control values are, so a row of any length is fitted in
windows: the values that spans already given away depend on are kept, the others are
found again with the next window. What is far away counts less by 0.27 for each knot.

**Proof.** Between two breakpoints (polyline corners and knots) the difference of spline and
polyline is a cubic; it lies in the hull of its four Bezier points, so the largest of
these bounds it everywhere, not at samples only. Both are compared at the same length s.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from controller.geometry.arrays import Array, distinct
from controller.plan import banded

Index = npt.NDArray[np.intp]

BASE_MM = 8.0  # longest span
STOP_MM = 5e-4  # a corner that would need spans this short is no blend: the row stops there
AHEAD = 6  # spans of BASE_MM that must be known beyond what is given away
USED = 0.9  # share of the tolerance from which on a span is halved
FROZEN = 2  # spans behind the seam whose knots the spans before it already depend on
GRADE = 2.01  # largest ratio of neighbouring spans
LOCAL = 0.4  # of several spans around one corner only those this near the worst are halved
BACK_COSINE = math.cos(math.radians(150.0))  # corners beyond are reversals: a stop
PAIRS = tuple(itertools.combinations_with_replacement(range(4), 2))  # of the B-splines on a span
PER_SPAN = 4  # places of a span that count in the least squares besides the polyline's corners


@dataclass(frozen=True, slots=True)
class Tolerance:
    """How far the spline may leave the polyline: tip (mm) and axis (rad).

    ``spin`` is the column of the rotary whose turn moves the axis only by ``sine`` of it,
    or None where both rotaries count in full.
    """

    tip_mm: float
    axis_rad: float
    spin: int | None


@dataclass(frozen=True, slots=True)
class Polyline:
    """Corners of the row: ``s`` (M,) rising, ``values`` (M, 5), ``sine`` (M,) of axis to pole."""

    s: Array
    values: Array
    sine: Array

    def after(self, other: Polyline) -> Polyline:
        """Both, ``other`` first; its last corner is this one's first and stands once."""
        pairs = ((other.s, self.s), (other.values, self.values), (other.sine, self.sine))
        s, values, sine = (np.concatenate((a[:-1], b)) for a, b in pairs)
        return Polyline(s, values, sine)

    def between(self, first: int, last: int) -> Polyline:
        return Polyline(self.s[first : last + 1], self.values[first : last + 1], self.sine[first : last + 1])


@dataclass(frozen=True, slots=True)
class Spans:
    """A part of the spline: ``knots`` (n + 1,), ``c`` (n, 5, 4) in powers of s - knot.

    ``rests``: it ends at rest, exactly on the polyline.
    """

    knots: Array
    c: Array
    rests: bool


class Row:
    """One row of lines, fitted from its front while it grows at its end."""

    def __init__(self, tolerance: Tolerance, start: Polyline) -> None:
        self._tolerance = tolerance
        self._line = start  # corners from the last one at or before the seam
        self._begin()

    def _begin(self) -> None:
        """At rest where the polyline begins."""
        self._seam = float(self._line.s[0])
        self._left = np.full(3, self._seam)  # three knots before the seam
        self._frozen = np.empty(0)  # knots behind the seam that stand already
        self._kept: Array = self._line.values[:1]  # control values that stand already

    def extend(self, more: Polyline) -> None:
        """Corners that follow; the first is the last one known."""
        self._line = more.after(self._line)

    def take(self, final: bool) -> Spans | None:
        """The next part of the spline, as far as more lines cannot change it; None if there is none yet.

        ``final``: the row ends with what is known. Ends at rest and exactly on the polyline
        where ``rests``; then ``take`` goes on from rest there.
        """
        stop = self._reversal()
        if stop is not None:
            return self._given(self._line.between(0, stop), stop)
        if final:
            last = len(self._line.s) - 1
            return self._given(self._line, last) if last > 0 else None
        known = self._seam + float(self._frozen[-1] - self._seam if len(self._frozen) else 0.0)
        spans = math.floor((float(self._line.s[-1]) - known) / BASE_MM)
        if spans <= AHEAD:
            return None
        return self._given(self._line, None)

    def _reversal(self) -> int | None:
        """Index of the first corner where the tip turns back, legs of noise aside."""
        step = np.diff(self._line.values[:, :3], axis=0)
        length = np.sqrt((step * step).sum(axis=1))
        cosine = (step[1:] * step[:-1]).sum(axis=1)
        long = np.minimum(length[1:], length[:-1]) > 4.0 * self._tolerance.tip_mm
        back = long & (cosine < BACK_COSINE * length[1:] * length[:-1])
        back &= self._line.s[1:-1] > self._seam
        return int(back.argmax()) + 1 if back.any() else None

    def _given(self, line: Polyline, last: int | None) -> Spans:
        """Fit what is known; give away all of it (``last`` is its end) or what is far from its end."""
        fit = _Fit(line, self._seam, self._left, self._frozen, self._kept, self._tolerance, last is not None)
        corner = fit.refine()
        if corner is not None:
            return self._given(line.between(0, corner), corner)
        if last is not None:
            spans = Spans(fit.x, fit.spans(), True)
            self._line = self._line.between(last, len(self._line.s) - 1)
            self._begin()
            return spans
        return self._seamed(fit)

    def _seamed(self, fit: _Fit) -> Spans:
        x = fit.x
        n = int(np.searchsorted(x, x[-1] - AHEAD * BASE_MM, side="right")) - 1
        n = max(n, FROZEN + 1)
        spans = Spans(x[: n + 1], fit.spans()[:n], False)
        self._left = fit.t[n : n + 3]
        self._frozen = x[n + 1 : n + 1 + FROZEN]
        self._kept = fit.controls[n : n + 3]
        self._seam = float(x[n])
        first = max(0, int(np.searchsorted(self._line.s, self._seam, side="right")) - 1)
        self._line = self._line.between(first, len(self._line.s) - 1)
        return spans


class _Fit:
    """One window: knots ``x`` from the seam to the end of what is known, and control values."""

    def __init__(
        self,
        line: Polyline,
        seam: float,
        left: Array,
        frozen: Array,
        kept: Array,
        tolerance: Tolerance,
        final: bool,
    ) -> None:
        self._line, self._left, self._kept, self._tolerance = line, left, kept, tolerance
        self._way, self._length = np.diff(line.values, axis=0), np.diff(line.s)
        self._still = len(frozen)
        begin = float(frozen[-1]) if len(frozen) else seam
        count = (float(line.s[-1]) - begin) / BASE_MM
        whole = max(1, round(count)) if final else math.floor(count)
        grid = begin + BASE_MM * np.arange(1, whole + 1)
        if final:
            grid[-1] = line.s[-1]
        self.x: Array = np.concatenate(([seam], frozen[frozen < grid[0]], grid))
        self.t = self.controls = self._basis = np.empty(0)

    def refine(self) -> int | None:
        """Halve spans until all keep the tolerance; or the corner that cannot be blended."""
        while True:
            self._solve()
            off = self._deviation()
            wide = off > USED
            wide[: self._still] = False
            if not wide.any():
                return None
            short = np.diff(self.x) < 2.0 * STOP_MM
            if (wide & short).any():
                return self._sharpest(int(np.argmax(np.where(wide & short, off, 0.0))))
            around = np.max([np.roll(off, k) for k in (-2, -1, 0, 1, 2)], axis=0)
            self._halve(wide & ((off >= LOCAL * around) | ~np.isfinite(off)))

    def _halve(self, which: npt.NDArray[np.bool_]) -> None:
        while which.any():
            middle = 0.5 * (self.x[:-1] + self.x[1:])[which]
            self.x = np.sort(np.concatenate((self.x, middle)))
            size = np.diff(self.x)
            which = np.zeros(len(size), dtype=bool)
            which[:-1] |= size[:-1] > GRADE * size[1:]
            which[1:] |= size[1:] > GRADE * size[:-1]
            which[: self._still] = False

    def _sharpest(self, span: int) -> int | None:
        """Of the corners in and beside a span the one that bends most."""
        s, step = self._line.s, np.diff(self._line.values, axis=0) / np.diff(self._line.s)[:, None]
        step[:, :3] /= self._tolerance.tip_mm
        step[:, 3:] /= self._tolerance.axis_rad
        bend = np.abs(np.diff(step, axis=0)).sum(axis=1)
        reach = 4.0 * (self.x[span + 1] - self.x[span])
        near = (s[1:-1] > self.x[span] - reach) & (s[1:-1] < self.x[span + 1] + reach)
        near &= s[1:-1] > self.x[self._still]
        if not near.any():
            near = s[1:-1] > self.x[self._still]
        return int(np.argmax(np.where(near, bend, -1.0))) + 1

    # ---- least squares -----------------------------------------------------------

    def _solve(self) -> None:
        x = self.x
        self.t = np.concatenate((self._left, x, np.full(3, x[-1])))
        self._basis = _basis(self.t, len(x) - 1)
        place, span = self._places()
        weight = np.zeros(len(place))
        half = 0.5 * np.diff(place)
        weight[:-1] += half
        weight[1:] += half
        h = (place - x[span])[:, None]
        c = self._basis.take(span, axis=0)
        b = c[..., 0] + h * (c[..., 1] + h * (c[..., 2] + h * c[..., 3]))
        f = self._along(place) - self._kept[0]
        self.controls = self._kept[0] + self._banded(b, f, weight, span)

    def _places(self) -> tuple[Array, Index]:
        """Corners of the polyline and some places of each span, in order, with their span."""
        x, s = self.x, self._line.s
        inner = x[:-1, None] + np.diff(x)[:, None] * (np.arange(PER_SPAN) / PER_SPAN)
        corners = s[(s > x[0]) & (s < x[-1])]
        place = np.concatenate((inner.ravel(), corners, x[-1:]))
        place.sort()
        return place, np.clip(np.searchsorted(x, place, side="right") - 1, 0, len(x) - 2)

    def _banded(self, b: Array, f: Array, weight: Array, span: Index) -> Array:
        """Controls (n, 5) relative to the first kept one, those that stand already and the end given."""
        spans, n = len(self.x) - 1, len(self.x) + 2
        wb = b * weight[:, None]
        first = np.searchsorted(span, np.arange(spans))
        squares = np.add.reduceat(wb[:, [p for p, _ in PAIRS]] * b[:, [q for _, q in PAIRS]], first, axis=0)
        kept = self._kept - self._kept[0]
        moves = f.any(axis=0) | kept.any(axis=0)  # what stands all along has no controls but the first
        f = f[:, moves]
        sums = np.add.reduceat(wb[:, :, None] * f[:, None, :], first, axis=0)
        band, right = np.zeros((4, n)), np.zeros((n, f.shape[1]))
        for p in range(4):
            right[p : p + spans] += sums[:, p]
        for (p, q), square in zip(PAIRS, squares.T, strict=True):
            band[3 - (q - p), q : q + spans] += square
        known = len(kept)
        out = np.zeros((n, f.shape[1]))
        out[:known] = kept[:, moves]
        out[-1] = f[-1]
        for j in (*range(known), n - 1):  # what is known goes to the right side
            for d in range(-3, 4):
                i = j + d
                if 0 <= i < n:
                    right[i] -= band[3 - abs(d), max(i, j)] * out[j]
        inner = slice(known, n - 1)
        if n - 1 > known:
            out[inner] = banded.solve(band[:, inner], right[inner])
        found = np.zeros((n, len(moves)))
        found[:, moves] = out
        return found

    def spans(self) -> Array:
        """Coefficients (n, 5, 4) of the five values in powers of s - knot."""
        count = len(self.x) - 1
        rows = np.arange(count)[:, None] + np.arange(4)
        base = self.controls[:count]  # differences keep their digits
        c = np.einsum("kpi,kpj->kji", self._basis, self.controls[rows] - base[:, None, :])
        c[..., 0] += base
        return np.asarray(c)

    def _along(self, s: Array) -> Array:
        """Values (N, 5) of the polyline at ``s``."""
        line = self._line
        i = np.clip(np.searchsorted(line.s, s, side="right") - 1, 0, len(line.s) - 2)
        share = (s - line.s[i]) / self._length[i]
        return np.asarray(line.values.take(i, axis=0) + share[:, None] * self._way.take(i, axis=0))

    # ---- deviation ---------------------------------------------------------------

    def _deviation(self) -> Array:
        """Bound of the deviation on each span, in tolerances (n,)."""
        x, line, allowed = self.x, self._line, self._tolerance
        inside = (line.s > x[0]) & (line.s < x[-1])
        place = distinct(np.concatenate((x, line.s[inside])))
        span = np.clip(np.searchsorted(x, place, side="right") - 1, 0, len(x) - 2)
        h, c = (place - x[span])[:, None], self.spans().take(span, axis=0)
        f = self._along(place)
        value = c[..., 0] + h * (c[..., 1] + h * (c[..., 2] + h * c[..., 3])) - f
        rate = c[..., 1] + h * (2.0 * c[..., 2] + 3.0 * h * c[..., 3])
        width = np.diff(place)[:, None]
        slope = np.diff(f, axis=0) / width
        sine = np.interp(place, line.s, line.sine)
        sine = np.maximum(sine[:-1], sine[1:])
        points = (
            value[:-1],
            value[:-1] + width / 3.0 * (rate[:-1] - slope),
            value[1:] - width / 3.0 * (rate[1:] - slope),
            value[1:],
        )
        off = np.max([_size(point, sine, allowed) for point in points], axis=0)
        return np.asarray(np.maximum.reduceat(off, np.searchsorted(place, x[:-1])))


def _size(e: Array, sine: Array, allowed: Tolerance) -> Array:
    """Differences (N, 5) in tolerances: the larger of tip and axis."""
    tip = np.sqrt(e[:, 0] ** 2 + e[:, 1] ** 2 + e[:, 2] ** 2) / allowed.tip_mm
    one, other = np.abs(e[:, 3]), np.abs(e[:, 4])
    if allowed.spin is None:
        axis = np.maximum(one, other)
    else:
        tilt, spin = (other, one) if allowed.spin == 0 else (one, other)
        axis = tilt + np.minimum(sine + tilt, 1.0) * spin
    return np.asarray(np.maximum(tip, axis / allowed.axis_rad))


def _basis(t: Array, count: int) -> Array:
    """The four cubic B-splines on each of ``count`` spans from t[3] on: (count, 4, 4).

    [k, p, i] is the coefficient of (s - t[k + 3])^i in the p-th of them (de Boor-Cox).
    """
    k = np.arange(count) + 3
    old = [np.zeros((count, 4))]
    old[0][:, 0] = 1.0
    for d in (1, 2, 3):
        new = [np.zeros((count, 4)) for _ in range(d + 1)]
        for r, b in enumerate(old):
            low, high = t[k + r + 1 - d], t[k + r + 1]
            per = 1.0 / (high - low)
            shifted = np.zeros((count, 4))
            shifted[:, 1:] = b[:, :-1]
            new[r] += ((high - t[k]) * per)[:, None] * b - per[:, None] * shifted
            new[r + 1] += ((t[k] - low) * per)[:, None] * b + per[:, None] * shifted
        old = new
    return np.stack(old, axis=1)
