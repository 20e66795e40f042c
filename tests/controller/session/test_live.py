"""The live machine: real processes on the wall clock, killed, stopped and refused.

Nothing here asserts a time of day. What counts are SYNCs, rows, and stamps of the bus; limits on
waiting are there so that a test that hangs fails.
"""

from __future__ import annotations

import contextlib
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cutting import program, shares, shipped

from controller import config
from controller.handoff import COLUMN, Snapshot
from controller.kinematics import Kinematics
from controller.machine import Joints, Machine
from controller.motions import JointMove
from controller.plan import blocks, path, survey
from controller.plan.path import Chain, Stretch
from controller.plan.path import Path as TracedPath
from controller.session import live
from controller.session.live import Live
from controller.session.startup import SessionError
from controller.state import FAULTS, Fault, Mode, Request
from drives import bus, cia402, pdo
from drives.cia402 import State

ROOT = Path(__file__).resolve().parents[3]
HANGS_S = 120.0  # no test is meant to come near
SEED = int(os.environ.get("DIRECTRIX_TEST_SEED", random.SystemRandom().randrange(10**6)))
ON_PATH_MM = 1e-6
DRY = "G21 G90 G54 G0 X5.\nM30\n"


# ---- what the tests are made of ----------------------------------------------------


@contextlib.contextmanager
def session(text: str, machine: Machine | None = None) -> Iterator[Live]:
    with live.started(machine or shipped(), text.encode(), "part.ngc") as running:
        yield running


def until(done: Callable[[], Any]) -> Any:
    """Waits for something to become true, and gives it."""
    give_up_s = time.monotonic() + HANGS_S
    while not (found := done()):
        assert time.monotonic() < give_up_s, "waited in vain"
        time.sleep(0.001)
    return found


def run(running: Live, look: Callable[[Snapshot], None] = lambda _: None) -> tuple[np.ndarray, Snapshot]:
    """``Live.run`` that does not wait forever."""
    give_up_s = time.monotonic() + HANGS_S

    def guarded(now: Snapshot) -> None:
        assert time.monotonic() < give_up_s, f"waited in vain: {now}"
        look(now)

    return running.run(guarded)


def at(running: Live, plan_time_s: float, act: Callable[[], None]) -> Callable[[Snapshot], None]:
    """For ``Live.run``: does something once when the path clock comes to ``plan_time_s``, to the tick."""
    left = [act]

    def look(now: Snapshot) -> None:
        if left and now.plan_time_s > plan_time_s - 0.2:
            until(lambda: _now(running).plan_time_s >= plan_time_s or _now(running).mode is not Mode.RUNNING)
            left.pop()()

    return look


def _now(running: Live) -> Snapshot:
    now = running.board.read()
    assert now is not None
    return now


def traced(text: str, machine: Machine, start: tuple[float, ...]) -> TracedPath:
    a, b, c, d, e = start
    return path.trace(
        blocks.read(text.encode(), machine, "part.ngc"), machine, Kinematics(machine), (a, b, c, d, e)
    )


def home(machine: Machine) -> tuple[float, ...]:
    return tuple(axis.homing.position for axis in machine.axes)


def off_path(rows: np.ndarray, of: TracedPath, machine: Machine) -> np.ndarray:
    """Distance (mm) of each row's commanded tip from the exact path, on the table; dwells left out."""
    kinematics = Kinematics(machine)
    chains = (item for item in of.items if isinstance(item, Chain))
    stretches = [stretch for chain in chains for stretch in chain.stretches]
    moving = rows[rows[:, COLUMN["motion_id"]] >= 0]
    return np.array([_off(row, stretches[int(row[COLUMN["motion_id"]])], kinematics) for row in moving])


def _off(row: np.ndarray, stretch: Stretch, kinematics: Kinematics) -> float:
    joints = _joints(row)
    s = float(row[COLUMN["s"]])
    motion = stretch.motion
    if isinstance(motion, JointMove):
        wanted = motion.joints(s, (0.0, 0.0), kinematics)
        assert wanted is not None
        there = kinematics.forward(wanted, 0.0).tip
        here = kinematics.forward(joints, 0.0).tip
    else:
        # The surface itself says where the tip belongs: C1 + r n, no inverse kinematics in between.
        there = motion.part.to_parent(motion.pose(s).tip)
        here = kinematics.forward(joints, motion.length_mm).tip
    return float(np.linalg.norm(np.subtract(here, there)))


def _joints(row: np.ndarray) -> Joints:
    first = COLUMN["joint_command_0"]
    a, b, c, d, e = map(float, row[first : first + 5])
    return (a, b, c, d, e)


