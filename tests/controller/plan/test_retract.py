"""Off the path: which ways are taken, and when there is none."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
import pytest
from support.machines.interrupted_runs import LONG
from support.machines.stepped_runs import shipped

from controller.ipc.handoff import Snapshot, blank
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Joints
from controller.plan import off_path
from controller.plan.off_path import SAME, Detour
from controller.plan.restart.reentry import NotPossible, room_along_axis
from controller.plan.segment import ContinuousPath, PathItem, Pause
from controller.program.program import Act, Place
from controller.state.modes import Mode

MACHINES = ("trunnion", "table_head", "head_head", "oblique45")
HELD = (10.0, 60.0, 100.0, 0.3, 0.4)
PLACE = Place(10, 1)


def corners(items: Iterable[PathItem]) -> list[Joints]:
    """Where a way turns; it ends with a stop."""
    *chains, last = items
    assert isinstance(last, Pause) and last.act is Act.STOP
    segments = [chain.segments[0] for chain in chains if isinstance(chain, ContinuousPath)]
    return [segments[0].start, *(segment.end for segment in segments)]


def snapshot(joints: Joints, at_rest: bool = True, mode: Mode = Mode.HOLD) -> Snapshot:
    return blank()._replace(tick=LONG, mode=mode, joints=joints, at_rest=at_rest)


@pytest.mark.parametrize("name", MACHINES)
def test_a_retract_moves_the_tip_along_the_tool_axis_alone(name: str) -> None:
    machine = shipped(name)
    kinematics = kinematics_of(machine)
    held = (10.0, 20.0, -50.0, 0.3, 0.4)
    first, last = corners(off_path.retract(held, 12.0, PLACE, machine, kinematics))
    (tip, axis), after = kinematics.forward(first, 7.0), kinematics.forward(last, 7.0)
    assert np.abs(np.subtract(after.tip, tip) - 12.0 * np.array(axis)).max() < 1e-9
    assert np.abs(np.subtract(after.axis, axis)).max() < 1e-12


def test_a_retract_that_the_travel_has_no_room_for_is_refused_with_what_there_is() -> None:
    machine = shipped()
    kinematics = kinematics_of(machine)
    assert room_along_axis(HELD, machine, kinematics) == pytest.approx(200.0)
    for by_mm in (0.0, -1.0, 200.1, math.nan, math.inf):
        with pytest.raises(NotPossible, match=r"up to 200\.000 mm"):
            off_path.retract(HELD, by_mm, PLACE, machine, kinematics)


@pytest.mark.parametrize("mode", [mode for mode in Mode if mode is not Mode.HOLD])
def test_off_the_path_and_back_is_asked_for_in_a_hold_at_rest(mode: Mode) -> None:
    machine = shipped()
    detour = Detour(machine, kinematics_of(machine))
    with pytest.raises(NotPossible, match=mode.name):
        detour.retract(snapshot(HELD, mode=mode), None, None, 5.0)
    with pytest.raises(NotPossible, match="HOLD"):
        detour.retract(snapshot(HELD, at_rest=False), None, None, 5.0)


def test_without_a_program_there_is_no_path_to_leave_and_none_to_return_to() -> None:
    machine = shipped()
    detour = Detour(machine, kinematics_of(machine))
    with pytest.raises(NotPossible, match="out of a program"):
        detour.retract(snapshot(HELD), None, None, 5.0)
    with pytest.raises(NotPossible, match="has not left the path"):
        detour.go_back(snapshot(HELD), None, None, SAME)
