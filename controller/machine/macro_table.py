"""``[[macro]]`` of a machine file: lines of program by name, which the page has as buttons."""

from __future__ import annotations

from dataclasses import dataclass

from controller.commands.table import MAX_MACRO
from controller.machine.declaration import key
from controller.machine.forms import TEXT, Choice, Own
from controller.machine.reading import Reading
from controller.messages import message

MACRO_ROLES = ("operate", "set_up")  # who may press the button of a macro
MAX_TEXT = 1000  # letters of all lines, as of what is typed by hand
_LINES = message("file.may.lines", most=MAX_TEXT)


def _name(here: Reading, key: str) -> str:
    name = here.table.text(key)
    if not 0 < len(name) <= MAX_MACRO or not name.isprintable() or "/" in name or name != name.strip():
        here.table.refuse(key, "macro_name", most=MAX_MACRO)
    return name


def _lines(here: Reading, key: str) -> tuple[str, ...]:
    value = here.table.get(key, _LINES)
    if not isinstance(value, list) or not value or not all(map(_is_line, value)):
        here.table.refuse(key, "no_lines", allowed=_LINES)
    if len("\n".join(value)) > MAX_TEXT:
        here.table.refuse(key, "no_lines", allowed=_LINES)
    return tuple(value)


def _is_line(value: object) -> bool:
    return isinstance(value, str) and bool(value.strip()) and "\n" not in value


@dataclass(frozen=True, slots=True)
class Macro:
    """Lines of program that are run as typed by hand, by a button with their name."""

    name: str = key(
        Own(_name, TEXT.allowed(None), {"type": "string", "minLength": 1, "maxLength": MAX_MACRO}),
        "of its button on the page, at MDI",
    )
    lines: tuple[str, ...] = key(
        Own(_lines, _LINES, {"type": "array", "items": {"type": "string"}, "minItems": 1}),
        "of program, run one after another as typed by hand",
    )
    role: str = key(
        Choice(MACRO_ROLES),
        "the least that the button asks for; who operates may type the lines in any case",
        silent=MACRO_ROLES[0],
    )
