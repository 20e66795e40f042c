"""``directrix faults``: the fault table of a machine, with the times that it promises."""

from __future__ import annotations

import json
from typing import Annotated, Any

import typer
from rich.table import Table

from controller import config, times
from controller.state import FAULTS, Fault, Reaction, Times, stands_within_s
from controller.toml_table import ConfigError
from controller.verify.console import refusals, show

MachineArgument = Annotated[str, typer.Argument(help="Machine file, or the name of a shipped one.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]

CLASSES = {
    Reaction.NONE: "",
    Reaction.WARN: "warn",
    Reaction.END_OF_BLOCK: "hold at the end of the block",
    Reaction.HOLD: "hold on the path",
    Reaction.PATH_STOP: "coordinated stop",
    Reaction.LOST_DRIVE: "coordinated stop around the lost drive",
    Reaction.QUICK_STOP: "quick stop",
    Reaction.DISABLE: "quick stop, then off",
}


def faults(machine: MachineArgument = "trunnion", as_json: Json = False) -> None:
    """Every fault: its class, what happened, what to do, and within which time the axes stand."""
    with refusals(as_json, lambda: (ConfigError,)):
        made = config.load(machine)
        taken = times.of(made)
        rows = [_row(fault, taken) for fault in Fault if fault is not Fault.NONE]
        if as_json:
            print(json.dumps({"ok": True, "machine": made.name, "times": taken._asdict(), "faults": rows}))
        else:
            show.print(_table(rows, made.name))


def _row(fault: Fault, taken: Times) -> dict[str, Any]:
    row = FAULTS[fault]
    return {
        "fault": fault.name,
        "class": CLASSES[row.reaction],
        "stands_within_s": round(stands_within_s(fault, taken), 6),
        "position_trusted": row.position_trusted,
        "recovery": row.recovery.name.lower(),
        "text": row.text,
        "remedy": row.remedy,
    }


def _table(rows: list[dict[str, Any]], name: str) -> Table:
    table = Table(title=f"Faults of {name}; position: whether it is still trusted", show_lines=True)
    for heading in ("fault", "class", "stands within", "position", "what happened, what to do"):
        table.add_column(heading, justify="right" if heading == "stands within" else "left")
    for row in rows:
        within = f"{1e3 * row['stands_within_s']:.0f} ms" if row["stands_within_s"] else ""
        position = "yes" if row["position_trusted"] else "no"
        table.add_row(row["fault"], row["class"], within, position, f"{row['text']} {row['remedy']}")
    return table
