"""The pump as a process of its own, on the virtual hub: what comes out on the bus, in which order.

Nothing is timed: a busy computer makes all of it later, and nothing of it other.
"""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from support.drives import pump_ticks
from support.drives.pump_ticks import BEAT_EVERY, DRIVES, HOLD, MASTER, WAIT_S, Tick, begun, until

from drives import pdo, real_time
from drives.bench.virtual.hub import Hub
from drives.bus import HubSocket
from drives.bus import joined as join
from drives.ports import hub_protocol
from drives.pump import process
from drives.pump.plan_memory import Phase
from drives.pump.process import BusJob, Job
from drives.pump.wires import DriveWire
from drives.settings import BusSettings


@pytest.fixture
def hub(tmp_path: Path) -> Iterator[str]:
    path = str(tmp_path / "hub")
    serving, over = Hub(path, bit_rate=0, sync_log=False), threading.Event()
    thread = threading.Thread(target=serving.run, args=(over.is_set,))
    thread.start()
    yield path
    over.set()
    thread.join()
    serving.close()


def client(path: str) -> HubSocket:
    settings, wishes = BusSettings("bus", "virtual", path, 1_000_000), hub_protocol.wishes([(0, 0)])
    return HubSocket(join(settings, wishes), "bus", path, wishes)


def on_hub(path: str) -> Tick:
    return Tick(client(path), client(path), path)


@pytest.fixture
def tick(hub: str) -> Iterator[Tick]:
    made = on_hub(hub)
    try:
        made.ready()
        yield made
    finally:
        made.end()


def test_a_job_is_the_same_at_its_other_end() -> None:
    bus = BusJob("raw", 5, "can0", "socketcan can0", [(2, DriveWire(3, 1, True))])
    job = Job(1, 2, 3, 4, [bus], 0.002, 127, 25, 81, True)
    assert Job.from_text(job.to_text()) == job
    assert job.descriptors == (2, 3, 5)


def test_it_loads_nothing_of_the_controller_no_adapter_and_no_numpy() -> None:
    asked = (
        "import sys, drives.pump.process; print(*{name.split('.')[0] for name in sys.modules},"
        " *(name for name in sys.modules if name.startswith('drives.')))"
    )
    done = subprocess.run([sys.executable, "-P", "-c", asked], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.split())
    assert not loaded & {"controller", "numpy", "can", "canopen", "serial", "logging", "threading", "pickle"}
    assert {name for name in loaded if name.startswith("drives.")} == {
        *("drives.pdo", "drives.real_time", "drives.texts", "drives.ports"),
        *("drives.ports.hub_protocol", "drives.ports.port", "drives.pump"),
        *(f"drives.pump.{name}" for name in ("braking", "lead", "plan_memory", "player", "process")),
        *("drives.pump.setpoint_frame", "drives.pump.speed_ramp", "drives.pump.wires"),
    }


def test_it_says_what_it_was_given_and_sends_nothing_without_a_plan(hub: str) -> None:
    tick = on_hub(hub)
    try:
        granted = tick.ready()
        assert set(granted) == {"locked", "slack", "fifo"}
        fifo = os.sched_getscheduler(tick.process.pid) & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO
        assert granted["fifo"] is fifo
        assert Path(f"/proc/{tick.process.pid}/comm").read_text().strip() == process.NAME
        begun(tick)
        tick.listen()
        assert tick.heard == []
    finally:
        tick.end()


