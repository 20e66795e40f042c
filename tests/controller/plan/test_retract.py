"""Off the path: which ways are taken, and which tools are refused in a sentence."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
import pytest
from support.machines.interrupted_runs import EXAMPLE_2, LINES, LONG, rest_of, with_tool
from support.machines.stepped_runs import shipped

from controller.ipc.handoff import Snapshot, blank
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Joints
from controller.plan import retract
from controller.plan.off_path import SAME, Detour
from controller.plan.restart.program_position import Spot
from controller.plan.restart.reentry import along_axis, room_along_axis
from controller.plan.restart.restart import Rest
from controller.plan.retract import NotPossible
from controller.plan.stretch import Chain, Pause
from controller.program.program import Act, Place
from controller.state.modes import Mode

MACHINES = ("trunnion", "table_head", "head_head", "oblique45")
HELD = (10.0, 60.0, 100.0, 0.3, 0.4)
PLACE = Place(10, 1)


def corners(items: Iterable[Chain | Pause]) -> list[Joints]:
    """Where a way turns; it ends with a stop."""
    *chains, last = items
    assert isinstance(last, Pause) and last.act is Act.STOP
    stretches = [chain.stretches[0] for chain in chains if isinstance(chain, Chain)]
    return [stretches[0].start, *(stretch.end for stretch in stretches)]


def snapshot(joints: Joints, at_rest: bool = True, mode: Mode = Mode.HOLD) -> Snapshot:
    return blank()._replace(tick=LONG, mode=mode, joints=joints, at_rest=at_rest)


@pytest.mark.parametrize("name", MACHINES)
def test_a_retract_moves_the_tip_along_the_tool_axis_alone(name: str) -> None:
    machine = shipped(name)
    kinematics = kinematics_of(machine)
    held = (10.0, 20.0, -50.0, 0.3, 0.4)
    first, last = corners(retract.retract(held, 12.0, PLACE, machine, kinematics))
    (tip, axis), after = kinematics.forward(first, 7.0), kinematics.forward(last, 7.0)
    assert np.abs(np.subtract(after.tip, tip) - 12.0 * np.array(axis)).max() < 1e-9
    assert np.abs(np.subtract(after.axis, axis)).max() < 1e-12


def test_a_retract_that_the_travel_has_no_room_for_is_refused_with_what_there_is() -> None:
    machine = shipped()
    kinematics = kinematics_of(machine)
    assert room_along_axis(HELD, machine, kinematics) == pytest.approx(200.0)
    for by_mm in (0.0, -1.0, 200.1, math.nan, math.inf):
        with pytest.raises(NotPossible, match=r"up to 200\.000 mm"):
            retract.retract(HELD, by_mm, PLACE, machine, kinematics)


def rest(text: str = EXAMPLE_2, line: int = 4, **tool: float) -> Rest:
    return rest_of(text, Spot(line, 0.5), with_tool(shipped(), 2, **tool))


def test_a_tool_that_is_longer_than_it_stands_off_is_refused() -> None:
    machine = shipped()
    before, left = machine.tool(2), rest(LINES)
    after = with_tool(machine, 2, length_mm=5.0).tool(2)
    assert before is not None and after is not None
    with pytest.raises(NotPossible, match="retract by more"):
        retract.see_fits(HELD, HELD, before, after, left)
    retract.see_fits(along_axis(HELD, 5.1, kinematics_of(machine)), HELD, before, after, left)


def test_a_thicker_tool_is_refused_on_lines_that_are_not_compensated_for_it() -> None:
    machine = shipped()
    before = machine.tool(2)
    thick, thin = (with_tool(machine, 2, radius_mm=r).tool(2) for r in (2.0, 1.0))
    assert before is not None and thick is not None and thin is not None
    left = rest(LINES, 5)
    held = left.target.joints
    with pytest.raises(NotPossible, match=r"0\.500 mm thicker .* line 5 .* at most 1\.500 mm"):
        retract.see_fits(held, held, before, thick, left)
    retract.see_fits(held, held, before, thin, left)


def test_a_thicker_tool_must_stand_above_what_compensated_lines_have_left() -> None:
    machine = shipped()
    before, thick = machine.tool(2), with_tool(machine, 2, radius_mm=2.0).tool(2)
    assert before is not None and thick is not None
    text = "G21 G90 G54 T2 M6\nG0 X0 Y-5 Z40\nG1 Z20 F900\nG41 D2 G1 X0 Y0\nX30\nG40 Y-5\nG0 Z40\nM30\n"
    left = rest(text, 5)
    held, kinematics = left.target.joints, kinematics_of(machine)
    with pytest.raises(NotPossible, match=r"stands 8\.000 mm lower"):
        retract.see_fits(along_axis(held, 12.0, kinematics), held, before, thick, left)
    retract.see_fits(along_axis(held, 20.1, kinematics), held, before, thick, left)


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
