"""A program's path as a picture needs it: points of the tip, and the rulings of its surfaces.

    taker = Picture(machine, kinematics)
    for item in taker.watched(items): ...     # the path, as somebody else reads it
    shape = taker.shape()

Programs may have any number of lines, a screen has not: whenever too many points have come,
they are thinned, and the tolerance grows. All points are in the table's frame (rotaries at
zero), where the work stands still whatever its offset is.
"""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller import npz
from controller.geometry.arrays import Array, distinct
from controller.geometry.curves import Even, Line
from controller.machine.kinematics import Kinematics
from controller.machine.model import Joints, Machine
from controller.motion.motions import JointMove, SurfaceCut, ToolLine, ToolSpline
from controller.plan.report.works import work_of
from controller.plan.rotaries.branch import joints_along
from controller.plan.segment import ContinuousPath, PathItem, Segment
from controller.program.program import Act

Whole = NDArray[np.int64]

MAX_POINTS = 20_000
MAX_RULINGS = 4_000
FIRST_TOLERANCE_MM = 0.002
DEG_PER_POINT = 3.0  # of turning rotaries and arcs, before thinning
MM_PER_POINT = 0.5  # of a surface or a spline
MAX_PER_STRETCH = 2_000
PER_SURFACE = 60  # rulings
RAPID, FEED, SURFACE = 0, 1, 2
KINDS = {"rapid": RAPID, "surface": SURFACE}  # of works; all others are at feed
KEPT = 200  # files; the oldest go


@dataclass(frozen=True, slots=True)
class Shape:
    """What is drawn of a program; table frame, mm."""

    tips: Array  # (N, 3)
    kinds: Whole  # (N,) of the way to each point: RAPID, FEED, SURFACE
    motions: Whole  # (N,) number of the point's motion, as a snapshot tells it
    lines: Whole  # (N,) of the program
    rulings: Array  # (R, 6) upper and lower end
    surfaces: Whole  # (S,) how many rulings each surface has
    tolerance_mm: float  # no point that was left out is further from the lines than this
    axes: Array  # (N, 3) of the tool at each point

    def save(self, file: Path) -> None:
        """Write it whole or not at all; the oldest of the folder go. Raises OSError."""
        file.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile("wb", dir=file.parent, suffix=".new", delete=False) as new:
            try:
                np.savez_compressed(new, **{name: getattr(self, name) for name in self.__slots__})
                os.fchmod(new.fileno(), 0o640)
                new.close()
                os.replace(new.name, file)
            except BaseException:
                with contextlib.suppress(OSError):
                    os.unlink(new.name)
                raise
        for old in sorted(file.parent.glob("*.npz"), key=lambda one: one.stat().st_mtime)[:-KEPT]:
            old.unlink(missing_ok=True)


def load(file: Path) -> Shape:
    """A shape as it was saved. Raises OSError, ValueError or KeyError where there is none."""
    kept: dict[str, Any] = npz.read(file)
    values = {name: kept[name] for name in Shape.__slots__}
    return Shape(**{**values, "tolerance_mm": float(values["tolerance_mm"])})


def points_of(line: int, shape: Shape, of_text: bool) -> NDArray[np.bool_]:
    """Which points (N,) show a line: all of its way, or where the path was when it was its turn.

    ``of_text``: it is refused as text, and the path goes on behind it; else the path ends by it.
    """
    found: NDArray[np.bool_] = shape.lines == line
    if len(found) and not found.any():
        before = np.flatnonzero(shape.lines < line) if of_text else [len(found) - 1]
        found[max(before, default=0)] = True
    return found


