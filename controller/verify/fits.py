"""The largest cutter that keeps a tolerance on a surface, and the placement that does it.

What twist costs grows with the radius, in proportion while it is little; so the largest radius is
found by a few cuts of trial. Each is planned as the only cut of a program, with its approach, leads and
departure, and judged by ``audit.findings_of``, as ``check`` and ``verify`` judge it: a cutter keeps the
tolerance where they find no gouge and a verdict within it. Neighbours are not in it. A tool of the table is
tried as it is, with its flute, shank and holder.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from controller.geometry.defects import concave_radius
from controller.geometry.placement import Strategy
from controller.geometry.surfaces import Surface
from controller.geometry.vectors import Frame
from controller.machine import tool_profile
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine, Tool
from controller.messages import Message
from controller.plan.path.path import PathBuilder
from controller.plan.surfaces import choices
from controller.plan.surfaces.cuts import surface_of
from controller.program.position import homed
from controller.program.program import CutBlock, ProgramError
from controller.verify import passes
from controller.verify.audit import Watched, findings_of
from controller.verify.nominal import Nominal, grid
from controller.verify.passes import longest

STRATEGIES = (Strategy.SINGLE, Strategy.DOUBLE, Strategy.OPTIMAL)
LARGEST_MM, SMALLEST_MM = 25.0, 0.05  # radii that are looked at
TRIALS = 7  # cuts of trial for one placement
CLOSE = 1.03  # the largest radius is known within so much
GAIN = 1.05  # a further placement is worth it where its radius is larger by that


@dataclass(frozen=True, slots=True)
class Best:
    """The largest radius of one kind of cutter; 0 where none keeps the tolerance."""

    kind: str  # as ``kind_of``
    taper_deg: float
    radius_mm: float
    placement: str
    off_mm: float  # that the surface is then off
    tool: int | None  # the largest of the tool table that keeps it
    tool_radius_mm: float | None
    tool_placement: str
    why: Message | str = ""  # none keeps it: what the last trial was refused for, or gouged; "": it exceeded

    def to_dict(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in self.__slots__ if name != "why"}


@dataclass(frozen=True, slots=True)
class SurfaceToFit:
    """A surface to be fitted: its block, and the machine that is to cut it."""

    block: CutBlock
    machine: Machine

    @property
    def line(self) -> int:
        return self.block.place.line

    def hollow_mm(self) -> float:
        """The least radius of its hollows on the cutter's side: no larger cutter fits."""
        bend = float(self._nominal.hollow(*grid(129, 9)).max())
        at_edge, _ = concave_radius(self._surface, self._side)
        return min(at_edge, 1.0 / bend if bend > 0.0 else math.inf)

    def flank_mm(self) -> float:
        """So long a flank cuts all of its height."""
        return longest([self._nominal])

    @property
    def length_mm(self) -> float:
        """Of the tool that the program has for it: a cutter that is none of the table is held as far off."""
        tool = self.block.modal.tool_in(self.machine)
        return tool.length_mm if tool is not None else 0.0

    @property
    def _surface(self) -> Surface:
        return surface_of(self.block)

    @property
    def _side(self) -> float:
        return self.block.modal.side.value

    @property
    def _nominal(self) -> Nominal:
        return Nominal(self._surface, Frame(), self._side, Tool(1, "", 1.0, 0.0, 1.0), self.line)


class Trial(NamedTuple):
    """How far a cut leaves its surface off at most, mm; inf where it is refused or gouges, and why."""

    off_mm: float
    why: Message | str = ""


Row = tuple[Strategy, float, Trial]  # a placement, the largest radius in it, and its trial


def trial(asked: SurfaceToFit, tool: Tool, strategy: Strategy, tolerance_mm: float) -> Trial:
    """One tool in one placement, as ``check`` judges a program that has no other cut."""
    machine = replace(asked.machine, gouge="warn")  # what gouges is to be found here, not refused before
    modal = replace(asked.block.modal, cutter=tool, placement=strategy.value, tolerance_mm=tolerance_mm)
    block, kinematics, start = replace(asked.block, modal=modal), kinematics_of(machine), homed(machine)
    try:
        chosen = choices.choices([block], machine, kinematics, start, "")
        watched = Watched(PathBuilder("", machine, kinematics, start, chosen).items([block]))
        for _ in watched:
            pass
    except ProgramError as refused:
        return Trial(math.inf, refused.said)
    fitted = passes.Fitted.of([block], machine)
    found = findings_of(watched.segments, fitted, machine, kinematics)
    if found.gouges:
        return Trial(math.inf, found.gouges[0].message)
    return Trial(max(one.largest_mm for one in found.verdicts))


