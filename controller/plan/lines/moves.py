"""G0 to G3: lines and arcs of X Y Z with the rotaries turning evenly along."""

from __future__ import annotations

import math
from dataclasses import replace

from controller.geometry.curves import Arc
from controller.geometry.vectors import Frame, Vector, norm, scale, subtract, unit
from controller.machine.model import Joints, Machine
from controller.motion.motions import JointMove, ThreadMove
from controller.plan.context import Context
from controller.plan.segment import Segment, rotaries_of, round_arc, straight
from controller.program.contour import circles
from controller.program.position import placed, read_in, shifted
from controller.program.program import JointArc, JointLine, JointMotion, Thread

TANGENT_RAD = 1e-6
SPIN_UP_S = 0.25  # along a thread, at least: in less the spindle's lag could not be learnt
FOLLOWING_SHARE = 0.3  # of the axes' limits: what a thread leaves for following a spindle that lags


def line(block: JointLine, context: Context, now: Joints) -> Segment | None:
    """The segment of a G0 or G1; None where nothing moves."""
    end = target(block, context, now)
    found = straight("line", block.place, now, end, block.feed_mm_s, context.kinematics, block.feed_deg_s)
    if found is None:
        return None
    if block.hole:
        found = replace(found, hole=block.hole)
    if block.thread is not None:
        return _tied(found, block.thread, context.machine)
    return found if block.time_s is None else timed(found, block.time_s)


def _tied(segment: Segment, thread: Thread, machine: Machine) -> Segment:
    """The same line led by the spindle; of the axes' limits a share is left to follow it by."""
    move, told = segment.motion, machine.spindle.position if machine.spindle is not None else None
    if not isinstance(move, JointMove) or told is None:
        return segment
    way = scale(move.curve.derivative(0.0), 1.0 / move.end)
    axes = [(abs(d), machine.axes[i].limits) for d, i in zip(way, machine.linear(), strict=True) if d]
    turned = thread.rev_per_mm * move.end
    tied = ThreadMove(
        *(move.curve, move.end, move.start_rotaries, move.end_rotaries),
        thread.rev_per_mm,
        -turned if thread.begin_rev is None else thread.begin_rev,
        min(told.acceleration_rev_s2 / abs(thread.rev_per_mm), (segment.feed_mm_s or 0.0) / SPIN_UP_S),
        FOLLOWING_SHARE * min(limits.velocity / d for d, limits in axes),
        FOLLOWING_SHARE * min(limits.acceleration / d for d, limits in axes),
    )
    return replace(segment, motion=tied, name="thread")


def timed(segment: Segment, time_s: float) -> Segment:
    """The same segment at the feed with which it takes ``time_s`` (G93)."""
    return replace(segment, feed_mm_s=segment.motion.end / time_s)


def target(block: JointMotion, context: Context, now: Joints) -> Joints:
    """Joints at the end of a block: program values plus work offset and tool length (G43)."""
    if isinstance(block, JointLine) and block.machine_frame:
        frame, length = Frame(), 0.0
    else:
        frame, length = read_in(
            block.modal, context.machine, context.kinematics, rotaries_of(now, context.kinematics)
        )
    end = [
        q if t is None else (q + t if block.relative else t) for q, t in zip(now, block.targets, strict=True)
    ]
    linear = context.machine.linear()
    words = tuple(block.targets[i] for i in linear)
    if any(word is not None for word in words):
        here = xyz_of(now, linear)
        there = shifted(words, here, frame) if block.relative else placed(words, here, frame, length)
        for i, value in zip(linear, there, strict=True):
            end[i] = value
    return tuple(end)


def xyz_of(joints: Joints, linear: tuple[int, int, int]) -> Vector:
    """X Y Z out of joints."""
    return joints[linear[0]], joints[linear[1]], joints[linear[2]]


# ---- arcs ------------------------------------------------------------------------


def arc(block: JointArc, context: Context, now: Joints) -> Segment | None:
    """The segment of a G2 or G3: arc or helix, full circles and turns included."""
    end = target(block, context, now)
    frame, _ = read_in(block.modal, context.machine, context.kinematics, rotaries_of(now, context.kinematics))
    linear = context.machine.linear()
    # Distances only: the origin of the frame and the tool length cancel out.
    chord = frame.turn_back(subtract(xyz_of(end, linear), xyz_of(now, linear)))
    a, b, n = block.plane
    # Seen from the end of the normal a, b turn counter-clockwise only if (a, b, n) is right-handed.
    handed = 1.0 if (b - a) % 3 == 1 else -1.0
    way = -handed if block.clockwise else handed
    try:
        centre, sweep, drift = circles.meant(
            block.centre_mm,
            block.radius_mm,
            (chord[a], chord[b]),
            way,
            block.turns,
            context.machine.arc_tolerance_mm,
        )
    except circles.NoCircleError as error:
        context.refuse(block.place, error.said)
    radius = math.hypot(*centre)
    first, second, rise = [0.0] * 3, [0.0] * 3, [0.0] * 3
    first[a], first[b] = -centre[0], -centre[1]
    second[a], second[b] = centre[1] * way, -centre[0] * way
    rise[a], rise[b], rise[n] = *drift, chord[n]
    middle = subtract(xyz_of(now, linear), frame.turn((first[0], first[1], first[2])))
    vectors = (frame.turn((v[0], v[1], v[2])) for v in (first, second, rise))
    f, s, r = vectors
    if radius * sweep < circles.SAME_MM:
        line = straight("line", block.place, now, end, block.feed_mm_s, context.kinematics)
        return line if line is None or block.time_s is None else timed(line, block.time_s)
    bow = Arc(middle, f, s, sweep, r)
    found = round_arc("arc", block.place, now, end, bow, block.feed_mm_s, context.kinematics)
    return found if block.time_s is None else timed(found, block.time_s)


# ---- running through -------------------------------------------------------------


def runs_through(before: Segment, after: Segment) -> bool:
    """Whether two feed moves meet with one tangent, rotaries in proportion: no stop between them."""
    a, b = before.motion, after.motion
    if not isinstance(a, JointMove) or not isinstance(b, JointMove):
        return False
    if isinstance(a, ThreadMove) or isinstance(b, ThreadMove):
        return False  # the spindle turns from rest to rest
    first, second = _tangent(a, 1.0), _tangent(b, 0.0)
    if (first[0] is None) != (second[0] is None):
        return False
    if first[0] is not None and second[0] is not None and norm(subtract(first[0], second[0])) > TANGENT_RAD:
        return False
    return max(abs(p - q) for p, q in zip(first[1], second[1], strict=True)) <= TANGENT_RAD


def _tangent(move: JointMove, share: float) -> tuple[Vector | None, tuple[float, float]]:
    """Unit tangent of X Y Z (None where they stand) and the rotaries' turn per unit of s."""
    rate = scale(move.curve.derivative(share), 1.0 / move.end)
    (a0, b0), (a1, b1) = move.start_rotaries, move.end_rotaries
    turn = ((a1 - a0) / move.end, (b1 - b0) / move.end)
    return (unit(rate) if norm(rate) > 1e-9 else None), turn
