"""``directrix soak``: random parts, programs, operators and faults for hours, judged at every tick."""

from __future__ import annotations

import importlib
import random
import sys
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from controller import memory
from controller.cli import checkout
from controller.verify import console
from controller.verify.console import Refused, answered, bar, refusals, say, show, tell


def soak(
    hours: Annotated[float, typer.Option("--hours", min=0.0)] = 1.0,
    seed: int | None = None,
    clock: Literal["stepped", "real"] = "stepped",
    first: Annotated[int, typer.Option("--first", min=0)] = 0,
    runs: Annotated[int | None, typer.Option("--runs", min=1)] = None,
    out: Path = Path("soak"),
    as_json: bool = False,
) -> None:
    """Run what is drawn at random, and judge every tick of it.

    What does not hold is kept as a folder with seed, tick and record: `directrix replay FOLDER` makes the run
    again, and so does --seed N --first K --runs 1. Exit code 1 where something did not hold, or memory grew.
    """
    with refusals(as_json):
        sys.path.insert(0, str(checkout.tests()))
        module: Any = importlib.import_module("support.soak.soak")
        memory.collect_rarely()
        drawn = random.randrange(10**6) if seed is None else seed
        if not as_json:
            tell.print(_say("begins", seed=drawn))
        with bar(say("cli.bar.soaking"), as_json) as progress:

            def show_run(one: Any, came: Any, so_far: Any) -> None:
                progress(0.0, f"{so_far.runs} ({len(so_far.kept)}) {one.title}")
                if came.wrong and not as_json:
                    tell.print(f"{so_far.kept[-1]}: {came.wrong}")

            soaked = module.soak if clock == "stepped" else module.on_real_clock
            found = soaked(drawn, 3600.0 * hours, out, first, runs, show_run)
        results = ", ".join(f"{count} {name}" for name, count in sorted(found.results.items()))
        figures = dict(seed=drawn, runs=found.runs, ticks=found.ticks, wrong=len(found.kept), results=results)
        if found.kept:
            raise Refused(_say("wrong", **figures, folder=found.kept[0]), **found.to_dict())
        if grown := found.grown:
            named = ", ".join(f"{name} {one:.1f} > {two:.1f} MB" for name, (one, two) in grown.items())
            raise Refused(_say("grown", **figures, grown=named), **found.to_dict())
        if not answered(as_json, **found.to_dict()):
            show.print(_say("held", **figures))


def _say(key: str, **values: object) -> str:
    return console.say(f"soak.{key}", **values)
