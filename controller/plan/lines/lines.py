"""G0 and G1 under G43.4 and G43.5: from blocks to exact lines of the tool and to rapids.

Where the tool stands is kept as the program said it (tip and axis), so that rounding of
the kinematics does not add up from line to line.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NoReturn

import numpy as np
import numpy.typing as npt

from controller.geometry.arrays import Array
from controller.geometry.vectors import ROUNDING, Vector, add, dot, norm, subtract, unit
from controller.machine.kinematics import Kinematics
from controller.machine.model import Joints, Machine
from controller.messages import Key, message
from controller.motion.motions import DEG_PER_MM, Rotaries, ToolLine
from controller.plan.context import Context
from controller.plan.junctions import JUMP_SHARE, STOP_SHARE
from controller.plan.lines import moves
from controller.plan.rotaries.tool_axes import AxisLost, Followed, GreatCircles, follow
from controller.plan.rotaries.tool_paths import LITTLE_RAD
from controller.plan.rotaries.turns import SAME_ROTARY_RAD
from controller.plan.segment import STANDS_MM, Segment, joints_of, rotaries_of, straight
from controller.program.block_look_ahead import AHEAD_LINES
from controller.program.program import Place, TipLine

LITTLE_COSINE = math.cos(LITTLE_RAD)
SAME_AXIS = 1e-15  # 1 - cosine of the angle between two axes
GREAT = "great_circle"


@dataclass(frozen=True, slots=True)
class Stand:
    """The tool standing between two lines: tip and axis in the table frame."""

    joints: Joints
    tip: Vector
    axis: Vector
    rotaries: Rotaries
    length_mm: float

    @staticmethod
    def at(joints: Joints, length_mm: float, kinematics: Kinematics) -> Stand:
        tip, axis = kinematics.forward(joints, length_mm)
        return Stand(joints, tip, axis, rotaries_of(joints, kinematics), length_mm)


def tip_of(block: TipLine, here: Vector) -> Vector:
    """Where a block sends the tip that is ``here``, both in the part frame."""
    x, y, z = block.tip
    a, b, c = here
    if block.relative:
        return a + (x or 0.0), b + (y or 0.0), c + (z or 0.0)
    return a if x is None else x, b if y is None else y, c if z is None else z


def rotaries_to(block: TipLine, now: Rotaries) -> Rotaries:
    """Where a block under G43.4 sends the rotaries."""
    a, b = block.rotaries
    first, second = now
    if block.relative:
        return first + (a or 0.0), second + (b or 0.0)
    return first if a is None else a, second if b is None else b


def exact(block: TipLine, stand: Stand, context: Context) -> tuple[list[Segment], Stand]:
    """The exact segments of a G1, a swivel at the pole before it if it needs one, and where it ends."""
    part = block.modal.frame(context.machine)
    tip = part.to_parent(tip_of(block, part.from_parent(stand.tip)))
    if block.axis is None:
        rotaries = rotaries_to(block, stand.rotaries)
        return _to_rotaries(block, stand, tip, rotaries, context)
    axis = part.turn(unit(block.axis))
    try:
        circles = circle(stand.axis, axis)
        found = follow(circles, stand.rotaries, context.kinematics)
    except AxisLost as lost:
        refuse_lost(lost, block.place, context)
    begin, end = _pair(found.rotaries[0]), _pair(found.rotaries[-1])
    segments = []
    swivel = turn(block, stand, begin, context.kinematics)
    if swivel is not None:
        segments.append(swivel)
        stand = Stand(swivel.end, stand.tip, stand.axis, begin, stand.length_mm)
    line = great_line(stand, tip, circles, end)
    if line is not None:
        segments.append(segment_of(block, line, stand.joints, context.kinematics))
        stand = Stand(segments[-1].end, tip, axis, end, stand.length_mm)
    return segments, stand


def refuse_lost(lost: AxisLost, place: Place, context: Context) -> NoReturn:
    context.refuse(place, message("reach.on_line", reason=Key(lost.reason)))


def _to_rotaries(
    block: TipLine, stand: Stand, tip: Vector, rotaries: Rotaries, context: Context
) -> tuple[list[Segment], Stand]:
    axis = axis_of(rotaries, context.kinematics)
    circles = great_circle(stand, axis, rotaries, context)
    if circles is None:
        line = even_line(stand.tip, tip, stand.rotaries, rotaries, stand.length_mm)
    else:
        line = great_line(stand, tip, circles, rotaries)
    if line is None:
        return [], stand
    segment = segment_of(block, line, stand.joints, context.kinematics)
    return [segment], Stand(segment.end, tip, axis, rotaries, stand.length_mm)


def axis_of(rotaries: Rotaries, kinematics: Kinematics) -> Vector:
    """Tool axis in the table frame."""
    return kinematics.tool_axis(rotaries)


def circle(a: Vector, b: Vector) -> GreatCircles:
    return GreatCircles.of(np.array([a, b]))


def great_circle(stand: Stand, axis: Vector, rotaries: Rotaries, context: Context) -> GreatCircles | None:
    """The great circle to ``axis`` if it leads to just these rotaries; None: they turn evenly.

    It does not where a program turns a rotary the long way round, by whole turns, or at the pole.
    """
    if context.machine.tool_lines != GREAT or dot(stand.axis, axis) > 1.0 - SAME_AXIS:
        return None
    try:
        circles = circle(stand.axis, axis)
        if _leads_there(stand, axis, rotaries, context.kinematics):
            return circles
        found = follow(circles, stand.rotaries, context.kinematics)
    except AxisLost:
        return None
    ends = np.abs(found.rotaries[[0, -1]] - np.array([stand.rotaries, rotaries])).max()
    return circles if ends < SAME_ROTARY_RAD else None


def _leads_there(stand: Stand, axis: Vector, rotaries: Rotaries, kinematics: Kinematics) -> bool:
    """Whether a short turn surely leads to ``rotaries``: clear of poles and of the end of reach.

    The other branch is half a turn away there.
    """
    turned = max(abs(a - b) for a, b in zip(rotaries, stand.rotaries, strict=True))
    if kinematics.is_bounded or turned > LITTLE_RAD or dot(stand.axis, axis) < LITTLE_COSINE:
        return False
    return kinematics.is_clear_of_pole(stand.axis) and kinematics.is_clear_of_pole(axis)


def even_line(
    start: Vector, end: Vector, first: Rotaries, last: Rotaries, length_mm: float
) -> ToolLine | None:
    """A line with rotaries turning evenly; None where nothing moves."""
    turned = math.degrees(math.hypot(last[0] - first[0], last[1] - first[1]))
    size = measure(norm(subtract(end, start)), turned)
    if size < ROUNDING:
        return None
    way = subtract(end, start)
    return ToolLine(start, way, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), 0.0, first, last, True, length_mm, size)


def great_line(stand: Stand, tip: Vector, circles: GreatCircles, last: Rotaries) -> ToolLine | None:
    """A line with the axis on a great circle; None where nothing moves."""
    first, angle = stand.rotaries, float(circles.angle[0])
    way = subtract(tip, stand.tip)
    turned = math.degrees(max(angle, abs(last[0] - first[0]), abs(last[1] - first[1])))
    size = measure(norm(way), turned)
    if norm(way) < STANDS_MM:
        size = math.degrees(angle)
    if size < ROUNDING:
        return None
    axis, across = vector(circles.axis[0]), vector(circles.across[0])
    return ToolLine(stand.tip, way, axis, across, angle, first, last, False, stand.length_mm, size)


def measure(tip_mm: float, turned_deg: float) -> float:
    """Length of a line in the unit of s, see ``motions.DEG_PER_MM``."""
    return turned_deg if tip_mm < STANDS_MM else max(tip_mm, turned_deg / DEG_PER_MM)


def turn(block: TipLine, stand: Stand, rotaries: Rotaries, kinematics: Kinematics) -> Segment | None:
    """At the pole the work's rotary turns under the standing tool, to where the next line begins."""
    if max(abs(a - b) for a, b in zip(rotaries, stand.rotaries, strict=True)) < SAME_ROTARY_RAD:
        return None
    line = even_line(stand.tip, stand.tip, stand.rotaries, rotaries, stand.length_mm)
    return None if line is None else segment_of(block, line, stand.joints, kinematics, "swivel")


