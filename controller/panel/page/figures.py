"""Figures of a program as the page's lists have them: a size, a time, the lines around a mistake."""

from __future__ import annotations

from pathlib import Path
from typing import Any

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


def size(count: int) -> str:
    """Bytes in words."""
    value, unit = float(count), "B"
    for unit in ("B", "kB", "MB", "GB"):
        if value < 1000.0 or unit == "GB":
            break
        value /= 1000.0
    return f"{value:.0f} {unit}" if unit == "B" else f"{value:.1f} {unit}"


def percent(share: float) -> str:
    """A share in words."""
    return f"{share * 100:.0f} %"


def clock(seconds: float | None) -> str:
    """``67.7`` as ``1:08``; a dash where nothing is known."""
    if seconds is None:
        return "–"
    whole = round(seconds)
    hours, minutes = divmod(whole // 60, 60)
    return f"{hours}:{minutes:02d}:{whole % 60:02d}" if hours else f"{minutes}:{whole % 60:02d}"


def overcut(check: dict[str, Any]) -> str:
    """The deepest cut into the part, where a verification has told it."""
    deepest = (check.get("verified") or {}).get("overcut_mm")
    return "" if deepest is None else f"{deepest * 1000.0:.1f} µm"
