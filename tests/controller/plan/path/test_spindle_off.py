"""A cut with a spindle that was never started is told, once, with its line."""

from __future__ import annotations

from dataclasses import replace

from support.machines.stepped_runs import shipped

from controller.machine.model import Machine, Spindle
from controller.runtime import checked

MILL = replace(shipped(), spindle=Spindle(24000.0, "drive"))
MOVES = "G21 G90\nG0 X1.\nG1 X2. F600\nG1 X3.\n"


def lines(
    text: str, machine: Machine | None = None, key: str = "note.spindle_off", **how: object
) -> list[int]:
    """Those of which it is told."""
    task = checked.task(text.encode(), "part.ngc", machine or MILL)
    task = replace(task, typed=bool(how.pop("typed", False)))
    walk = checked.path_of(task, **how)  # type: ignore[arg-type]
    for _ in walk.items:
        pass
    return [note.place.line for note in walk.notes if note.said["key"] == key]


def test_the_first_feed_move_is_told_and_no_other() -> None:
    assert lines(MOVES) == [3]
    assert lines("S1000\n" + MOVES) == [4]
    assert lines("M3\n" + MOVES) == [4], "without S it does not turn"


def test_a_spindle_that_was_started_or_is_none_is_not_told() -> None:
    assert lines("S1000 M3\n" + MOVES) == []
    assert lines("S1000 M4\n" + MOVES + "M5\nG1 X4.\n") == []
    assert lines(MOVES, replace(MILL, spindle=None)) == []
    assert lines("G21 G90\nG0 X1.\n") == []


def test_neither_a_line_by_hand_nor_a_dry_run_is_told() -> None:
    assert lines(MOVES, in_spindle=1, typed=True) == []
    assert lines(MOVES, dry_run_mm=10.0) == []


def test_a_spindle_that_the_operator_switches_may_turn_already() -> None:
    assert lines(MOVES, replace(MILL, spindle=Spindle(24000.0))) == []
