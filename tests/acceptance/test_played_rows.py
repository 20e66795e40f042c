"""Late ticks drawn at random with whatever else may befall a run, judged by what the pump handed over.

Ticks that come 10 to 500 ms late, in trains; feedback or setpoints lost; a drive that trips; holds, resumes,
overrides; a planner without a turn; a stock that is used up, and a cut that the operator begins anew. No
drive that follows is sent a jump, every row on the path is what was sent two periods later and where its own
motion is: ``support.machines.played_rows``.

    DIRECTRIX_CASES=400 pytest -m slow -s tests/acceptance/test_played_rows.py      others with another seed
"""

from __future__ import annotations

import os
import random
from collections import Counter
from dataclasses import replace

import pytest
from support.machines import late_runs, played_rows
from support.machines.late_runs import Healthy, Late
from support.machines.stepped_runs import program, shipped
from support.machines.with_tables import with_tables
from support.suite.seed import SEED

from controller.machine.model import Machine

CASES = int(os.environ.get("DIRECTRIX_CASES") or 24)
PERIODS_S = (0.002, 0.01, 0.005)
LINES = "G21 G90 G54 G61\nG0 Z50\nG1 X30 Y5 F6000\nG2 X20 Y-5 I-10\nM8\nG1 X0 Y0 Z30\nG0 X-60 Z60\nM30\n"
PROGRAMS = {
    "trunnion": program("example2_ready", "6000."),
    "three_axes": LINES,
    "table_head": LINES,
}
ONE = (
    lambda rng, axis, T: f"drop tpdo {axis} x {rng.choice((1, 2, 3, 5, 10, 50))}",
    lambda rng, axis, T: f"drop tpdo {axis} for {rng.choice((0.02, 0.1, 0.5))} s odds 0.4",
    lambda rng, axis, T: f"delay tpdo {axis} by {rng.choice((1, 3, 10, 40))} ms for 0.1 s",
    lambda rng, axis, T: f"drop rpdo {axis} x {rng.choice((1, 3, 5, 10))}",
    lambda rng, axis, T: f"silence {axis} for {rng.choice((0.01, 0.05, 0.3))} s",
    lambda rng, axis, T: f"sto {axis} for {rng.choice((0.02, 0.3))} s",
    lambda rng, axis, T: f"jam {axis} for {rng.choice((0.02, 0.1))} s",
)


def drawn(rng: random.Random, machine: Machine, ticks: int) -> tuple[int, Late]:
    """(tick of the fork; what befalls the run from there on)."""
    late = dict[int, float]()
    for _train in range(rng.randrange(1, 4)):
        place, most = rng.randrange(50), rng.choice((0.015, 0.03, 0.06, 0.12, 0.5))
        for k in range(rng.choice((1, 1, 2, 3, 6))):
            late[place + k] = rng.uniform(0.01, max(0.011, most))
    slow = {rng.randrange(60): rng.uniform(0.0, 4.0) * machine.period_s for _ in range(rng.randrange(6))}
    names = [axis.name for axis in machine.axes]
    faults = [
        f"at {rng.uniform(0.001, 0.3):.4f} s: {rng.choice(ONE)(rng, rng.choice(names), machine.period_s)}"
        for _ in range(rng.choice((0, 0, 1, 1, 2)))
    ]
    asked = late_runs._requests(rng) if rng.random() < 0.4 else ()
    begins = [rng.randrange(60) for _ in range(rng.choice((0, 0, 1, 2)))]
    silent = [range(n, n + rng.randrange(5, 60)) for n in begins]
    script = "\n".join([f"seed {rng.randrange(1000)}", *faults]) if faults else ""
    again = rng.random() < 0.3
    to_end = again or bool(asked) or rng.random() < 0.1
    return rng.randrange(ticks), Late("drawn", late, slow, asked, False, to_end, script, silent, again)


def searched(rng: random.Random, name: str, cases: int) -> None:
    machine = replace(shipped(name, period_s=rng.choice(PERIODS_S)), stock_s=0.016)
    limits = [axis.limits for axis in machine.axes]
    healthy = Healthy(with_tables(rng, machine) if rng.random() < 0.5 else machine, PROGRAMS[name], limits)
    lates = sorted((drawn(rng, machine, healthy.ticks) for _ in range(cases)), key=lambda one: one[0])
    verdicts = list(late_runs.cases(healthy, lates, played_rows.judged))
    print(f"\n{name}, {machine.period_s} s, {healthy.ticks} ticks:", Counter(one.result for one in verdicts))
    print(Counter(key for one in verdicts for key in one.shares if " " not in key))
    wrongs = [f"fork at {one.fork}, {one.late}: {one.wrongs[:4]}" for one in verdicts if one.wrongs]
    assert not wrongs, "\n".join([f"{name}, {machine.period_s} s: {len(wrongs)} of {cases}", *wrongs])


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(PROGRAMS))
def test_whatever_befalls_a_run_each_row_is_what_was_sent_and_no_drive_jumps(name: str) -> None:
    searched(random.Random(f"played rows {SEED} {name}"), name, CASES)


def test_a_few_runs_that_late_ticks_and_faults_befall() -> None:
    searched(random.Random("played rows, a few"), "three_axes", 3)
