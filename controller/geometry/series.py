"""Truncated Taylor series to the third order: exact derivatives of any formula.

A formula written for ``m=math`` or ``m=numpy`` gives, with ``m=controller.geometry.series`` and
``variable(u)`` for u, its value and first three derivatives at every sample at once:
``c[k]`` holds the k-th derivative over k!, shape (4, ...). Products are products of
polynomials without their higher terms; functions follow from the differential
equation each obeys, coefficient by coefficient (e.g. f = sqrt(x): f f = x).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from controller.geometry.arrays import Array

ORDER = 3
pi = math.pi


class Jet:
    """f(u0 + h) = c[0] + c[1] h + c[2] h^2 + c[3] h^3 at an array of points u0."""

    __slots__ = ("_turned", "c")
    __array_ufunc__ = None  # an array on the left of + - * / hands over to the jet

    def __init__(self, c: Array) -> None:
        self.c = c
        self._turned: tuple[Jet, Jet] | None = None  # sine and cosine, which are wanted both

    def derivative(self, order: int) -> Array:
        """d^order f / du^order, order 0 to 3."""
        return np.asarray(self.c[order] * float(math.factorial(order)))

    def __add__(self, other: Any) -> Jet:
        if isinstance(other, Jet):
            return Jet(self.c + other.c)
        value = self.c[0] + other
        if np.shape(value) == self.c.shape[1:]:
            made = self.c.copy()
        else:
            made = np.empty((ORDER + 1, *np.shape(value)))
            made[1:] = _widened(self.c, made.ndim)[1:]
        made[0] = value
        return Jet(made)

    def __neg__(self) -> Jet:
        return Jet(-self.c)

    def __sub__(self, other: Any) -> Jet:
        return self.__add__(-other)

    def __rsub__(self, other: Any) -> Jet:
        return self.__neg__().__add__(other)

    def __mul__(self, other: Any) -> Jet:
        if not isinstance(other, Jet):
            return Jet(self.c * other)
        return Jet(_product(self.c, other.c))

    def __truediv__(self, other: Any) -> Jet:
        if not isinstance(other, Jet):
            return Jet(self.c / other)
        return _quotient(self.c, other.c)

    def __rtruediv__(self, other: Any) -> Jet:
        zero = np.zeros(np.shape(self.c[0]))
        return _quotient(np.stack([zero + other, zero, zero, zero]), self.c)

    def __pow__(self, exponent: int) -> Jet:
        if exponent < 0:
            return 1.0 / self ** (-exponent)
        result = constant(np.ones(np.shape(self.c[0])))
        for _ in range(exponent):
            result = result * self
        return result

    __radd__ = __add__
    __rmul__ = __mul__


def variable(u: Any) -> Jet:
    """The parameter itself at the points ``u`` (float or array)."""
    u = np.asarray(u, dtype=float)
    return Jet(np.stack([u, np.ones(u.shape), np.zeros(u.shape), np.zeros(u.shape)]))


def constant(value: Any) -> Jet:
    """A value that does not depend on the parameter."""
    value = np.asarray(value, dtype=float)
    return Jet(np.stack([value, *(np.zeros(value.shape),) * ORDER]))


def jet(value: Any) -> Jet:
    """``value`` as a jet, whatever it is."""
    return value if isinstance(value, Jet) else constant(value)


def _pair(x: Any, y: Any) -> tuple[Jet, Jet]:
    """Both as jets of one shape; one of them may be a number."""
    x, y = jet(x), jet(y)
    if x.c.shape == y.c.shape:
        return Jet(x.c + 0.0), Jet(y.c + 0.0)
    zero = np.zeros(np.broadcast_shapes(np.shape(x.c[0]), np.shape(y.c[0])))
    return Jet(np.stack([c + zero for c in x.c])), Jet(np.stack([c + zero for c in y.c]))


def _product(a: Array, b: Array) -> Array:
    """Nearly all of the planner's arithmetic is done here: all orders of b times one of a at once."""
    if a.ndim != b.ndim:
        a, b = _widened(a, b.ndim), _widened(b, a.ndim)
    a0, a1, a2, a3 = a
    made: Array = a0 * b
    from_first, from_second, third = made[1:], made[2:], made[3:]
    from_first += a1 * b[:3]
    from_second += a2 * b[:2]
    third += a3 * b[:1]
    return made


