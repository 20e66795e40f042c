"""Tick and pump on a real kernel: stopped and killed in a cut, and what of it is on the bus.

What is asserted is which frames there are and in which order, and times of 20 ms and more.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import signal
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import pytest
from guest import absence, on_can
from support.live.live_machines import Live, at, now_of, run, until
from support.live.pumps import CUT, is_alive, pump_of

from controller.ipc.handoff import Snapshot
from controller.machine.model import Machine
from controller.runtime.startup import SessionError
from controller.state.modes import Fault, Mode
from drives import pdo
from drives.pump.process import LATE_SHARE

T = on_can.PERIOD_S
BEAT = pdo.HEARTBEAT + 127
DRY = "G21 G90 G54 G0 X5.\nM30\n"
STRUCK_S = 1.0  # of the path clock, at full feed
HELD_S = 0.1  # a tick that does not run is tolerated for so long at rest (tick/stock.STOPPED_S)
SO_TIMESTAMPNS, SO_RCVBUFFORCE = 35, 33


def machine(stock_s: float = 0.16) -> Machine:
    return replace(on_can.machine(), stock_s=stock_s)


class Ear:
    """Every frame on the interface with the kernel's time (s) of it."""

    def __init__(self) -> None:
        self.frames: list[tuple[float, int, bytes]] = []
        self._socket = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        self._socket.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        self._socket.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, 1 << 24)
        self._socket.settimeout(0.1)
        self._socket.bind(("vcan0",))
        self._over = False
        self._thread = threading.Thread(target=self._listen)
        self._thread.start()

    def _listen(self) -> None:
        while not self._over:
            with contextlib.suppress(TimeoutError):
                frame, notes, _, _ = self._socket.recvmsg(pdo.FRAME_BYTES, 64)
                seconds, nanoseconds = struct.unpack("qq", notes[0][2])
                can_id, data = pdo.unpack(frame)
                self.frames.append((seconds + nanoseconds * 1e-9, can_id, data))

    def close(self) -> None:
        self._over = True
        self._thread.join()
        self._socket.close()

    def cycles(self, since: int = 0) -> list[tuple[float, list[int]]]:
        """(when, setpoints) of each SYNC; each is followed by those of all drives, in their order."""
        found: list[tuple[float, list[int]]] = []
        for at_s, can_id, data in self.frames[since:]:
            if can_id == pdo.SYNC:
                found.append((at_s, []))
            elif can_id & ~0xF == pdo.RPDO1 and found:
                assert can_id == pdo.rpdo(1, len(found[-1][1]) + 1), "out of order"
                found[-1][1].append(pdo.COMMAND.unpack(data)[1])
        assert all(len(setpoints) == 5 for _, setpoints in found[:-1]), "a SYNC without its setpoints"
        return found


@contextlib.contextmanager
def ear() -> Iterator[Ear]:
    listening = Ear()
    try:
        yield listening
    finally:
        listening.close()


def steps_of_x(cycles: list[tuple[float, list[int]]]) -> list[int]:
    return [b[1][0] - a[1][0] for a, b in itertools.pairwise(cycles) if len(b[1]) == 5]


def struck(
    machine: Machine, strike: Callable[[Live, Ear], None], attempts: int = on_can.ATTEMPTS
) -> tuple[Snapshot | str, Ear, int]:
    """A cut that is struck on its way: the last snapshot or the error, what was heard, and from when on.

    One that the computer was away from is begun anew.
    """
    last: Snapshot | str
    for left in reversed(range(attempts)):
        began: list[int] = []
        with ear() as heard, on_can.ready(CUT, machine) as (running, _):

            def act(running: Live = running, heard: Ear = heard, began: list[int] = began) -> None:
                began.append(len(heard.frames))
                strike(running, heard)

            pump, last = pump_of(running.tick.pid), ""
            with contextlib.suppress(SessionError):
                _, last = run(running, at(running, STRUCK_S, act))
            if not is_alive(pump):  # then the tick ends by itself
                until(lambda running=running: not running.tick.is_alive())
            if not running.tick.is_alive():
                last = running.tick.last_words()
        away = absence.figures().away()
        if began and not (left and away):
            break
        on_can.skip_if_away(not left and not began)
    return last, heard, began[0]