def largest(
    asked: SurfaceToFit, shape: Tool, strategy: Strategy, tolerance_mm: float, most_mm: float
) -> tuple[float, Trial]:
    """The largest radius (mm; 0: none) of a shape in one placement, and its trial; of none the last one."""
    low, high, radius = 0.0, most_mm, most_mm
    best = tried = Trial(math.inf)
    for _ in range(TRIALS):
        tool = scaled(shape, radius, asked.flank_mm(), asked.length_mm)
        tried = trial(asked, tool, strategy, tolerance_mm)
        if tried.off_mm <= tolerance_mm:
            low, best = radius, tried
        else:
            high = radius
        if low >= high / CLOSE or high < SMALLEST_MM:
            break
        guess = radius * tolerance_mm / max(tried.off_mm, 1e-9)
        gap = high - low
        radius = min(max(guess, low + 0.1 * gap), low + 0.9 * gap)
    return low, best if low > 0.0 else tried


def scaled(shape: Tool, radius_mm: float, flank_mm: float = 0.0, length_mm: float = 0.0) -> Tool:
    """The same kind of cutter in another radius: its rounded parts grow with it, its flank is so long."""
    share = radius_mm / shape.radius_mm
    end = None if shape.end_mm is None else share * shape.end_mm
    corner, back = share * shape.corner_mm, share * shape.back_mm
    made = replace(shape, radius_mm=radius_mm, corner_mm=corner, end_mm=end, back_mm=back)
    made = replace(made, holder=(), length_mm=length_mm)
    return replace(made, flute_mm=made.flute_mm - tool_profile.flank_mm(made) + flank_mm)


def kind_of(tool: Tool) -> str:
    """What a cutter is called by its shape."""
    if tool.barrel_mm is not None:
        return "barrel"
    if tool.taper_rad > 0.0:
        return "taper"
    if tool.end_mm is not None:
        return "lens"
    if tool.point_rad < math.pi:
        return "drill"
    if tool.back_mm > 0.0:
        return "lollipop" if tool.corner_mm >= tool.radius_mm else "T-slot"
    if tool.corner_mm <= 0.0:
        return "cylinder"
    return "ball" if tool.corner_mm >= tool.radius_mm else "bull nose"


def fit(asked: SurfaceToFit, tools: Iterable[Tool], tolerance_mm: float) -> list[Best]:
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
    asked: SurfaceToFit, tools: Iterable[Tool], rows: Sequence[Row], tolerance_mm: float
) -> tuple[Tool, Strategy] | None:
    """The first of some tools, the largest first, that keeps the tolerance as it is, and its placement."""
    for tool in tools:
        for strategy, radius, _ in rows:
            fits = tool.radius_mm <= CLOSE * radius
            if fits and trial(asked, tool, strategy, tolerance_mm).off_mm <= tolerance_mm:
                return tool, strategy
    return None


def _placed(asked: SurfaceToFit, shape: Tool, tolerance_mm: float) -> list[Row]:
    """Largest radius and its trial, by placement; a later one only where it can do better."""
    most = min(LARGEST_MM, asked.hollow_mm() * (1.0 - 1e-6))
    rows = []
    for strategy in STRATEGIES:
        radius, found = largest(asked, shape, strategy, tolerance_mm, most)
        rows.append((strategy, radius, found))
        if radius >= most / CLOSE:
            break
    return rows


def _best(
    kind: str,
    taper_rad: float,
    rows: Sequence[Row],
    own: tuple[Tool, Strategy] | None,
) -> Best:
    strategy, radius, found = rows[0]
    for other in rows[1:]:
        if other[1] > GAIN * radius:
            strategy, radius, found = other
    has_one = radius > 0.0
    tool, by = own or (None, None)
    return Best(
        kind,
        math.degrees(taper_rad),
        radius,
        strategy.name.lower() if has_one else "",
        found.off_mm if has_one else 0.0,
        tool.number if tool else None,
        tool.radius_mm if tool else None,
        by.name.lower() if by else "",
        "" if has_one else found.why,
    )
