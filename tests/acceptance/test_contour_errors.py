"""Setpoints and positions that are lost or late on the bus: what the tool is off its path is told, all of it.

Judged by the motors themselves (``Observer``), which the controller does not see: their distance from the
path of the commands, as this file finds it.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pytest
from support.machines.stepped_runs import SHIPPED, shipped

from controller.ipc.handoff import COLUMN
from controller.runtime import checked
from controller.runtime.bench.fault_file import MachineScript
from controller.runtime.bench.observer import Sight
from controller.runtime.contour_error import Demands
from controller.runtime.contour_watch import REPORTED_TICKS, ContourWatch
from controller.runtime.events import Event
from controller.runtime.stepped import Run, SteppedMachine
from controller.state.modes import Fault, Request

LONG = REPORTED_TICKS + 1  # "more than 10 ticks"
LATER = 15  # ticks from a motor to the row in which its place was heard, lost frames among them
LOOK_BACK_S = 0.1
COUNTS_MM = 0.002  # of a place that is heard in counts, at the end of a flute
TEXT = """G21 G90 G54 G61 G94
T2 M6
G43 H2
G0 X0 Y0 Z60
G1 X30 Y20 F{feed}
G2 X30 Y50 R30
G3 X-10 Y20 R40
G1 X0 Y0 Z50
M30
"""


def losses(rng: random.Random, seconds: float) -> str:
    """Some of what a bus does to setpoints, on some of the axes."""
    kinds = (
        lambda axis: f"drop rpdo {axis} x {rng.choice((1, 3, 10, 20, 40))}",
        lambda axis: f"delay rpdo {axis} by {rng.choice((1, 2, 4, 10))} ms for {rng.choice((0.1, 0.5))} s",
        lambda axis: f"repeat rpdo {axis} for {rng.choice((0.02, 0.06, 0.1))} s",
        lambda axis: f"drop rpdo {axis} for {rng.choice((0.1, 0.5, 2.0))} s odds 0.3",
        lambda axis: f"drop tpdo {axis} for 0.3 s odds 0.2",
    )
    lines = [
        f"at {rng.uniform(0.5, seconds):.4f} s: {rng.choice(kinds)(rng.choice('XYZ'))}"
        for _ in range(rng.randint(1, 3))
    ]
    return "\n".join([f"seed {rng.randrange(1000)}", *lines])


@dataclass(frozen=True, eq=False)
class Lossy:
    """A run under such a script."""

    bench: SteppedMachine
    watch: ContourWatch
    run: Run
    sight: Sight
    first_tick: int

    @classmethod
    def of(cls, name: str, text: str, script: str, events: Sequence[Event] = (), **how: object) -> Lossy:
        bench = SteppedMachine(shipped(name, **how))
        task = checked.task(text.encode(), "part.ngc", bench.machine)
        walk = checked.walk_of(task, None, unchecked=False)
        watch = bench.watch_contour(Demands(task.read(), bench.planner.stretches, bench.machine))
        bench.come_up()
        observer = bench.observe()
        observer.begin(0.0)
        MachineScript.read(script, bench.machine).inject(bench.rig.buses, bench.machine.period_s)
        run = bench.run(checked.walk_from(task, walk, bench.joints, unchecked=False), events)
        return cls(bench, watch, run, observer.sight, observer.first_tick)

    @property
    def at_feed(self) -> np.ndarray:
        """Ticks in which the drives are to follow a motion at feed."""
        rows, stretches = self.run.rows, self.bench.planner.stretches
        fed = {number for number, one in stretches.items() if one.feed_mm_s is not None}
        ticks = {int(row[COLUMN["tick"]]) for row in rows if int(row[COLUMN["motion_id"]]) in fed}
        return np.array([one.on_path and one.tick + self.first_tick in ticks for one in self.sight.ticks])

    @property
    def errors(self) -> np.ndarray:
        """(N,) mm, tick by tick, of the motors: the larger one of tip and top of the flute."""
        tool = self.bench.machine.tool(2)
        assert tool is not None
        back = round(LOOK_BACK_S / self.bench.machine.period_s)
        found = np.zeros(len(self.sight.ticks))
        for above_mm in (0.0, tool.flute_mm):
            path, there = (self._points(joints, tool.length_mm, above_mm) for joints in self._both())
            found = np.maximum(found, [_off(path[max(0, i - back) : i + 1], p) for i, p in enumerate(there)])
        return found

    def _both(self) -> tuple[np.ndarray, np.ndarray]:
        return self.sight.command, self.sight.motors

    def _points(self, joints: np.ndarray, length_mm: float, above_mm: float) -> np.ndarray:
        poses = [self.bench.kinematics.forward(tuple(map(float, row)), length_mm) for row in joints]
        return np.array([np.add(pose.tip, np.multiply(above_mm, pose.axis)) for pose in poses])

    def excesses(self, most_mm: float, ticks: int) -> list[tuple[int, int]]:
        """(first, last) tick of the machine, of what is beyond that for so many ticks."""
        beyond = np.concatenate([[False], (self.errors > most_mm) & self.at_feed, [False]])
        first, end = (np.flatnonzero(np.diff(beyond.astype(int)) == sign) for sign in (1, -1))
        spans = zip(first + self.first_tick, end - 1 + self.first_tick, strict=True)
        return [(int(a), int(b)) for a, b in spans if b - a + 1 >= ticks]


def _off(path: np.ndarray, point: np.ndarray) -> float:
    """The distance of a point to a polyline."""
    begin, chord = path[:-1], np.diff(path, axis=0)
    length = (chord * chord).sum(axis=1)
    share = ((point - begin) * chord).sum(axis=1) / np.where(length > 0.0, length, 1.0)
    near = np.vstack([path[-1:], begin + np.clip(share, 0.0, 1.0)[:, None] * chord])
    return float(np.sqrt(((near - point) ** 2).sum(axis=1)).min())


def assert_told(lossy: Lossy) -> int:
    """All that is beyond the tolerance for long is reported, and nothing that is not beyond it at all."""
    tolerance = lossy.bench.machine.tolerance_mm
    assert tolerance is not None
    told = [(one.tick, one.tick + one.ticks) for one in lossy.watch.excesses]
    sight, fault = lossy.sight, lossy.run.fault
    until = lossy.first_tick + len(sight.ticks)
    if fault is not Fault.NONE:  # what a drive without torque does is told by its fault
        until = lossy.first_tick + next(one.tick for one in sight.raised() if one.fault is fault)
    wanted = [one for one in lossy.excesses(tolerance + COUNTS_MM, LONG) if one[1] + LATER < until]
    for first, last in wanted:
        assert any(a <= last + LATER and b >= first for a, b in told), (first, last, told)
    there = lossy.excesses(tolerance - COUNTS_MM, 2)
    for a, b in told:
        assert any(a <= last + LATER and b >= first for first, last in there), (a, b)
    return len(wanted)


def drawn(seed: int) -> Lossy:
    rng = random.Random(seed)
    feed = rng.choice((500, 1000, 2000, 3000, 6000))
    script = losses(rng, 150.0 / (feed / 60.0))
    lossy = Lossy.of(rng.choice(SHIPPED), TEXT.format(feed=feed), script)
    named = {word for line in script.splitlines()[1:] for word in line.split() if word in ("X", "Y", "Z")}
    axes = [lossy.bench.machine.axes[one.largest.axis].name for one in lossy.watch.excesses]
    assert set(axes) <= named, (axes, named)
    return lossy


@pytest.mark.parametrize("seed", (8, 21))
def test_what_lost_setpoints_cost_is_told_with_place_and_axis(seed: int) -> None:
    assert_told(drawn(seed))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(1000))
def test_what_lost_setpoints_cost_is_told_whatever_they_are(seed: int) -> None:
    assert_told(drawn(1000 + seed))


FORTY = "at 2.5 s: drop rpdo Y x 40"


def test_forty_lost_setpoints_are_told_and_end_the_run_as_the_machine_file_says() -> None:
    warned = Lossy.of("trunnion", TEXT.format(feed=600), FORTY)
    assert warned.run.result == "completed"
    (one,) = warned.watch.excesses
    assert warned.bench.machine.axes[one.largest.axis].name == "Y" and one.largest.line in (5, 6)
    assert assert_told(warned) == 1
    held = Lossy.of("trunnion", TEXT.format(feed=600), FORTY, contour_error="hold")
    assert held.run.result == "held" and held.run.line in (5, 6)
    assert held.run.rows[-1, COLUMN["tick"]] < one.tick + 300
    slow = Lossy.of("trunnion", TEXT.format(feed=600), FORTY, contour_error="slow")
    assert slow.run.result == "completed" and slow.run.rows[-1, COLUMN["override"]] == 0.5


def test_a_healthy_run_says_nothing() -> None:
    events = (Event(400, Request.HOLD), Event(700, Request.RESUME), Event(900, Request.OVERRIDE, 2.0))
    healthy = Lossy.of("table_head", TEXT.format(feed=3000), "", events)
    assert healthy.run.result == "completed" and healthy.watch.excesses == []
    assert healthy.watch.largest is not None and healthy.watch.largest.mm < 0.02
    assert set(healthy.watch.by_line) == {5, 6, 7, 8}
