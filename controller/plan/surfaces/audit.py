"""Audits over dense samples: joints inside their travel, cutter outside the part."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from controller.geometry.arrays import Array, rows
from controller.geometry.vectors import ROUNDING, Vector
from controller.machine import tool_profile
from controller.machine.model import Axis, Joints, Machine, Tool
from controller.messages import Message, message
from controller.motion.motions import SurfaceCut
from controller.plan.surfaces import deviation
from controller.plan.surfaces.cuts import Cut, flank

MOVE = message("travel.move")  # what helps against a joint outside of its travel
POINTS_PER_CUT = (161, 7)  # along and across, for the gouge check of leads
MAX_POINTS = 20000
TURN_POSES = 33
BESIDE = 0.1  # share of u on either side of a joint that is looked at while the tool turns there


class Excess(NamedTuple):
    """A joint outside of its travel: which, at which sample, where it gets to and by how much."""

    axis: int
    sample: int
    value: float
    by: float  # mm or rad


def extremes(x: Array, values: Array) -> tuple[Array, Array, Array, Array]:
    """(lowest, its sample, highest, its sample) of each column of ``values`` (N, k) over ``x`` (N,).

    Beside the samples the vertex of the parabola through three neighbours counts, so
    that an extreme between samples is not missed.
    """
    low, high = values.copy(), values.copy()
    if len(x) > 2:
        h0, h1 = (x[1:-1] - x[:-2])[:, None], (x[2:] - x[1:-1])[:, None]
        d0, d1 = np.diff(values, axis=0)[:-1] / h0, np.diff(values, axis=0)[1:] / h1
        slope, bend = (d0 * h1 + d1 * h0) / (h0 + h1), (d1 - d0) / (h0 + h1)
        vertex = (d0 * d1 < 0.0) & (bend != 0.0)
        peak = values[1:-1] - np.where(vertex, slope * slope / np.where(vertex, 4.0 * bend, 1.0), 0.0)
        low[1:-1], high[1:-1] = np.minimum(low[1:-1], peak), np.maximum(high[1:-1], peak)
    i, j = np.argmin(low, axis=0), np.argmax(high, axis=0)
    columns = np.arange(values.shape[1])
    return low[i, columns], i, high[j, columns], j


def outside(machine: Machine, x: Array, joints: Array, rotary: bool = True) -> Excess | None:
    """The joint (of all, or of the linear ones) that leaves its travel most, each in its own unit."""
    low, i, high, j = extremes(x, joints)
    found = []
    for n, axis in enumerate(machine.axes):
        if axis.is_rotary and not rotary:
            continue
        under, over = axis.travel_min - float(low[n]), float(high[n]) - axis.travel_max
        found.append(Excess(n, int(i[n]), float(low[n]), under))
        found.append(Excess(n, int(j[n]), float(high[n]), over))
    worst = max(found, key=lambda excess: excess.by)
    return worst if worst.by > ROUNDING else None


def surely_inside(machine: Machine, rows: Sequence[Joints]) -> bool:
    """Whether samples are so far inside of the travel that ``outside`` finds nothing, on floats.

    A parabola through three of them reaches beyond the outmost by less than they are apart.
    """
    for axis, values in zip(machine.axes, zip(*rows, strict=True), strict=True):
        low, high = min(values), max(values)
        apart = high - low
        if low - apart < axis.travel_min or high + apart > axis.travel_max:
            return False
    return True


def outside_at(machine: Machine, joints: Joints) -> Excess | None:
    """As ``outside`` for one position, on floats."""
    for n, (axis, q) in enumerate(zip(machine.axes, joints, strict=True)):
        by = max(axis.travel_min - q, q - axis.travel_max)
        if by > ROUNDING:
            return Excess(n, 0, q, by)
    return None


def describe(axis: Axis, excess: Excess, where: Message | str = "", advice: Message = MOVE) -> Message:
    """One sentence: which axis, where, how far, what is allowed and what to do."""
    return message("travel.beyond", where=where, advice=advice, **beyond(axis, excess))


def beyond(axis: Axis, excess: Excess) -> dict[str, object]:
    """The axis, how far it would get and what is allowed, for a text; in its unit outside."""
    k = axis.shown_per_unit
    low, high = sorted((axis.travel_min * k, axis.travel_max * k))
    unit = "deg" if axis.is_rotary else "mm"
    reached = {"value": excess.value * k, "by": abs(excess.by * k)}
    return {"axis": axis.name, "unit": unit, "low": low, "high": high, **reached}


def at_place(cut: Cut, u: float) -> Message:
    """Where on a block, for a sentence: its parameter and the contact, part frame."""
    x, y, z = cut.motion.surface.contact(u)
    return message("travel.at", u=cut.block_u(u), x=x, y=y, z=z)


# ---- gouging ---------------------------------------------------------------------


def surface_points(cuts: Sequence[Cut]) -> Array:
    """Points (3, N) of the surfaces of joined cuts, table frame."""
    along, across = POINTS_PER_CUT
    along = max(9, min(along, MAX_POINTS // (across * len(cuts))))
    u, v = np.meshgrid(np.linspace(0.0, 1.0, along), np.linspace(0.0, 1.0, across), indexing="ij")
    columns = []
    for cut in cuts:
        point = cut.motion.surface.point(u.ravel(), v.ravel(), np)
        columns.append(np.array(cut.motion.part.to_parent(point)))
    return np.concatenate(columns, axis=1)


def depth(points: Array, tips: Array, axes: Array, tool: Tool) -> float:
    """Deepest that the flank of a tool on tips (3, M) along axes (3, M) reaches into ``points`` (3, N), mm.

    It is a cylinder, or the cone of a taper or about a barrel. What lies below the tip's plane
    the end does not touch. 0 where nothing is reached.
    """
    poses = zip(tips.T, axes.T, strict=True)
    return max(0.0, *(in_flank(*above(points, tip, axis), tool) for tip, axis in poses))


def above(points: Array, tip: Array, axis: Array) -> tuple[Array, Array]:
    """Of those ``points`` (3, N) that lie above a tip's plane: heights, and distances to the axis (M,)."""
    away = points - tip[:, None]
    height = axis @ away
    square = np.einsum("ij,ij->j", away, away) - height * height
    those = height > -1e-6
    return height[those], np.sqrt(np.maximum(square[those], 0.0))


