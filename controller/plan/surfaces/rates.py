"""How the joints change along a path: exact derivatives with respect to its length.

The joints q are functions of the path length s. With exact derivatives q', q'',
q''' the motion law s(t) moves joint j by

    velocity      q' v
    acceleration  q'' v^2 + q' a
    jerk          q''' v^3 + 3 q'' v a + q' j

so every joint limit is a limit on (v, a, j) at each place of the path.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import numpy.typing as npt

from controller.geometry import series as jets
from controller.geometry.arrays import Array, distinct
from controller.geometry.curves import Bezier, Curve, Line
from controller.geometry.placement import Blend, Blended, Placed
from controller.geometry.surfaces import RuledSurface, Surface
from controller.geometry.touches import seen_at
from controller.geometry.vectors import Number, Vector, norm
from controller.machine.kinematics import Kinematics
from controller.machine.model import STILL, Joints, Machine
from controller.memory import remembered
from controller.motion.motions import JointMove, SurfaceCut, ToolLine, ToolSpline
from controller.plan.rotaries import tool_paths
from controller.plan.rotaries.branch import joints_along, one_branch
from controller.plan.segment import Segment
from controller.plan.surfaces.blends import in_arc_length

Index = npt.NDArray[np.intp]
Pair = tuple[Number, Number]  # of the rotaries
Terms = tuple[Vector, Vector, Vector]

# Exact derivatives of the rotaries are 0/0 at a pole and lose 1/distance^3 digits beside it. They are
# taken a micron inside and carried on from there: a lead whose begin had the rate of a micron before
# would jump by what the path bends meanwhile. A touch tells them at the pole itself.
# Away from it they are taken where they are asked for: two cuts that join smoothly would seem to
# turn by what the path bends within two microns, and a slow machine would creep over the joint.
# A path that begins beside the pole, and not at it, turns a rotary within the way that it is off: by no more
# than a share ``BESIDE`` of that may be carried on.
POLE_MARGIN_MM = 1e-3
BESIDE = 0.02
AT_POLE = 1e-8  # sine of the angle to it
REMEMBERED = 256  # cuts: a window asks for its own again and again
MIN_RATE = 1e-3  # of C1'' at an end: below that C1 stands still there, and s has no series


@dataclass(frozen=True, slots=True)
class Derivatives:
    """q', q'', q''' at N places of a segment, each (N, axes), per mm (or degree) of s."""

    first: Array
    second: Array
    third: Array

    def velocity(self, v: Array) -> Array:
        return self.first * v[:, None]

    def acceleration(self, v: Array, a: Array) -> Array:
        return self.second * (v * v)[:, None] + self.first * a[:, None]

    def jerk(self, v: Array, a: Array, j: Array) -> Array:
        cubic = self.third * (v**3)[:, None] + 3.0 * self.second * (v * a)[:, None]
        return cubic + self.first * j[:, None]

    def even_speed(self, velocity: Array, acceleration: Array, jerk: Array) -> Array:
        """Largest speed along the path (N,) within limits (axes,) of the joints, where it does not change."""
        tiny = 1e-30
        by_velocity = velocity / (np.abs(self.first) + tiny)
        by_acceleration = np.sqrt(acceleration / (np.abs(self.second) + tiny))
        by_jerk = np.cbrt(jerk / (np.abs(self.third) + tiny))
        return np.asarray(np.minimum(np.minimum(by_velocity, by_acceleration), by_jerk).min(axis=1))

    def beyond(self, way: Array) -> Derivatives:
        """By Taylor's series at places that lie ``way`` (N,), in mm, further along."""
        x = way[:, None]
        second = self.second + x * self.third
        return Derivatives(self.first + 0.5 * x * (self.second + second), second, self.third)


def limits(machine: Machine) -> Array:
    """Largest velocity, acceleration and jerk of each joint: (axes, 3), in mm or rad, per s, s^2 and s^3."""
    return np.array([(a.limits.velocity, a.limits.acceleration, a.limits.jerk) for a in machine.axes])


def derivatives(segment: Segment, s: Array, kinematics: Kinematics) -> Derivatives:
    """Exact derivatives of the joints with respect to s at the places ``s`` (N,)."""
    if isinstance(segment.motion, JointMove):
        return _derivatives_of_move(segment.motion, s, kinematics)
    if isinstance(segment.motion, ToolLine):
        return Derivatives(*tool_paths.derivatives_of_line(segment.motion, s, kinematics))
    if isinstance(segment.motion, ToolSpline):
        return together([segment], s, np.zeros(len(s), dtype=np.intp), kinematics)
    return _derivatives_of_cut(segment, segment.motion, s, kinematics)


