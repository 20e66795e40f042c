"""M6 by hand: where a program stops, for which tool, and what is told of it."""

from __future__ import annotations

import contextlib
from dataclasses import replace
from pathlib import Path

import pytest
from support.machines.spindle_machine import mill
from support.machines.stepped_runs import shipped

from controller import own_database
from controller.machine import machine_file
from controller.machine.model import Machine
from controller.plan.report.survey import survey
from controller.plan.segment import Pause
from controller.program.program import Act
from controller.runtime import checked
from controller.runtime.stepped import SteppedMachine
from controller.service.alarms import Alarms
from controller.service.set_up import SetUp
from controller.store import service_store
from controller.store.service_store import ServiceStore
from controller.store.set_up_store import SPINDLE

TRUNNION = shipped()
CLAMPED = mill()


def walked(text: str, in_spindle: int = 1, machine: Machine = TRUNNION, typed: bool = False) -> list[str]:
    """What comes on the path: the words of its pauses with the tool, and moves."""
    task = replace(checked.task(text.encode(), "part.ngc", machine), typed=typed)
    walk = checked.path_of(task, in_spindle=in_spindle)
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


def test_a_line_by_hand_means_the_tool_that_is_there_until_it_names_one() -> None:
    moves = "G21 G90\nM3 S100\nG53 G0 X10\n"
    for in_spindle in (0, 1, 3):
        assert "STOP 1" not in walked(moves, in_spindle, typed=True)
        assert walked(moves + "T2 M6\nG53 G0 X0\n", in_spindle, typed=True)[-3:] == [
            "TOOL 2",
            "STOP 2",
            "move",
        ]


def test_a_clamp_that_is_open_for_the_next_move_stays_so() -> None:
    walk = checked.path_of(checked.task(b"G21 G90\nG53 G0 C10\n", "p", CLAMPED), in_spindle=2)
    pauses = [item for item in walk.items if isinstance(item, Pause)]
    assert [item.act for item in pauses] == [Act.CLAMP, Act.TOOL, Act.STOP]
    assert len({item.open_clamps for item in pauses}) == 1 and pauses[0].open_clamps


def test_check_names_the_changes_and_counts_on_the_machine_files_time_for_each() -> None:
    text = machine_file.load("trunnion").text.replace("change_s = 60.0", "change_s = 45.0")
    machine = machine_file.read(text, "mine.toml")
    task = checked.task(b"G21 G90\nT2 M6\nG53 G0 X10\nM0\nT1 M6\nG53 G0 X0\n", "part.ngc", machine)
    walk = checked.path_of(task, in_spindle=1)
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
    run = bench.run(checked.path_of(task, checked.chosen_for(task), in_spindle=1))
    assert (run.result, run.assumed_resumes) == ("completed", 1)


def test_the_tool_in_the_spindle_is_known_after_a_loss_of_power(tmp_path: Path) -> None:
    def known() -> int:
        """By the next service."""
        with contextlib.closing(ServiceStore(tmp_path)) as store:
            return SetUp(TRUNNION, store, Alarms(store), lambda tool: None).tool

    def damage(more: str) -> None:
        """By who keeps no sums, as a bad bit."""
        with contextlib.closing(own_database.opened(tmp_path / service_store.FILE)) as sql:
            newest = "generation = (SELECT max(generation) FROM documents WHERE name = 'in_spindle')"
            sql.execute(f"{more} WHERE name = 'in_spindle' AND {newest}")

    assert known() == 1
    for more in ("UPDATE documents SET value = '7'", "DELETE FROM documents"):
        service_store.put(tmp_path, SPINDLE, 3)
        assert known() == 3
        damage(more)
        assert known() == 0, "the one before is not the one in the spindle"
        assert known() == 0, "nor is it to the service after that"
    service_store.put(tmp_path, SPINDLE, 5)
    damage("UPDATE documents SET generation = generation + 1")
    assert known() == 0