def _widened(c: Array, dimensions: int) -> Array:
    """The same coefficients with the dimensions that numpy would add in front of the points."""
    return c.reshape(ORDER + 1, *(1,) * (dimensions - c.ndim), *c.shape[1:])


def _quotient(a: Array, b: Array) -> Jet:
    """q b = a."""
    a0, a1, a2, a3 = a
    b0, b1, b2, b3 = b
    q0 = a0 / b0
    q1 = (a1 - q0 * b1) / b0
    q2 = (a2 - (q0 * b2 + q1 * b1)) / b0
    q3 = (a3 - (q0 * b3 + q1 * b2 + q2 * b1)) / b0
    return Jet(np.array([q0, q1, q2, q3]))


def sqrt(x: Any) -> Jet:
    """f f = x; x > 0."""
    a0, a1, a2, a3 = jet(x).c
    f0 = np.sqrt(a0)
    twice = 2.0 * f0
    f1 = a1 / twice
    f2 = (a2 - f1 * f1) / twice
    f3 = (a3 - (f1 * f2 + f2 * f1)) / twice
    return Jet(np.array([f0, f1, f2, f3]))


def _sine_cosine(x: Any) -> tuple[Jet, Jet]:
    """s' = c x', c' = -s x'."""
    at = jet(x)
    if at._turned is None:
        _, a1, a2, a3 = at.c
        a2, a3 = 2.0 * a2, 3.0 * a3
        s0, c0 = np.sin(at.c[0]), np.cos(at.c[0])
        s1, c1 = a1 * c0, -(a1 * s0)
        s2, c2 = (a1 * c1 + a2 * c0) / 2, -(a1 * s1 + a2 * s0) / 2
        s3, c3 = (a1 * c2 + a2 * c1 + a3 * c0) / 3, -(a1 * s2 + a2 * s1 + a3 * s0) / 3
        at._turned = Jet(np.array([s0, s1, s2, s3])), Jet(np.array([c0, c1, c2, c3]))
    return at._turned


def sin(x: Any) -> Jet:
    return _sine_cosine(x)[0]


def cos(x: Any) -> Jet:
    return _sine_cosine(x)[1]


def hypot(x: Any, y: Any) -> Jet:
    x, y = _pair(x, y)
    return sqrt(x * x + y * y)


def atan2(y: Any, x: Any) -> Jet:
    """(x x + y y) f' = x y' - y x'; the value by ``numpy.atan2``."""
    x, y = _pair(x, y)
    rate = (x * _rate(y) - y * _rate(x)) / (x * x + y * y)
    return _integral(np.atan2(y.c[0], x.c[0]), rate)


def acos(x: Any) -> Jet:
    """f' = -x' / sqrt(1 - x x); -1 < x < 1."""
    x = jet(x)
    return _integral(np.acos(x.c[0]), -(_rate(x) / sqrt(1.0 - x * x)))


def _rate(x: Jet) -> Jet:
    """x' as a series; its last coefficient is unknown, left 0 and not used by ``_integral``."""
    rate = np.zeros_like(x.c)
    rate[0], rate[1], rate[2] = x.c[1], 2.0 * x.c[2], 3.0 * x.c[3]
    return Jet(rate)


def _integral(value: Array, rate: Jet) -> Jet:
    r, c = rate.c, np.empty_like(rate.c)
    c[0], c[1], c[2], c[3] = value, r[0], r[1] / 2.0, r[2] / 3.0
    return Jet(c)
