"""G0 to G3: lines and arcs of X Y Z with the rotaries turning evenly along."""

from __future__ import annotations

import math
from dataclasses import replace

from controller.curves import Arc
from controller.geometry import Frame, Vector, norm, scale, subtract, unit
from controller.kinematics import Kinematics
from controller.machine import Joints, Machine
from controller.motions import JointMove
from controller.plan.route.stretch import Stretch, Voice, rotaries_of, round_arc, straight
from controller.plan.text.position import placed, read_in, shifted
from controller.plan.text.program import JointArc, JointLine

ROUND_MM = 0.005  # by which R may be too small for its end (rounded words)
# By which start and end may differ in their distance from a centre, as LinuxCNC has it: what words of
# two decimals give away in mm, or this share of the radius, up to ``arc_tolerance_mm``.
ARC_ROUND_MM = 0.02 * math.sqrt(2.0)
ARC_SHARE = 0.001
SAME_MM = 1e-6  # ends of an arc nearer than this are one point: a full circle
TANGENT_RAD = 1e-6


def line(block: JointLine, machine: Machine, kinematics: Kinematics, now: Joints) -> Stretch | None:
    """The stretch of a G0 or G1; None where nothing moves."""
    end = target(block, machine, kinematics, now)
    found = straight("line", block.place, now, end, block.feed_mm_s, kinematics, block.feed_deg_s)
    return found if found is None or block.time_s is None else timed(found, block.time_s)


def timed(stretch: Stretch, time_s: float) -> Stretch:
    """The same stretch at the feed with which it takes ``time_s`` (G93)."""
    return replace(stretch, feed_mm_s=stretch.motion.end / time_s)


def target(block: JointLine | JointArc, machine: Machine, kinematics: Kinematics, now: Joints) -> Joints:
    """Joints at the end of a block: program values plus work offset and tool length (G43)."""
    if isinstance(block, JointLine) and block.machine_frame:
        frame, length = Frame(), 0.0
    else:
        frame, length = read_in(block.modal, machine, kinematics, rotaries_of(now, kinematics))
    end = [
        q if t is None else (q + t if block.relative else t) for q, t in zip(now, block.targets, strict=True)
    ]
    linear = machine.linear()
    words = tuple(block.targets[i] for i in linear)
    if any(word is not None for word in words):
        here = _xyz(now, linear)
        there = shifted(words, here, frame) if block.relative else placed(words, here, frame, length)
        for i, value in zip(linear, there, strict=True):
            end[i] = value
    a, b, c, d, e = end
    return (a, b, c, d, e)


def _xyz(joints: Joints, linear: tuple[int, int, int]) -> Vector:
    return joints[linear[0]], joints[linear[1]], joints[linear[2]]


# ---- arcs ------------------------------------------------------------------------


def arc(
    block: JointArc, machine: Machine, kinematics: Kinematics, now: Joints, voice: Voice
) -> Stretch | None:
    """The stretch of a G2 or G3: arc or helix, full circles and turns included."""
    end = target(block, machine, kinematics, now)
    frame, _ = read_in(block.modal, machine, kinematics, rotaries_of(now, kinematics))
    linear = machine.linear()
    # Distances only: the origin of the frame and the tool length cancel out.
    chord = frame.turn_back(subtract(_xyz(end, linear), _xyz(now, linear)))
    a, b, n = block.plane
    centre = _centre(block, (chord[a], chord[b]), voice, machine.arc_tolerance_mm)
    # Seen from the end of the normal a, b turn counter-clockwise only if (a, b, n) is right-handed.
    handed = 1.0 if (b - a) % 3 == 1 else -1.0
    way = -handed if block.clockwise else handed
    centre, sweep, drift = _fitted(centre, (chord[a], chord[b]), way, max(block.turns, 1) - 1)
    radius = math.hypot(*centre)
    first, second, rise = [0.0] * 3, [0.0] * 3, [0.0] * 3
    first[a], first[b] = -centre[0], -centre[1]
    second[a], second[b] = centre[1] * way, -centre[0] * way
    rise[a], rise[b], rise[n] = *drift, chord[n]
    middle = subtract(_xyz(now, linear), frame.turn((first[0], first[1], first[2])))
    vectors = (frame.turn((v[0], v[1], v[2])) for v in (first, second, rise))
    f, s, r = vectors
    if radius * sweep < SAME_MM:
        line = straight("line", block.place, now, end, block.feed_mm_s, kinematics)
        return line if line is None or block.time_s is None else timed(line, block.time_s)
    bow = Arc(middle, f, s, sweep, r)
    found = round_arc("arc", block.place, now, end, bow, block.feed_mm_s, kinematics)
    return found if block.time_s is None else timed(found, block.time_s)


