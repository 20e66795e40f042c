r"""Blends of lines and arcs with surfaces under G64 P: a row runs on into a cut, or a cut into a row.

    row  - - - - - - - .
                         `-. .            cubics in place of the row's last ``reach``
                              `=======>   the cut, its first poses corrected

They meet where the row leads the tool to the begin of the cut, within the tolerance, or begins where the
cut ends. As between two cuts each is led over by half of what their poses and the first two derivatives of
these differ by: the cut by a ``placement.Blend``, the row by cubics in its own ``ToolSpline``. Both are made
shorter until foot and head of the flank are within the tolerance of the programmed path.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from controller.geometry import series
from controller.geometry.arrays import Array
from controller.geometry.placement import Blend
from controller.geometry.vectors import angle_between, norm, subtract
from controller.machine.model import Joints
from controller.messages import Key, Message, message
from controller.motion.motions import ROW, SurfaceCut, ToolSpline
from controller.plan.context import Context
from controller.plan.rotaries.branch import joints_along
from controller.plan.segment import Segment, rotaries_of
from controller.plan.surfaces import audit, rates
from controller.plan.surfaces.blending import (
    CLEAR_OF_POLE,
    SHARE,
    SHORTEST_MM,
    USED,
    USEFUL_MM,
    USEFUL_S,
    Tolerance,
    allowed_by,
)
from controller.plan.surfaces.blends import End, Rounding, with_blend
from controller.plan.surfaces.cuts import Cut, edge
from controller.plan.surfaces.leads import Room, beyond
from controller.plan.surfaces.legs import CutSegment
from controller.plan.surfaces.links import cubics
from controller.plan.surfaces.train import choose
from controller.program.program import Modal, ProgramError

Follow = Callable[[SurfaceCut], Segment | None]

SHORTER = 0.75  # each blend that is tried is so much shorter than the one before
LOOKED, OF_PATH = 25, 97  # places of the blend on either side, and of the programmed path
SAME_AXIS = 1e-12  # axes and their rates that differ by less are alike
MIN_RATE = 0.2  # mm of the tip per mm of s: where a tip all but stands nothing is blended
ROUNDING = Rounding.of(0.0594)


class Blended(NamedTuple):
    """A row and a cut that run through, and what it costs."""

    row: Segment
    cut: Segment
    reach_mm: float
    deviates_mm: float

    def message(self, name: str, before: Segment) -> Message:
        """The message that it runs on from the block before, called by the text of ``name``."""
        costs = {"reach": self.reach_mm, "um": 1000.0 * self.deviates_mm}
        return message("row.runs_on", name=Key(name), line=_last_line(before), **costs)


class Entered(NamedTuple):
    """A row that leads over into a train, and the train's cuts as they are followed then."""

    row: Segment
    legs: list[CutSegment]


def _last_line(segment: Segment) -> int:
    motion = segment.motion
    return motion.lines[-1] if isinstance(motion, ToolSpline) else segment.place.line


def onto(row: Segment, modal: Modal, members: Sequence[Cut], context: Context) -> Entered | None:
    """The last segment of a row and the train that it leads to; None where they do not meet so."""
    first, legs = members[0], list[CutSegment]()
    meeting, near = _meeting(row, modal, first, False, context), rotaries_of(row.end, context.kinematics)
    if meeting is None:
        return None

    def follow(motion: SurfaceCut) -> Segment | None:
        led = replace(first, motion=motion, start=edge(motion, 0.0))
        try:
            legs[:] = choose((led, *members[1:]), context, near, near, meeting.turn_rad)
        except ProgramError:  # it may be cut from where an approach leads
            return None
        return legs[0].segment

    found = meeting.blended(follow)
    if found is None:
        return None
    context.tell(first.block.place, found.message("row.the_line", row))
    return Entered(found.row, legs)


def off(
    legs: Sequence[CutSegment], run: Sequence[Segment], row: Segment, modal: Modal, context: Context
) -> Blended | None:
    """The last cut of a train and the first segment of the row that begins at its end, led over."""
    found = _left(legs, run, row, modal, context)
    if found is not None:
        context.tell(row.place, found.message("row.the_block", run[-1]))
    return found


