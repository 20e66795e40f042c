"""What ``directrix drives`` shows to people: tables that fit 80 columns.

Identifiers, mappings and words of bits are hexadecimal, as manuals have them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rich import box
from rich.table import Table

from controller.verify.console import in_words, say, word
from drives.commissioning.remote import Outcome
from drives.commissioning.setup import Row
from drives.commissioning.survey import Entry, Status
from drives.commissioning.values import shown_at


def outcomes(found: Sequence[Outcome]) -> Table:
    """What commissioning changed, object by object; a drive that was right has one row."""
    table = _table("commissioned", "drive", "node", "object", "was", "is", "because")
    for outcome in found:
        for change in outcome.changes:
            at = change.index, change.sub
            was, now = _value(*at, change.was), _value(*at, change.now)
            table.add_row(outcome.name, str(outcome.node), place(*at), was, now, in_words(change.why))
        key = "drive_table.so_and_stored" if outcome.stored else "drive_table.so"
        left = say(key, count=outcome.already_so)
        table.add_row(outcome.name, str(outcome.node), "", "", "", left)
    return table


def answering(rows: Sequence[dict[str, Any]]) -> Table:
    """Who answers on the buses."""
    titles = "bus", "node", "drive", "profile", "vendor", "product", "revision", "serial"
    table = _table("nodes", *titles)
    for row in rows:
        kind = row["device_type"]
        words = [_hex(row[key]) for key in ("vendor", "product", "revision", "serial")]
        profile = "-" if kind is None else str(kind & 0xFFFF)
        name = row["name"] or say("drive_table.unknown")
        table.add_row(row["bus"], str(row["node"]), name, profile, *words)
    return table


def status(found: Sequence[Status]) -> Table:
    """How the drives are; below an error the last ones before it (1003h)."""
    table = _table("drives", "drive", "node", "nmt", "state", "mode", "position", "error")
    for one in found:
        position = "-" if one.position_counts is None else str(one.position_counts)
        history = " ".join(f"{word & 0xFFFF:04X}" for word in one.history)
        error = f"{_hex(one.error_code)}, {_hex(one.error_register)}" + (f"\n{history}" if history else "")
        bits = "" if one.statusword is None else f"\n0x{one.statusword:04x}"
        nmt = say(f"drive_table.nmt.{one.nmt}")
        state = f"{_state(one.state)}{bits}"
        table.add_row(one.name, str(one.node), nmt, state, one.mode_name, position, error)
    return table


def _state(state: str | None) -> str:
    return "-" if state is None else word(f"drives.state.{state.upper().replace(' ', '_')}", state)


def dump(entries: Sequence[Entry]) -> Table:
    """Every object of a drive."""
    table = _table("objects", "object", "name", "access", "value", "hex", "default")
    for entry in entries:
        at = entry.index, entry.sub
        value = in_words(entry.refused) or _value(*at, entry.value)
        hexadecimal = _hex(entry.value) if isinstance(entry.value, int) and entry.value >= 0 else ""
        default = "" if entry.default is None else _value(*at, entry.default)
        shown = "" if hexadecimal == value else hexadecimal
        table.add_row(place(*at), entry.name, entry.access, value, shown, default)
    return table


def differences(rows: Sequence[Row], file: str) -> Table:
    """What is other in a drive than in a file."""
    table = _table("differences", "object", "name", "file", "drive", file=file)
    for row in rows:
        now = in_words(row.refused) if row.now is None else _value(*row.place, row.now)
        table.add_row(place(*row.place), row.name, _value(*row.place, row.kept), now)
    return table


def restored(rows: Sequence[Row]) -> Table:
    """What was put back, and what the drive did not take."""
    table = _table("put_back", "object", "name", "was", "file", "drive", file=say("drive_table.the_file"))
    for row in rows:
        was, kept = _value(*row.place, row.now), _value(*row.place, row.kept)
        result = say("drive_table.refused", why=row.refused) if row.refused else say("drive_table.so_now")
        table.add_row(place(*row.place), row.name, was, kept, result)
    return table


def place(index: int, sub: int) -> str:
    return f"{index:04X}h:{sub:02X}"


def _table(title: str, *columns: str, **values: object) -> Table:
    """By the keys of its title and its columns, with ``values`` in them."""
    heading = say(f"drive_table.title.{title}")
    table = Table(title=heading, title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.pad_edge = False
    for column in columns:
        told = say(f"drive_table.{column}", **values)
        table.add_column(told, overflow="fold", no_wrap=column in ("object", "node"))
    return table


def _value(index: int, sub: int, value: object) -> str:
    if value is None:
        return "-"
    if isinstance(value, int):
        return shown_at(index, sub, value)
    return value.hex(" ") if isinstance(value, bytes) else str(value)


def _hex(value: int | None) -> str:
    return "-" if value is None else f"{value:#x}"
