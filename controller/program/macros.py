"""Fanuc's custom macros: their statements (loops, jumps, conditions) as marks of a text, and their calls.

    WHILE [condition] DO1 ... END1      DO1 ... END1, which only a jump leaves
    GOTO 100                            to the line N100: the next one, else the first from the top
    #1=2 GOTO 100                       a setting before it
    IF [condition] GOTO 100             IF [condition] THEN #1=2.

They are written without an O-word and stand alone on their line; the first two letters of a word will
do (``WH[#1LT5]DO1`` ... ``EN1``, ``GO 10``, ``TH``; Fanuc B-63944EN, custom macro). Only under its dialect.

Called macros have their own #1 to #33 (Fanuc B-63684EN/01, 16.7):

    G65 P9010 L2 A1. B2. X3.     calls O9010 twice, with #1=1 #2=2 #24=3
    G65 P9010 I1. J2. I3.        a further set of I J K: #4=1 #5=2 #7=3
    G66 P9010 A1.                calls it behind each line that moves, until G67

What is set last counts. A round of L, and a call of G66, finds the values that the one before has left.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from types import MappingProxyType
from typing import NamedTuple

from controller.messages import message
from controller.program.expressions import GAPS
from controller.program.line import ANGLES, AXES, CENTRE, LENGTHS, Line, Word, pointed
from controller.program.marks import Mark, behind_bracket
from controller.program.parameters import Name
from controller.program.program import ProgramError
from controller.program.source_text import NEWLINE, Text, without_comments

GOTO, IF_GOTO, IF_THEN = "goto", "if goto", "if then"  # keywords; a loop is a while of an O-word
GOTO_WORDS, THEN_WORDS = ("goto", "go"), ("then", "th")  # as written

_BEGIN = r"(?<![^\r\n])[ \t]*(?P<deleted>/[1-9]?)?[ \t]*"
_STATEMENT = re.compile(
    _BEGIN + r"(?:N[ \t]*[0-9]+[ \t]*)?(?:#[^\r\n(;]*?(?=GO(?:TO)?[ \t]*[0-9#\[]))?"
    r"(?P<word>(?:WH(?:ILE)?|IF)(?=[ \t]*\[)|GO(?:TO)?(?=[ \t]*[0-9#\[])|(?:DO|END?)(?=[ \t]*[0-9]))",
    re.IGNORECASE,
)
_DO = re.compile(rf"do[ \t]*([0-9]+)[{GAPS}]*$")
_DO_AND_MORE = re.compile(rf"(?:\][{GAPS}]*|(?<![a-z]))(do[ \t]*[0-9]+)[{GAPS}]*[^{GAPS}0-9]")
_NUMBER = re.compile(rf"[ \t]*([0-9]+)[{GAPS}]*$")
# A pattern for each letter: one that begins with a letter is looked for at a run.
_SIGNS = [
    re.compile(sign)
    for form in (
        rb"W[hH](?:[iI][lL][eE])?[ \t]*\[",
        rb"G[oO](?:[tT][oO])?[ \t]*[0-9#\[]",
        rb"I[fF][ \t]*\[",
        rb"D[oO][ \t]*[0-9]",
    )
    for sign in (form, form[:1].lower() + form[1:])
]


def may_stand_in(text: Text) -> bool:
    """Whether a text may have a statement."""
    return any(sign.search(text.body) for sign in _SIGNS)


def statements(text: str, name: str, end: int) -> Iterator[Mark]:
    """The marks of a text up to ``end``; what only looks like a statement has none."""
    loops, number, before = _Loops(), 1, 0
    for found in _STATEMENT.finditer(text, 0, end):
        at = found.start()
        number, before = number + sum(1 for _ in NEWLINE.finditer(text, before, at)), at
        newline = NEWLINE.search(text, found.end())
        raw, begins = text[at : newline.start() if newline else len(text)], found.start("word") - at
        bare = without_comments(raw, name, number).lower()
        kind = _kind(found["word"].lower(), bare, begins, loops)
        if kind is None and (more := _DO_AND_MORE.search(bare, begins)) is not None:
            why = message("flow.behind_do", do=" ".join(more[1].upper().split()))
            raise ProgramError(name, number, more.end(1) + 1, why)
        if kind is not None:
            after = newline.end() if newline else len(text) + 1
            written = " ".join(raw[begins:].split())
            yield Mark(at, after, number, *kind, found["deleted"] is not None, written, begins + 1)


class _Loops:
    """Those that are under way, by number and the label that each has as an O-word."""

    def __init__(self) -> None:
        self._open: list[tuple[str, str]] = []
        self._count = 0

    def begin(self, number: str) -> str:
        self._count += 1
        self._open.append((number, f"{number}.{self._count}"))
        return self._open[-1][1]

    def end(self, number: str) -> str:
        """Of the innermost of that number; of one that nobody began its number alone."""
        one = next((one for one in reversed(self._open) if one[0] == number), (number, number))
        self._open = [other for other in self._open if other != one]
        return one[1]


def _kind(word: str, bare: str, begins: int, loops: _Loops) -> tuple[str, str, str, int] | None:
    """Label, keyword, line and where what it takes begins, of a statement; None where it is none."""
    rest = begins + len(word)
    if word in GOTO_WORDS:
        return "", GOTO, bare, rest
    if word == "if":
        behind = behind_bracket(bare, rest).lstrip(GAPS)
        keyword = {"go": IF_GOTO, "th": IF_THEN}.get(behind[:2])
        return None if keyword is None else ("", keyword, bare, rest)
    if word in ("end", "en"):
        closed = _NUMBER.match(bare, rest)
        return None if closed is None else (loops.end(closed[1]), "endwhile", bare[:rest], rest)
    loop = _DO.search(bare, begins)
    if loop is None:
        return None
    label = loops.begin(loop[1])
    if word == "do":  # for ever
        return label, "while", bare[:begins] + "[1]", begins
    return label, "while", bare[: loop.start()], rest


def line_of(text: str, number: int, low: int, high: int) -> int | None:
    """The offset of the line N ``number`` between two offsets; None where there is none."""
    found = re.compile(rf"{_BEGIN}[nN][ \t]*0*{number}(?![0-9.])").search(text, low, high)
    return found.start() if found else None


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
