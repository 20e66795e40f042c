"""The laws of a chain as they are planned from rest to rest, and its joints as the tick samples them."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from support.machines import traced_programs

from controller.ipc.handoff import Law
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine
from controller.plan.feed import profile
from controller.plan.feed.course import FeedCourse
from controller.plan.segment import ContinuousPath, Segment, rotaries_of


def chains(source: str, machine: Machine) -> list[ContinuousPath]:
    home = tuple(axis.homing.position for axis in machine.axes)
    return [
        item
        for item in traced_programs.trace(source, machine, home).items
        if isinstance(item, ContinuousPath)
    ]  # type: ignore[arg-type]


def laws_of(segments: Sequence[Segment], machine: Machine, override: float = 1.0) -> list[Law]:
    """A law for each segment of a chain, as the planner runs it from rest to rest."""
    kinematics = kinematics_of(machine)
    laws = []
    for run in profile.split_at_stops(segments, machine, kinematics, override):
        course = FeedCourse(run, machine, kinematics, override)
        planned = profile.plan(course)
        assert planned is not None
        laws += [law for _, law in planned.laws(course)]
    return laws


def sampled(
    segments: Sequence[Segment], laws: Sequence[Law], machine: Machine
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Joints at every tick, standing before and after; and s of each segment at its ticks."""
    kinematics, T = kinematics_of(machine), machine.period_s
    ends = np.cumsum([law.duration_s for law in laws])
    near = rotaries_of(segments[0].start, kinematics)
    joints = [segments[0].start] * 4
    places: list[list[float]] = [[] for _ in laws]
    for n in itertools.count(1):
        k = int(np.searchsorted(ends, n * T, side="right"))
        if k == len(laws):
            break
        s = laws[k].at(n * T - (ends[k] - laws[k].duration_s))[0]
        q = segments[k].motion.joints(s, near, kinematics)
        assert q is not None
        near = rotaries_of(q, kinematics)
        joints.append(q)
        places[k].append(s)
    joints += [segments[-1].end] * 4
    return np.asarray(joints), [np.asarray(p) for p in places]
