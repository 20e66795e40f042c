"""Example 2 with its plan or its tick killed at random instants, on the stepped clock.

The service's own plan, with its orders and journal. A seed is printed; ``DIRECTRIX_SEED`` repeats
it, and ``DIRECTRIX_KILLS`` (default 1) asks for more instants. With real processes, and in real
time: test_killed_in_a_run.
"""

from __future__ import annotations

import os
import random
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.live.replayed_runs import Again, assert_cut
from support.machines.interrupted_runs import assert_rest_is_cut, fresh, rest_of, resumed, segments
from support.machines.planning_bench import Bench
from support.machines.stepped_runs import cut, program

from controller.ipc.handoff import COLUMN
from controller.plan.restart.program_position import ENTRY_ID, Spot
from controller.runtime.events import Event
from controller.service import journal
from controller.state.modes import Fault, Mode, Request

pytestmark = pytest.mark.slow

TEXT = program("example2_ready.ngc", "1000.")
TICKS = 2300  # of the whole run
LOST_S = 1.0  # of cut, at most
SEED = int(os.environ.get("DIRECTRIX_SEED") or random.randrange(1_000_000))
KILLS = int(os.environ.get("DIRECTRIX_KILLS") or 1)


@pytest.fixture(params=range(KILLS))
def instant(request: pytest.FixtureRequest) -> int:
    """A tick of the run."""
    rng = random.Random(f"{SEED}-{request.param}-{request.node.originalname}")
    tick = rng.randrange(10, TICKS)
    print(f"DIRECTRIX_SEED={SEED} DIRECTRIX_KILLS={KILLS}: {request.node.name} at tick {tick}")
    return tick


def killed(folder: Path, instant: int) -> Bench:
    bench = Bench(folder)
    bench.armed(TEXT)
    bench.rows.append(bench.stepped.go(instant))
    return bench


def last_place(bench: Bench) -> tuple[int, float]:
    rows = np.concatenate(bench.rows)
    ids = rows[:, COLUMN["motion_id"]]
    row = rows[(ids >= 0) & (ids < ENTRY_ID)][-1]
    return int(row[COLUMN["motion_id"]]), float(row[COLUMN["s"]])


def goes_on(bench: Bench, first: int) -> None:
    """The rest, as the journal offers it, is cut to the end within 1e-6 mm."""
    entry = bench.offered(TEXT)
    bench.armed(TEXT, spot=entry.spot, start=entry.job.start, in_spindle=2)
    bench.until(Mode.READY)
    bench.assert_cut(TEXT, bench.machine, entry.spot, first)


def test_a_killed_plan_leaves_the_tool_on_the_path_and_the_rest_is_cut_from_there(
    tmp_path: Path, instant: int
) -> None:
    bench = killed(tmp_path, instant)
    bench.kill()
    modes, follow = bench.stepped.cycle.modes, bench.stepped.cycle.follow
    bench.go(lambda: modes.mode in (Mode.FAULT, Mode.READY) and follow.at_rest)
    bench.rows.append(bench.stepped.go(20))
    if modes.mode is Mode.READY:
        return  # all of it had been planned
    assert modes.fault is Fault.PLANNER_GONE and modes.untrusted == 0
    entry = bench.offered(TEXT)
    assert entry.exact and (entry.spot.motion_id, entry.spot.s) == last_place(bench)
    before = len(bench.rows)
    bench.mend()
    bench.recover()
    goes_on(bench, before)


def test_a_killed_tick_loses_at_most_a_second_of_cut(tmp_path: Path, instant: int) -> None:
    bench = killed(tmp_path, instant)
    bench.journal.lost(bench.snapshot())
    led = last_place(bench)
    rows = np.concatenate(bench.rows)
    again = Bench(tmp_path)  # after a reset of all: the axes are homed anew
    if journal.read(again.store) is None:
        return  # nothing of the program was done
    entry = again.offered(TEXT)
    begin = (entry.spot.motion_id, entry.spot.s)
    assert not entry.exact and begin <= led
    places = zip(rows[:, COLUMN["motion_id"]], rows[:, COLUMN["s"]], strict=True)
    lost_s = sum(place > begin for place in places) * bench.machine.period_s
    assert lost_s <= LOST_S
    goes_on(again, 0)


def test_a_cut_that_begins_where_another_was_stopped_is_judged_by_its_own_motions() -> None:
    """The tool retracts first, so that every motion of the whole run has the next number."""
    stepped, begin = fresh(), Spot(1, 0.0, 0, 0.0)
    assert cut(TEXT, events=[Event(2200, Request.STOP)], stepped=stepped).run.result == "stopped"
    start = stepped.joints
    done = Again(cut(TEXT, stepped=stepped).run, stepped, np.empty((0, 5)), start=start)
    assert_cut(done, TEXT, begin)
    with pytest.raises(AssertionError):
        assert_cut(replace(done, start=None), TEXT, begin)


def test_a_rest_from_within_the_lead_out_begins_behind_it() -> None:
    """All has been cut there, and the tool is beside the part."""
    stepped, wanted = fresh(), segments(TEXT, fresh().machine)
    number, way = next((n, one) for n, one in wanted.items() if one.name == "lead out")
    spot = Spot(way.place.line, 1.0, number, 0.8 * way.motion.end)
    done = resumed(stepped, rest_of(TEXT, spot, stepped.machine), in_spindle=2)
    assert done.run.result == "completed"
    assert number not in done.run.rows[:, COLUMN["motion_id"]]
    assert_rest_is_cut(done.run.rows, wanted, spot)
