"""All that is refused in a program, in one answer: a post that writes one word wrong writes it on every line.

Reading goes on behind a line that is refused, as if it were not there. O-words that make no whole
structure end the search, for nothing tells then in which order lines run.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

from controller.machine.model import Joints, Machine
from controller.program import blocks
from controller.program.program import ProgramError

MOST = 100  # that are told one by one
MAX_WIDE = 100  # columns of a line that is shown
MAX_BLOCKS = 1_000_000  # that are read to find them


def of(data: bytes, machine: Machine, name: str, start: Joints | None = None) -> list[ProgramError]:
    """The refusals of the text of a program as they are met, one for each place; none where it reads well."""
    refused: list[ProgramError] = []
    try:
        for count, _ in enumerate(blocks.stream(data, machine, name, start=start, refused=refused)):
            if count > MAX_BLOCKS:
                break
    except ProgramError as error:
        refused.append(error)
    places: dict[tuple[str, int, int], ProgramError] = {}
    for one in refused:
        places.setdefault((one.file, one.line, one.column), one)
    return list(places.values())


def counts(refused: Sequence[ProgramError]) -> dict[str, int]:
    """How many there are of each code or letter, most first; "" of what is about neither."""
    return dict(Counter(error.about for error in refused).most_common())


def summed(refused: Sequence[ProgramError]) -> str:
    """One line that counts them."""
    each = ", ".join(f"{about or 'other'} {count}" for about, count in counts(refused).items())
    return f"{len(refused)} refusals: {each}."


def pointed(error: ProgramError, name: str, lines: Sequence[str]) -> str:
    """What is told of a refusal, its line, and a caret below the column; ``lines`` are those of ``name``."""
    if error.file != name or not 0 < error.line <= len(lines) or len(lines[error.line - 1]) > MAX_WIDE:
        return str(error)
    text = "".join(sign if sign.isprintable() else " " for sign in lines[error.line - 1])
    return f"{error}\n    {text}\n    {' ' * (error.column - 1)}^"


def facts(refused: Sequence[ProgramError]) -> dict[str, Any]:
    """The same for JSON."""
    rows = [
        {
            "file": one.file,
            "line": one.line,
            "column": one.column,
            "sentence": one.sentence,
            "code": one.about,
        }
        for one in refused[:MOST]
    ]
    return {"refusals": rows, "counts": counts(refused)}
