"""Runs that fork into others with late ticks, each judged by what was played and by the motors.

One healthy run of a machine and a program goes first; a second one forks where ticks are to come late, and
each child is held against the first: its setpoints, where its motors truly were with each period, the path.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import count
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import cKDTree
from support.machines.forked_machine import Forkable
from support.oracles import latched_setpoints

from controller.geometry.arrays import Array
from controller.ipc.handoff import COLUMN, of_axes
from controller.machine.compensation import reversal
from controller.machine.kinematics import Kinematics
from controller.machine.model import Limits, Machine
from controller.runtime import checked
from controller.runtime.bench.fault_file import MachineScript
from controller.runtime.events import Event
from controller.runtime.stepped import Run
from controller.state.modes import Fault, Request
from drives.bench.simulated.plant import Plant
from drives.pump.plan_memory import FOLLOWS, Phase
from drives.pump.stepped import SteppedPump

AFTER_S = 0.5  # from the last late tick to the end of a case
BEFORE = 20  # periods before a fork that are judged with it
MOST_SHARE = 1.1  # of an axis' limits, of a motor; where a healthy one has more of its own, of that
ROUNDED = 1.002  # of an acceleration of setpoints: what the limits are held by in a healthy run
COUNTS = 4.0  # in a second difference of rounded setpoints, at most
OFF_MM = 0.010  # the path, beyond the healthy error
TOOL_MM = 60.0  # two points of the tool so far apart tell where it is
SAME_END_MM = 1e-3  # the last of what has led the axes on a thread is not played yet
SAME_MM = 1e-4  # two points of a line that are nearer are one
NEAR = 8  # places of the path
THREAD_UM = 10.0  # axes and spindle, beyond the healthy error
LEAST_MM = 0.1  # of a thread, that is judged
TOLD = (Fault.STOCK_USED_UP, Fault.TOO_MANY_SKIPS)


class Late(NamedTuple):
    """What befalls a run from the fork on; ticks count from it."""

    kind: str
    late_s: Mapping[int, float]  # ticks that come so late
    slow_s: Mapping[int, float]  # ticks that take so long from their look at the pump to their plan
    asked: Sequence[Event] = ()
    within: bool = False  # no tick is later than the stock lasts
    to_end: bool = False
    faults: str = ""  # script of what befalls the buses, from the fork on
    silent: Sequence[range] = ()  # ticks in which the planner has no turn
    again: bool = False  # after its end the machine comes up, and the program begins anew

    @property
    def last(self) -> int:
        return max([0, *self.late_s, *self.slow_s, *(event.tick for event in self.asked)])


@dataclass
class Verdict:
    """One case; ``wrongs`` is empty if all is well."""

    late: Late
    fork: int  # tick of the run
    wrongs: list[str] = field(default_factory=list)
    shares: dict[str, float] = field(default_factory=dict)
    result: str = ""


class Played(NamedTuple):
    """One period."""

    phase: Phase
    counts: tuple[int, ...]
    motors: tuple[float, ...]  # when it was sent, mm and rad
    shaft: float | None = None  # of the spindle, where there is one, and ...
    turned: float | None = None  # ... where a thread has begun (rev)
    words: tuple[int, ...] = ()  # that the drives were sent, with ``FOLLOWS``

    @property
    def follow(self) -> bool:
        """Whether all drives go by their setpoints, and none stops by itself."""
        return all(word & FOLLOWS for word in self.words)


class Watched(Forkable):
    """Notes what is played, and where the motors then are."""

    def __init__(self, machine: Machine, **how: Any) -> None:
        self.played: dict[int, Played] = {}
        self.warned: set[Fault] = set()
        self._servos: list[tuple[Any, float]] = []
        super().__init__(machine, **how)
        for axis in machine.axes:
            servo = self.rig.drives[axis.name].axis
            self._servos.append((servo, servo.units.position / axis.counts_per_unit))

    def tick(self) -> None:
        super().tick()
        self.warned.add(self.cycle.modes.warning)

    def _pump(self, plans: Any) -> SteppedPump:
        made, machine = super()._pump(plans), self.machine
        player, send = made._player, made._player.send

        def noted(due_ns: int, late_ns: int) -> None:
            shaft = None if self.rig.spindle is None else float(self.rig.spindle.axis.servo.shaft)
            words = tuple(player._memory.words[: len(machine.axes)])
            place = self.motors(), shaft, self.turned(), words
            self.played[player.period] = Played(player.phase, tuple(player._counts), *place)
            send(due_ns, late_ns)

        player.send = noted  # type: ignore[method-assign]
        return made

    def motors(self) -> tuple[float, ...]:
        return tuple(
            (axis.servo.motor if isinstance(axis.servo, Plant) else axis.servo.position) * size
            for axis, size in self._servos
        )

    def turned(self) -> float | None:
        spindle, rig = self.machine.spindle, self.rig
        if spindle is None or spindle.position is None or not self.cycle.coupling.active:
            return None
        return float(rig.spindle.axis.servo.shaft / spindle.counts_per_rev)

    def walk(self, text: str) -> checked.Walk:
        task = replace(checked.task(text.encode(), "part.ngc", self.machine), start=self.joints)
        return checked.walk_of(task, None, False)

    def befall(self, late: Late) -> None:
        """From the next tick on."""
        stock, clock = self.cycle.stock, self.clock
        assert stock is not None
        first, ticks, publish = clock.waits, count(), stock.publish
        clock._lateness = lambda n: late.late_s.get(n - first, 0.0)

        def published(anew: bool) -> None:
            clock._now_s += late.slow_s.get(next(ticks), 0.0)
            for step in clock.steppers:
                step(clock._now_s)
            publish(anew)

        if late.slow_s:
            stock.publish = published  # type: ignore[method-assign]
        if late.faults:
            MachineScript.read(late.faults, self.machine).inject(self.rig.buses, self.machine.period_s)
        if late.silent:
            plan = self._plan
            self._plan = lambda: None if any(clock.waits - first in one for one in late.silent) else plan()  # type: ignore[method-assign]


# ---- the run in time


class Healthy:
    """A machine and a program, in time."""

    def __init__(self, machine: Machine, text: str, limits: Sequence[Limits] = (), **how: Any) -> None:
        """``limits``: what is judged by, where the axes' tables leave the plan less."""
        self.machine, self.text, self.how = machine, text, how
        self.stepped = self.up()
        self.first = self.stepped.cycle.tick
        self.run = self.stepped.run(self.stepped.walk(text))
        self.played = self.stepped.played
        self.ticks = len(self.run.rows)
        units = [1.0 / axis.counts_per_unit for axis in machine.axes]
        limits, T = limits or [axis.limits for axis in machine.axes], machine.period_s
        self.units = np.array(units)
        self.most = (
            np.array([one.velocity for one in limits]) * T,
            np.array([one.acceleration for one in limits]) * T**2,
        )
        self.periods = [n for n in self.played if n > self.first]
        self.cuts = cuts([self.played[n] for n in self.periods])
        self.threads = bool(self.cuts)

    def up(self) -> Watched:
        stepped = Watched(self.machine, **self.how)
        stepped.come_up()
        return stepped

    @property
    def kinematics(self) -> Kinematics:
        return self.stepped.kinematics

    def setpoints(self, played: Sequence[Played]) -> Array:
        return np.array([one.counts for one in played]) * self.units

    def shares(self, joints: Array, counts: float = 0.0) -> tuple[float, float]:
        """The largest share of velocity and acceleration; so many ``counts`` of it are rounding."""
        found = []
        for n, most in enumerate(self.most, 1):
            differences = np.abs(np.diff(joints, n, axis=0)) - 0.5 * n * counts * np.abs(self.units)
            found.append(float((differences / most).max(initial=0.0)))
        return found[0], found[1]

    @cached_property
    def of_setpoints(self) -> tuple[float, float]:
        return self.shares(self.setpoints([self.played[n] for n in self.periods]), COUNTS)

    @cached_property
    def of_motors(self) -> tuple[float, float]:
        return self.shares(np.array([self.played[n].motors for n in self.periods]))

    @cached_property
    def line(self) -> tuple[Array, cKDTree]:
        """The tool's way along the segments of its path, four points a tick."""
        line = moving(self.tools(np.array(list(self._places()))), SAME_MM)
        return line, cKDTree(line)

    def _places(self) -> Iterator[Sequence[float]]:
        """Joints along the path."""
        joints = self.run.rows[:, of_axes("joint_command", len(self.machine.axes))].tolist()
        ids, places = (self.run.rows[:, COLUMN[name]].tolist() for name in ("motion_id", "s"))
        segments, near = self.stepped.planner.segments, self.kinematics.rotaries
        for i, row in enumerate(joints[:-1]):
            yield row
            if row == joints[i + 1]:
                continue
            old, new = int(ids[i]), int(ids[i + 1])
            for number in range(old, new + 1) if 0 <= old <= new else ():
                if number in segments:
                    motion = segments[number].motion
                    begin = places[i] if number == old else 0.0
                    end = places[i + 1] if number == new else motion.end
                    for s in np.linspace(begin, end, 5):
                        found = motion.joints(float(s), near(row), self.kinematics)
                        if found is not None:
                            yield found

    @cached_property
    def setpoints_off_mm(self) -> float:
        """Likewise of the setpoints: what axes miss is taken off them."""
        return self.off(self.setpoints([self.played[n] for n in self.periods]))

    @cached_property
    def play_mm(self) -> float:
        """By which axes that turn back are sent elsewhere: how far that has come is a matter of time."""
        return math.hypot(*(reversal(a.pitch) for a in self.machine.axes if a.pitch is not None))

    @cached_property
    def off_mm(self) -> float:
        """The motors' distance from the path."""
        return self.off(np.array([self.played[n].motors for n in self.periods]))

    def tools(self, joints: Array) -> Array:
        """Two points of the tool, shape (N, 6)."""
        found = np.empty((len(joints), 6))
        for row, q in zip(found, joints.tolist(), strict=True):
            here = self.kinematics.forward(tuple(q), 0.0)
            row[:3] = here.tip
            row[3:] = np.array(here.tip) + TOOL_MM * np.array(here.axis)
        return found

    def off(self, joints: Array) -> float:
        """The largest distance from the path (mm)."""
        line, tree = self.line
        points = self.tools(moving(joints))
        _, nearest = tree.query(points, k=NEAR)  # of all the passes that it makes there
        best = np.full(len(points), np.inf)
        for i in np.clip((*nearest.T, *(nearest.T - 1)), 0, len(line) - 2):
            a, ab = line[i], line[i + 1] - line[i]
            length = (ab * ab).sum(axis=1)
            t = ((points - a) * ab).sum(axis=1) / np.where(length > 0.0, length, 1.0)
            off = points - a - ab * np.clip(t, 0.0, 1.0)[:, None]
            best = np.minimum(best, np.linalg.norm(off, axis=1))
        return float(best.max())


