"""What ``directrix drives`` shows to people."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rich.markup import escape
from rich.table import Table

from drives.commissioning.remote import Outcome
from drives.commissioning.survey import Entry, Status


def outcomes(found: Sequence[Outcome]) -> Table:
    """What commissioning changed, object by object; a drive that was right has one row."""
    table = Table(title="Commissioned", title_justify="left")
    for title in ("drive", "node", "object", "was", "is", "because"):
        table.add_column(title, overflow="fold")
    for outcome in found:
        for change in outcome.changes:
            where = f"{change.index:04X}h:{change.sub:02X}"
            was = "-" if change.was is None else str(change.was)
            table.add_row(outcome.name, str(outcome.node), where, was, str(change.now), escape(change.why))
        left = f"{outcome.already_so} objects were already so" + (", stored" if outcome.stored else "")
        table.add_row(outcome.name, str(outcome.node), "", "", "", left)
    return table


def found(rows: Sequence[dict[str, Any]]) -> Table:
    """Who answers on the buses."""
    table = Table(title="Nodes that answer", title_justify="left")
    for title in ("bus", "node", "machine file", "profile", "vendor", "product", "revision", "serial"):
        table.add_column(title, overflow="fold")
    for row in rows:
        kind = row["device_type"]
        words = [_hex(row[key]) for key in ("vendor", "product", "revision", "serial")]
        profile = "-" if kind is None else str(kind & 0xFFFF)
        table.add_row(row["bus"], str(row["node"]), escape(row["name"] or "not expected"), profile, *words)
    return table


def status(found: Sequence[Status]) -> Table:
    """How the drives are."""
    table = Table(title="Drives", title_justify="left")
    for title in ("drive", "node", "NMT", "state", "mode", "position", "error", "register", "history"):
        table.add_column(title, overflow="fold")
    for one in found:
        position = "-" if one.position_counts is None else str(one.position_counts)
        history = " ".join(f"{word & 0xFFFF:04X}" for word in one.history)
        error, register = _hex(one.error_code), _hex(one.error_register)
        about = (one.nmt, one.state or "-", one.mode_name, position, error, register, history)
        table.add_row(one.name, str(one.node), *about)
    return table


def dump(entries: Sequence[Entry]) -> Table:
    """Every object of a drive."""
    table = Table(title="Objects", title_justify="left")
    for title in ("object", "name", "access", "value", "hex", "default"):
        table.add_column(title, overflow="fold")
    for entry in entries:
        value = entry.refused or str(entry.value)
        hexadecimal = _hex(entry.value) if isinstance(entry.value, int) and entry.value >= 0 else ""
        default = "" if entry.default is None else str(entry.default)
        where = f"{entry.index:04X}h:{entry.sub:02X}"
        table.add_row(where, escape(entry.name), entry.access, escape(value), hexadecimal, default)
    return table


def _hex(value: int | None) -> str:
    return "-" if value is None else f"{value:#x}"
