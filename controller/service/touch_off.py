"""Touching off: a work offset, or the length of a tool, from what a figure is to read where the tool stands.

What is set is the work figure (``state.figures``) in the state that is in force, so that ``G0 Z0`` stands on
what was touched when Z was to read 0 there.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from controller.geometry.vectors import add, subtract
from controller.ipc.handoff import Snapshot
from controller.machine.kinematics import kinematics_of
from controller.machine.model import OFFSETS, Joints, Machine, Offset, Tool
from controller.machine.toml_table import Table
from controller.program import dynamic_offset
from controller.program.expressions import Values
from controller.program.modal import State
from controller.program.parameters import Parameters
from controller.program.program import ProgramError
from controller.service.refusals import number, refused
from controller.service.status import reading
from controller.state import figures

MAX_READING = 1e5  # mm or degrees
_ARITHMETIC = re.compile(r"[-+*/(). 0-9]{1,100}")
_TWO_NUMBERS = re.compile(r"[0-9.] +[0-9.]")


def figure(typed: object, now: float) -> float:
    """What a figure is to read: a number, or arithmetic as ``5/2`` and ``(3+1)*2``, with point or comma.

    What begins with + is so much more than what it reads ``now``. Raises CommandRefused.
    """
    if not isinstance(typed, str):
        return number({"figure": typed}, "figure", -MAX_READING, MAX_READING)
    text = typed.strip().replace(",", ".").replace("−", "-")
    more, text = text.startswith("+"), text.removeprefix("+")
    if _ARITHMETIC.fullmatch(text) and not _TWO_NUMBERS.search(text):
        values = Values(f"[{text}]".replace("(", "[").replace(")", "]"), "", 1, Parameters())
        with contextlib.suppress(ProgramError):
            value = values.bracket()
            if not values.peek():
                return number({"figure": now + value if more else value}, "figure", -MAX_READING, MAX_READING)
    raise refused("no_figure", code="bad", typed=typed[:100])


def check_homed(machine: Machine, now: Snapshot) -> None:
    """Without its zero an axis says nothing. Raises CommandRefused."""
    lost = ~now.homed | now.untrusted
    if axes := ", ".join(axis.name for i, axis in enumerate(machine.axes) if lost >> i & 1):
        raise refused("tip_not_homed", now.mode.name, "TOUCH OFF", axes=axes)


def offset(
    machine: Machine, state: State, joints: Joints, name: str, reads: object, tool: int | None = None
) -> Offset:
    """The work offset in which each axis of ``reads`` reads so, were it the active one.

    ``tool``: as under G43 with that one; None: with the length that is in force. Raises CommandRefused,
    ConfigError.
    """
    index = OFFSETS.index(Table("offsets", "offset", {"name": name}).text("name", OFFSETS))
    state = state.with_origins(replace(state.origins, index=index), machine)
    kinematics = kinematics_of(machine)
    read = reading(machine, kinematics, joints, state)
    if tool is not None:
        read = read._replace(length_mm=_tool(machine, tool).worn.length_mm)
    now = figures.work(machine, kinematics, joints, read)
    wanted = _target_readings(machine, now, reads)
    before = state.origins.offset(index, machine)
    found = figures.offset_for(machine, now, read, before, wanted)
    state = dynamic_offset.standing(state, machine.pair(joints, 0.0), machine, kinematics)
    if (following := state.origins.following) is None:
        return found
    origin = before.frame.origin
    way = following.set_down(subtract(found.frame.origin, origin))
    return replace(found, frame=found.frame._replace(origin=add(origin, way)))


def tool(machine: Machine, state: State, joints: Joints, number_: int, reads: object) -> Tool:
    """The tool with whose length in force X, Y or Z of ``reads`` reads so. It is worn no more.

    Raises CommandRefused.
    """
    found, kinematics = _tool(machine, number_), kinematics_of(machine)
    read = reading(machine, kinematics, joints, state)._replace(length_mm=found.worn.length_mm)
    now = figures.work(machine, kinematics, joints, read)
    wanted = _target_readings(machine, now, reads)
    (letter, value), *others = wanted.items()
    if others or letter not in "XYZ":
        raise refused("one_reading", code="bad")
    less_mm = now[[axis.name for axis in machine.axes].index(letter)] - value
    length_mm = figures.length_for(kinematics, joints, read, letter, less_mm)
    if length_mm is None:
        raise refused("across_tool", axis=letter)
    return replace(found, length_mm=length_mm, wear_length_mm=0.0)


def _tool(machine: Machine, number_: int) -> Tool:
    found = machine.table_tool(number_)
    if found is None:
        raise refused("no_tool", number=number_)
    return found


def _target_readings(machine: Machine, now: figures.Figures, reads: object) -> Mapping[str, float]:
    """The value that each axis is to read. Raises CommandRefused."""
    typed: dict[str, Any] = reads if isinstance(reads, dict) else {}
    shown = dict(zip((axis.name for axis in machine.axes), now, strict=True))
    if not typed:
        raise refused("no_reading", code="bad")
    if unknown := [name for name in typed if name not in shown]:
        raise refused("no_axis", code="bad", axis=unknown[0], allowed=", ".join(shown))
    return {name: figure(value, shown[name]) for name, value in typed.items()}
