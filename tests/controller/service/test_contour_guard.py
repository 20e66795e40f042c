"""A contour error of a run at the service: its alarms, what is asked of the tick, what its record has."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.machines.stepped_runs import shipped

from controller.ipc.control_socket import CommandRefused
from controller.ipc.handoff import COLUMN, ROW, Snapshot, blank, of_axes
from controller.machine.model import Machine
from controller.program import modal
from controller.runtime.plan_messages import MotionFacts
from controller.service.alarms import Alarms
from controller.service.contour_guard import ContourGuard
from controller.state.modes import Mode, Request

MACHINE = shipped()
AXES = len(MACHINE.axes)
NOW = blank(AXES)._replace(mode=Mode.RUNNING, override=1.0)


class Tick:
    """What is asked of it; gone: it refuses."""

    def __init__(self, gone: bool = False) -> None:
        self.asked: list[tuple[Request, float]] = []
        self.gone = gone

    def request(self, request: Request, value: float = 0.0) -> int:
        if self.gone:
            raise CommandRefused("unreachable", {"key": "x", "values": {}}, "")  # type: ignore[arg-type]
        self.asked.append((request, value))
        return len(self.asked)


class Service:
    """A guard with what it needs."""

    def __init__(self, folder: Path, tick: Tick | None = None, **machine: Any) -> None:
        self.tick, self.alarms = tick or Tick(), Alarms(folder)
        self.machine: Machine = replace(MACHINE, **machine)
        self.guard = ContourGuard(self.alarms, self.tick)  # type: ignore[arg-type]
        self.guard.begin(self.machine)
        self.n = 0

    def send(self, ways: Mapping[int, float | None]) -> None:
        """Motions, by their feed."""
        joints, state = (0.0,) * AXES, modal.power_on()
        made = {number: MotionFacts(joints, feed, "line", 1, state) for number, feed in ways.items()}
        self.guard.hear(made, self.machine)

    def run(self, motion: int, ticks: int, off_mm: float = 0.0, now: Snapshot = NOW) -> None:
        """Along X; Y is off by so much."""
        n = np.arange(self.n, self.n + ticks)
        self.n += ticks
        rows = np.zeros((ticks, len(ROW)))
        rows[:, COLUMN["tick"]], rows[:, COLUMN["motion_id"]] = n, motion
        rows[:, COLUMN["line"]], rows[:, COLUMN["sync_sent"]] = 10 * motion, 1.0
        rows[:, of_axes("joint_command", AXES)][:, 0] = 0.1 * n
        rows[:, of_axes("actual", AXES)][:, 0] = 0.1 * np.maximum(n - 5, 0)
        rows[:, of_axes("actual", AXES)][:, 1] = off_mm
        for part in np.array_split(rows, max(1, ticks // 10)):
            self.guard.take(part, self.machine, now)


def test_one_alarm_a_line_with_the_largest_of_its_errors(tmp_path: Path) -> None:
    service = Service(tmp_path)
    service.send({1: 20.0, 2: 20.0, 3: None})
    service.run(1, 300)
    for off in (0.1, 0.3, 0.2):
        service.run(1, 30, off)
        service.run(1, 300)
    service.run(2, 100)
    service.run(2, 40, 0.07)
    service.run(2, 300)
    service.run(3, 100)
    service.run(3, 300, 1.0)  # a rapid
    newest, oldest = service.alarms.list()
    assert {one["name"] for one in (newest, oldest)} == {"CONTOUR_ERROR"}
    assert (oldest["line"], oldest["axis"], oldest["values"]["largest"]) == (10, "Y", pytest.approx(0.3))
    assert (newest["line"], newest["values"]["largest"]) == (20, pytest.approx(0.07))
    facts = service.guard.end()["contour_error"]
    assert [one["line"] for one in facts["excesses"]] == [10, 10, 10, 20]
    assert facts["largest"]["largest_mm"] == pytest.approx(0.3) and facts["largest"]["line"] == 10
    assert service.tick.asked == [] and service.guard.end() == {}


def test_motions_that_are_passed_are_forgotten_and_still_known_for_the_rows_that_wait(tmp_path: Path) -> None:
    service = Service(tmp_path)
    service.send({number: 20.0 for number in range(1, 400)})
    for motion in range(1, 400):
        service.run(motion, 3, 0.2)
    assert len(service.guard._demands) < 100
    watch = service.guard._watch
    service.guard.end()
    assert watch is not None and watch.by_line.keys() == {10 * motion for motion in range(1, 399)}


@pytest.mark.parametrize(
    ("word", "wanted"), [("hold", (Request.HOLD, 0.0)), ("slow", (Request.OVERRIDE, 0.5))]
)
def test_what_the_machine_file_says_is_asked_once_for_an_error(
    tmp_path: Path, word: str, wanted: tuple[Request, float]
) -> None:
    service = Service(tmp_path, contour_error=word)
    service.send({1: 20.0})
    service.run(1, 300)
    service.run(1, 200, 0.2)
    assert service.tick.asked == [wanted]
    service.run(1, 200)
    service.run(1, 200, 0.2, NOW._replace(mode=Mode.HOLD))  # it stands already
    assert service.tick.asked == [wanted] and len(service.alarms.list()) == 1


def test_a_tick_that_is_gone_costs_no_alarm(tmp_path: Path) -> None:
    service = Service(tmp_path, Tick(gone=True), contour_error="hold")
    service.send({1: 20.0})
    service.run(1, 200, 0.2)
    assert len(service.alarms.list()) == 1


def test_each_line_of_a_row_has_its_own_tolerance(tmp_path: Path) -> None:
    service = Service(tmp_path)
    power_on = modal.power_on()
    loose = power_on._replace(modal=replace(power_on.modal, tolerance_mm=1.0))
    way = MotionFacts(
        (0.0,) * AXES, 20.0, "line", 1, power_on, states=((0.0, power_on), (5.0, loose), (8.0, power_on))
    )
    service.guard.hear({1: way}, service.machine)
    found = [service.guard._demand(1, s) for s in (0.0, 4.9, 5.0, 7.9, 8.0)]
    usual = found[0].tolerance_mm if found[0] is not None else None
    assert usual != 1.0 and [one and one.tolerance_mm for one in found] == [usual, usual, 1.0, 1.0, usual]
    assert service.guard._demand(2, 0.0) is None


def test_the_record_has_what_the_drives_have_missed_since_the_run_began(tmp_path: Path) -> None:
    service = Service(tmp_path)
    service.send({1: 20.0})
    begin = NOW._replace(missed=(3, -1, *NOW.missed[2:]), overdue=(1, 0, *NOW.overdue[2:]))
    service.run(1, 20, now=begin)
    service.run(1, 20, now=begin._replace(missed=(7, 2, *NOW.missed[2:])))
    counts = service.guard.end()["setpoints"]
    assert list(counts) == [axis.name for axis in service.machine.axes]
    assert counts["X"] == {"missed": 4, "overdue": 0} and counts["Y"] == {"missed": 2, "overdue": 0}
