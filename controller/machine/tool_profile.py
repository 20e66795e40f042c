"""The form of a tool: one profile of revolution, of bodies that cut or do not.

Seen in the half plane through the tool's axis, rho across it and h up from the tip (mm), each body is convex:
its outline is a row of arcs, joined by straight faces that touch them. An edge is an arc of radius 0.

         h                |    / flank, leaning outward by the taper
         ^                |   /
         |       corner . |__/   all of the outline turns one way, so over each arc
         +--> rho         tip    its outward normal turns from ``low`` to ``high``

    end      flat; a lens: an arc about a point of the axis; the point of a drill: a face from the tip
    corner   0, or an arc up to that of a ball
    flank    a face; a barrel: an arc whose middle leans as the taper
    back     the arc of a lollipop or of a rounded T-slot cutter, down to its neck

As a convex body is what lies behind all of its tangent planes, the signed distance of a point is the largest
of its distances to these: exact inside and outside. A tool is a row of such bodies from the tip upwards, and
only the first of them cuts:

    cutter   up to ``flute_mm``
    shank    as wide as the neck, or as the cutter is there, up to the holder; else up to the gauge line
    holder   the cylinders of the tool table, a neck or a thicker shank among them
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from controller.geometry.arrays import Array
from controller.geometry.placement import Barrel
from controller.machine.model import Tool

T = TypeVar("T", float, NDArray[np.float64])

DOWN, UP = -0.5 * math.pi, 0.5 * math.pi
ROUND = 9  # points of an arc in an outline


class Arc(NamedTuple):
    """A part of an outline, mm: its centre and radius, and the angles of its normal (rad; 0: outward)."""

    rho: float
    h: float
    radius: float
    low: float
    high: float

    def at(self, angle: float) -> tuple[float, float]:
        """The point with that normal."""
        return self.rho + self.radius * math.cos(angle), self.h + self.radius * math.sin(angle)

    def on_face(self, h: T) -> T:
        """rho at heights of the straight face above the arc."""
        return self.rho + self.radius / math.cos(self.high) - (h - self.h) * math.tan(self.high)


@dataclass(frozen=True, slots=True)
class Body:
    """A convex body of revolution about the tool axis, by the arcs of its outline from the tip's end up."""

    name: str  # 'cutter', 'shank', 'holder'
    arcs: tuple[Arc, ...]

    @property
    def bottom_mm(self) -> float:
        """The lowest h."""
        return self.arcs[0].at(self.arcs[0].low)[1]

    @property
    def top_mm(self) -> float:
        """The highest h."""
        return self.arcs[-1].h + self.arcs[-1].radius

    @property
    def widest_mm(self) -> float:
        """The largest rho: the body lies within so much of its axis between bottom and top."""
        return max(one.at(min(max(0.0, one.low), one.high))[0] for one in self.arcs)

    @property
    def from_its_foot(self) -> Body:
        """The same with h from its own lower end."""
        bottom = self.bottom_mm
        return replace(self, arcs=tuple(one._replace(h=one.h - bottom) for one in self.arcs))

    def longer(self, by_mm: float) -> Body:
        """As if its flank went on; itself where that leans inwards."""
        *below, top = self.arcs
        if top.low > 0.0 or top.radius > 0.0:
            return self
        higher = top._replace(rho=top.rho - by_mm * math.tan(top.low), h=top.h + by_mm)
        return replace(self, arcs=(*below, higher))

    def distance(self, rho: Array, h: Array) -> Array:
        """Signed distance (mm) of points at ``rho``, ``h`` (equal shapes) to the body, negative inside."""
        found = rho
        for k, arc in enumerate(self.arcs):
            x, y = rho - arc.rho, h - arc.h
            until = x > 0.0 if arc.high == UP else _turned(arc.high, x, y) < 0.0
            beside = (_turned(arc.low, x, y) > 0.0) & until
            here = _along(arc.high, x, y)
            if k == 0:  # the face below any other arc is the one above the arc before
                here = np.maximum(here, _along(arc.low, x, y))
            here[beside] = np.sqrt(x[beside] ** 2 + y[beside] ** 2)
            here -= arc.radius
            found = np.maximum(found, here, out=found) if k else here
        return found

    def radius(self, h: Array) -> Array:
        """rho of the outline at heights (N,); 0 beyond the ends."""
        found = np.where((h < self.bottom_mm) | (h > self.top_mm), 0.0, np.inf)
        for arc in self.arcs:
            if arc.high < UP:
                found = np.minimum(found, arc.on_face(h))
            on = (h >= arc.at(arc.low)[1]) & (h <= arc.at(arc.high)[1])
            across = np.sqrt(np.maximum(arc.radius**2 - (h[on] - arc.h) ** 2, 0.0))
            found[on] = np.minimum(found[on], arc.rho + across)
        return found

    def outline(self) -> Array:
        """Points (N, 2) of rho and h on its border, whose circles hold the whole body in their hull."""
        return np.array([point for one in self.arcs for point in map(one.at, _angles(one))])


