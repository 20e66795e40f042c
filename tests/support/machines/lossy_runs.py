"""Runs in which setpoints or positions are lost or late on the bus, and how far the tool is off then.

Judged by the motors themselves (``Observer``), which the controller does not see: their distance from the
path of the commands, as this file finds it.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from support.machines.forked_machine import Forkable
from support.machines.stepped_runs import shipped

from controller.ipc.handoff import COLUMN
from controller.runtime import checked
from controller.runtime.bench.fault_file import MachineScript
from controller.runtime.bench.observer import Sight
from controller.runtime.contour_error import Demands
from controller.runtime.contour_watch import REPORTED_TICKS, ContourWatch
from controller.runtime.events import Event
from controller.runtime.stepped import Run
from controller.state.modes import Fault

LONG = REPORTED_TICKS + 1  # "more than 10 ticks"
LATER = 15  # ticks from a motor to the row in which its place was heard, lost frames among them
LOOK_BACK_S = 0.1  # as the controller looks: how late a motor may be
COUNTS_MM = 0.002  # of a place that is heard in counts, at the end of a flute
TOOL = 3  # 50 mm long
TEXT = """G21 G90 G54 G61 G94
T3 M6
G43 H3
G0 X0 Y0 Z60
G1 X30 Y20 {first}6 {second}15 F{feed}
G2 X30 Y50 R30
G3 X-10 Y20 R40
G1 X0 Y0 Z50 {first}-4 {second}-20
M30
"""

Kind = Callable[[random.Random, str], str]
KINDS: tuple[Kind, ...] = (
    lambda rng, axis: f"drop rpdo {axis} x {rng.choice((1, 3, 10, 20, 40))}",
    lambda rng, axis: f"delay rpdo {axis} by {rng.choice((1, 2, 4, 10))} ms for {rng.choice((0.1, 0.5))} s",
    lambda rng, axis: f"repeat rpdo {axis} for {rng.choice((0.02, 0.06, 0.1))} s",
    lambda rng, axis: f"drop rpdo {axis} for {rng.choice((0.1, 0.5))} s odds 0.3",
    lambda rng, axis: f"drop tpdo {axis} for 0.3 s odds 0.2",
)


def script(rng: random.Random, names: Sequence[str], most: int, seconds: float) -> tuple[str, set[str]]:
    """What a bus does to frames of some axes, within so many seconds; and these axes."""
    axes = [rng.choice(names) for _ in range(rng.randint(1, most))]
    lines = [f"at {rng.uniform(0.01, seconds):.4f} s: {rng.choice(KINDS)(rng, axis)}" for axis in axes]
    return "\n".join([f"seed {rng.randrange(1000)}", *lines]), set(axes)


class Watched(Forkable):
    """A machine that has come up, whose motors and contour error are watched."""

    watch: ContourWatch
    task: checked.Task
    walk: checked.Walk

    @classmethod
    def up(cls, name: str, feed: int, **how: object) -> Watched:
        """With its program read, but not begun."""
        bench = cls(shipped(name, **how))
        first, second = (bench.machine.axes[i].name for i in bench.machine.rotary())
        text = TEXT.format(feed=feed, first=first, second=second)
        bench.task = checked.task(text.encode(), "part.ngc", bench.machine)
        bench.walk = checked.walk_of(bench.task, None, unchecked=False)
        demands = Demands(bench.task.read(), bench.planner.segments, bench.machine)
        bench.watch = bench.watch_contour(demands)
        bench.come_up()
        bench.observer.begin(0.0)
        return bench

    def befall(self, faults: str) -> None:
        """Times count from now on."""
        MachineScript.read(faults, self.machine).inject(self.rig.buses, self.machine.period_s)

    def cut(self, events: Sequence[Event] = ()) -> Run:
        return self.run(checked.walk_from(self.task, self.walk, self.joints, unchecked=False), events)


@dataclass
class Judged:
    """What the motors were off, from some tick on, and what was told of it."""

    told: list[tuple[int, int, str, int]]  # first tick, the one after it, axis, line
    missing: list[tuple[int, int]] = field(default_factory=list)  # ticks from and to
    false: list[tuple[int, int, str, int]] = field(default_factory=list)
    long: int = 0  # so many were to be told


def judged(bench: Watched, rows: np.ndarray, fault: Fault, first: int = 0) -> Judged:
    """From the tick ``first`` of the machine on; ``rows`` of the recorder, all since the program's begin."""
    sight, machine = bench.observer.sight, bench.machine
    tolerance = machine.tolerance_mm
    assert tolerance is not None
    begin = bench.observer.first_tick
    back = round(LOOK_BACK_S / machine.period_s)
    since = max(0, first - begin)
    errors = _errors(bench, sight, max(0, since - back))[min(since, back) :]
    at_feed = _at_feed(bench, sight, rows)[since:]
    excesses = [one for one in bench.watch.excesses if one.tick >= first]
    told = [
        (one.tick, one.tick + one.ticks, machine.axes[one.largest.axis].name, one.largest.line)
        for one in excesses
    ]
    until = begin + len(sight.ticks)
    if fault is not Fault.NONE:  # what a drive without torque does is told by its fault
        until = begin + next((one.tick for one in sight.raised() if one.fault is fault), until - begin)
    found = Judged(told)
    for low, high in _spans(errors, at_feed, tolerance + COUNTS_MM, LONG, begin + since):
        if high + LATER >= until:
            continue
        found.long += 1
        if not any(a <= high + LATER and b >= low for a, b, *_ in told):
            found.missing.append((low, high))
    there = _spans(errors, at_feed, tolerance - COUNTS_MM, 2, begin + since)
    found.false = [one for one in told if not any(one[0] <= b + LATER and one[1] >= a for a, b in there)]
    return found


