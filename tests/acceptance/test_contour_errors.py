"""Setpoints and positions that are lost or late on the bus: what the tool is off its path is told, all of it.

How it is judged: ``support.machines.lossy_runs``.
"""

from __future__ import annotations

import random

import numpy as np
import pytest
from support.machines.lossy_runs import Watched, cases, judged, length
from support.machines.stepped_runs import SHIPPED
from support.suite.seed import SEED

from controller.ipc.handoff import COLUMN
from controller.runtime.events import Event
from controller.state.modes import Fault, Request

FEEDS = (500, 1000, 2000, 3000, 6000)
FORTY = "at 2.5 s: drop rpdo Y x 40"
BATCH = 100


def assert_all_told(seed: int | str, count: int) -> None:
    """Of so many ways in which a run is disturbed: each error told, with an axis that was, and no other."""
    rng = random.Random(seed)
    name, feed = rng.choice(SHIPPED), rng.choice(FEEDS)
    found = cases(name, feed, rng, count, (100, length(name, feed) - 300))
    assert len(found) == count
    wrong = [(one.tick, one.faults, one.wrong) for one in found if one.wrong]
    assert not wrong, (name, feed, wrong)
    assert sum(one.judged.long for one in found if one.judged is not None) > count // 20


def test_what_lost_setpoints_cost_is_told_with_place_and_axis() -> None:
    assert_all_told(24, 20)


@pytest.mark.slow
@pytest.mark.parametrize("batch", range(100))
def test_ten_thousand_losses_are_told(batch: int) -> None:
    assert_all_told(f"losses {SEED} {batch}", BATCH)


Ended = tuple[Watched, str, np.ndarray]


def cut(faults: str, feed: int, events: tuple[Event, ...] = (), **how: object) -> Ended:
    """The machine, how the run ended, and its rows."""
    bench = Watched.up("trunnion", feed, **how)
    if faults:
        bench.befall(faults)
    run = bench.cut(events)
    return bench, run.result, run.rows


def test_forty_lost_setpoints_are_told_and_end_the_run_as_the_machine_file_says() -> None:
    sooner = (Event(2000, Request.OVERRIDE, 2.0),)  # it has been told long before: the rest is run through
    warned, result, rows = cut(FORTY, 600, sooner)
    assert result == "completed"
    (one,) = warned.watch.excesses
    assert warned.machine.axes[one.largest.axis].name == "Y" and one.largest.line in (5, 6)
    told = judged(warned, rows, Fault.NONE)
    assert (told.long, told.missing, told.false) == (1, [], [])
    _, result, rows = cut(FORTY, 600, contour_error="hold")
    assert result == "held" and rows[-1, COLUMN["line"]] in (5, 6)
    assert rows[-1, COLUMN["tick"]] < one.tick + 300
    _, result, rows = cut(FORTY, 600, sooner, contour_error="slow")
    assert result == "completed" and rows[-1, COLUMN["override"]] == 2.0
    slowed = (rows[:, COLUMN["tick"]] > one.tick + 300) & (rows[:, COLUMN["override"]] != 2.0)
    assert np.count_nonzero(slowed) > 100 and set(rows[slowed, COLUMN["override"]]) == {0.5}


def test_a_healthy_run_says_nothing() -> None:
    words = (Event(400, Request.HOLD), Event(700, Request.RESUME), Event(900, Request.OVERRIDE, 2.0))
    healthy, result, _ = cut("", 3000, words)
    assert result == "completed" and healthy.watch.excesses == []
    assert healthy.watch.largest is not None and healthy.watch.largest.mm < 0.02
    assert set(healthy.watch.by_line) == {5, 6, 7, 8}
