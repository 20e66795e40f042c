"""Where the tool went, as passes in the table frame: from a planned path, or from a trace.

A planned path is taken by its joints, as the machine takes it: whatever placed the cutter,
and whatever the kinematics made of it, is in the poses that come back from them.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.geometry.arrays import Array, distinct
from controller.geometry.placement import Strategy
from controller.machine.kinematics import Kinematics
from controller.machine.model import Machine, Tool
from controller.machine.tool_profile import whole
from controller.motion.motions import SurfaceCut, ToolSpline
from controller.plan.path.outputs import PROBE
from controller.plan.rotaries.branch import joints_along
from controller.plan.segment import Segment
from controller.plan.surfaces.blending import allowed_by
from controller.plan.surfaces.cuts import strategy, tolerance_mm
from controller.program.program import Block
from controller.verify.nominal import Nominal
from controller.verify.sweep import FIT_MM, Pass, Poses, sampled
from controller.verify.trace import Trace, forward

ROUGH_MM = 0.5  # step of the first look at a pass
NEAR_MM = 1.0  # a pass that stays this far from every surface is not looked at closely
SCALLOP_MM = 5e-5  # that the samples of a cut may leave between them, before their places are made exact
STEPS_MM = (0.01, 0.05)
ROUGH_STEP_MM, ROUGH_SCALLOP_MM, ROUGH_FIT_MM = (0.02, 0.2), 1e-3, 1e-4


class Form(NamedTuple):
    """How exact a surface is to be cut, mm, and how the cutter is placed for it."""

    allowance_mm: float
    tolerance_mm: float | None  # None: none is asked for
    joint_tolerance_mm: float
    placement: Strategy

    @classmethod
    def of(cls, block: Block, tool: Tool, machine: Machine) -> Form:
        modal = block.modal
        tolerance = tolerance_mm(modal, tool, machine)
        joint_mm = allowed_by(modal, machine).mm
        return cls(modal.allowance_mm, tolerance, joint_mm, strategy(modal, tool, machine))


@dataclass(frozen=True, slots=True)
class Fitted:
    """Which tool is in the spindle, and how exact it is to cut, by ``Place.order``."""

    orders: tuple[int, ...]  # rising; the tool holds from there on
    tools: tuple[Tool, ...]
    forms: tuple[Form, ...]

    @classmethod
    def of(cls, blocks: Iterable[Block], machine: Machine) -> Fitted:
        """Of a program's blocks; T1 is in the spindle before them. Lines come in their order."""
        first = machine.tool(1) or machine.tools[0].worn
        placement = Strategy[machine.placement.upper()]
        orders, tools = [0], [first]
        forms = [Form(0.0, machine.tolerance_mm, machine.joint_tolerance_mm, placement)]
        for block in blocks:
            tool = block.modal.tool_in(machine)
            if tool is None:
                continue
            if machine.probe is not None and tool.number == machine.probe.tool:
                tool = replace(tool, flute_mm=0.0)  # a probe touches and cuts nothing
            form = Form.of(block, tool, machine)
            if (tool, form) != (tools[-1], forms[-1]):
                orders.append(block.place.order)
                tools.append(tool)
                forms.append(form)
        return cls(tuple(orders), tuple(tools), tuple(forms))

    def at(self, order: int) -> Tool:
        return self.tools[self._index(order)]

    def form(self, order: int) -> Form:
        return self.forms[self._index(order)]

    def _index(self, order: int) -> int:
        return max(0, int(np.searchsorted(self.orders, order, side="right")) - 1)


def nominals(segments: Mapping[int, Segment], fitted: Fitted) -> list[Nominal]:
    """The surfaces that a path cuts, in its order."""
    found = []
    for number, segment in segments.items():
        motion = segment.motion
        if isinstance(motion, SurfaceCut) and segment.cutting:  # no pivot of placed axes
            side = -1.0 if motion.offset_mm < 0.0 else 1.0
            line, order = segment.place.line, segment.place.order
            tool, form = fitted.at(order), fitted.form(order)
            one = Nominal(motion.surface, motion.part, side, tool, line, number, *form, share=segment.share)
            found.append(one)
    return found


def step_mm(tool: Tool, rough: bool = False) -> float:
    """How close samples of a cut stand: a row of cylinders leaves scallops of step^2 / (8 r)."""
    (low, high), scallop = (ROUGH_STEP_MM, ROUGH_SCALLOP_MM) if rough else (STEPS_MM, SCALLOP_MM)
    return float(np.clip(np.sqrt(8.0 * tool.radius_mm * scallop), low, high))


