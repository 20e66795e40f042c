"""The rehearsal before a deadline: only where there is time, and nothing comes of it but warm caches."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.machines.interrupted_runs import TIPS
from support.machines.stepped_runs import cut, program, shipped
from support.machines.tapping import Tapper
from support.machines.tick_bench import Bench

from controller.ipc.handoff import Jog, Recorder, SnapshotBoard
from controller.machine import compensation
from controller.machine.model import Machine, Pitch
from controller.runtime.events import Event
from controller.runtime.stepped import SteppedMachine
from controller.state.modes import Request
from controller.tick.cycle import Cycle
from controller.tick.loop import Loop, SteppedClock

PERIOD_S = 0.001
OPERATOR = (
    Event(500, Request.HOLD),
    Event(700, Request.RESUME),
    Event(900, Request.OVERRIDE, 0.5),
    Event(1100, Request.OVERRIDE, 1.0),
    Event(1102, Request.HOLD),
    Event(1110, Request.RESUME),
)
TAP = "G21 G90 G54 G40\nS800 M3\nG0 X5. Y-50.\nG0 Z40.\nG33.1 Z35. K1.\nG0 Z60.\nM30\n"


# ---- nothing comes of it -----------------------------------------------------------


class Rehearsed:
    """A cycle that rehearses before each of its ticks, as often as one likes."""

    def __init__(self, cycle: Cycle) -> None:
        self._cycle = cycle

    def __getattr__(self, name: str) -> Any:
        return getattr(self._cycle, name)

    def receive(self, now_s: float) -> None:
        self._cycle.rehearse(now_s)
        self._cycle.receive(now_s)
        self._cycle.rehearse(now_s)


def with_screws() -> Machine:
    """A machine whose axes miss where they are told to be, by where they come from."""
    at, off = (-1000.0, 1000.0), (0.01, 0.01)
    pitch = Pitch(at, tuple(-x for x in off), off)
    made = shipped(period_s=0.004)
    axes = [axis if axis.is_rotary else replace(axis, pitch=pitch) for axis in made.axes]
    return replace(made, axes=compensation.reserved(axes))


def rows_of(
    text: str, machine: Machine, rehearsed: bool, lateness: Callable[[int], float] | None = None
) -> np.ndarray:
    stepped = SteppedMachine(machine, lateness=lateness)
    stepped.come_up()
    if rehearsed:
        stepped._loop._cycle = Rehearsed(stepped.cycle)  # type: ignore[assignment]
    return cut(text, events=OPERATOR, stepped=stepped).run.rows


def now_and_then(n: int) -> float:
    """Late so that a SYNC is left out; and by so many periods that drives stand."""
    return 0.02 if n % 1900 == 1899 else 0.0008 if n % 97 == 96 else 0.0


def test_a_cut_of_surfaces_with_rehearsals_is_the_same_to_the_last_bit() -> None:
    text = program("example2_ready", "3000.")
    plain, rehearsed = (rows_of(text, shipped(period_s=0.004), one, now_and_then) for one in (False, True))
    assert len(plain) > 1000 and plain.tobytes() == rehearsed.tobytes()


def test_lines_on_axes_with_tables_with_rehearsals_are_the_same_to_the_last_bit() -> None:
    plain, rehearsed = (rows_of(TIPS.replace("S8000 M3", ""), with_screws(), one) for one in (False, True))
    assert len(plain) > 1000 and plain.tobytes() == rehearsed.tobytes()


def test_a_thread_with_rehearsals_is_the_same_to_the_last_bit() -> None:
    found = []
    for rehearsed in (False, True):
        tapper = Tapper()
        if rehearsed:
            tapper.bench._loop._cycle = Rehearsed(tapper.bench.cycle)  # type: ignore[assignment]
        found.append(tapper.run(TAP))
    assert found[0].result == found[1].result == "completed"
    assert found[0].rows.tobytes() == found[1].rows.tobytes()


def test_a_jog_with_rehearsals_is_the_same_to_the_last_bit() -> None:
    found = []
    for rehearsed in (False, True):
        bench = Bench()
        if rehearsed:
            bench.loop._cycle = Rehearsed(bench.cycle)  # type: ignore[assignment]
        bench.enable()
        bench.jog(Jog((1.0, 0.0, 0.0, 0.0, 0.0), 100.0, math.inf))
        bench.tick(400)
        found.append(bench.rows())
    assert len(found[0]) > 400 and found[0].tobytes() == found[1].tobytes()


def test_what_is_filled_is_not_shown_and_what_is_shown_stays() -> None:
    board, recorder = SnapshotBoard(), Recorder(rows=8)
    bench = Bench()
    bench.enable()
    bench.tick(3)
    shown, rows = bench.snapshot, bench.recorder.last(8)
    bench.cycle.rehearse(0.0)
    assert bench.snapshot == shown
    assert bench.recorder.last(8).tobytes() == rows.tobytes()
    assert board.read() is None and len(recorder.drain()) == 0


# ---- where there is time -----------------------------------------------------------


class Stage:
    """A cycle and a clock in one: what the loop calls, and how long that takes."""

    def __init__(self, wakes_early_s: float, rehearsal_s: float) -> None:
        self.sync = self
        self.earliest_s = float("-inf")  # of a SYNC
        self.machine = shipped(period_s=PERIOD_S)
        self.wakes_early_s, self.rehearsal_s, self.drain_s = wakes_early_s, rehearsal_s, 20e-6
        self.time_s = 0.0
        self.called: list[str] = []
        self.late_s: list[float] = []

    def now_s(self) -> float:
        return self.time_s

    def wake(self, deadline_s: float, early_s: float) -> None:
        self.time_s = deadline_s - self.wakes_early_s
        self.called.clear()

    def spin(self, deadline_s: float) -> float:
        self.time_s = max(self.time_s, deadline_s)
        return self.time_s

    def rehearse(self, now_s: float) -> None:
        self.called.append("rehearse")
        self.time_s += self.rehearsal_s

    def receive(self, now_s: float) -> None:
        self.called.append("receive")
        self.time_s += self.drain_s

    def run(self, now_s: float, lateness_s: float, missed: int = 0) -> bool:
        self.called.append("run")
        self.late_s.append(lateness_s)
        return True


def staged(stage: Stage) -> Loop:
    return Loop(stage, stage)  # type: ignore[arg-type]


def test_the_rehearsal_comes_before_the_drain_and_both_before_the_deadline() -> None:
    stage = Stage(wakes_early_s=200e-6, rehearsal_s=60e-6)
    loop = staged(stage)
    for _ in range(50):
        loop.tick()
        assert stage.called == ["rehearse", "receive", "run"]
    assert max(stage.late_s) < 1e-9


def test_without_time_before_the_deadline_nothing_is_rehearsed() -> None:
    stage = Stage(wakes_early_s=10e-6, rehearsal_s=60e-6)
    loop = staged(stage)
    loop.tick()  # how long it takes is not known before
    for _ in range(5):
        loop.tick()
        assert stage.called == ["receive", "run"]


def test_woken_behind_the_deadline_sync_comes_before_the_drain_but_never_twice_in_a_row() -> None:
    stage = Stage(wakes_early_s=200e-6, rehearsal_s=60e-6)
    loop = staged(stage)
    loop.tick()
    stage.wakes_early_s = -10e-6
    for called in (["run"], ["receive", "run"], ["run"], ["receive", "run"]):
        loop.tick()
        assert stage.called == called
    assert stage.late_s[1:] == pytest.approx([10e-6, 30e-6, 10e-6, 30e-6])


def test_woken_too_late_for_sync_there_is_no_hurry() -> None:
    stage = Stage(wakes_early_s=-0.26 * PERIOD_S, rehearsal_s=60e-6)
    loop = staged(stage)
    for _ in range(3):
        loop.tick()
        assert stage.called == ["receive", "run"]


def test_a_rehearsal_that_has_come_too_late_is_tried_again_but_rarely() -> None:
    stage = Stage(wakes_early_s=50e-6, rehearsal_s=60e-6)
    loop, rehearsed = staged(stage), 0
    for _ in range(1000):
        loop.tick()
        rehearsed += "rehearse" in stage.called
    assert 2 <= rehearsed <= 5
    stage.rehearsal_s = 20e-6  # there is time for it again
    for _ in range(500):
        loop.tick()
    assert "rehearse" in stage.called


def test_the_stepped_clock_has_no_time_for_it() -> None:
    bench = Bench()
    assert isinstance(bench.clock, SteppedClock)
    called: list[float] = []
    cycle = Rehearsed(bench.cycle)
    cycle.rehearse = called.append  # type: ignore[attr-defined]
    cycle.receive = bench.cycle.receive  # type: ignore[method-assign]
    bench.loop._cycle = cycle  # type: ignore[assignment]
    bench.tick(20)
    assert not called
