"""What ``explain --json`` and ``check --json`` answer, of accepted programs and of refused ones."""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

from support.net import normal
from typer.testing import CliRunner

from controller.__main__ import app
from controller.machine import machine_file

TESTS = Path(__file__).resolve().parents[2]
SHIPPED = machine_file.SHIPPED / "programs"
GOOD, POSTS, REFUSED = (TESTS / "programs" / name for name in ("good", "posts", "refused"))
VERBS = ("explain", "check")
POSTED = {"example1_ready": "0.2", "example2_ready": "0.1", "contour": "0.05"}  # chord, mm
TAPPED = ("doosan_fanuc_tapping", "haas_ngc")  # no tap without a spindle that is driven
MACHINES = {"example1_ready": ("table_head", "head_head"), "example2_ready": ("oblique45", "fig4c")}


def run(*words: str) -> str:
    """What a command line prints."""
    before = sys.argv
    sys.argv = ["directrix", *words]
    with tempfile.TemporaryDirectory() as folder, _environment(XDG_STATE_HOME=folder, COLUMNS="120"):
        try:
            return CliRunner().invoke(app, [*words]).stdout
        finally:
            sys.argv = before


@contextlib.contextmanager
def _environment(**values: str) -> Iterator[None]:
    before = {name: os.environ.get(name) for name in (*values, "DIRECTRIX_LANGUAGE")}
    os.environ.update(values)
    os.environ.pop("DIRECTRIX_LANGUAGE", None)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def answer(*words: str) -> list[Any]:
    """The JSON lines of a command line."""
    return [json.loads(line) for line in run(*words, "--json").splitlines()]


@cache
def names() -> dict[str, tuple[str, ...]]:
    """Command lines by the name of their answer; {posted} stands for a program of ``directrix post``."""
    found: dict[str, tuple[str, ...]] = {}
    for verb in VERBS:
        for file in sorted(SHIPPED.glob("*.ngc")):
            found[f"{verb}-{file.stem}"] = (verb, str(file))
        for folder in sorted(GOOD.iterdir()):
            found[f"{verb}-{folder.name}"] = (verb, str(folder / "program.ngc"))
        for stem in POSTED:
            found[f"{verb}-posted-{stem}"] = (verb, f"{{posted}}{stem}")
    for stem, machines in MACHINES.items():
        for machine in machines:
            words = ("check", str(SHIPPED / f"{stem}.ngc"), "--machine", machine, "--gouge", "warn")
            found[f"check-{stem}-{machine}"] = words
    found["check-example2-warned"] = ("check", str(SHIPPED / "example2.ngc"), "--gouge", "warn")
    for file in sorted(POSTS.iterdir()):
        driven = ("--machine", "machining_centre") if file.stem in TAPPED else ()
        found[f"check-{file.stem}"] = ("check", str(file), *driven)
        found[f"explain-{file.stem}-fanuc"] = ("explain", str(file), "--dialect", "fanuc", *driven)
    return found


def text(name: str) -> str:
    """The answer of a name, as lines."""
    verb, program, *more = names()[name]
    if program.startswith("{posted}"):
        program = str(_posted(program.removeprefix("{posted}")))
    found = answer(verb, program, *more)
    whole = found[0] if len(found) == 1 else {str(k): one for k, one in enumerate(found)}
    return "".join(f"{line}\n" for line in normal.lines(whole))


@cache
def _posted(stem: str) -> Path:
    """The lines that ``directrix post`` makes of a shipped program."""
    folder = Path(tempfile.mkdtemp(prefix="posted-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    run("post", str(SHIPPED / f"{stem}.ngc"), "--chord", POSTED[stem], "--out", str(folder / stem), "--json")
    return min(folder.iterdir())


def refusals() -> str:
    """Of every program that is refused: verb, line, column and key of what it is refused for."""
    rows = []
    for folder in sorted(REFUSED.iterdir()):
        for verb in VERBS:
            *_, last = [{}, *answer(verb, str(folder / "program.ngc"))]
            told = last.get("refusals", [last]) if "key" in last or "refusals" in last else []
            places = [f"{one['line']}:{one['column']} {one['key']}" for one in told]
            rows.append(f"{verb} {folder.name} = {', '.join(places) or 'accepted'}\n")
    return "".join(rows)