def _sweep(centre: tuple[float, float], chord: tuple[float, float], way: float) -> float:
    """Angle from start to end in the sense of ``way``; a full turn where both are in one direction."""
    if math.hypot(*chord) < SAME_MM:
        return 2.0 * math.pi
    start = math.atan2(-centre[1], -centre[0])
    end = math.atan2(chord[1] - centre[1], chord[0] - centre[0])
    angle = (way * (end - start)) % (2.0 * math.pi)
    return angle if angle * math.hypot(*centre) >= SAME_MM else 2.0 * math.pi


def _fitted(
    centre: tuple[float, float], chord: tuple[float, float], way: float, turns: int
) -> tuple[tuple[float, float], float, tuple[float, float]]:
    """Centre, sweep and drift of the arc about ``centre`` that ends on the end of ``chord``.

    The centre is moved between the ends; on more than half a turn, where that would carry the arc
    away, and far where the ends lie near each other, it drifts along its radius instead.
    """
    sweep, size = _sweep(centre, chord, way) + 2.0 * math.pi * turns, math.hypot(*chord)
    if size < SAME_MM:
        return centre, sweep, (0.0, 0.0)
    if sweep > math.pi and math.hypot(chord[0] - centre[0], chord[1] - centre[1]) > SAME_MM:
        return centre, sweep, _drift(centre, chord)
    centre = _between(centre, chord)
    return centre, _sweep(centre, chord, way) + 2.0 * math.pi * turns, (0.0, 0.0)


def _between(centre: tuple[float, float], chord: tuple[float, float]) -> tuple[float, float]:
    """The nearest centre that is as far from one end as from the other."""
    (x, y), size = centre, math.hypot(*chord)
    along = (x * chord[0] + y * chord[1]) / size - size / 2.0
    return x - along * chord[0] / size, y - along * chord[1] / size


def _drift(centre: tuple[float, float], chord: tuple[float, float]) -> tuple[float, float]:
    """From the circle's end to the programmed one, along the radius."""
    x, y = chord[0] - centre[0], chord[1] - centre[1]
    share = 1.0 - math.hypot(*centre) / math.hypot(x, y)
    return x * share, y * share


def _centre(block: JointArc, chord: tuple[float, float], voice: Voice, most_mm: float) -> tuple[float, float]:
    """Centre from the start point in the plane; refuses one that does not fit the end."""
    if block.centre_mm is None:
        return _centre_of_radius(block, chord, voice)
    x, y = block.centre_mm
    start, end = math.hypot(x, y), math.hypot(chord[0] - x, chord[1] - y)
    if start < SAME_MM:
        voice.refuse(
            block.place, "the centre of this arc is its start; I J K are the way from start to centre"
        )
    allowed = min(most_mm, max(ARC_ROUND_MM, ARC_SHARE * max(start, end)))
    if abs(start - end) > allowed:
        voice.refuse(
            block.place,
            f"this arc begins {start:.4f} mm from its centre and ends {end:.4f} mm from it; they may differ "
            f"by {allowed:.4f} mm; correct I J K or the end point",
        )
    return x, y


def _centre_of_radius(block: JointArc, chord: tuple[float, float], voice: Voice) -> tuple[float, float]:
    """R form: of the two centres the one of the short way (R > 0) or the long way (R < 0)."""
    radius, size = block.radius_mm or 0.0, math.hypot(*chord)
    if size < SAME_MM:
        voice.refuse(
            block.place, "an arc with R needs an end point other than its start; a full circle takes I J K"
        )
    if size / 2.0 > abs(radius) + ROUND_MM:
        voice.refuse(
            block.place,
            f"R {abs(radius):.4f} mm cannot reach an end {size:.4f} mm away; R is at least half of that; "
            "correct R or the end point",
        )
    height = math.sqrt(max(0.0, radius * radius - size * size / 4.0))
    a, b, _ = block.plane
    handed = 1.0 if (b - a) % 3 == 1 else -1.0
    left = -handed if block.clockwise else handed  # the centre of a short way round lies on this side
    height *= left * math.copysign(1.0, radius)
    return chord[0] / 2.0 - height * chord[1] / size, chord[1] / 2.0 + height * chord[0] / size


# ---- running through -------------------------------------------------------------


def runs_through(before: Stretch, after: Stretch) -> bool:
    """Whether two feed moves meet with one tangent, rotaries in proportion: no stop between them."""
    a, b = before.motion, after.motion
    if not isinstance(a, JointMove) or not isinstance(b, JointMove):
        return False
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
