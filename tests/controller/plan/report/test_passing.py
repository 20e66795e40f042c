"""What a check says is left at a place is what the machine then takes from there."""

from __future__ import annotations

import numpy as np
import pytest
from support.machines.interrupted_runs import EXAMPLE_2, LINES, TIPS, source
from support.machines.stepped_runs import cut, shipped

from controller.ipc.handoff import COLUMN
from controller.plan.path import path
from controller.plan.report.passing import MAX_MARKS, OWN, Passing, passed_s, place_of
from controller.plan.report.survey import survey
from controller.plan.restart.program_position import lines_along, part_at
from controller.plan.segment import ContinuousPath

CLOSE = 0.005  # of the duration ...
SHORT_S = 0.06  # ... or this: nobody sees it of a program of seconds
PERIOD_S = 0.008


def passing_of(text: str) -> tuple[Passing, float, dict[int, tuple[str, tuple]]]:
    """The marks, the duration, and of each motion its name and lines."""
    asked = source(text, shipped(period_s=PERIOD_S))

    def chains():
        tracer = path.PathBuilder(
            asked.name, asked.machine, asked.kinematics, asked.start, asked.chosen or {}
        )
        return tracer.items(asked.blocks)

    made = Passing()
    found = survey(chains(), asked.machine, asked.kinematics, passing=made)
    motions = [
        (segment.name, parts)
        for chain in chains()
        if isinstance(chain, ContinuousPath)
        for segment, parts in zip(chain.segments, lines_along(chain), strict=True)
    ]
    return made, found.duration_s, dict(enumerate(motions))


@pytest.mark.parametrize("text", [EXAMPLE_2, LINES, TIPS], ids=["surfaces", "lines", "tips"])
def test_the_time_that_has_passed_at_a_place_is_that_of_the_run(text: str) -> None:
    made, duration_s, motions = passing_of(text)
    machine = shipped(period_s=PERIOD_S)
    rows = cut(text, machine).rows
    off = []
    for tick, row in enumerate(rows):
        number = int(row[COLUMN["motion_id"]])
        if number in motions and motions[number][0] != "retract":  # at the end: no line goes on there
            (name, parts), s = motions[number], float(row[COLUMN["s"]])
            part, fraction = part_at(parts, s)
            told = passed_s(made.marks, place_of(name, part.order, fraction, s))
            off.append(told - tick * machine.period_s)
    assert len(off) > 0.5 * len(rows)
    assert np.ptp(off) < max(CLOSE * duration_s, SHORT_S)
    assert np.abs(off).max() < CLOSE * duration_s + 0.2, "the start itself takes some ticks"


def test_marks_of_a_long_program_are_bounded() -> None:
    made = Passing()
    for k in range(10 * MAX_MARKS):
        made._mark((k, 0.0, OWN, 0.0), 0.1 * k)
    assert len(made.marks) <= MAX_MARKS
    for k in (0, 7, 12345, 10 * MAX_MARKS - 1):
        assert passed_s(made.marks, (k, 0.0, OWN, 0.0)) == pytest.approx(0.1 * k, abs=0.1)
