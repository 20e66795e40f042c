"""A place in a text as people are shown it: its line, and a caret below the column."""

from __future__ import annotations

from collections.abc import Sequence


def pointed(lines: Sequence[str], column: int, wide: int) -> list[str]:
    """Lines of which the last is the one of the place, and a caret under its column (1-based; 0: none).

    A column beyond ``wide`` is shown in the middle of as many. A sign that has no width, or another one,
    takes one column as any other: a tab is as wide as it likes.
    """
    first = max(0, column - wide // 2) if column > wide else 0
    even = [
        "".join(sign if sign.isprintable() else " " for sign in line[first : first + wide]) for line in lines
    ]
    return [*even, f"{' ' * (column - 1 - first)}^"] if column > 0 else even
