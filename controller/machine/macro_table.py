"""``[[macro]]`` of a machine file: lines of program by name, which the page has as buttons."""

from __future__ import annotations

from collections.abc import Sequence

from controller.commands.table import MAX_MACRO
from controller.machine.model import MACRO_ROLES, Macro
from controller.machine.toml_table import Table
from controller.messages import said

MAX_TEXT = 1000  # letters of all lines, as of what is typed by hand


def macros(tables: Sequence[Table]) -> tuple[Macro, ...]:
    """The macros of a file, in its order. Raises ConfigError."""
    found: list[Macro] = []
    for table in tables:
        made = Macro(_name(table), _lines(table), table.text("role", MACRO_ROLES, MACRO_ROLES[0]))
        table.finish()
        if any(made.name == other.name for other in found):
            table.refuse("name", "macro_twice")
        found.append(made)
    return tuple(found)


def _name(table: Table) -> str:
    name = table.text("name")
    if not 0 < len(name) <= MAX_MACRO or not name.isprintable() or "/" in name or name != name.strip():
        table.refuse("name", "macro_name", most=MAX_MACRO)
    return name


def _lines(table: Table) -> tuple[str, ...]:
    allowed = said("file.may.lines", most=MAX_TEXT)
    value = table.get("lines", allowed)
    if not isinstance(value, list) or not value or not all(map(_is_line, value)):
        table.refuse("lines", "no_lines", allowed=allowed)
    if len("\n".join(value)) > MAX_TEXT:
        table.refuse("lines", "no_lines", allowed=allowed)
    return tuple(value)


def _is_line(value: object) -> bool:
    return isinstance(value, str) and bool(value.strip()) and "\n" not in value
