"""The text of a program around a place: where a check has found a mistake."""

from __future__ import annotations

from itertools import islice
from pathlib import Path

from controller.program import source_text

SHOWN_BEFORE = 3  # lines of text above the one that is wrong
SHOWN_WIDE = 300  # columns of a line


def around(path: Path, line: int, column: int) -> list[str]:
    """The lines up to a place (1-based) with their numbers, and a caret under its column.

    Of lines in which the place is further to the right all show the same columns, those around it.
    """
    first = max(1, line - SHOWN_BEFORE)
    with open(path, encoding="utf-8", errors="replace") as file:
        words = [one.rstrip() for one in islice(file, first - 1, max(line, 0))]
    margins = [f"{number:>{max(6, len(str(line)))}}  " for number in range(first, first + len(words))]
    shown = source_text.pointed(words, column, SHOWN_WIDE)
    margins += [" " * len(margins[-1])] * (len(shown) - len(words)) if words else []
    return [f"{margin}{one}".rstrip() for margin, one in zip(margins, shown, strict=False)]
