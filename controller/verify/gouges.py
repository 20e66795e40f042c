"""What a program cuts that it must not: hollows, far places of its own cut, other motions, holder, table.

A cylinder on a twisted surface overcuts where it is placed right; that is reported and is no
gouge. A gouge is overcut that has another reason:

- hollow: the surface bends towards the cutter more tightly than the cutter does;
- the cutter is at a quite different place of the same cut, or in another motion, and reaches
  deeper there than the cuts concerned reach by their twist;
- the holder is in the surface, or anything of the tool in the machine's table.

Depth is that of the nominal point in the tool, so it needs no normal and no edge is in its way.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.curves import ArcLength
from controller.geometry import Vector
from controller.machine import Tool, WorkTable
from controller.placement import Placed
from controller.verify.bodies import Body, cutter, holder
from controller.verify.envelope import nearest
from controller.verify.nominal import Nominal, grid
from controller.verify.passes import height_mm, longest
from controller.verify.sweep import Pass, Sweep

Array = NDArray[np.float64]

LEAST_MM = 1e-3  # depths below are no gouge
SPACING_MM = 0.5  # of the grid, about; with a thin cutter half of its radius
ALONG, ACROSS = (9, 129), (5, 33)  # fewest and most points of the grid
KINDS = ("hollow", "overcut", "own cut", "other motion", "holder", "table")
ROUND_TABLE = 24  # points of a circle held against the table


@dataclass(frozen=True, slots=True)
class Gouge:
    """One place where a tool goes where it must not."""

    kind: str  # one of KINDS
    line: int  # whose surface is hurt; of the motion where it is the table
    by_line: int
    by: str  # name of the motion that does it
    tool: int
    depth_mm: float
    u: float | None
    v: float | None
    place: Vector  # part frame of the surface; table frame for the table
    detail: str = ""

    def to_dict(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in self.__slots__}

    @property
    def sentence(self) -> str:
        """What happens where, for people."""
        x, y, z = self.place
        at = f"at X {x:.3f} Y {y:.3f} Z {z:.3f} mm"
        if self.u is not None:
            at = f"at u = {self.u:.4f}, v = {self.v:.3f} (part {at[3:]})"
        depth = f"{self.depth_mm:.3f} mm"
        motion = f"the {self.by} of line {self.by_line}"
        if self.kind == "hollow":
            return f"the cutter T{self.tool} does not fit into {self.detail} and cuts {depth} too deep {at}"
        if self.kind == "overcut":
            return f"the twist of the surface costs {depth} of overcut, more than the {self.detail}, {at}"
        if self.kind == "own cut":
            return f"the cut comes back to its own surface and cuts {depth} too deep {at}"
        if self.kind == "holder":
            return f"in {motion} the holder of T{self.tool} is {depth} deep in the surface {at}"
        if self.kind == "table":
            what = f"the {self.detail} of T{self.tool}"
            return f"in {motion} {what} is {depth} deep in the machine's table, table frame {at}"
        return f"{motion} cuts {depth} too deep into the surface {at}"

    @property
    def advice(self) -> str:
        return {
            "hollow": "take a smaller cutter or the other side (G41/G42)",
            "overcut": "take a smaller cutter or another placement of it",
            "own cut": "take a smaller cutter or the other side (G41/G42)",
            "other motion": "take a smaller cutter, the other side (G41/G42), or move that block away",
            "holder": "take a longer tool or a slimmer holder",
            "table": "raise the work (work offset), or take a longer tool or a slimmer holder",
        }[self.kind]


def _paper_mm(nominal: Nominal) -> float:
    """What the paper's placement would deviate by: one that is better is not refused for less."""
    return nominal.surface.paper_mm if isinstance(nominal.surface, Placed) else 0.0


def gouges(
    surfaces: Sequence[Nominal],
    passes: Mapping[Tool, Sequence[Pass]],
    max_overcut_mm: float | None = None,
    progress: Callable[[float], None] = lambda _: None,
) -> list[Gouge]:
    """What hurts the surfaces, the deepest place of each kind and motion once, in the program's order."""
    sweeps = {tool: Sweep(rows, height_mm(tool, surfaces)) for tool, rows in passes.items() if rows}
    looks = []
    for k, one in enumerate(surfaces):
        looks.append(_Look(one, sweeps, longest(surfaces)))
        progress((k + 1) / max(1, len(surfaces)))
    twist: dict[int, float] = {}
    for look in looks:
        twist[look.nominal.line] = max(twist.get(look.nominal.line, 0.0), look.twist)
    papers: dict[int, float] = {}
    for one in surfaces:
        papers[one.line] = max(papers.get(one.line, 0.0), _paper_mm(one))
    found = [gouge for look in looks for gouge in look.gouges(twist, papers, max_overcut_mm)]
    return sorted(found, key=lambda one: (one.by_line, KINDS.index(one.kind)))


