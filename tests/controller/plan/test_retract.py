"""Off the path and back: which ways are taken, and which are refused in a sentence."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable

import numpy as np
import pytest
from support.machines.interrupted_runs import LONG
from support.machines.stepped_runs import shipped

from controller.ipc.handoff import Snapshot, blank
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Joints
from controller.plan import retract
from controller.plan.off_path import Detour
from controller.plan.restart.entry import along_axis, room_along_axis
from controller.plan.restart.program_position import Spot
from controller.plan.retract import Aside, NotPossible
from controller.plan.stretch import Chain, Pause
from controller.program.program import Act, Place
from controller.state.modes import Mode

MACHINES = ("trunnion", "table_head", "head_head", "oblique45")
HELD = (10.0, 60.0, 100.0, 0.3, 0.4)


def away(by_mm: float = 15.0, held: Joints = HELD) -> Aside:
    return Aside(Spot(10, 0.5, 4, 20.0), held, Place(10, 1), 2.0, by_mm)


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
    first, last = corners(retract.retract(away(12.0, held), machine, kinematics))
    (tip, axis), after = kinematics.forward(first, 7.0), kinematics.forward(last, 7.0)
    assert np.abs(np.subtract(after.tip, tip) - 12.0 * np.array(axis)).max() < 1e-9
    assert np.abs(np.subtract(after.axis, axis)).max() < 1e-12


def test_a_retract_that_the_travel_has_no_room_for_is_refused_with_what_there_is() -> None:
    machine = shipped()
    kinematics = kinematics_of(machine)
    assert room_along_axis(HELD, machine, kinematics) == pytest.approx(200.0)
    for by_mm in (0.0, -1.0, 200.1, math.nan, math.inf):
        with pytest.raises(NotPossible, match=r"up to 200\.000 mm"):
            retract.retract(away(by_mm), machine, kinematics)


def test_the_way_back_goes_through_every_turn_of_the_way_off() -> None:
    machine = shipped()
    kinematics = kinematics_of(machine)
    off = away()
    retract.retract(off, machine, kinematics)
    places = [off.turns[0], (40.0, 60.0, 115.0, 0.3, 0.4), (40.0, 20.0, 115.0, 0.3, 0.4)]
    for a, b in itertools.pairwise(places):
        for share in np.linspace(0.05, 1.0, 20):
            x = tuple(float(p + share * (q - p)) for p, q in zip(a, b, strict=True))
            off.see(snapshot(x, at_rest=bool(share == 1.0)))  # type: ignore[arg-type]
    back = corners(retract.back(off, places[-1], HELD, (0.0, 0.0), machine, kinematics))
    assert len(back) == 4
    assert np.abs(np.subtract(back, [*reversed(places), HELD])).max() < 1e-9


def test_a_turn_is_seen_also_where_the_jog_did_not_rest_in_it() -> None:
    off = away()
    off.turns = [HELD]
    way = [(10.0 + k, 60.0, 100.0, 0.3, 0.4) for k in range(10)]
    way += [(19.0, 60.0 + k, 100.0, 0.3, 0.4) for k in range(1, 10)]
    for joints in way:
        off.see(snapshot(joints, at_rest=False))
    assert any(abs(turn[0] - 19.0) < 1e-9 and abs(turn[1] - 60.0) < 1e-9 for turn in off.turns)


def test_with_a_longer_tool_the_tip_goes_the_same_way_back() -> None:
    machine = shipped("head_head")
    kinematics = kinematics_of(machine)
    held = (10.0, 20.0, -50.0, 0.3, 0.4)
    off = away(20.0, held)
    retract.retract(off, machine, kinematics)
    off.turns.append((40.0, 20.0, -10.0, 0.3, 0.4))
    target = along_axis(held, 5.0, kinematics)
    back = corners(retract.back(off, off.turns[-1], target, (30.0, 35.0), machine, kinematics))
    tips = [kinematics.forward(q, 35.0).tip for q in back[1:]]
    wanted = [kinematics.forward(q, 30.0).tip for q in (*reversed(off.turns), held)]
    assert np.abs(np.subtract(tips, wanted)).max() < 1e-9


def test_a_tool_that_is_longer_than_the_retract_is_refused() -> None:
    machine = shipped()
    kinematics = kinematics_of(machine)
    off = away(5.0)
    retract.retract(off, machine, kinematics)
    with pytest.raises(NotPossible, match="retract by more"):
        retract.back(off, off.turns[0], HELD, (0.0, 5.0), machine, kinematics)


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
        detour.go_back(snapshot(HELD), None, (0.0, 0.0))
