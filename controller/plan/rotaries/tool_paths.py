"""Joints and their exact derivatives along tool lines and tool splines, at arrays of places."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
import numpy.typing as npt

from controller.geometry import series as jets
from controller.geometry.arrays import Array, columns, distinct
from controller.geometry.vectors import Number, Vector
from controller.machine.kinematics import Kinematics
from controller.motion.motions import ROW, ToolLine, ToolSpline
from controller.plan.rotaries.tool_axes import GreatCircles, follow
from controller.plan.rotaries.turns import TURN

Index = npt.NDArray[np.intp]

# Exact derivatives of the rotaries are 0/0 at a pole and lose digits beside it; this
# share of a line inside they are those of the limit. Away from it they are taken at the ends themselves.
POLE_MARGIN = 1e-4
WITHIN_REACH = 0.2  # sine of the angle to where both branches are one
LITTLE_RAD = 0.1  # a line turns the axis, and each rotary, by: so clear of the pole no branch is in doubt


def joints_along_line(line: ToolLine, s: Array, kinematics: Kinematics) -> Array:
    """Joints (N, axes) at the places ``s`` (N,), in any order."""
    share = s / line.end
    rotaries = _rotaries(line, share, kinematics)
    tip = tuple(t + w * share for t, w in zip(line.tip, line.way, strict=True))
    x, y, z = kinematics.linear(
        (tip[0], tip[1], tip[2]), (rotaries[:, 0], rotaries[:, 1]), line.length_mm, np
    )
    values = (x, y, z, rotaries[:, 0], rotaries[:, 1])
    return columns(kinematics.arrange(values), len(share))


def _rotaries(line: ToolLine, share: Array, kinematics: Kinematics) -> Array:
    if line.even:
        start, end = np.array(line.start_rotaries), np.array(line.end_rotaries)
        return np.asarray(start + (end - start) * share[:, None])
    inner = distinct(share[(share > 0.0) & (share < 1.0)])
    found = follow(
        _circle(line), line.start_rotaries, kinematics, extra=(np.zeros(len(inner), dtype=np.intp), inner)
    )
    return np.asarray(found.rotaries[np.searchsorted(found.share, np.clip(share, 0.0, 1.0))])


def _circle(line: ToolLine) -> GreatCircles:
    return GreatCircles(np.array([line.axis]), np.array([line.across]), np.array([line.angle_rad]))


def derivatives_of_line(line: ToolLine, s: Array, kinematics: Kinematics) -> tuple[Array, Array, Array]:
    """q', q'', q''' (N, axes) of the joints over s."""
    share = s / line.end
    if not line.even:
        first, last = _margins(line, kinematics)
        share = np.clip(share, first, 1.0 - last)
    x = jets.Jet(np.stack([share, np.full_like(s, 1.0 / line.end), 0.0 * s, 0.0 * s]))
    tip = tuple(t + x * w for t, w in zip(line.tip, line.way, strict=True))
    first, second = _rotary_jets(line, share, x, kinematics)
    return _orders((tip[0], tip[1], tip[2], first, second), True, line.length_mm, kinematics, s)


def kind(line: ToolLine, kinematics: Kinematics) -> object:
    """What lines have in common whose derivatives can be taken together; None: they cannot.

    Of a line that turns little, clear of the pole and of the end of reach, the branch is told by its ends.
    """
    if line.even:
        return True, line.length_mm
    turned = max(abs(a - b) for a, b in zip(line.start_rotaries, line.end_rotaries, strict=True))
    if max(turned, line.angle_rad) > LITTLE_RAD or any(_margins(line, kinematics)):
        return None
    if kinematics.is_bounded:
        ends = zip(line.axis, _end_axis(line), strict=True)
        x, y, z = (np.array(pair) for pair in ends)
        if np.min(kinematics.off_limit((x, y, z))) < WITHIN_REACH:
            return None
    return False, line.length_mm


def _end_axis(line: ToolLine) -> Vector:
    c, w = math.cos(line.angle_rad), math.sin(line.angle_rad)
    x, y, z = (c * a + w * b for a, b in zip(line.axis, line.across, strict=True))
    return x, y, z


def derivatives_of_lines(
    lines: Sequence[ToolLine], s: Array, of: Index, kinematics: Kinematics
) -> tuple[Array, Array, Array]:
    """As ``derivatives_of_line`` for lines of one kind: ``s`` (N,) in the lines ``of`` (N,)."""
    ends = np.array([line.end for line in lines])[of]
    share = s / ends
    x = jets.Jet(np.stack([share, 1.0 / ends, 0.0 * s, 0.0 * s]))
    tip = [t + x * w for t, w in zip(_each(lines, "tip", of), _each(lines, "way", of), strict=True)]
    pairs = tuple(zip(_each(lines, "start_rotaries", of), _each(lines, "end_rotaries", of), strict=True))
    first, second = (a + x * (b - a) for a, b in pairs)
    if not lines[0].even:
        shown = tuple(a + share * (b - a) for a, b in pairs)
        angle = np.array([line.angle_rad for line in lines])[of]
        c, w = jets.cos(x * angle), jets.sin(x * angle)
        axis, across = _each(lines, "axis", of), _each(lines, "across", of)
        ax, ay, az = (c * a + w * b for a, b in zip(axis, across, strict=True))
        first, second = nearest(kinematics.branches((ax, ay, az), jets), shown)
    return _orders((tip[0], tip[1], tip[2], first, second), True, lines[0].length_mm, kinematics, s)


def rates_of_circles(circles: GreatCircles, share: float, shown: Array, kinematics: Kinematics) -> Array:
    """What both rotaries turn per share of each line (N, 2), at one ``share`` of all, next to ``shown``."""
    none = np.zeros(len(shown))
    x = jets.Jet(np.stack([none + share, none + 1.0, none, none]))
    c, w = jets.cos(x * circles.angle), jets.sin(x * circles.angle)
    ax, ay, az = (c * a + w * b for a, b in zip(circles.axis.T, circles.across.T, strict=True))
    turned = nearest(kinematics.branches((ax, ay, az), jets), shown.T)
    return np.stack([_coefficient(q, 1, none) for q in turned], axis=1)


def rotaries_on_circles(circles: GreatCircles, share: float, shown: Array, kinematics: Kinematics) -> Array:
    """Both rotaries at one ``share`` of every line (N, 2), on branch and turn next to ``shown``."""
    ax, ay, az = circles.at(np.arange(len(shown)), np.full(len(shown), share))[0].T
    pairs = [np.stack(pair, axis=1) for pair in kinematics.branches((ax, ay, az), np)]
    pairs = [pair + TURN * np.round((shown - pair) / TURN) for pair in pairs]
    one, other = (np.abs(pair - shown).max(axis=1)[:, None] for pair in pairs)
    return np.asarray(np.where(one <= other, *pairs))


def _each(lines: Sequence[ToolLine], name: str, of: Index) -> list[Array]:
    """The components of a vector of each line, at the samples of the lines ``of``."""
    return list(np.array([getattr(line, name) for line in lines]).T[:, of])


def _margins(line: ToolLine, kinematics: Kinematics) -> tuple[float, float]:
    """How far inside its start and its end, as shares of a line, its derivatives are taken."""
    first, last = (
        0.0 if kinematics.is_clear_of_pole(axis) else POLE_MARGIN for axis in (line.axis, _end_axis(line))
    )
    return first, last


def _rotary_jets(line: ToolLine, share: Array, x: jets.Jet, kinematics: Kinematics) -> tuple[Number, Number]:
    if line.even:
        pairs = zip(line.start_rotaries, line.end_rotaries, strict=True)
        first, second = (a + x * (b - a) for a, b in pairs)
        return first, second
    shown = _rotaries(line, share, kinematics).T
    c, w = jets.cos(x * line.angle_rad), jets.sin(x * line.angle_rad)
    ax, ay, az = (c * a + w * b for a, b in zip(line.axis, line.across, strict=True))
    return nearest(kinematics.branches((ax, ay, az), jets), shown)


def nearest(pairs: Sequence[tuple[Number, Number]], shown: Iterable[Array]) -> tuple[Number, Number]:
    """Of both branches at each place the one next to the rotaries ``shown``, each (N,)."""
    one, other = pairs
    away = [sum(1.0 - np.cos(q.c[0] - at) for q, at in zip(pair, shown, strict=True)) for pair in pairs]
    near = np.asarray(away[0] <= away[1])
    first, second = (jets.Jet(np.where(near, p.c, q.c)) for p, q in zip(one, other, strict=True))
    return first, second


def _spans(spline: ToolSpline, s: Array) -> tuple[Array, Array]:
    """Coefficients (N, 5, 4) of the spans in which ``s`` lies, and the way into them (N, 1)."""
    knots = np.frombuffer(spline.knots)
    i = np.clip(np.searchsorted(knots, s, side="right") - 1, 0, len(knots) - 2)
    return np.frombuffer(spline.spans).reshape(-1, ROW)[i].reshape(-1, 5, 4), (s - knots[i])[:, None]


def joints_along_spline(spline: ToolSpline, s: Array, kinematics: Kinematics) -> Array:
    """Joints (N, axes) at the places ``s`` (N,), in any order."""
    c, h = _spans(spline, s)
    value = c[..., 0] + h * (c[..., 1] + h * (c[..., 2] + h * c[..., 3]))
    x, y, z, a, b = value.T
    if spline.tips:
        x, y, z = kinematics.linear((x, y, z), (a, b), spline.length_mm, np)
    values = (x, y, z, a, b)
    return columns(kinematics.arrange(values), len(s))


def derivatives_of_splines(
    splines: Sequence[ToolSpline], s: Array, of: Index, kinematics: Kinematics
) -> tuple[Array, Array, Array]:
    """As ``derivatives_of_line`` for splines of one kind: ``s`` (N,) in the splines ``of`` (N,).

    At a knot those after it.
    """
    c, h = np.empty((len(s), 5, 4)), np.empty((len(s), 1))
    order = np.argsort(of, kind="stable")
    ends = np.cumsum(np.bincount(of, minlength=len(splines))).tolist()
    for spline, first, last in zip(splines, [0, *ends], ends, strict=False):
        here = order[first:last]
        c[here], h[here] = _spans(spline, s[here])
    return derivatives_of_spans(c, h, splines[0].tips, splines[0].length_mm, kinematics)


def derivatives_of_spans(
    c: Array, h: Array, tips: bool, length_mm: float, kinematics: Kinematics
) -> tuple[Array, Array, Array]:
    """The same in cubics ``c`` (N, 5, 4), each at its own ``h`` (N, 1)."""
    series = np.stack(
        [
            c[..., 0] + h * (c[..., 1] + h * (c[..., 2] + h * c[..., 3])),
            c[..., 1] + h * (2.0 * c[..., 2] + h * (3.0 * c[..., 3])),
            c[..., 2] + h * (3.0 * c[..., 3]),
            c[..., 3],
        ]
    )
    x, y, z, a, b = (jets.Jet(series[..., i]) for i in range(5))
    return _orders((x, y, z, a, b), tips, length_mm, kinematics, h[:, 0])


def _orders(
    values: tuple[Number, Number, Number, Number, Number],
    tips: bool,
    length_mm: float,
    kinematics: Kinematics,
    s: Array,
) -> tuple[Array, Array, Array]:
    x, y, z, a, b = values
    if tips:
        x, y, z = kinematics.linear((x, y, z), (a, b), length_mm, jets)
    return orders((x, y, z, a, b), kinematics, s)


def orders(values: tuple[Number, ...], kinematics: Kinematics, s: Array) -> tuple[Array, Array, Array]:
    """First to third derivatives (N, axes) of joints by series of X Y Z and both rotaries at ``s`` (N,)."""
    joints = kinematics.arrange(values)
    first, second, third = (np.stack([_coefficient(q, k, s) for q in joints], axis=1) for k in (1, 2, 3))
    return first, 2.0 * second, 6.0 * third


def _coefficient(q: Number, k: int, s: Array) -> Array:
    return np.broadcast_to(np.asarray(q.c[k] if isinstance(q, jets.Jet) else 0.0, dtype=float), s.shape)
