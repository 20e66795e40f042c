"""What of a tool can touch the part: bodies of revolution about the tool axis, as signed distances.

Seen in the half plane through the axis, rho across it and h up from the tip, a cutter is a
cone over a corner point, rounded by the corner radius:

         h                |    / flank, leaning outward by the taper
         ^                |   /
         |       corner . |__/ .  V = (radius - corner, corner), and everything within ``corner`` of it
         +--> rho         tip

Flat end mill: corner 0. Ball: corner = radius. Bull nose: between. The distance to such a
figure is exact in closed form, outside and at the border; inside it is that
to the nearer side, which is all that is asked of it.

A tool is a row of such bodies from the tip upwards, and only the first of them cuts:

    cutter   up to ``flute_mm``
    shank    as wide as the cutter is there, up to the holder; up to the gauge line where none is told of
    holder   the cylinders of the tool table, a neck or a thicker shank among them
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from controller.machine.model import Tool

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Body:
    """A rounded cone frustum about the tool axis, from its lower end up to ``top_mm``."""

    name: str  # 'cutter', 'shank', 'holder'
    corner_rho_mm: float  # V, in the half plane
    corner_h_mm: float
    rounding_mm: float
    taper_rad: float
    top_mm: float  # of h

    @property
    def bottom_mm(self) -> float:
        """The lowest h."""
        return self.corner_h_mm - self.rounding_mm

    @property
    def widest_mm(self) -> float:
        """The largest rho: the body lies within so much of its axis between bottom and top."""
        flank = self.rounding_mm / math.cos(self.taper_rad)
        return (
            self.corner_rho_mm + flank + max(0.0, self.top_mm - self.corner_h_mm) * math.tan(self.taper_rad)
        )

    @property
    def from_its_foot(self) -> Body:
        """The same with h from its own lower end."""
        bottom = self.bottom_mm
        return replace(self, corner_h_mm=self.corner_h_mm - bottom, top_mm=self.top_mm - bottom)

    def distance(self, rho: Array, h: Array) -> Array:
        """Signed distance (mm) of points at ``rho``, ``h`` (equal shapes) to the body, negative inside."""
        x, y = rho - self.corner_rho_mm, h - self.corner_h_mm
        if self.taper_rad == 0.0:
            side, corner = x, (x > 0.0) & (y < 0.0)
        else:
            sine, cosine = math.sin(self.taper_rad), math.cos(self.taper_rad)
            side, corner = x * cosine - y * sine, (x > 0.0) & (x * sine + y * cosine < 0.0)
        up = h - self.top_mm
        lower = np.maximum(side, -y)
        lower[corner] = np.sqrt(x[corner] ** 2 + y[corner] ** 2)
        found = np.asarray(np.maximum(lower - self.rounding_mm, up))
        # Over the flank's upper end it is the edge up there: what is beside and above is further than
        # from either side alone, and bounds on distances rely on that.
        out = rho - self.widest_mm
        beyond = (out > 0.0) & (out * math.sin(self.taper_rad) + up * math.cos(self.taper_rad) > 0.0)
        found[beyond] = np.sqrt(out[beyond] ** 2 + up[beyond] ** 2)
        return found

    def outline(self) -> Array:
        """Points (N, 2) of rho and h on its border, whose circles hold the whole body in their hull."""
        turn = np.linspace(-0.5 * math.pi, -self.taper_rad, 9)
        round_ = np.stack(
            [
                self.corner_rho_mm + self.rounding_mm * np.cos(turn),
                self.corner_h_mm + self.rounding_mm * np.sin(turn),
            ],
            axis=1,
        )
        rise = self.top_mm - round_[-1, 1]
        top = [round_[-1, 0] + rise * math.tan(self.taper_rad), self.top_mm]
        return np.vstack([round_, [top]])


def cutter(tool: Tool) -> Body:
    """What of a tool cuts: its end and its flank, as far up as the flute goes."""
    corner = min(tool.corner_mm, tool.radius_mm)
    return Body("cutter", tool.radius_mm - corner, corner, corner, tool.taper_rad, tool.flute_mm)


def blunt(tool: Tool, extent_mm: float = 0.0) -> tuple[Body, ...]:
    """What of a tool does not cut, from the flute upwards.

    A shank without a holder is at least ``extent_mm`` long: above the gauge line the spindle is no slimmer.
    """
    top = tool.holder[0][0] if tool.holder else max(tool.length_mm, tool.flute_mm + extent_mm)
    shank = _cylinder("shank", tool.flute_mm, top, cutter(tool).widest_mm)
    holder = (_cylinder("holder", low, high, radius) for low, high, radius in tool.holder)
    return (*((shank,) if top > tool.flute_mm else ()), *holder)


def whole(tool: Tool, extent_mm: float = 0.0) -> tuple[Body, ...]:
    """Everything of a tool that can touch anything."""
    return (cutter(tool), *blunt(tool, extent_mm))


def _cylinder(name: str, low_mm: float, high_mm: float, radius_mm: float) -> Body:
    return Body(name, radius_mm, low_mm, 0.0, 0.0, high_mm)
