"""``directrix faults``: the fault table of a machine, with the times that it promises."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.padding import Padding
from rich.text import Text

from controller import messages
from controller.ipc import control_socket
from controller.machine import arrangement, machine_file
from controller.machine.arrangement import Found
from controller.state import stop_times
from controller.state.modes import FAULTS, Fault, Times, stands_within_s
from controller.verify.console import refusals, show, spoken
from drives.arranged import Arranged
from drives.texts import filled

Texts = Mapping[str, str]
INDENT = (0, 0, 0, 4)  # columns of what is under a fault's name


def faults(
    machine: Annotated[str, typer.Argument()] = "trunnion", state: Path | None = None, as_json: bool = False
) -> None:
    """Every fault: its class, what happened, what to do, and within which time the axes stand."""
    with refusals(as_json):
        said = messages.of(spoken.get()).texts
        made = machine_file.load(machine)
        found = arrangement.load((state or control_socket.state_folder()) / arrangement.FOLDER, made)
        taken = stop_times.of(made, found.drives if found else ())
        rows = [_row(fault, taken, said) for fault in Fault if fault is not Fault.NONE]
        if as_json:
            facts = {
                "ok": True,
                "machine": made.name,
                "times": taken._asdict(),
                "drives": _drives(found, said),
            }
            print(json.dumps({**facts, "faults": rows}))
            return
        show.print(Text(said["faults.title"].format(machine=made.name), style="italic"))
        show.print(*(Text(line) for line in _basis(found, said)), sep="\n")
        for row in rows:
            show.print(*_paragraph(row, said))


def _drives(found: Found | None, said: Texts) -> dict[str, Any] | None:
    if found is None:
        return None
    return {"read": found.at, "axes": [{**asdict(one), "notes": _notes(one, said)} for one in found.drives]}


def _notes(one: Arranged, said: Texts) -> list[str]:
    return [filled(note, said) for note in one.notes]


def _basis(found: Found | None, said: Texts) -> Iterator[str]:
    """Whether the drives' own stops are as they were read, and what is wrong with them."""
    if found is None:
        yield said["faults.unread"]
        return
    stops = ", ".join(f"{one.name} {1e3 * one.stop_s:.0f} ms" for one in found.drives if one.stop_s)
    yield said["faults.read"].format(at=found.at.replace("T", " "), stops=stops)
    for one in found.drives:
        yield from _notes(one, said)


def _row(fault: Fault, taken: Times, said: Texts) -> dict[str, Any]:
    row = FAULTS[fault]
    return {
        "fault": fault.name,
        "class": said[f"class.{row.reaction.name}"],
        "stands_within_s": round(stands_within_s(fault, taken), 6),
        "position_trusted": row.position_trusted,
        "recovery": row.recovery.name.lower(),
        "steps": said[f"recovery.{row.recovery.name}"],
        "text": said[f"fault.{fault.name}"],
        "cause": said[f"cause.{fault.name}"],
        "remedy": said[f"remedy.{fault.name}"],
    }


def _paragraph(row: dict[str, Any], said: Texts) -> Iterator[Text | Padding]:
    """A fault's facts, and under them its sentences over the whole width: no column is too narrow."""
    trusted = said["faults.yes" if row["position_trusted"] else "faults.no"]
    facts = [f"{said['faults.position']} {trusted}"]
    if row["stands_within_s"]:
        facts.append(said["faults.stands"].format(ms=f"{1e3 * row['stands_within_s']:.0f}"))
    yield Text.assemble("\n", (row["fault"], "bold"), f": {row['class']}")
    yield Padding(Text("; ".join([*facts, row["steps"]]), style="dim"), INDENT, expand=False)
    yield Padding(Text(row["text"]), INDENT, expand=False)
    yield Padding(Text(said["faults.cause"].format(cause=row["cause"])), INDENT, expand=False)
    yield Padding(Text(said["faults.remedy"].format(remedy=row["remedy"])), INDENT, expand=False)
