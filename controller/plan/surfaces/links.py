"""Links: from the last ruling of one surface to the first one of the next, without a retract between them.

        C1 of one  ======>=====.                   .=====>======  C1 of the next
                                `.               .'
                                  `---- link ---'      up to ``lead_mm`` off both

As a lead does, a link begins with the place, the rate and the bend that the cut has, and so it ends: tip
and both rotaries are cubics over s with two continuous derivatives. It goes where leads would go
anyway: not further than ``link_mm`` from surface to surface, and only where it stays out of both.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence

import numpy as np

from controller.geometry.arrays import Array
from controller.geometry.vectors import norm, subtract
from controller.machine.model import Machine
from controller.plan.context import Context
from controller.plan.segment import Segment
from controller.plan.surfaces import rates
from controller.plan.surfaces.cuts import Cut
from controller.plan.surfaces.leads import MAX_TURN_RAD, POSES, End, Room, lead_feed, spline_of
from controller.plan.surfaces.legs import CutSegment

NAME = "link"
SHARES = (1.0, 0.5, 0.25, 0.0)  # of ``lead_mm``, how far its middle is off the straight way
STRETCHES = (1.0, 1.6, 2.5, 4.0)  # its length over the way that the tip has to go, by the rate of the cuts
SPANS = 4


def reaches(before: Cut, after: Cut, machine: Machine) -> bool:
    """Whether the next train begins so near, and with nothing else changed, that a link is tried."""
    gap = norm(subtract(before.end.tip, after.start.tip))
    return machine.lead_mm > 0.0 and gap <= machine.link_mm and _alike(before, after)


def _alike(before: Cut, after: Cut) -> bool:
    """Whether nothing but the place changes: tool, its length, work offset and side; and no G61."""
    one, other = before.block.modal, after.block.modal
    same = (one.tool, one.offset, one.side, one.length_mm) == (
        other.tool,
        other.offset,
        other.side,
        other.length_mm,
    )
    return same and not (one.exact_joints or other.exact_joints)


def lay(before: Sequence[CutSegment], after: Sequence[CutSegment], context: Context) -> Segment | None:
    """The link furthest off the straight way that stays out of both trains and in travel, if there is one.

    Of those the first at the feed of the cuts, else the one that is the least slower. None where a rotary
    has to turn far: the tool would sweep over the part.
    """
    if max(abs(p - q) for p, q in zip(before[-1].end, after[0].start, strict=True)) > MAX_TURN_RAD:
        return None
    ends = End.of(before[-1], False, context), End.of(after[0], True, context)
    if not all(np.isfinite(end.rows).all() for end in ends):
        return None
    rooms = Room.of(before, False, context), Room.of(after, True, context)
    found = [one for one in _tried(*ends, context.machine) if all(room.lets(one) for room in rooms)]
    slow = min(end.feed_mm_s for end in ends)
    return min(found, key=lambda one: max(1.0, _strain(one, slow, context)), default=None)


def _strain(link: Segment, feed_mm_s: float, context: Context) -> float:
    """The largest share of the joints' limits that the link takes at a feed; above 1 it is to be slower."""
    d = rates.derivatives(link, np.linspace(0.0, link.motion.end, POSES), context.kinematics)
    shares = zip((d.first, d.second, d.third), rates.limits(context.machine).T, strict=True)
    roots = ((np.abs(q) / most).max() ** (1.0 / order) for order, (q, most) in enumerate(shares, 1))
    return float(feed_mm_s * max(roots))


def _tried(one: End, other: End, machine: Machine) -> Iterator[Segment]:
    for share in SHARES:
        for stretched in STRETCHES:
            yield _link(one, other, share * machine.lead_mm, stretched, machine)


def _link(one: End, other: End, off_mm: float, stretched: float, machine: Machine) -> Segment:
    """Through the middle of the straight way, ``off_mm`` off it."""
    a, b = one.rows, other.rows
    away = np.add(one.away, other.away)
    middle = 0.5 * (a[0] + b[0])
    middle[:3] += off_mm * away / max(float(np.linalg.norm(away)), 1e-9)
    way = float(np.linalg.norm(middle[:3] - a[0, :3]) + np.linalg.norm(b[0, :3] - middle[:3]))
    rate = 0.5 * (one.tip_rate + other.tip_rate)
    length = stretched * max(way / rate, 2.0 * off_mm / rate, _to_turn(a, b))
    made = cubics(a, middle, b, length)
    knots = np.linspace(0.0, length, SPANS + 1)
    spline = spline_of(knots, made, other.length_mm, other.place.line)
    feed, steps, turning = _feeds(one, other, length, machine)
    return Segment(spline, other.place, feed, False, one.joints, other.joints, True, NAME, steps, turning)


def _to_turn(a: Array, b: Array) -> float:
    """The way along s on which the rotaries turn from one end to the other at the mean of their rates."""
    turn = np.abs(b[0, 3:] - a[0, 3:])
    rate = 0.5 * np.abs(a[1, 3:] + b[1, 3:])
    return float((turn / np.maximum(rate, turn / 10.0 + 1e-12)).max())


def cubics(a: Array, middle: Array, b: Array, length: float) -> Array:
    """Coefficients (4 spans, 5, 4) of cubics with two continuous derivatives from ``a`` (3, 5) to ``b``.

    Place, rate and bend are those of the rows at both ends, the place in the middle is given. With the
    bends m0 to m4 at the knots, h apart, the places beside the ends are y0 + h y0' + h^2 (2 m0 + m1) / 6 and
    its mirror, and m(i-1) + 4 m(i) + m(i+1) = 6 (y(i-1) - 2 y(i) + y(i+1)) / h^2 inside, solved by hand.
    """
    h = length / SPANS
    (y0, d0, m0), (y4, d4, m4) = a, b
    m2 = 1.5 * (y0 + h * d0 - 2.0 * middle + y4 - h * d4) / h**2 + 0.5 * (m0 + m4)
    m1 = ((middle - y0 - 2.0 * h * d0) * 6.0 / h**2 - 5.0 * m0 - m2) / 6.0
    m3 = ((middle - y4 + 2.0 * h * d4) * 6.0 / h**2 - 5.0 * m4 - m2) / 6.0
    spans, place, rate = [], y0, d0
    for bend, following in itertools.pairwise((m0, m1, m2, m3, m4)):
        turn = (following - bend) / h
        spans.append(np.stack((place, rate, 0.5 * bend, turn / 6.0), axis=1))
        place = place + h * (rate + h * (0.5 * bend + h * turn / 6.0))
        rate = rate + 0.5 * h * (bend + following)
    return np.array(spans)


def _feeds(
    one: End, other: End, length: float, machine: Machine
) -> tuple[float, tuple[tuple[float, float], ...], tuple[tuple[float, float], ...]]:
    """Beside both rulings the cuts' own feeds, between them that of leads; and where it is not the tip's."""
    begin, end = one.settling(machine), length - other.settling(machine)
    own, next_own = one.feed_mm_s, other.feed_mm_s
    if begin >= end:
        return own, ((0.0, own), (0.5 * length, next_own)), ((0.0, math.inf),)
    fast = max(lead_feed(at.feed_mm_s, at.tip_rate, machine) for at in (one, other))
    steps = ((0.0, own), (begin, fast), (end, next_own))
    return own, steps, ((0.0, begin), (end, math.inf))
