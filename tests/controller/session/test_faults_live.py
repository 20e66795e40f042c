"""The rows of the fault matrix that only processes can show: killed, stopped, and a bus that starts anew.

Times are those of the bus: the stamps in the recording's candump log, never the test's own clock.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cutting import program, shipped
from living import Listener, assert_within_limits, now_of, run, until

from controller import config, times
from controller.handoff import COLUMN, Snapshot
from controller.machine import Machine
from controller.session import live
from controller.session.children import Child
from controller.session.live import Live
from controller.session.startup import SessionError
from controller.state import FAULTS, Fault, Mode, Request, stands_within_s
from drives import cia402, pdo
from drives.cia402 import State
from drives.log import candump

EXAMPLE_2 = program("example2_ready", "3000.")
LATE_S = 0.02  # a hub that shares two processors with others
HEARD = 40  # heartbeats of a drive: two seconds of bus time

pytestmark = pytest.mark.slow


def started(folder: Path, machine: Machine | None = None) -> object:
    return live.started(machine or shipped(), EXAMPLE_2.encode(), "part.ngc", None, True, folder)


def strikes(
    running: Live, when: Callable[[Snapshot], bool], act: Callable[[], None]
) -> Callable[[Snapshot], None]:
    """For ``run``: acts once when the snapshot is as wanted."""
    left = [act]

    def look(_: Snapshot) -> None:
        if left and (now_of(running).cutting or not now_of(running).at_rest):
            until(lambda: when(now_of(running)) or now_of(running).mode is Mode.FAULT)
            left.pop()()

    return look


def full_feed(now: Snapshot) -> bool:
    return now.cutting and now.rate == 1.0


def frames(folder: Path) -> list[tuple[float, int, bytes]]:
    """(time, identifier, data) of the recording's log."""
    found = []
    for at_s, _, frame in candump.read((folder / "frames.log").read_text().splitlines()):
        can_id, data = pdo.unpack(frame)
        found.append((at_s, can_id, bytes(data)))
    return found


def recording_in(folder: Path) -> Path:
    (made,) = folder.iterdir()
    assert sorted(path.name for path in made.iterdir()) == ["fault.json", "frames.log", "trace.npz"]
    return made


def moved(listener: Listener, nodes: list[int]) -> list[int]:
    return [listener.read(node, 0x6064) for node in nodes]


@pytest.mark.parametrize("place", ["idle", "cutting", "hold"])
def test_a_tick_that_is_killed_leaves_drives_that_stop_in_time_and_a_recording(
    place: str, tmp_path: Path
) -> None:
    machine = shipped()
    nodes = [axis.node for axis in machine.axes]
    master = config.master_settings(machine)
    with started(tmp_path, machine) as running:
        running.ready()
        listener = Listener(running.machine)

        def kill() -> None:
            os.kill(running.tick.pid, signal.SIGKILL)
            running.tick.process.wait()

        def hold_and_kill() -> None:
            running.request(Request.HOLD)
            until(lambda: now_of(running).mode is Mode.HOLD)
            kill()

        at_feed = strikes(running, full_feed, hold_and_kill if place == "hold" else kill)

        def look(now: Snapshot) -> None:
            listener.listen()
            if running.tick.is_alive():
                at_feed(now)

        if place == "idle":
            kill()
        with pytest.raises(SessionError) as refused:
            run(running, look)
        assert FAULTS[Fault.CONTROLLER_GONE].text in str(refused.value) or place == "idle"

        def beats() -> int:
            listener.listen()
            return listener.count(pdo.HEARTBEAT + nodes[0])

        begun = beats()
        # Silence is noticed, ramps are over: counted in the drives' own heartbeats.
        promised_s = stands_within_s(Fault.CONTROLLER_GONE, times.of(machine)) + LATE_S
        until(lambda: beats() >= begun + 1 + int(promised_s / master.heartbeat_s))
        first = moved(listener, nodes)
        until(lambda: beats() >= begun + HEARD)
        assert moved(listener, nodes) == first
        for axis in machine.axes:
            state = cia402.state(listener.read(axis.node, 0x6041) & 0xFFFF)
            # An axis that would fall is held by its motor after the ramp.
            assert state is (State.QUICK_STOP_ACTIVE if axis.brake else State.SWITCH_ON_DISABLED)
    if place != "idle":
        made = recording_in(tmp_path)
        assert str(made) in str(refused.value) and "CONTROLLER_GONE" in made.name


