"""A batch of random cases run: one machine with one program, prepared once, that forks into each.

A case is the same run as the others up to its tick; what it is, and how it is had again, is in
``random_faults``.
"""

from __future__ import annotations

import contextlib
import random
from pathlib import Path
from typing import NamedTuple

from support.faults.fault_scripts import Batch, Case, Draw, case
from support.faults.invariants import wrongs
from support.machines.forked_machine import Forkable

from controller.runtime import checked
from controller.runtime.bench.fault_file import Injected, MachineScript
from controller.runtime.events import REQUESTS, Event
from controller.runtime.startup import SessionError
from controller.runtime.stepped import Run
from controller.verify import trace as traces
from drives.commission import CommissionError

HORIZON_S = 5.0  # of a program: later nothing happens that has not happened before
STILL_S = 0.2  # after a fault all stands for so long, looked at
LONGEST_S = 30.0  # a run that takes longer does not end


class Came(NamedTuple):
    """What came of a case."""

    case: Case
    wrongs: tuple[str, ...]
    fault: str  # at the run's end
    ticks: int
    warned: str = "NONE"


class Bench(Forkable):
    """A batch's machine, ready to begin."""

    def __init__(self, of: Batch, draw: Draw) -> None:
        self.batch, self.draw = of, draw
        self.asked: list[Event] = []
        made = of.made
        self.task = checked.task(of.program.encode(), "part.ngc", made)
        self.walk = checked.walk_of(self.task, None, False)
        super().__init__(made)
        self.injected: Injected | None = None

    def begin_script(self, seed: int = 0) -> None:
        after_s = 0.0 if self.batch.origin == "home" else self.machine.period_s
        self.observer.begin(after_s)
        self.injected = MachineScript((), seed).inject(self.rig.buses, after_s)

    def do(self, one: Case) -> None:
        """From here on the case's faults and requests."""
        script = MachineScript.read(one.script, self.machine)
        assert self.injected is not None
        for injector in self.injected._injectors.values():
            injector._random.seed(script.seed)
        self.injected.add(script.faults)
        self.asked += [event(told) for told in one.events]

    @property
    def tick_now(self) -> int:
        """Counted from the program's start; the last one that has been."""
        return self.cycle.tick - self.observer.first_tick

    def came(self, one: Case, run: Run | None, trace: Path | None) -> Came:
        """The verdict, once the run is over; then the machine is looked at a little longer."""
        if run is not None and trace is not None:
            segments = self.planner.segments
            seen = traces.from_rows(
                run.rows, self.machine, self.task.kinematics, segments, first_tick=run.first_tick
            )
            seen.save(trace)
        ticks, fault, warned = self.tick_now, self.cycle.modes.fault.name, self.cycle.modes.warning.name
        self.at_tick = lambda: None
        for _ in range(round(STILL_S / self.machine.period_s)):
            self.tick()
        found = wrongs(self.observer.sight, self.times)
        return Came(one, tuple(found), fault, ticks, warned)


def event(told: dict[str, object]) -> Event:
    """As ``--events`` reads it."""
    request, value = REQUESTS[str(told["request"])], float(str(told.get("value", 0.0)))
    return Event(
        int(str(told["tick"])), request, value / 100.0 if "override" in str(told["request"]) else value
    )


class Ended(Exception):
    """The rest of a run is not needed."""


def cases(of: Batch, count: int, save: Path | None = None, draw: Draw = case) -> list[Came]:
    """Run a batch; ``save``: a folder for the trace of each, as ``simulate`` writes it.

    Of a batch that begins with the program the first that comes is the healthy run.
    """
    bench = Bench(of, draw)
    with bench.nursery():
        return (_homed if of.origin == "home" else _forked)(bench, count, save)


def _homed(bench: Bench, count: int, save: Path | None) -> list[Came]:
    """From the beginning of homing, each alone."""
    found, second = [], round(1.0 / bench.machine.period_s)
    bench.begin_script()
    for n in range(count):
        rng = random.Random(f"case {bench.batch.number} {n}")
        one = bench.draw(rng, bench.machine, rng.randrange(second), "home")
        came = bench.fork()
        if came is None:
            bench.do(one)
            _come_up_and_run(bench, one, save and save / f"{n}.npz")
        found.append(came)
    return found


def _come_up_and_run(bench: Bench, one: Case, trace: Path | None) -> None:
    bench.at_tick = lambda: _must_end(bench, one)
    try:
        bench.come_up()
    except (SessionError, CommissionError):
        bench.stand_still()
        bench.report(bench.came(one, None, trace))
    bench.report(bench.came(one, bench.run(bench.walk, bench.asked), trace))


def _forked(bench: Bench, count: int, save: Path | None) -> list[Came]:
    """The healthy run first, and then from tick to tick."""
    bench.come_up()
    bench.begin_script()
    horizon = round(HORIZON_S / bench.machine.period_s)
    healthy = Case(0, ({"tick": horizon, "request": "stop"},), "")
    whole = bench.fork()
    if whole is None:
        bench.do(healthy)
        bench.report(bench.came(healthy, bench.run(bench.walk, bench.asked), None))
    rng = random.Random(f"ticks {bench.batch.number}")
    branches = _Branches(bench, sorted(rng.randrange(1, max(2, whole.ticks - 2)) for _ in range(count)))
    bench.at_tick = branches.look
    run = None
    with contextlib.suppress(Ended):
        run = bench.run(bench.walk, bench.asked)
    if bench.is_child:
        number, one = branches.mine
        bench.report(bench.came(one, run, save and save / f"{number}.npz"))
    return [whole, *branches.found]


class _Branches:
    """Looks behind every tick of the parent's run whether it is time for the next cases."""

    def __init__(self, bench: Bench, ticks: list[int]) -> None:
        self._bench, self._waiting = bench, ticks
        self.found: list[Came] = []
        self.mine = (-1, Case(0, (), ""))  # of a child: what it does

    def look(self) -> None:
        bench = self._bench
        if bench.is_child:
            _must_end(bench, self.mine[1])
            return
        while self._waiting and self._waiting[0] <= bench.tick_now and bench.quiet:
            self._waiting.pop(0)
            number = len(self.found)
            rng = random.Random(f"case {bench.batch.number} {number}")
            one = bench.draw(rng, bench.machine, bench.tick_now, "program")
            came = bench.fork()
            if came is None:
                self.mine = number, one
                bench.do(one)
                return
            self.found.append(came)
        if not self._waiting:
            raise Ended


def _must_end(bench: Bench, one: Case) -> None:
    if (bench.tick_now - one.tick) * bench.machine.period_s > LONGEST_S:
        raise RuntimeError(f"the run does not end:\n{one.script}")
