"""What a machine has besides its axes: ``directrix probe``, ``changer`` and ``maintenance``, over REST."""

from __future__ import annotations

from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from controller.cli import remote
from controller.cli.client import Url, carried_out, connected, named, set_going, tell_done
from controller.cli.speech import Verbs, say
from controller.verify.console import Refused, answered, show, word

# --- probe


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
    """Run a probing cycle from where the probe stands, list the cycles, or what they have found."""
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
            ask = partial(carried_out, machine, "probing", body)
            set_going(machine, machine.control(take_over), ask, lambda _: say("started"), wait, as_json)


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


# --- changer

changer = Verbs()


@changer.callback(invoke_without_command=True)
def shown(context: typer.Context, url: Url = remote.URL, as_json: bool = False) -> None:
    """Show spindle, pockets and what must be confirmed."""
    if context.invoked_subcommand is not None:
        return
    with connected(url, as_json) as machine:
        facts = machine.get("changer")
        if not answered(as_json, **facts):
            for line in _pockets(facts):
                show.print(line)


@changer.command()
def confirm(
    spindle: Annotated[int, typer.Option("--spindle")],
    away: list[int] | None = None,
    clear: bool = False,
    take_over: bool = False,
    url: Url = remote.URL,
    as_json: bool = False,
) -> None:
    """Say where every tool is: each one that is not named is in its pocket."""
    with connected(url, as_json) as machine:
        if not clear:
            raise Refused(say("changer_not_clear"))
        with machine.control(take_over):
            done = machine.post("changer/confirm", {"spindle": spindle, "away": away or [], "clear": clear})
            tell_done(say("changer_confirmed"), done, as_json)


@changer.command()
def pocket(
    number: int, tool: int, take_over: bool = False, url: Url = remote.URL, as_json: bool = False
) -> None:
    """Give a pocket to a tool; where all tools are must be confirmed then."""
    with connected(url, as_json) as machine, machine.control(take_over):
        tell_done(say("changer_pocket"), machine.put(f"changer/pockets/{number}", {"tool": tool}), as_json)


def _pockets(facts: dict[str, Any]) -> list[str]:
    """Spindle and pockets, a line each."""
    spindle = facts.get("spindle")
    shown = say("changer_unknown") if spindle is None else f"T{spindle}" if spindle else say("changer_empty")
    told = [f"{say('changer_spindle')}: {shown}"]
    for row in facts.get("pockets") or []:
        where = {True: "changer_here", False: "changer_gone", None: "changer_unknown"}[row["here"]]
        told.append(f"{row['pocket']:4}: " + (f"T{row['tool']}, {say(where)}" if row["tool"] else "–"))
    if step := facts.get("step"):
        told.append(f"T{step['tool_out']} -> T{step['tool_in']}, {step['step'] + 1}: {step['name']}")
    if beside := facts.get("preparing"):
        what = {"tool": beside["tool"], "number": beside["step"] + 1, "steps": beside["steps"]}
        told.append(say("changer_preparing", name=beside["name"], **what))
    if ready := facts.get("ready"):
        told.append(say("changer_ready", tool=ready))
    if doubt := facts.get("doubt"):
        told.append(str(doubt.get("sentence", "")))
    return told


# --- maintenance


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
            show.print(_jobs(told))


def _jobs(told: dict[str, Any]) -> Table:
    made = Table()
    for head in ("job", "counter", "used", "every", "due"):
        made.add_column(say(f"maintenance_{head}"))
    for one in told["items"]:
        unit = word(f"usage.unit.{one['unit']}", one["unit"])
        used, every = f"{one['used']:.4g}", f"{one['every']:g} {unit}"
        due = say("maintenance_due") if one["due"] else ""
        made.add_row(one["name"], _counter(one["counter"]), used, every, due)
    for one in told["counters"]:
        unit = word(f"usage.unit.{one['unit']}", one["unit"])
        made.add_row("", _counter(one["name"]), f"{one['value']:.4g} {unit}", "", "")
    return made


def _counter(name: str) -> str:
    """A counter in words, with its name as --counter takes it; an axis by its name alone."""
    words = word(f"usage.counter.{name}")
    return f"{words} ({name})" if words else name
