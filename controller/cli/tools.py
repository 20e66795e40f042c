"""``directrix tools``: the tool table of a machine, in and out of files, its tools' pictures and life."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from controller.cli import remote
from controller.cli.client import Json, TakeOver, Url, asked
from controller.cli.speech import say, speaking
from controller.machine import tool_files
from controller.machine.toml_table import ConfigError
from controller.verify import console
from controller.verify.console import Refused, show

SENT = ("name", "radius_mm", "length_mm", "flute_mm", "corner_mm", "taper_deg")


@speaking
def tools(
    write: Annotated[Path | None, typer.Option("--export", help="Write it: FILE.tbl or FILE.json.")] = None,
    read: Annotated[
        Path | None, typer.Option("--import", help="Take its tools: FILE.tbl or FILE.json.")
    ] = None,
    flute: Annotated[
        float | None,
        typer.Option("--flute", help="With --import: length that cuts, where nothing says it."),
    ] = None,
    picture: Annotated[
        int | None, typer.Option("--picture", help="Number of a tool: its profile as SVG.")
    ] = None,
    life: Annotated[
        int | None, typer.Option("--life", help="Number of a tool: its limits, given by the four below.")
    ] = None,
    minutes: Annotated[float | None, typer.Option("--minutes", help="Of cut; 0: no limit.")] = None,
    metres: Annotated[float | None, typer.Option("--metres", help="Of cut; 0: no limit.")] = None,
    parts: Annotated[int | None, typer.Option("--parts", help="That it cuts; 0: no limit.")] = None,
    sister: Annotated[
        int | None, typer.Option("--sister", help="Tool that comes once it is worn; 0: none.")
    ] = None,
    renewed: Annotated[
        int | None, typer.Option("--renewed", help="Number of a tool that has a new edge.")
    ] = None,
    take_over: TakeOver = False,
    url: Url = remote.URL,
    as_json: Json = False,
) -> None:
    """Show the tool table; write it, take tools in: LinuxCNC's tool.tbl, or JSON with ISO 13399's names."""
    given = {"cut_min": minutes, "cut_m": metres, "parts": parts, "sister": sister}
    limits = {name: value for name, value in given.items() if value is not None}
    if limits and life is None:
        raise typer.BadParameter(say("tools_no_life"))
    with asked(url, as_json) as machine:
        rows = {int(number): row for number, row in machine.get("tools")["tools"].items()}
        if read is not None:
            wanted = _read(read, rows, flute)
            with machine.control(take_over):
                for row in wanted:
                    values = {key: row[key] for key in SENT if key in row}
                    machine.put(f"tools/{row['number']}", values)
            rows = {int(number): row for number, row in machine.get("tools")["tools"].items()}
        if life is not None:
            machine.put(f"usage/tools/{life}", {**_limits(_uses(machine).get(life, {})), **_set(limits)})
        if renewed is not None:
            machine.post(f"usage/tools/{renewed}/renewed")
        if picture is not None:
            if picture not in rows:
                raise Refused(f"--picture {picture}: there is no such tool; the table has {_numbers(rows)}.")
            print(tool_files.picture(rows[picture]), end="")
        elif write is not None:
            _write(write, rows)
        elif as_json:
            uses = _uses(machine)
            told = [{**row, "life": uses.get(number)} for number, row in rows.items()]
            print(json.dumps({"ok": True, "tools": told}))
        else:
            show.print(table(rows))
            if uses := _uses(machine):
                show.print(lives(uses))


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


def _read(file: Path, there: Mapping[int, Any], flute: float | None) -> list[dict[str, Any]]:
    """Raises Refused."""
    _format(file, "--import")
    take = tool_files.read_json if file.suffix == ".json" else tool_files.read_table
    try:
        return tool_files.completed(take(file.read_text(encoding="utf-8"), file.name), there, flute)
    except (OSError, UnicodeDecodeError) as error:
        raise Refused(f"--import {file}: cannot be read ({error}); give a text file.") from error
    except ConfigError as error:
        raise Refused(str(error)) from error


def _write(file: Path, rows: Mapping[int, Any]) -> None:
    """Raises Refused."""
    _format(file, "--export")
    make = tool_files.json_text if file.suffix == ".json" else tool_files.table_text
    try:
        file.write_text(make(rows.values()), encoding="utf-8")
    except OSError as error:
        raise Refused(
            f"--export {file}: cannot be written ({error.strerror}); choose another place."
        ) from error
    show.print(console.say("table.tools_in", count=len(rows), file=file), markup=False)


def _format(file: Path, option: str) -> None:
    if file.suffix not in tool_files.FORMATS:
        allowed = " or ".join(tool_files.FORMATS)
        raise Refused(f"{option} {file}: its ending does not say what it is; allowed is {allowed}.")


def _numbers(rows: Mapping[int, Any]) -> str:
    return " ".join(f"T{number}" for number in rows) or "none"


def table(rows: Mapping[int, Any]) -> Table:
    made = Table()
    for head in ("tool", "name", "radius", "corner", "flute", "length", "wear_radius", "wear_length"):
        made.add_column(console.say(f"table.{head}"))
    for number, row in rows.items():
        names = ("radius_mm", "corner_mm", "flute_mm", "length_mm", "wear_radius_mm", "wear_length_mm")
        made.add_row(f"T{number}", row["name"], *(f"{row[name]:.3f}" for name in names))
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