def assert_within_limits(rows: np.ndarray, machine: Machine) -> None:
    """First and second differences of the commanded joints, from SYNC to SYNC."""
    sent = rows[rows[:, COLUMN["sync_sent"]] != 0.0]
    first = COLUMN["joint_command_0"]
    velocity, acceleration, _ = shares(sent[:, first : first + 5], machine)
    assert velocity.max() <= 1.0 + 1e-6
    assert acceleration.max() <= 1.001  # the tick's own check allows as much


def processes(of_parent: int) -> dict[int, str]:
    """Names of the living children of a process, by pid."""
    found = {}
    for entry in Path("/proc").iterdir():
        with contextlib.suppress(OSError, ValueError):
            pid = int(entry.name)
            name, _, rest = (entry / "stat").read_text().partition("(")[2].rpartition(")")
            state, parent, *_ = rest.split()
            if int(parent) == of_parent and state != "Z":
                found[pid] = name
    return found


def gone(pids: list[int]) -> bool:
    return not any(_alive(pid) for pid in pids)


def _alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


# ---- a cut -------------------------------------------------------------------------


@pytest.mark.slow
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
        end = _now(running)
    assert (last.mode, last.fault) == (Mode.READY, Fault.NONE)
    assert seen == {"names": ["directrix-plan", "directrix-tick", "virtual-bus"], "threads": 1}
    assert off_path(rows, traced(text, machine, start.joints), machine).max() <= ON_PATH_MM
    assert_within_limits(rows, machine)
    cut = rows[rows[:, COLUMN["cutting"]] != 0.0]
    assert 94.0 < cut[-1, COLUMN["s"]] - cut[0, COLUMN["s"]] <= 94.2478
    assert running.recorder.lost == 0
    assert last.skips <= 0.02 * last.tick
    # The path clock counts SYNCs: it stands in every tick that sent none.
    sent = rows[1:, COLUMN["sync_sent"]] != 0.0
    steps = np.diff(rows[:, COLUMN["plan_time_s"]])
    assert steps[sent].max() <= machine.period_s * (1.0 + 1e-9)
    assert not steps[~sent].any()
    (stamps_s,) = running.sync_stamps_s.values()
    assert len(stamps_s) >= end.tick + 1 - end.skips
    longest_frame_s = 135e-6  # may be on the wire before SYNC
    assert np.diff(stamps_s).min() >= 0.75 * machine.period_s - longest_frame_s


@pytest.mark.slow
def test_leaving_a_session_in_the_middle_of_a_cut_stops_on_the_path_and_switches_the_drives_off() -> None:
    machine, text = shipped(), program("example2_ready", "3000.")
    with session(text, machine) as running:
        start = running.ready()
        running.recorder.drain()
        running.request(Request.START)
        until(lambda: _now(running).cutting and _now(running).rate == 1.0)
    rows, end = running.recorder.drain(), _now(running)
    assert end.at_rest
    assert State.OPERATION_ENABLED not in end.drive_states
    moving = rows[rows[:, COLUMN["rate"]] > 0.0]
    assert off_path(moving, traced(text, machine, start.joints), machine).max() <= ON_PATH_MM
    assert_within_limits(moving, machine)
    assert gone([running.tick.pid, running.plan.pid, *(hub.pid for hub in running.hubs.values())])


@pytest.mark.slow
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
    return machine, whole, survey.survey(whole, machine, Kinematics(machine)).duration_s


@pytest.mark.slow
@pytest.mark.parametrize("number", range(20))
def test_without_its_planner_the_machine_holds_on_the_path(
    number: int, example_2: tuple[Machine, TracedPath, float]
) -> None:
    machine, exact, duration_s = example_2
    chance = random.Random(SEED + number)
    how = (signal.SIGKILL, signal.SIGSTOP)[number % 2]
    instant_s = chance.uniform(0.05, duration_s - 0.8)
    print(f"seed {SEED} (DIRECTRIX_TEST_SEED), {how.name} at {instant_s:.4f} s of {duration_s:.3f} s")
    struck: list[Snapshot] = []

    def strike() -> None:
        os.kill(running.plan.pid, how)
        struck.append(_now(running))

    with session(EXAMPLE_2, machine) as running:
        start = running.ready()
        rows, last = run(running, at(running, instant_s, strike))
        if how is signal.SIGSTOP:  # it comes back with all that it had to say
            os.kill(running.plan.pid, signal.SIGCONT)
        until(lambda: _now(running).tick > last.tick + 150)
        later = _now(running)
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
    off_mm = off_path(rows, exact, machine).max()
    slowing = int((rows[faults, COLUMN["rate"]] > 0.0).sum())
    print(f"silent for {silent:.0f} ticks, at rest {slowing} ticks later, {off_mm:.1e} mm off the path")
    assert silent <= 0.100 / machine.period_s + 3
    assert off_mm <= ON_PATH_MM
    assert_within_limits(rows, machine)
    assert rows[-1, COLUMN["rate"]] == 0.0


