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

from controller.geometry.vectors import ROUNDING, dot, subtract
from controller.machine.model import Joints, Machine, Tool
from controller.machine.tool_profile import flank, radii
from controller.messages import Message, message
from controller.plan.restart import contours
from controller.plan.restart.reentry import NotPossible
from controller.plan.restart.restart import Rest
from controller.program.program import Block, JointArc, JointCurve, JointLine, TipLine

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
        hit, standing = contours.cut_deeper(rest.source, after, thicker, DEEPER_MM, pose)
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
