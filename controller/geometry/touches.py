"""Where a cut's tool axis touches the pole of the rotary next to the work, and its direction there.

At the pole (the axis along +-w2) that rotary follows the direction of (a, b), the axis' parts
across w2. Where the axis comes there and turns back (contact of the second order), or creeps
through it (third), a and b vanish with their derivatives, and beside it they are rounding: at
1e-5 of u from a triple contact 1e-15 mm is all that is left of them. So the common zeros are
taken out once, in the plan,

    (a, b) (u) = rho(u) (a~, b~) (u),        rho(u) = product of (u - root) / length,

and what is left, which vanishes nowhere, tells the direction to the last digit. rho keeps its
sign: through a contact of odd order the tilt goes on to the other side, smoothly.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from types import ModuleType
from typing import NamedTuple

from controller.geometry.vectors import Number


class Seen(NamedTuple):
    """A unit tool axis as the rotary next to the work sees it: rho (a, b) across w2, h along it."""

    a: Number
    b: Number
    h: Number
    rho: Number


class Touch(NamedTuple):
    """The tool axis over ``low`` <= u <= ``high``, as polynomials in u - ``about`` without a common zero.

    ``roots`` holds each place on the pole as often as its order says. A row of ``across`` is
    (a~, b~), one of ``along`` the part along w2: of the axis times any positive length.
    """

    low: float
    high: float
    roots: tuple[float, ...]
    about: float
    across: tuple[tuple[float, float], ...]
    along: tuple[float, ...]

    def seen(self, u: Number, m: ModuleType = math) -> Seen:
        """The axis at ``u``: floats, arrays or series."""
        x = u - self.about
        a, b = self.across[-1]
        for p, q in self.across[-2::-1]:
            a, b = a * x + p, b * x + q
        h: Number = self.along[-1]
        for p in self.along[-2::-1]:
            h = h * x + p
        rho = u - self.roots[0]
        for root in self.roots[1:]:
            rho = rho * (u - root)
        per = 1.0 / m.sqrt(rho * rho * (a * a + b * b) + h * h)
        return Seen(a, b, h * per, rho * per)


def seen_at(touches: Sequence[Touch], u: float) -> Seen | None:
    """The axis at ``u`` where a touch tells it; for the tick."""
    for touch in touches:
        if touch.low <= u <= touch.high:
            return touch.seen(u)
    return None


def seen_along(touches: Sequence[Touch], u: Number, plain: Seen, m: ModuleType) -> Seen:
    """As ``seen_at`` for samples or series ``u``; ``plain`` elsewhere, its ``rho`` 1."""
    import numpy as np

    at = np.asarray(u.c[0] if hasattr(u, "c") else u)
    for touch in touches:
        within = (touch.low <= at) & (at <= touch.high)
        if within.all():
            return _broadcast(touch.seen(u, m), u)
        if within.any():
            plain = Seen(*(_where(within, x, y, u) for x, y in zip(touch.seen(u, m), plain, strict=True)))
    return plain


def _broadcast(seen: Seen, u: Number) -> Seen:
    a, b, h, rho = (_where(True, x, x, u) for x in seen)
    return Seen(a, b, h, rho)


def _where(within: Number, x: Number, y: Number, u: Number) -> Number:
    """``x`` where ``within``, else ``y``, as what ``u`` is: samples or a series of samples."""
    import numpy as np

    if not hasattr(u, "c"):
        return np.where(within, x, y) + 0.0 * u
    a, b = (v.c if hasattr(v, "c") else _still(v, u.c) for v in (x, y))
    return type(u)(np.where(within, a, b))


def _still(number: Number, like: Number) -> Number:
    """The Taylor coefficients of what does not change."""
    import numpy as np

    still = np.zeros(np.shape(like))
    still[0] = number
    return still
