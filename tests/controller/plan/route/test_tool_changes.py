"""M6 by hand: where a program stops, for which tool, and what is told of it."""

from __future__ import annotations

import pytest
from cutting import shipped
from milling import mill

from controller import config
from controller.machine import Machine
from controller.plan.report.survey import survey
from controller.plan.route.stretch import Pause
from controller.plan.text.program import Act
from controller.session import checked
from controller.session.stepped import SteppedMachine

TRUNNION = shipped()
CLAMPED = mill()


def walked(text: str, in_spindle: int = 1, machine: Machine = TRUNNION) -> list[str]:
    """What comes on the path: the words of its pauses with the tool, and moves."""
    walk = checked.path_of(checked.task(text.encode(), "part.ngc", machine), in_spindle=in_spindle)
    return [
        f"{item.act.name} {item.modal.tool}" if isinstance(item, Pause) and item.act else "move"
        for item in walk.items
    ]


def test_another_tool_is_waited_for_and_the_one_that_is_there_is_not() -> None:
    text = "G21 G90\nT2 M6\nG53 G0 X10\nT2 M6\nT1 M6\nG53 G0 X0\n"
    here = ["TOOL 2", "STOP 2", "move", "TOOL 2", "TOOL 1", "STOP 1", "move"]
    assert walked(text) == here
    assert walked(text, in_spindle=2) == [here[0], *here[2:]]


def test_a_tool_that_is_not_known_is_asked_for_before_anything_moves() -> None:
    text = "G21 G90\nG53 G0 X10\nG53 G0 X0\n"
    assert walked(text) == ["move", "move"]
    assert walked(text, in_spindle=0) == walked(text, in_spindle=3) == ["TOOL 1", "STOP 1", "move", "move"]
    assert walked("G21 G90\nT2 M6\n" + text, in_spindle=0) == ["TOOL 2", "STOP 2", "move", "move"]


def test_a_clamp_that_is_open_for_the_next_move_stays_so() -> None:
    walk = checked.path_of(checked.task(b"G21 G90\nG53 G0 C10\n", "p", CLAMPED), in_spindle=2)
    pauses = [item for item in walk.items if isinstance(item, Pause)]
    assert [item.act for item in pauses] == [Act.CLAMP, Act.TOOL, Act.STOP]
    assert len({item.open_clamps for item in pauses}) == 1 and pauses[0].open_clamps


def test_check_names_the_changes_and_counts_on_the_machine_files_time_for_each() -> None:
    text = config.load("trunnion").text.replace("[tools]", "[tools]\nchange_s = 45.0")
    if "change_s" not in text:
        text = "[tools]\nchange_s = 45.0\n" + text
    machine = config.read(text, "mine.toml")
    task = checked.task(b"G21 G90\nT2 M6\nG53 G0 X10\nM0\nT1 M6\nG53 G0 X0\n", "part.ngc", machine)
    walk = checked.path_of(task)
    found = survey(walk.items, machine, task.kinematics)
    plain = checked.path_of(checked.task(b"G21 G90\nG53 G0 X10\nM0\nG53 G0 X0\n", "p", machine))
    assert found.waits_s - survey(plain.items, machine, task.kinematics).waits_s == pytest.approx(90.0)
    stops = [note for note in walk.notes if "is in the spindle" in note.sentence]
    assert [note.place.line for note in stops] == [2, 5]
    assert "T2 (end mill 3 mm)" in stops[0].sentence


def test_a_run_stands_at_the_change_until_the_operator_goes_on() -> None:
    bench = SteppedMachine(TRUNNION)
    bench.come_up()
    task = checked.task(b"G21 G90\nG53 G0 X10\nT2 M6\nG53 G0 X20\n", "part.ngc", TRUNNION)
    run = bench.run(checked.walk_of(task, None, False))
    assert (run.result, run.assumed_resumes) == ("completed", 1)
