"""The live machine over SocketCAN: real processes, a real kernel, simulated drives."""

from __future__ import annotations

import numpy as np
from guest import on_can
from support.live.live_machines import assert_within_limits, off_path, traced
from support.machines.stepped_runs import program

from controller.ipc.handoff import COLUMN, OFF_PATH
from controller.machine.model import Machine
from controller.state.modes import Fault, Mode

ON_PATH_MM = 1e-6


def cut(machine: Machine, feed: str) -> int:
    """Example 2, cut on the path and within the limits; the number of cutting ticks that sent SYNC.

    A cut from which the computer was away ends on the path, too, and is begun anew.
    """
    for _ in range(on_can.ATTEMPTS):
        sent, fault, away = attempt(machine, feed)
        if not away:
            break
    on_can.skip_if_away(away)
    assert fault is Fault.NONE
    return sent


def attempt(machine: Machine, feed: str) -> tuple[int, Fault, bool]:
    """(cutting ticks that sent SYNC, what ended it, whether the computer was away then).

    On the path until then, and within the limits.
    """
    text = program("example2_ready", feed)
    with on_can.drives(), on_can.ready(text, machine) as (running, start):
        rows, last = running.run()  # minutes: the guest itself is what would end a run that hangs
        away = on_can.held_up(last.fault)
    assert last.mode is (Mode.READY if last.fault is Fault.NONE else Mode.FAULT)
    cutting = rows[rows[:, COLUMN["cutting"]] != 0.0]
    sent = int(np.count_nonzero(cutting[:, COLUMN["sync_sent"]] != 0.0))
    print(f"{len(cutting)} ticks of cutting, {len(cutting) - sent} without SYNC, {last.skips} skips in all")
    moved = rows[rows[:, COLUMN["switches"]].astype(int) & OFF_PATH == 0]  # behind it: where the drives are
    assert off_path(moved, traced(text, machine, start.joints), machine).max() <= ON_PATH_MM
    assert_within_limits(moved, machine)
    assert running.recorder.lost == 0
    return sent, last.fault, away


def test_ten_thousand_ticks_of_cutting_at_10_ms_stay_on_the_path() -> None:
    assert cut(on_can.machine(), "52.") >= 10_000