def height_mm(tool: Tool, surfaces: Sequence[Nominal]) -> float:
    """How far above the tip the poses of samples are held exact: flute, holder and the longest ruling."""
    return max(tool.flute_mm, longest(surfaces), *(high for _, high, _ in tool.holder))


def longest(surfaces: Sequence[Nominal]) -> float:
    """A little over the longest ruling."""
    return max((1.1 * one.size[1] + 1.0 for one in surfaces), default=0.0)


def extent_mm(surfaces: Sequence[Nominal]) -> float:
    """A length that no two points of all surfaces exceed: so far above its flute a shank is looked at."""
    return Balls.of(surfaces).extent_mm


def planned(
    segments: Mapping[int, Segment],
    surfaces: Sequence[Nominal],
    fitted: Fitted,
    kinematics: Kinematics,
    rough: bool = False,
) -> dict[Tool, list[Pass]]:
    """The passes of each tool that come near a surface; ``rough``: so close as finding gouges needs it.

    None of a probing move, and of what leads off from its end: it ends where it touches, and the end that is
    written lies within what it touches.
    """
    found: dict[Tool, list[Pass]] = {}
    balls, probes = Balls.of(surfaces), False
    extent = balls.extent_mm
    for number, segment in segments.items():
        probed, probes = probes, segment.name == PROBE
        if probed or probes:
            continue
        tool = fitted.at(segment.place.order)
        bodies = whole(tool, extent)
        top, reach = (max(body.top_mm for body in bodies), max(body.widest_mm for body in bodies))
        poses, height = _poses(segment, tool, kinematics), height_mm(tool, surfaces)
        end = segment.motion.end
        span = (0.0, end) if segment.cutting else _near(poses, end, top, reach, balls)
        if span is None:
            continue
        start, end = span
        step, fit = step_mm(tool, rough), ROUGH_FIT_MM if rough else FIT_MM
        s, tips, axes = sampled(_from(poses, start), end - start, step, height, fit)
        row = _pass(segment, s + start, tips, axes, number)
        found.setdefault(tool, []).append(row)
    return found


def _from(poses: Poses, start: float) -> Poses:
    return lambda s: poses(s + start)


def _pass(segment: Segment, s: Array, tips: Array, axes: Array, number: int) -> Pass:
    motion, lines, begun = segment.motion, tuple[int, ...](), tuple[float, ...]()
    if isinstance(motion, ToolSpline):
        lines, begun = tuple(motion.lines), tuple(motion.lines_s)
    feeding = segment.feed_mm_s is not None
    return Pass(s, tips, axes, segment.place.line, segment.name, number, feeding, lines, begun)


def rough(
    segments: Mapping[int, Segment], tool_of: Fitted, kinematics: Kinematics
) -> list[tuple[Tool, Pass]]:
    """Every motion of a path, sampled coarsely: enough for tables."""
    found = []
    for number, segment in segments.items():
        tool = tool_of.at(segment.place.order)
        height = max(body.top_mm for body in whole(tool))
        s, tips, axes = sampled(
            _poses(segment, tool, kinematics), segment.motion.end, ROUGH_MM, height, ROUGH_FIT_MM
        )
        found.append((tool, _pass(segment, s, tips, axes, number)))
    return found


def _poses(segment: Segment, tool: Tool, kinematics: Kinematics) -> Poses:
    def poses(s: Array) -> tuple[Array, Array]:
        return forward(joints_along(segment, s, kinematics), tool.length_mm, kinematics)

    return poses


@dataclass(frozen=True, slots=True)
class Balls:
    """A ball about each of K surfaces: centres (K, 3) and radii (K,), table frame."""

    centres: Array
    radii: Array

    @classmethod
    def of(cls, surfaces: Sequence[Nominal]) -> Balls:
        return cls(
            np.array([one.ball[0] for one in surfaces]).reshape(-1, 3),
            np.array([one.ball[1] for one in surfaces]),
        )

    @property
    def extent_mm(self) -> float:
        """The diagonal of a box about them all; 0 where there is none."""
        if not len(self.radii):
            return 0.0
        wide = self.radii[:, None]
        return float(np.linalg.norm((self.centres + wide).max(axis=0) - (self.centres - wide).min(axis=0)))

    def about(self, points: Array, within: float) -> Iterator[tuple[Array, float]]:
        """Centre and radius of those that may come ``within`` of anything between ``points`` (N, 3)."""
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        size = float(np.linalg.norm(points - middle, axis=1).max())
        off = np.linalg.norm(self.centres - middle, axis=1) - self.radii - size
        for k in np.flatnonzero(off <= within):
            yield self.centres[k], float(self.radii[k])


