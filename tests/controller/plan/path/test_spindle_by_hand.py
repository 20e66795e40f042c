"""A spindle that the operator switches: where a path stops for him, and where it needs no stop."""

from __future__ import annotations

from dataclasses import replace

import pytest
from support.machines.spindle_machine import mill
from support.machines.stepped_runs import shipped

from controller.machine import machine_file
from controller.machine.model import Machine
from controller.messages import text as in_words
from controller.plan.segment import ContinuousPath, PathItem
from controller.program.program import Act, ProgramError
from controller.runtime import checked

HAND = machine_file.load("trunnion")
NO_SPINDLE = replace(HAND, spindle=None)
STOPS = "Stops for the spindle, which is switched by hand:"
HEAD = "G21 G90 G54\nT1 M6\n"


def walked(program: str, machine: Machine = HAND, typed: bool = False) -> list[str]:
    """What comes along the path: moves, stops of the program, and how the operator is asked to turn it."""
    task = replace(checked.task(program.encode(), "part.ngc", machine), typed=typed)
    walk = checked.path_of(task, in_spindle=1)
    return [_named(one) for one in walk.items if isinstance(one, ContinuousPath) or one.act is Act.STOP]


def _named(item: PathItem) -> str:
    if isinstance(item, ContinuousPath):
        return "move"
    return f"turn {item.modal.spindle_rev_min:g}" if item.turns else "stop"


def test_each_change_before_a_motion_is_one_stop() -> None:
    assert walked(HEAD + "S800 M3\nG1 X5 F600\nS900\nG1 X6\nM4\nG1 X7\nM5\nG1 X8\nM30\n") == [
        *("turn 800", "move", "turn 900", "move", "turn -900", "move", "turn 0", "move"),
    ]
    assert walked(HEAD + "S800\nM3\nM8\nS850\nG1 X5 F600\nM30\n") == ["turn 850", "move"]


def test_what_is_as_before_is_not_asked() -> None:
    assert walked(HEAD + "S800 M3\nG1 X5 F600\nM5\nM3\nG1 X6\nS800\nG1 X7\nM30\n")[1:].count("turn 800") == 0
    assert walked(HEAD + "S800\nG1 X5 F600\nM5\nM30\n") == ["move"]


def test_at_the_end_of_a_program_nobody_is_asked() -> None:
    assert walked(HEAD + "S800 M3\nG1 X5 F600\nM5 M9\nM30\n") == ["turn 800", "move"]


def test_a_stop_of_the_program_is_that_stop() -> None:
    assert walked(HEAD + "S800 M3\nG1 X5 F600\nM5\nM0\nG1 X6\nM30\n") == [
        "turn 800",
        "move",
        "turn 0",
        "move",
    ]
    change = HEAD + "S800 M3\nG1 X5 F600\nT2 M6\nS900 M3\nG1 X6\nM30\n"
    assert walked(change) == ["turn 800", "move", "turn 0", "turn 900", "move"], "off for the change by hand"


def test_an_optional_stop_which_may_not_stop_is_none() -> None:
    assert walked(HEAD + "S800 M3\nG1 X5 F600\nM5\nM1\nG1 X6\nM30\n") == [
        "turn 800",
        "move",
        "turn 0",
        "move",
    ]


def test_a_line_by_hand_waits_for_him_too() -> None:
    assert walked("S800 M3\n", typed=True) == ["turn 800"]
    assert walked("M5\n", typed=True) == [], "it stood"


def test_a_driven_spindle_waits_for_nobody() -> None:
    assert walked(HEAD + "S800 M3\nG1 X5 F600\nM30\n", mill()) == ["move"]


def test_each_stop_is_told_by_check() -> None:
    task = checked.task((HEAD + "S800\nM3\nG1 X5 F600\nM5\nG1 X6\nM30\n").encode(), "part.ngc", HAND)
    found, kept = checked.looked_at(task)
    told = [(note.place.line, in_words(note.said)) for note in kept.notes]
    assert told == [
        (
            4,
            f"{STOPS} Switch the spindle on, clockwise (M3), 800 1/min.",
        ),
        (6, f"{STOPS} Switch the spindle off (M5)."),
    ]
    assert HAND.spindle is not None and found.waits_s == pytest.approx(2 * HAND.spindle.by_hand_s)


@pytest.mark.parametrize(("line", "word"), [("S800", "S800"), ("M3", "M3"), ("M4", "M4"), ("S0 M3", "S0")])
def test_without_a_spindle_its_words_are_refused_with_what_to_write(line: str, word: str) -> None:
    with pytest.raises(ProgramError) as why:
        walked(f"{HEAD}{line}\nG1 X5 F600\nM30\n", NO_SPINDLE)
    assert (why.value.line, why.value.said["key"]) == (3, "spindle.none")
    assert word in why.value.sentence and 'by = "hand"' in why.value.sentence
    assert walked(HEAD + "M5\nG1 X5 F600\nM30\n", NO_SPINDLE) == ["move"], "it stands"


def test_no_tap_with_a_spindle_that_nobody_turns_back_in_time() -> None:
    with pytest.raises(ProgramError) as why:
        walked(HEAD + "S100 M3\nG0 X0 Y0 Z20\nG84 Z-5 R2 F100\nM30\n")
    assert why.value.said["key"] == "cycle.tap_by_hand"


@pytest.mark.parametrize("name", machine_file.shipped())
def test_every_shipped_machine_has_a_spindle(name: str) -> None:
    spindle = machine_file.load(name).spindle
    assert spindle is not None and spindle.max_rev_min >= 12000.0


def test_a_ruled_surface_may_be_cut_though_no_word_has_started_it() -> None:
    task = checked.task(machine_file.shipped_program("example1").read_bytes(), "example1.ngc", shipped())
    assert list(checked.path_of(task).items)