def joint_series(segment: Segment, s: float, joints: Joints, kinematics: Kinematics) -> list[jets.Jet]:
    """The joints of a segment as series over s at ``s``, where they are ``joints``."""
    with np.errstate(all="ignore"):
        d = derivatives(segment, np.array([s]), kinematics)
    rows = zip(joints, d.first[0], 0.5 * d.second[0], d.third[0] / 6.0, strict=True)
    return [jets.Jet(np.array(row)[:, None]) for row in rows]


def _derivatives_of_move(move: JointMove, s: Array, kinematics: Kinematics) -> Derivatives:
    per_s = 1.0 / move.end
    if isinstance(move.curve, Line):
        return _even(np.tile(_rates(move, kinematics), (len(s), 1)))
    (a0, b0), (a1, b1) = move.start_rotaries, move.end_rotaries
    found = []
    for order in (1, 2, 3):
        xyz = [np.broadcast_to(c, s.shape) for c in move.curve.derivative(s * per_s, order, np)]
        turns = [np.full_like(s, a1 - a0), np.full_like(s, b1 - b0)] if order == 1 else [0.0 * s, 0.0 * s]
        values = [*xyz, *turns]
        found.append(np.stack(kinematics.arrange(values), axis=1) * per_s**order)
    return Derivatives(*found)


def _even(first: Array) -> Derivatives:
    """Of straight moves, by the rates of the joints, (N, axes)."""
    return Derivatives(first, np.zeros(first.shape), np.zeros(first.shape))


def _rates(move: JointMove, kinematics: Kinematics) -> Array:
    """Of the joints along a straight one, (axes,) per unit of s."""
    (a0, b0), (a1, b1) = move.start_rotaries, move.end_rotaries
    ways = kinematics.arrange([*move.curve.derivative(0.0, 1), a1 - a0, b1 - b0])
    return np.array(ways, dtype=float) * (1.0 / move.end)


@remembered(REMEMBERED)
def _inside(cut: SurfaceCut, kinematics: Kinematics) -> tuple[float, float]:
    """From where to where (mm) in a cut its derivatives are taken."""
    lower = cut.surface.lower

    def margin(u: float) -> float:
        rate, bend = (float(norm(lower.derivative(u, k))) for k in (1, 2))
        axis = cut.part.turn(cut.surface.axis(u))
        if rate <= MIN_RATE * bend:
            return POLE_MARGIN_MM
        if seen_at(cut.touches, u) is not None or kinematics.is_clear_of_pole(axis):
            return 0.0
        off, turn_per_mm = float(kinematics.off_pole(axis)), float(norm(cut.surface.axis_rate(u))) / rate
        return POLE_MARGIN_MM if off < AT_POLE else min(POLE_MARGIN_MM, BESIDE * off / max(turn_per_mm, 1e-9))

    return min(margin(0.0), cut.end / 3), cut.end - min(margin(1.0), cut.end / 3)


def _derivatives_of_cut(segment: Segment, cut: SurfaceCut, s: Array, kinematics: Kinematics) -> Derivatives:
    branch = one_branch(segment, cut, kinematics)
    if branch is not None:
        return on_branch(cut, s, branch, kinematics)
    inside = np.clip(s, *_inside(cut, kinematics))
    u = cut.arc.u_along(inside)
    first, second = kinematics.spread([*joints_along(segment, inside, kinematics).T])[3:]
    shown = first, second  # where a free rotary stands, X and Y are the part's turned by it
    own = partial(tool_paths.nearest, shown=shown)
    return _derived(cut, cut.surface, u, kinematics, own, shown).beyond(s - inside)


def on_branch(cut: SurfaceCut, s: Array, branch: int, kinematics: Kinematics) -> Derivatives:
    """As ``derivatives`` of a cut that is on one of ``kinematics.branches`` wherever it is asked for."""
    inside = np.clip(s, *_inside(cut, kinematics))
    u = cut.arc.u_along(inside)
    return _derived(cut, cut.surface, u, kinematics, lambda pairs: pairs[branch]).beyond(s - inside)


def _derived(
    cut: SurfaceCut,
    surface: Surface,
    u: Array,
    kinematics: Kinematics,
    own: Callable[[Sequence[Pair]], Pair],
    keep: Pair = STILL,
) -> Derivatives:
    """At the parameters ``u`` (N,) of a surface, the rest as in ``cut``; ``own`` takes a branch.

    ``keep``: the pair of rotaries there, for one that is free.
    """
    series = in_arc_length(surface.lower, u)
    tip, axis = surface.pose(series, cut.offset_mm, jets)
    tip, axis = cut.part.to_parent(tip), cut.part.turn(axis)
    seen = cut.seen_along(series, axis, kinematics, jets)
    first, second = own(kinematics.branches(axis, jets, keep=keep, seen=seen))
    x, y, z = kinematics.linear(tip, (first, second), cut.length_mm, jets)
    return Derivatives(*tool_paths.orders((x, y, z, first, second), kinematics, u))


