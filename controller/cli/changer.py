"""``directrix changer``: where the tools of a changer are, and what an operator confirms of them."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from controller.cli import remote
from controller.cli.client import Url, connected, tell_done
from controller.cli.speech import Verbs, say
from controller.verify.console import Refused, answered, show

app = Verbs()


@app.callback(invoke_without_command=True)
def shown(context: typer.Context, url: Url = remote.URL, as_json: bool = False) -> None:
    """Show spindle, pockets and what must be confirmed."""
    if context.invoked_subcommand is not None:
        return
    with connected(url, as_json) as machine:
        facts = machine.get("changer")
        if not answered(as_json, **facts):
            for line in lines(facts):
                show.print(line)


@app.command()
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


@app.command()
def pocket(
    number: int, tool: int, take_over: bool = False, url: Url = remote.URL, as_json: bool = False
) -> None:
    """Give a pocket to a tool; where all tools are must be confirmed then."""
    with connected(url, as_json) as machine, machine.control(take_over):
        tell_done(say("changer_pocket"), machine.put(f"changer/pockets/{number}", {"tool": tool}), as_json)


def lines(facts: dict[str, Any]) -> list[str]:
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
