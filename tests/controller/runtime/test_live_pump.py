"""Tick and pump of a live machine on the virtual bus, each stopped or killed in a cut: what is on the bus.

What is asserted is which frames there are, and in which order.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from support.live.live_machines import Listener, Live, assert_within_limits, at, now_of, run, session, until
from support.live.pumps import CUT, Cycles, assert_braked, full_feed, is_alive, pump_of
from support.machines.stepped_runs import shipped

from controller import messages
from controller.ipc.handoff import COLUMN, Snapshot
from controller.runtime.startup import SessionError
from controller.state.modes import Fault, Mode
from drives import pdo

pytestmark = [pytest.mark.slow, pytest.mark.live]

STRUCK_S = 1.0  # of the path clock, at full feed
LOCKED_KB = 60_000  # by tick and pump together


def struck(strike: Callable[[Live], None]) -> tuple[Snapshot | str, Cycles, list[int]]:
    """A cut that is struck on its way: the last snapshot or the error, and the cycles heard from then on."""
    began: list[int] = []
    with session(CUT, shipped()) as running:
        running.ready()
        listener, pump = Listener(running.machine), pump_of(running.tick.pid)

        def act() -> None:
            listener.listen()
            began.append(len(listener.frames))
            strike(running)
            time.sleep(0.3)

        last: Snapshot | str
        with contextlib.suppress(SessionError):
            _, last = run(running, at(running, STRUCK_S, act))
        if not is_alive(pump):  # the tick ends by itself
            until(lambda: not running.tick.is_alive())
        if not running.tick.is_alive():
            until(lambda: running.service.alarms.list())
            time.sleep(0.5)  # for the service to have found out why
            last = " ".join(messages.text(one) for one in running.service.alarms.list())
        listener.listen()
    frames = listener.frames[began[0] :]
    return last, Cycles(frames), [can_id for can_id, _ in frames]


def test_a_tick_that_is_stopped_again_and_again_is_not_seen_by_the_drives() -> None:
    """At the feed each setpoint is as far from the one before: none is missing, or there twice."""
    machine = shipped()
    with session(CUT, machine) as running:
        running.ready()
        listener = Listener(running.machine)
        over = threading.Event()

        def stop() -> None:
            while not over.wait(0.02):
                os.kill(running.tick.pid, signal.SIGSTOP)
                time.sleep(0.005)
                os.kill(running.tick.pid, signal.SIGCONT)

        thread = threading.Thread(target=stop)
        thread.start()
        try:
            rows, last = run(running, lambda _: listener.listen())
        finally:
            over.set()
            thread.join()
        listener.listen()
    assert (last.mode, last.fault) == (Mode.READY, Fault.NONE)
    cycles = Cycles(listener.frames)
    assert not cycles.torn
    if not last.braked:  # else the computer was away for longer than the stock
        assert set(full_feed(cycles.steps)) == {16000}
    assert last.played > 0
    _, newest = np.unique(rows[::-1, COLUMN["tick"]], return_index=True)  # one whose plan came late has two
    assert_within_limits(rows[::-1][newest], machine)


def test_a_tick_that_is_killed_ends_in_a_braked_stop_and_silence() -> None:
    pumps: list[int] = []

    def strike(running: Live) -> None:
        pumps.append(pump_of(running.tick.pid))
        os.kill(running.tick.pid, signal.SIGKILL)
        until(lambda: not is_alive(pumps[0]))

    last, cycles, _ = struck(strike)
    assert isinstance(last, str) and "SIGKILL" in last
    assert_braked(cycles)


def test_a_tick_that_is_stopped_for_long_is_a_fault_and_nothing_moves_when_it_goes_on() -> None:
    marks: list[int] = []

    def strike(running: Live) -> None:
        os.kill(running.tick.pid, signal.SIGSTOP)
        time.sleep(0.6)
        os.kill(running.tick.pid, signal.SIGCONT)
        until(lambda: now_of(running).mode is Mode.FAULT)
        marks.append(1)

    last, cycles, _ = struck(strike)
    assert isinstance(last, Snapshot)
    assert (last.mode, last.fault) == (Mode.FAULT, Fault.STOCK_USED_UP)
    rest = cycles.steps.index(0)
    assert all(b <= a + 1 for a, b in itertools.pairwise(cycles.steps[:rest])), cycles.steps
    assert max(map(abs, cycles.steps[rest:])) < 200, "it went on"


def test_a_pump_that_is_killed_is_told_and_the_tick_stops_the_drives_itself() -> None:
    last, cycles, heard = struck(lambda running: os.kill(pump_of(running.tick.pid), signal.SIGKILL))
    assert isinstance(last, str) and "directrix-pump" in last
    assert cycles.torn <= 1 and len(cycles.steps) > 50  # the one in which it was killed
    assert heard.count(pdo.SYNC) > 50
    assert cycles.words[-1] != 0x0F, "quick stop, or off"


def test_a_pump_that_is_stopped_is_a_fault_and_goes_nowhere_when_it_goes_on() -> None:
    named: list[int] = []

    def strike(running: Live) -> None:
        pump = pump_of(running.tick.pid)
        os.kill(pump, signal.SIGSTOP)
        until(lambda: now_of(running).mode is Mode.FAULT)
        named.append(now_of(running).fault)
        os.kill(pump, signal.SIGCONT)

    last, cycles, _ = struck(strike)
    assert isinstance(last, Snapshot) and last.mode is Mode.FAULT
    assert named == [Fault.SYNC_LOST]
    assert not cycles.torn and set(cycles.steps[-20:]) == {0}
    assert 0x0F not in cycles.words[-20:]


def test_where_both_are_killed_nothing_is_sent_any_more() -> None:
    def strike(running: Live) -> None:
        pump = pump_of(running.tick.pid)
        os.kill(running.tick.pid, signal.SIGKILL)
        os.kill(pump, signal.SIGKILL)

    last, cycles, heard = struck(strike)
    assert isinstance(last, str) and "SIGKILL" in last
    assert len(cycles.steps) < 50
    assert any(pdo.EMCY < can_id < pdo.EMCY + 128 for can_id in heard), "the drives miss the heartbeat"


def test_tick_and_pump_lock_little_memory() -> None:
    with session(CUT, shipped()) as running:
        running.ready()
        run(running)
        tick = running.tick.pid
        status = [Path(f"/proc/{pid}/status").read_text() for pid in (tick, pump_of(tick))]
    locked = [int(one.split("VmLck:")[1].split()[0]) for one in status]
    if not any(locked):
        pytest.skip("this user may not lock memory")
    assert all(locked) and sum(locked) < LOCKED_KB, locked