def segment_of(
    block: TipLine, line: ToolLine, start: Joints, kinematics: Kinematics, name: str = "line"
) -> Segment:
    """A tool line with the block's feed: of the tip, or of the turn where the tip stands."""
    xyz = kinematics.linear(add(line.tip, line.way), line.end_rotaries, line.length_mm)
    end = joints_of(xyz, line.end_rotaries, kinematics)
    stands = norm(line.way) < STANDS_MM
    feed = block.feed_deg_s if stands else block.feed_mm_s
    if block.time_s is not None:
        feed = line.end / block.time_s * line.tip_rate
    return Segment(line, block.place, feed, False, start, end, True, name)


# ---- rapids ----------------------------------------------------------------------


def rapid(
    block: TipLine, stand: Stand, following: Sequence[TipLine], wanted: Rotaries | None, context: Context
) -> tuple[Segment | None, Stand]:
    """G0: the joints go straight to where the tip and axis are wanted.

    Under G43.5 the branch and turns are chosen here: ``wanted``, or the least rotary travel
    of the move with the lines ``following`` it, inside the travel of all joints.
    """
    part = block.modal.frame(context.machine)
    tip = part.to_parent(tip_of(block, part.from_parent(stand.tip)))
    if block.axis is None:
        rotaries = rotaries_to(block, stand.rotaries)
        axis = axis_of(rotaries, context.kinematics)
    else:
        axis = part.turn(unit(block.axis))
        rotaries = _chosen(block, stand, tip, axis, following, wanted, context)
    end = joints_of(context.kinematics.linear(tip, rotaries, stand.length_mm), rotaries, context.kinematics)
    segment = straight("line", block.place, stand.joints, end, None, context.kinematics)
    return segment, Stand(end, tip, axis, rotaries, stand.length_mm)