def departs(
    legs: Sequence[CutSegment], run: Sequence[Segment], row: Sequence[Segment], modal: Modal, context: Context
) -> Message | str | None:
    """Why a row that begins so does not lead on from the last cut; None: it does, empty: it is not to."""
    if not row:
        return message("row.unreached")
    meeting = _meeting(row[0], modal, legs[-1].cut, True, context)
    if meeting is None:
        return ""
    if _left(legs, run, row[0], modal, context) is None:
        return meeting.unmet
    deeper, most = (
        Room.of(legs, False, context).reached(row[0]),
        legs[-1].cut.block.modal.blend_mm,
    )
    return message("row.deeper", deeper=deeper, mm=most) if deeper > most else None


def _left(
    legs: Sequence[CutSegment], run: Sequence[Segment], row: Segment, modal: Modal, context: Context
) -> Blended | None:
    def follow(motion: SurfaceCut) -> Segment | None:
        end = motion.joints(motion.end, rotaries_of(run[-1].end, context.kinematics), context.kinematics)
        return replace(run[-1], motion=motion, end=end) if end is not None else None

    meeting = _meeting(row, modal, legs[-1].cut, True, context)
    return meeting.blended(follow) if meeting is not None else None


def _meeting(row: Segment, modal: Modal, cut: Cut, leaves: bool, context: Context) -> Meeting | None:
    """None where they are not one path: another tool, exact stops, or another place."""
    own = cut.block.modal
    if (
        own.tool != modal.tool
        or own.exact_joints
        or own.blend_mm <= 0.0
        or not isinstance(row.motion, ToolSpline)
    ):
        return None
    one, other = (allowed_by(each, context.machine) for each in (own, modal))
    allowed = Tolerance(min(one.mm, other.mm), min(one.rad, other.rad))
    made = Meeting(row, cut, leaves, allowed, context)
    return made if made.within else None


class Flank(NamedTuple):
    """Feet and heads (N, 3) of the flank, table frame, and unit vectors (N, 3) along the axis."""

    feet: Array
    heads: Array
    axes: Array

    def off(self, path: Flank) -> tuple[float, float]:
        """How far (mm, rad) they are from a path that is given by places in its order."""
        near = ((self.feet[:, None] - path.feet) ** 2).sum(axis=2).argmin(axis=1)
        tilt = np.sqrt(((self.axes - path.axes[near]) ** 2).sum(axis=1))
        return max(_off(self.feet, path.feet), _off(self.heads, path.heads)), float(tilt.max())


def _off(points: Array, way: Array) -> float:
    """The largest distance (mm) of points (N, 3) from a polyline (M, 3)."""
    start, step = way[:-1], np.diff(way, axis=0)
    away = points[:, None] - start
    share = (away * step).sum(axis=2) / np.maximum((step * step).sum(axis=1), 1e-30)
    off = away - np.clip(share, 0.0, 1.0)[..., None] * step
    return float(np.sqrt((off * off).sum(axis=2).min(axis=1)).max())


