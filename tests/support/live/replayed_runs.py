"""The record of a live run, run again on the stepped clock: what the tests of records compare."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from support.machines.interrupted_runs import assert_rest_is_cut, distance, program_rows, segments
from support.machines.stepped_runs import shipped

from controller.ipc.handoff import COLUMN
from controller.machine import machine_file, setup_data
from controller.machine.model import Joints, Machine
from controller.plan.restart.program_position import Spot
from controller.runtime import checked, events, replay, starts
from controller.runtime.comparison import Comparison, off_path
from controller.runtime.stepped import Run, SteppedMachine
from controller.service.jobs import whole_from
from controller.state.setpoints import SETPOINTS

FIRST = COLUMN["setpoint_0"]
LOOKING = 1  # tick: whether the one that found the end belongs to it
SAME_MM = 1e-6  # mm or rad


@dataclass(frozen=True)
class Again:
    """A recorded run and its repetition."""

    run: Run
    stepped: SteppedMachine
    live: np.ndarray  # (N, 5) setpoints in counts
    off_path: int = 1 << 40  # the tick from which on they were where the drives were
    start: Joints | None = None  # of the whole run, of which motions have their numbers; None: homed

    @property
    def setpoints(self) -> np.ndarray:
        sent = self.run.rows[:, COLUMN["sync_sent"]] != 0.0
        return self.run.rows[sent, FIRST : FIRST + 5]


def records(state: Path) -> list[Path]:
    """Folders of the runs that came to an end, the oldest first."""
    return sorted(path.parent for path in (state / "runs").glob("*/run.json"))


def facts(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / "run.json").read_text())
    return found


def again(folder: Path, text: str, machine: Machine | None = None) -> Again:
    """As ``directrix simulate --events`` does it, at the period of the record."""
    recorded = events.recorded(folder / "events.jsonl")
    assert recorded is not None
    built, begin = machine or shipped(), recorded.begin
    if begin.period_s is not None:
        built = machine_file.with_period(built, begin.period_s)
    made = setup_data.applied(built, begin.fitted)
    task = checked.task(text.encode(), "part.ngc", made)
    bench = SteppedMachine(made)
    bench.come_up()
    bench.stand_at(begin.start.joints, begin.start.plan_time_s)
    walk = starts.path_from(task, None, begin.start)
    live = SETPOINTS.read(folder)
    assert live is not None
    part = replay.Part(task, lambda fitted: setup_data.applied(built, dict(fitted)))
    compared = Comparison(folder, recorded)
    run = replay.again(bench, walk, part, recorded, compared)
    assert compared.difference is None
    return Again(run, bench, live, off_path(recorded), whole_from(begin.start))


def assert_same_setpoints(done: Again, ended_itself: bool = True) -> None:
    """Bit for bit; of a run that was cut off, as far as it went."""
    length = min(len(done.live), len(done.setpoints), done.off_path)
    if ended_itself:
        assert abs(len(done.live) - len(done.setpoints)) <= LOOKING
    np.testing.assert_array_equal(done.setpoints[:length], done.live[:length])


def assert_cut(done: Again, text: str, spot: Spot) -> None:
    """From the spot on every feed motion of the program, to its end, within 1e-6 mm.

    Of a spot behind the last of them nothing is left to cut, and no row is compared.
    """
    wanted = segments(text, done.stepped.machine, done.start)
    rows = program_rows(done.run.rows)  # rapids begin wherever the run did
    feeds = [number for number, segment in wanted.items() if segment.feed_mm_s is not None]
    cut = rows[np.isin(rows[:, COLUMN["motion_id"]], feeds)]
    far = distance(cut, wanted, done.stepped.kinematics)
    assert far < SAME_MM, far
    assert_rest_is_cut(done.run.rows, wanted, spot)
