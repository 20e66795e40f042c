"""Spindle, coolant and clamps by hand: ``directrix spindle``, ``coolant``, ``clamps``, over REST."""

from __future__ import annotations

from typing import Annotated

import typer

from controller.cli import remote
from controller.cli.client import PANEL, Json, TakeOver, Url, asked, tell_done
from controller.cli.speech import say, speaking


def spindle(
    rev_min: Annotated[float, typer.Argument()],
    take_over: TakeOver = False,
    url: Url = remote.URL,
    as_json: Json = False,
) -> None:
    """Turn the spindle by hand, while no program is on; one that starts begins with it off."""
    with asked(url, as_json) as machine, machine.control(take_over):
        done = machine.put("machine/spindle", {"rev_min": rev_min})
        tell_done(say("spindle_turns", rev_min=rev_min) if rev_min else say("spindle_off"), done, as_json)


def coolant(
    mist: Annotated[bool, typer.Option("--mist")] = False,
    flood: Annotated[bool, typer.Option("--flood")] = False,
    take_over: TakeOver = False,
    url: Url = remote.URL,
    as_json: Json = False,
) -> None:
    """Coolant by hand: on what is named, off what is not."""
    with asked(url, as_json) as machine, machine.control(take_over):
        wanted = {"mist": mist, "flood": flood}
        done = machine.put("machine/coolant", wanted)
        kinds = " ".join(kind for kind, on in wanted.items() if on) or "–"
        tell_done(say("coolant", kinds=kinds), done, as_json)


def clamps(
    axes: Annotated[list[str] | None, typer.Argument()] = None,
    take_over: TakeOver = False,
    url: Url = remote.URL,
    as_json: Json = False,
) -> None:
    """Open and close clamps of axes by hand, while no program is on."""
    with asked(url, as_json) as machine, machine.control(take_over):
        wanted = [name.upper() for name in axes or ()]
        done = machine.put("machine/clamps", {"open": wanted})
        tell_done(say("clamps", axes=" ".join(wanted) or say("none_open")), done, as_json)


def register(app: typer.Typer) -> None:
    """Adds these verbs to the command line."""
    loose = {"ignore_unknown_options": True}  # -3000 is no option
    app.command("spindle", context_settings=loose, rich_help_panel=PANEL)(speaking(spindle))
    for verb in (coolant, clamps):
        app.command(verb.__name__, rich_help_panel=PANEL)(speaking(verb))