def in_flank(height: Array, off: Array, tool: Tool) -> float:
    """How deep the deepest of points (M,) is in it; below 0 the nearest is so far off it."""
    cutter = tool_profile.flank(tool).radius_mm(height) - off
    return float(cutter.max(initial=-np.inf)) * math.cos(tool.taper_rad)


def depth_near(cut: Cut, points: Array, at_start: bool, reach_mm: float) -> float:
    """As ``depth`` for the cut itself over ``reach_mm`` next to one of its ends."""
    length = cut.motion.arc.length_mm
    s = np.linspace(0.0, min(reach_mm, length), 13)
    u = cut.motion.arc.u_along(s if at_start else length - s)
    tip, axis = cut.motion.surface.pose(u, cut.motion.offset_mm, np)
    part = cut.motion.part
    shape = np.zeros((3, len(u)))
    return depth(
        points,
        np.array(part.to_parent(tip)) + shape,
        shape + _rows(part.turn(axis)),
        cut.tool,
    )


def _rows(vector: Vector) -> Array:
    return np.array([np.atleast_1d(c) for c in np.broadcast_arrays(*vector)])


def depth_in_turn(way: SurfaceCut, before: Cut, after: Cut) -> float:
    """How deep (mm) the flank gets into both surfaces while the tool turns from one placement to the next.

    As far as the corner of the tool reaches nothing is looked at: it touches the lower edge only.
    """
    poses = [way.surface.pose(float(x), 0.0) for x in np.linspace(0.0, 1.0, TURN_POSES)]
    tips, axes = (np.array(column) for column in zip(*poses, strict=True))
    deepest = 0.0
    for cut, u in ((before, 1.0 - BESIDE * _JOINT_SHARES), (after, BESIDE * _JOINT_SHARES)):
        points = _beside(cut, u)
        gap = deviation.at_poses(tips, axes, flank(cut), points)
        deepest = max(deepest, -float(gap.min()))
    return deepest


_JOINT_SHARES = np.linspace(0.0, 1.0, 65) ** 2  # closer towards the joint


def _beside(cut: Cut, u: Array) -> Array:
    """Points (3, N) of a surface at the rulings ``u``, part frame."""
    along, across = (a.ravel() for a in np.meshgrid(u, np.linspace(0.0, 1.0, 17), indexing="ij"))
    point = cut.motion.surface.point(along, across, np)
    return rows(point, along.shape)