@pytest.mark.parametrize("stopped_s", [0.005, 0.05, 0.5])
def test_a_tick_that_is_stopped_for_a_while_goes_on_or_stops_and_never_jumps(
    stopped_s: float, tmp_path: Path
) -> None:
    machine = shipped()
    with started(tmp_path, machine) as running:
        running.ready()
        listener = Listener(running.machine)
        beat = pdo.HEARTBEAT + machine.axes[0].node

        def stop() -> None:
            """For so many milliseconds of bus time: told by the drives' heartbeats where it is long."""
            os.kill(running.tick.pid, signal.SIGSTOP)
            listener.listen()
            begun = listener.count(beat)
            if stopped_s >= 0.5:
                until(lambda: listener.listen() or listener.count(beat) >= begun + 10)
            else:
                signal.sigtimedwait([], stopped_s)
            os.kill(running.tick.pid, signal.SIGCONT)

        rows, last = run(running, strikes(running, full_feed, stop))
        text = running.fault_text(last)
    assert_within_limits(rows, machine)  # from SYNC to SYNC, whatever lies between
    if last.fault is Fault.NONE:
        assert stopped_s < 0.5 and last.mode is Mode.READY
        return
    assert last.fault is Fault.TOO_MANY_SKIPS and stopped_s > 0.005
    made = recording_in(tmp_path)
    assert str(made) in text
    if stopped_s < 0.5:
        return
    # The drives did not wait for the controller: silence and ramp, by the stamps of the bus.
    heard = frames(made)
    ours = pdo.HEARTBEAT + config.master_settings(machine).node_id
    for node in (axis.node for axis in machine.axes):
        told_s = next(
            at for at, can_id, data in heard if can_id == pdo.EMCY + node and data[:2] == b"\x30\x81"
        )
        silent_from_s = max(at for at, can_id, _ in heard if can_id == ours and at < told_s)
        assert told_s - silent_from_s <= config.master_settings(machine).consumer_s + LATE_S
    assert last.untrusted and not last.homed & last.untrusted
    assert "Also:" in text or not FAULTS[last.fault].position_trusted


def test_a_killed_planner_leaves_a_recording_that_its_sentence_names(tmp_path: Path) -> None:
    machine = shipped()
    with started(tmp_path, machine) as running:
        running.ready()
        kill = strikes(running, full_feed, lambda: os.kill(running.plan.pid, signal.SIGKILL))
        rows, last = run(running, kill)
        text = running.fault_text(last)
    assert last.fault is Fault.PLANNER_GONE and not last.untrusted
    made = recording_in(tmp_path)
    assert text.endswith(f"Recording: {made}")
    assert_within_limits(rows, machine)
    with np.load(made / "trace.npz") as file:
        faults = file["rows"][:, COLUMN["fault"]]
    assert (faults == Fault.PLANNER_GONE).any() and (faults == Fault.NONE).any()


def test_a_hub_that_starts_anew_is_a_named_fault_and_moves_nothing(tmp_path: Path) -> None:
    machine = shipped()
    nodes = [axis.node for axis in machine.axes]
    with started(tmp_path, machine) as running:
        running.ready()
        (hub,) = running.hubs.values()
        again: list[Child] = []

        def restart() -> None:
            os.kill(hub.pid, signal.SIGKILL)
            hub.process.wait()
            path = Path(running.machine.buses[0].channel)
            path.unlink(missing_ok=True)
            options = [str(path), "--nodes", *map(str, nodes)]
            again.append(Child("hub", options, tmp_path.parent / "again.words"))
            until(path.exists)

        rows, last = run(running, strikes(running, full_feed, restart))
        try:
            assert last.fault in (Fault.BUS_ERROR, Fault.BUS_OFF, Fault.SEND_FAILED, Fault.FEEDBACK_LOST)
            assert last.untrusted == 0x1F or last.fault is Fault.FEEDBACK_LOST
            listener = Listener(replace(machine, buses=running.machine.buses))
            states = [cia402.state(listener.read(node, 0x6041) & 0xFFFF) for node in nodes]
            assert set(states) == {State.SWITCH_ON_DISABLED}
            assert moved(listener, nodes) == [0] * len(nodes)
        finally:
            for child in again:
                child.end()
    assert_within_limits(rows[rows[:, COLUMN["fault"]] == 0.0], machine)
    assert recording_in(tmp_path)
