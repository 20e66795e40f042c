"""What a soak runs: a machine, a part, what goes wrong, all drawn from a seed and a number."""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from support.faults import fault_scripts
from support.faults.random_script_lines import line
from support.machines import drawn_files
from support.machines.stepped_runs import program as shipped_program
from support.parts import (
    cam_lines,
    random_contours,
    random_nurbs,
    random_planar,
    random_surfaces,
    surface_trains,
    twisted_blades,
)

from controller.machine import machine_file
from controller.machine.model import Machine
from controller.runtime.bus_load import overload

MACHINES = (*fault_scripts.MACHINES, *("shop",) * 4)
FAULTY = 0.35  # share of the runs in which something goes wrong
PERIODS_S = (0.0005, 0.001, 0.002, 0.003, 0.005)
LIVE_PERIODS_S = (0.005, 0.01)  # that a busy computer keeps, too

KILL_RUNS = 40  # at the beginning: only a process that lives on tells whether its memory grows
# What befalls a live machine: a process is killed, the computer is not there for a moment, a drive finds an
# error, or a stranger commands it.
KILLED = ("kill plan", "kill panel", "kill tick", "kill serve")
STRUCK = (
    *(f"stop tick for {ms} ms" for ms in (30, 60, 100)),
    *(f"emcy {{axis}} {code}" for code in ("1000", "4310", "6320", "7305", "FF01")),
    *(f"nmt {{axis}} {word}" for word in ("stop", "preop", "reset_communication")),
)


@dataclass(frozen=True)
class Scenario:
    """One run; ``operator`` is the seed of what is asked meanwhile."""

    seed: int
    number: int
    machine: Machine
    kind: str  # of the part
    program: str
    script: str  # of faults, from the run's start; "" = nothing goes wrong. Live: what is done, and when
    operator: str

    @property
    def title(self) -> str:
        faults = f", {self.script.count(' s: ')} faults" if self.script else ""
        return f"{self.kind} on {self.machine.name} at {1e3 * self.machine.period_s:g} ms{faults}"


def drawn(seed: int, number: int) -> Scenario:
    """The scenario of a number: the same for the same seed, whatever ran before it."""
    rng = random.Random(f"soak {seed} {number}")
    machine = _machine(rng)
    kind = rng.choice(sorted(PARTS))
    script = _script(rng, machine) if rng.random() < FAULTY else ""
    text = drawn_files.program(rng, PARTS[kind](rng, machine))
    return Scenario(seed, number, machine, kind, text, script, f"{seed} {number}")


def live_machine(seed: int) -> Machine:
    """The one that a soak on the real clock runs on from its beginning to its end; it can run all parts."""
    return _machine(random.Random(f"live soak {seed}"), ("shop",), LIVE_PERIODS_S)


def live(seed: int, number: int, machine: Machine) -> Scenario:
    """As ``drawn``, on a machine that is there."""
    rng = random.Random(f"live soak {seed} {number}")
    kind = rng.choice(sorted(PARTS))
    text, script = drawn_files.program(rng, PARTS[kind](rng, machine)), ""
    if rng.random() < FAULTY:
        kills = number < KILL_RUNS and rng.random() < 0.5
        words = rng.choice(KILLED if kills else STRUCK)
        script = f"{rng.uniform(0.2, 6.0):.3f} s: {words.format(axis=rng.choice(machine.axes).name)}"
    return Scenario(seed, number, machine, kind, text, script, f"live {seed} {number}")


def _machine(
    rng: random.Random,
    names: Sequence[str] = MACHINES,
    periods_s: Sequence[float] = PERIODS_S,
) -> Machine:
    """A shipped one that warns of gouges, at a period that its buses carry."""
    text = drawn_files.drawn(rng, machine_file.load(rng.choice(names)).text)
    made = machine_file.read(re.sub(r'(?m)^gouge = "refuse"', 'gouge = "warn"', text), "machine.toml")
    fitting = [one for one in periods_s if not overload(machine_file.with_period(made, one))]
    return machine_file.with_period(made, rng.choice(fitting)) if fitting else made


def _script(rng: random.Random, machine: Machine) -> str:
    at_s, lines = rng.uniform(0.05, 4.0), [f"seed {rng.randrange(10**6)}"]
    for _ in range(rng.choice((1, 1, 2, 3))):
        bus, _, words = line(rng, machine)[0].partition("|")
        lines.append(f"{bus}at {at_s:.6f} s: {words}")
        at_s += rng.uniform(0.0, 0.3)
    return "\n".join([*lines, ""])


# ---- parts


def _feed(rng: random.Random) -> float:
    return float(rng.choice((200, 600, 1500, 4000, rng.randint(100, 6000))))


def _placed(rng: random.Random) -> str:
    return rng.choice(("P1", "P1", "P2", "P3", "P4 R0.05"))


def _compound(rng: random.Random, _: Machine) -> str:
    surfaces = random_surfaces.compound(rng.randrange(10**6), rng.randrange(1, 4))
    side = rng.choice(("G41", "G42"))
    return random_surfaces.text(surfaces, _feed(rng), f"{side} {_placed(rng)}")


def _train(rng: random.Random, _: Machine) -> str:
    made = surface_trains.program(rng.randrange(2, 9), rng.uniform(0.0, 6.0), rng.choice((0, 0, 3)))
    return made.replace("P1", _placed(rng)).replace("F1000.", f"F{_feed(rng):g}")


def _blade(rng: random.Random, _: Machine) -> str:
    upper, lower = random_nurbs.blade(rng.randrange(10**6), rng.choice((2, 3, 4, 12, 30)))
    return random_nurbs.text(upper, lower, _feed(rng), rng.choice(("G41", "G42")))


def _twisted(rng: random.Random, _: Machine) -> str:
    """Its normal turns by more than a right angle: only an axis off the ruling can follow it."""
    surface, radius = twisted_blades.blade(rng.randrange(10**6))
    pairs = [(np.array(surface.upper.points), np.array(surface.lower.points))]
    return random_surfaces.text(pairs, _feed(rng), f"{'G42' if radius > 0.0 else 'G41'} P3")


def _example(rng: random.Random, _: Machine) -> str:
    return shipped_program(rng.choice(("example1_ready", "example2_ready")), f"{_feed(rng):g}.")


def _rapids(rng: random.Random, machine: Machine) -> str:
    return fault_scripts.rapids(rng, machine)


def _contour(rng: random.Random, _: Machine) -> str:
    if rng.random() < 0.5:
        return random_planar.program(rng)
    pieces = random_contours.contour(rng, 3.0)
    return random_contours.text(pieces, rng.choice(("G41 D2", "G42 D2")), 5)


def _cam(rng: random.Random, _: Machine) -> str:
    """Five-axis lines with tool vectors, which every machine can read."""
    at = cam_lines.places(rng.randrange(50, 600), rng.choice((0.02, 0.1, 0.5)))
    head = f"G21 G90 {rng.choice(('G61', 'G64', 'G64 P0.01', 'G64 P0.05 Q0.2'))}"
    return "".join(cam_lines.program(at, True, head, _feed(rng)))


PARTS: dict[str, Callable[[random.Random, Machine], str]] = {
    "compound surfaces": _compound,
    "row of surfaces": _train,
    "NURBS blade": _blade,
    "twisted blade": _twisted,
    "example of the paper": _example,
    "rapids": _rapids,
    "contour": _contour,
    "CAM lines": _cam,
}