@pytest.mark.slow
def test_a_planner_that_dies_of_an_error_of_its_own_says_so_in_one_sentence() -> None:
    bad = replace(shipped(), retract_mm="high")  # type: ignore[arg-type]
    sentence = r"^The \w+ process met an error of its own; .*\.py, line \d+\)$"
    with pytest.raises(SessionError, match=sentence), session(EXAMPLE_2, bad) as running:
        running.ready()


# ---- the tick is gone ------------------------------------------------------------------


class Listener:
    """A passive client of the virtual bus: every frame in the order of the bus."""

    def __init__(self, machine: Machine) -> None:
        (settings,) = config.bus_settings(machine)
        self._port = bus.open(settings)
        self._buffer = bytearray(pdo.FRAME_BYTES)
        self.frames: list[tuple[int, bytes]] = []

    def listen(self) -> None:
        while self._port.receive_into(self._buffer):
            can_id, data = pdo.unpack(self._buffer)
            self.frames.append((can_id, bytes(data)))

    def count(self, can_id: int, after: int = 0) -> int:
        return sum(heard == can_id for heard, _ in self.frames[after:])

    def last_sync(self) -> int:
        return max(i for i, (heard, _) in enumerate(self.frames) if heard == pdo.SYNC)

    def read(self, node: int, index: int) -> int:
        """SDO upload (CiA 301, 7.2.4.3.5) of up to four bytes."""
        asked = len(self.frames)
        self._port.send(pdo.frame(0x600 + node, bytes([0x40, index & 0xFF, index >> 8, 0, 0, 0, 0, 0])))

        def answer() -> list[bytes]:
            self.listen()
            return [data for heard, data in self.frames[asked:] if heard == 0x580 + node]

        return int.from_bytes(until(answer)[0][4:], "little", signed=True)


@pytest.mark.slow
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
            assert not listener.count(0x180 + node, end + 10)  # without SYNC no feedback

        def beats() -> int:
            listener.listen()
            return listener.count(pdo.HEARTBEAT + nodes[0])

        begun = beats()
        until(lambda: beats() >= begun + 20)  # a second of bus time: every ramp is over
        first = [listener.read(node, 0x6064) for node in nodes]
        until(lambda: beats() >= begun + 24)
        assert [listener.read(node, 0x6064) for node in nodes] == first
        for node in nodes:
            state = cia402.state(listener.read(node, 0x6041) & 0xFFFF)
            assert state not in (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE)
    assert gone([running.tick.pid, running.plan.pid, *(hub.pid for hub in running.hubs.values())])


# ---- the bus is gone ---------------------------------------------------------------------


@pytest.mark.slow
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
        pytest.raises(SessionError, match=r"^part\.ngc:1:\d+: .*G52 needs 8 points"),
        session("G52 X0 Y0\nM30\n") as running,
    ):
        running.ready()
    assert running.board.read() is None or _now(running).homed == 0
    assert processes(os.getpid()) == before


def test_a_bus_that_cannot_be_opened_ends_the_session_with_one_sentence() -> None:
    machine = shipped()
    absent = replace(machine, buses=(replace(machine.buses[0], interface="socketcan", channel="none7"),))
    before = processes(os.getpid())
    with pytest.raises(SessionError, match=r"^bus can0: ") as refused, session(DRY, absent) as running:
        running.ready()
    assert "\n" not in str(refused.value)
    assert processes(os.getpid()) == before


# ---- the command, interrupted -----------------------------------------------------------------


@contextlib.contextmanager
def demo(out: Path) -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, "-m", "controller", "demo", "--out", str(out)]
    running = subprocess.Popen(
        command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    try:
        yield running
    finally:
        running.kill()
        running.communicate()


def named(parent: int, name: str) -> dict[int, str]:
    children = processes(parent)
    return children if name in children.values() else {}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stage", "wait_ticks"),
    [("virtual-bus", 0), ("directrix-tick", 0), ("directrix-plan", 0), ("directrix-plan", 2500)],
)
def test_ctrl_c_ends_the_demo_without_a_traceback_and_without_orphans(
    stage: str, wait_ticks: int, tmp_path: Path
) -> None:
    with demo(tmp_path) as running:
        children = until(lambda: named(running.pid, stage))
        if wait_ticks:  # on the bus: well into the cut
            time.sleep(wait_ticks * 0.002)
        children |= processes(running.pid)
        os.killpg(running.pid, signal.SIGINT)
        _, told = running.communicate(timeout=HANGS_S)
        assert running.returncode not in (0, None)
        assert "Traceback" not in told and "Error" not in told
        assert gone(list(children))
        assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGKILL])
def test_no_process_outlives_a_parent_that_is_killed(how: signal.Signals, tmp_path: Path) -> None:
    with demo(tmp_path) as running:
        children = until(lambda: named(running.pid, "directrix-plan"))
        assert len(children) == 3
        running.send_signal(how)
        running.wait(HANGS_S)
        until(lambda: gone(list(children)))