def test_every_period_of_a_plan_goes_out_once_in_its_order_and_then_there_is_silence(tick: Tick) -> None:
    first = begun(tick)
    tick.publish(first - 8, 100)
    tick.until_silent()
    cycles = tick.cycles()
    played = [cycle[0] for cycle in cycles]
    assert all(cycle == [cycle[0]] * DRIVES for cycle in cycles)
    assert played[-HOLD - 1 :] == [first - 8 + 99] * (HOLD + 1)
    began = played[0]
    assert played == [*range(began, first - 8 + 100), *[first - 8 + 99] * HOLD]
    beats = sum(can_id == pdo.HEARTBEAT + MASTER for can_id, _ in tick.heard)
    assert beats in (len(played) // BEAT_EVERY, len(played) // BEAT_EVERY + 1)
    assert tick.process.poll() is None, "it waits for a new beginning"


@pytest.mark.parametrize("exercise", pump_ticks.EXERCISES, ids=lambda one: one.__name__)
def test_whatever_is_published_and_when_no_period_is_lost_or_doubled(
    exercise: Callable[[Tick], None], tick: Tick
) -> None:
    exercise(tick)


def test_nothing_that_it_sends_comes_back_to_the_tick(tick: Tick) -> None:
    tick.publish(begun(tick) - 8, 50)
    tick.until_silent()
    assert len(tick.heard) > 100
    assert not tick.port.receive_into(bytearray(pdo.FRAME_BYTES))


def test_told_to_end_it_plays_its_plan_to_the_end(tick: Tick) -> None:
    first = begun(tick)
    tick.publish(first - 8, 60)
    until(lambda: tick.writer.played().period > first)
    tick.process.send_signal(signal.SIGTERM)
    tick.publish(first, 5000, anew=False)  # comes too late or not, it is not waited for
    assert tick.process.wait(WAIT_S) == 0
    time.sleep(0.05)
    tick.listen()
    played = [cycle[0] for cycle in tick.cycles()]
    assert played == [*range(played[0], played[-1] + 1), *[played[-1]] * HOLD]
    assert played[-1] in (first - 8 + 59, first + 4999)


def test_a_pump_whose_tick_is_gone_plays_its_plan_to_the_end_and_ends(hub: str) -> None:
    """The tick is a process between: it starts the pump, publishes and is killed."""
    source = f"""
import os, sys
sys.path[:0] = {sys.path!r}
import test_process as here
tick = here.on_hub({hub!r})
tick.ready()
tick.publish(here.begun(tick) - 8, 40)
print(tick.process.pid, flush=True)
here.time.sleep(1000)
"""
    folder = str(Path(__file__).parent)
    between = subprocess.Popen(
        [sys.executable, "-c", source],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join((folder, *sys.path))},
    )
    bus = client(hub)
    try:
        assert between.stdout is not None
        pump = int(between.stdout.readline())
        between.kill()
        between.wait()
        until(lambda: not _lives(pump))
        time.sleep(0.05)
        buffer, heard = bytearray(pdo.FRAME_BYTES), []
        while bus.receive_into(buffer):
            heard.append(pdo.unpack(buffer))
        setpoints = [pdo.COMMAND.unpack(data)[1] for can_id, data in heard if can_id == pdo.rpdo(1, 1)]
        assert setpoints[-HOLD - 1 :] == [setpoints[-1]] * (HOLD + 1)
        assert setpoints[:-HOLD] == [*range(setpoints[0], setpoints[-1] + 1)]
    finally:
        between.kill()
        with contextlib.suppress(UnboundLocalError, OSError):
            os.kill(pump, signal.SIGKILL)
        bus.close()


def _lives(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def test_no_two_pumps_play_on_one_bus(hub: str) -> None:
    """The second one waits for the end of the first, which a dead tick's pump comes to; not for ever."""
    first = on_hub(hub)
    second = None
    try:
        first.ready()
        second = on_hub(hub)
        assert second.control.recv(1024) == b"", "it has ended"
        assert second.process.wait(WAIT_S) == process.CLAIMED
        second.end()
        second = on_hub(hub)
        first.end()
        assert "fifo" in second.ready()
    finally:
        first.end()
        if second is not None:
            second.end()


def test_played_ahead_it_is_the_same_and_the_pump_sleeps_meanwhile(tick: Tick) -> None:
    first = begun(tick)
    tick.memory.at_once = 8
    tick.publish(first - 8, 160)
    woken = _slept(tick.process.pid)
    tick.until_silent()
    cycles = tick.cycles()
    played = [cycle[0] for cycle in cycles]
    assert all(cycle == [cycle[0]] * DRIVES for cycle in cycles)
    assert played == [*range(played[0], first + 152), *[first + 151] * HOLD]
    assert _slept(tick.process.pid) - woken < len(played) / 2


def _slept(pid: int) -> int:
    rows = Path(f"/proc/{pid}/status").read_text()
    return int(rows.split("voluntary_ctxt_switches:")[1].split()[0])


def test_stopped_for_longer_than_a_gap_it_goes_on_with_what_went_out_last_until_a_new_beginning(
    tick: Tick,
) -> None:
    first = begun(tick)
    tick.publish(first - 8, 400)
    until(lambda: tick.writer.played().period > first + 20)
    tick.process.send_signal(signal.SIGSTOP)
    time.sleep(0.1)
    tick.process.send_signal(signal.SIGCONT)
    until(lambda: tick.writer.played().phase in (Phase.GAP, Phase.SILENT))
    slips = tick.writer.played().slips
    assert slips >= 1
    tick.until_silent()
    played = [cycle[0] for cycle in tick.cycles()]
    last = played[-1]
    assert played == [*range(played[0], last + 1), *[last] * (len(played) - 1 - last + played[0])]
    assert HOLD <= played.count(last) - 1 <= HOLD + 1


def test_a_process_gets_what_both_were_given() -> None:
    granted = real_time.Granted(locked=True, fifo=False) & real_time.Granted(
        locked=True, fifo=True, awake=False
    )
    assert granted == {"locked": True, "fifo": False, "awake": False}
