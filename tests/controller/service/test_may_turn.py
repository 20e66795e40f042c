"""The spindle turns with no probe in it, and with no tool faster than this bears, whoever asks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from support.fakes.fake_engine import done, engine_of, served
from support.machines.stepped_runs import shipped

from controller.ipc.control_socket import CommandRefused
from controller.machine.model import Machine
from controller.plan.segment import Pause
from controller.program.program import Act, ProgramError
from controller.runtime import checked
from controller.service.command_handlers import CommandHandlers
from controller.state.modes import Request

CHANGER = shipped("machining_centre")  # its probe is T99
BY_HAND = replace(CHANGER, changer=None)


def fitted(machine: Machine, may_turn: bool, number: int = 99) -> Machine:
    tools = [replace(t, may_turn=may_turn) if t.number == number else t for t in machine.tools]
    return replace(machine, tools=tuple(tools))


def acts(
    text: str, machine: Machine, in_spindle: int | None = None, typed: bool = False
) -> list[tuple[Act, float]]:
    """Where the path waits, and the spindle then. Raises ProgramError."""
    task = replace(checked.task(text.encode(), "part.ngc", machine), typed=typed)
    walk = checked.path_of(task, in_spindle=in_spindle)
    return [(one.act, one.modal.spindle_rev_min) for one in walk.items if isinstance(one, Pause)]


@pytest.mark.parametrize(
    ("text", "line"),
    [("T99 M6\nS1000\nM3\n", 3), ("T99 M6\nM4 S200\n", 2), ("S1000 M3\nT99 M6\nG43 H99\nM3\n", 4)],
)
@pytest.mark.parametrize("machine", [CHANGER, BY_HAND])
def test_a_program_is_refused_at_the_line_that_would_turn_it(text: str, line: int, machine: Machine) -> None:
    with pytest.raises(ProgramError) as told:
        acts(text, machine)
    assert (told.value.line, told.value.said["key"]) == (line, "spindle.must_stand")
    assert acts(text, fitted(machine, True))[-1] != (Act.SPINDLE, 0.0), "unless the tool says that it may"


def test_a_tool_that_is_no_probe_may_be_forbidden_to_turn_too() -> None:
    with pytest.raises(ProgramError, match="T2"):
        acts("T2 M6\nM3 S100\n", fitted(CHANGER, False, 2))
    assert acts("T2 M6\nM3 S100\n", CHANGER)


def test_a_turning_spindle_is_not_said_to_hold_the_probe() -> None:
    with pytest.raises(ProgramError) as told:
        acts("S500 M3\nM61 Q99\n", BY_HAND)
    assert (told.value.line, told.value.said["key"]) == (2, "spindle.must_stand")


def test_a_line_by_hand_means_the_probe_that_is_there() -> None:
    with pytest.raises(ProgramError) as told:
        acts("S500 M3\n", BY_HAND, in_spindle=99, typed=True)
    assert told.value.said["key"] == "spindle.must_stand"
    assert acts("S500 M3\n", BY_HAND, in_spindle=2, typed=True) == [(Act.SPINDLE, 500.0)]


def test_a_program_without_a_tool_word_asks_for_its_tool_before_the_spindle_turns() -> None:
    found = acts("S500 M3\nG1 X5 F100\n", BY_HAND, in_spindle=99)
    assert found[:3] == [(Act.TOOL, 0.0), (Act.STOP, 0.0), (Act.SPINDLE, 500.0)]


def test_by_hand_it_is_refused_as_long_as_the_probe_is_there(tmp_path: Path) -> None:
    service = served(tmp_path, BY_HAND)
    desk, asked = CommandHandlers(service), engine_of(service).requests
    service.set_up.put_in(99)
    with pytest.raises(CommandRefused, match="T99"):
        done(desk, "spindle", rev_min=300.0)
    assert asked == []
    done(desk, "spindle", rev_min=0.0)
    service.set_up.put_in(2)
    done(desk, "spindle", rev_min=300.0)
    assert asked == [Request.SPINDLE, Request.SPINDLE]


SLOW = replace(
    BY_HAND, tools=tuple(replace(t, max_rev_min=800.0) if t.number == 2 else t for t in CHANGER.tools)
)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("S900\nT2 M6\nM3\n", 3),
        ("T2 M6\nM4 S801\n", 2),
        ("T2 M6\nS800 M3\nG1 X1 F100\nS801\n", 4),
        ("S900 M3\nM61 Q2\n", 2),
    ],
)
def test_a_program_is_refused_at_the_line_that_turns_a_tool_too_fast(text: str, line: int) -> None:
    with pytest.raises(ProgramError, match="T2") as found:
        acts(text, SLOW)
    assert (found.value.line, found.value.said["key"]) == (line, "spindle.too_fast_for_tool")
    assert acts(text, BY_HAND)
    assert acts(text.replace("T2", "T3").replace("Q2", "Q3"), SLOW), "another tool bears it"


def test_what_it_bears_turns() -> None:
    assert (Act.SPINDLE, 800.0) in acts("T2 M6\nS800 M3\n", SLOW)


def test_by_hand_a_tool_is_turned_no_faster_than_it_bears(tmp_path: Path) -> None:
    service = served(tmp_path, SLOW)
    commands, asked = CommandHandlers(service), engine_of(service).requests
    service.set_up.put_in(2)
    with pytest.raises(CommandRefused, match="800"):
        done(commands, "spindle", rev_min=-801.0)
    assert asked == []
    done(commands, "spindle", rev_min=-800.0)
    service.set_up.put_in(3)
    done(commands, "spindle", rev_min=801.0)
    assert asked == [Request.SPINDLE, Request.SPINDLE]


def test_a_line_by_hand_means_the_slow_tool_that_is_there() -> None:
    with pytest.raises(ProgramError) as found:
        acts("S900 M3\n", SLOW, in_spindle=2, typed=True)
    assert found.value.said["key"] == "spindle.too_fast_for_tool"
    assert acts("S800 M4\n", SLOW, in_spindle=2, typed=True) == [(Act.SPINDLE, -800.0)]


def test_a_program_asks_for_its_tool_before_the_slow_one_that_is_there_turns_too_fast() -> None:
    found = acts("S900 M3\nG1 X5 F100\n", SLOW, in_spindle=2)
    assert found[:3] == [(Act.TOOL, 0.0), (Act.STOP, 0.0), (Act.SPINDLE, 900.0)]
