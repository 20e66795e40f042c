"""Exact lines of the tool (G61) in rows: many short ones as one motion, with all their corners.

    blocks -> tips, rotaries and great circles of many lines at once
           -> one cubic of the rotaries for each line, the tip straight: a ``ToolSpline`` with corners
           -> chains, at rest where a corner is too sharp to be run through

Only lines that turn little, clear of poles and of the end of reach, and as short as CAM systems write them;
every other line is a motion of its own (``lines``).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from typing import NamedTuple, TypeGuard

import numpy as np
import numpy.typing as npt

from controller.geometry.arrays import Array, Flags, columns
from controller.geometry.vectors import ROUNDING
from controller.motion.motions import DEG_PER_MM, Rotaries
from controller.plan import junctions
from controller.plan.context import Context
from controller.plan.lines import lines, rows
from controller.plan.lines.corners import Feed
from controller.plan.lines.lines import Stand
from controller.plan.lines.row_motions import Begun, RowMotions, feed_of
from controller.plan.lines.rows import Part
from controller.plan.rotaries import tool_paths
from controller.plan.rotaries.tool_axes import AxisLost, GreatCircles, follow
from controller.plan.rotaries.tool_paths import LITTLE_RAD, WITHIN_REACH
from controller.plan.rotaries.turns import SAME_ROTARY_RAD
from controller.plan.segment import STANDS_MM, ContinuousPath, Segment, joints_of
from controller.plan.surfaces.rates import Derivatives, limits
from controller.program.program import Block, ProgramError, Tip, TipLine

FIRST, MAX_LINES = (
    64,
    1024,
)  # lines after which they are looked at: at first, and as many as that each time later
MIN_LINES = 16  # lines are a row, and so many wait for those behind them
SHORT_MM = 0.12  # of s, median length of the lines of a row
SPANS = 128  # lines of one motion at most
SAMPLES = 2  # of each line for the audit of travel
OFF_RAD = 1e-9  # a cubic may leave a great circle's rotaries, in the middle of a line


class _Ways(NamedTuple):
    """Lines as arrays, table frame: where they meet, and how the axis and the rotaries get there."""

    tips: Array  # (n + 1, 3)
    axes: Array  # (n + 1, 3)
    rotaries: Array  # (n + 1, 2)
    size: Array  # (n,) in s
    cubics: Array  # (n, 5, 4) of tip and rotaries, in powers of s from each line's beginning
    fit: Flags  # (n,) to stand in a row


class ExactLines:
    """Collects lines; ``parts`` tells which of them are rows."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._motions = RowMotions(context)
        self._velocity, self._acceleration, self._jerk = (junctions.MARGIN * limits(context.machine)).T
        self._tool_limits = (
            context.machine.tip_acceleration_mm_s2 is not None or context.machine.axis_speed_rad_s is not None
        )
        self.forget()

    def forget(self) -> None:
        """None of them is wanted any more."""
        self._blocks: list[TipLine] = []
        self._look = FIRST
        self._goes_on = False  # the first of them goes on with a row that is given away

    def __bool__(self) -> bool:
        return bool(self._blocks)

    def takes(self, block: Block) -> TypeGuard[TipLine]:
        """Whether a block is such a line."""
        return (
            isinstance(block, TipLine)
            and block.feed_mm_s is not None
            and block.probe is None
            and not self._tool_limits
            and not rows.blends(block)
        )

    def goes_with(self, block: Feed) -> bool:
        """Whether it may stand in one row with those that wait."""
        return rows.alike(block.modal, self._blocks[0].modal)

    def add(self, block: TipLine) -> bool:
        """Whether it is time to look at them."""
        self._blocks.append(block)
        return len(self._blocks) >= self._look

    @property
    def length_mm(self) -> float:
        """Of their tool."""
        return self._blocks[0].modal.length_mm

    def parts(self, standing: Callable[[], Stand], final: bool) -> Iterator[Part]:
        """Rows, and lines that are no row, in order; ``standing``: where the path has come to by then.

        Not ``final``: the last lines wait for those behind them.
        """
        blocks, goes_on, look = self._blocks, self._goes_on, min(2 * self._look, MAX_LINES)
        self.forget()
        waits = False
        while blocks and not waits:
            ways = self._ways(blocks, stand := standing())
            first, last = _first_run(ways, goes_on)
            waits = not final and first < last == len(blocks)
            if waits:  # it may go on
                last = max(last - MIN_LINES, first)
            goes_on = goes_on and first == 0
            if last - first < MIN_LINES and not goes_on:
                last = first if waits else last
                if alone := blocks[:last]:
                    yield Part(alone)
            else:
                if first:
                    yield Part(blocks[:first])
                try:
                    chains, goes_on = self._chains(blocks, ways, first, last, waits)
                except ProgramError:  # each alone: what is before the one that is refused is sound
                    goes_on = False
                    yield Part(blocks[first:last])
                else:
                    yield Part((), laid=(chains, self._stand(ways, last, stand.length_mm)))
            blocks = blocks[last:]
        self._blocks, self._goes_on, self._look = blocks, goes_on, look

    # ---- geometry ----------------------------------------------------------------------

    def _ways(self, blocks: list[TipLine], stand: Stand) -> _Ways:
        part = blocks[0].modal.frame(self._context.machine)
        here, programmed = part.from_parent(stand.tip), []
        for block in blocks:
            here = lines.tip_of(block, here)
            programmed.append(here)
        frame = np.array([part.x, part.y, part.z])
        tips = np.concatenate(([stand.tip], np.array(part.origin) + np.array(programmed) @ frame))
        if blocks[0].modal.tip is Tip.VECTORS:
            return self._to_vectors(blocks, stand, tips, frame)
        turned = [stand.rotaries]
        for block in blocks:
            turned.append(lines.rotaries_to(block, turned[-1]))
        rotaries = np.array(turned)
        none = np.zeros(len(turned))
        joints = self._context.kinematics.arrange((none, none, none, rotaries[:, 0], rotaries[:, 1]))
        axes = columns(self._context.kinematics.forward(joints, 0.0, np).axis, len(turned))
        axes[0] = stand.axis
        even = (axes[:-1] * axes[1:]).sum(axis=1) > 1.0 - lines.SAME_AXIS
        if self._context.machine.tool_lines != lines.GREAT:
            even[:] = True
        return self._with_cubics(tips, axes, rotaries, even, np.ones(len(blocks), dtype=bool))

    def _to_vectors(self, blocks: list[TipLine], stand: Stand, tips: Array, frame: Array) -> _Ways:
        n = len(blocks)
        axes = np.concatenate(([stand.axis], lines.vectors(blocks, frame)))
        given = np.array([True, *(block.axis is not None for block in blocks)])
        axes = axes[np.maximum.accumulate(np.where(given, np.arange(n + 1), 0))]
        rotaries, fit, known = np.tile(np.array(stand.rotaries), (n + 1, 1)), np.zeros(n, dtype=bool), n
        while known:
            try:
                found = follow(GreatCircles.of(axes[: known + 1]), stand.rotaries, self._context.kinematics)
            except AxisLost as lost:
                known = lost.line
                continue
            begins, ends = (found.rotaries[found.share == share] for share in (0.0, 1.0))
            rotaries[1 : known + 1] = ends
            swivels = np.abs(begins - rotaries[:known]).max(axis=1) >= SAME_ROTARY_RAD
            fit[:known] = ~swivels
            break
        return self._with_cubics(tips, axes, rotaries, np.zeros(n, dtype=bool), fit)

    def _with_cubics(self, tips: Array, axes: Array, rotaries: Array, even: Flags, fit: Flags) -> _Ways:
        """The ways of lines of which ``fit`` may be in a row; on ``even`` ones both rotaries turn evenly."""
        way, turn = np.diff(tips, axis=0), np.diff(rotaries, axis=0)
        length = np.sqrt((way * way).sum(axis=1))
        most = np.abs(turn).max(axis=1)
        fit = fit & (even | (self._clear(axes) & (most <= LITTLE_RAD)))
        turned = np.where(even, np.sqrt((turn * turn).sum(axis=1)), most)
        rates = np.stack([turn, turn])
        great = np.flatnonzero(fit & ~even)
        if len(great):
            circles = GreatCircles.of(axes)
            circles = GreatCircles(circles.axis[great], circles.across[great], circles.angle[great])
            turned[great] = np.maximum(turned[great], circles.angle)
            fit[great] &= circles.angle <= LITTLE_RAD
            for k, shown in ((0, rotaries[:-1]), (1, rotaries[1:])):
                shares = (circles, float(k), shown[great], self._context.kinematics)
                rates[k, great] = tool_paths.rates_of_circles(*shares)
            middle = 0.5 * (rotaries[:-1] + rotaries[1:])[great]
            off = tool_paths.rotaries_on_circles(circles, 0.5, middle, self._context.kinematics) - middle
            off -= (rates[0] - rates[1])[great] / 8.0
            fit[great] &= np.abs(off).max(axis=1) <= OFF_RAD
        size = np.maximum(length, np.degrees(turned) / DEG_PER_MM)
        fit &= (length >= STANDS_MM) | (size < ROUNDING)
        cubics = np.zeros((len(size), 5, 4))
        cubics[..., 0] = np.hstack([tips[:-1], rotaries[:-1]])
        per = 1.0 / np.maximum(size, ROUNDING)[:, None]
        cubics[:, :3, 1] = way * per
        cubics[:, 3:, 1] = rates[0] * per
        cubics[:, 3:, 2] = (3.0 * turn - 2.0 * rates[0] - rates[1]) * per**2
        cubics[:, 3:, 3] = (rates[0] + rates[1] - 2.0 * turn) * per**3
        return _Ways(tips, axes, rotaries, size, cubics, fit)

    def _clear(self, axes: Array) -> Flags:
        """Lines (n,) between ``axes`` (n + 1, 3) on which no branch is in doubt if they turn little."""
        kinematics = self._context.kinematics
        clear = np.array([kinematics.is_clear_of_pole(lines.vector(axis)) for axis in axes])
        if kinematics.is_bounded:
            x, y, z = axes.T
            clear &= np.asarray(kinematics.off_limit((x, y, z))) >= WITHIN_REACH
        return np.asarray(clear[:-1] & clear[1:])

    def _stand(self, ways: _Ways, k: int, length_mm: float) -> Stand:
        tip, axis = lines.vector(ways.tips[k]), lines.vector(ways.axes[k])
        rotaries: Rotaries = (float(ways.rotaries[k, 0]), float(ways.rotaries[k, 1]))
        xyz = self._context.kinematics.linear(tip, rotaries, length_mm)
        return Stand(joints_of(xyz, rotaries, self._context.kinematics), tip, axis, rotaries, length_mm)

    # ---- chains ------------------------------------------------------------------------

    def _chains(
        self, blocks: list[TipLine], ways: _Ways, first: int, last: int, more: bool
    ) -> tuple[list[ContinuousPath], bool]:
        """Chains of the lines from ``first`` up to ``last``, and whether the next of them runs on from those.

        It may if it is one ``more`` of the row; before a line that stands in no row is a rest.
        """
        upto = min(last + more, len(blocks))
        lines_of = first + np.flatnonzero(ways.size[first:upto] >= ROUNDING)
        stops = self._stops(blocks, ways, lines_of)
        goes_on = bool(len(lines_of)) and lines_of[-1] == last
        if goes_on:
            lines_of = lines_of[:-1]
            goes_on = bool(len(lines_of)) and not stops[-1]
            stops = stops[:-1]
        cuts = [0, *(np.flatnonzero(stops[: max(len(lines_of) - 1, 0)]) + 1).tolist(), len(lines_of)]
        chains = []
        for low, high in itertools.pairwise(cuts):
            found = [
                self._motion(blocks, ways, lines_of[k : min(k + SPANS, high)])
                for k in range(low, high, SPANS)
            ]
            if found:
                chains.append(ContinuousPath(tuple(found), runs_on=goes_on and high == len(lines_of)))
        return chains, goes_on

    def _motion(self, blocks: list[TipLine], ways: _Ways, of: npt.NDArray[np.intp]) -> Segment:
        knots = np.concatenate([[0.0], np.cumsum(ways.size[of])])
        here = [blocks[k] for k in of.tolist()]
        way = ways.cubics[of, :3, 1] * ways.size[of, None]
        lengths = np.sqrt((way * way).sum(axis=1)).tolist()
        feeds = [
            feed_of(block, size, length, 0.0)
            for block, size, length in zip(here, ways.size[of].tolist(), lengths, strict=True)
        ]
        begun = Begun(list(here), knots[:-1].tolist(), feeds)
        length_mm = blocks[0].modal.length_mm
        return self._motions.segment(knots, ways.cubics[of], begun, True, length_mm, True, SAMPLES)

    def _stops(self, blocks: list[TipLine], ways: _Ways, of: npt.NDArray[np.intp]) -> Flags:
        """Of each corner between the lines ``of``: whether it is no faster to pass it than to stop."""
        size, cubics = ways.size[of], ways.cubics[of]
        machine, kinematics = self._context.machine, self._context.kinematics
        length_mm, period_s = blocks[0].modal.length_mm, machine.period_s
        begin, end = (
            Derivatives(*tool_paths.derivatives_of_spans(cubics, h[:, None], True, length_mm, kinematics))
            for h in (np.zeros(len(of)), size)
        )
        way = ways.cubics[of, :3, 1]
        tip_rate = np.sqrt((way * way).sum(axis=1))
        feeds = [
            feed_of(blocks[k], float(s), float(s * r), 0.0)[0]
            for k, s, r in zip(of, size, tip_rate, strict=True)
        ]
        feed = np.array(feeds) / tip_rate
        jump = np.abs(begin.first[1:] - end.first[:-1])
        curve = np.abs(begin.second[1:] - end.second[:-1])
        speed = junctions.passed(jump, curve, self._acceleration, self._jerk, period_s)
        unhindered, least = np.minimum(feed[1:], feed[:-1]), np.full(len(speed), np.inf)
        for d, which in ((end, slice(None, -1)), (begin, slice(1, None))):
            rates = np.abs(d.first[which])
            reached = junctions.reached(rates, size[which], self._acceleration, self._jerk)
            here = Derivatives(d.first[which], d.second[which], d.third[which])
            unhindered = np.minimum(
                unhindered,
                np.minimum(reached, here.even_speed(self._velocity, self._acceleration, self._jerk)),
            )
            least = np.minimum(least, junctions.least(rates, self._jerk, period_s))
        found = speed < np.maximum(junctions.STOP_SHARE * unhindered, least)
        return np.asarray(found | ~lines.slight(jump, np.minimum(feed[1:], feed[:-1]), self._context.machine))


def _first_run(ways: _Ways, goes_on: bool) -> tuple[int, int]:
    """The first lines that are a row, from and up to; or that may come to be one with those behind them."""
    n = len(ways.fit)
    edges = np.flatnonzero(np.diff(ways.fit.astype(np.int8), prepend=0, append=0))
    for first, last in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        many = last - first >= MIN_LINES and float(np.median(ways.size[first:last])) <= SHORT_MM
        if many or (goes_on and first == 0) or (last == n and last - first < MIN_LINES):
            return first, last
    return n, n
