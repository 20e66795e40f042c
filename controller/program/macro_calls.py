"""Calls of Fanuc's custom macros, whose #1 to #33 are their own (Fanuc B-63684EN/01, 16.7).

    G65 P9010 L2 A1. B2. X3.     calls O9010 twice, with #1=1 #2=2 #24=3
    G65 P9010 I1. J2. I3.        a further set of I J K: #4=1 #5=2 #7=3
    G66 P9010 A1.                calls it behind each line that moves, until G67

What is set last counts. A round of L, and a call of G66, finds the values that the one before has left.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import NamedTuple

from controller.program.line import ANGLES, AXES, CENTRE, LENGTHS, Line, Word, pointed
from controller.program.parameters import Name

NOW, BEHIND_MOVES, NO_MORE = 65.0, 66.0, 67.0  # G65, G66, G67
NUMBER_OF = MappingProxyType(
    {
        **dict(zip("ABCIJKDEF", range(1, 10), strict=True)),
        **dict(zip("QRSTUVWXYZ", range(17, 27), strict=True)),
        "H": 11,
        "M": 13,
    }
)
SETS = 10  # of I J K, from #4 on
_WITHOUT_MOVE = frozenset((4.0, 10.0, 28.1, 30.1, 43.1, 52.0, 68.0, 68.2, 68.4, 92.0))  # take axis words


class Macro(NamedTuple):
    """What is called, how often, with its own parameters as it has left them, and the line that says so."""

    label: str
    rounds: int
    values: dict[Name, float]
    line: Line
    call: Word


def call_in(line: Line) -> Word | None:
    """The word of a line that calls, or ends calls."""
    codes = (NOW, BEHIND_MOVES, NO_MORE)
    return next((word for word in line.words if word.letter == "G" and word.value in codes), None)


def parted(line: Line, call: Word) -> tuple[tuple[Word, ...], tuple[Word, ...]]:
    """The words before the call, and those behind it. Raises ProgramError."""
    at = line.words.index(call)
    before, behind = line.words[:at], line.words[at + 1 :]
    for word in before if call.value != NO_MORE else ():
        if word.letter != "G":
            raise line.refusal(word, "macro.before", code=call.text)
    return before, behind


def arguments(
    line: Line, call: Word, words: tuple[Word, ...], without_point: str, inches: bool
) -> dict[Name, float]:
    """Numbers and values of what a macro begins with. Raises ProgramError."""
    found: dict[Name, float] = {}
    sets, last = 0, "K"
    for word in words:
        if word.letter in LENGTHS + ANGLES:
            word = pointed(word, without_point, inches and word.letter in LENGTHS, line.refusal)
        value = word.value
        if word.letter in "IJK":
            sets += word.letter <= last
            last = word.letter
            if sets > SETS:
                raise line.refusal(word, "macro.too_many_sets", most=SETS)
            found[NUMBER_OF["I"] + 3 * (sets - 1) + "IJK".index(word.letter)] = value
        elif word.letter in NUMBER_OF:
            found[NUMBER_OF[word.letter]] = value
        else:
            raise line.refusal(word, "macro.no_argument", code=call.text)
    return found


def moves(line: Line) -> bool:
    """Whether axes have words on a line of which no code takes them for anything else than a move."""
    if line.is_plain and (parts := line.parts) is not None:
        return any(part is not None for part in parts[AXES:CENTRE])
    codes = {word.value for word in line.words if word.letter == "G"}
    return not codes & _WITHOUT_MOVE and any(word.letter in "XYZABCUVW" for word in line.words)
