"""Strips in cut order, with side and tool, as the text of a part program.

Climb milling (the spindle turns clockwise) has the cutter on the left of its travel, G41, so
side and direction of travel are one choice for the whole program. Strips that share a ruling
follow each other and run through; how the cutter comes to the first of a row and leaves the
last of it is the controller's own affair (approach and departure of every block).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from controller.cad.curve import Nurbs
from controller.cad.strip import Strip
from controller.geometry.arrays import Array
from controller.machine.model import Machine, Tool
from controller.machine.tool_profile import flank_mm
from controller.messages import TextError, message

MEET_MM = 1e-3  # ends of rulings that are nearer are one
TWISTED_RAD = 1e-5
STRAIGHT_RAD = 2e-4  # between two rulings that are one: fits of 0.05 um over rulings of some millimetres
FITS = 0.999  # of the tightest hollow, for the largest cutter
PLACEMENTS = {"single": 1, "double": 2, "optimal": 3}


class NoTool(TextError):
    """Why no tool of the table cuts these faces."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """What the operator chooses."""

    feed_mm_min: float
    spindle_rev_min: float
    conventional: bool
    placement: str  # of twisted faces; "" leaves it to tool and machine


@dataclass(frozen=True, slots=True)
class Written:
    """A program and, for each of its faces in cut order, the strip as it was written."""

    text: str
    strips: tuple[Strip, ...]


def write(notes: Sequence[str], strips: Sequence[Strip], tool: Tool, wanted: Wanted) -> Written:
    """The program that cuts ``strips``; ``notes`` stand above it as comments."""
    row = tuple(_joined(ordered(stacked([_faced(one, wanted.conventional) for one in strips]))))
    body = ["%", *(comment(note) for note in notes)]
    body += list(_numbered(_blocks(row, tool, wanted)))
    return Written("\n".join([*body, "%", ""]), row)


def _faced(one: Strip, right: bool) -> Strip:
    return one if one.right == right else one.turned()


def _blocks(row: Sequence[Strip], tool: Tool, wanted: Wanted) -> Iterator[str]:
    yield "G21 G90 G17 G54 G61 G94"
    yield f"T{tool.number} M6 {comment(tool.name)}"
    yield f"S{wanted.spindle_rev_min:.0f} M3"
    said = ""
    for one in row:
        side = _side(one, wanted)
        if side != said:
            yield side
            said = side
        for part in one.joined or (one,):
            yield comment(f"face {part.face.number}: {part.face.kind}")
        yield from lines(one, wanted.feed_mm_min)
    yield from ("G40", "M5", "M30")


def _side(one: Strip, wanted: Wanted) -> str:
    side = "G42" if one.right else "G41"
    twisted = one.twist_rad() > TWISTED_RAD
    return f"{side} P{PLACEMENTS[wanted.placement]}" if twisted and wanted.placement else side


def _numbered(blocks: Iterator[str]) -> Iterator[str]:
    count = 0
    for block in blocks:
        plain = not block.startswith("(")
        count += 10 * plain
        yield f"N{count} {block}" if plain else block


# ---- one side of several faces -------------------------------------------------------


def stacked(strips: Sequence[Strip]) -> list[Strip]:
    """As given, but strips whose rulings go on in each other are one: a side that is split across them."""
    row = list(strips)
    while (pair := next(_stacks(row), None)) is not None:
        low, high = pair
        parts = tuple(part for one in pair for part in (one.joined or (one,)))
        whole = replace(
            low,
            upper=high.upper,
            cone=None,
            off_ruled_mm=max(low.off_ruled_mm, high.off_ruled_mm),
            prolonged_mm=max(low.prolonged_mm, high.prolonged_mm),
            bridges=low.bridges or high.bridges,
            remarks=(*low.remarks, *(one for one in high.remarks if one not in low.remarks)),
            joined=parts,
        )
        row[row.index(low)] = whole
        row.remove(high)
    return row


def _stacks(row: Sequence[Strip]) -> Iterator[tuple[Strip, Strip]]:
    """Pairs of strips, the lower one first, of which each ruling of the one goes on in the other's."""
    share = np.linspace(0.0, 1.0, 17)
    for low in row:
        for high in row:
            if high is low or float(_apart(low.upper.at(share), high.lower.at(share)).max()) > MEET_MM:
                continue
            below, above = (one.upper.at(share) - one.lower.at(share) for one in (low, high))
            sizes = np.linalg.norm(below, axis=1) * np.linalg.norm(above, axis=1)
            if (np.linalg.norm(np.cross(below, above), axis=1) <= STRAIGHT_RAD * sizes).all():
                yield low, high


