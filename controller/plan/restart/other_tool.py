r"""Another tool than the one that has cut a program up to a place: what it would cut deeper, before it moves.

      before        after
      |    |       |      |      Of lines nobody knows on which side the part is. What they leave standing is
      |    |       |      |      all that the tool which cut them was not in. So with the tips at one place a
      |    |        \    /       tool that reaches out of that one nowhere may go wherever the lines go, and
       \__/          \__/        come to them along its own axis; one that does would cut as much deeper.

G41 and G42 with D lead a thicker tool further off, so that there the shape alone counts: corner, taper, shank
and holder. Surfaces are placed for each tool, and are walls of their own (``surfaces.walls``).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from controller.geometry.arrays import Array, rows
from controller.geometry.vectors import ROUNDING, Pose, dot, subtract
from controller.machine.model import Joints, Machine, Tool
from controller.machine.tool_profile import flank, radii
from controller.messages import Message, message
from controller.plan.path.path import PathBuilder
from controller.plan.restart.reentry import NotPossible
from controller.plan.restart.restart import Rest, Source
from controller.plan.rotaries.branch import joints_along
from controller.plan.segment import Segment
from controller.program.program import Block, JointArc, JointCurve, JointLine, JointMotion, Modal, TipLine

DEEPER_MM = 0.01  # by which another tool may cut deeper than the one before
SAMPLES = 400  # heights at which two tools are compared
EDGE_MM = 1e-6  # beside the ends of a holder's cylinders


class Overhang(NamedTuple):
    """How far a tool reaches out of another one, their tips at one place."""

    by_mm: float
    above_mm: float  # its lowest height above the tip


def overhang(before: Tool, after: Tool, top_mm: float, off_mm: float = 0.0) -> Overhang | None:
    """How far ``after`` reaches out of ``before`` below ``top_mm`` above the tips; None where it does not.

    ``off_mm``: its path is so much further off what it cuts.
    """
    tools = before, after
    ends = [h for tool in tools for low, high, _ in tool.holder for h in (low, high)]
    highest = max(*ends, *(tool.flute_mm for tool in tools), 0.0)  # alike above
    least = max(flank(tool).begins_mm for tool in tools)
    heights = np.linspace(0.0, max(min(top_mm, highest + 1.0), least, EDGE_MM), SAMPLES)
    heights = np.unique(np.r_[heights, [h + d for h in ends for d in (-EDGE_MM, EDGE_MM) if h < top_mm]])
    out = radii(after, heights) - radii(before, heights) - off_mm
    wide = out > DEEPER_MM
    return Overhang(float(out.max()), float(heights[wide][0])) if wide.any() else None


def see_fits(now: Joints, held: Joints, before: Tool, after: Tool, rest: Rest) -> None:
    """Raises NotPossible where another tool cannot come back from ``now``, or would cut lines too deep.

    It stands no higher than the place of the hold for being longer; or it reaches out of the tool before it,
    and what lines have left beside it nobody knows.
    """
    target, kinematics = rest.target, rest.source.kinematics
    tip, axis = kinematics.forward(now, after.length_mm)
    longer = after.length_mm - before.length_mm
    off_mm = dot(subtract(tip, kinematics.forward(held, before.length_mm).tip), axis)
    if longer > 0.0 and off_mm <= 0.0:
        raise NotPossible(message("aside.longer", longer=longer, off=off_mm + longer))
    see_cuts_no_deeper(before, after, rest, now)
    if target.is_surface:
        return
    high_mm = dot(subtract(tip, kinematics.forward(target.joints, after.length_mm).tip), axis)
    low_mm = _top(rest) - high_mm
    if low_mm > ROUNDING and overhang(before, after, low_mm) is not None:
        raise NotPossible(message("aside.low", low=low_mm))


def see_cuts_no_deeper(before: Tool, after: Tool, rest: Rest, now: Joints) -> None:
    """Raises NotPossible where a line that is left would be cut deeper than with the tool before, or where
    the tool may stand in a wall before it goes there from ``now``.
    """
    longer, thicker = after.length_mm - before.length_mm, after.radius_mm - before.radius_mm
    if longer <= DEEPER_MM and all(overhang(before, after, math.inf, off) is None for off in (0.0, thicker)):
        return
    beside = 0  # a line that G41 or G42 leads
    fits_to = dict[float, float]()  # by how far off its path is: so high nothing reaches out
    for block, lower_mm in _cut_lines(rest):
        follows = block.modal.tilted or abs(block.modal.length_mm - after.length_mm) < DEEPER_MM
        if longer > DEEPER_MM and not follows:
            why = message(
                "aside.not_lengthened", longer=longer, line=block.place.line, length=before.length_mm
            )
            raise NotPossible(why)
        off_mm = thicker if block.modal.compensated else 0.0
        beside = beside or (block.place.line if block.modal.compensated else 0)
        top_mm = _top(rest) + lower_mm
        if top_mm <= fits_to.get(off_mm, -math.inf):
            continue
        if (found := overhang(before, after, top_mm, off_mm)) is not None:
            raise NotPossible(_deeper(found, before, after, block))
        fits_to[off_mm] = top_mm
    if beside and thicker > DEEPER_MM:
        pose = rest.source.kinematics.forward(now, after.length_mm)
        hit, standing = cut_deeper(rest.source, after, thicker, DEEPER_MM, pose)
        if hit is not None:
            raise NotPossible(message("aside.contour", tool=after.number, by=hit.depth_mm, line=hit.line))
        if standing is not None:
            where = {"tool": after.number, "by": standing.depth_mm, "line": standing.line}
            raise NotPossible(message("aside.stands_beside", **where))


def _deeper(out: Overhang, before: Tool, after: Tool, block: Block) -> Message:
    line, tool = block.place.line, after.number
    if out.above_mm >= after.flute_mm:
        return message("aside.holder", tool=tool, by=out.by_mm, above=out.above_mm, line=line)
    thicker = after.radius_mm - before.radius_mm
    if thicker > DEEPER_MM and not block.modal.compensated:
        return message("aside.thicker", by=thicker, radius=before.radius_mm, line=line)
    return message("aside.shape", tool=tool, by=out.by_mm, above=out.above_mm, line=line)


def _top(rest: Rest) -> float:
    """How far (mm) the highest that the program has cut up to a place is above the tip there."""
    return max(0.0, rest.target.clear_mm - rest.source.machine.clearance_mm)


# ---- the lines that are left ---------------------------------------------------------

Line = JointLine | TipLine | JointArc | JointCurve


def _cut_lines(rest: Rest) -> Iterator[tuple[Line, float]]:
    """Lines at feed from the place on that cut, up to the next change of the tool, in their order.

    With each how far (mm) it leads below the place; infinite where nobody knows.

    One that only leads down along Z cuts where no line that G41 or G42 leads comes after it: else it is
    the way down beside the part. What leads up, and off a contour at its end, cuts nothing.
    """
    machine, tool = rest.source.machine, rest.target.modal.tool
    down: tuple[Line, float] | None = None  # along Z, of which it is not known yet what comes behind it
    beside, z, frame = False, math.inf, rest.target.modal.part
    place_z: float | None = None  # of the place; not a number where nobody knows
    for block in rest.source.again():
        left = block.place.order >= rest.order
        if left and block.modal.tool != tool:
            break
        if not isinstance(block, Line):
            continue
        fed = left and _is_fed(block)
        z, before = _height(block, z, machine), z
        if left and place_z is None:
            place_z = before + rest.spot.fraction * (z - before)
        lower_mm = (place_z or 0.0) - min(z, before)
        made = block, lower_mm if math.isfinite(lower_mm) and block.modal.part == frame else math.inf
        if not _goes_across(block, machine):
            if fed and z < before:
                down = down or made
            continue
        compensated = block.modal.compensated
        leads_off, beside = beside and not compensated, compensated
        if down is not None and not (fed and compensated):
            yield down
        down = None
        if fed and not leads_off:
            yield made
    if down is not None:
        yield down


def _is_fed(block: Line) -> bool:
    if getattr(block, "probe", None) is not None:
        return False
    return block.feed_mm_s is not None or block.feed_deg_s is not None


def _goes_across(block: Line, machine: Machine) -> bool:
    """Whether it moves by more than Z alone."""
    if isinstance(block, JointLine):
        z = machine.linear()[2]
        return any(word is not None for i, word in enumerate(block.targets) if i != z)
    if isinstance(block, TipLine):
        words = (*block.tip[:2], *block.rotaries)
        return block.axis is not None or any(word is not None for word in words)
    return True


def _height(block: Line, z: float, machine: Machine) -> float:
    """Z after a block, as its words have it, and ``z`` before."""
    if isinstance(block, TipLine):
        word = block.tip[2]
    elif isinstance(block, JointLine) and block.machine_frame:
        return math.inf
    else:
        word = block.targets[machine.linear()[2]]
    if word is None:
        return z
    return z + word if block.relative else word


# ---- walls that lines under G41 or G42 leave -------------------------------------------
#
#             ___________________________     the wall of another contour
#        new  . . . . . . . . . . . . . .     a tool that is thicker goes further off its own wall,
#        old  - - - - - - - - - - - - - -     and may reach into another that the one before was clear of
#             ---------------------------     the wall of this one
#
# A wall is a row of points of the programmed contour at the levels at which the program cuts. A point stands
# that the tool before does not reach anywhere. Contours are compared with those of the same tool axis.
# How high the part is beside them nobody says: no higher than where the program begins to go down at feed.


SPACING_MM = 0.3  # of samples along lines
LEVEL_MM = 0.05  # heights that are one level
MAX_LEVELS = 40
SAME_AXIS = 1e-4  # of unit vectors


class Deeper(NamedTuple):
    """How deep a tool gets into what stands, and along which line."""

    depth_mm: float
    line: int


class Samples(NamedTuple):
    """Places of the tip at feed: ``beside`` (N,) signed millimetres to the left of the contour, 0 off it."""

    tips: Array  # (N, 3), table frame
    axes: Array  # (N, 3)
    left: Array  # (N, 3) unit vectors to the left of the way
    beside: Array
    lines: Array  # of the program


class Found(NamedTuple):
    """Of the whole way, and where the tool stands before it."""

    on_the_way: Deeper | None
    standing: Deeper | None


def cut_deeper(source: Source, tool: Tool, thicker_mm: float, deeper_mm: float, now: Pose) -> Found:
    """How deep (mm) the tool of a source reaches into a wall that one thinner by ``thicker_mm`` leaves
    standing, and along which line; None where it does not by ``deeper_mm``. Raises ProgramError.

    ``now``: its pose (mm, table frame) before it moves.
    """
    made = [_along(segment, beside, source, tool.length_mm) for segment, beside in _fed(source, tool.number)]
    if not made:
        return Found(None, None)
    fed = Samples(*(np.concatenate(parts) for parts in zip(*made, strict=True)))
    worst = standing = Deeper(0.0, 0)
    for axis in np.unique(np.round(fed.axes / SAME_AXIS), axis=0) * SAME_AXIS:
        here = np.abs(fed.axes - axis).max(axis=1) < 2.0 * SAME_AXIS
        one = Samples(*(part[here] for part in fed))
        tip = np.asarray(now.tip) if np.abs(now.axis - axis).max() < 2.0 * SAME_AXIS else None
        found = _deepest(one, axis, tool.radius_mm, thicker_mm, deeper_mm, tip)
        worst, standing = max(worst, found[0]), max(standing, found[1])
    return Found(*(one if one.depth_mm > deeper_mm else None for one in (worst, standing)))


def _deepest(
    fed: Samples, axis: Array, radius: float, thicker_mm: float, deeper_mm: float, tip: Array | None
) -> tuple[Deeper, Deeper]:
    """Of samples with one tool axis: on the way, and with the tip where it is before; None: another axis."""
    from scipy.spatial import cKDTree  # its package takes long to load, and few need it

    axis = axis / np.linalg.norm(axis)
    plane = np.linalg.svd(axis[None])[2][1:]
    high, beside = fed.tips @ axis, fed.beside
    contour = np.flatnonzero(beside)
    worst = standing = Deeper(0.0, 0)
    if not len(contour):
        return worst, standing
    walls = (fed.tips - beside[:, None] * fed.left)[contour] @ plane.T
    before = (fed.tips - (np.sign(beside) * thicker_mm)[:, None] * fed.left) @ plane.T
    after = fed.tips @ plane.T
    levels = np.unique(np.round(high[contour] / LEVEL_MM))
    levels = levels[np.linspace(0, len(levels) - 1, min(len(levels), MAX_LEVELS)).astype(int)] * LEVEL_MM
    is_low = tip is not None and float(tip @ axis) < float(high.max())
    for level in levels:
        low = high <= level + LEVEL_MM
        points = walls[high[contour] <= level + LEVEL_MM]
        stands = cKDTree(before[low]).query(points)[0] >= radius - thicker_mm - deeper_mm
        if stands.any():
            off, nearest = cKDTree(after[low]).query(points[stands])
            k = int(off.argmin())
            worst = max(worst, Deeper(radius - float(off[k]), int(fed.lines[low][nearest[k]])))
            if is_low:
                away = np.linalg.norm(points[stands] - plane @ tip, axis=1)
                k = int(away.argmin())
                line = int(fed.lines[contour][high[contour] <= level + LEVEL_MM][stands][k])
                standing = max(standing, Deeper(radius - float(away[k]), line))
    return worst, standing


def _fed(source: Source, tool: int) -> Iterator[tuple[Segment, float]]:
    """Motions at feed with that tool, and how far beside the contour they are; of none of its leads."""
    modals = dict[int, Modal]()

    def read() -> Iterator[Block]:
        for block in source.again():
            if isinstance(block, JointMotion):
                modals[block.place.order] = block.modal
            yield block

    machine = source.machine
    tracer = PathBuilder(source.name, machine, source.kinematics, source.start, source.chosen or {})
    before = 0
    for item in tracer.items(read()):
        for segment in item.segments:
            modal = modals.get(segment.order_at(segment.motion.end))
            if modal is None or modal.tool != tool or segment.feed_mm_s is None:
                before = 0
                continue
            leads_in = modal.beside_mm != 0.0 and before in (0, segment.place.order)
            before = (segment.place.order if leads_in else -1) if modal.beside_mm else 0
            yield segment, 0.0 if leads_in else modal.beside_mm


def _along(segment: Segment, beside_mm: float, source: Source, length_mm: float) -> Samples:
    count = 2 + math.ceil(segment.motion.end / SPACING_MM)
    s = np.linspace(0.0, segment.motion.end, count)
    joints = joints_along(segment, s, source.kinematics)
    pose = source.kinematics.forward(tuple(joints.T), length_mm, np)
    tips, axes = (rows(vector, (count,)).T for vector in pose)
    left = np.cross(axes, np.gradient(tips, axis=0))
    size = np.linalg.norm(left, axis=1, keepdims=True)
    left = np.where(size > 0.0, left / np.where(size > 0.0, size, 1.0), 0.0)
    lines = np.array([segment.line_at(one) for one in s.tolist()])
    return Samples(tips, axes, left, np.full(count, beside_mm), lines)
