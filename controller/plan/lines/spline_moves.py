"""G5, G5.1 and G5.2: curves of X and Y as they are, run through evenly, a move for each of their spans."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from controller.geometry import arc_length
from controller.geometry.arrays import Array
from controller.geometry.curves import Curve, Even
from controller.geometry.splines import BSpline, simplest
from controller.geometry.vectors import ROUNDING, Vector, add, norm, subtract
from controller.machine.model import Joints
from controller.messages import message
from controller.motion.motions import JointMove
from controller.plan.context import Context
from controller.plan.lines import moves
from controller.plan.lines.moves import xyz_of
from controller.plan.segment import Segment, joints_of, rotaries_of
from controller.program.position import placed, read_in, shifted
from controller.program.program import JointCurve, JointLine, JointMotion

SLOW = 0.01  # of the highest rate of a span: where the least one is below, it is looked for
SAMPLES = 257  # of a span
BESIDE_KNOT = 1e-6  # of the parameter: nearer to a knot there is an end already


def moves_of(block: JointMotion, context: Context, now: Joints) -> list[Segment]:
    """The moves of a G0 to G5.2 without a tool-centre mode, as it stands there; none where nothing moves."""
    if isinstance(block, JointCurve):
        return segments(block, context, now)
    one = moves.line(block, context, now) if isinstance(block, JointLine) else moves.arc(block, context, now)
    return [one] if one is not None else []


def segments(block: JointCurve, context: Context, now: Joints) -> list[Segment]:
    """The moves of a curve, one for each span between its knots; none where it has no length."""
    whole = spline(block, controls(block, context, now))
    whole = whole.refined(_slow(whole))
    try:
        arcs = [arc_length.of(span) for span in _spans(whole)]
    except ValueError:
        context.refuse(block.place, message("curve.to_and_fro"))
    length = sum(arc.length_mm for arc in arcs)
    made: list[Segment] = []
    for arc in arcs:
        feed = block.feed_mm_s if block.time_s is None else length / block.time_s
        rotaries, start = rotaries_of(now, context.kinematics), made[-1].end if made else now
        end = joints_of(arc.curve.at(1.0), rotaries, context.kinematics)
        move = JointMove(Even(arc), arc.length_mm, rotaries, rotaries)
        made.append(Segment(move, block.place, feed, False, start, end, True, "curve"))
    return made


def controls(block: JointCurve, context: Context, now: Joints) -> list[Vector]:
    """The control points as positions of X Y Z, the first where the axes stand."""
    frame, length = read_in(
        block.modal, context.machine, context.kinematics, rotaries_of(now, context.kinematics)
    )
    here = xyz_of(now, context.machine.linear())
    found = []
    for x, y, off, _ in block.controls:
        words = (x, y, None)
        point = shifted(words, here, frame) if block.relative else placed(words, here, frame, length)
        found.append(add(point, frame.turn((*off, 0.0))))
    return found


def spline(block: JointCurve, points: list[Vector]) -> BSpline:
    """The curve of control points whose inner knots lie evenly and whose ends are points of it."""
    spans = len(points) - block.order + 1
    knots = [0.0] * block.order + [float(k) for k in range(1, spans)] + [float(spans)] * block.order
    return BSpline.of(block.order, knots, points, [control.weight for control in block.controls])


def _slow(whole: BSpline) -> list[float]:
    """Parameters inside of the spans where the curve all but stands: at cusps and in hairpins.

    There its direction turns at once, so that they are ends: the path rests there, or passes as slowly.
    """
    found = []
    for low, high in pairwise(whole.breaks):
        u = np.linspace(low, high, SAMPLES)
        rate = _rate(whole, u)
        inner = (rate[1:-1] <= rate[:-2]) & (rate[1:-1] < rate[2:]) & (rate[1:-1] < SLOW * rate.max())
        for k in np.flatnonzero(inner) + 1:
            found.append(_least(whole, float(u[k - 1]), float(u[k + 1])))
    return [u for u in found if min(abs(u - knot) for knot in whole.breaks) > BESIDE_KNOT]


def _least(whole: BSpline, low: float, high: float) -> float:
    """Where between two parameters its rate is least, by ever closer samples."""
    while high - low > 1e-12:
        u = np.linspace(low, high, 9)
        k = int(np.argmin(_rate(whole, u)))
        low, high = float(u[max(k - 1, 0)]), float(u[min(k + 1, 8)])
    return 0.5 * (low + high)


def _rate(whole: BSpline, u: Array) -> Array:
    return np.asarray(np.broadcast_to(norm(whole.derivative(u, 1, np), np), u.shape))


def _spans(whole: BSpline) -> Iterator[Curve]:
    """Each span that has a length as a curve of its own: at the knots the curvature may jump."""
    weights = whole.weights or ((),) * len(whole.spans)
    for points, weight in zip(whole.spans, weights, strict=True):
        if sum(float(norm(subtract(b, a))) for a, b in pairwise(points)) > ROUNDING:
            yield simplest(BSpline((0.0, 1.0), (points,), (weight,) if weight else ()))
