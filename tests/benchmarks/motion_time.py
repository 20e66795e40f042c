"""How long the planned motion takes, beside a lower bound by toppra in the same run.

The time of the cutting segments in the planned program against velocity, acceleration and feed
limits alone (no jerk), each smooth segment at any speed where it joins another: Example 2 at three
feeds, both parts of the paper with the limits that LinuxCNC ships for its xyzac simulation, and random
compound surfaces at feeds that bind. The planner's processor time stands beside it. Random paths on
machines with limits drawn over four decades stand beside the jerk-limited optimum of their cuts.
"""

from __future__ import annotations

import itertools
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
from support.suite import figures  # noqa: E402
from support.suite.figures import Figure, Report  # noqa: E402

from controller.machine.kinematics import kinematics_of  # noqa: E402
from controller.machine.model import Machine  # noqa: E402
from controller.plan.feed import profile  # noqa: E402
from controller.plan.feed.course import FeedCourse  # noqa: E402
from controller.plan.path.path import ContinuousPath  # noqa: E402
from controller.program.program import ProgramError  # noqa: E402

BOUND, OPTIMUM = "bound without jerk", "jerk-limited optimum"
FEEDS = ("100.", "1000.", "3000.")
MACHINES = ("trunnion", "fig4b", "fig4c", "fig4d", "table_head", "head_head", "oblique45")


class Cut(NamedTuple):
    """One program: seconds of cut, its bound, processor seconds of planning and of motion planned."""

    name: str
    cut_s: float
    bound_s: float
    cpu_s: float
    motion_s: float

    @property
    def ratio(self) -> float:
        return self.cut_s / self.bound_s


def measured(name: str, source: str, machine: Machine) -> Cut:
    """Plan a program as it is run and compare its cuts with their bound."""
    kinematics = kinematics_of(machine)
    home = tuple(axis.homing.position for axis in machine.axes)
    chains = [i for i in traced_programs.trace(source, machine, home).items if isinstance(i, ContinuousPath)]  # type: ignore[arg-type]
    cut = cpu = motion = bound = 0.0
    for chain in chains:
        for run in profile.split_at_stops(chain.segments, machine, kinematics):
            before = time.process_time()
            course = FeedCourse(run, machine, kinematics)
            planned = profile.plan(course)
            assert planned is not None, name
            cpu += time.process_time() - before
            motion += planned.duration_s
            for k, law in planned.laws(course):
                cut += law.duration_s * run[k].cutting
            bound += time_bound.seconds_of_cuts(run, machine)
    return Cut(name, cut, bound, cpu, motion)


def of_the_paper() -> list[Cut]:
    machine = shipped()
    slow = time_bound.linuxcnc(machine)
    found = [measured(f"Example 2 at {feed}", program("example2.ngc", feed), machine) for feed in FEEDS]
    return found + [
        measured(f"{name} at 1000. on LinuxCNC's xyzac", program(f"{name}.ngc", "1000."), slow)
        for name in ("example1", "example2")
    ]


def of_random_surfaces(count: int, first_seed: int = 500) -> list[Cut]:
    found: list[Cut] = []
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


def of_any_weight(count: int) -> list[Cut]:
    """The cuts alone, from rest to rest."""
    found: list[Cut] = []
    cases = itertools.chain(
        [("two rails as published", slow_machines.two_rails(), slow_machines.published())],
        ((f"seed {n}", slow_machines.any_path(n), slow_machines.drawn(n)) for n in itertools.count(1000)),
    )
    for name, source, machine in cases:
        if len(found) >= count:
            break
        try:
            cuts = [s for chain in planned_laws.chains(source, machine) for s in chain.segments if s.cutting]
        except ProgramError:
            continue  # a surface that is refused; others will do
        before = time.process_time()
        took_s = sum(law.duration_s for law in planned_laws.laws_of(cuts, machine))
        cpu_s = time.process_time() - before
        best_s = jerk_limited_time.optimum(cuts, machine).seconds
        found.append(Cut(f"{name} on {machine.name}", took_s, best_s, cpu_s, took_s))
    return found


def report(short: bool) -> Report:
    paper = of_the_paper()[: 1 if short else None]
    random_ones, heavy = of_random_surfaces(1 if short else 40), of_any_weight(1 if short else 20)
    found = [Figure(one.name, one.cut_s, "s", one.bound_s, BOUND) for one in paper]
    for name, some, beside in (
        ("random surfaces", random_ones, BOUND),
        ("machines of any weight", heavy, OPTIMUM),
    ):
        ratios = [one.ratio for one in some]
        found.append(Figure(f"{name}, median", statistics.median(ratios), "times", 1.0, beside))
        found.append(Figure(f"{name}, worst", max(ratios), "times", 1.0, beside))
    every = [*paper, *random_ones]
    cpu_s, motion_s, cut_s = (
        sum(float(getattr(one, name)) for one in every) for name in ("cpu_s", "motion_s", "cut_s")
    )
    found.append(Figure("planning", cpu_s, "s of CPU", motion_s, "the motion planned"))
    parts = {"cuts": cut_s / motion_s, "ways beside them": 1.0 - cut_s / motion_s}
    return Report(tuple(found), parts, "the motion planned")


if __name__ == "__main__":
    figures.main(report)
