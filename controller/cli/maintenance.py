"""``directrix maintenance``: what is to be done at a machine every so often, and what was done."""

from __future__ import annotations

from typing import Annotated, Any

import typer
from rich.table import Table

from controller.cli import remote
from controller.cli.client import Url, connected
from controller.cli.speech import say
from controller.verify.console import answered, show, word


def maintenance(
    name: Annotated[str, typer.Argument()] = "",
    every: float | None = None,
    counter: str = "",
    done: bool = False,
    url: Url = remote.URL,
    as_json: bool = False,
) -> None:
    """List jobs of maintenance with their counters, make or change one, or say that it was done."""
    if not name and (every is not None or counter or done):
        raise typer.BadParameter(say("maintenance_no_name"))
    with connected(url, as_json) as machine:
        if every is not None:
            machine.put("usage/maintenance", {"name": name, "counter": counter, "every": every or None})
        if done:
            machine.post("usage/maintenance/done", {"name": name})
        told = machine.get("usage")
        if not answered(as_json, items=told["items"], counters=told["counters"]):
            show.print(table(told))


def table(told: dict[str, Any]) -> Table:
    made = Table()
    for head in ("job", "counter", "used", "every", "due"):
        made.add_column(say(f"maintenance_{head}"))
    for one in told["items"]:
        unit = word(f"usage.unit.{one['unit']}", one["unit"])
        used, every = f"{one['used']:.4g}", f"{one['every']:g} {unit}"
        due = say("maintenance_due") if one["due"] else ""
        made.add_row(one["name"], counter(one["counter"]), used, every, due)
    for one in told["counters"]:
        unit = word(f"usage.unit.{one['unit']}", one["unit"])
        made.add_row("", counter(one["name"]), f"{one['value']:.4g} {unit}", "", "")
    return made


def counter(name: str) -> str:
    """A counter in words, with its name as --counter takes it; an axis by its name alone."""
    words = word(f"usage.counter.{name}")
    return f"{words} ({name})" if words else name