def comes_up_again(machine: Machine) -> bool:
    with on_can.ready(DRY, machine) as (running, _):
        _, last = run(running)
    return (last.mode, last.fault) == (Mode.READY, Fault.NONE)


def outside(cycles: list[tuple[float, list[int]]]) -> int:
    """SYNCs whose distance is not that of the period, give or take what is late."""
    gaps = [b - a for (a, _), (b, _) in itertools.pairwise(cycles)]
    return sum(not (1.0 - LATE_SHARE) * T < gap < (1.0 + LATE_SHARE) * T for gap in gaps)


def full_feed(steps: list[int]) -> list[int]:
    """The part of a cut at its feed, without what speeds up and slows down."""
    usual = sorted(steps)[len(steps) * 3 // 4]
    at_feed = [i for i, step in enumerate(steps) if abs(step - usual) <= 1]
    return steps[at_feed[0] : at_feed[-1] + 1]


class Stops:
    """The tick is stopped for so long, and goes on, again and again while a block runs."""

    def __init__(self, pid: int, stopped_s: float, times: int) -> None:
        self._pid, self._stopped_s, self._times = pid, stopped_s, times
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._stop)

    def _stop(self) -> None:
        with contextlib.suppress(ProcessLookupError):  # it has ended
            for _ in range(self._times):
                os.kill(self._pid, signal.SIGSTOP)
                time.sleep(self._stopped_s)
                os.kill(self._pid, signal.SIGCONT)
                if self._over.wait(0.025):
                    return

    def __enter__(self) -> None:
        self._thread.start()

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()


@pytest.mark.parametrize(("stopped_s", "times"), [(0.01, 100), (0.1, 30)])
def test_a_tick_that_is_stopped_again_and_again_is_not_seen_on_the_bus(stopped_s: float, times: int) -> None:
    """Every period has its setpoint, once and in its order: at the feed each is as far as the one before."""

    def cut(stops: int) -> tuple[Snapshot | str, list[tuple[float, list[int]]]]:
        with on_can.drives(), ear() as heard, on_can.ready(CUT, machine()) as (running, _):
            begin, last = len(heard.frames), ""
            with contextlib.suppress(SessionError), Stops(running.tick.pid, stopped_s, stops):
                _, last = run(running)
            return last, heard.cycles(begin)

    for left in reversed(range(on_can.ATTEMPTS)):
        found = [cut(stops) for stops in (0, times)]
        away = absence.figures().away()
        ended = [isinstance(last, Snapshot) and last.fault is Fault.NONE for last, _ in found]
        if all(ended) or not away:
            break
        on_can.skip_if_away(not left)
    assert all(ended), found[-1][0]
    late = [outside(cycles) for _, cycles in found]
    print(f"SYNCs outside of the period, without and with stops: {late}")
    cut_at_feed = full_feed(steps_of_x(found[-1][1]))
    assert len(cut_at_feed) > 200
    least = cut_at_feed.index(min(cut_at_feed))
    beside = cut_at_feed[max(0, least - 20) : least + 20]
    assert max(cut_at_feed) - min(cut_at_feed) <= 2, f"a setpoint is missing, or there twice: {beside}"
    assert away or late[1] <= 2 * late[0] + 3


def assert_braked_and_silent(heard: Ear, began: int, stop: int | None = None) -> None:
    """From ``began`` on: full feed, a ramp to rest that never goes back, rest, and nothing of ours."""
    end_s = heard.frames[began][0] if stop is None else heard.frames[stop - 1][0]
    frames = heard.frames[began:stop]
    ours = [at_s for at_s, can_id, _ in frames if can_id in (pdo.SYNC, BEAT) or can_id & ~0xF == pdo.RPDO1]
    cut = Ear.__new__(Ear)
    cut.frames = frames
    steps = steps_of_x(cut.cycles())
    rest = next(i for i, step in enumerate(steps) if step == 0)
    assert steps[0] > 100
    assert all(b <= a + 1 for a, b in itertools.pairwise(steps)), steps
    largest = max(a - b for a, b in itertools.pairwise(steps))
    assert largest < steps[0] / 2, f"no ramp: {steps}"
    assert steps[rest:] == [0] * len(steps[rest:])
    assert round(HELD_S / T) - 2 <= len(steps) - rest <= round(HELD_S / T) + 1
    if stop is not None:
        assert end_s - ours[-1] > 0.05, "silence"


