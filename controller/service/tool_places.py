"""Where the tools of a changer are, as the door has it: asked, confirmed by an operator, given a pocket."""

from __future__ import annotations

import sqlite3
from typing import Any

from controller.ipc.control_socket import Values
from controller.machine import setup_data, tool_store
from controller.machine.model import Machine
from controller.service import fitting
from controller.service.refusals import refused
from controller.service.service import Service
from controller.service.tool_changer import ToolChanger

LOGGED = ("time_s", "what", "tool_out", "tool_in", "step", "name")


def to_json(service: Service) -> Values:
    """Spindle, pockets, doubts and the last steps. Raises CommandRefused."""
    changer = _changer_of(service)
    return {**changer.to_json(), "log": [dict(zip(LOGGED, row, strict=True)) for row in changer.store.log()]}


def confirm(service: Service, values: Values) -> Values:
    """Where every tool is, as an operator has seen it, and that the changer stands clear.

    ``spindle``: the tool in it, 0 = none; ``away``: tools out of the machine; each other one is in its
    pocket. Raises CommandRefused.
    """
    changer = _changer_of(service)
    if not values["clear"]:
        raise refused("changer_not_clear", code="bad")
    spindle, away = values["spindle"], values["away"]
    _known(service, [spindle, *away])
    if spindle and spindle in away:
        raise refused("changer_twice", code="bad", tool=spindle)
    try:
        changer.store.confirm(tool_store.placed(_pockets(service.set_up.machine), spindle, away))
    except sqlite3.Error as error:
        raise refused("not_written", code="busy", path=service.state, why=str(error)) from error
    service.run.change_tool(changer.whereabouts.spindle)
    return changer.to_json()


def give_pocket(service: Service, values: Values) -> Values:
    """Whose a pocket is; from then on somebody must confirm where the tools are. Raises CommandRefused."""
    changer = _changer_of(service)
    with fitting.at_rest(service, "pockets", "SET POCKETS"):
        machine = setup_data.with_pocket(service.set_up.machine, str(values["pocket"]), values["tool"])
        changer.store.forget()
        pockets = {str(number): its for number, its in enumerate(_pockets(machine), 1)}
        service.set_up.fit(machine, {**service.set_up.fitted, "pockets": pockets})
    return changer.to_json()


def _changer_of(service: Service) -> ToolChanger:
    if service.changer is None:
        raise refused("no_changer", code="bad")
    return service.changer


def _pockets(machine: Machine) -> tuple[int, ...]:
    """The tool of each pocket, 0 = nobody's."""
    return machine.changer.pockets if machine.changer is not None else ()


def _known(service: Service, tools: list[Any]) -> None:
    known = service.set_up.tool_numbers
    for tool in tools:
        if type(tool) is not int or (tool not in known and tool != 0):
            allowed = ", ".join(f"T{number}" for number in sorted(known))
            raise refused("changer_no_tool", code="bad", tool=tool, allowed=allowed)
