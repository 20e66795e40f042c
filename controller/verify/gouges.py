"""What a program cuts that it must not: hollows, far places of its own cut, other motions, holder, table.

A cylinder on a twisted surface overcuts where it is placed right; that is reported and is no
gouge. A gouge is overcut that has another reason:

- hollow: the surface bends towards the cutter more tightly than the cutter does;
- the cutter is at a quite different place of the same cut, or in another motion, and reaches
  deeper there than the cut itself does at that very place;
- the holder is in the surface, or anything of the tool in the machine's table.

Beside the ends of a cut, where the same tool in the same pose runs on, turns or is led away, the
flank reaches over the end: what a twist costs there is told as ``end``, and is a gouge where it is
more than the twist can cost (``looks``). With ``max_overcut_mm`` whatever is deeper is one.

Depth is that of the nominal point in the tool, so it needs no normal and no edge is in its way.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from controller.geometry.vectors import Vector
from controller.machine.model import Tool, WorkTable
from controller.machine.tool_profile import Body, whole
from controller.messages import Key, Message, message, text
from controller.plan.report.stored import Overcut
from controller.plan.report.verdict import Verdict
from controller.plan.segment import motion_named
from controller.plan.surfaces.leads import LEADS
from controller.verify import forms
from controller.verify.looks import MIN_MM, NOT_CUT, Hurt, SurfaceGrid, blunts_of
from controller.verify.nominal import Nominal
from controller.verify.passes import extent_mm, height_mm
from controller.verify.sweep import Pass, Sweep
from controller.workers import Spread, here

KINDS = ("hollow", "overcut", "own cut", "other motion", *NOT_CUT, "table")
END = "end"  # told, and no gouge
ADVICE = {
    "hollow": "gouge.do.side",
    "overcut": "gouge.do.placement",
    END: "gouge.do.placement",
    "own cut": "gouge.do.side",
    "other motion": "gouge.do.apart",
    "uncut": "gouge.do.flute",
    "shank": "gouge.do.shank",
    "holder": "gouge.do.holder",
    "stock": "gouge.do.shank",
    "plunge": "gouge.do.plunge",
    "table": "gouge.do.table",
}
ROW = 8  # surfaces that one worker looks at in a row, for neighbours are in each other's sight
SURFACE_S = 0.02  # that one takes, about
LOOKED_AT = 64  # surfaces that are kept in sight: what cuts into one is next to it
ROUND_TABLE = 24  # points of a circle held against the table


@dataclass(frozen=True, slots=True)
class Gouge:
    """One place where a tool goes where it must not."""

    kind: str  # one of KINDS, or END
    line: int  # whose surface is hurt; of the motion where it is the table
    by_line: int
    by: str  # name of the motion that does it
    tool: int
    depth_mm: float
    u: float | None
    v: float | None
    place: Vector  # part frame of the surface; table frame for the table
    bound_mm: float = 0.0  # radius of the hollow, or what a twist may cost, or does cost beside it
    body: str = ""  # of the tool, in the table or against stock

    def to_dict(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in self.__slots__}

    @property
    def message(self) -> Message:
        """What happens where, for people; without a full stop."""
        x, y, z = self.place
        at = message("gouge.at", x=x, y=y, z=z)
        if self.u is not None:
            at = message("gouge.at_uv", u=self.u, v=self.v, x=x, y=y, z=z)
        return message(
            f"gouge.{self.kind.replace(' ', '_')}",
            tool=self.tool,
            depth=self.depth_mm,
            bound=self.bound_mm,
            at=at,
            motion=message("gouge.motion", motion=motion_named(self.by), line=self.by_line),
            whose="" if self.line == self.by_line else message("gouge.of_line", line=self.line),
            body=Key(f"gouge.body.{self.body}") if self.body else "",
        )

    @property
    def sentence(self) -> str:
        """In English."""
        return text(self.message)

    @property
    def advice(self) -> Key:
        if self.kind == "other motion" and self.line == self.by_line:
            return Key("gouge.do.side_or_lead" if self.by in LEADS else "gouge.do.side")
        return Key(ADVICE[self.kind])

    def with_advice(self, key: str, **values: object) -> Message:
        """Its message and its advice in one text."""
        return message(key, what=self.message, advice=self.advice, **values)


@dataclass(frozen=True, slots=True)
class Findings:
    """What hurts the surfaces, and what twist costs beside the ends of the cuts; in the program's order."""

    gouges: list[Gouge]
    ends: list[Gouge]
    overcuts: list[Overcut]  # of each surface by its own cut
    verdicts: list[Verdict]  # of those that have a form tolerance


