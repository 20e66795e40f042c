"""The length along a curve, and its inverse fitted for the tick: on arrays, before the curve is run along."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from controller.geometry.arrays import Array
from controller.geometry.curves import DEGREE, Arc, ArcLength, Curve, Line, NoLength
from controller.geometry.vectors import norm

MAX_PANELS = 4096  # of a curve
MAX_OF_SPAN = 256  # of a part between knots: a curve with a cusp there takes some hundred
# The length of a panel by Gauss-Legendre: exact up to degree 31 of the speed.
_NODES, _WEIGHTS = (0.5 * a for a in np.polynomial.legendre.leggauss(16))
_NODES = _NODES + 0.5
# Lobatto nodes hold both ends of a panel, so neighbours meet; between them lie the check points.
_FIT = 0.5 - 0.5 * np.cos(np.pi * np.arange(1, DEGREE + 1) / DEGREE)
_CHECK = 0.5 - 0.5 * np.cos(np.pi * (np.arange(DEGREE) + 0.5) / DEGREE)
_POWERS = _FIT[:, None] ** np.arange(DEGREE)


def of(curve: Curve) -> ArcLength:
    """Along ``curve``, the panels fitted; ValueError for one without length or without end to its bends."""
    if isinstance(curve, Line | Arc):  # even already
        length = float(norm(curve.derivative(0.0)))
        _refuse_nothing(length)
        panel = (0.0, 1.0 / length, 0.0, 1.0, *(0.0,) * (DEGREE - 1))
        return ArcLength(curve, length, (0.0, length), (0.0, 1.0), (panel,))
    rough = float(np.sum(_length(curve, np.arange(64) / 64, np.arange(1, 65) / 64)))
    _refuse_nothing(rough)
    tolerance = 1e-12 * max(1.0, rough)
    knots_u, lengths, fits = zip(*_panels(curve, tolerance), strict=True)
    # Summed exactly: a knot's rounding would otherwise show as a step at each join.
    knots = tuple(math.fsum(lengths[:i]) for i in range(len(lengths) + 1))
    panels = tuple((s, 1.0 / n, *fit) for s, n, fit in zip(knots, lengths, fits, strict=False))
    return ArcLength(curve, knots[-1], knots, (*knots_u, 1.0), panels)


def s_at(arc: ArcLength, u: Any) -> Any:
    """Length from the start to the parameter ``u`` (float or array), mm, by Gauss-Legendre."""
    at = np.clip(np.asarray(u, dtype=float), 0.0, 1.0)
    index = np.clip(np.searchsorted(arc.knots_u, at, side="right") - 1, 0, len(arc.panels) - 1)
    s = np.array(arc.knots_mm)[index] + _length(arc.curve, np.array(arc.knots_u)[index], at)
    return s if np.ndim(u) else float(s)


def _speed(curve: Curve, u: Array) -> Array:
    return np.broadcast_to(norm(curve.derivative(u, 1, np), np), u.shape)


def _length(curve: Curve, start: Any, end: Any) -> Array:
    """Arc length between parameters (equal shapes), mm; good within one panel."""
    start, end = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    width = end - start
    speeds = _speed(curve, start[..., None] + width[..., None] * _NODES)
    return np.asarray(width * (speeds @ _WEIGHTS))


def _refuse_nothing(length: float) -> None:
    if not (math.isfinite(length) and length > 0.0):
        raise NoLength("cut.no_length")


def _panels(curve: Curve, tolerance: float) -> Iterator[tuple[float, float, tuple[float, ...]]]:
    """(start u, length, fit) of panels in order, halved until each fits.

    Where C' = 0 at an end, u goes like a root of s and no polynomial fits: there the
    halves shrink geometrically until what is left is shorter than the tolerance.
    """
    # The polynomials do not reach over a knot, where the curve's own polynomials change.
    knots = getattr(curve, "breaks", (0.0, 1.0))
    open_ends, start, count, of_span = [*reversed(knots[1:])], 0.0, 0, 0
    new_span = set(knots)
    while open_ends:
        end = open_ends[-1]
        length = float(_length(curve, start, end))
        fit = _fit(curve, start, end, length, tolerance)
        middle = 0.5 * (start + end)
        if fit is None and start < middle < end:
            open_ends.append(middle)
            continue
        count, of_span = count + 1, of_span + 1
        if count > MAX_PANELS or of_span > MAX_OF_SPAN:
            raise NoLength("cut.endless_bend")
        if length > 0.0:
            yield start, length, fit or (start, end - start, *(0.0,) * (DEGREE - 1))
        start = open_ends.pop()
        of_span = 0 if start in new_span else of_span


def _fit(curve: Curve, start: float, end: float, length: float, tolerance: float) -> tuple[float, ...] | None:
    """Coefficients of u(x), x = share of the panel's length; None where the panel is too wide."""
    if length <= tolerance:
        return (start, end - start, *(0.0,) * (DEGREE - 1))
    middle = 0.5 * (start + end)
    halves = _length(curve, [start, middle], [middle, end])
    # The length itself gets a tenth of what the fit may miss.
    if abs(float(halves.sum()) - length) > 0.1 * tolerance:
        return None
    u = _invert(curve, start, end, length, _FIT * length)
    if u is None:
        return None
    u[-1] = end
    # Divided by x once, so that u = start at x = 0 holds exactly and small u stay exact.
    tail = np.linalg.solve(_POWERS, (u - start) / _FIT)
    fitted = start + _CHECK * np.polynomial.polynomial.polyval(_CHECK, tail)
    missed = _length(curve, np.full(DEGREE, start), fitted) - _CHECK * length
    if not np.all(np.abs(missed) <= tolerance):
        return None
    return (start, *map(float, tail))


def _invert(curve: Curve, start: float, end: float, length: float, s: Array) -> Array | None:
    """Parameters at lengths ``s`` from ``start`` by Newton; None where it does not settle."""
    u = start + (end - start) * s / length
    low = np.full(s.shape, start)
    for _ in range(12):
        missed = s - _length(curve, low, u)
        speed = _speed(curve, u)
        if not np.all(speed > 0.0):
            return None
        step = missed / speed
        u = np.clip(u + step, start, end)
        if np.all(np.abs(step) <= 4e-16 * np.abs(u) + 1e-14 * (end - start)):
            return u
    return None