def thread_um(
    played: Sequence[Played], linear: Sequence[int], rev_per_mm: float = 0.0
) -> tuple[float, float]:
    """The largest distance of the tap from its thread, and the threads' revolutions per mm, if not given."""
    most = 0.0
    for begin, end in cuts(played):
        cut = played[begin:end]
        at = np.array([one.motors for one in cut])[:, list(linear)]
        turned = np.array([one.turned for one in cut])
        way, turns = np.linalg.norm(at - at[0], axis=1), np.abs(turned - turned[0])
        if np.ptp(way) > LEAST_MM:
            rev_per_mm = rev_per_mm or float(np.polyfit(way, turns, 1)[0])
            most = max(most, 1e3 * float(np.abs(way - turns / rev_per_mm).max()))
    return most, rev_per_mm


def cuts(played: Sequence[Played]) -> list[tuple[int, int]]:
    """From where to where the axes have followed the spindle."""
    tied = np.array([False, *(one.turned is not None for one in played), False])
    begins, ends = (np.flatnonzero(np.diff(tied.astype(int)) == way) for way in (1, -1))
    return list(zip(begins.tolist(), ends.tolist(), strict=True))


def moving(rows: Array, same: float = 0.0) -> Array:
    """Without what repeats the row before."""
    keep = np.ones(len(rows), bool)
    keep[1:] = (np.abs(np.diff(rows, axis=0)) > same).any(axis=1)
    return rows[keep]