@dataclass(frozen=True, slots=True)
class Meeting:
    """The end of a row and the start of a cut or, where it ``leaves``, the end of a cut and a row's start."""

    row: Segment
    cut: Cut
    leaves: bool
    allowed: Tolerance
    context: Context

    @property
    def within(self) -> bool:
        """Whether the row has the tool there as the cut has it, within the tolerance."""
        there = self.cut.end if self.leaves else self.cut.start
        here = self.context.kinematics.forward(self._joints, self.cut.motion.length_mm)
        gap, tilt = norm(subtract(here.tip, there.tip)), norm(subtract(here.axis, there.axis))
        return self._keeps(float(gap + tilt * self._height_mm), float(tilt))

    @property
    def unmet(self) -> Message:
        """Why no blend was found."""
        if self._longest_mm() < SHORTEST_MM:
            return message("row.short", room=self._longest_mm())
        here, there = self._pose_rows()[1, :3], End.of(self.cut.motion, not self.leaves).rows[1, :3]
        turn = np.degrees(angle_between(tuple(here), tuple(there)))
        degrees = float(np.degrees(self.allowed.rad))
        return message("row.turns", turn=float(turn), mm=self.allowed.mm, degrees=degrees)

    def blended(self, follow: Follow) -> Blended | None:
        """The longest blend within the tolerance; ``follow`` gives a cut's motion as the joints follow it."""
        with np.errstate(all="ignore"):
            end, row = End.of(self.cut.motion, not self.leaves), self._pose_rows()
        if not (end.sound and np.isfinite(row).all()):
            return None
        own, of_cut = (float(np.linalg.norm(rows[1, :3])) for rows in (row, end.rows))
        if min(own, of_cut) < MIN_RATE:
            return None
        row *= _powers(of_cut / own)
        reach = self._longest_mm()
        while reach >= SHORTEST_MM:
            found = self._of_reach(reach, row, end, follow)
            if found is not None:
                return found
            reach *= SHORTER
        return None

    def _of_reach(self, reach: float, row: Array, end: End, follow: Follow) -> Blended | None:
        motion = with_blend(self.cut.motion, self._blend(reach, row, end))
        off, tilt = self._flank_of(motion, reach, LOOKED).off(self._flank_of(self.cut.motion, reach, OF_PATH))
        if not self._keeps(off, tilt) or not self._is_clear(tilt, reach):
            return None
        cut = follow(motion)
        led = self._led(cut, reach) if cut is not None else None
        if cut is None or led is None:
            return None
        off, tilt = self._off(led, motion, reach)
        return Blended(led, cut, reach, off) if self._keeps(off, tilt) else None

    def _keeps(self, off: float, tilt: float) -> bool:
        return off <= USED * self.allowed.mm and tilt <= self.allowed.rad

    def _blend(self, reach: float, row: Array, end: End) -> Blend:
        """What leads the cut half way over; the axis is let alone where it goes on as it is."""
        before, after = (end.rows, row) if self.leaves else (row, end.rows)
        half = 0.5 * (after - before)
        rounded = np.outer((ROUNDING.away * reach, 0.0, ROUNDING.bend / reach), half[1])
        blend = end.blend(rounded + half if self.leaves else rounded - half, reach)
        alike = float(np.abs(half[:, 3:]).max()) <= SAME_AXIS
        return replace(blend, axis=None) if alike else blend

    def _is_clear(self, tilt: float, reach: float) -> bool:
        """Whether the axis may be changed by so much: beside a pole a rotary would turn by far more."""
        if tilt <= SAME_AXIS:
            return True
        axes = self._flank_of(self.cut.motion, reach, LOOKED).axes
        return float(np.min(self.context.kinematics.off_pole(tuple(axes.T), np))) > CLEAR_OF_POLE * tilt

    @property
    def turn_rad(self) -> float:
        """What the rotaries may differ by where they meet."""
        return CLEAR_OF_POLE * self.allowed.rad

    # ---- the row's side ----------------------------------------------------------------

    @property
    def _spline(self) -> ToolSpline:
        assert isinstance(self.row.motion, ToolSpline)
        return self.row.motion

    @property
    def _at_s(self) -> float:
        return 0.0 if self.leaves else self._spline.end

    @property
    def _joints(self) -> Joints:
        return self.row.start if self.leaves else self.row.end

    @property
    def _height_mm(self) -> float:
        return max(float(norm(self.cut.motion.surface.ruling(u))) for u in (0.0, 1.0))

    def _longest_mm(self) -> float:
        """Of a blend: of more no joint is asked less; both ends of the line and of the cut may be blended."""
        spline = self._spline
        bounds = [0.0, *(s for s in spline.lines_s if 0.0 < s < spline.end), spline.end]
        line = bounds[1] if self.leaves else spline.end - bounds[-2]
        useful = min(max(USEFUL_S * self.cut.block.feed_mm_s, USEFUL_MM[0]), USEFUL_MM[1])
        return min(useful, SHARE * line * self._own_rate(), SHARE * self.cut.motion.end)

    def _own_rate(self) -> float:
        """Millimetres of the tip per unit of the row's s where it meets the cut."""
        return float(self.row.tip_rate(np.array([self._at_s]))[0])

    def _pose_rows(self) -> Array:
        """Tip and axis there in the cut's part frame, with two derivatives over the row's s: (3, 6)."""
        part = self.cut.motion.part
        joints = rates.joint_series(self.row, self._at_s, self._joints, self.context.kinematics)
        tip, axis = self.context.kinematics.forward(joints, self.cut.motion.length_mm, series)
        return _rows((*part.from_parent(tip), *part.turn_back(axis)))

    def _spline_rows(self, segment: Segment, s: float, joints: Joints) -> Array:
        """What the row's spline is made of, at ``s`` of a segment with two derivatives: (3, 5)."""
        found = rates.joint_series(segment, s, joints, self.context.kinematics)
        x, y, z, *turns = self.context.kinematics.spread(found)
        if self._spline.tips:
            x, y, z = self.context.kinematics.forward(found, self._spline.length_mm, series).tip
        return _rows((x, y, z, *turns))

    def _row_at(self, away: float) -> tuple[float, Joints]:
        """The place so far from where they meet, in the row's s, and the joints there."""
        s = away if self.leaves else self._spline.end - away
        found = self._spline.joints(
            s, rotaries_of(self._joints, self.context.kinematics), self.context.kinematics
        )
        assert found is not None
        return s, found

    def _led(self, cut: Segment, reach: float) -> Segment | None:
        """The row with cubics for its ``reach`` (mm of the tip) beside the cut; None out of travel."""
        joint, end = (cut.end, cut.motion.end) if self.leaves else (cut.start, 0.0)
        turned = zip(*(rotaries_of(q, self.context.kinematics) for q in (joint, self._joints)), strict=True)
        if max(abs(a - b) for a, b in turned) > self.turn_rad:
            return None  # another branch, or beside a pole
        inner = self._spline_rows(cut, end, joint)
        size = reach / self._own_rate()
        outer = self._spline_rows(self.row, *self._row_at(size))
        per = self._tip_rate(cut, end, joint) / self._own_rate()
        middle = self._middle(inner, size, per)
        length = 2.0 * size / (1.0 + per)
        made = cubics(*((inner, middle, outer) if self.leaves else (outer, middle, inner)), length)
        led = _spliced(self.row, self._row_at(size)[0], length, made, self.leaves)
        led = replace(led, start=joint) if self.leaves else replace(led, end=joint)
        return led if self._in_travel(led, length) else None

    def _tip_rate(self, cut: Segment, s: float, joints: Joints) -> float:
        found = rates.joint_series(cut, s, joints, self.context.kinematics)
        tip = self.context.kinematics.forward(found, self.cut.motion.length_mm, series).tip
        return float(np.linalg.norm(_rows(tip)[1]))

    def _middle(self, inner: Array, size: float, per: float) -> Array:
        """Where the cubics are half way: the row there, and what is left of the blend.

        Their s goes from that of the row to that of the cut, of which one is ``per`` of the row's.
        """
        sign = 1.0 if self.leaves else -1.0
        x = 0.25 * (3.0 * per + 1.0) / (1.0 + per)  # share of ``size`` from the cut to the middle
        own = self._spline_rows(self.row, self._at_s, self._joints) * _powers(per)
        a, rate, bend = (inner - own) * _powers(sign * size / per)
        b = rate + 4.0 * a
        c = 0.5 * bend + 4.0 * b - 6.0 * a
        there = self._spline_rows(self.row, *self._row_at(x * size))[0]
        return np.asarray(there + (1.0 - x) ** 4 * (a + x * (b + x * c)))

    def _in_travel(self, led: Segment, length: float) -> bool:
        s = np.linspace(0.0, length, LOOKED) + (0.0 if self.leaves else led.motion.end - length)
        return audit.outside(self.context.machine, s, joints_along(led, s, self.context.kinematics)) is None

    # ---- what it costs -----------------------------------------------------------------

    def _off(self, led: Segment, motion: SurfaceCut, reach: float) -> tuple[float, float]:
        """How far (mm, rad) the row and the cut, led over, leave the programmed path."""
        size = reach / self._own_rate()
        longer = led.motion.end - self._spline.end
        rows = self._flank_on(self.row, size, OF_PATH), self._flank_on(led, size + longer, LOOKED)
        cuts = (self._flank_of(self.cut.motion, reach, OF_PATH), self._flank_of(motion, reach, LOOKED))
        path, now = (
            Flank(*(np.vstack((a[::-1], b)) for a, b in zip(cut, row, strict=True)))
            for cut, row in zip(cuts, rows, strict=True)
        )
        return now.off(path)

    def _flank_on(self, row: Segment, size: float, count: int) -> Flank:
        """Beside the cut as far as ``size`` of s, from there on."""
        away = np.linspace(0.0, size, count)
        joints = joints_along(row, away if self.leaves else row.motion.end - away, self.context.kinematics)
        pose = self.context.kinematics.forward(tuple(joints.T), self.cut.motion.length_mm, np)
        return self._flank(pose.tip, pose.axis, count)

    def _flank_of(self, cut: SurfaceCut, reach: float, count: int) -> Flank:
        """Beside the row as far as ``reach``, from there on."""
        away = np.linspace(0.0, reach, count)
        u = cut.arc.u_along(cut.end - away if self.leaves else away)
        pose = cut.surface.pose(u, cut.offset_mm, np)
        return self._flank(cut.part.to_parent(pose.tip), cut.part.turn(pose.axis), count)

    def _flank(self, tip: tuple[Array, ...], axis: tuple[Array, ...], count: int) -> Flank:
        feet, axes = (np.array([np.broadcast_to(c, (count,)) for c in v]).T for v in (tip, axis))
        return Flank(feet, feet + self._height_mm * axes, axes)


