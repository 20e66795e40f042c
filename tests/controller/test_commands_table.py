"""The table of commands: whole, and read as it says."""

from __future__ import annotations

import inspect
import re
from typing import Any

import pytest
from support.fakes.fake_engine import FakeEngine, done, engine_of, served

from controller import messages
from controller.commands.table import ALL, COMMANDS, SWITCHED, Request
from controller.ipc.control_socket import CommandRefused
from controller.machine import setup_data
from controller.service.command_handlers import AT_ONCE, ERRANDS, CommandHandlers
from controller.service.preconditions import NEEDS
from controller.state.modes import ALWAYS, Mode
from controller.store import set_up_store


def test_every_command_is_carried_out_by_one_place_and_needs_what_there_is() -> None:
    assert len(COMMANDS) == len(ALL) and AT_ONCE.keys().isdisjoint(ERRANDS)
    assert AT_ONCE.keys() | ERRANDS.keys() <= COMMANDS.keys()
    for command in ALL:
        by_tick = command.name not in AT_ONCE and command.name not in ERRANDS
        assert not by_tick or command.request is not None, command.name
        assert set(command.needs) <= NEEDS.keys() and set(command.modes) <= {mode.name for mode in Mode}
    assert set(SWITCHED) == {Request.SINGLE_BLOCK, Request.OPTIONAL_STOP, Request.ADAPTIVE_FEED}
    assert set(SWITCHED) < ALWAYS


def test_what_is_told_to_take_long_is_what_the_sequencer_does() -> None:
    """But for an unload, which only waits for the end of the load that it has given up."""
    ways = re.compile(r"\.(sequence|begin)\(|_aside\(\w+,")
    long = {name for name, handler in AT_ONCE.items() if ways.search(inspect.getsource(handler))}
    assert {command.name for command in ALL if command.one_at_a_time} == long - {"unload"}


@pytest.fixture
def desk(tmp_path: Any) -> Any:
    service = served(tmp_path)
    made = CommandHandlers(service)
    yield made
    made.close()
    service.close()


REFUSED: tuple[tuple[str, dict[str, Any], str], ...] = (
    ("forget", {}, "name None: must be a text of 1 to 20 characters; correct it."),
    ("forget", {"name": ""}, "name '': must be a text of 1 to 20 characters; correct it."),
    ("override", {"share": float("nan")}, "share nan: must be a number from 0 to 2; correct it."),
    ("retract", {"mm": 0.0}, "mm 0.0: must be a number above 0, up to 1000; correct it."),
    ("optional_stop", {"on": 1}, "on 1: must be true or false; correct it."),
    ("jog_step", {"frame": "space", "axis": "X", "distance": 1.0}, "joint, part, tool"),
    ("jog_step", {"frame": "joint", "axis": "X"}, "distance None: must be a number from -1000 to 1000"),
    ("tool_life", {"tool": True}, "tool True: must be a whole number from 1 to 99999; correct it."),
    ("tool_life", {"tool": 99999}, "The tool table has no T99999."),
    ("tool_renewed", {"tool": 99999}, "The tool table has no T99999."),
)


@pytest.mark.parametrize(("verb", "args", "says"), REFUSED)
def test_what_is_no_argument_is_one_sentence_in_each_language(
    desk: CommandHandlers, verb: str, args: dict[str, Any], says: str
) -> None:
    with pytest.raises(CommandRefused) as error:
        done(desk, verb, **args)
    assert says in error.value.sentence and error.value.code in ("bad", "missing")
    assert messages.text(error.value.said, "de") not in ("", error.value.sentence)


def test_no_argument_whatever_keeps_a_stop_from_its_work(desk: CommandHandlers) -> None:
    engine: FakeEngine = engine_of(desk.service)
    for verb in ("stop", "estop"):
        done(desk, verb, press={"nested": [5]}, more=1)
    assert engine.requests[-2:] == [Request.STOP, Request.ESTOP]


def test_a_tool_that_is_changed_twice_keeps_its_wear_over_a_restart(desk: CommandHandlers) -> None:
    row = {"name": "", "radius_mm": 1.4, "length_mm": 8.0, "flute_mm": 15.0}
    done(desk, "set_tool", number=2, **row, wear_radius_mm=0.1)
    done(desk, "set_tool", number=2, **{**row, "length_mm": 9.0})
    after = setup_data.applied(desk.service.set_up.file, set_up_store.load(desk.service.state))
    for machine in (desk.service.set_up.machine, after):
        tool = next(one for one in machine.tools if one.number == 2)
        assert (tool.wear_radius_mm, tool.length_mm) == (0.1, 9.0)