# ---- the cases

# Of a child, from the period on in which it forked; with the stops that had been made by then, and its run.
Judge = Callable[[Healthy, Watched, Verdict, int, int, Run | None], None]


def cases(
    healthy: Healthy, lates: Sequence[tuple[int, Late]], judge: Judge | None = None
) -> Iterator[Verdict]:
    """``lates``: with the tick of the run behind which each forks off, in that order."""
    parent, waiting, found = healthy.up(), list(lates), list[Verdict]()
    parent.warned.clear()
    assert parent.cycle.tick == healthy.first
    events: list[Event] = []
    parent.at_tick = lambda: _forks(healthy, parent, waiting, events, found, judge or judged)
    with parent.nursery():
        run = parent.run(parent.walk(healthy.text), events)
        if parent.is_child:
            parent.ended(run)  # type: ignore[attr-defined]
    assert np.array_equal(run.rows, healthy.run.rows)
    yield from found


def _forks(
    healthy: Healthy,
    parent: Watched,
    waiting: list[tuple[int, Late]],
    events: list[Event],
    found: list[Verdict],
    judge: Judge,
) -> None:
    n = parent.cycle.tick - healthy.first
    while waiting and waiting[0][0] <= n:
        fork, late = waiting.pop(0)
        verdict = parent.fork()
        if verdict is None:
            _go_on(healthy, parent, Verdict(late, fork), events, judge)
            return
        found.append(verdict)


