"""``directrix explain``: what a program asks for, one canonical motion or function per line."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Literal

from controller.cli import fitted as fittings
from controller.machine import machine_file
from controller.plan.report import explained
from controller.plan.report.explained import Step
from controller.program import blocks, linked, position
from controller.verify import tables
from controller.verify.console import Refused, refusals, say, spoken


def explain(
    program: Path,
    machine: str = "trunnion",
    dialect: Literal["rs274", "fanuc"] | None = None,
    fitted: Path | None = None,
    as_json: bool = False,
) -> None:
    """Print the canonical motions of a program, one per line; nothing is planned and nothing moves.

    Positions are those at the end of each, from the homed position on: of the program, then of the axes.
    """
    with refusals(as_json):
        made = fittings.laid(machine_file.load(machine), fitted)
        made = replace(made, dialect=dialect) if dialect else made
        if not program.is_file():
            raise Refused(say("table.no_file", program=program))
        start = position.homed(made)
        text = linked.linked(linked.mapped(program), linked.beside(program), made)
        read = blocks.stream(text, made, str(program))
        for step in explained.steps(read, made, str(program), start, spoken.get()):
            print(json.dumps(step.to_dict()) if as_json else line_of(step))


def line_of(step: Step) -> str:
    """A step for people."""
    kind = tables.kind(step.kind)
    words = [f"{step.line:6d} {kind:13s} {_places(step.program):42s} | {_places(step.axes):52s} |"]
    told = [f"{step.offset} {step.plane}{' ' + say('table.tilted') if step.tilted is not None else ''}"]
    told += [
        str(value) if name == "unit" else f"{say(f'table.fact.{name}')} {_plain(value)}"
        for name, value in step.facts.items()
    ]
    return " ".join([*words, *told])


def _places(known: dict[str, float | None]) -> str:
    return " ".join(f"{name}{'?' if value is None else f'{value:.4f}'}" for name, value in known.items())


def _plain(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, dict):
        return _places(value)
    if isinstance(value, list):
        return ", ".join(map(_plain, value))
    return str(value)
