"""A strip in the words of a program: G51, G52 or G6.2, absolute, mm, every number with a point."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from controller.cad.curve import Nurbs
from controller.cad.strip import Strip
from controller.geometry.arrays import Array

MAX_COMMENT = 100


def number(value: float, digits: int = 9) -> str:
    """With a decimal point, since words without one count in 0.01 mm, and no digits that say nothing."""
    text = f"{value:.{digits}f}".rstrip("0")
    return "0." if text in ("-0.", "0.") else text


def comment(text: str) -> str:
    """In brackets; brackets inside, and what is not plain text, would end it."""
    return f"({re.sub('[^ -~]', '?', text).translate(str.maketrans('()', '[]'))[:MAX_COMMENT]})"


def code(strip: Strip) -> str:
    """The code that says this strip."""
    if strip.cone is not None:
        return "G51"
    return "G6.2" if strip.upper.cubic() is None or strip.lower.cubic() is None else "G52"


def lines(strip: Strip, feed_mm_min: float) -> Iterator[str]:
    """The block of one strip."""
    feed = f"F{number(feed_mm_min, 3)}"
    if strip.cone is not None:
        one = strip.cone
        words = zip("XYZIJKHRD", (*one.start, *one.centre, one.height_mm, one.upper_radius_mm), strict=False)
        yield " ".join(
            ["G51", *(letter + number(v) for letter, v in words), f"D{number(one.sweep_deg, 12)}", feed]
        )
        return
    upper, lower = strip.upper.cubic(), strip.lower.cubic()
    if upper is not None and lower is not None:
        first, *others = (_place(point) for point in (*upper, *lower))
        yield f"G52 {first} {feed}"
        yield from others
        return
    yield f"G6.2 P{strip.upper.order} Q{strip.lower.order} {feed}"
    yield from _curve(strip.upper)
    yield from _curve(strip.lower)


def _place(point: Array) -> str:
    return " ".join(letter + number(float(value)) for letter, value in zip("XYZ", point, strict=True))


def _curve(curve: Nurbs) -> Iterator[str]:
    """K X Y Z (and R) of each point, then the last knots alone."""
    knots = [number(float(knot), 15) for knot in curve.shares]
    weights: Iterable[float] = (curve.weights / curve.weights.max()).tolist()
    for knot, point, weight in zip(knots, curve.points, weights, strict=False):
        ratio = f" R{number(weight, 15)}" if curve.is_rational else ""
        yield f"K{knot} {_place(point)}{ratio}"
    yield from (f"K{knot}" for knot in knots[len(curve.points) :])
