"""``directrix tools``: the tool table of a machine, in and out of files, data, pictures, life."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from controller.cli import remote
from controller.cli.client import Url, connected, named, tell_done
from controller.cli.offsets import typed
from controller.cli.speech import say
from controller.machine import tool_files
from controller.machine.tool_files import TableRefused
from controller.messages import text
from controller.verify import console
from controller.verify.console import Refused, show, spoken

SHOWN = ("radius_mm", "corner_mm", "flute_mm", "length_mm", "wear_radius_mm", "wear_length_mm")
FLAGS = {"true": True, "false": False}  # as centre_cutting has them
KEPT = ("name", "radius_mm", "length_mm", "flute_mm")  # what REST asks for of a tool that is changed


def tools(
    values: Annotated[list[str] | None, typer.Argument()] = None,
    change: Annotated[int | None, typer.Option("--set")] = None,
    touch: list[str] | None = None,
    delete: int | None = None,
    write: Annotated[Path | None, typer.Option("--export")] = None,
    read: Annotated[Path | None, typer.Option("--import")] = None,
    flute: float | None = None,
    picture: int | None = None,
    life: int | None = None,
    minutes: float | None = None,
    metres: float | None = None,
    parts: int | None = None,
    sister: int | None = None,
    renewed: int | None = None,
    take_over: bool = False,
    url: Url = remote.URL,
    as_json: bool = False,
) -> None:
    """Show the tool table; change it; in and out of LinuxCNC's tool.tbl, or JSON with ISO 13399's names."""
    given = {"cut_min": minutes, "cut_m": metres, "parts": parts, "sister": sister}
    limits = {name: value for name, value in given.items() if value is not None}
    if limits and life is None:
        raise typer.BadParameter(say("tools_no_life"))
    if (values or touch) and change is None:
        raise typer.BadParameter(say("tools_no_set", typed=" ".join([*(values or ()), *(touch or ())])))
    with connected(url, as_json) as machine:
        if change is not None or delete is not None or read is not None:
            with machine.control(take_over):
                by_values = change if values or not touch else None
                _change(machine, by_values, _flagged(named(values, ("name",))), delete, read, flute)
                if touch:
                    machine.post(f"tools/{change}/touch_off", typed(touch))
        if life is not None:
            machine.put(f"usage/tools/{life}", {**_limits(_uses(machine).get(life, {})), **_set(limits)})
        if renewed is not None:
            machine.post(f"usage/tools/{renewed}/renewed")
        rows = _rows(machine)
        if picture is not None:
            if picture not in rows:
                raise Refused(say("tool_missing", tool=picture, allowed=_numbers(rows)))
            print(tool_files.picture(rows[picture]), end="")
        elif write is not None:
            _write(write, rows, as_json)
        else:
            _tell(rows, _uses(machine), as_json)


def _tell(rows: Mapping[int, dict[str, Any]], uses: Mapping[int, dict[str, Any]], as_json: bool) -> None:
    if as_json:
        told = [{**row, "life": uses.get(number)} for number, row in rows.items()]
        print(json.dumps({"ok": True, "tools": told}))
        return
    show.print(table(rows))
    if uses:
        show.print(lives(uses))


def _rows(machine: remote.Machine) -> dict[int, dict[str, Any]]:
    return {int(number): row for number, row in machine.get("tools")["tools"].items()}


def _change(
    machine: remote.Machine,
    number: int | None,
    values: Mapping[str, str | float],
    delete: int | None,
    file: Path | None,
    flute: float | None,
) -> None:
    """What is not said of a tool that is there stays. Raises Refused."""
    if number is not None:
        before = _rows(machine).get(number, {})
        kept = {key: before[key] for key in KEPT if key in before}
        machine.put(f"tools/{number}", {**kept, **values})
    if delete is not None:
        machine.delete(f"tools/{delete}")
    if file is not None:
        sent = {"file": file.name, "text": _content(file), "flute_mm": flute}
        machine.post("tools/import", sent)


def _content(file: Path) -> str:
    """Raises Refused; OSError where it cannot be read."""
    try:
        return file.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise Refused(say("no_text", file=file)) from error


def _flagged(values: Mapping[str, str | float]) -> dict[str, str | float | bool]:
    """With true and false as such, but for a name."""
    return {key: FLAGS.get(str(one), one) if key != "name" else one for key, one in values.items()}


def _uses(machine: remote.Machine) -> dict[int, dict[str, Any]]:
    """What each tool has cut, and may; those that nobody has counted are not there."""
    return {use["number"]: use for use in machine.get("usage")["tools"]}


def _limits(use: Mapping[str, Any]) -> dict[str, Any]:
    """As they stand, so that one can be changed alone."""
    found = {name: use.get(f"most_{name}") for name in ("cut_min", "cut_m", "parts")}
    return {**found, "sister": use.get("sister")}


def _set(limits: Mapping[str, float]) -> dict[str, float | None]:
    """0 takes a limit away."""
    return {name: value or None for name, value in limits.items()}


def _write(file: Path, rows: Mapping[int, Any], as_json: bool) -> None:
    """Raises Refused; OSError where it cannot be written."""
    try:
        made = tool_files.written(rows.values(), file.name)
    except TableRefused as error:
        raise Refused(text(error.said, spoken.get())) from error
    file.write_text(made, encoding="utf-8")
    tell_done(console.say("table.tools_in", count=len(rows), file=file), {"file": str(file)}, as_json)


def _numbers(rows: Mapping[int, Any]) -> str:
    return " ".join(f"T{number}" for number in rows) or "–"


def table(rows: Mapping[int, Any]) -> Table:
    made = Table()
    for head in ("tool", "name", "radius", "corner", "flute", "length", "wear_radius", "wear_length"):
        made.add_column(console.say(f"table.{head}"))
    for number, row in rows.items():
        made.add_row(f"T{number}", row["name"], *(f"{row[name]:.3f}" for name in SHOWN))
    return made


def lives(uses: Mapping[int, Mapping[str, Any]]) -> Table:
    """Used of what each tool may, and what comes in its place."""
    made = Table()
    for head in ("tool", "minutes", "metres", "parts", "sister", "worn"):
        made.add_column(say(f"tools_{head}"))
    for number, use in uses.items():
        pairs = (
            (use["cut_s"] / 60.0, use["most_cut_min"]),
            (use["cut_m"], use["most_cut_m"]),
            (use["parts"], use["most_parts"]),
        )
        used = (f"{have:.4g}" if may is None else f"{have:.4g} / {may:g}" for have, may in pairs)
        sister = f"T{use['sister']}" if use["sister"] else ""
        made.add_row(f"T{number}", *used, sister, say("tools_worn") if use["worn"] else "")
    return made
