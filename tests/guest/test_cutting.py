"""The live machine over SocketCAN: real processes, a real kernel, simulated drives."""

from __future__ import annotations

import numpy as np
from cutting import program
from guest import on_can
from living import assert_within_limits, off_path, session, traced

from controller.handoff import COLUMN
from controller.machine import Machine
from controller.state import Fault, Mode

ON_PATH_MM = 1e-6


def cut(machine: Machine, feed: str) -> int:
    """Example 2, cut on the path and within the limits; the number of cutting ticks that sent SYNC."""
    text = program("example2_ready", feed)
    with on_can.drives(), session(text, machine) as running:
        start = running.ready()
        rows, last = running.run()  # minutes: the guest itself is what would end a run that hangs
    assert (last.mode, last.fault) == (Mode.READY, Fault.NONE)
    cutting = rows[rows[:, COLUMN["cutting"]] != 0.0]
    sent = np.count_nonzero(cutting[:, COLUMN["sync_sent"]] != 0.0)
    print(f"{len(cutting)} ticks of cutting, {len(cutting) - sent} without SYNC, {last.skips} skips in all")
    assert off_path(rows, traced(text, machine, start.joints), machine).max() <= ON_PATH_MM
    assert_within_limits(rows, machine)
    assert running.recorder.lost == 0
    return sent


def test_ten_thousand_ticks_of_cutting_at_10_ms_stay_on_the_path() -> None:
    assert cut(on_can.machine(), "52.") >= 10_000


def test_a_part_is_cut_to_the_kernels_sync() -> None:
    assert cut(on_can.machine(sync="kernel"), "1000.") >= 500
