"""A mill with spindle, inputs, outputs and clamps as a live machine: hub, plan and tick, each a process."""

from __future__ import annotations

import pytest
from support.live.live_machines import run, session
from support.machines.spindle_machine import C_CLOSED, COOLANT, mill

from controller.ipc.handoff import Snapshot
from controller.state.modes import Fault, Mode

PROGRAM = """G21 G90 G54
S6000 M3 M8
G1 X10. Y-50. Z130. F6000
G1 C10. F2000
M30
"""


@pytest.mark.slow
@pytest.mark.live
def test_a_program_waits_for_spindle_coolant_and_clamp_and_leaves_all_off() -> None:
    seen: list[Snapshot] = []
    with session(PROGRAM, mill()) as running:
        running.ready()
        _, last = run(running, seen.append)
    assert (last.mode, last.fault) == (Mode.READY, Fault.NONE)
    assert last.joints[4] > 0.17
    working = [now for now in seen if now.mode is Mode.RUNNING and not now.waiting and now.line in (3, 4)]
    assert working and all(now.spindle_at_speed and now.outputs >> COOLANT & 1 for now in working)
    turning = [now for now in working if now.line == 4 and 0.01 < now.joints[4] < 0.16]
    assert not any(now.inputs >> C_CLOSED & 1 for now in turning)
