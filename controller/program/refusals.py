"""All that is refused in a program, in one answer: a post that writes one word wrong writes it on every line.

Reading goes on behind a line that is refused, as if it were not there. O-words that make no whole
structure end the search, for nothing tells then in which order lines run.
"""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from controller.machine.model import Joints, Machine
from controller.messages import DEFAULT, Message, chain, message, text
from controller.program import blocks, linked, source_text
from controller.program.program import ProgramError
from controller.program.source_text import NEWLINE

MAX_REPORTED = 100  # that are told one by one
MAX_WIDE = 100  # columns of a line that is shown
MAX_BLOCKS = 1_000_000  # that are read to find them
MAX_REPEATED = 10_000  # refusals of lines that are refused already


class _Enough(Exception):
    """What a loop repeats has been refused often enough."""


class _Refused(list[ProgramError]):
    """The refusals as they are met, one for each place."""

    def __init__(self) -> None:
        super().__init__()
        self._places: set[tuple[str, int, int]] = set()
        self._repeated = 0

    def append(self, error: ProgramError) -> None:
        """Raises _Enough: a loop whose counter is refused would run for ever."""
        place = (error.file, error.line, error.column)
        if place not in self._places:
            self._places.add(place)
            super().append(error)
            return
        self._repeated += 1
        if self._repeated > MAX_REPEATED:
            raise _Enough

    def clear(self) -> None:
        super().clear()
        self._places.clear()


def of(data: bytes, machine: Machine, name: str, start: Joints | None = None) -> list[ProgramError]:
    """The refusals of the text of a program as they are met, one for each place; none where it reads well."""
    refused = _Refused()
    with contextlib.suppress(_Enough):
        try:
            for count, _ in enumerate(blocks.stream(data, machine, name, start=start, refused=refused)):
                if count > MAX_BLOCKS:
                    break
        except ProgramError as error:
            refused.append(error)
    return list(refused)


def counts(refused: Sequence[ProgramError]) -> dict[str, int]:
    """How many there are of each code or letter, most first; "" of what is about neither."""
    return dict(Counter(error.about for error in refused).most_common())


def summed(refused: Sequence[ProgramError]) -> Message:
    """One sentence that counts them."""
    each: list[Message | str] = [
        message("program.count" if about else "program.count_other", about=about, count=count)
        for about, count in counts(refused).items()
    ]
    return message("program.summed", count=len(refused), each=chain("program.listed", each))


def lines_of(data: bytes, name: str) -> dict[str, list[str]]:
    """The lines of a program, and of the files that it calls, by their names."""
    program, files = linked.parts(data)
    texts = {name: program, **dict(files.values())}
    return {file: NEWLINE.split(bytes(one).decode(errors="replace")) for file, one in texts.items()}


def shown(error: ProgramError, by_file: Mapping[str, Sequence[str]]) -> list[str]:
    """The line of a refusal, and a caret below the column; nothing where the line is not there."""
    lines = by_file.get(error.file, ())
    if not 0 < error.line <= len(lines):
        return []
    return source_text.pointed([lines[error.line - 1]], error.column, MAX_WIDE)


def pointed(error: ProgramError, by_file: Mapping[str, Sequence[str]], language: str = DEFAULT) -> str:
    """What is told of a refusal, with its line and the caret."""
    return "\n    ".join([text(error.placed, language), *shown(error, by_file)])


def facts(
    refused: Sequence[ProgramError], by_file: Mapping[str, Sequence[str]], program: str
) -> dict[str, Any]:
    """The same for JSON; ``called_at``: of what is in a called file, the line that calls it."""

    def row(one: ProgramError) -> dict[str, Any]:
        place = {"file": one.file, "line": one.line, "column": one.column, "code": one.about}
        if one.file != program:
            place["called_at"] = one.line_in(program)
        return {**place, **one.said, "shown": shown(one, by_file)}

    return {"refusals": [row(one) for one in refused[:MAX_REPORTED]], "counts": counts(refused)}
