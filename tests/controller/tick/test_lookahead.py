"""The work of a look ahead, in rows: a period that is new is computed once, along a thread as well."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import pytest
from support.machines import tapping
from support.machines.stepped_runs import cut, shipped
from support.machines.tapping import Tapper

from controller.machine.deviation_tables import Pitch
from controller.machine.model import Machine
from controller.runtime.stepped import SteppedMachine
from controller.tick.follow import Follow
from controller.tick.lookahead import Ghost, Lookahead
from drives.bench.simulated.spindle_motor import MotorParameters

THREAD = "G21 G90 G54 G40\nS600 M3\nG0 X5. Y-50.\nG0 Z40\nF600\nG84 Z28 R40\nG80\nM30\n"
PATH = "G21 G90 G54 G40 G64 P0.01\nF4000\nG1 X20 Y10\nG2 X40 Y-10 R20\nG1 X30 A5\nM30\n"
NEW = 2.0  # rows in a tick, on average: one, and what comes where motion begins
AT_ONCE = 50  # where motion begins


class Work:
    """Of each tick on the thread, in rows."""

    def __init__(self) -> None:
        self.stepped: list[int] = []
        self.led: list[int] = []


@contextmanager
def counted(tapper: Tapper, monkeypatch: pytest.MonkeyPatch) -> Iterator[Work]:
    work, now = Work(), [0, 0]
    step, led, tick = Ghost.step, Lookahead._led, tapper.bench.tick

    def stepped(self: Ghost, go: bool) -> Any:
        now[0] += 1
        return step(self, go)

    def laid(self: Lookahead, *given: Any) -> Any:
        now[1] += 1
        return led(self, *given)

    def ticked() -> None:
        now[:] = 0, 0
        tick()
        if tapper.bench.cycle.coupling.active:
            work.stepped.append(now[0])
            work.led.append(now[1])

    monkeypatch.setattr(Ghost, "step", stepped)
    monkeypatch.setattr(Lookahead, "_led", laid)
    monkeypatch.setattr(tapper.bench, "tick", ticked)
    yield work


def with_tables() -> Machine:
    """A mill whose linear axes have pitch and play."""
    made, pitch = tapping.machine(), Pitch((-300.0, 0.0, 300.0), (0.01, 0.02, -0.01), (-0.01, 0.005, -0.02))
    axes = [replace(axis, pitch=pitch) if axis.name in "XYZ" else axis for axis in made.axes]
    return replace(made, axes=tuple(axes))


@pytest.mark.parametrize("made", [tapping.machine, with_tables])
def test_on_a_thread_a_tick_computes_the_rows_that_are_new(
    made: Callable[[], Machine], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where the spindle is stuck, so that all that was foreseen of it is made anew."""
    tapper = Tapper(made(), motor=MotorParameters(0.02, 0.02, 200.0))
    periods = round(tapper.machine.stock_s / tapper.machine.period_s)
    tapper.at = {300: lambda: tapper.spindle.jam(True, tapper.now_s)}
    with counted(tapper, monkeypatch) as work:
        assert tapper.run(THREAD).result == "held"
    ticks = len(work.stepped)
    assert ticks > 400
    assert 0.4 * ticks < sum(work.stepped) <= NEW * ticks and max(work.stepped) <= AT_ONCE
    assert work.stepped.count(1) > 0.6 * ticks, "stops begin in every second tick, and no tick has two rows"
    turning = work.led[:300]
    assert 280 <= sum(turning) <= NEW * len(turning) and max(work.led) == periods
    anew = [stepped for stepped, led in zip(work.stepped, work.led, strict=True) if led == periods]
    assert len(anew) > 50 and sorted(anew)[len(anew) // 2] <= NEW


def test_no_tick_computes_the_joints_that_were_looked_ahead(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where the plan time of a tick is rounded otherwise than that of the period ahead."""
    taken: list[bool] = []
    step, stepped = Follow.step, SteppedMachine(shipped(stock_s=0.03))
    stepped.come_up()

    def noted(self: Follow, go: bool, foreseen: Any = None) -> Any:
        before = self.joints
        found = step(self, go, foreseen)
        if type(self) is Follow and self.joints != before:
            taken.append(foreseen is not None and self.joints is foreseen.joints)
        return found

    monkeypatch.setattr(Follow, "step", noted)
    cut(PATH, stepped=stepped)
    assert len(taken) > 300 and all(taken[1:-1]), "all but both ends"
