"""The lines of an electronic data sheet (EDS or DCF, CiA 306-1): sections of keys and values.

By hand, for every start reads a sheet or two: configparser takes five times as long.
"""

from __future__ import annotations

import re

from drives.texts import TextError, message

BYTE_ORDER_MARK = "\xef\xbb\xbf"  # of UTF-8, read as Latin-1
COMMENT = re.compile(r"(?:^|\s);.*")

Sections = dict[str, dict[str, str]]


class LineError(TextError, ValueError):
    """A text is no data sheet: where, and why."""


def sections(text: str) -> Sections:
    """Values by key and section, spelt as they are written; of what stands twice the last counts.

    A line that says nothing is left out. Raises LineError for one that stands before the first section.
    """
    found: Sections = {}
    values: dict[str, str] | None = None
    for number, written in enumerate(text.removeprefix(BYTE_ORDER_MARK).split("\n"), 1):
        line = (COMMENT.sub("", written) if ";" in written else written).strip()
        if not line or line[0] == "#":
            continue
        if line[0] == "[" and "]" in line:
            values = found.setdefault(line[1 : line.rindex("]")], {})
        elif values is None:
            raise LineError(message("sheet.before_sections", line=number))
        else:
            name, equals, value = line.partition("=")
            if equals:
                values[name.rstrip()] = value.lstrip()
    return found


def written(kept: Sections) -> str:
    """The text of sections."""
    lines = []
    for section, values in kept.items():
        lines.append(f"[{section}]")
        lines += [f"{name}={value}" for name, value in values.items()]
    return "\n".join([*lines, ""])