def _powers(per: float) -> Array:
    """What turns a value and its derivatives over s into those over ``per`` of it."""
    return np.array([[1.0], [per], [per * per]])


def _rows(values: tuple[object, ...]) -> Array:
    """Numbers or series at one place as values with two derivatives, (3, n)."""
    made = [series.jet(one) for one in values]
    return np.array([[one.derivative(k).item() for one in made] for k in range(3)])


def _spliced(row: Segment, at: float, length: float, made: Array, leaves: bool) -> Segment:
    """``row`` with the spans ``made`` over ``length`` in place of what lies before ``at``, or behind it."""
    spline = row.motion
    assert isinstance(spline, ToolSpline)
    knots, spans = np.frombuffer(spline.knots), np.frombuffer(spline.spans).reshape(-1, ROW)
    own = length * np.arange(len(made) + 1) / len(made)
    fresh = made.reshape(-1, ROW)
    i = int(np.clip(np.searchsorted(knots, at, side="right") - 1, 0, len(spans) - 1))
    if leaves:
        per = length / at
        rest = beyond(spans[i].reshape(-1, 4).T, at - knots[i]).T.ravel()
        knots = np.concatenate((own, knots[i + 1 :] - at + length))
        spans = np.concatenate((fresh, [rest], spans[i + 1 :]))
    else:
        per = length / (spline.end - at)
        i -= int(at <= knots[i] and i > 0)
        knots = np.concatenate((knots[: i + 1], at + own))
        spans = np.concatenate((spans[: i + 1], fresh))

    def moved(s: float) -> float:
        if leaves:
            return s * per if s < at else s - at + length
        return s if s < at else at + (s - at) * per

    motion = replace(
        spline,
        knots=array("d", knots.tolist()),
        spans=array("d", spans.ravel().tolist()),
        lines_s=array("d", map(moved, spline.lines_s)),
    )
    steps = tuple((moved(s), feed) for s, feed in row.feed_steps)
    turning = tuple((moved(a), moved(b)) for a, b in row.turning)
    return replace(row, motion=motion, feed_steps=steps, turning=turning)