def _chosen(
    block: TipLine,
    stand: Stand,
    tip: Vector,
    axis: Vector,
    following: Sequence[TipLine],
    wanted: Rotaries | None,
    context: Context,
) -> Rotaries:
    if wanted is not None:
        return wanted
    tips, axes = _row_ahead(block, tip, axis, following, context.machine)
    ways = _ways(axes, stand.rotaries, context.kinematics)
    if not ways:
        context.refuse(block.place, message("reach.tilt", reason=Key(context.kinematics.unreached)))
    ways = [shifted for way in ways for shifted in _in_turns(way, stand.rotaries, context.machine)]
    ways.sort(key=lambda way: _travel(way, stand.rotaries))
    for way in ways:
        if _inside(way, tips, stand.length_mm, context):
            return _pair(way.rotaries[0])
    return _pair(ways[0].rotaries[0])  # the audit of what comes says what is outside


def _row_ahead(
    block: TipLine, tip: Vector, axis: Vector, following: Sequence[TipLine], machine: Machine
) -> tuple[Array, Array]:
    """Tips and axes from the end of the rapid on, table frame, as long as lines with one offset follow."""
    part = block.modal.frame(machine)
    here, tips, axes = part.from_parent(tip), [tip], [axis]
    for after in following[:AHEAD_LINES]:
        here = tip_of(after, here)
        tips.append(part.to_parent(here))
        axes.append(axes[-1] if after.axis is None else part.turn(unit(after.axis)))
    # At the pole a free rotary is best where the first line that leaves it wants it.
    first = next((i for i, other in enumerate(axes) if dot(axis, other) < 1.0 - SAME_AXIS), 1) - 1
    tips, axes = tips[first:], axes[first:]
    if len(axes) == 1:
        tips, axes = tips * 2, axes * 2
    return np.array(tips), np.array(axes)


def _ways(axes: Array, near: Rotaries, kinematics: Kinematics) -> list[Followed]:
    """The row on both branches, in the turns nearest ``near``; what cannot be followed is looked at later."""
    pairs = kinematics.branches(vector(axes[0]), math, None, near)
    starts = [pair for pair in pairs if not any(map(math.isnan, pair))]
    found = []
    for start in starts:
        place = [
            q + 2.0 * math.pi * round((n - q) / (2.0 * math.pi)) for q, n in zip(start, near, strict=True)
        ]
        begin = (place[0], place[1])
        for row in (axes, axes[[0, 0]]):
            try:
                found.append(follow(GreatCircles.of(row), begin, kinematics))
                break
            except AxisLost:
                continue
    return found


