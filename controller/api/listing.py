"""The text of a program around a place: where a check has found a mistake."""

from __future__ import annotations

from pathlib import Path

SHOWN_BEFORE = 3  # lines of text above the one that is wrong
SHOWN_WIDE = 300  # columns of a line


def around(path: Path, line: int, column: int) -> list[str]:
    """The lines up to a place (1-based) with their numbers, and a caret under its column.

    Of lines that are longer than ``SHOWN_WIDE`` all show the same columns, those around the place.
    A sign that has no width, or another one, takes one column as any other.
    """
    first = max(0, column - SHOWN_WIDE // 2) if column > SHOWN_WIDE else 0
    width = max(6, len(str(line)))
    found = []
    with open(path, encoding="utf-8", errors="replace") as file:
        for number, words in enumerate(file, 1):
            if number > line:
                break
            if number > line - SHOWN_BEFORE - 1:
                shown = words.rstrip()[first : first + SHOWN_WIDE]
                found.append(f"{number:>{width}}  {_even(shown)}".rstrip())
    if column > 0:
        found.append(" " * (width + 2 + column - 1 - first) + "^")
    return found


def _even(words: str) -> str:
    """A tab is as wide as it likes; the caret counts it as one."""
    return "".join(sign if sign.isprintable() else " " for sign in words)
