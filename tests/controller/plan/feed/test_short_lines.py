"""Exact lines much shorter than what a tick's jump takes around it: no slower than with a rest at each corner."""

from __future__ import annotations

import pytest
from support.machines.planned_laws import chains, laws_of, sampled
from support.machines.stepped_runs import SHIPPED, largest, shipped
from support.parts import cam_programs

from controller.machine.kinematics import kinematics_of
from controller.motion.motions import ToolLine
from controller.plan.feed import profile
from controller.plan.feed.course import Course

NAMES = [
    name if name in ("trunnion", "head_head") else pytest.param(name, marks=pytest.mark.slow)
    for name in SHIPPED
]
AT_LEAST = 20  # lines that are looked at


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(("step_mm", "decimals"), [(0.02, 4), (0.02, 3), (0.1, 4)])
def test_running_through_short_lines_is_quicker_than_a_rest_at_each_of_their_corners(
    name: str, step_mm: float, decimals: int
) -> None:
    machine = shipped(name)
    made = cam_programs.bowl(1, 25.0 * step_mm, step_mm=step_mm)
    source, _ = cam_programs.text(made, 2000.0, True, "G61", decimals=decimals)
    looked = 0
    for chain in chains(source, machine):
        lines = [s for s in chain.stretches if isinstance(s.motion, ToolLine)]
        if not lines:
            continue
        laws = laws_of(lines, machine)
        velocity, acceleration, jerk = largest(sampled(lines, laws, machine)[0], machine)
        assert velocity <= 1.0005 and acceleration <= 1.0005 and jerk <= 1.0005
        alone = [profile.plan(Course([line], machine, kinematics_of(machine))) for line in lines]
        at_rests = sum(law.duration_s for law in alone if law is not None)
        assert sum(law.duration_s for law in laws) <= 1.02 * at_rests
        looked += len(lines)
    assert looked >= AT_LEAST