def _apart(rows: Array, others: Array) -> Array:
    return np.asarray(np.linalg.norm(rows - others, axis=1))


# ---- order -------------------------------------------------------------------------


def ordered(strips: Sequence[Strip]) -> list[Strip]:
    """As given, but each is followed by what begins where it ends, and a row begins at its beginning."""
    left, row = list(strips), []
    while left:
        one: Strip | None = _first(left)
        while one is not None:
            left.remove(one)
            row.append(one)
            one = next((other for other in left if meets(row[-1], other)), None)
    return row


def _first(left: Sequence[Strip]) -> Strip:
    """Back from the first that is left, as far as others lead to it; all the way round: itself."""
    one, seen = left[0], {id(left[0])}
    while (before := next((o for o in left if o is not one and meets(o, one)), None)) is not None:
        if id(before) in seen:
            return left[0]
        seen.add(id(before))
        one = before
    return one


def meets(before: Strip, after: Strip) -> bool:
    """Whether two strips share the ruling between them."""
    pairs = ((before.upper, after.upper), (before.lower, after.lower))
    return all(float(np.linalg.norm(a.points[-1] - b.points[0])) <= MEET_MM for a, b in pairs)


def _joined(row: Sequence[Strip]) -> Iterator[Strip]:
    """With the very same points where one strip ends and the next begins: CAD keeps them apart by nm."""
    before: Strip | None = None
    for one in row:
        if before is not None and one.cone is None and meets(before, one):
            one = replace(
                one,
                upper=_from(before.upper.points[-1], one.upper),
                lower=_from(before.lower.points[-1], one.lower),
            )
        yield one
        before = one


def _from(start: Array, curve: Nurbs) -> Nurbs:
    return replace(curve, points=np.concatenate([start[None, :], curve.points[1:]]))


# ---- tool --------------------------------------------------------------------------


def fitting(strips: Sequence[Strip], machine: Machine) -> Tool:
    """The thickest tool that fits into every hollow and is long enough; raises NoTool."""
    fits = tools_for(strips, machine)
    if not fits:
        tightest, longest = _needed(strips)
        known = ", ".join(f"T{t.number} (r {t.radius_mm:g}, l {t.flute_mm:g} mm)" for t in machine.tools)
        key = "cad.no_tool_in_hollow" if tightest < math.inf else "cad.no_tool"
        raise NoTool(message(key, radius=FITS * tightest, flute=longest, known=known))
    return fits[0]


def tools_for(strips: Sequence[Strip], machine: Machine) -> list[Tool]:
    """The tools that fit into every hollow and are long enough, the thickest first."""
    tightest, longest = _needed(strips)
    fits = [
        tool
        for tool in (one.worn for one in machine.tools)
        if tool.radius_mm <= FITS * tightest and flank_mm(tool) >= longest
    ]
    return sorted(fits, key=lambda tool: (-tool.radius_mm, tool.length_mm))


def _needed(strips: Sequence[Strip]) -> tuple[float, float]:
    """The tightest hollow and the longest ruling, mm."""
    tightest = min((one.concave_mm() for one in strips), default=math.inf)
    return tightest, max((one.size()[1] for one in strips), default=0.0)


# ---- the words of a program: G51, G52 or G6.2, absolute, mm, every number with a point --------


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
