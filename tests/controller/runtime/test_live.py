"""The live machine: real processes on the wall clock, killed, stopped and refused.

Nothing here asserts a time of day. What counts are SYNCs, rows, and stamps of the bus; limits on
waiting are there so that a test that hangs fails.
"""

from __future__ import annotations

import os
import random
import re
import signal
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.live.live_machines import (
    Listener,
    assert_within_limits,
    gone,
    now_of,
    off_path,
    processes,
    run,
    session,
    traced,
    until,
)
from support.machines.stepped_runs import program, shipped

from controller.ipc.handoff import COLUMN, STOOD, Snapshot
from controller.machine import drive_profiles, machine_file
from controller.runtime.startup import SessionError
from controller.state.modes import Fault, Mode
from drives import cia402, pdo
from drives.bench.simulated import family_sheet
from drives.cia402 import State
from drives.profile import Supervision

SEED = int(os.environ.get("DIRECTRIX_TEST_SEED", random.SystemRandom().randrange(10**6)))
ON_PATH_MM = 1e-6
LONGEST_FRAME_S = 135e-6  # may be on the wire before SYNC
LOCKED, LOCKED_MB = re.compile(r"^VmLck:\s+(\d+) kB$", re.MULTILINE), 60
DRY = "G21 G90 G54 G0 X5.\nM30\n"


# ---- a cut -------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.live
def test_a_cut_in_real_time_completes_on_the_path_in_two_processes_and_a_hub() -> None:
    machine, text = shipped(), program("example1_ready", "700.")
    before = processes(os.getpid())
    seen: dict[str, Any] = {}

    def look(now: Snapshot) -> None:
        if now.cutting and not seen:
            children = processes(os.getpid())
            seen["names"] = sorted(name for pid, name in children.items() if pid not in before)
            seen["threads"] = len(os.listdir(f"/proc/{running.tick.pid}/task"))

    with session(text, machine) as running:
        start = running.ready()
        rows, last = run(running, look)
        end = now_of(running)
        process = Path(f"/proc/{running.tick.pid}")
        libraries, status = (process / "maps").read_text(), (process / "status").read_text()
    # Also after a cut: nothing that it was sent has brought numpy with it.
    assert "numpy" not in libraries and LOCKED.findall(status)
    assert all(int(kb) < LOCKED_MB * 1024 for kb in LOCKED.findall(status))
    assert (last.mode, last.fault) == (Mode.READY, Fault.NONE)
    assert seen == {"names": ["directrix-plan", "directrix-tick", "virtual-bus"], "threads": 1}
    assert off_path(rows, traced(text, machine, start.joints), machine).max() <= ON_PATH_MM
    assert_within_limits(rows, machine)
    cut = rows[rows[:, COLUMN["cutting"]] != 0.0]
    assert 94.0 < cut[-1, COLUMN["s"]] - cut[0, COLUMN["s"]] <= 94.2478
    assert running.recorder.lost == 0
    assert last.skips <= 0.02 * last.tick
    # The path clock counts SYNCs: it stands in every tick that sent none. After a gap so long that
    # the drives stand, what the last tick sent and no drive has used is taken back.
    sent = rows[1:, COLUMN["sync_sent"]] != 0.0
    back = rows[1:, COLUMN["switches"]].astype(int) & STOOD != 0
    steps, tick_s = np.diff(rows[:, COLUMN["plan_time_s"]]), machine.period_s * (1.0 + 1e-9)
    assert steps[sent].max() <= tick_s
    assert not steps[~sent & ~back].any()
    assert np.abs(steps[back] + tick_s / 2.0).max(initial=0.0) <= tick_s / 2.0
    (stamps_s,) = running.sync_stamps_s.values()
    assert len(stamps_s) >= end.tick + 1 - end.skips
    assert np.diff(stamps_s).min() >= 0.75 * machine.period_s - LONGEST_FRAME_S