def _go_on(healthy: Healthy, child: Watched, verdict: Verdict, events: list[Event], judge: Judge) -> None:
    """In the child: what befalls it, and its end."""
    late, clock = verdict.late, child.clock
    period, first = child.cycle.tick, clock.waits
    braked = child.cycle.sync.braked
    over_s: list[float] = []

    def ended(run: Run | None) -> None:
        judge(healthy, child, verdict, period, braked, run)
        child.report(verdict)

    def look() -> None:
        if clock.waits - first > late.last and not over_s:
            over_s.append(clock.now_s())
        if over_s and not late.to_end and clock.now_s() > over_s[0] + AFTER_S:
            ended(None)

    child.at_tick, child.ended = look, ended  # type: ignore[attr-defined]
    begun = verdict.fork
    events += [replace(event, tick=begun + event.tick) for event in late.asked]
    child.befall(late)


def judged(
    healthy: Healthy, child: Watched, verdict: Verdict, period: int, braked: int, run: Run | None
) -> None:
    """From just before the fork to the end, or to where the drives stop by themselves."""
    wrong, shares, late = verdict.wrongs.append, verdict.shares, verdict.late
    modes = child.cycle.modes
    played = [child.played[n] for n in range(period - BEFORE, max(child.played) + 1)]
    silent = next((n for n, one in enumerate(played) if one.phase is Phase.SILENT), len(played))
    silent_told = silent == len(played) or Fault.STOCK_USED_UP in (modes.fault, *child.warned)
    heard = played[:silent]
    given_up = (n for n in range(1, len(heard)) if heard[n - 1].follow and not heard[n].follow)
    led = heard[: next(given_up, len(heard))]
    setpoints, motors = healthy.setpoints(led), np.array([one.motors for one in heard])
    verdict.result = modes.fault.name if modes.fault is not Fault.NONE else "" if run is None else run.result
    told = (*TOLD, Fault.SPINDLE_LAGS, Fault.SPINDLE_LOST) if healthy.threads else TOLD
    if modes.fault not in (Fault.NONE, *told) or not silent_told:
        wrong(f"{modes.fault.name}: {child.fault_text}")
    if run is not None and modes.fault is Fault.NONE and run.result != "completed":
        wrong(f"{run.result} {run.refusal.name}")
    names = ("velocity", "acceleration")
    for name, share, own in zip(names, healthy.shares(setpoints, COUNTS), healthy.of_setpoints, strict=True):
        shares[f"setpoint {name}"] = share
        if share > max(ROUNDED, own * 1.0005):
            wrong(f"setpoints have {share:.4f} of an {name}, in time {own:.4f}")
    for name, share, own in zip(names, healthy.shares(motors), healthy.of_motors, strict=True):
        shares[f"motor {name}"] = share
        shares[f"motor {name} / in time"] = share / max(1.0, own)
        if share > MOST_SHARE * max(1.0, own):
            wrong(f"motors have {share:.4f} of an {name}, in time {own:.4f}")
    if len(healthy.machine.axes) == latched_setpoints.AXES:
        shares["recorded acceleration"] = _recorded(healthy, child)
    if healthy.threads:
        _thread(healthy, [*(one for n, one in child.played.items() if n < period - BEFORE), *heard], verdict)
    else:
        _path(healthy, heard, verdict)
    if child.cycle.sync.braked > braked:
        if Fault.TICK_LATE not in child.warned and modes.fault is Fault.NONE:
            wrong("braked, and nothing is told")
        if late.within:
            wrong("braked within the stock")
    if late.within and not late.asked:
        _same(healthy, heard, period - BEFORE, verdict)
    last = list(healthy.played.values())[-1]
    off = np.abs(np.array(played[-1].counts) - last.counts) * np.abs(healthy.units)
    near = SAME_END_MM * healthy.threads + healthy.play_mm  # a reversal may be under way where a program ends
    if run is not None and run.result == "completed" and off.max() > near:
        wrong("ends elsewhere")