def _angles(arc: Arc) -> list[float]:
    return [arc.low] if arc.radius == 0.0 else np.linspace(arc.low, arc.high, ROUND).tolist()


def _along(angle: float, x: Array, y: Array) -> Array:
    """How far points lie along the direction of an angle."""
    if angle in (DOWN, 0.0, UP):
        return -y if angle == DOWN else x if angle == 0.0 else y
    return x * math.cos(angle) + y * math.sin(angle)


def _turned(angle: float, x: Array, y: Array) -> Array:
    """How far they lie along the direction a right angle further."""
    if angle in (DOWN, 0.0):
        return x if angle == DOWN else y
    return y * math.cos(angle) - x * math.sin(angle)


# ---- of a tool ---------------------------------------------------------------------


@lru_cache(256)
def cutter(tool: Tool) -> Body:
    """What of a tool cuts: its end and its flank, as far up as the flute goes."""
    kept, top = list[Arc](), tool.flute_mm
    for arc in _arcs(tool):
        if kept and arc.at(arc.low)[1] >= top:
            break
        if arc.at(arc.high)[1] > top:
            kept.append(arc._replace(high=max(arc.low, math.asin(max(-1.0, (top - arc.h) / arc.radius)))))
            break
        kept.append(arc)
    last = kept[-1]
    rho, h = last.at(last.high)
    if last.high < UP:
        kept.append(Arc(last.on_face(top) if h < top else rho, top, 0.0, last.high, UP))
    return Body("cutter", tuple(kept))


def _arcs(tool: Tool) -> Iterator[Arc]:
    """Those of end, corner, flank and back, from the tip upwards, as if the flute had no end."""
    low, corner = DOWN, min(tool.corner_mm, tool.radius_mm)
    rho, h = tool.radius_mm - corner, corner
    if tool.end_mm is not None:  # takes the corner on in one tangent
        end = max(tool.end_mm, tool.radius_mm)  # what is worn may be thicker
        low = -math.acos(rho / (end - corner)) if rho else DOWN
        yield Arc(0.0, end, end, DOWN, low)
        h = end + (end - corner) * math.sin(low)
    elif tool.point_rad < math.pi:
        low = -0.5 * tool.point_rad
        yield Arc(0.0, 0.0, 0.0, DOWN, low)
        h = (rho * math.cos(low) + corner) / -math.sin(low)
    bow = _bow(tool, corner, h)
    begins = -tool.taper_rad - bow
    yield Arc(rho, h, corner, low, begins)
    if tool.barrel_mm is not None:
        inside = tool.barrel_mm - corner
        at = rho - inside * math.cos(begins), h - inside * math.sin(begins)
        yield Arc(*at, tool.barrel_mm, begins, bow - tool.taper_rad)
    elif tool.back_mm > 0.0:
        back = min(tool.back_mm, tool.radius_mm)
        yield Arc(tool.radius_mm - back, max(h, tool.flute_mm - back), back, begins, UP)


