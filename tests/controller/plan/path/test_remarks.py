"""What a check remarks of a path: a spindle that was never started, a change that turns a rotary."""

from __future__ import annotations

from dataclasses import replace

from support.machines.stepped_runs import shipped

from controller.machine import machine_file
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


SHOP = machine_file.load("shop")  # its changer has A at 0
PLANE = "G68.2 X0 Y0 Z0 I0 J20 K0\nG53.1\n"


def notes(text: str, machine: Machine = SHOP) -> list[tuple[int, str, str]]:
    """Line, key and axes of each note of a change; the path is gone through."""
    walk = checked.path_of(checked.task(f"G21 G90 G54\nT1 M6\n{text}M30\n".encode(), "p.ngc", machine))
    for _ in walk.items:
        pass
    found = [
        (one.place.line, str(one.said["key"]), str(one.said["values"].get("axes"))) for one in walk.notes
    ]
    return [row for row in found if row[1].startswith("note.change")]


def unturned() -> Machine:
    """The same machine, whose changer moves no rotary."""
    changer = SHOP.changer
    assert changer is not None
    rows = [
        tuple(replace(one, move=tuple(way for way in one.move if way[0] != "A")) for one in steps)
        for steps in (changer.put_away, changer.take)
    ]
    return replace(SHOP, changer=replace(changer, put_away=rows[0], take=rows[1]))


def test_a_change_that_leaves_a_rotary_elsewhere_is_told_with_both_places() -> None:
    assert notes("G53 G0 Z430\nG0 A30\nT2 M6\nG0 A15\nT1 M6\nT2 M6\n") == [
        (5, "note.change_turns", "A 30 -> 0"),
        (7, "note.change_turns", "A 15 -> 0"),
    ]


def test_in_a_tilted_plane_it_is_told_that_the_tool_no_longer_stands_along_it() -> None:
    assert notes(f"G53 G0 Z430\n{PLANE}T2 M6\nG53.1\n") == [(6, "note.change_leaves_plane", "A -20 -> 0")]


def test_a_change_without_a_rotary_in_its_steps_turns_none_and_is_not_told() -> None:
    assert notes(f"G53 G0 Z430\n{PLANE}T2 M6\n", unturned()) == []
    assert notes(f"G53 G0 Z430\n{PLANE}T2 M6\n", replace(SHOP, changer=None)) == []
