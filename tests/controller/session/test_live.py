"""The live machine: real processes on the wall clock, killed, stopped and refused.

Nothing here asserts a time of day. What counts are SYNCs, rows, and stamps of the bus; limits on
waiting are there so that a test that hangs fails.
"""

from __future__ import annotations

import os
import random
import signal
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.live.live_machines import (
    Listener,
    assert_within_limits,
    at,
    gone,
    home,
    now_of,
    off_path,
    processes,
    run,
    session,
    traced,
    until,
)
from support.machines.stepped_runs import program, shipped

from controller import config
from controller.handoff import COLUMN, STOOD, Snapshot
from controller.kinematics import Kinematics
from controller.machine import Machine
from controller.plan.report import survey
from controller.plan.route.path import Path as TracedPath
from controller.session.startup import SessionError
from controller.state import FAULTS, Fault, Mode, Request
from drives import cia402, pdo
from drives.cia402 import State

SEED = int(os.environ.get("DIRECTRIX_TEST_SEED", random.SystemRandom().randrange(10**6)))
ON_PATH_MM = 1e-6
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
    longest_frame_s = 135e-6  # may be on the wire before SYNC
    assert np.diff(stamps_s).min() >= 0.75 * machine.period_s - longest_frame_s


@pytest.mark.slow
@pytest.mark.live
def test_leaving_a_session_in_the_middle_of_a_cut_stops_on_the_path_and_switches_the_drives_off() -> None:
    machine, text = shipped(), program("example2_ready", "3000.")
    with session(text, machine) as running:
        start = running.ready()
        running.recorder.drain()
        running.request(Request.START)
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


# ---- the plan is gone ----------------------------------------------------------------

EXAMPLE_2 = program("example2_ready", "3000.")


@pytest.fixture(scope="module")
def example_2() -> tuple[Machine, TracedPath, float]:
    """The machine, the path from where it homes, and the seconds that all of it takes."""
    machine = shipped()
    whole = traced(EXAMPLE_2, machine, home(machine))
    return machine, whole, survey.survey(whole.items, machine, Kinematics(machine)).duration_s


@pytest.mark.slow
@pytest.mark.live
@pytest.mark.parametrize("number", range(20))
def test_without_its_planner_the_machine_holds_on_the_path(
    number: int, example_2: tuple[Machine, TracedPath, float]
) -> None:
    machine, exact, duration_s = example_2
    chance = random.Random(SEED + number)
    how = (signal.SIGKILL, signal.SIGSTOP)[number % 2]
    # It has sent what it planned ahead, which must not have been the end.
    instant_s = chance.uniform(0.05, duration_s - 4.0)
    print(f"seed {SEED} (DIRECTRIX_TEST_SEED), {how.name} at {instant_s:.4f} s of {duration_s:.3f} s")
    struck: list[Snapshot] = []

    def strike() -> None:
        os.kill(running.plan.pid, how)
        struck.append(now_of(running))

    with session(EXAMPLE_2, machine) as running:
        start = running.ready()
        rows, last = run(running, at(running, instant_s, strike))
        if how is signal.SIGSTOP:  # it comes back with all that it had to say
            os.kill(running.plan.pid, signal.SIGCONT)
        until(lambda: now_of(running).tick > last.tick + 150)
        later = now_of(running)
    assert start.joints == home(machine)
    assert struck[0].mode is Mode.RUNNING
    assert (last.mode, last.fault) == (Mode.FAULT, Fault.PLANNER_GONE)
    assert "planner gone" in FAULTS[last.fault].text
    assert last.at_rest
    assert set(last.drive_states) == {State.OPERATION_ENABLED}
    assert (later.joints, later.fault, later.at_rest) == (last.joints, Fault.PLANNER_GONE, True)
    assert set(later.drive_states) == {State.OPERATION_ENABLED}
    faults = np.flatnonzero(rows[:, COLUMN["fault"]] == Fault.PLANNER_GONE)
    silent = rows[faults[0], COLUMN["tick"]] - struck[0].tick
    queued = (struck[0].queue_end_s - struck[0].plan_time_s) / machine.period_s
    off_mm = off_path(rows, exact, machine).max()
    slowing = int((rows[faults, COLUMN["rate"]] > 0.0).sum())
    print(f"silent for {silent:.0f} ticks, at rest {slowing} ticks later, {off_mm:.1e} mm off the path")
    assert silent >= queued - 3, "it went on to the queue's end"
    assert off_mm <= ON_PATH_MM
    assert_within_limits(rows, machine)
    assert rows[-1, COLUMN["rate"]] == 0.0


@pytest.mark.slow
@pytest.mark.live
def test_a_planner_that_dies_of_an_error_of_its_own_says_so_in_one_sentence() -> None:
    bad = replace(shipped(), retract_mm="high")  # type: ignore[arg-type]
    sentence = r"^The \w+ process met an error of its own; report this: \w+ in \w+\.py, line \d+: "
    with pytest.raises(SessionError, match=sentence), session(EXAMPLE_2, bad) as running:
        running.ready()


# ---- the tick is gone ------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.live
def test_without_the_tick_the_drives_stop_by_their_own_supervision() -> None:
    machine = shipped()
    nodes = [axis.node for axis in machine.axes]
    lost = config.master_settings(machine).consumer_s / config.master_settings(machine).heartbeat_s
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
            assert listener.frames[told][1][:2] == (0x8130).to_bytes(2, "little")  # heartbeat error
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


def test_a_refused_program_ends_the_session_with_its_sentence_before_anything_moves() -> None:
    before = processes(os.getpid())
    with (
        pytest.raises(SessionError, match=r"^part\.ngc:1:\d+: G87 \(back boring\) is not done here"),
        session("G87 X5 Y0\nM30\n") as running,
    ):
        running.ready()
    assert running.board.read() is None or now_of(running).homed == 0
    assert processes(os.getpid()) == before


def test_a_bus_that_cannot_be_opened_ends_the_session_with_one_sentence() -> None:
    machine = shipped()
    absent = replace(machine, buses=(replace(machine.buses[0], interface="socketcan", channel="none7"),))
    before = processes(os.getpid())
    with pytest.raises(SessionError, match=r"^bus can0: ") as refused, session(DRY, absent) as running:
        running.ready()
    assert "\n" not in str(refused.value)
    assert processes(os.getpid()) == before