@dataclass(slots=True)
class Picture:
    """Takes a path in its order; memory is bounded however long it is."""

    machine: Machine
    kinematics: Kinematics
    most: int = MAX_POINTS
    _poses: Array = field(default_factory=lambda: np.empty((0, 6)))  # tip and axis
    _marks: Whole = field(default_factory=lambda: np.empty((0, 3), dtype=np.int64))  # kind, motion, line
    _slack: Array = field(default_factory=lambda: np.empty(0))  # of what was left out before each point
    _new: list[tuple[Array, float, int, int, Whole]] = field(default_factory=list)
    _waiting: int = 0  # points in ``_new``
    _tolerance_mm: float = FIRST_TOLERANCE_MM
    _rulings: list[Array] = field(default_factory=list)
    _motion: int = 0
    _last: tuple[Joints, float | None] | None = None  # where the path has come to, with which length
    _length_mm: float | None = None  # of the tool in the spindle, as far as the path has told

    def watched(self, items: Iterable[PathItem]) -> Iterator[PathItem]:
        """The same path; what it looks like is noted as it is read."""
        for item in items:
            if isinstance(item, ContinuousPath):
                self.take(item)
            elif item.act is Act.TOOL:
                tool = item.modal.tool_in(self.machine)
                self._length_mm = tool.length_mm if tool is not None else self._length_mm
            yield item

    def take(self, chain: ContinuousPath) -> None:
        """The next chain of the path."""
        if chain.first_id is not None:
            self._motion = chain.first_id
        for segment in chain.segments:
            self._segment(segment)
            self._motion += 1
            if self._waiting > self.most:
                self._gather()

    def shape(self) -> Shape:
        """What came so far."""
        self._gather()
        found = self._fewer_rulings()
        return Shape(
            self._poses[:, :3],
            self._marks[:, 0],
            self._marks[:, 1],
            self._marks[:, 2],
            np.concatenate(found) if found else np.empty((0, 6)),
            np.array([len(one) for one in found], dtype=np.int64),
            self._tolerance_mm if len(self._slack) and self._slack.max() > 0.0 else 0.0,
            self._poses[:, 3:],
        )

    # ---- points

    def _segment(self, segment: Segment) -> None:
        motion = segment.motion
        length_mm: float | None = getattr(motion, "length_mm", None)
        if length_mm is not None and getattr(motion, "tips", True):  # rows of positions of the axes know none
            self._length_mm = length_mm
        elif self._length_mm is None:
            first = self.machine.tool(self.machine.in_spindle)
            self._length_mm = first.length_mm if first is not None else 0.0
        kind = KINDS.get(work_of(segment), FEED)
        joints, lines = self._joints(segment)
        if self._last == (
            segment.start,
            self._length_mm,
        ):  # it is there already, as the end of what led to it
            joints, lines = joints[1:], lines[1:]
        self._last = segment.end, self._length_mm
        self._new.append((joints, self._length_mm or 0.0, kind, self._motion, lines))
        self._waiting += len(joints)
        if segment.cut:
            self._surface(segment.cut)

    def _joints(self, segment: Segment) -> tuple[Array, Whole]:
        """Joints (n, axes) at so many places that nothing that bends is missed; the lines of the ways."""
        n, motion, line = _places(segment), segment.motion, segment.place.line
        if n <= 2:
            return np.array([segment.start, segment.end]), np.array([line, line])
        s = np.linspace(0.0, motion.end, min(n, MAX_PER_STRETCH))
        lines = np.full(len(s), line)
        if isinstance(motion, ToolSpline):
            begins = np.clip(motion.lines_s[: len(motion.lines)], 0.0, motion.end)
            s = np.unique(np.concatenate([s, begins]))
            lines = np.array(motion.lines)[np.clip(np.searchsorted(begins, s) - 1, 0, None)]
        joints = np.concatenate([[segment.start], joints_along(segment, s, self.kinematics), [segment.end]])
        return joints, np.concatenate([lines[:1], lines, lines[-1:]])

    def _gather(self) -> None:
        """New points join the others; too many are thinned."""
        if not self._new:
            return
        counts = [len(joints) for joints, *_ in self._new]
        joints, lengths = [one[0] for one in self._new], [one[1] for one in self._new]
        poses = self._forward(np.concatenate(joints), np.repeat(lengths, counts))
        each = np.repeat(np.array([one[2:4] for one in self._new], dtype=np.int64), counts, axis=0)
        marks = np.column_stack([each, np.concatenate([one[4] for one in self._new])])
        self._new.clear()
        self._waiting = 0
        self._poses, self._marks = np.concatenate([self._poses, poses]), np.concatenate([self._marks, marks])
        self._slack = np.concatenate([self._slack, np.zeros(len(poses))])
        self._thin()
        while len(self._poses) > self.most:
            self._tolerance_mm *= 2.0
            self._thin()

    def _thin(self) -> None:
        """Kinds are kept apart: a rapid does not melt into a cut. Motions may."""
        kept, self._slack = thin(self._poses[:, :3], self._marks[:, 0], self._tolerance_mm, self._slack)
        self._poses, self._marks = self._poses[kept], self._marks[kept]

    def _forward(self, joints: Array, length_mm: Array) -> Array:
        """Tips and axes of the tool in the table frame, (n, 6)."""
        pose = self.kinematics.forward([*joints.T], length_mm, np)  # type: ignore[arg-type]
        rows = [np.asarray(c, dtype=float) for c in (*pose.tip, *pose.axis)]
        return np.stack([np.broadcast_to(c, (len(joints),)) for c in rows], axis=1)

    # ---- surfaces

    def _surface(self, cut: SurfaceCut) -> None:
        u = cut.arc.u_along(np.linspace(0.0, cut.end, PER_SURFACE))
        upper, lower = cut.surface.upper.at(u, np), cut.surface.lower.at(u, np)
        ends = [cut.part.to_parent(end) for end in (upper, lower)]
        self._rulings.append(np.stack([np.broadcast_to(c, u.shape) for end in ends for c in end], axis=1))
        if len(self._rulings) * PER_SURFACE > 4 * MAX_RULINGS:
            self._rulings = self._fewer_rulings()

    def _fewer_rulings(self) -> list[Array]:
        """At most so many; each surface keeps its first and its last one."""
        per_surface = max(2, MAX_RULINGS // max(1, len(self._rulings)))
        found = [one[_spread(len(one), per_surface)] for one in self._rulings]
        most = MAX_RULINGS // 2
        return found if len(found) <= most else [found[i] for i in _spread(len(found), most)]


def _places(segment: Segment) -> int:
    """How many points show a motion: two where its tip goes straight on."""
    motion = segment.motion
    if isinstance(motion, ToolLine):
        return 2
    if isinstance(motion, JointMove) and not isinstance(motion.curve, Even):
        turns = zip(motion.start_rotaries, motion.end_rotaries, strict=True)
        turned = float(np.degrees(max(abs(b - a) for a, b in turns)))
        if not isinstance(motion.curve, Line):
            turned += abs(float(np.degrees(getattr(motion.curve, "sweep_rad", np.pi))))
        return 2 + int(turned / DEG_PER_POINT)
    return 8 + int(motion.end / MM_PER_POINT)


def _spread(n: int, most: int) -> Whole:
    """Indices of at most ``most`` out of ``n``, first and last among them."""
    return distinct(np.linspace(0, n - 1, min(n, most)).round().astype(np.int64))


# A long row of points made short, with a bound on what is lost.
#
# Every second point goes where it may; then again, until nothing more can go. What a removed
# point was away from the line that remains adds to what its neighbours' lines had lost already,
# so the sum bounds the distance of every point that was ever there (a point on an old line is
# no further from the new one than the removed corner).


def thin(points: Array, kinds: Whole, tolerance: float, slack: Array | None = None) -> tuple[Whole, Array]:
    """Indices of the points (N, D) that stay, and their slack.

    ``kinds`` (N,) belong to the way *to* each point: a point between two kinds stays. ``slack`` (N,)
    is what the way to each point has lost before, at most ``tolerance`` after.
    """
    kept = np.arange(len(points))
    lost = np.zeros(len(points)) if slack is None else slack.copy()
    first, idle = 1, 0
    while len(kept) > 2 and idle < 2:
        goes, after = _may_go(points[kept], kinds[kept], lost, tolerance, first)
        idle = 0 if goes.any() else idle + 1
        behind = np.flatnonzero(goes) + 1  # the way to these now leaps over what went
        lost[behind] = after[goes]
        kept, lost = kept[~goes], lost[~goes]
        first = 3 - first
    return kept, lost


def _may_go(
    points: Array, kinds: Whole, lost: Array, tolerance: float, first: int
) -> tuple[NDArray[np.bool_], Array]:
    """Which of the points ``first``, ``first + 2``, ... may go, and what is lost behind each then."""
    n = len(points)
    goes, after = np.zeros(n, dtype=bool), np.zeros(n)
    i = np.arange(first, n - 1, 2)
    if len(i):
        away = _distances(points[i], points[i - 1], points[i + 1])
        after[i] = away + np.maximum(lost[i], lost[i + 1])
        goes[i] = (after[i] <= tolerance) & (kinds[i] == kinds[i + 1])
    return goes, after


def _distances(points: Array, begins: Array, ends: Array) -> Array:
    """From each point to its line of finite length; all (n, D)."""
    way = ends - begins
    square = (way * way).sum(axis=1)
    along = ((points - begins) * way).sum(axis=1)
    share = np.clip(np.divide(along, square, out=np.zeros(len(points)), where=square > 0.0), 0.0, 1.0)
    off = points - begins - share[:, None] * way
    return np.asarray(np.sqrt((off * off).sum(axis=1)))
