"""What is told of the contour error, of rows that were made up."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from support.machines.stepped_runs import shipped

from controller.ipc.handoff import COLUMN, ROW, of_axes
from controller.runtime.contour_error import Demand
from controller.runtime.contour_watch import ContourWatch, Excess, reaction
from controller.state.live_state import OFF_PATH
from controller.state.modes import Request

MACHINE = shipped()
AXES = len(MACHINE.axes)
X, Y = 0, 1
TOLERANCE = 0.05
LATE = 5  # ticks from a command to the drives


@dataclass
class Drives:
    """A diagonal at 0.2 mm a tick, and drives that follow it ``LATE`` ticks later."""

    ticks: int = 400

    def __post_init__(self) -> None:
        n = np.arange(self.ticks)
        self.command, self.actual = np.zeros((self.ticks, AXES)), np.zeros((self.ticks, AXES))
        self.command[:, [X, Y]] = 0.2 * n[:, None] * np.array([0.8, 0.6])
        self.actual[:, [X, Y]] = 0.2 * np.maximum(n - LATE, 0)[:, None] * np.array([0.8, 0.6])
        self.motion = np.full(self.ticks, 3)
        self.switches = np.zeros(self.ticks)

    def off(self, axis: int, first: int, count: int, mm: float) -> Drives:
        self.actual[first : first + count, axis] += mm
        return self

    def lost(self, axis: int, first: int, count: int) -> Drives:
        """So many positions in a row are not heard."""
        self.actual[first : first + count, axis] = self.actual[first - 1, axis]
        return self

    @property
    def rows(self) -> np.ndarray:
        rows = np.zeros((self.ticks, len(ROW)))
        rows[:, COLUMN["tick"]] = 1000 + np.arange(self.ticks)
        rows[:, COLUMN["motion_id"]], rows[:, COLUMN["line"]] = self.motion, 10 * self.motion
        rows[:, COLUMN["s"]] = 0.2 * np.arange(self.ticks)
        rows[:, COLUMN["switches"]] = self.switches
        rows[:, of_axes("joint_command", AXES)], rows[:, of_axes("actual", AXES)] = self.command, self.actual
        return rows


def demands(motion_id: int, _: float = 0.0) -> Demand | None:
    """Motions from 3 on are at feed, 7 with a longer tool, 8 without a tolerance."""
    if motion_id < 3:
        return None
    tolerance = float("inf") if motion_id == 8 else TOLERANCE
    return Demand(80.0 if motion_id == 7 else 60.0, 15.0, tolerance)


def watched(drives: Drives, *cuts: int) -> ContourWatch:
    """``cuts``: where the rows are parted."""
    watch = ContourWatch(MACHINE, demands)
    watch.portion = 1
    for part in np.split(drives.rows, cuts):
        watch.take(part)
    watch.see_all()
    return watch


def only(drives: Drives) -> Excess:
    (found,) = watched(drives).excesses
    return found


def test_being_late_is_no_contour_error() -> None:
    watch = watched(Drives())
    assert watch.excesses == [] and watch.largest is not None and watch.largest.mm < 1e-9
    assert watch.by_line.keys() == {30}


def test_ten_ticks_are_reported_with_place_and_axis_and_nine_are_not() -> None:
    # Beside the diagonal it is off by 0.8 of what Y alone is off.
    found = only(Drives().off(Y, 200, 10, 0.1))
    assert (found.tick, found.ticks, found.over) == (1200, 10, True)
    assert (found.largest.line, found.largest.axis) == (30, Y)
    assert found.largest.mm == pytest.approx(0.08)
    # Where the path is nearest: Y ahead by 0.1 mm leads 0.06 mm along the diagonal.
    assert abs(found.largest.s - 0.2 * (found.largest.tick - 1000 - LATE)) < 0.2
    nine = watched(Drives().off(Y, 200, 9, 0.1))
    assert nine.excesses == [] and nine.by_line[30] == pytest.approx(0.08)


def test_it_is_reported_while_it_lasts_and_once_more_when_it_is_over() -> None:
    rows, watch = Drives().off(X, 200, 40, -0.2).rows, ContourWatch(MACHINE, demands)
    watch.portion = 1
    told = [(k, one.over, one.ticks) for k in range(len(rows)) for one in watch.take(rows[k : k + 1])]
    assert told == [(209, False, 10), (240, True, 40)]
    assert watch.excesses[0].largest.axis == X


@pytest.mark.parametrize("seed", range(5))
def test_portions_change_nothing(seed: int) -> None:
    rng = np.random.default_rng(seed)
    drives = Drives().off(X, 100, 30, 0.3).off(Y, 250, 12, 0.1).lost(Y, 300, 2)
    drives.motion[220:] = 4
    whole, parts = watched(drives), watched(drives, *sorted(rng.integers(1, 399, 12)))
    assert parts.to_dict()["lines"] == pytest.approx(whole.to_dict()["lines"])
    assert [(one.tick, one.ticks) for one in parts.excesses] == [(1100, 30), (1250, 12)]


def test_a_position_that_was_not_heard_shows_no_error_but_one_that_stands_does() -> None:
    """Frames are lost now and then; a drive that does not move any more is another matter."""
    drives = Drives()
    for k in range(100, 300, 5):
        drives.lost(Y, k, 2)
    assert watched(drives).excesses == []
    assert only(Drives().lost(Y, 200, 30)).largest.axis == Y


def test_what_is_no_motion_at_feed_is_not_held_against_a_tolerance() -> None:
    rapid, loose = Drives().off(Y, 200, 50, 1.0), Drives().off(Y, 200, 50, 1.0)
    rapid.motion[:], loose.motion[:] = 2, 8
    assert watched(rapid).excesses == [] and watched(rapid).largest is None
    found = watched(loose)
    assert found.excesses == [] and found.largest is not None and found.largest.mm == pytest.approx(0.8)
    assert found.to_dict()["largest"]["tolerance_mm"] is None


def test_each_line_of_a_motion_has_its_own_tolerance() -> None:
    """A row of lines is one motion, and R of G41 may change within it."""
    drives = Drives().off(Y, 100, 50, 0.3).off(Y, 250, 50, 0.3)
    rows = drives.rows
    rows[200:, COLUMN["line"]] += 1

    def two(motion_id: int, s: float) -> Demand | None:
        found = demands(motion_id)
        return found if found is None or s >= rows[200, COLUMN["s"]] else found._replace(tolerance_mm=1.0)

    for cuts in ((), (120, 260), (199, 200, 201)):
        watch = ContourWatch(MACHINE, two)
        for part in np.split(rows, cuts):
            watch.take(part)
        watch.see_all()
        (one,) = watch.excesses
        assert one.tick == 1250 and one.largest.tolerance_mm == TOLERANCE


def test_commands_that_follow_the_drives_are_no_path() -> None:
    drives = Drives().off(Y, 200, 50, 1.0)
    drives.switches[190:] = OFF_PATH
    assert watched(drives).excesses == []


def test_another_tool_is_another_path() -> None:
    """The tip jumps with its length where the machine stands."""
    drives = Drives()
    drives.motion[200:] = 7
    assert watched(drives).excesses == []


def test_one_drive_that_is_always_later_is_the_one_that_is_named() -> None:
    """Though on a line along X alone nobody can see it: there it is late, and on its path."""
    drives, n = Drives(800), np.arange(800)
    drives.command[400:, X] = drives.command[400, X] + 0.2 * (n[400:] - 400)
    drives.command[400:500, Y] = drives.command[400, Y]
    drives.command[500:, Y] = drives.command[400, Y] + 0.2 * (n[500:] - 500)
    drives.actual = drives.command[np.maximum(n - LATE, 0)].copy()
    drives.actual[400:, X] = drives.command[400 - LATE - 2 : -LATE - 2, X]
    told = watched(drives).excesses
    assert told and all(one.largest.axis == X for one in told)


def test_a_turned_tool_is_seen_at_the_top_of_its_flute() -> None:
    """A is off about the tip itself: 15 mm above it that is 0.26 mm."""
    a = next(i for i, axis in enumerate(MACHINE.axes) if axis.name == "A")
    drives = Drives()
    drives.command[:, [X, Y]] = drives.actual[:, [X, Y]] = 0.0
    found = only(drives.off(a, 200, 20, np.radians(1.0)))
    assert found.largest.axis == a and found.largest.mm > 0.2


def test_what_the_machine_file_says() -> None:
    assert reaction(MACHINE, 1.0) is None
    slow, hold = (replace(MACHINE, contour_error=word) for word in ("slow", "hold"))
    assert reaction(hold, 1.0) == (Request.HOLD, 0.0)
    assert [reaction(slow, share) for share in (1.0, 0.15, 0.1)] == [
        (Request.OVERRIDE, 0.5),
        (Request.OVERRIDE, 0.1),
        None,
    ]
