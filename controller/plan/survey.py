"""A path looked at whole before anything moves: duration, and how much every joint is asked for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from controller.handoff import Law
from controller.kinematics import Kinematics
from controller.machine import Machine
from controller.motions import SurfaceCut
from controller.plan import profile
from controller.plan.law import along
from controller.plan.limits import derivatives
from controller.plan.path import Chain, Path, Stretch, joints_along

Array = npt.NDArray[np.float64]

SAMPLES = 400  # per stretch


@dataclass(frozen=True, slots=True)
class JointUse:
    """Range of one joint over the path, and the largest shares of its limits (1.0 = the limit)."""

    name: str
    lowest: float  # mm or degrees, as shown outside
    highest: float
    travel: tuple[float, float]
    velocity_share: float
    acceleration_share: float
    jerk_share: float


@dataclass(frozen=True, slots=True)
class Survey:
    """What ``check`` tells of a program that can run."""

    duration_s: float
    cut_time_s: float
    cut_length_mm: float
    cuts_mm: tuple[float, ...]  # length of C1 of each surface
    joints: tuple[JointUse, ...]

    def to_dict(self) -> dict[str, Any]:
        return asdict(self)


def survey(
    path: Path, machine: Machine, kinematics: Kinematics, progress: Callable[[float], None] = lambda _: None
) -> Survey:
    """Plan the whole path at 100 % and measure it; ``progress`` gets the share done."""
    joints, shares = [], []
    duration = cut_time = 0.0
    for n, item in enumerate(path.items):
        progress(n / len(path.items))
        if not isinstance(item, Chain):
            duration += item.seconds
            continue
        for stretch, law in zip(item.stretches, profile.plan(item, machine, kinematics), strict=True):
            duration += law.duration_s
            cut_time += law.duration_s * stretch.cutting
            q, used = _measure(stretch, law, machine, kinematics)
            joints.append(q)
            shares.append(used)
    cuts = [
        stretch.motion.end
        for item in path.items
        if isinstance(item, Chain)
        for stretch in item.stretches
        if isinstance(stretch.motion, SurfaceCut)
    ]
    return Survey(duration, cut_time, float(sum(cuts)), tuple(cuts), _uses(joints, shares, machine))


def _measure(stretch: Stretch, law: Law, machine: Machine, kinematics: Kinematics) -> tuple[Array, Array]:
    """Joints at samples of the law, (N, 5), and the largest shares of the three limits, (3, 5)."""
    times = np.linspace(0.0, law.duration_s, SAMPLES)
    s, v, a, j = along(law, times)
    s = np.clip(s, 0.0, stretch.motion.end)
    d = derivatives(stretch, s, kinematics)
    limits = [axis.limits for axis in machine.axes]
    shares = [
        np.abs(value).max(axis=0) / np.array(limit)
        for value, limit in (
            (d.velocity(v), [x.velocity for x in limits]),
            (d.acceleration(v, a), [x.acceleration for x in limits]),
            (d.jerk(v, a, j), [x.jerk for x in limits]),
        )
    ]
    return joints_along(stretch, s, kinematics), np.array(shares)


def _uses(joints: list[Array], shares: list[Array], machine: Machine) -> tuple[JointUse, ...]:
    if not joints:
        return ()
    q, most = np.concatenate(joints), np.max(shares, axis=0)
    uses = []
    for i, axis in enumerate(machine.axes):
        ends = sorted(
            (float(q[:, i].min()) * axis.shown_per_unit, float(q[:, i].max()) * axis.shown_per_unit)
        )
        travel = sorted((axis.travel_min * axis.shown_per_unit, axis.travel_max * axis.shown_per_unit))
        uses.append(
            JointUse(axis.name, ends[0], ends[1], (travel[0], travel[1]), *(float(x) for x in most[:, i]))
        )
    return tuple(uses)
