"""``directrix drives profile``: a profile drafted from a data sheet, as a file that a machine file names."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from controller import atomic_file
from controller.cli import new_files, toml_rows
from controller.machine import drive_profiles
from controller.machine.drive_profiles import MODES, NONE
from controller.verify.console import Refused, in_words, refusals, say, show
from drives.commissioning import draft, possible, sheet
from drives.profile import Profile
from drives.settings import MasterSettings
from drives.text_file import TextFile

NOTE_COLUMN = 32  # where notes begin


def profile(
    eds: Annotated[Path, typer.Argument(metavar="SHEET.eds")],
    output: Annotated[Path | None, typer.Option("--output", "-o", metavar="FILE.toml")] = None,
    period_ms: Annotated[float, typer.Option("--period-ms", min=0.5, max=10.0)] = 2.0,
    overwrite: bool = False,
    as_json: bool = False,
) -> None:
    """Draft a profile for a drive that has none, from its data sheet.

    Notes in it say what the drive lacks and what that costs, and where only the manual knows.
    """
    with refusals(as_json):
        if output:
            new_files.target(output, overwrite, "--output", ".toml")
        about = sheet.load(str(eds), 1)
        master = MasterSettings(period_s=period_ms / 1e3)
        name = (output or eds).stem
        found = draft.draft(name, about, master)
        problems = [*map(in_words, found.problems)]
        if problems:
            lines = "\n".join(f"{eds.name}: {problem}." for problem in problems)
            heading = say("cli.profile.none", name=eds.name)
            raise Refused(f"{heading}\n{lines}", eds=str(eds), problems=problems)
        folder = output.resolve().parent if output else Path.cwd()
        text = "\n".join(_lines(found, eds, os.path.relpath(eds, folder))) + "\n"
        # As who takes it reads it, so that no draft is refused later.
        read = drive_profiles.read(text, f"{name}.toml", folder, name, TextFile(eds.name, ""))
        verdict = possible.of_profile(read, about, master)
        remarks = [*map(in_words, (*verdict.remarks, *verdict.undecided))]
        if output:
            atomic_file.write(output, text)
        if as_json:
            facts = {"eds": str(eds), "file": str(output or ""), "text": text, "remarks": remarks}
            print(json.dumps({"ok": True, **facts}))
        elif output:
            show.print(say("cli.profile.written", file=output, name=eds.name), soft_wrap=True)
        else:
            print(text, end="")


def _lines(found: draft.Draft, eds: Path, beside: str) -> Iterator[str]:
    """The rows of the profile, each key with its note."""
    yield f"# {say('draft.heading', name=eds.name)}"
    yield "[drive]"
    yield f"eds = {toml_rows.value(beside)}"
    for key, value in _keys(found.profile):
        shown = f"{value:#x}" if key == "vendor" else toml_rows.value(value)
        yield from toml_rows.noted(f"{key} = {shown}", _note(found, key), NOTE_COLUMN)
    for index in found.profile.optional:
        yield f"#   {index:04X}: {say(f'draft.without.{index:04X}')}"
    if unit := _note(found, "velocity_unit_counts_s"):
        yield f"# {unit}"
    yield 'quirks = [{ text = "profile.drafted" }]'


def _note(found: draft.Draft, key: str) -> str:
    return in_words(found.notes[key]) if key in found.notes else ""


def _keys(profile: Profile) -> Iterator[tuple[str, object]]:
    """Keys of the table ``[drive]`` in the order of the shipped files, those that may be left out apart."""
    yield "mode", next(name for name, mode in MODES.items() if mode is profile.mode)
    yield "rpdo", profile.rpdo
    yield "tpdo", profile.tpdo
    if profile.takes_feed_forward:
        yield "command_rpdo", profile.command_rpdo
    yield "feed_forward", profile.takes_feed_forward
    yield "period_ms", [1e3 * profile.period_min_s, 1e3 * profile.period_max_s]
    yield "period_step_ms", 1e3 * profile.period_step_s
    yield "period_exponents", profile.period_exponents
    yield "supervision", profile.supervision.value
    yield "quick_stop_code", NONE if profile.quick_stop_code is None else profile.quick_stop_code
    yield "abort_code", NONE if profile.abort_code is None else profile.abort_code
    yield "homing_methods", profile.homing_methods
    yield "home_offset", NONE if profile.home_offset is None else f"{profile.home_offset:04X}"
    if profile.most_following_error != Profile().most_following_error:
        yield "most_following_error", profile.most_following_error
    if profile.vendor is not None:
        yield "vendor", profile.vendor
    if profile.optional:
        yield "optional", [f"{index:04X}" for index in profile.optional]
