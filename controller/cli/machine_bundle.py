"""``directrix machine``: a machine with all that it names as one text, and back as a folder; two compared."""

from __future__ import annotations

import hashlib
import json
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import Annotated, Any

import typer

from controller import atomic_file
from controller.cli import new_files
from controller.cli.new_machine import new
from controller.cli.speech import Verbs
from controller.machine import machine_file
from controller.machine.named_files import PROFILES, SHEETS
from controller.machine.toml_table import read_text
from controller.verify.console import Refused, answered, refusals, say, show

app = Verbs(add_completion=False, no_args_is_help=True)

app.command("new")(new)

SEAL = "# sha256 of all above: "
MACHINE_FILE = "machine.toml"
NAMES = ("name", "number", "object")  # what rows of a table are distinguished by


@app.command()
def pack(
    machine: Annotated[str, typer.Argument(metavar="MACHINE")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE.toml")],
    overwrite: bool = False,
    as_json: bool = False,
) -> None:
    """Write a machine as one sealed file: its tools, data sheets and profiles are in it."""
    with refusals(as_json):
        new_files.target(output, overwrite, "--output", ".toml")
        made = machine_file.load(machine)
        text = sealed(machine_file.alone(made))
        atomic_file.write(output, text)
        files = [name for name, _ in _files(text)]
        if answered(as_json, machine=made.name, file=str(output), files=files):
            return
        facts = {"name": made.name, "file": output, "files": ", ".join(files) or say("cli.nothing")}
        show.print(say("cli.machine.packed", **facts), soft_wrap=True)


@app.command()
def unpack(
    packed: Annotated[Path, typer.Argument(metavar="FILE.toml")],
    folder: Annotated[Path, typer.Argument(metavar="FOLDER")],
    as_json: bool = False,
) -> None:
    """Lay a packed machine, or one from a record or back-up, out as a folder to work in."""
    with refusals(as_json):
        text = unsealed(read_text(packed), packed)
        made = machine_file.read(text, packed.name)
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise Refused(say("cli.machine.not_empty", folder=folder))
        files = {MACHINE_FILE: machine_file.written(text).encode()}
        for name, words in _files(text):
            place = PurePosixPath(name)
            if place.is_absolute() or ".." in place.parts or place == PurePosixPath(MACHINE_FILE):
                raise Refused(say("cli.machine.outside", file=packed, name=name))
            files[name] = words.encode(PROFILES if place.suffix == ".toml" else SHEETS)
        for name in files:
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
        with atomic_file.all_or_none({folder / name: content for name, content in files.items()}) as put:
            put()
        if as_json:
            facts = {"machine": made.name, "folder": str(folder), "files": [*files]}
            print(json.dumps({"ok": True, **facts}))
            return
        row = say("cli.machine.unpacked", name=made.name, folder=folder, files=", ".join(files))
        show.print(row, soft_wrap=True)


@app.command()
def diff(
    old: Annotated[str, typer.Argument(metavar="OLD")],
    new: Annotated[str, typer.Argument(metavar="NEW")],
    as_json: bool = False,
) -> None:
    """Compare two machines key by key, tools, sheets and profiles too; exit code 1 where they differ."""
    with refusals(as_json):
        before, after = (dict(_values(_alone(one))) for one in (old, new))
        places = dict.fromkeys((*before, *after))
        rows = [(place, before.get(place), after.get(place)) for place in places]
        changes = [row for row in rows if row[1] != row[2]]
        if as_json:
            found = [{"key": place, "old": was, "new": now} for place, was, now in changes]
            print(json.dumps({"ok": not found, "differences": found}))
        for place, was, now in () if as_json else changes:
            show.print(f"{place}: {_shown(was)} -> {_shown(now)}", soft_wrap=True)
        if not changes and not as_json:
            show.print(say("cli.machine.same"))
        if changes:
            raise typer.Exit(1)


def sealed(text: str) -> str:
    """With its checksum in the last line."""
    return f"{text.rstrip()}\n{SEAL}{_sum(text)}\n"


def unsealed(text: str, file: Path) -> str:
    """Without its checksum, which must be right where there is one. Raises Refused."""
    own, seal, told = text.rpartition(SEAL)
    if seal and told.strip() != _sum(own):
        raise Refused(say("cli.machine.spoilt", file=file))
    return own if seal else text


def _sum(text: str) -> str:
    return hashlib.sha256(text.rstrip().encode()).hexdigest()


def _files(text: str) -> Iterator[tuple[str, str]]:
    """Names and texts of the files that a machine's text has with it."""
    for row in tomllib.loads(text).get("file", ()):
        yield row["name"], row["text"]


def _alone(machine: str) -> dict[str, Any]:
    """Its tables, wherever its tools were written. Raises ConfigError."""
    return tomllib.loads(machine_file.alone(machine_file.load(machine)))


def _values(tree: Mapping[str, Any], where: str = "") -> Iterator[tuple[str, Any]]:
    """Place and value of each key; the rows of a table are distinguished by their name, number or object."""
    for key, value in tree.items():
        if isinstance(value, Mapping):
            yield from _values(value, f"{where}[{key}] ")
        elif isinstance(value, list) and value and all(isinstance(row, Mapping) for row in value):
            for place, row in enumerate(value, 1):
                name = next((row[one] for one in NAMES if one in row), place)
                yield from _values(row, f"{where}[[{key}]] {name}: ")
        else:
            yield f"{where}{key}", value


LONGEST = 60  # of a value in a row of differences


def _shown(value: Any) -> str:
    """A value as TOML has it, "-" for none; of a whole file its length."""
    if value is None:
        return "-"
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= LONGEST else say("cli.machine.long", count=len(text), begins=text[:20])
