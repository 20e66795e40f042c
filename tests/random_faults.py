"""Random fault scripts: what is run, when what goes wrong, and what the operator does meanwhile.

A batch is one machine with one program, prepared once; each of its cases is the same run up to some
tick and forks there. Everything is drawn from the batch's number, and every case can be had again by
``directrix simulate``.
"""

from __future__ import annotations

import contextlib
import json
import random
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from cutting import program
from fault_judge import wrongs
from forks import Forkable

from controller import config
from controller.machine import Machine
from controller.session import checked
from controller.session.events import REQUESTS, Event
from controller.session.fault_file import Injected, MachineScript
from controller.session.startup import SessionError
from controller.session.stepped import Run
from controller.verify import trace as traces

MACHINES = tuple(file.stem for file in sorted(config.SHIPPED.glob("*.toml")) if file.stem not in ("tools",))
HORIZON_S = 5.0  # of a program: later nothing happens that has not happened before
AFTER_S = 0.4  # from the end of the last fault to the operator's stop
STILL_S = 0.2  # after a fault all stands for so long, looked at
LONGEST_S = 30.0  # a run that takes longer does not end


@dataclass(frozen=True)
class Batch:
    """What its cases have in common."""

    number: int
    machine: str
    program: str
    origin: str  # "program" or "home"

    @property
    def made(self) -> Machine:
        return replace(config.load(self.machine), gouge="warn")


class Case(NamedTuple):
    """One run: requests and faults from ``tick`` on."""

    tick: int
    events: tuple[dict[str, object], ...]
    script: str


class Came(NamedTuple):
    """What came of a case."""

    case: Case
    wrongs: tuple[str, ...]
    fault: str
    ticks: int


def batch(number: int) -> Batch:
    """Machine after machine, so that a few batches have seen all of them."""
    rng = random.Random(f"batch {number}")
    machine = MACHINES[number % len(MACHINES)]
    origin = "home" if rng.random() < 0.1 else "program"
    example = rng.choice(("example1_ready", "example2_ready"))
    feed = f"{rng.choice((100, 300, 1000, 3000, rng.randint(100, 3000)))}."
    text = program(example, feed) if rng.random() < 0.8 else _rapids(rng, config.load(machine))
    return Batch(number, machine, text, origin)


