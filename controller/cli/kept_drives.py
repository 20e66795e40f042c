"""``directrix drives save``, ``restore``, ``compare``: a drive's set-up as a file (CiA 306-1 DCF)."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from controller.cli import drive_buses, drive_tables
from controller.machine import nodes
from controller.verify.console import Refused, answered, in_words, refusals, say, show, tell
from drives import commission as commissioning
from drives.commissioning import dcf, setup, sheet
from drives.commissioning.remote import NMT_PRE_OPERATIONAL
from drives.commissioning.wanted import Settings

DriveName = Annotated[str, typer.Argument(metavar="X")]
File = Annotated[Path, typer.Argument(metavar="FILE.dcf")]


def save(
    drive: DriveName,
    file: File,
    machine: str = "trunnion",
    bus: str = "",
    channel: str = "",
    as_json: bool = False,
) -> None:
    """Write what is set up in a drive into a file, for the one that replaces it. Changes nothing in it."""
    with refusals(as_json), _one(machine, bus, channel, drive) as (settings, here, rate):
        values, failed = setup.read(here)
        counts = {say(f"setup.{why}"): count for why, count in setup.beside(here).items()}
        about = sheet.own(settings.eds, settings.node, sheet.known_of(settings))
        text = dcf.written(about, settings.node, rate, values, file.name)
        _write(file, text)
        if as_json:
            facts = {"drive": settings.name, "node": settings.node, "file": str(file), "saved": len(values)}
            print(json.dumps({"ok": True, **facts, "left_out": counts, "unread": _rows(failed)}))
            return
        for row in failed:
            tell.print(
                say("cli.kept.unread", place=drive_tables.place(row.index, row.sub), refused=row.refused)
            )
        kinds = ", ".join(f"{count} {why}" for why, count in sorted(counts.items()))
        one = {"name": settings.name, "node": settings.node, "count": len(values)}
        show.print(say("cli.kept.saved", file=file, left=kinds or say("cli.nothing"), **one), soft_wrap=True)


def compare(
    drive: DriveName,
    file: File,
    machine: str = "trunnion",
    bus: str = "",
    channel: str = "",
    address: bool = False,
    as_json: bool = False,
) -> None:
    """What is set up in a drive against a file: the differences only; exit code 1 where there are any."""
    with refusals(as_json):
        kept = dcf.read(file)
        with _one(machine, bus, channel, drive) as (settings, here, _):
            setup.belongs(here, kept)
            rows = list(setup.differences(here, kept, address))
        facts = {"drive": settings.name, "file": str(file), "differences": _rows(rows)}
        if rows:
            if not as_json:
                show.print(drive_tables.differences(rows, kept.name))
            one = {"name": settings.name, "node": settings.node, "file": kept.name}
            counts = {"count": len(rows), "all": len(kept.values)}
            raise Refused(say("cli.kept.differs", **one, **counts), **facts)
        if not answered(as_json, **facts):
            show.print(say("cli.kept.as_it_says", name=settings.name, node=settings.node, file=kept.name))


def restore(
    drive: DriveName,
    file: File,
    machine: str = "trunnion",
    bus: str = "",
    channel: str = "",
    store: bool = False,
    address: bool = False,
    as_json: bool = False,
) -> None:
    """Put a set-up back into a drive that is off: what differs is written and read back.

    Without --address node id and bit rate stay. The drive is left pre-operational; commission it next.
    """
    with refusals(as_json):
        kept = dcf.read(file)
        with _one(machine, bus, channel, drive, alone=True) as (settings, here, _):
            setup.belongs(here, kept)
            setup.see_off(here)
            here.command(NMT_PRE_OPERATIONAL)
            rows = setup.restore(here, kept, address)
            refused = [row for row in rows if row.refused]
            if store and len(rows) > len(refused):
                here.store()
        facts = {"drive": settings.name, "file": str(file), "changed": len(rows) - len(refused)}
        facts |= {"stored": here.outcome.stored, "objects": _rows(rows)}
        if rows and not as_json:
            show.print(drive_tables.restored(rows))
        if refused:
            one = {"name": settings.name, "node": settings.node, "file": kept.name}
            counts = {"count": len(refused), "all": len(rows)}
            raise Refused(say("cli.kept.not_taken", **one, **counts), **facts)
        if not answered(as_json, **facts):
            key = "cli.kept.stored" if here.outcome.stored else "cli.kept.restored"
            told = {"name": settings.name, "file": kept.name, "count": len(rows)}
            show.print(say(key if rows else "cli.kept.was_so", **told))


@contextlib.contextmanager
def _one(
    machine: str, bus: str, channel: str, drive: str, alone: bool = False
) -> Iterator[tuple[Settings, commissioning.Drive, int]]:
    """The drive that is asked for, and its bus' bit rate. ``alone``: nobody else may drive it."""
    made = drive_buses.machine(machine)
    with drive_buses.joined(made, bus, channel, drive) as found:
        its = [(each, node) for each in found for node in each.nodes]
        if len(its) != 1:
            known = ", ".join(f"{node.name} (bus {each.bus.name})" for each, node in its)
            raise Refused(say("cli.kept.one", drive=drive, known=known or say("cli.nothing")))
        each, node = its[0]
        if alone:
            drive_buses.see_alone(each, nodes.master_settings(made))
        here = commissioning.Drive(each.network, node)
        here.meet()
        yield node, here, each.bus.bit_rate


def _write(file: Path, text: str) -> None:
    try:
        file.write_bytes(text.encode("latin-1", "replace"))
    except OSError as error:
        raise Refused(say("cli.kept.not_written", file=file, why=error)) from error


def _rows(rows: Sequence[setup.Row]) -> list[dict[str, Any]]:
    """Values that JSON has no form for as hexadecimal text."""

    def plain(value: Any) -> Any:
        return value.hex() if isinstance(value, bytes) else value

    rows_in_words = ({**asdict(row), "refused": in_words(row.refused)} for row in rows)
    return [{key: plain(value) for key, value in row.items()} for row in rows_in_words]