# ---- cuts of one kind, together: a row of short surfaces costs little more than one


class _Row(Surface):
    """Ruled surfaces as one whose control points are arrays: the n-th sample lies on surface ``of[n]``."""

    __slots__ = ("lower", "ruling_curve", "upper")

    def __init__(self, surfaces: Sequence[Surface], of: Index) -> None:
        self.lower = self.upper = _gathered([one.lower for one in surfaces], of)
        self.ruling_curve = _gathered([one.ruling_curve for one in surfaces], of)


def _row(surfaces: Sequence[Surface], of: Index) -> Surface:
    """Surfaces of one kind in a row, with what is placed and blended on them."""
    row, first = _Row(surfaces, of), surfaces[0]
    if not isinstance(first, Placed):
        return row
    placed = replace(first, base=row)
    if not isinstance(placed, Blended):
        return placed
    blends = [one.blends for one in surfaces if isinstance(one, Blended)]
    return replace(placed, blends=tuple(_blends(each, of) for each in zip(*blends, strict=True)))


def _blends(blends: Sequence[Blend], of: Index) -> Blend:
    per_u = np.array([one.per_u for one in blends])[of]
    tip = _terms([one.tip for one in blends], of)
    axes = [one.axis for one in blends if one.axis is not None]
    return Blend(blends[0].at_start, per_u, tip, _terms(axes, of) if axes else None)


def _terms(terms: Sequence[Terms], of: Index) -> Terms:
    (a, b, c) = ((p[:, 0], p[:, 1], p[:, 2]) for p in np.moveaxis(np.array(terms)[of], 1, 0))
    return a, b, c


def _gathered(curves: Sequence[Curve], of: Index) -> Curve:
    points = np.array([curve.points for curve in curves if isinstance(curve, Bezier)])[of]
    return Bezier(tuple((p[:, 0], p[:, 1], p[:, 2]) for p in np.moveaxis(points, 1, 0)))


def kind(segment: Segment, kinematics: Kinematics) -> object:
    """What segments have in common whose derivatives can be taken together; None: they cannot."""
    cut = segment.motion
    if isinstance(cut, ToolLine):
        return tool_paths.kind(cut, kinematics)
    if isinstance(cut, JointMove):
        return JointMove if isinstance(cut.curve, Line) else None
    if isinstance(cut, ToolSpline):
        return ToolSpline, cut.tips, cut.length_mm
    if not isinstance(cut, SurfaceCut) or cut.touches or cut.beside_pole:
        return None
    surface = cut.surface
    lower, ruling = surface.lower, surface.ruling_curve
    if (
        type(surface.nominal) is not RuledSurface
        or not isinstance(lower, Bezier)
        or not isinstance(ruling, Bezier)
    ):
        return None
    branch = one_branch(segment, cut, kinematics)
    if branch is None or (isinstance(surface, Placed) and surface.through is not None):
        return None
    form = (len(lower.points), len(ruling.points), _placement(surface))
    return *form, cut.offset_mm, cut.length_mm, cut.part, branch


def _placement(surface: Surface) -> object:
    """All of a placed cutter but for the surface, and where it is blended."""
    if not isinstance(surface, Placed):
        return None
    blends = surface.blends if isinstance(surface, Blended) else ()
    ends = tuple((one.at_start, one.axis is None) for one in blends)
    return surface.offset_mm, surface.points_v, surface.normals_v, surface.taper_rad, surface.shift_mm, ends


def together(segments: Sequence[Segment], s: Array, of: Index, kinematics: Kinematics) -> Derivatives:
    """As ``derivatives`` for segments of one kind: ``s`` (N,) in the segments ``of`` (N,)."""
    lines = [one.motion for one in segments if isinstance(one.motion, ToolLine)]
    if lines:
        return Derivatives(*tool_paths.derivatives_of_lines(lines, s, of, kinematics))
    splines = [one.motion for one in segments if isinstance(one.motion, ToolSpline)]
    if splines:
        return Derivatives(*tool_paths.derivatives_of_splines(splines, s, of, kinematics))
    moves = [one.motion for one in segments if isinstance(one.motion, JointMove)]
    if moves:
        return _even(np.array([_rates(move, kinematics) for move in moves])[of])
    cuts = [one.motion for one in segments if isinstance(one.motion, SurfaceCut)]
    spans = np.array([_inside(cut, kinematics) for cut in cuts])[of]
    inside, u = np.clip(s, spans[:, 0], spans[:, 1]), np.empty(len(s))
    for k in distinct(of):
        here = of == k
        u[here] = cuts[k].arc.u_along(inside[here])
    branch = one_branch(segments[0], cuts[0], kinematics) or 0
    row = _row([cut.surface for cut in cuts], of)
    return _derived(cuts[0], row, u, kinematics, lambda pairs: pairs[branch]).beyond(s - inside)
