"""Rows of lines and arcs as smooth splines: from blocks to chains, some thousand lines at a time.

    lines -> corners: tip (table frame) and rotaries, more where the great circle asks for it
          -> ``fit`` -> spans -> motions of ``SPANS`` spans each

A row is what stands under one G64 P, or lines whose corners are not meant (``meant``), within the machine's
tolerance of joints. It is at rest at both ends and wherever ``fit`` finds no blend, where the tip stands
while the axis turns by more than ``STANDING_DEG``, and where a rotary must turn at the pole.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from controller.geometry.arrays import Array
from controller.geometry.vectors import Vector
from controller.motion.motions import DEG_PER_MM, ToolLine
from controller.plan.context import Context
from controller.plan.lines import lines, moves
from controller.plan.lines.corners import CHORD_SHARE, CIRCLE_SHARE, CornerMaker, Corners, Feed
from controller.plan.lines.lines import Stand
from controller.plan.lines.row_motions import Begun, RowMotions, feed_of, turning_feed
from controller.plan.lines.spline_fit import Polyline, Row, Spans, Tolerance
from controller.plan.rotaries.tool_axes import GreatCircles
from controller.plan.rotaries.turns import SAME_ROTARY_RAD
from controller.plan.segment import (
    STANDS_MM,
    ContinuousPath,
    Segment,
    joints_of,
    rotaries_of,
    straight,
)
from controller.plan.surfaces import audit
from controller.program.program import JointLine, Modal, Tip, TipLine

Index = npt.NDArray[np.intp]

WINDOW = 2000  # lines that are fitted together
SPANS = 128  # of one motion at most
BLEND_DEG = 0.05  # G64 P without Q: the axis may leave its way by so much (17 um at 20 mm of flute)
STANDING_DEG = 1.0  # turns of a standing tip that a row runs through
AUDIT_DEG = 2.0  # turn of an exact line per sample of its audit
MIN_GAP = 1e-9  # corners nearer than this in s are one


class Part(NamedTuple):
    """Lines that waited until it was known how they are laid."""

    blocks: Sequence[Feed]
    blended: bool = False  # they are one row; otherwise each is exact
    goes_on: bool = False  # the next line is a part of the same row
    laid: tuple[list[ContinuousPath], Stand] | None = None  # as exact chains already, and where they end


def blends(block: Feed) -> bool:
    """Whether a block is a line or an arc that G64 P lets be left."""
    feeds = block.feed_mm_s is not None
    framed = isinstance(block, JointLine) and block.machine_frame
    return feeds and not framed and not block.modal.exact and block.modal.blend_mm > 0.0


def _key(modal: Modal) -> tuple[object, ...]:
    """What must not change inside a row."""
    where = modal.tip, modal.offset, modal.part, modal.tilted
    return *where, modal.length_mm, modal.blend_mm, modal.blend_deg, modal.outputs, modal.overrides


def alike(a: Modal, b: Modal) -> bool:
    """Whether lines under both may stand in one row."""
    return a is b or _key(a) == _key(b)


class LineRow:
    """Collects the blocks of one row; ``chains`` gives what can be given of it."""

    def __init__(self, block: Feed, stand: Stand, context: Context) -> None:
        self._context = context
        self._modal = block.modal
        self._tip_mm = block.modal.blend_mm or context.machine.joint_tolerance_mm
        self._tips = block.modal.tip is not Tip.OFF
        self._vectors = block.modal.tip is Tip.VECTORS
        degrees = block.modal.blend_deg or BLEND_DEG
        self._axis_rad = math.radians(degrees)
        self._maker = CornerMaker(block.modal, self._axis_rad, context)
        self._motions = RowMotions(context)
        self._stand = stand
        self.joints = stand.joints  # where the segments given away end
        self._blocks: list[Feed] = []
        self._given = 0  # lines that have been fitted before
        self._row: Row | None = None
        self._s = 0.0
        self._lines_s: list[float] = []  # where each line begins, with its block
        self._lines: list[Feed] = []
        self._feeds: list[tuple[float, bool]] = []  # of each line; whether of s, as the tip stands

    @property
    def only(self) -> Feed | None:
        """The row's block if it is but one: it stays exact."""
        return self._blocks[0] if len(self._blocks) == 1 and not self._given else None

    @property
    def modal(self) -> Modal:
        """The state that all its blocks share."""
        return self._modal

    @property
    def stand(self) -> Stand:
        """Where the row has come to."""
        return self._stand

    def takes(self, block: Feed) -> bool:
        return alike(block.modal, self._modal)

    def add(self, block: Feed) -> None:
        self._blocks.append(block)

    @property
    def full(self) -> bool:
        return len(self._blocks) >= WINDOW

    def chains(self, final: bool) -> Iterator[ContinuousPath]:
        """Fit what has been collected and give away what is certain, ``final``: all of it."""
        blocks, self._blocks = self._blocks, []
        if blocks:
            self._given += len(blocks)
            yield from self._fitted(blocks)
        if final:
            yield from self._taken(True)

    # ---- from blocks to corners ------------------------------------------------------

    def _fitted(self, blocks: list[Feed]) -> Iterator[ContinuousPath]:
        found, ends = self._maker.of(blocks, self._stand)
        yield from self._begun(blocks[0], found)
        step = self._steps(found)
        first = 0
        for after, through in self._stops(found, len(blocks)):
            self._grow(blocks, found, step, first, after)
            yield from self._taken(True)
            yield from self._turned(blocks, found, after, through)
            first = through
        self._grow(blocks, found, step, first, len(found.line) - 1)
        self._stand = ends
        yield from self._taken(False)

    def _begun(self, block: Feed, found: Corners) -> Iterator[ContinuousPath]:
        """A swivel at the pole before the first line, where its tool vectors ask for it."""
        if not isinstance(block, TipLine):
            return
        begin = (float(found.values[0, 3]), float(found.values[0, 4]))
        swivel = lines.turn(block, self._stand, begin, self._context.kinematics)
        if swivel is not None:
            yield from self._taken(True)
            audit_line(swivel, self._context)
            self.joints = swivel.end
            yield ContinuousPath((swivel,))

    # ---- from corners to spans ---------------------------------------------------------

    def _steps(self, found: Corners) -> Array:
        """Length in s from each corner to the next."""
        way = np.diff(found.values, axis=0)
        tip = np.sqrt((way[:, :3] ** 2).sum(axis=1))
        turned = np.degrees(np.abs(way[:, 3:]).max(axis=1, initial=0.0))
        return np.asarray(np.maximum(tip, turned / DEG_PER_MM))

    def _stops(self, found: Corners, count: int) -> list[tuple[int, int]]:
        """(last corner before, first corner after) each turn of the standing tool."""
        way = np.diff(found.values, axis=0)
        moved = np.sqrt((way[:, :3] ** 2).sum(axis=1)) >= STANDS_MM
        turned = np.degrees(np.abs(way[:, 3:]).max(axis=1, initial=0.0))
        of = found.line[:-1]
        within = found.share[:-1] < 1.0  # otherwise between the end of a line and the start of the next
        rest = np.bincount(of, moved & within, count) == 0.0
        whole = np.bincount(of, np.where(within, turned, 0.0), count)
        stands = (rest & (whole > STANDING_DEG))[of] & within
        swivels = ~within & (turned > math.degrees(SAME_ROTARY_RAD))
        stops: list[tuple[int, int]] = []
        for i in np.flatnonzero(stands | swivels).tolist():
            if stops and i < stops[-1][1]:
                continue
            last = i + 1
            while stands[i] and last < len(of) and of[last] == of[i] and stands[last]:
                last += 1
            stops.append((i, last))
        return stops

    def _grow(self, blocks: list[Feed], found: Corners, step: Array, first: int, last: int) -> None:
        """The corners from ``first`` to ``last`` join the spline."""
        if last <= first:
            return
        s = self._s + np.concatenate(([0.0], np.cumsum(step[first:last])))
        values, sine = found.values[first : last + 1], found.sine[first : last + 1]
        keep = np.concatenate(([True], np.diff(s) > MIN_GAP))
        if not keep[1:].any():
            return
        self._note_lines(blocks, found, s, first, last)
        line = Polyline(s[keep], values[keep], sine[keep])
        if self._row is None:
            spin = self._context.kinematics.work if self._tips else None
            share = 1.0 - CIRCLE_SHARE if self._tips else 1.0
            chords = 0.0 if self._tips else CHORD_SHARE
            tolerance = Tolerance((1.0 - chords) * self._tip_mm, share * self._axis_rad, spin)
            self._row = Row(tolerance, line.between(0, 0))
        self._row.extend(line)
        self._s = float(line.s[-1])

    def _note_lines(self, blocks: list[Feed], found: Corners, s: Array, first: int, last: int) -> None:
        """Where each line begins in s, and its feed."""
        of = found.line[first:last]
        starts = np.concatenate(([0], np.flatnonzero(np.diff(of)) + 1))
        ends = np.concatenate((starts[1:], [last - first]))
        way = np.diff(found.values[first : last + 1], axis=0)
        tip, turned = (
            np.add.reduceat(np.sqrt((part * part).sum(axis=1)), starts) for part in (way[:, :3], way[:, 3:])
        )
        sizes = s[ends] - s[starts]
        for line, at, size, length, turn in zip(
            *(row.tolist() for row in (of[starts], s[starts], sizes, tip, turned)), strict=True
        ):
            self._lines_s.append(at)
            self._lines.append(blocks[line])
            self._feeds.append(feed_of(blocks[line], size, length, math.degrees(turn)))

    def _taken(self, final: bool) -> Iterator[ContinuousPath]:
        """What ``fit`` can give away by now."""
        while self._row is not None:
            spans = self._row.take(final)
            if spans is None:
                break
            yield self._chain(spans)
        if final:
            self._row = None

    def _turned(
        self, blocks: list[Feed], found: Corners, after: int, through: int
    ) -> Iterator[ContinuousPath]:
        """The tip stands while the axis turns: an exact line of its own."""
        a, b = found.values[after], found.values[through]
        swivel = bool(found.share[after] == 1.0)
        block = blocks[int(found.line[through] if swivel else found.line[after])]
        first, last = (float(a[3]), float(a[4])), (float(b[3]), float(b[4]))
        kinematics = self._context.kinematics
        if not isinstance(block, TipLine):
            start, end = (joints_of(_three(v), (float(v[3]), float(v[4])), kinematics) for v in (a, b))
            feeds = (block.feed_mm_s, kinematics, turning_feed(block))
            segment = straight("line", block.place, start, end, *feeds)
            if segment is not None:
                if block.time_s is not None:
                    segment = moves.timed(segment, block.time_s)
                ends = np.array([0.0, segment.motion.end]), np.array([start, end])
                self._motions.audit(lambda _: block.place, *ends)
                self.joints = segment.end
                yield ContinuousPath((segment,))
            return
        stand = self._maker.standing(a[:3], first, lines.axis_of(first, kinematics))
        line: ToolLine | None
        axis = lines.axis_of(last, kinematics)
        circles = None if swivel else self._circle(stand, axis, last)
        if circles is None:
            line = lines.even_line(stand.tip, stand.tip, first, last, stand.length_mm)
        else:
            line = lines.great_line(stand, stand.tip, circles, last)
        if line is not None:
            name = "swivel" if swivel else "line"
            segment = lines.segment_of(block, line, stand.joints, kinematics, name)
            audit_line(segment, self._context)
            self.joints = segment.end
            yield ContinuousPath((segment,))

    def _circle(self, stand: Stand, axis: Vector, last: tuple[float, float]) -> GreatCircles | None:
        if self._vectors:
            return lines.circle(stand.axis, axis)
        return lines.great_circle(stand, axis, last, self._context)

    # ---- from spans to motions -----------------------------------------------------------

    def _chain(self, spans: Spans) -> ContinuousPath:
        segments = []
        for first in range(0, len(spans.c), SPANS):
            last = min(first + SPANS, len(spans.c))
            segments.append(self._segment(spans.knots[first : last + 1], spans.c[first:last]))
        self.joints = segments[-1].end
        return ContinuousPath(tuple(segments), runs_on=not spans.rests)

    def _segment(self, knots: Array, c: Array) -> Segment:
        first = max(0, bisect_right(self._lines_s, float(knots[0]) + MIN_GAP) - 1)
        last = bisect_left(self._lines_s, float(knots[-1]) - MIN_GAP)
        begun = Begun(self._lines[first:last], self._lines_s[first:last], self._feeds[first:last])
        length_mm = self._modal.length_mm if self._tips else 0.0
        found = self._motions.segment(knots, c, begun, self._tips, length_mm)
        del self._lines[: last - 1], self._lines_s[: last - 1], self._feeds[: last - 1]
        return found


def audit_line(segment: Segment, context: Context) -> None:
    """Refuses an exact tool line on which a joint leaves its travel."""
    motion = segment.motion
    first, last = rotaries_of(segment.start, context.kinematics), rotaries_of(segment.end, context.kinematics)
    turned = math.degrees(max(abs(a - b) for a, b in zip(first, last, strict=True)))
    near, rows = first, []
    s = np.linspace(0.0, motion.end, 3 + math.ceil(turned / AUDIT_DEG))
    for at in s.tolist():
        joints = motion.joints(at, near, context.kinematics) or segment.end
        near = rotaries_of(joints, context.kinematics)
        rows.append(joints)
    if audit.surely_inside(context.machine, rows):
        return
    excess = audit.outside(context.machine, s, np.array(rows))
    if excess is not None:
        context.refuse(segment.place, audit.describe(context.machine.axes[excess.axis], excess))


def _three(row: Array) -> Vector:
    return float(row[0]), float(row[1]), float(row[2])