class _Look:
    """One surface on a grid, and how deep each of its points gets into the tools."""

    def __init__(self, nominal: Nominal, sweeps: Mapping[Tool, Sweep], least_mm: float) -> None:
        self.nominal = nominal
        thinnest = min((tool.radius_mm for tool in sweeps), default=1.0)
        spacing = min(SPACING_MM, max(0.5 * thinnest, 0.1))
        along, across = (
            int(np.clip(size / spacing, *ends))
            for size, ends in zip(nominal.size, (ALONG, ACROSS), strict=True)
        )
        self.u, self.v = grid(along, across)
        self.points = nominal.points(self.u, self.v)
        self._sweeps = {tool: self._about(sweep, tool, least_mm) for tool, sweep in sweeps.items()}
        self._least_mm = least_mm
        self._own = self._own_depth()
        self._hollow = self._hollows()

    def _about(self, sweep: Sweep, tool: Tool, least_mm: float) -> Sweep:
        """The passes that come near this surface."""
        centre, radius = self.nominal.ball
        widest = max(body.widest_mm for body in (cutter(tool, least_mm), *holder(tool)))
        runs = sweep.runs
        off = runs.distance(np.vstack([centre, centre]))[0] - runs.slack
        near = np.unique(sweep.owner[runs.start[off <= radius + widest + LEAST_MM]])
        return sweep.only(near.tolist())

    # ---- its own cut -------------------------------------------------------------

    def _own_depth(self) -> Array:
        """Depth (N,) under its own cut near its own place; what is far along the cut is kept apart."""
        sweep = self._passes(self._is_own)
        self._far = np.zeros(len(self.u))
        found = nearest(self.points, sweep, self._cutter)
        depth = np.maximum(0.0, np.nan_to_num(-found.distance, neginf=0.0))
        if not len(sweep):
            return depth
        motions = np.array([one.motion for one in sweep.passes])[sweep.owner[found.sample]]
        here = motions == self.nominal.motion
        far = here & self._is_far(found.s)
        self._far = np.where(far, depth, 0.0)
        return np.where(far, 0.0, depth)

    def _is_far(self, s: Array) -> NDArray[np.bool_]:
        """Whether the cutter is more than its diameter along the surface away from the point."""
        if self.nominal.motion < 0:
            return np.zeros(len(s), dtype=bool)
        arc = ArcLength.of(self.nominal.surface.lower)
        way = self.nominal.length_between(self.u, arc.u_along(s), self.v)
        return np.asarray(way > 2.0 * self.nominal.tool.radius_mm + LEAST_MM)

    def _hollows(self) -> NDArray[np.bool_]:
        """Where the surface bends more tightly than the cutter at that height."""
        tool = self.nominal.tool
        height = (1.0 - self.v) * self.nominal.size[1]
        radius = tool.radius_mm + height * np.tan(tool.taper_rad)
        return np.asarray(self.nominal.hollow(self.u, self.v) * radius > 1.0 + 1e-9)

    @property
    def twist(self) -> float:
        """Deepest overcut of its own cut, where it is in place."""
        return float(np.max(self._own, initial=0.0))

    def _passes(self, keep: Callable[[Pass], bool]) -> Sweep:
        sweep = self._sweeps.get(self.nominal.tool)
        if sweep is None:
            return Sweep([], 0.0)
        return sweep.only(i for i, one in enumerate(sweep.passes) if keep(one))

    @property
    def _cutter(self) -> Body:
        return cutter(self.nominal.tool, self._least_mm)

    # ---- what is told ------------------------------------------------------------

    def gouges(
        self, twist: Mapping[int, float], papers: Mapping[int, float], most_mm: float | None
    ) -> Iterator[Gouge]:
        """The deepest of each kind."""
        line = self.nominal.line
        own = _By(self._passes(self._is_own), self._cutter, line, "cut", self.nominal.tool)
        hollow = np.where(self._hollow, self._own, 0.0)
        if hollow.max(initial=0.0) > LEAST_MM:
            k = int(np.argmax(hollow))
            bend = float(self.nominal.hollow(self.u[k : k + 1], self.v[k : k + 1])[0])
            yield self._gouge("hollow", hollow, own, f"the hollow of radius {1.0 / bend:.3f} mm")
        elif most_mm is not None and self.twist > most_mm:
            yield self._gouge("overcut", self._own, own, f"{most_mm:g} mm of max_overcut_mm")
        if self._far.max(initial=0.0) > self.twist + LEAST_MM:
            yield self._gouge("own cut", self._far, own)
        yield from self._others(twist, papers)
        yield from self._holders()

    def _others(self, twist: Mapping[int, float], papers: Mapping[int, float]) -> Iterator[Gouge]:
        """Other motions, those of one line and name together."""
        for tool, sweep in self._sweeps.items():
            groups: dict[tuple[int, str], list[int]] = {}
            for i, one in enumerate(sweep.passes):
                if not self._is_own(one):
                    groups.setdefault((one.line, one.name), []).append(i)
            for (line, name), members in groups.items():
                by = _By(sweep.only(members), cutter(tool, self._least_mm), line, name, tool)
                depth = by.depth(self.points)
                paper = max(_paper_mm(self.nominal), papers.get(line, 0.0))
                allowed = max(self.twist, paper, twist.get(line, 0.0) if name == "cut" else 0.0)
                if depth.max(initial=0.0) > allowed + LEAST_MM:
                    yield self._gouge("other motion", depth, by)

    def _holders(self) -> Iterator[Gouge]:
        for tool, sweep in self._sweeps.items():
            for body in holder(tool):
                found = nearest(self.points, sweep, body)
                depth = np.maximum(0.0, -found.distance)
                if depth.max(initial=0.0) > LEAST_MM:
                    one = sweep.passes[int(sweep.owner[found.sample[int(np.argmax(depth))]])]
                    yield self._gouge("holder", depth, _By(sweep, body, one.line, one.name, tool))
                    break

    def _is_own(self, one: Pass) -> bool:
        return one.name == "cut" and one.line == self.nominal.line

    def _gouge(self, kind: str, depth: Array, by: _By, detail: str = "") -> Gouge:
        """The deepest point of the grid, and from there the deepest about it."""
        k = int(np.argmax(depth))
        u, v, most = float(self.u[k]), float(self.v[k]), float(depth[k])
        half = np.array([1.0 / max(1, len(np.unique(self.u)) - 1), 1.0 / max(1, len(np.unique(self.v)) - 1)])
        step = np.linspace(-1.0, 1.0, 5)
        for _ in range(6):
            a, b = (m.ravel() for m in np.meshgrid(u + half[0] * step, v + half[1] * step, indexing="ij"))
            a, b = np.clip(a, 0.0, 1.0), np.clip(b, 0.0, 1.0)
            found = by.depth(self.nominal.points(a, b))
            k = int(np.argmax(found))
            if found[k] > most:
                u, v, most = float(a[k]), float(b[k]), float(found[k])
            half = 0.5 * half
        place = self.nominal.place(u, v)
        return Gouge(kind, self.nominal.line, by.line, by.name, by.tool.number, most, u, v, place, detail)


@dataclass(frozen=True, eq=False, slots=True)
class _By:
    """Motions of one line, and the body of the tool that hurts in them."""

    sweep: Sweep
    body: Body
    line: int
    name: str
    tool: Tool

    def depth(self, points: Array) -> Array:
        """How deep points (N, 3) get into the body."""
        return np.asarray(np.maximum(0.0, -nearest(points, self.sweep, self.body).distance))


# ---- the table ---------------------------------------------------------------------


def in_table(table: WorkTable | None, passes: Sequence[tuple[Tool, Pass]]) -> list[Gouge]:
    """Cutter and holder of every pass against the machine's table: the deepest of each motion."""
    if table is None:
        return []
    found = []
    for tool, one in passes:
        for body in (cutter(tool, 0.0), *holder(tool)):
            depth, place = _deepest(table, one, body)
            if depth > LEAST_MM:
                by = (one.line, one.line, one.name, tool.number)
                found.append(Gouge("table", *by, depth, None, None, place, body.name))
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