def healthy_batch(number: int) -> Batch:
    """The paper's parts at any feed."""
    rng = random.Random(f"healthy {number}")
    example = ("example1_ready", "example2_ready")[number // len(MACHINES) % 2]
    return Batch(
        number, MACHINES[number % len(MACHINES)], program(example, f"{rng.randint(100, 3000)}."), "program"
    )


def healthy_case(rng: random.Random, machine: Machine, tick: int, _origin: str) -> Case:
    """Nothing goes wrong; the operator holds, goes on, and turns the knobs."""
    events: list[dict[str, object]] = []
    for _ in range(rng.randrange(1, 7)):
        tick += rng.randrange(1, round(0.3 / machine.period_s))
        asked = rng.choice(("hold", "resume", "override", "rapid_override"))
        value = {"value": rng.randrange(0, 201)} if "override" in asked else {}
        events.append({"tick": tick, "request": asked, **value})
    tick += round(0.1 / machine.period_s)
    last = (
        {"tick": tick, "request": "resume"},
        {"tick": tick + round(0.3 / machine.period_s), "request": "stop"},
    )
    return Case(tick, (*events, *last), "")


def _rapids(rng: random.Random, machine: Machine) -> str:
    """Moves of all axes at once, to and fro."""
    lines = ["G21 G90 G54 G64"]
    for _ in range(12):
        words = [
            f"{a.name}{rng.uniform(-12.0, 12.0) if a.is_rotary else rng.uniform(-40.0, 40.0):.3f}"
            for a in machine.axes
            if rng.random() < 0.7
        ]
        lines.append(f"{rng.choice(('G0', 'G0', 'G1 F1500'))} {' '.join(words)}" if words else "G4 P0.1")
    return "\n".join([*lines, "M30", ""])


# ---- what goes wrong


def case(rng: random.Random, machine: Machine, tick: int, origin: str) -> Case:
    """Faults that begin at a tick or a little later, in a run, a hold, on the way out of it, or at rest."""
    T = machine.period_s
    in_ticks: Callable[[float], int] = lambda seconds: round(seconds / T)  # noqa: E731
    events: list[dict[str, object]] = []
    begin = tick + 1 + rng.randrange(20)
    asked = (
        rng.choice(("run", "run", "run", "hold", "resume", "rest", "override")) if origin == "program" else ""
    )
    if asked in ("hold", "resume", "rest"):
        events.append({"tick": tick + 1, "request": "hold"})
        begin = tick + 1 + rng.randrange(in_ticks(0.15))
    if asked == "rest":
        begin = tick + 1 + in_ticks(0.4)
    if asked == "resume":
        events.append({"tick": tick + 1 + in_ticks(0.3), "request": "resume"})
        begin = tick + 1 + in_ticks(0.3 + rng.uniform(0.0, 0.3))
    if asked == "override":
        events.append({"tick": tick + 1, "request": "override", "value": rng.randrange(0, 201)})
    lines, lasts_s = [f"seed {rng.randrange(10**6)}"], 0.0
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        at = begin + rng.randrange(in_ticks(0.1))
        text, length_s = line(rng, machine)
        when = f"at sync {at + 1}" if rng.random() < 0.5 and origin == "program" else f"at {at * T:.6f} s"
        bus, _, words = text.partition("|")
        lines.append(f"{bus}{when}: {words}")
        lasts_s = max(lasts_s, length_s + (at - begin) * T)
    stops = begin + in_ticks(min(lasts_s, 1.0) + AFTER_S) if origin == "program" else in_ticks(0.2)
    events.append({"tick": stops, "request": "stop"})
    return Case(tick, tuple(events), "\n".join([*lines, ""]))


def line(rng: random.Random, machine: Machine) -> tuple[str, float]:
    """One fault as "on BUS: |words", and about how long it lasts, s."""
    axis, bus = rng.choice(machine.axes).name, rng.choice(machine.buses).name
    kind = rng.choice(tuple(KINDS))
    words, on_bus, length_s = KINDS[kind](rng, axis, machine.period_s)
    return f"{f'on {bus}: ' if on_bus else ''}|{kind} {words}", length_s


Words = tuple[str, bool, float]  # the words, whether they are about a whole bus, and how long it lasts


def _frames(rng: random.Random, axis: str) -> tuple[str, bool]:
    name = rng.choice(("rpdo", "rpdo", "rpdo", "tpdo", "tpdo", "sync", "heartbeat"))
    return (name, True) if name == "sync" else (f"{name} {axis}", False)


def _how_many(rng: random.Random, period_s: float) -> tuple[str, float]:
    """So many frames, or so long, now and then by chance."""
    if rng.random() < 0.5:
        count = rng.choice((1, 2, 3, 5, 10, 20, 50, 200, 1000))
        return f"x {count}", count * period_s
    length_s = rng.choice((0.002, 0.01, 0.05, 0.2, 1.0, 10.0))
    return f"for {length_s} s" + (
        f" odds {rng.choice((0.2, 0.5, 0.9))}" if rng.random() < 0.3 else ""
    ), length_s


def _befall(rng: random.Random, axis: str, period_s: float) -> Words:
    (target, on_bus), (many, length_s) = _frames(rng, axis), _how_many(rng, period_s)
    return f"{target} {many}", on_bus, length_s


def _late(rng: random.Random, axis: str, period_s: float) -> Words:
    target, on_bus, length_s = _befall(rng, axis, period_s)
    name, _, rest = target.partition(" x ")
    late_ms = rng.choice((0.3, 1.0, 3.0, 10.0, 40.0, 150.0))
    if rest:
        return f"{name} x {rest} by {late_ms} ms", on_bus, length_s + 1e-3 * late_ms
    name, _, rest = target.partition(" for ")
    return f"{name} by {late_ms} ms for {rest}", on_bus, length_s + 1e-3 * late_ms


def _falsify(rng: random.Random, axis: str, period_s: float) -> Words:
    many, length_s = _how_many(rng, period_s)
    name, byte = rng.choice(("rpdo", "tpdo")), rng.randrange(6)
    return f"{name} {axis} byte {byte} xor {1 << rng.randrange(8):02X} {many}", False, length_s


def _node(rng: random.Random, axis: str, _: float) -> Words:
    length_s = rng.choice((0.005, 0.05, 0.3, 1.0))
    return f"{axis} for {length_s} s", False, length_s


def _bus_off(rng: random.Random, axis: str, period_s: float) -> Words:
    words, _, length_s = _node(rng, axis, period_s)
    return (words, False, length_s) if rng.random() < 0.7 else (f"master for {length_s} s", True, length_s)


def _whole_bus(what: str) -> Callable[[random.Random, str, float], Words]:
    def words(rng: random.Random, _axis: str, _period_s: float) -> Words:
        length_s = rng.choice((0.005, 0.02, 0.1, 0.4))
        return f"{what} for {length_s} s", True, length_s

    return words


KINDS: dict[str, Callable[[random.Random, str, float], Words]] = {
    "drop": _befall,
    "delay": _late,
    "duplicate": _befall,
    "reorder": _befall,
    "corrupt": _befall,
    "falsify": _falsify,
    "silence": _node,
    "bus_off": _bus_off,
    "node_reset": lambda _rng, axis, _period_s: (axis, False, 0.3),
    "queue_full": _whole_bus("master"),
    "babble": _whole_bus("001"),
}


# ---- running them


Draw = Callable[[random.Random, Machine, int, str], Case]


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
            stretches = self.planner.stretches
            seen = traces.from_rows(
                run.rows, self.machine, self.task.kinematics, stretches, first_tick=run.first_tick
            )
            seen.save(trace)
        ticks = self.tick_now
        self.at_tick = lambda: None
        for _ in range(round(STILL_S / self.machine.period_s)):
            self.tick()
        found = wrongs(self.observer.sight)
        return Came(one, tuple(found), self.cycle.modes.fault.name, ticks)


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
    except SessionError:
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


# ---- having one again


def written(of: Batch, one: Case, folder: Path) -> list[str]:
    """The files of a case, and the words behind ``directrix`` that make its run again."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "part.ngc").write_text(of.program)
    (folder / "faults.txt").write_text(one.script)
    (folder / "events.jsonl").write_text("".join(json.dumps(told) + "\n" for told in one.events))
    files = ("--faults", str(folder / "faults.txt"), "--events", str(folder / "events.jsonl"))
    return [
        *("simulate", str(folder / "part.ngc"), "--machine", of.machine, "--gouge", "warn"),
        *(*files, "--faults-from", of.origin),
    ]
