"""A machine file with every key that there is, and the same with one wrong value."""

from __future__ import annotations

import re
from pathlib import Path

EVERY = Path(__file__).parents[2] / "controller" / "machine" / "every_key.toml"
TEXT = EVERY.read_text()
VALUE = re.compile(r"(?P<key>[A-Za-z_]\w*) = (?P<value>\{.*\}|\[.*\]|[^,}\n]+)")


def values_of_every_key() -> list[tuple[int, str, str]]:
    """(line, key, the text with a wrong value in its place), of every value in the file."""
    lines, found = TEXT.splitlines(), []
    for number, line in enumerate(lines, 1):
        for one in VALUE.finditer(line) if not line.startswith("#") else ():
            ends = [(one.start("value"), one.end("value"))]
            inside = [
                (m.start("value") + ends[0][0] + 1, m.end("value") + ends[0][0] + 1)
                for m in VALUE.finditer(one["value"][1:])
            ]
            for begin, end in [*ends, *inside]:
                name = line[:begin].rstrip(" =").split(" ")[-1]
                wrong = f"{line[:begin]}[[]]{line[end:]}"
                found.append((number, name, "\n".join([*lines[: number - 1], wrong, *lines[number:]])))
    return found
