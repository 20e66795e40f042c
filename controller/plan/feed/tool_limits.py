"""The optional limits of the tool itself: its tip's acceleration and its axis' turning, in the part frame.

The machine file may bound how hard the tip is accelerated and how fast the axis turns as
the part sees them; both hold for feed moves. With p(s) the tip and o(s) the axis

    tip     | p'' z + p' z' / 2 |  <=  A          z = v^2
    axis    | o' | v               <=  w

The norm of the tip's acceleration is that of a vector in the plane of p' and p''. A polygon
about that plane's circle makes it a row of linear limits; it lies inside the circle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from controller.geometry import series as jets
from controller.geometry.arrays import Array, distinct
from controller.geometry.curves import Line
from controller.machine.model import Machine
from controller.motion.motions import JointMove, Motion
from controller.plan.feed.course import FeedCourse, Index
from controller.plan.rotaries.branch import joints_along
from controller.plan.surfaces.rates import Derivatives, derivatives

DIRECTIONS = 12  # of half the polygon's sides; the other half are their opposites
INSIDE = math.cos(math.pi / (2 * DIRECTIONS))  # of the circle that the polygon's corners touch


@dataclass(frozen=True, slots=True)
class ToolRates:
    """p' along itself, p'' along and across p', (N,) each, and how fast the axis turns, rad per unit of s."""

    along: Array
    bend_along: Array
    bend_across: Array
    turn: Array

    def tip_acceleration(self, v: Array, a: Array) -> Array:
        return np.hypot(self.along * a + self.bend_along * v * v, self.bend_across * v * v)


def has_limits(machine: Machine) -> bool:
    return machine.tip_acceleration_mm_s2 is not None or machine.axis_speed_rad_s is not None


def rates(course: FeedCourse, s: Array, index: Index) -> ToolRates:
    """What the tool does at the places ``s`` (N,) of the segments ``index``; nothing on rapids."""
    found = ToolRates(*(np.zeros(len(s)) for _ in range(4)))
    length = max((getattr(x.motion, "length_mm", 0.0) for x in course.segments), default=0.0)
    for k in distinct(index):
        segment, here = course.segments[k], index == k
        if segment.feed_mm_s is None:
            continue
        if goes_straight(segment.motion):
            found.along[here] = 1.0
            continue
        local = np.clip(s[here] - course.zeros[k], 0.0, segment.motion.end)
        q = joints_along(segment, local, course.kinematics)
        one = _of_joints(q, derivatives(segment, local, course.kinematics), course, length)
        for name in ("along", "bend_along", "bend_across", "turn"):
            getattr(found, name)[here] = getattr(one, name)
    return found


def goes_straight(motion: Motion) -> bool:
    """Whether the tip goes straight with X Y Z, a millimetre for each of s, while the rotaries stand."""
    if not isinstance(motion, JointMove) or not isinstance(motion.curve, Line):
        return False
    return motion.start_rotaries == motion.end_rotaries


def rates_in(course: FeedCourse, s: Array, index: Index) -> ToolRates | None:
    """The same, or None where the machine has no such limits."""
    return rates(course, s, index) if has_limits(course.machine) else None


def _of_joints(q: Array, d: Derivatives, course: FeedCourse, length_mm: float) -> ToolRates:
    series = [
        jets.Jet(np.stack([q[:, i], d.first[:, i], d.second[:, i] / 2.0, d.third[:, i] / 6.0]))
        for i in range(q.shape[1])
    ]
    pose = course.kinematics.forward(series, length_mm, jets)
    first, second = (_orders(pose.tip, k, len(q)) * math.factorial(k) for k in (1, 2))
    along = np.linalg.norm(first, axis=1)
    unit = first / np.maximum(along, 1e-12)[:, None]
    bend_along = (second * unit).sum(axis=1)
    across = np.linalg.norm(second - bend_along[:, None] * unit, axis=1)
    return ToolRates(along, bend_along, across, np.linalg.norm(_orders(pose.axis, 1, len(q)), axis=1))


def _orders(vector: tuple[object, object, object], k: int, n: int) -> Array:
    """The k-th Taylor coefficients of a vector of series, (N, 3)."""
    values = [c.c[k] if isinstance(c, jets.Jet) else 0.0 for c in vector]
    return np.stack([np.broadcast_to(np.asarray(value, dtype=float), (n,)) for value in values], axis=1)


def most_speed(course: FeedCourse, rates: ToolRates | None, n: int) -> Array:
    """Speed that both limits allow where the path acceleration is none, (n,)."""
    machine = course.machine
    most = np.full(n, math.inf)
    if rates is None:
        return most
    if machine.axis_speed_rad_s is not None:
        most = np.minimum(most, machine.axis_speed_rad_s / (rates.turn + 1e-30))
    if machine.tip_acceleration_mm_s2 is not None:
        bend = np.hypot(rates.bend_along, rates.bend_across)
        most = np.minimum(most, np.sqrt(machine.tip_acceleration_mm_s2 / (bend + 1e-30)))
    return most