def _recorded(healthy: Healthy, child: Watched) -> float:
    """The largest share of an acceleration in the recorder's rows of the program, without a fault."""
    child._drain()
    rows = np.concatenate(child._rows)
    ours = (rows[:, COLUMN["tick"]] > healthy.first) & (rows[:, COLUMN["fault"]] == Fault.NONE)
    return latched_setpoints.most(rows[ours], healthy.machine)[1]


def _thread(healthy: Healthy, heard: Sequence[Played], verdict: Verdict) -> None:
    """Axes and spindle stay together."""
    linear = healthy.machine.linear()
    own, rev_per_mm = thread_um(list(healthy.played.values()), linear)
    um, _ = thread_um(heard, linear, rev_per_mm)
    name = "thread um" if verdict.late.within else "thread um beyond"
    verdict.shares[name] = um - own
    if um > own + THREAD_UM:
        verdict.wrongs.append(f"the tap is {um:.1f} um off its thread, in time {own:.1f}")


def _path(healthy: Healthy, heard: Sequence[Played], verdict: Verdict) -> None:
    wrong, shares = verdict.wrongs.append, verdict.shares
    motors = np.array([one.motors for one in heard])
    above = healthy.off(motors) - healthy.off_mm
    shares["above um"] = 1e3 * above
    if above > OFF_MM + healthy.play_mm:
        wrong(f"motors are off the path by {1e3 * above:.1f} um more than {1e3 * healthy.off_mm:.1f}")
    setpoints = healthy.setpoints(heard)
    off = shares["setpoints off um"] = 1e3 * (healthy.off(setpoints) - healthy.setpoints_off_mm)
    if off > 1e3 * (OFF_MM + healthy.play_mm):
        wrong(f"setpoints are off the path by {off:.1f} um more than in time")


