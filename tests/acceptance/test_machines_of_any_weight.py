"""Programs on machines with limits over four decades run to their end, inside of all limits and in time."""

from __future__ import annotations

import contextlib
import itertools

import numpy as np
import pytest
from support.machines.slow_machines import any_path, drawn, published, two_rails
from support.machines.stepped_runs import Cut, cut, off_the_plan
from support.oracles import jerk_limited_time
from support.oracles.trace_limits import assert_in_limits

from controller.machine.model import Machine
from controller.plan.surfaces.leads import LEADS
from controller.program.program import ProgramError

TIP_MM = 1e-6


def run(source: str, machine: Machine, label: object) -> tuple[Cut, float]:
    """The finished run, and its seconds from lead to lead over the optimum of the same way.

    The cut begins and ends at speed in both: from rest to rest are leads and cuts together.
    """
    done = cut(source, machine)
    assert done.run.result == "completed", (label, done.run.result, done.run.fault_text)
    assert_in_limits(done, label, ())
    assert off_the_plan(done, np.flatnonzero(done.column("mode") != 1.0)) < TIP_MM, label
    way = {i: s for i, s in done.segments.items() if s.cutting or s.name in LEADS}
    rows = list(way.values())
    begins = [k for k, segment in enumerate(rows) if segment.name == LEADS[0]]
    assert begins and begins[0] == 0, label
    trains = [rows[a:b] for a, b in itertools.pairwise([*begins, len(rows)])]
    best = sum(jerk_limited_time.optimum(train, machine).seconds for train in trains)
    ticks = int(np.isin(done.column("motion_id"), list(way)).sum())
    return done, ticks * machine.period_s / best


def test_the_published_two_rail_case_runs_to_its_end_at_its_optimum() -> None:
    _, ratio = run(two_rails(), published(), "two rails")
    assert ratio <= 1.05


@pytest.mark.slow
@pytest.mark.parametrize("first", range(1000, 5000, 200))
def test_random_paths_on_random_machines_run_to_their_ends(first: int) -> None:
    for seed in range(first, first + 5):
        machine = drawn(seed)
        with contextlib.suppress(ProgramError):  # a surface that is refused; another one will do
            made, ratio = run(any_path(seed), machine, seed)
            print(f"seed {seed}: {len(made.rows) * machine.period_s:.1f} s, {ratio:.4f} of the optimum")
            assert ratio <= 1.15, seed
            return
    raise AssertionError("all are refused")
