"""One surface looked at on a grid: how deep each of its points gets into which tool, and why.

What a cut takes at a point while it is in place there (``own``) is the measure for everything
else: another motion that reaches no deeper does no harm. Only beside the ends of a cut is more
taken for what it is, the twist:

        cut            end                     the axis at the end is askew to the last ruling,
    ------------------->| . . .  lead out      so where the tool goes straight on, its flank
                        |                      still takes something off that ruling; leads,
                        |                      joined cuts and pivots start in the same pose

``onward_mm`` is what going straight on from the very ends would take, computed for the poses as
they are and as they turn. Within a radius of the last ruling (of the surface, for another cut) twist and that
are no gouge, nor what the joint tolerance lets cuts take off each other in a concave corner; they are told
where they exceed the twist of the cut.

What does not cut (shank, holder) takes nothing: it hurts where it is deeper in the surface than that is
cut, and where it comes to what stands. Until a stock is known that is the surface itself, less what any
cutter has taken up to then. The end of a mill that does not cut over its centre is blunt as it plunges.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from controller.geometry import arc_length
from controller.geometry.arrays import Array, Flags, distinct
from controller.geometry.curves import ArcLength
from controller.machine.model import Tool
from controller.machine.tool_profile import Body, blunt, cutter, flank
from controller.verify.envelope import PATCH, at_least, deviation, nearest
from controller.verify.nominal import Nominal, grid
from controller.verify.sweep import Pass, Sweep

AT_JOINTS = ("cut", "pivot")  # motions that a concave corner within the joint tolerance is cut by
MIN_MM = 1e-3  # depths below are no gouge
NOT_CUT = ("uncut", "shank", "holder", "stock", "plunge")  # kinds: by what of a tool does not cut
SHORT_MM = 5e-3  # a flute that ends so little below the upper edge leaves nothing
STANDS_MM = 0.01  # what is left of a surface by no more than this, or by its form tolerance, is cut
SPACING_MM = 0.5  # of the grid, about; with a thin cutter half of its radius
ALONG, ACROSS = (9, 129), (5, 33)  # fewest and most points of the grid
BETWEEN_MM = 1.0  # more than a tool goes from one sample to the next
ONWARD = 17  # poses of a tool that goes straight on by its diameter
ZOOMS, ZOOM_POINTS = 6, 5
FEWEST_ZOOMS, SETTLED_MM = 2, 1e-6  # a zoom ends where a step after these gains less


@dataclass(frozen=True, eq=False, slots=True)
class ToolSweep:
    """Motions of one line, and the body of the tool that hurts in them."""

    sweep: Sweep
    body: Body
    line: int
    name: str
    tool: Tool

    def distance(self, points: Array, below: Array) -> Array:
        """Signed distance of points (N, 3) to the body, negative inside; inf where not ``below`` (N,)."""
        found = np.full(len(points), np.inf)
        near = np.flatnonzero(at_least(points, self.sweep, self.body) < below)
        found[near] = nearest(points[near], self.sweep, self.body).distance
        return found

    def depth(self, points: Array) -> Array:
        """How deep they get into it."""
        return np.asarray(np.maximum(0.0, -nearest(points, self.sweep, self.body).distance))

    def line_at(self, point: Array) -> int:
        """The line whose motion comes nearest to a point (1, 3), or is deepest there."""
        found = nearest(point, self.sweep, self.body)
        return self.sweep.passes[int(self.sweep.owner[found.sample[0]])].line_at(float(found.s[0]))

    def during(self, i: int) -> ToolSweep:
        """One of its motions alone."""
        one = self.sweep.passes[i]
        return replace(self, sweep=self.sweep.only([i]), line=one.line, name=one.name)


@dataclass(frozen=True, eq=False, slots=True)
class Hurt:
    """Something to be told: ``depth`` (N,) at the points of the grid, 0 where it is no matter."""

    kind: str
    depth: Array
    by: ToolSweep
    bound_mm: float = 0.0  # as that of ``Gouge``
    body: str = ""  # of the tool, where it is not its cutter


def blunts_of(sweeps: Mapping[Tool, Sweep], extent_mm: float) -> list[ToolSweep]:
    """What of each tool does not cut, on its way; ``extent_mm`` is that of all surfaces."""
    return [
        ToolSweep(sweep.lifted(body.bottom_mm, body.top_mm), body.from_its_foot, 0, "", tool)
        for tool, sweep in sweeps.items()
        for body in blunt(tool, extent_mm)
    ]


def _depth(points: Array, sweep: Sweep, body: Body) -> Array:
    depth = np.zeros(len(points))
    if len(sweep) and len(points):
        off = sweep.runs.distance(points) - sweep.runs.slack - body.widest_mm
        near = (off <= BETWEEN_MM).any(axis=1)  # the others are in the body nowhere on its way
        if near.any():
            depth[near] = np.maximum(0.0, -nearest(points[near], sweep, body).distance)
    return depth


class SurfaceGrid:
    """One surface on a grid, and how deep each of its points gets into the tools."""

    def __init__(
        self,
        nominal: Nominal,
        sweeps: Mapping[Tool, Sweep],
        blunts: Sequence[ToolSweep],
        errors_mm: float = 0.0,
    ) -> None:
        """``blunts``: what does not cut, by ``blunts_of``; ``errors_mm``: of drives, motion to motion."""
        self.nominal = nominal
        self._harmless_mm = MIN_MM + errors_mm
        thinnest = min((tool.radius_mm for tool in sweeps), default=1.0)
        spacing = min(SPACING_MM, max(0.5 * thinnest, 0.1))
        self.shape = _counts(nominal, spacing)
        self.u, self.v = grid(*self.shape)
        self.points = nominal.points(self.u, self.v)
        self._sweeps = {tool: self._about(sweep, cutter(tool)) for tool, sweep in sweeps.items()}
        self._blunts = blunts
        self._cutter = cutter(nominal.tool)
        self._look_at_own()

    def _about(self, sweep: Sweep, body: Body) -> Sweep:
        """The passes that bring a body near this surface."""
        centre, radius = self.nominal.ball
        runs = sweep.runs
        off = runs.distance(np.vstack([centre, centre]))[0] - runs.slack
        near = distinct(sweep.owner[runs.start[off <= radius + body.widest_mm + MIN_MM]])
        return sweep.only(near.tolist())

    # ---- its own cut -------------------------------------------------------------

    def _look_at_own(self) -> None:
        """Depths (N,) under its own cut: ``own`` in place, ``far`` with the cutter elsewhere on its way.

        ``left`` (N,) is the signed distance to all that cuts, once ``hurts`` has gone through the others.
        """
        sweep = self._passes(self._is_own)
        found = nearest(self.points, sweep, self._cutter)
        self.left = self._alone = found.distance
        depth = np.maximum(0.0, np.nan_to_num(-found.distance, neginf=0.0))
        self.own, self.far = depth, np.zeros(len(depth))
        if not len(sweep):
            return
        motions = np.array([one.motion for one in sweep.passes])[sweep.owner[found.sample]]
        far = (motions == self.nominal.motion) & (depth > MIN_MM) & self._is_far(self.u, found.s, self.v)
        if far.any():
            near = self._in_place(far, sweep)
            self.own, self.far = np.where(far, near, depth), np.where(far & (depth > near), depth, 0.0)

    def _is_far(self, u: Array, s: Array, v: Array) -> Flags:
        """Whether the cutter at ``s`` is more than its diameter along the surface away from u, all (N,)."""
        if self.nominal.motion < 0:
            return np.zeros(len(s), dtype=bool)
        way = self.nominal.length_between(u, self._arc.u_along(s), v)
        return np.asarray(way > 2.0 * self.nominal.tool.radius_mm + MIN_MM)

    @cached_property
    def _arc(self) -> ArcLength:
        return arc_length.of(self.nominal.surface.lower)

    def _in_place(self, far: Flags, sweep: Sweep) -> Array:
        """Depth (N,) of points under the part of their own cut that is near their own u; 0 elsewhere."""
        depth = np.zeros(len(far))
        whole = next(one for one in sweep.passes if one.motion == self.nominal.motion)
        for u in distinct(self.u[far]):
            row = far & (self.u == u)
            middle = np.full(len(whole.s), 0.5)
            near = np.flatnonzero(~self._is_far(np.full(len(whole.s), u), whole.s, middle))
            part = whole.part(near[0], near[-1]) if len(near) else None
            if part is not None:
                depth[row] = _depth(self.points[row], Sweep([part], sweep.height_mm), self._cutter)
        return depth

    @property
    def twist_mm(self) -> float:
        """Deepest overcut of its own cut, where it is in place."""
        return float(np.max(self.own, initial=0.0))

    @cached_property
    def onward_mm(self) -> float:
        """Deepest overcut beside its ends if the tool went straight on, its axis held or turning on."""
        cuts = self._passes(self._is_own).passes
        reach, depth = 2.0 * self.nominal.tool.radius_mm, 0.0
        for end, one, row in ((0.0, cuts[0], 0), (1.0, cuts[-1], -1)) if cuts else ():
            beside = self.nominal.length_between(self.u, np.full(len(self.u), end), self.v) <= reach
            way = self._out_of(end)
            s = np.linspace(0.0, reach, ONWARD)
            for turn in (0.0, 1.0):
                axes = one.axes[row] + turn * s[:, None] * _turning(one, row)
                axes /= np.linalg.norm(axes, axis=1)[:, None]
                on = Sweep(
                    [Pass(s, one.tips[row] + s[:, None] * way, axes, one.line, "onward")], self._top_mm
                )
                depth = max(depth, float(_depth(self.points[beside], on, self._cutter).max(initial=0.0)))
        return depth

    def _out_of(self, end: float) -> Array:
        """Unit vector (3,) along C1 at an end, away from the surface."""
        inner = 1e-3 if end == 0.0 else 1.0 - 1e-3
        a, b = self.nominal.points(np.array([inner, end]), np.ones(2))
        return np.asarray((b - a) / max(float(np.linalg.norm(b - a)), 1e-300))

    @property
    def _top_mm(self) -> float:
        return self._cutter.top_mm

    @property
    def sweep(self) -> Sweep:
        """All that its own tool does near this surface."""
        return self._sweeps.get(self.nominal.tool) or Sweep([], 0.0)

    def _passes(self, keep: Callable[[Pass], bool]) -> Sweep:
        sweep = self.sweep
        return sweep.only(i for i, one in enumerate(sweep.passes) if keep(one))

    def _is_own(self, one: Pass) -> bool:
        return one.name == "cut" and one.line == self.nominal.line

    # ---- what is told ------------------------------------------------------------

    def hurts(self, cuts: Callable[[int], Sequence[SurfaceGrid]], most_mm: float | None) -> Iterator[Hurt]:
        """The deepest of each kind; ``cuts`` are the looks of each line, ``most_mm`` what twist may cost."""
        own = self.whole_cut.by
        hollow = np.where(self._hollows(), self.own, 0.0)
        if hollow.max(initial=0.0) > MIN_MM:
            k = int(np.argmax(hollow))
            bend = float(self.nominal.hollow(self.u[k : k + 1], self.v[k : k + 1])[0])
            yield Hurt("hollow", hollow, own, 1.0 / bend)
        elif most_mm is not None and self.twist_mm > most_mm:
            yield Hurt("overcut", self.own, own, most_mm)
        if (self.far - self.own).max(initial=0.0) > self._harmless_mm:
            yield Hurt("own cut", self.far, own)
        for by in self._others():
            yield from self._other(by, cuts, most_mm)
        yield from self._uncut()
        yield from self._blunt_bodies()

    def _hollows(self) -> Flags:
        """Where the surface bends more tightly than the cutter at that height."""
        bare = flank(self.nominal.tool)
        radius = bare.radius_mm(bare.begins_mm + (1.0 - self.v) * self.nominal.size[1])
        return np.asarray(self.nominal.hollow(self.u, self.v) * radius > 1.0 + 1e-9)

    def _others(self) -> Iterator[ToolSweep]:
        """Other motions, those of one line and name together."""
        for tool, sweep in self._sweeps.items():
            groups: dict[tuple[int, str], list[int]] = {}
            for i, one in enumerate(sweep.passes):
                if not self._is_own(one):
                    groups.setdefault((one.line, one.name), []).append(i)
            for (line, name), members in groups.items():
                yield ToolSweep(sweep.only(members), cutter(tool), line, name, tool)

    def _other(
        self, by: ToolSweep, cuts_of: Callable[[int], Sequence[SurfaceGrid]], most_mm: float | None
    ) -> Iterator[Hurt]:
        """What another motion takes beyond the own cut; ``cuts_of`` gives those of its line."""
        distance = by.distance(self.points, np.maximum(self.left, -self.own - self._harmless_mm))
        self.left = np.minimum(self.left, distance)
        depth = np.maximum(0.0, -distance)
        more = depth > self.own + self._harmless_mm
        if not more.any():
            return
        cuts = cuts_of(by.line)
        near = self._beside(by, cuts, more)
        both = (self, *cuts)
        twist = max(one.twist_mm for one in both)
        most = max(twist, *(one.onward_mm for one in both)) if near.any() else 0.0
        if by.name in AT_JOINTS:
            most = max(most, min(one.nominal.joint_tolerance_mm for one in both))
        gouged = np.where(more & (~near | (depth > most + self._harmless_mm)), depth, 0.0)
        if gouged.any():
            yield Hurt("other motion", gouged, by)
            return
        ended = np.where(near & (depth > twist + self._harmless_mm), depth, 0.0)
        if most_mm is not None and float(depth[near].max()) > most_mm:
            yield Hurt("overcut", np.where(near, depth, 0.0), by, most_mm)
        elif ended.any():
            yield Hurt("end", ended, by, twist)

    def _beside(self, by: ToolSweep, cuts: Sequence[SurfaceGrid], of: Flags) -> Flags:
        """Points (N,) within a radius of where the cuts of a motion's line end, or go if it is a cut.

        Only those ``of`` which it matters.
        """
        beside, points = np.zeros(len(self.points), dtype=bool), self.points[of]
        for one in cuts:
            rulings = np.isin(one.u, (0.0, 1.0)) if by.name != "cut" else np.ones(len(one.u), dtype=bool)
            beside[of] |= _close(points, one.points[rulings], by.tool.radius_mm)
        return beside

    def _uncut(self) -> Iterator[Hurt]:
        """What its own cut would take if the flute had no end, and nothing else does."""
        short = SHORT_MM + self._harmless_mm - MIN_MM
        rows = np.flatnonzero(self.left - self.nominal.allowance_mm > short)
        own = self.whole_cut.by
        if not len(rows) or not len(own.sweep):
            return
        endless = nearest(self.points[rows], own.sweep, self._endless).distance
        missed = np.zeros(len(self.points))
        missed[rows] = np.where(self.left[rows] - np.maximum(endless, 0.0) > short, self._alone[rows], 0.0)
        if missed.any():
            yield Hurt("uncut", missed, own)

    @property
    def _endless(self) -> Body:
        """The cutter as if it cut over all of its length."""
        return self._cutter.longer(2.0 * self.nominal.ball[1])

    def _blunt_bodies(self) -> Iterator[Hurt]:
        """What does not cut, and is in the surface, or comes to what no cut has taken before."""
        touch = np.full(len(self.points), self.nominal.allowance_mm + MIN_MM)
        for far in self._blunts:
            body = far.body
            by = replace(far, sweep=self._about(far.sweep, body))
            distance = by.distance(self.points, touch)
            # A shank's width is not in the table: where it is the cutter's it may rub as that may cut.
            within = self._harmless_mm if body.name == "holder" else self._within_mm
            depth = np.maximum(0.0, -distance)
            deep = np.where(depth > np.maximum(0.0, -self.left) + within, depth, 0.0)
            if deep.any():
                yield Hurt(body.name, deep, self._motion_of(by, deep), body=body.name)
            yield from self._in_stock(by, distance < touch, "stock")
        for tool, sweep in self._sweeps.items():
            if not tool.centre_cutting:
                down = [part for one in sweep.passes for part in one.plunges()]
                by = ToolSweep(Sweep(down, sweep.height_mm), cutter(tool), 0, "", tool)
                yield from self._in_stock(by, by.distance(self.points, touch) < touch, "plunge")

    @property
    def _within_mm(self) -> float:
        """How far off a surface may be to be held cut."""
        tolerance = self.nominal.tolerance_mm
        return max(self._harmless_mm, 0.0 if tolerance is None else tolerance)

    def _motion_of(self, by: ToolSweep, depth: Array) -> ToolSweep:
        """The motion that is deepest."""
        k = int(np.argmax(depth))
        found = nearest(self.points[k : k + 1], by.sweep, by.body)
        one = by.sweep.passes[int(by.sweep.owner[found.sample[0]])]
        return replace(by, line=one.line, name=one.name)

    def _in_stock(self, by: ToolSweep, touched: Flags, kind: str) -> Iterator[Hurt]:
        """Where a body comes to points of the grid (``touched``) that still stand: the worst motion."""
        rest, worst = np.flatnonzero(touched), list[Hurt]()
        order = [one.order for one in by.sweep.passes]
        for i in np.argsort(order, kind="stable").tolist():
            if not len(rest):
                break
            one = by.during(i)
            near = one.distance(self.points[rest], np.full(len(rest), self.nominal.allowance_mm + MIN_MM))
            comes = near < self.nominal.allowance_mm + MIN_MM
            now, rest = rest[comes], rest[~comes]
            left = self._left_until(now, order[i], kind == "stock") - self.nominal.allowance_mm
            stands = np.zeros(len(self.points))
            stands[now] = np.where(left > max(STANDS_MM, self._within_mm), left, 0.0)
            if stands.any():
                worst.append(Hurt(kind, stands, one, body=by.body.name))
        if worst:
            yield max(worst, key=lambda hurt: float(hurt.depth.max()))

    def _left_until(self, rows: NDArray[np.int64], order: float, with_it: bool) -> Array:
        """Distances of points of the grid to all that has cut before a motion, or with it.

        Where nothing has, it is the longest ruling.
        """
        left = np.full(len(rows), self.nominal.size[1])
        for tool, sweep in self._sweeps.items() if len(rows) else ():
            before = (
                i
                for i, one in enumerate(sweep.passes)
                if one.order < order or (with_it and one.order == order)
            )
            left = np.minimum(left, nearest(self.points[rows], sweep.only(before), cutter(tool)).distance)
        return left

    @property
    def whole_cut(self) -> Hurt:
        """The twist itself: what the own cut takes where it is in place."""
        by = ToolSweep(self._passes(self._is_own), self._cutter, self.nominal.line, "cut", self.nominal.tool)
        return Hurt("overcut", self.own, by)

    def deviation(self, u: Array, v: Array) -> Array:
        """Signed deviation (N,) mm along the normal by all that cuts; nan where nothing does."""
        points, normals = self.nominal.points(u, v), self.nominal.normals(u, v)
        t = np.full(len(u), np.nan)
        for tool, sweep in self._sweeps.items():
            t = np.fmin(t, deviation(points, normals, sweep, cutter(tool)).t)
        return t

    def cut_by(self, u: float, v: float) -> tuple[str, int]:
        """Name and line of the motion that comes nearest to one place, or is deepest there."""
        best, by = np.inf, ("cut", self.nominal.line)
        for tool, sweep in self._sweeps.items():
            at = self.nominal.points(np.array([u]), np.array([v]))
            found = nearest(at, sweep, cutter(tool))
            if found.distance[0] < best:
                one = sweep.passes[int(sweep.owner[found.sample[0]])]
                best, by = float(found.distance[0]), (one.name, one.line_at(float(found.s[0])))
        return by

    def left_without_flute(self, u: float, v: float) -> float:
        """Distance (mm) of one place to what its own tool would cut if it cut over all of its length."""
        at = self.nominal.points(np.array([u]), np.array([v]))
        return float(nearest(at, self.sweep, self._endless).distance[0])

    def overcut(self, u: float, v: float) -> float:
        """Overcut (mm) of its own cut along the normal at one place."""
        at = np.array([u]), np.array([v])
        by = self.whole_cut.by
        t = deviation(self.nominal.points(*at), self.nominal.normals(*at), by.sweep, by.body).t
        return max(0.0, -float(np.nan_to_num(t)[0]))

    def deepest(self, hurt: Hurt) -> tuple[float, float, float]:
        """u, v and depth: the deepest point of the grid, and from there the deepest about it."""
        k = int(np.argmax(hurt.depth))
        u, v, most = float(self.u[k]), float(self.v[k]), float(hurt.depth[k])
        half = 1.0 / (np.array(self.shape) - 1)
        step = np.linspace(-1.0, 1.0, ZOOM_POINTS)
        for zoom in range(ZOOMS):
            before = most
            a, b = (m.ravel() for m in np.meshgrid(u + half[0] * step, v + half[1] * step, indexing="ij"))
            a, b = np.clip(a, 0.0, 1.0), np.clip(b, 0.0, 1.0)
            found = hurt.by.depth(self.nominal.points(a, b))
            k = int(np.argmax(found))
            if found[k] > most:
                u, v, most = float(a[k]), float(b[k]), float(found[k])
            if zoom >= FEWEST_ZOOMS and most - before < SETTLED_MM:
                break
            half = 0.5 * half
        return u, v, most


def _close(points: Array, others: Array, within_mm: float) -> Flags:
    """Which of ``points`` (N, 3) have one of ``others`` (M, 3) within so much."""
    low, high = points.min(axis=0) - within_mm, points.max(axis=0) + within_mm
    x, y, z = others[((others >= low) & (others <= high)).all(axis=1)].T
    parts = []
    for k in range(0, len(points), PATCH):
        a, b, c = (column[:, None] for column in points[k : k + PATCH].T)
        square = (a - x) ** 2 + (b - y) ** 2 + (c - z) ** 2
        parts.append(np.sqrt(square.min(axis=1, initial=np.inf)) <= within_mm)
    return np.concatenate(parts)


def _counts(nominal: Nominal, spacing_mm: float) -> tuple[int, int]:
    """Points along and across."""
    (length, height), (few, many), (least, most) = nominal.size, ALONG, ACROSS
    along, across = int(length / spacing_mm), int(height / spacing_mm)
    return min(max(along, few), many), min(max(across, least), most)


def _turning(one: Pass, row: int) -> Array:
    """How the axis (3,) turns at an end of a pass, outwards, per mm of the contact."""
    inner = 1 if row == 0 else -2
    return np.asarray((one.axes[row] - one.axes[inner]) / max(abs(one.s[row] - one.s[inner]), 1e-9))
