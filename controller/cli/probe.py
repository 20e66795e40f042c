"""``directrix probe``: a probing cycle from where the probe is."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import Annotated, Any

import typer

from controller.cli import remote, waiting
from controller.cli.client import Url, carried_out, connected, named, tell_done
from controller.cli.speech import say
from controller.verify.console import answered, show, word


def probe(
    cycle: Annotated[str | None, typer.Argument()] = None,
    values: Annotated[list[str] | None, typer.Argument()] = None,
    offset: str = "none",
    found: bool = False,
    table: Annotated[Path | None, typer.Option("--csv")] = None,
    touches: Path | None = None,
    wait: bool = False,
    take_over: bool = False,
    url: Url = remote.URL,
    as_json: bool = False,
) -> None:
    """Run a probing cycle from where the probe is, list the cycles, or what they have found."""
    with connected(url, as_json) as machine:
        for file, key, path in ((table, "probed_csv", "found"), (touches, "touches_csv", "touches")):
            if file is not None:
                text = machine.get(f"probing/{path}.csv")
                file.write_text(text, encoding="utf-8", newline="")
                tell_done(say(key, count=text.count("\n") - 1, path=file), {"file": str(file)}, as_json)
        if table is not None or touches is not None:
            return
        if found:
            _show_found(machine.get("probing/found"), as_json)
        elif cycle is None:
            _list(machine.get("probing"), as_json)
        else:
            body = {"cycle": cycle, "values": named(values), "offset": offset}
            with machine.control(take_over):
                done = carried_out(machine, "probing", body)
                run = waiting.run_of(machine, done) if wait else ""
            if wait:
                waiting.to_its_end(machine, run, as_json)
            else:
                tell_done(say("started"), done, as_json)


def _show_found(told: dict[str, Any], as_json: bool) -> None:
    if answered(as_json, **told):
        return
    if not told["found"]:
        show.print(say("probed_nothing"))
    for one in told["found"]:
        at = datetime.fromtimestamp(one["at_s"]).strftime("%Y-%m-%d %H:%M:%S")
        values = " ".join(f"{name}={value:g}" for name, value in one["values"].items())
        show.print(f"{at} {one['program']} {one['cycle']} {values}", soft_wrap=True)


def _list(told: dict[str, Any], as_json: bool) -> None:
    if answered(as_json, **told):
        return
    for cycle in told["cycles"]:
        show.print(f"{cycle['name']}: {word('probing.cycle.' + cycle['name'])}")
        for value in cycle["values"]:
            bounds = "|".join(value["choices"]) if "choices" in value else _bounds(value)
            name = word("probing.value." + value["name"])
            show.print(f"    {value['name']}={value['usual']}  {name} ({bounds})")


def _bounds(value: dict[str, Any]) -> str:
    return f"{value['lowest']:g} … {value['highest']:g} {value['unit']}"