@pytest.mark.slow
@pytest.mark.live
def test_simulated_drives_of_makers_families_come_up_under_one_tick(tmp_path: Path) -> None:
    """One of them is guarded: the tick asks it for its state while the plan commissions it."""
    machine = shipped()
    families = [
        drive_profiles.load(name) for name in ("maxon_epos4", "technosoft_ipos", "elmo_gold", "generic")
    ]
    assert [f.name for f in families if f.supervision is Supervision.GUARDING] == ["technosoft_ipos"]
    sheets = [str(family_sheet.write(tmp_path / f"{family.name}.eds", family)) for family in families]
    own = zip(machine.axes[:4], families, sheets, strict=True)
    axes = (*(replace(axis, profile=family.name, eds=eds) for axis, family, eds in own), *machine.axes[4:])
    with session(DRY, replace(machine, axes=axes)) as running:
        running.ready()
        _, last = run(running)
    assert (last.mode, last.fault) == (Mode.READY, Fault.NONE)


@pytest.mark.slow
@pytest.mark.live
def test_leaving_a_session_in_the_middle_of_a_cut_stops_on_the_path_and_switches_the_drives_off() -> None:
    machine, text = shipped(), program("example2_ready", "3000.")
    with session(text, machine) as running:
        start = running.ready()
        running.recorder.drain()
        running.start()
        until(lambda: now_of(running).cutting and now_of(running).rate == 1.0)
    rows, end = running.recorder.drain(), now_of(running)
    assert end.at_rest
    assert State.OPERATION_ENABLED not in end.drive_states
    moving = rows[rows[:, COLUMN["rate"]] > 0.0]
    assert off_path(moving, traced(text, machine, start.joints), machine).max() <= ON_PATH_MM
    assert_within_limits(rows, machine)  # all of them: a late computer has the path stand in its middle
    assert gone([running.tick.pid, running.plan.pid, *(hub.pid for hub in running.hubs.values())])


@pytest.mark.slow
@pytest.mark.live
def test_a_program_without_motion_is_over_at_once_and_told_as_completed() -> None:
    with session("G21 G90\nM3 S1000\nM5\nM30\n") as running:
        running.ready()
        _, last = run(running)
    assert (last.mode, last.fault) == (Mode.READY, Fault.NONE)


@pytest.mark.slow
@pytest.mark.live
def test_a_machine_at_rest_sleeps_through_ticks_that_are_all_on_the_bus_and_wakes_for_a_start() -> None:
    """What is said again goes out ahead of its time: each tick has its row, and each that is sent a SYNC."""
    machine = shipped(period_s=0.002, late="count")
    with session(DRY, machine) as running:
        running.ready()
        running.recorder.drain()
        woken, before = _woken(running.tick.pid), now_of(running)
        until(lambda: now_of(running).tick >= before.tick + 2000)
        woken, after = _woken(running.tick.pid) - woken, now_of(running)
        rest = running.recorder.drain()
        rows, last = run(running)
        end = now_of(running)
    assert woken < 0.5 * (after.tick - before.tick), "it is woken for each tick"
    assert (last.mode, last.fault) == (Mode.READY, Fault.NONE)
    assert last.joints[0] == pytest.approx(5.0 + machine.offsets[0].origin[0])
    every = np.concatenate([rest, rows])
    sent = np.count_nonzero(every[:, COLUMN["sync_sent"]])
    ticks = every[-1, COLUMN["tick"]] - every[0, COLUMN["tick"]] + 1  # those for which it came too late, too
    assert not running.recorder.lost and ticks - sent <= end.skips and sent > 2000 - end.skips
    assert_within_limits(every, machine)
    (stamps_s,) = running.sync_stamps_s.values()
    assert len(stamps_s) >= end.tick + 1 - end.skips
    assert np.diff(stamps_s).min() >= 0.75 * machine.period_s - LONGEST_FRAME_S


def _woken(pid: int) -> int:
    """How often the process has slept by itself."""
    rows = Path(f"/proc/{pid}/status").read_text()
    return int(re.findall(r"^voluntary_ctxt_switches:\s+(\d+)$", rows, re.MULTILINE)[0])


EXAMPLE_2 = program("example2_ready", "3000.")


