"""The shortest time of a path by toppra with velocity and acceleration limits alone: no controller beats it.

Each smooth segment from rest to rest, or at any speed where it joins another. Near an end at rest
the time lives in ever smaller steps, so the grid is refined there until the time is stable.
Joints are sampled and splined; nothing of the planner is used but the motions themselves.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np
import toppra
from scipy.interpolate import PPoly, make_interp_spline

from controller.machine.kinematics import Kinematics, kinematics_of
from controller.machine.model import Kind, Limits, Machine
from controller.plan.rotaries.branch import joints_along
from controller.plan.segment import Segment

STABLE = 1e-3
FIRST_GRID = 400
MAX_GRID = 26_000
ENDS = 3.0  # how strongly samples and grid gather at both ends

logging.getLogger("toppra").setLevel(logging.ERROR)


def linuxcnc(machine: Machine) -> Machine:
    """``machine`` with the limits that LinuxCNC ships for its xyzac simulation, jerk 30 a second of them."""
    line, turn = Limits(20.0, 300.0, 9000.0), Limits(*(math.radians(x) for x in (30.0, 300.0, 9000.0)))
    axes = (replace(axis, limits=line if axis.kind is Kind.LINEAR else turn) for axis in machine.axes)
    return replace(machine, axes=tuple(axes))


def seconds(segments: Iterable[Segment], machine: Machine) -> float:
    """Sum of the shortest times of the segments, each from rest to rest at no more than its feed."""
    kinematics = kinematics_of(machine)
    return sum(_of_one(segment, machine, kinematics, (False, False)) for segment in segments)


def seconds_of_cuts(run: Sequence[Segment], machine: Machine) -> float:
    """As ``seconds``, of the cuts in a row of segments that is run through without a rest."""
    kinematics, last = kinematics_of(machine), len(run) - 1
    return sum(
        _of_one(segment, machine, kinematics, (k > 0, k < last))
        for k, segment in enumerate(run)
        if segment.cutting
    )


def _of_one(segment: Segment, machine: Machine, kinematics: Kinematics, moving: tuple[bool, bool]) -> float:
    joints = sampled(segment, kinematics)
    feed = segment.feed_mm_s or 1e9
    count, before = FIRST_GRID, math.inf
    while True:
        grid = _gathered(count) * segment.motion.end
        now = _shortest(joints, segment.motion.end, machine, feed, grid, moving)
        if now < math.inf and abs(now - before) <= STABLE * now:
            return now
        if count > MAX_GRID:
            raise ValueError(f"toppra's time of the {segment.name} is not stable: {before} s, then {now} s.")
        count, before = 2 * count, now


def _gathered(count: int) -> np.ndarray:
    """0 to 1, close together at both ends: the steps there shrink with the count's third power."""
    x = np.linspace(-1.0, 1.0, count + 1)
    return 0.5 * (1.0 + np.sign(x) * (1.0 - (1.0 - np.abs(x)) ** ENDS))


def sampled(segment: Segment, kinematics: Kinematics, count: int = 4000) -> PPoly:
    """Joints over s as a quintic spline through samples that gather at both ends."""
    s = 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, count))) * segment.motion.end
    return make_interp_spline(s, np.asarray(joints_along(segment, s, kinematics)), k=5)


class _Path(toppra.interpolator.AbstractGeometricPath):  # type: ignore[misc, name-defined]
    def __init__(self, joints: Callable[..., np.ndarray], end: float) -> None:
        self._joints, self._end = joints, end

    dof = 5

    @property
    def path_interval(self) -> np.ndarray:
        return np.array([0.0, self._end])

    def __call__(self, s: np.ndarray, order: int = 0) -> np.ndarray:
        return self._joints(np.atleast_1d(np.asarray(s, dtype=float)), nu=order)


class _Feed(toppra.constraint.LinearConstraint):  # type: ignore[misc, name-defined]
    """The path speed is at most the feed."""

    def __init__(self, feed: float) -> None:
        super().__init__()
        self._feed, self.identical = feed, False
        self.discretization_type = toppra.constraint.DiscretizationType.Collocation

    def compute_constraint_params(self, path: object, grid: np.ndarray) -> tuple[object, ...]:
        return None, None, None, None, None, None, np.tile([0.0, self._feed**2], (len(grid), 1))


class _Planner(toppra.algorithm.TOPPRA):  # type: ignore[misc, name-defined]
    """The end may have any speed up to ``sd_end``; toppra's own must have just that."""

    def compute_controllable_sets(self, sdmin: float, sdmax: float) -> np.ndarray:
        return np.asarray(super().compute_controllable_sets(0.0, sdmax))


def _shortest(
    joints: Callable[..., np.ndarray],
    end: float,
    machine: Machine,
    feed: float,
    grid: np.ndarray,
    moving: tuple[bool, bool],
) -> float:
    """Seconds of the time-optimal profile on one grid (M,) from 0 to ``end``; inf where toppra fails.

    It does so on some grids by rounding and not on others; the next finer one is asked then.
    ``moving``: at the begin and at the end, where it else rests.
    """
    velocity = np.array([axis.limits.velocity for axis in machine.axes])
    acceleration = np.array([axis.limits.acceleration for axis in machine.axes])
    constraints = [
        toppra.constraint.JointVelocityConstraint(np.stack([-velocity, velocity], axis=1)),
        toppra.constraint.JointAccelerationConstraint(np.stack([-acceleration, acceleration], axis=1)),
        _Feed(feed),
    ]
    planner = _Planner(constraints, _Path(joints, end), gridpoints=grid, solver_wrapper="seidel")
    at_end, at_begin = feed if moving[1] else 0.0, 0.0
    if moving[0]:
        at_begin = math.sqrt(planner.compute_controllable_sets(0.0, at_end)[0, 1])
    _, speeds, _, _ = planner.compute_parameterization(at_begin, at_end, return_data=True)
    if speeds is None:
        return math.inf
    v = np.asarray(speeds)
    return float((2.0 * np.diff(grid) / (v[1:] + v[:-1])).sum())