def gouges(
    surfaces: Sequence[Nominal],
    passes: Mapping[Tool, Sequence[Pass]],
    max_overcut_mm: float | None = None,
    progress: Callable[[float], None] = lambda _: None,
    errors_mm: float = 0.0,
    spread: Spread = here,
) -> Findings:
    """The deepest place of each kind and motion once.

    ``errors_mm`` is how far the drives of a recorded run were off at most: one motion may reach so
    much deeper than another without being led there.
    """
    told, overcuts, verdicts = list[Gouge](), list[Overcut](), list[Verdict]()
    rows = [range(k, min(k + ROW, len(surfaces))) for k in range(0, len(surfaces), ROW)]
    for found in spread(_Looks(surfaces, passes, max_overcut_mm, errors_mm), rows, ROW * SURFACE_S):
        for hurts, overcut, verdict in found:
            told += hurts
            overcuts.append(overcut)
            verdicts += [verdict] if verdict is not None else []
        progress(len(overcuts) / len(surfaces))
    told.sort(key=lambda one: (one.by_line, (*KINDS, END).index(one.kind)))
    hurt, ends = ([one for one in told if (one.kind == END) == is_end] for is_end in (False, True))
    return Findings(hurt, ends, overcuts, verdicts)


class _Looks:
    """What is found at a few surfaces that follow each other, by their numbers."""

    def __init__(
        self,
        surfaces: Sequence[Nominal],
        passes: Mapping[Tool, Sequence[Pass]],
        max_overcut_mm: float | None,
        errors_mm: float,
    ) -> None:
        self._surfaces, self._passes = surfaces, passes
        self._max_overcut_mm, self._errors_mm = max_overcut_mm, errors_mm

    def __call__(self, row: range) -> list[tuple[list[Gouge], Overcut, Verdict | None]]:
        found = []
        for look in map(self._look, row):
            hurts = [_gouge(look, hurt) for hurt in look.hurts(self._cuts, self._max_overcut_mm)]
            found.append((hurts, _overcut(look), forms.verdict(look)))
        return found

    def _cuts(self, line: int) -> list[SurfaceGrid]:
        return [self._look(k) for k in self._of_line.get(line, ())]

    @cached_property
    def _look(self) -> Callable[[int], SurfaceGrid]:
        sweeps = {t: Sweep(rows, height_mm(t, self._surfaces)) for t, rows in self._passes.items() if rows}
        blunts = blunts_of(sweeps, extent_mm(self._surfaces))
        return lru_cache(LOOKED_AT)(lambda k: SurfaceGrid(self._surfaces[k], sweeps, blunts, self._errors_mm))

    @cached_property
    def _of_line(self) -> dict[int, list[int]]:
        of_line = dict[int, list[int]]()
        for k, one in enumerate(self._surfaces):
            of_line.setdefault(one.line, []).append(k)
        return of_line


def _overcut(look: SurfaceGrid) -> Overcut:
    """By depth, as gouges are found; told along the normal, as ``judge`` does."""
    u, v, depth = look.deepest(look.whole_cut)
    return Overcut(look.nominal.line, max(depth, look.overcut(u, v)), look.nominal.block_u(u), v)


def _gouge(look: SurfaceGrid, hurt: Hurt) -> Gouge:
    u, v, depth = look.deepest(hurt)
    by, line = hurt.by, look.nominal.line
    place = look.nominal.place(u, v)
    by_line = by.line_at(look.nominal.points(np.array([u]), np.array([v])))
    tool = by.tool.number
    return Gouge(
        hurt.kind,
        line,
        by_line,
        by.name,
        tool,
        depth,
        look.nominal.block_u(u),
        v,
        place,
        hurt.bound_mm,
        hurt.body,
    )


# ---- the table ---------------------------------------------------------------------


def in_table(table: WorkTable | None, passes: Sequence[tuple[Tool, Pass]]) -> list[Gouge]:
    """Cutter and holder of every pass against the machine's table: the deepest of each motion."""
    if table is None:
        return []
    found = []
    for tool, one in passes:
        for body in whole(tool):
            depth, place = _deepest(table, one, body)
            if depth > MIN_MM:
                by = (one.line, one.line, one.name, tool.number)
                found.append(Gouge("table", *by, depth, None, None, place, body=body.name))
    return found


def _deepest(table: WorkTable, one: Pass, body: Body) -> tuple[float, Vector]:
    """How deep a body gets into the table's disc, and where: circles of its outline, point by point."""
    normal, best, place = np.array(table.normal), 0.0, (0.0, 0.0, 0.0)
    down = np.cross(np.cross(one.axes, normal), one.axes)  # across the axis, up along the normal
    size = np.linalg.norm(down, axis=1)
    any_ = np.cross(one.axes, np.where(np.abs(one.axes[:, :1]) < 0.9, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]))
    first = np.where(size[:, None] > 1e-9, -down, any_)
    first /= np.linalg.norm(first, axis=1)[:, None]
    second = np.cross(one.axes, first)
    for rho, h in body.outline():
        for angle in 2.0 * np.pi * np.arange(ROUND_TABLE) / ROUND_TABLE:
            around = np.cos(angle) * first + np.sin(angle) * second
            points = one.tips + h * one.axes + rho * around - np.array(table.centre)
            height = points @ normal
            across = np.linalg.norm(points - height[:, None] * normal, axis=1)
            inside = (height < 0.0) & (height > -table.thickness_mm) & (across < table.radius_mm)
            depth = np.where(inside, np.minimum(-height, height + table.thickness_mm), 0.0)
            k = int(np.argmax(depth))
            if depth[k] > best:
                best = float(depth[k])
                x, y, z = points[k] + np.array(table.centre)
                place = (float(x), float(y), float(z))
    return best, place