# ---- the tick is gone ------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.live
def test_without_the_tick_the_drives_stop_by_their_own_supervision() -> None:
    machine = shipped()
    nodes = [axis.node for axis in machine.axes]
    lost = (
        machine_file.master_settings(machine).consumer_s / machine_file.master_settings(machine).heartbeat_s
    )
    with session(EXAMPLE_2, machine) as running:
        running.ready()
        listener = Listener(running.machine)

        def strike(now: Snapshot) -> None:
            listener.listen()
            if now.cutting and now.rate == 1.0 and running.tick.is_alive():
                os.kill(running.tick.pid, signal.SIGKILL)
                running.tick.process.wait()

        with pytest.raises(SessionError) as refused:
            run(running, strike)
        sentence = str(refused.value)
        assert "tick process was killed by signal SIGKILL" in sentence and "start again" in sentence

        def all_told() -> bool:
            listener.listen()
            end = listener.last_sync()
            return all(listener.count(pdo.EMCY + node, end) for node in nodes)

        until(all_told)
        end = listener.last_sync()
        for node in nodes:
            told = next(
                i for i, (heard, _) in enumerate(listener.frames) if i > end and heard == pdo.EMCY + node
            )
            # Whichever comes first: our heartbeat is missing, or a setpoint is (CiA 301, RPDO timeout).
            assert int.from_bytes(listener.frames[told][1][:2], "little") in (0x8130, 0x8250)
            # The drives' own heartbeats are the clock here: one every 50 ms of bus time.
            beats = sum(heard == pdo.HEARTBEAT + node for heard, _ in listener.frames[end:told])
            assert beats <= lost + 1
            assert not listener.count(0x180 + node, told)  # without SYNC no feedback

        def beats() -> int:
            listener.listen()
            return listener.count(pdo.HEARTBEAT + nodes[0])

        begun = beats()
        until(lambda: beats() >= begun + 20)  # a second of bus time: every ramp is over
        first = [listener.read(node, 0x6064) for node in nodes]
        until(lambda: beats() >= begun + 24)
        assert [listener.read(node, 0x6064) for node in nodes] == first
        for axis in machine.axes:
            state = cia402.state(listener.read(axis.node, 0x6041) & 0xFFFF)
            # An axis that would fall is held by its motor after the ramp.
            assert state is (State.QUICK_STOP_ACTIVE if axis.brake else State.SWITCH_ON_DISABLED)
    assert gone([running.tick.pid, running.plan.pid, *(hub.pid for hub in running.hubs.values())])


# ---- the bus is gone ---------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.live
def test_without_the_bus_the_tick_names_the_fault_and_comes_to_rest() -> None:
    with session(EXAMPLE_2) as running:
        running.ready()
        (hub,) = running.hubs.values()

        def strike(now: Snapshot) -> None:
            if now.cutting and hub.is_alive():
                os.kill(hub.pid, signal.SIGKILL)

        rows, last = run(running, strike)
        assert last.mode is Mode.FAULT
        assert last.fault in (Fault.BUS_ERROR, Fault.SEND_FAILED, Fault.FEEDBACK_LOST)
        assert running.tick.is_alive()
    bad = rows[:, COLUMN["fault"]] != 0.0
    lost = int(np.flatnonzero(bad)[0])
    assert rows[lost - 1, COLUMN["rate"]] > 0.0  # it was moving
    assert running.tick.process.returncode == 0


# ---- refused -------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.live
def test_a_refused_program_is_told_in_its_sentence_before_anything_moves() -> None:
    before = processes(os.getpid())
    with session("G87 X5 Y0\nM30\n") as running:
        with pytest.raises(SessionError, match=r"^part\.ngc:1:\d+: G87 \(back boring\) is not done here"):
            running.ready()
        assert now_of(running).homed == 0
    assert processes(os.getpid()) == before


def test_a_bus_that_cannot_be_opened_ends_the_service_with_one_sentence() -> None:
    machine = shipped()
    absent = replace(machine, buses=(replace(machine.buses[0], interface="socketcan", channel="none7"),))
    before = processes(os.getpid())
    with pytest.raises(SessionError, match=r"^bus can0: ") as refused, session(DRY, absent):
        raise AssertionError("it came up")
    assert "\n" not in str(refused.value)
    assert processes(os.getpid()) == before
