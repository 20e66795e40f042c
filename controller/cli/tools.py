"""``directrix tools``: the tool table of a machine, in and out of files, and pictures of its tools."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from controller.cli import remote
from controller.cli.client import Json, TakeOver, Url, asked
from controller.cli.speech import speaking
from controller.machine import tool_files
from controller.machine.toml_table import ConfigError
from controller.verify.console import Refused, say, show

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
    take_over: TakeOver = False,
    url: Url = remote.URL,
    as_json: Json = False,
) -> None:
    """Show the tool table; write it, take tools in: LinuxCNC's tool.tbl, or JSON with ISO 13399's names."""
    with asked(url, as_json) as machine:
        rows = {int(number): row for number, row in machine.get("tools")["tools"].items()}
        if read is not None:
            wanted = _read(read, rows, flute)
            with machine.control(take_over):
                for row in wanted:
                    values = {key: row[key] for key in SENT if key in row}
                    machine.put(f"tools/{row['number']}", values)
            rows = {int(number): row for number, row in machine.get("tools")["tools"].items()}
        if picture is not None:
            if picture not in rows:
                raise Refused(f"--picture {picture}: there is no such tool; the table has {_numbers(rows)}.")
            print(tool_files.picture(rows[picture]), end="")
        elif write is not None:
            _write(write, rows)
        elif as_json:
            print(json.dumps({"ok": True, "tools": list(rows.values())}))
        else:
            show.print(table(rows))


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
    show.print(say("table.tools_in", count=len(rows), file=file), markup=False)


def _format(file: Path, option: str) -> None:
    if file.suffix not in tool_files.FORMATS:
        allowed = " or ".join(tool_files.FORMATS)
        raise Refused(f"{option} {file}: its ending does not say what it is; allowed is {allowed}.")


def _numbers(rows: Mapping[int, Any]) -> str:
    return " ".join(f"T{number}" for number in rows) or "none"


def table(rows: Mapping[int, Any]) -> Table:
    made = Table()
    for head in ("tool", "name", "radius", "corner", "flute", "length", "wear_radius", "wear_length"):
        made.add_column(say(f"table.{head}"))
    for number, row in rows.items():
        names = ("radius_mm", "corner_mm", "flute_mm", "length_mm", "wear_radius_mm", "wear_length_mm")
        made.add_row(f"T{number}", row["name"], *(f"{row[name]:.3f}" for name in names))
    return made