def test_a_tick_that_is_stopped_for_longer_than_its_stock_ends_in_rest_silence_and_a_fault() -> None:
    marks: list[int] = []

    def strike(running: Live, heard: Ear) -> None:
        os.kill(running.tick.pid, signal.SIGSTOP)
        time.sleep(0.6)
        marks.append(len(heard.frames))
        os.kill(running.tick.pid, signal.SIGCONT)

    with on_can.drives():
        last, heard, began = struck(machine(0.02), strike)
    assert isinstance(last, Snapshot)
    assert last.mode is Mode.FAULT and last.fault is Fault.STOCK_USED_UP
    assert_braked_and_silent(heard, began, marks[-1])
    rest = heard.cycles(began)
    still = [setpoints[0] for at_s, setpoints in rest if len(setpoints) == 5][-1]
    at_rest = [setpoints[0] for _, setpoints in Ear.cycles(_part(heard, began, marks[-1]))][-1]
    assert abs(still - at_rest) < 200, "it went on"


def _part(heard: Ear, first: int, last: int) -> Ear:
    part = Ear.__new__(Ear)
    part.frames = heard.frames[first:last]
    return part


def test_a_tick_that_is_killed_ends_in_rest_and_silence_and_another_may_begin() -> None:
    pumps: list[int] = []

    def strike(running: Live, heard: Ear) -> None:
        pumps.append(pump_of(running.tick.pid))
        os.kill(running.tick.pid, signal.SIGKILL)
        until(lambda: not is_alive(pumps[-1]))
        time.sleep(0.1)

    with on_can.drives():
        last, heard, began = struck(machine(), strike)
        assert isinstance(last, str) and "SIGKILL" in last
        assert_braked_and_silent(heard, began)
        assert on_can.stopped(machine())
        assert comes_up_again(machine())


def test_a_pump_that_is_killed_is_told_and_the_drives_stop() -> None:
    with on_can.drives():
        last, _, _ = struck(machine(), lambda running, _: os.kill(pump_of(running.tick.pid), signal.SIGKILL))
        assert isinstance(last, str) and "directrix-pump" in last
        assert on_can.stopped(machine())
        assert comes_up_again(machine())


def test_a_pump_that_is_stopped_is_told_and_goes_nowhere_when_it_goes_on() -> None:
    marks: list[tuple[int, int]] = []

    def strike(running: Live, heard: Ear) -> None:
        pump = pump_of(running.tick.pid)
        os.kill(pump, signal.SIGSTOP)
        until(lambda: now_of(running).mode is Mode.FAULT)
        time.sleep(0.5)
        marks.append((len(heard.frames), int(now_of(running).fault)))
        os.kill(pump, signal.SIGCONT)

    with on_can.drives():
        last, heard, began = struck(machine(), strike)
        assert isinstance(last, Snapshot) and last.mode is Mode.FAULT
        assert marks[-1][1] == Fault.SYNC_LOST
        assert not [one for one in heard.frames[began + 60 : marks[-1][0]] if one[1] in (pdo.SYNC, BEAT)]
        assert on_can.stopped(machine())


def test_where_both_are_killed_the_drives_stop_by_their_own_supervision() -> None:
    def strike(running: Live, _: Ear) -> None:
        pump = pump_of(running.tick.pid)
        os.kill(running.tick.pid, signal.SIGKILL)
        os.kill(pump, signal.SIGKILL)

    with on_can.drives():
        last, _, _ = struck(machine(), strike)
        assert isinstance(last, str) and "SIGKILL" in last
        assert on_can.stopped(machine())
        assert comes_up_again(machine())
