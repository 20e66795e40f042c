"""The machine file as a table: every value with its line and the comment beside it.

The text is the file itself, read by the standard's rules; where a value stands is found by its
key, line by line. What the operator changed since (offsets, tools) stands in the service, not here.
"""

from __future__ import annotations

import re
import tomllib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

_TABLE = re.compile(r"^\s*(\[\[?)\s*([^\[\]]+?)\s*\]\]?\s*(?:#\s*(.*))?$")
_KEY = re.compile(r"""^\s*([A-Za-z0-9_-]+|"[^"]*"|'[^']*')((?:\s*\.\s*[A-Za-z0-9_-]+)*)\s*=\s*(.*)$""", re.S)
_NAMED = ("name", "number")  # what an entry of an array of tables is called by


@dataclass(frozen=True, slots=True)
class Row:
    """One value of the file."""

    table: str  # "machine", "axis X", "tool 2"
    key: str
    value: str  # as TOML, on one line
    line: int  # from 1
    comment: str

    def to_dict(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in self.__slots__}


def rows(text: str) -> list[Row]:
    """All values in the file's order. Raises ValueError for what is no TOML."""
    told = tomllib.loads(text)
    numbers: Counter[str] = Counter()
    found: list[Row] = []
    table, values = "", told
    for line, source in _statements(text):
        if head := _TABLE.match(source):
            brackets, name = head.group(1), head.group(2)
            entries = _inside(told, name)
            if brackets == "[[":
                values = entries[numbers[name]]
                numbers[name] += 1
                table = f"{name} {_called(values, numbers[name])}"
            else:
                values, table = entries, name
        elif key := _KEY.match(source):
            name = key.group(1).strip("\"'") + re.sub(r"\s", "", key.group(2))
            found.append(Row(table, name, _shown(_inside(values, name)), line, _comment(key.group(3))))
    return found


def _statements(text: str) -> Iterator[tuple[int, str]]:
    """(line number, text) of each statement; one over several lines comes as one, at its first."""
    lines = text.splitlines()
    i = 0
    while i < len(lines):
        begin, whole = i, lines[i]
        while _KEY.match(whole) and not _complete(whole) and i + 1 < len(lines):
            i += 1
            whole += "\n" + lines[i]
        yield begin + 1, whole
        i += 1


def _complete(statement: str) -> bool:
    try:
        tomllib.loads(statement)
    except tomllib.TOMLDecodeError:
        return False
    return True


def _inside(values: Any, dotted: str) -> Any:
    """The value under a dotted name; of an array of tables on the way, its last entry."""
    for part in re.split(r"\s*\.\s*", dotted):
        values = values[-1] if isinstance(values, list) else values
        values = values[part.strip("\"'")]
    return values


def _called(values: Any, number: int) -> str:
    return str(next((values[name] for name in _NAMED if name in values), number))


def _comment(after: str) -> str:
    """The text after a ``#`` that is no part of a text itself."""
    quote = ""
    for i, sign in enumerate(after):
        if quote:
            quote = "" if sign == quote else quote
        elif sign in "\"'":
            quote = sign
        elif sign == "#":
            return after[i + 1 :].split("\n")[0].strip()
    return ""


def _shown(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, list):
        return "[" + ", ".join(map(_shown, value)) + "]"
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_shown(one)}" for key, one in value.items()) + " }"
    return f"{value:,}".replace(",", "_") if isinstance(value, int) else str(value)