def _in_turns(way: Followed, near: Rotaries, machine: Machine) -> list[Followed]:
    """The same way in each whole turn, of those that matter, in which the rotaries stay inside travel."""
    options: list[list[int]] = []
    for k, (least, most) in enumerate(machine.turns()):
        q = way.rotaries[:, k]
        first = math.ceil((least - float(q.min()) - 1e-9) / (2.0 * math.pi))
        last = math.floor((most - float(q.max()) + 1e-9) / (2.0 * math.pi))
        nearest = (near[k] - float(q[0])) / (2.0 * math.pi)
        around = {math.floor(nearest), math.ceil(nearest)}
        options.append(sorted({min(max(n, first), last) for n in around}) if first <= last else [0])
    turned = [(i, j) for i in options[0] for j in options[1]]
    return [
        Followed(way.line, way.share, way.rotaries + 2.0 * math.pi * np.array(turns, dtype=float), way.sine)
        for turns in turned
    ]


def _travel(way: Followed, near: Rotaries) -> tuple[float, float]:
    approach = np.abs(way.rotaries[0] - np.array(near)).sum()
    return round(float(approach + np.abs(np.diff(way.rotaries, axis=0)).sum()), 9), float(
        np.abs(way.rotaries).max()
    )


def _inside(way: Followed, tips: Array, length_mm: float, context: Context) -> bool:
    tip = tips[way.line] + way.share[:, None] * (tips[way.line + 1] - tips[way.line])
    a, b = way.rotaries.T
    xyz = context.kinematics.linear((tip[:, 0], tip[:, 1], tip[:, 2]), (a, b), length_mm, np)
    values = (*xyz, a, b)
    joints = np.stack(context.kinematics.arrange(values), axis=1)
    return all(
        axis.travel_min - ROUNDING <= q.min() and q.max() <= axis.travel_max + ROUNDING
        for axis, q in zip(context.machine.axes, joints.T, strict=True)
    )


def _pair(row: Array) -> Rotaries:
    return float(row[0]), float(row[1])


def vector(row: Array) -> Vector:
    return float(row[0]), float(row[1]), float(row[2])


def vectors(blocks: Sequence[TipLine], frame: Array) -> Array:
    """Their tool vectors in the table frame (n, 3), of unit length; Z of the part where none is given."""
    found = np.array([block.axis or (0.0, 0.0, 1.0) for block in blocks]) @ frame
    return np.asarray(found / np.sqrt((found * found).sum(axis=1))[:, None])


# ---- running through ---------------------------------------------------------------

END_SHARE = 1e-4  # share of a line over which its rates at an end are measured


def runs_through(before: Segment, after: Segment, context: Context) -> bool:
    """Whether two exact motions need no stop between them: rates of tool lines may jump a little a tick."""
    if moves.runs_through(before, after):
        return True
    if not isinstance(before.motion, ToolLine) or not isinstance(after.motion, ToolLine):
        return False
    if before.feed_mm_s is None or after.feed_mm_s is None:
        return False
    rates = [_rates(s, at_end, context.kinematics) for s, at_end in ((before, True), (after, False))]
    speeds = [s.feed_mm_s / s.motion.tip_rate for s in (before, after)]  # type: ignore[union-attr,operator]
    jump = np.abs(np.subtract(rates[1], rates[0]))[None]
    return bool(slight(jump, np.array([min(speeds)]), context.machine)[0])


def slight(jump: Array, speed: Array, machine: Machine) -> npt.NDArray[np.bool_]:
    """Of jumps of the joints' rates (N, axes): whether they may be passed at a share of ``speed`` (N,)."""
    T, limits = machine.period_s, [axis.limits for axis in machine.axes]
    step = np.array([min(limit.acceleration * T, limit.jerk * T**2) for limit in limits])
    return np.asarray((jump * (speed * STOP_SHARE)[:, None] <= JUMP_SHARE * step).all(axis=1))


def _rates(segment: Segment, at_end: bool, kinematics: Kinematics) -> list[float]:
    """Joints per unit of s at one end of a line."""
    end = segment.motion.end
    joints = segment.end if at_end else segment.start
    s = end * (1.0 - END_SHARE) if at_end else end * END_SHARE
    inner = segment.motion.joints(s, rotaries_of(joints, kinematics), kinematics) or joints
    sign = 1.0 if at_end else -1.0
    return [sign * (q - p) / (end * END_SHARE) for p, q in zip(inner, joints, strict=True)]
