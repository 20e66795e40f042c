"""Random fault scripts: what is run, when what goes wrong, and what the operator does meanwhile.

A batch is one machine with one program, prepared once; each of its cases is the same run up to some
tick and forks there. Everything is drawn from the batch's number, and every case can be had again by
``directrix simulate``.
"""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from support.faults.random_script_lines import line
from support.machines.stepped_runs import program

from controller.machine import machine_file
from controller.machine.model import Machine

MACHINES = tuple(
    name
    for name in machine_file.shipped()
    if (spindle := machine_file.load(name).spindle) is not None and not spindle.is_driven
)
AFTER_S = 0.4  # from the end of the last fault to the operator's stop


@dataclass(frozen=True)
class Batch:
    """What its cases have in common."""

    number: int
    machine: str
    program: str
    origin: str  # "program" or "home"

    @property
    def made(self) -> Machine:
        return replace(machine_file.load(self.machine), gouge="warn")


class Case(NamedTuple):
    """One run: requests and faults from ``tick`` on."""

    tick: int
    events: tuple[dict[str, object], ...]
    script: str


Draw = Callable[[random.Random, Machine, int, str], Case]


def batch(number: int) -> Batch:
    """Machine after machine, so that a few batches have seen all of them."""
    rng = random.Random(f"batch {number}")
    machine = MACHINES[number % len(MACHINES)]
    origin = "home" if rng.random() < 0.1 else "program"
    example = rng.choice(("example1_ready", "example2_ready"))
    feed = f"{rng.choice((100, 300, 1000, 3000, rng.randint(100, 3000)))}."
    made = machine_file.load(machine)
    surfaces = rng.random() < 0.8 and bool(made.rotary())  # the paper's parts need a tool that leans
    text = program(example, feed) if surfaces else rapids(rng, made)
    return Batch(number, machine, text, origin)


def healthy_batch(number: int) -> Batch:
    """The paper's parts at any feed; rapids where the tool cannot lean."""
    rng = random.Random(f"healthy {number}")
    example = ("example1_ready", "example2_ready")[number // len(MACHINES) % 2]
    machine, feed = MACHINES[number % len(MACHINES)], f"{rng.randint(100, 3000)}."
    made = machine_file.load(machine)
    return Batch(number, machine, program(example, feed) if made.rotary() else rapids(rng, made), "program")


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


LOSSES = (  # of a sound bus with a bad contact: one frame at a time, and none a fault
    "drop rpdo {axis} x 1",
    "drop tpdo {axis} x 1",
    "drop sync x 1",
    "drop heartbeat {axis} x 1",
    "delay tpdo {axis} by 1 ms x 1",
    "delay rpdo {axis} by 1 ms x 1",
    "delay tpdo {axis} by 2.5 ms x 1",
    "delay sync by 300 us x 1",
    "duplicate rpdo {axis} x 3",
    "duplicate tpdo {axis} x 3",
    "duplicate sync x 2",
    "reorder tpdo {axis} x 1",
    "corrupt tpdo {axis} x 1",
    "corrupt rpdo {axis} x 1",
)
LOSS_EVERY = 25  # SYNCs at least


def lossy_case(rng: random.Random, machine: Machine, tick: int, origin: str) -> Case:
    """A healthy run on a bus that loses, delays and repeats a frame now and then."""
    healthy = healthy_case(rng, machine, tick, origin)
    at, last, lines = tick + 2, int(str(healthy.events[-1]["tick"])), [f"seed {rng.randrange(10**6)}"]
    while (at := at + LOSS_EVERY + rng.randrange(4 * LOSS_EVERY)) < last:
        axis, bus = rng.choice(machine.axes).name, rng.choice(machine.buses).name
        words = rng.choice(LOSSES).format(axis=axis)
        lines.append(f"{f'on {bus}: ' if ' sync ' in words else ''}at sync {at}: {words}")
    return Case(tick, healthy.events, "\n".join([*lines, ""]))


def rapids(rng: random.Random, machine: Machine) -> str:
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
    events.append({"tick": begin + in_ticks(min(lasts_s, 1.0) + AFTER_S), "request": "stop"})
    return Case(tick, tuple(events), "\n".join([*lines, ""]))


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