def _same(healthy: Healthy, heard: Sequence[Played], first: int, verdict: Verdict) -> None:
    """Bit for bit, also the spindle; what waits for a tick at a standstill goes on once a tick has seen it.

    Such a tick may tell the spindle later, which then stands at another angle. At the end of a thread it is
    the spindle that is waited for, to within a micrometre of the axes' way. From there on both are held
    against each other alone.
    """
    heard = [one for n, one in enumerate(heard, first) if n in healthy.played]
    whole = [healthy.played[first + n] for n in range(len(heard))]
    pairs = enumerate(zip(heard, whole, strict=True))
    differs = next((n for n, (one, other) in pairs if one[1:] != other[1:]), -1)
    if differs < 0:
        verdict.shares["same"] = 1.0
        return
    ours, theirs = healthy.setpoints(heard), healthy.setpoints(whole)
    a, b = moving(ours), moving(theirs)
    n = min(len(a), len(b))
    steps = [np.abs(one[differs] - one[differs - 1]).max() for one in (ours, theirs)]
    stands = differs > 0 and min(steps) <= SAME_END_MM * healthy.threads
    if stands and (healthy.threads or np.array_equal(a[:n], b[:n])):
        verdict.shares["waited"] = 1.0
        return
    verdict.wrongs.append(f"not bit for bit, from period {differs} on ({first + differs - healthy.first})")


# ---- drawn


def drawn(rng: random.Random, machine: Machine, ticks: int, first: int = 0) -> tuple[int, Late]:
    """(tick of the fork, from ``first`` on; what is late)."""
    stock = machine.stock_s
    kind = rng.choice(("one within",) * 3 + ("one beyond",) * 3 + ("train within", "train beyond", "slow"))
    late, slow = dict[int, float](), dict[int, float]()
    runs = rng.randrange(1, 5)
    places = sorted(rng.randrange(60) for _ in range(runs))
    if kind == "one within":
        late[1] = rng.choice((0.001, stock, rng.uniform(0.001, stock), rng.uniform(0.001, stock)))
    elif kind == "one beyond":
        late[1] = rng.choice(
            (rng.uniform(stock, 0.1), rng.uniform(stock, 0.5), rng.uniform(1.0, 2.5) * stock)
        )
    else:
        most = stock if kind == "train within" else rng.choice((0.01, 0.02, 0.05, 0.1, 0.5))
        for place in places:
            for k in range(rng.choice((1, 2, 3, 5))):
                late[place + k] = rng.uniform(0.0, most)
    if kind == "slow":
        late = {n: one for n, one in late.items() if rng.random() < 0.3}
        for place in places:
            for k in range(rng.choice((1, 1, 2, 4))):
                slow[place + k] = rng.uniform(0.0, rng.choice((0.5, 1.0, 2.0, 5.0)) * machine.period_s)
    asked = _requests(rng) if rng.random() < 0.25 else ()
    to_end = rng.random() < 0.1 or bool(asked)
    within = kind.endswith("within")
    return rng.randrange(first, ticks), Late(kind, late, slow, asked, within, to_end)


def _requests(rng: random.Random) -> list[Event]:
    """Near the late ticks, and all over in the end."""
    found = []
    for _ in range(rng.randrange(1, 4)):
        tick, later = rng.randrange(60), rng.randrange(1, 200)
        if rng.random() < 0.6:
            found += [Event(tick, Request.HOLD), Event(tick + later, Request.RESUME)]
        else:
            word = rng.choice((Request.OVERRIDE, Request.RAPID_OVERRIDE))
            found += [Event(tick, word, rng.choice((0.0, 0.1, 0.5, 1.0))), Event(tick + later, word, 1.0)]
    end = [(Request.OVERRIDE, 1.0), (Request.RAPID_OVERRIDE, 1.0), (Request.RESUME, 0.0)]
    found += [Event(400, word, value) for word, value in end]
    return sorted(found, key=lambda event: event.tick)
