"""The largest cutter that keeps a tolerance on a surface, and the placement that does it.

What twist costs grows with the radius, in proportion while it is little; so the largest radius is
found by a few cuts of trial, each swept and measured as ``check`` measures a cut: the surface by its
own cut, ends included. Leads and neighbours are not in it. A tool of the table is tried as it is, with
its flute, shank and holder.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.geometry import arc_length
from controller.geometry.arrays import columns
from controller.geometry.defects import concave_radius
from controller.geometry.placement import Strategy
from controller.geometry.surfaces import Surface
from controller.geometry.vectors import Frame
from controller.machine.model import Tool
from controller.plan.surfaces.placing import Cutter, place
from controller.verify import forms
from controller.verify.looks import NOT_CUT, SurfaceGrid, blunts_of
from controller.verify.nominal import Nominal, grid
from controller.verify.passes import ROUGH_FIT_MM, extent_mm, height_mm, longest, step_mm
from controller.verify.sweep import Pass, Sweep, sampled

Array = NDArray[np.float64]

STRATEGIES = (Strategy.SINGLE, Strategy.DOUBLE, Strategy.OPTIMAL)
LARGEST_MM, SMALLEST_MM = 25.0, 0.05  # radii that are looked at
TRIALS = 7  # cuts of trial for one placement
CLOSE = 1.03  # the largest radius is known within so much
GAIN = 1.05  # a further placement is worth it where its radius is larger by that


@dataclass(frozen=True, slots=True)
class Best:
    """The largest radius of one kind of cutter; 0 where none keeps the tolerance."""

    kind: str  # 'cylinder', 'taper', 'ball', 'bull nose'
    taper_deg: float
    radius_mm: float
    placement: str
    off_mm: float  # that the surface is then off
    tool: int | None  # the largest of the tool table that keeps it
    tool_radius_mm: float | None
    tool_placement: str

    def to_dict(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in self.__slots__}


@dataclass(frozen=True, slots=True)
class Asked:
    """A surface to be fitted."""

    line: int
    surface: Surface
    side: float  # +1: Eq. 5's side

    def hollow_mm(self) -> float:
        """The least radius of its hollows on that side: no larger cutter fits."""
        bend = float(self._nominal.hollow(*grid(129, 9)).max())
        at_edge, _ = concave_radius(self.surface, self.side)
        return min(at_edge, 1.0 / bend if bend > 0.0 else math.inf)

    def flank_mm(self) -> float:
        """So long a flank cuts all of its height."""
        return longest([self._nominal])

    @property
    def _nominal(self) -> Nominal:
        return Nominal(self.surface, Frame(), self.side, Tool(1, "", 1.0, 0.0, 1.0), self.line)


def off_mm(asked: Asked, tool: Tool, strategy: Strategy) -> float:
    """How far a surface is off at most by its own cut alone; infinite where what does not cut is in it."""
    cutter = Cutter.of(tool, asked.side, 0.0, tool.below_mm)
    surface = place(asked.surface, cutter, strategy)
    nominal = Nominal(surface, Frame(), asked.side, tool, asked.line, 0, tolerance_mm=1e-9)
    sweeps = {tool: _sweep(nominal, cutter)}
    look = SurfaceGrid(nominal, sweeps, blunts_of(sweeps, extent_mm([nominal])))
    if any(hurt.kind in NOT_CUT for hurt in look.hurts(lambda _: (look,), None)):
        return math.inf
    made = forms.verdict(look)
    assert made is not None
    return made.largest_mm


def _sweep(nominal: Nominal, cutter: Cutter) -> Sweep:
    arc = arc_length.of(nominal.surface.lower)

    def poses(s: Array) -> tuple[Array, Array]:
        tip, axis = nominal.surface.pose(arc.u_along(s), cutter.offset_mm, np)
        return _rows(tip, len(s)), _rows(axis, len(s))

    height = height_mm(nominal.tool, [nominal])
    s, tips, axes = sampled(poses, arc.length_mm, step_mm(nominal.tool, rough=True), height, ROUGH_FIT_MM)
    return Sweep([Pass(s, tips, axes, nominal.line, "cut", nominal.motion)], height)


def _rows(vector: Sequence[Any], n: int) -> Array:
    return columns(vector, n)


def largest(
    asked: Asked, shape: Tool, strategy: Strategy, tolerance_mm: float, most_mm: float
) -> tuple[float, float]:
    """The largest radius (mm; 0: none) of a shape in one placement, and how far off it leaves the surface."""
    low, low_off, high, trial = 0.0, 0.0, most_mm, most_mm
    for _ in range(TRIALS):
        off = off_mm(asked, scaled(shape, trial, asked.flank_mm()), strategy)
        if off <= tolerance_mm:
            low, low_off = trial, off
        else:
            high = trial
        if low >= high / CLOSE or high < SMALLEST_MM:
            break
        guess = trial * tolerance_mm / max(off, 1e-9)
        gap = high - low
        trial = min(max(guess, low + 0.1 * gap), low + 0.9 * gap)
    return low, low_off


def scaled(shape: Tool, radius_mm: float, flank_mm: float = 0.0) -> Tool:
    """The same kind of cutter in another radius: its corner grows with it, its flank is so long."""
    corner = shape.corner_mm * radius_mm / shape.radius_mm
    made = replace(shape, radius_mm=radius_mm, corner_mm=corner, holder=(), length_mm=0.0)
    return replace(made, flute_mm=made.flute_mm - made.flank_mm + flank_mm)


def kind_of(tool: Tool) -> str:
    """What a cutter is called by its shape."""
    if tool.taper_rad > 0.0:
        return "taper"
    if tool.corner_mm <= 0.0:
        return "cylinder"
    return "ball" if tool.corner_mm >= tool.radius_mm else "bull nose"


def fit(asked: Asked, tools: Iterable[Tool], tolerance_mm: float) -> list[Best]:
    """For a cylinder and every kind of cutter in the table: the largest radius, free and of the table."""
    table = sorted((tool.worn for tool in tools), key=lambda tool: (-tool.radius_mm, tool.number))
    shapes = {("cylinder", 0.0): Tool(0, "", 1.0, 0.0, 1.0)}
    for tool in table:
        shapes.setdefault((kind_of(tool), tool.taper_rad), tool)
    found = []
    for (kind, taper), shape in shapes.items():
        rows = _placed(asked, shape, tolerance_mm)
        own = (tool for tool in table if (kind_of(tool), tool.taper_rad) == (kind, taper))
        found.append(_best(kind, taper, rows, _of_table(asked, own, rows, tolerance_mm)))
    return found


def _of_table(
    asked: Asked, tools: Iterable[Tool], rows: Sequence[tuple[Strategy, float, float]], tolerance_mm: float
) -> tuple[Tool, Strategy] | None:
    """The first of some tools, the largest first, that keeps the tolerance as it is, and its placement."""
    for tool in tools:
        for strategy, radius, _ in rows:
            if tool.radius_mm <= radius and off_mm(asked, tool, strategy) <= tolerance_mm:
                return tool, strategy
    return None


def _placed(asked: Asked, shape: Tool, tolerance_mm: float) -> list[tuple[Strategy, float, float]]:
    """Largest radius and what is off, by placement; a later one only where it can do better."""
    most = min(LARGEST_MM, asked.hollow_mm() * (1.0 - 1e-6))
    rows = []
    for strategy in STRATEGIES:
        radius, off = largest(asked, shape, strategy, tolerance_mm, most)
        rows.append((strategy, radius, off))
        if radius >= most / CLOSE:
            break
    return rows


def _best(
    kind: str,
    taper_rad: float,
    rows: Sequence[tuple[Strategy, float, float]],
    own: tuple[Tool, Strategy] | None,
) -> Best:
    strategy, radius, off = rows[0]
    for other in rows[1:]:
        if other[1] > GAIN * radius:
            strategy, radius, off = other
    tool, by = own or (None, None)
    return Best(
        kind,
        math.degrees(taper_rad),
        radius,
        strategy.name.lower() if radius > 0.0 else "",
        off,
        tool.number if tool else None,
        tool.radius_mm if tool else None,
        by.name.lower() if by else "",
    )