def _at_feed(bench: Watched, sight: Sight, rows: np.ndarray) -> np.ndarray:
    """Ticks in which the drives are to follow a motion at feed."""
    fed = {number for number, one in bench.planner.segments.items() if one.feed_mm_s is not None}
    ticks = set(rows[np.isin(rows[:, COLUMN["motion_id"]], list(fed)), COLUMN["tick"]].astype(int).tolist())
    begin = bench.observer.first_tick
    return np.array([one.on_path and one.tick + begin in ticks for one in sight.ticks])


def _errors(bench: Watched, sight: Sight, since: int) -> np.ndarray:
    """(N,) mm, tick by tick, of the motors: the larger one of tip and top of the flute."""
    tool = bench.machine.tool(TOOL)
    assert tool is not None
    back = round(LOOK_BACK_S / bench.machine.period_s)
    both = sight.command[since:], sight.motors[since:]
    found = np.zeros(len(both[0]))
    for above_mm in (0.0, tool.flute_mm):
        path, there = (_points(bench, joints, tool.length_mm, above_mm) for joints in both)
        found = np.maximum(found, [_off(path[max(0, i - back) : i + 1], p) for i, p in enumerate(there)])
    return found


def _points(bench: Watched, joints: np.ndarray, length_mm: float, above_mm: float) -> np.ndarray:
    poses = [bench.kinematics.forward(tuple(map(float, row)), length_mm) for row in joints]
    return np.array([np.add(pose.tip, np.multiply(above_mm, pose.axis)) for pose in poses])


def _off(path: np.ndarray, point: np.ndarray) -> float:
    """The distance of a point to a polyline."""
    begin, chord = path[:-1], np.diff(path, axis=0)
    length = (chord * chord).sum(axis=1)
    share = ((point - begin) * chord).sum(axis=1) / np.where(length > 0.0, length, 1.0)
    near = np.vstack([path[-1:], begin + np.clip(share, 0.0, 1.0)[:, None] * chord])
    return float(np.sqrt(((near - point) ** 2).sum(axis=1)).min())


def _spans(
    errors: np.ndarray, at_feed: np.ndarray, most_mm: float, ticks: int, begin: int
) -> list[tuple[int, int]]:
    """(first, last) tick of the machine, of what is beyond that for so many ticks."""
    beyond = np.concatenate([[False], (errors > most_mm) & at_feed, [False]])
    first, end = (np.flatnonzero(np.diff(beyond.astype(int)) == sign) for sign in (1, -1))
    spans = zip((first + begin).tolist(), (end - 1 + begin).tolist(), strict=True)
    return [(a, b) for a, b in spans if b - a + 1 >= ticks]


# -- many of one run: each forks off where something befalls it


@dataclass
class Case:
    """What befalls a run behind a tick, and what came of it."""

    tick: int
    faults: str
    axes: set[str]
    judged: Judged | None = None
    fault: Fault = Fault.NONE

    @property
    def wrong(self) -> str:
        """What is not as it should be; empty: nothing."""
        assert self.judged is not None
        others = [one for one in self.judged.told if one[2] not in self.axes]
        found = (("not told", self.judged.missing), ("without need", self.judged.false), ("axis", others))
        return "; ".join(f"{what}: {list(map(str, which))}" for what, which in found if which)


AFTER_S = 0.9  # that a child goes on, of which 0.3 s are for what befalls it to begin


def cases(name: str, feed: int, rng: random.Random, count: int, ticks: tuple[int, int]) -> list[Case]:
    """``ticks``: of the run, between which they fork off."""
    bench, done = Watched.up(name, feed), list[Case]()
    names = [axis.name for axis in bench.machine.axes]
    waiting = [Case(tick, *script(rng, names, 3, 0.3)) for tick in sorted(rng.sample(range(*ticks), count))]
    first = bench.cycle.tick

    def ended(case: Case) -> None:
        bench._drain()
        bench.watch.see_all()
        case.fault = bench.cycle.modes.fault
        case.judged = judged(bench, np.concatenate(bench._rows), case.fault, first + case.tick)
        bench.report(case)

    def goes_on(case: Case) -> None:
        """In the child: what befalls it, and its end."""
        bench.befall(case.faults)
        over = bench.cycle.tick + round(AFTER_S / bench.machine.period_s)
        bench.ended = lambda: ended(case)  # type: ignore[attr-defined]
        bench.at_tick = lambda: ended(case) if bench.cycle.tick >= over else None

    def forks() -> None:
        while waiting and waiting[0].tick <= bench.cycle.tick - first:
            case = waiting.pop(0)
            found: Any = bench.fork()
            if found is None:
                goes_on(case)
                return
            done.append(found)

    bench.at_tick = forks
    with bench.nursery():
        bench.cut()
        if bench.is_child:
            bench.ended()  # type: ignore[attr-defined]
    return done


def length(name: str, feed: int) -> int:
    """Ticks of the run in which nothing is lost."""
    bench = Watched.up(name, feed)
    first = bench.cycle.tick
    bench.cut()
    return bench.cycle.tick - first
