"""Cuts that run through: which blocks join, and on which branch and turns all of them are cut.

A train is a row of blocks between one approach and one departure. Inside it the
rotaries have no choice: they follow the tool axis. The choice is made once, at its
start, for all of it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from enum import Enum
from typing import Any, NamedTuple

from controller.messages import Key, Message, chain, message
from controller.motion.motions import Rotaries
from controller.plan.context import Context
from controller.plan.rotaries import winding
from controller.plan.rotaries.turns import SAME_ROTARY_RAD
from controller.plan.surfaces import audit, blending, blends, passing, unwind
from controller.plan.surfaces.cuts import SAME_RAD, Cut, apart, turn, turned, turned_axis
from controller.plan.surfaces.legs import CutSegment, Fields, options, timed

SAME_MM = 2e-6  # rounding of six decimals, in three words
FLAT_MM = 1e-4  # a concave corner that costs less overcut than this is rounding of the program
TURNED_BACK_RAD = math.pi - 1e-6
CREASE_DEG = 0.01  # of the normals along a ruling: less is not told


class Meeting(Enum):
    """How one cut follows another."""

    JOIN = "joins"
    PIVOT = "pivots"
    APART = "apart"


class Met(NamedTuple):
    """How two cuts meet, told of the first one, and both as they are cut: a blend changes them."""

    meeting: Meeting
    told: Message
    before: Cut
    after: Cut


def meet(before: Cut, after: Cut, context: Context) -> Met:
    """Whether two blocks run through, pivot or need a departure; refuses a concave corner."""
    met = _met(before, after, context)
    name = message("join.block", line=before.block.place.line)
    if before.block is after.block:
        if met.meeting is Meeting.JOIN:
            return met
        name = message("join.own_part", u=after.part[0])
    told = Message(key=met.told["key"], values={**met.told["values"], "name": name})
    context.tell(after.block.place, told)
    return met


def _met(before: Cut, after: Cut, context: Context) -> Met:
    a, b = before.block.modal, after.block.modal
    differ = [
        Key(key)
        for key, same in (
            ("join.other_tool", a.tool == b.tool),
            ("join.other_offset", a.offset == b.offset),
            ("join.other_side", a.side == b.side),
        )
        if not same
    ]
    if differ:
        return Met(Meeting.APART, message("join.differs", what=chain("and", differ)), before, after)
    end, start = before.end, after.start
    gap, tilt = apart(end.contact, start.contact), apart(end.ruling, start.ruling)
    shared = tilt <= SAME_RAD and gap <= SAME_MM
    agree = shared and apart(end.tip, start.tip) <= SAME_MM and apart(end.axis, start.axis) <= SAME_RAD
    allowed = blending.tolerance(before, after, context.machine)
    joint = None
    may_blend = allowed.creases or not shared or blending.is_rounding(before, after, allowed)
    if may_blend and (not agree or _to_be_blended(before, after, allowed, context)):
        joint = blending.joined(before, after, allowed, context)
    if joint is not None:
        return Met(Meeting.JOIN, _blended(joint, allowed), joint.before, joint.after)
    if agree:
        slowed = _slowed_at_kink(before, after, context)
        return Met(Meeting.JOIN, message("join.agrees", slowed=slowed), before, after)
    if shared:
        return Met(*_corner(before, after, allowed, context), before, after)
    told = message("join.elsewhere", gap=gap, tilt=math.degrees(tilt), allowed=_tolerance_message(allowed))
    return Met(Meeting.APART, told, before, after)


def _to_be_blended(before: Cut, after: Cut, allowed: blending.Tolerance, context: Context) -> bool:
    """Of two cuts whose poses agree: whether their rates differ by rounding, or so that it leaves a mark."""
    if before.block is after.block:  # its parts are meant as they are, to the last derivative
        return False
    found = blending.difference(before, after, allowed)
    if found is blending.Difference.KINK:
        return passing.at_kink((before, after), context) is not None
    return found is blending.Difference.ROUNDING


def _blended(joint: blending.Joint, allowed: blending.Tolerance) -> Message:
    return message(
        "join.blended",
        degrees=math.degrees(joint.angle_rad),
        gap=joint.gap_mm,
        reach=joint.reach_mm,
        um=1000.0 * joint.deviates_mm,
        slowed=_slowed(joint, allowed),
    )


def _slowed(joint: blending.Joint, allowed: blending.Tolerance) -> Message | str:
    """What a blend costs that the tolerance or the length of the cuts keeps short: a sentence, or nothing."""
    told = joint.slowed
    if told is None:
        return ""
    binds, crease = _binding(told), _crease(joint.crease_rad)
    if not joint.axis_too:
        return message("join.slowed_at_pole", **binds)
    key = "join.slowed" if joint.shortened else "join.slowed_between_short_cuts"
    return message(key, crease=crease, mm=allowed.mm, **binds)


def _slowed_at_kink(before: Cut, after: Cut, context: Context) -> Message | str:
    """What it costs to run through exactly where the rates of the pose jump: a sentence, or nothing."""
    if before.block is after.block:
        return ""
    slowest = passing.at_kink((before, after), context)
    if slowest is None:
        return ""
    crease = _crease(blending.crease(before.motion, after.motion))
    return message("join.slowed_at_kink", crease=crease, **_binding(slowest))


def _binding(slowest: passing.Slowest) -> dict[str, Any]:
    return {"feed": 60.0 * slowest.mm_s, "axis": slowest.axis, "limit": Key(f"limit.{slowest.limit}")}


def _crease(angle_rad: float) -> Message | str:
    along = math.degrees(angle_rad)
    return message("join.crease", along=along) if along > CREASE_DEG else ""


def _tolerance_message(allowed: blending.Tolerance) -> Message:
    return message("join.tolerance", mm=allowed.mm, degrees=math.degrees(allowed.rad))


def _corner(
    before: Cut, after: Cut, allowed: blending.Tolerance, context: Context
) -> tuple[Meeting, Message]:
    """Ends meet on one ruling, the normals differ.

    With the cutter on the right a turn to the left leads it round the outside of the
    edge (convex), a turn to the right into a corner; on the left, the other way about. In a corner the
    cutter turns back to its next place, and gets into both surfaces: as far as the joint tolerance lets it.
    """
    angle = turned(before.end, after.start)
    radius, degrees = after.tool.radius_mm, math.degrees(abs(angle))
    if abs(angle) > TURNED_BACK_RAD:
        return Meeting.APART, message("join.turns_back")
    hollow: Message | str = ""
    least = radius * (1.0 - math.cos(angle)) if after.side * angle < 0.0 else 0.0
    if least > FLAT_MM or (least and allowed is not blending.EXACT):
        overcut = max(least, blends.overcut(before.motion, after.motion, angle))
        if least > FLAT_MM and (allowed is blending.EXACT or overcut > allowed.mm):
            figures = {"degrees": degrees, "radius": radius, "overcut": overcut}
            where = _where(before, after)
            told = message("join.concave", where=where, allowed=_tolerance_message(allowed), **figures)
            context.refuse(after.block.place, told)
        hollow = message("join.hollow", um=1000.0 * overcut) if overcut > FLAT_MM else ""
    tilt = math.degrees(apart(turned_axis(before.end, angle), after.start.axis))
    tilts = message("join.tilts", tilt=tilt) if tilt > 1e-6 else ""
    crease = _crease(blending.crease(before.motion, after.motion))
    whole = {"tilts": tilts, "reaches": _reached(before, after), "hollow": hollow, "crease": crease}
    return Meeting.PIVOT, message("join.pivots", degrees=degrees, **whole)


def _reached(before: Cut, after: Cut) -> Message | str:
    """What a turn between two placements costs the surfaces that meet there."""
    way = turn(before, after)
    if way is None:
        return ""
    return message("join.reaches", depth=audit.depth_in_turn(way, before, after))


def _where(before: Cut, after: Cut) -> Message:
    if before.block is after.block:
        return message("join.parts_meet", u=after.part[0])
    return message("join.blocks_meet", line=before.block.place.line)


def choose(
    cuts: Sequence[Cut],
    context: Context,
    now: Rotaries,
    wanted: Rotaries | None = None,
    within_rad: float = SAME_ROTARY_RAD,
) -> list[CutSegment]:
    """The legs of a train from the rotaries ``wanted``, which were chosen over the whole program.

    Without them, or where they do not fit, for the train alone: the branch on which its cuts are faster,
    then least rotary travel with its approach from ``now``, then positive tilt, then smaller abs(rotary),
    then positive rotary (DESIGN section 1); of these the first that keeps all joints in travel.
    """
    fields = Fields(cuts, context.kinematics)
    if wanted is not None:
        for option in options(fields, context, wanted):
            for by in option.way.shifts(context.machine, wanted):
                if (
                    option.way.inside
                    and winding.apart(winding.moved(option.way.start, by), wanted) < within_rad
                ):
                    return option.shifted(context.machine, by)
    found = timed(options(fields, context, now), context)
    fitting = [(o, by) for o in found if o.way.inside for by in o.way.shifts(context.machine, now)]
    if not fitting:
        unwind.refuse(options(fields, context, now, whole=True), context, now)
    option, by = min(fitting, key=lambda pair: pair[0].way.rank(pair[1], now).key)
    return option.shifted(context.machine, by)


def trains(ready: Sequence[Cut], context: Context) -> Iterator[tuple[list[Cut], list[Meeting]]]:
    """Rows of cuts that run through, with how each follows the one before."""
    members, meetings = [ready[0]], list[Meeting]()
    for following in ready[1:]:
        meeting, _, members[-1], after = meet(members[-1], following, context)
        if meeting is Meeting.APART:
            yield members, meetings
            members, meetings = [after], []
        else:
            members.append(after)
            meetings.append(meeting)
    yield members, meetings
