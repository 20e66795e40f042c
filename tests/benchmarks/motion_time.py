"""How long the planned motion takes, beside a lower bound by toppra in the same run.

    python tests/benchmarks/motion_time.py [--surfaces N] [--machines N] [--json]

The time of the cutting stretches in the planned program against velocity, acceleration and feed
limits alone (no jerk), each smooth stretch at any speed where it joins another: Example 2 at three
feeds, both parts of the paper with the limits that LinuxCNC ships for its xyzac simulation, and random
compound surfaces at feeds that bind. The planner's processor time stands beside it. Random paths on
machines with limits drawn over four decades stand beside the jerk-limited optimum of their cuts.
"""

from __future__ import annotations

import argparse
import itertools
import json
import random
import statistics
import sys
import time
from pathlib import Path
from typing import NamedTuple

sys.path[:0] = [str(Path(__file__).parents[2]), str(Path(__file__).parents[1])]

from support.machines import planned_laws, slow_machines, traced_programs  # noqa: E402
from support.machines.stepped_runs import program, shipped  # noqa: E402
from support.oracles import jerk_limited_time, time_bound  # noqa: E402
from support.parts.random_surfaces import compound, text  # noqa: E402

from controller.machine.kinematics import kinematics_of  # noqa: E402
from controller.machine.model import Machine  # noqa: E402
from controller.plan.feed import profile  # noqa: E402
from controller.plan.feed.course import Course  # noqa: E402
from controller.plan.path.path import Chain  # noqa: E402
from controller.program.program import ProgramError  # noqa: E402

FEEDS = ("100.", "1000.", "3000.")
MACHINES = ("trunnion", "fig4b", "fig4c", "fig4d", "table_head", "head_head", "oblique45")


class Figure(NamedTuple):
    """One program: seconds of cut, its bound, processor seconds of planning and of motion planned."""

    name: str
    cut_s: float
    bound_s: float
    cpu_s: float
    motion_s: float

    @property
    def ratio(self) -> float:
        return self.cut_s / self.bound_s


def measured(name: str, source: str, machine: Machine) -> Figure:
    """Plan a program as it is run and compare its cuts with their bound."""
    kinematics = kinematics_of(machine)
    home = tuple(axis.homing.position for axis in machine.axes)
    chains = [i for i in traced_programs.trace(source, machine, home).items if isinstance(i, Chain)]  # type: ignore[arg-type]
    cut = cpu = motion = bound = 0.0
    for chain in chains:
        for run in profile.split_at_stops(chain.stretches, machine, kinematics):
            before = time.process_time()
            course = Course(run, machine, kinematics)
            planned = profile.plan(course)
            assert planned is not None, name
            cpu += time.process_time() - before
            motion += planned.duration_s
            for k, law in planned.laws(course):
                cut += law.duration_s * run[k].cutting
            bound += time_bound.seconds_of_cuts(run, machine)
    return Figure(name, cut, bound, cpu, motion)


def of_the_paper() -> list[Figure]:
    machine = shipped()
    slow = time_bound.linuxcnc(machine)
    found = [measured(f"Example 2 at {feed}", program("example2.ngc", feed), machine) for feed in FEEDS]
    return found + [
        measured(f"{name} at 1000. on LinuxCNC's xyzac", program(f"{name}.ngc", "1000."), slow)
        for name in ("example1", "example2")
    ]


def of_random_surfaces(count: int, first_seed: int = 500) -> list[Figure]:
    found: list[Figure] = []
    seed = first_seed
    while len(found) < count:
        rng = random.Random(seed)
        machine = shipped(rng.choice(MACHINES))
        feed = rng.uniform(2000.0, 5000.0)
        try:
            source = text(compound(seed, rng.choice((1, 2, 3))), feed)
            found.append(measured(f"seed {seed} on {machine.name} at {feed:.0f}", source, machine))
        except (ProgramError, ValueError):
            pass  # a surface that is refused, or one whose bound is not found; others will do
        seed += 1
    return found


def of_any_weight(count: int) -> list[Figure]:
    """The cuts alone, from rest to rest."""
    found: list[Figure] = []
    cases = itertools.chain(
        [("two rails as published", slow_machines.two_rails(), slow_machines.published())],
        ((f"seed {n}", slow_machines.any_path(n), slow_machines.drawn(n)) for n in itertools.count(1000)),
    )
    for name, source, machine in cases:
        if len(found) >= count:
            break
        try:
            cuts = [s for chain in planned_laws.chains(source, machine) for s in chain.stretches if s.cutting]
        except ProgramError:
            continue  # a surface that is refused; others will do
        before = time.process_time()
        took_s = sum(law.duration_s for law in planned_laws.laws_of(cuts, machine))
        cpu_s = time.process_time() - before
        best_s = jerk_limited_time.optimum(cuts, machine).seconds
        found.append(Figure(f"{name} on {machine.name}", took_s, best_s, cpu_s, took_s))
    return found


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    arguments.add_argument("--surfaces", type=int, default=40)
    arguments.add_argument("--machines", type=int, default=20)
    arguments.add_argument("--json", action="store_true")
    asked = arguments.parse_args()
    figures = of_the_paper() + of_random_surfaces(asked.surfaces)
    heavy = of_any_weight(asked.machines)
    if asked.json:
        print(json.dumps([figure._asdict() for figure in figures + heavy], indent=1))
        return
    for f in figures + heavy:
        print(
            f"{f.name:40} cut {f.cut_s:8.3f} s  bound {f.bound_s:8.3f} s  ratio {f.ratio:.4f}"
            f"   planned {f.motion_s:7.2f} s of motion in {f.cpu_s:.3f} s"
        )
    for name, some in (("random surfaces", figures[len(FEEDS) + 2 :]), ("machines of any weight", heavy)):
        if ratios := [f.ratio for f in some]:
            print(f"{name}: median {statistics.median(ratios):.4f}, worst {max(ratios):.4f}")


if __name__ == "__main__":
    main()