def _near(poses: Poses, end: float, height: float, reach: float, balls: Balls) -> tuple[float, float] | None:
    """From where to where on a motion of length ``end`` the tool is near a surface; None: nowhere."""
    s, tips, axes = sampled(poses, end, ROUGH_MM, height, ROUGH_FIT_MM)
    off, within = np.full(len(s), np.inf), reach + NEAR_MM + ROUGH_MM
    for centre, radius in balls.about(np.vstack([tips, tips + height * axes]), within):
        h = np.clip(((centre - tips) * axes).sum(axis=1), 0.0, height)
        away = np.linalg.norm(centre - tips - h[:, None] * axes, axis=1) - radius
        off = np.minimum(off, away)
    rows = np.flatnonzero(off <= within)
    if not len(rows):
        return None
    return float(s[max(rows[0] - 1, 0)]), float(s[min(rows[-1] + 1, len(s) - 1)])


# ---- from a trace ------------------------------------------------------------------

FEWEST_ROWS = 4  # of a pass: a cubic needs four


def traced(
    trace: Trace, machine: Machine, fitted: Fitted, kinematics: Kinematics, actual: bool
) -> dict[Tool, list[Pass]]:
    """The passes of a recorded run: what was told to the drives, or what they reported.

    The joints of neighbouring ticks are the samples; places are rows of the trace.
    """
    per_unit = np.array([axis.shown_per_unit for axis in machine.axes])
    joints = (trace.joint_actual if actual else trace.joint_command) / per_unit
    found: dict[Tool, list[Pass]] = {}
    for start, stop in _segments(trace):
        middle = (start + stop) // 2
        line, cutting = int(trace.line[middle]), bool(trace.cutting[middle])
        tool = fitted.at(line)
        height = height_mm(tool, ())
        # One row more on both sides: neighbours meet, and no way between two ticks is lost.
        first = max(start - 1, 0)
        rows = np.arange(first, min(stop + 1, len(joints)), dtype=np.float64)
        tips, axes = forward(joints[first : first + len(rows)], tool.length_mm, kinematics)
        kept = _thinned(tips, tips + height * axes, 0.5 * step_mm(tool))
        name = "cut" if cutting else "way"
        one = Pass(rows[kept], tips[kept], axes[kept], line, name)
        found.setdefault(tool, []).append(one)
    return found


def _thinned(tips: Array, tops: Array, step_mm: float) -> NDArray[np.int64]:
    """Rows at least ``step_mm`` of way apart, and the ends: a slow feed has a thousand ticks per mm."""
    steps = np.maximum(
        np.linalg.norm(np.diff(tips, axis=0), axis=1), np.linalg.norm(np.diff(tops, axis=0), axis=1)
    )
    way = np.floor(np.concatenate([[0.0], np.cumsum(steps)]) / step_mm)
    kept = np.concatenate([[True], np.diff(way) > 0.0])
    kept[-1] = True
    if kept.sum() < FEWEST_ROWS:
        return distinct(np.linspace(0, len(tips) - 1, FEWEST_ROWS).astype(np.int64))
    return np.flatnonzero(kept)


def _segments(trace: Trace) -> list[tuple[int, int]]:
    """(start, stop) of rows of one line, cutting or not; short ones go with the one before."""
    n = len(trace.line)
    change = (np.diff(trace.line) != 0) | (np.diff(trace.cutting.astype(np.int8)) != 0)
    edges = [0, *(np.flatnonzero(change) + 1).tolist(), n]
    found: list[tuple[int, int]] = []
    for start, stop in itertools.pairwise(edges):
        if found and (stop - start < FEWEST_ROWS or found[-1][1] - found[-1][0] < FEWEST_ROWS):
            found[-1] = (found[-1][0], stop)
        else:
            found.append((start, stop))
    return [(start, stop) for start, stop in found if stop - start >= FEWEST_ROWS]
