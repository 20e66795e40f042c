"""``directrix offsets``: what is set at a machine beside its file."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Annotated, Any
from urllib.parse import quote

import typer
from rich.table import Table

from controller.cli import remote
from controller.cli.client import Json, TakeOver, Url, asked
from controller.cli.speech import speaking
from controller.verify.console import say, show


@speaking
def offsets(
    forget: Annotated[
        str, typer.Option("--forget", help="Take the machine file's again: G54, G92, G28, T3, #500, all.")
    ] = "",
    take_over: TakeOver = False,
    url: Url = remote.URL,
    as_json: Json = False,
) -> None:
    """Show offsets, shift, reference points and kept parameters, and where each comes from."""
    with asked(url, as_json) as machine:
        if forget:
            with machine.control(take_over):
                machine.delete(f"offsets/{quote(forget, safe='')}")
        found = machine.get("offsets")
        if as_json:
            print(json.dumps({"ok": True, **found}))
        else:
            show.print(table(found))


def table(found: Mapping[str, Any]) -> Table:
    made = Table()
    for head in ("name", "xyz", "rotaries", "turned", "source"):
        made.add_column(say(f"table.{head}"))
    sources = {source: say(f"table.source.{source}") for source in ("file", "machine")}
    for name, row in found["offsets"].items():
        if not row["unset"]:
            turned = _numbers(row["turned_deg"]) if any(row["turned_deg"]) else ""
            made.add_row(name, _numbers(row["origin_mm"]), _rotary(row), turned, sources[row["source"]])
    shift = found["shift"]
    state = " (G92.2)" if shift["suspended"] else ""
    made.add_row(f"G92{state}", _numbers(shift["origin_mm"]), _rotary(shift), "", sources[shift["source"]])
    for name, row in found["references"].items():
        rotary = {axis: value for axis, value in row.items() if axis in "ABC"}
        xyz = _numbers([row[axis] for axis in "XYZ"])
        made.add_row(name, xyz, _rotary({"rotary_deg": rotary}), "", sources[row["source"]])
    for name, value in found["parameters"].items():
        made.add_row(name, f"{value:g}", "", "", sources["machine"])
    return made


def _numbers(values: list[float]) -> str:
    return " ".join(f"{round(value, 3) + 0.0:.3f}" for value in values)  # no -0.000


def _rotary(row: Mapping[str, Any]) -> str:
    return " ".join(f"{axis}{value:.3f}" for axis, value in row.get("rotary_deg", {}).items() if value)