def _bow(tool: Tool, corner_mm: float, h: float) -> float:
    """By how much (rad) the normal of a barrel turns from its middle to either end; 0 of a straight flank.

    From the height h of the corner's centre to the flute's end f; corner c, barrel B, taper t:

        h + (B - c) sin(t + b) + B sin(b - t) = f
    """
    if tool.barrel_mm is None:
        return 0.0
    up = (2.0 * tool.barrel_mm - corner_mm) * math.cos(tool.taper_rad)
    lean = corner_mm * math.sin(tool.taper_rad)
    share = max(0.0, tool.flute_mm - h) / math.hypot(up, lean)
    return math.asin(min(1.0, share)) + math.atan2(lean, up)


def blunt(tool: Tool, extent_mm: float = 0.0) -> tuple[Body, ...]:
    """What of a tool does not cut, from the flute upwards.

    A shank without a holder is at least ``extent_mm`` long: above the gauge line the spindle is no slimmer.
    """
    top = tool.holder[0][0] if tool.holder else max(tool.length_mm, tool.flute_mm + extent_mm)
    shank = _cylinder("shank", tool.flute_mm, top, _shank_mm(tool))
    holder = (_cylinder("holder", low, high, radius) for low, high, radius in tool.holder)
    return (*((shank,) if top > tool.flute_mm else ()), *holder)


def whole(tool: Tool, extent_mm: float = 0.0) -> tuple[Body, ...]:
    """Everything of a tool that can touch anything."""
    return (cutter(tool), *blunt(tool, extent_mm))


def radii(tool: Tool, heights: Array) -> Array:
    """How thick (radius, mm) a tool is at heights (N,) above its tip; above all of it as at its top."""
    found = np.full(np.shape(heights), _shank_mm(tool))
    for body in whole(tool):
        on = (heights >= body.bottom_mm) & (heights <= body.top_mm)
        found[on] = body.radius(heights[on])
    if tool.holder:
        found[heights > tool.holder[-1][1]] = tool.holder[-1][2]
    return found


def _shank_mm(tool: Tool) -> float:
    """Its radius: that of the cutter's upper end, down to which a back leads; else at least the cutter's."""
    end = cutter(tool).arcs[-1]
    return end.at(end.high)[0] if tool.back_mm > 0.0 else max(tool.radius_mm, end.rho)


def _cylinder(name: str, low_mm: float, high_mm: float, radius_mm: float) -> Body:
    edges = Arc(radius_mm, low_mm, 0.0, DOWN, 0.0), Arc(radius_mm, high_mm, 0.0, 0.0, UP)
    return Body(name, edges)


# ---- its flank ---------------------------------------------------------------------


class Flank(NamedTuple):
    """What of a cutter is laid along a surface, endless: a cone, or a barrel that touches one."""

    face: Arc  # above which the cone lies
    begins_mm: float  # of h
    ends_mm: float
    barrel: Barrel | None = None  # touches the cone in its middle

    def radius_mm(self, h: T) -> T:
        """Of the cone at heights above the tip; a barrel is nowhere thicker."""
        return self.face.on_face(h)


@lru_cache(256)
def flank(tool: Tool) -> Flank:
    """Of a tool."""
    has_end = tool.end_mm is not None or tool.point_rad < math.pi
    corner, *rest = [*_arcs(tool)][1 if has_end else 0 :]
    begins = corner.at(corner.high)[1]
    if tool.barrel_mm is None:
        ends = rest[0].h if rest else tool.flute_mm
        return Flank(corner, begins, ends)
    middle = rest[0]._replace(low=-tool.taper_rad, high=-tool.taper_rad)
    barrel = Barrel(tool.barrel_mm, middle.at(middle.high)[1])
    return Flank(middle, begins, tool.flute_mm, barrel)


def flank_mm(tool: Tool) -> float:
    """How far above the lower edge of a surface it cuts: its flank but for ``below_mm``."""
    bare = flank(tool)
    return bare.ends_mm - tool.below_mm - bare.begins_mm
