"""How fast the joints' limits let the contact run beside the end of a cut, as its bare surface is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from support.machines.stepped_runs import Cut

from controller.geometry.placement import Blended
from controller.motion.motions import SurfaceCut
from controller.plan.feed.course import FeedCourse
from controller.plan.feed.limits import JointLimits
from controller.plan.segment import Segment


def allowed_mm_s(segment: Segment, done: Cut, beside_mm: float, at_end: bool = False) -> float:
    """The least speed that the limits allow within ``beside_mm`` of the begin or the end of a cut, mm/s."""
    motion = segment.motion
    assert isinstance(motion, SurfaceCut)
    surface = motion.surface
    bare = replace(motion, surface=replace(surface, blends=()) if isinstance(surface, Blended) else surface)
    s = np.linspace(0.001, min(beside_mm, bare.end - 0.001), 41)
    course = FeedCourse((replace(segment, motion=bare),), done.machine, done.kinematics)
    rates = course.derivatives(bare.end - s if at_end else s)
    return float(JointLimits.of(done.machine).path_speed(rates).min())
