"""The statements of Fanuc's custom macros as marks of a text: loops, jumps and conditions.

    WHILE [condition] DO1 ... END1      DO1 ... END1, which only a jump leaves
    GOTO 100                            to the line N100: the next one, else the first from the top
    IF [condition] GOTO 100             IF [condition] THEN #1=2.

They are written without an O-word and stand alone on their line; the first two letters of a word will
do (``WH[#1LT5]DO1`` ... ``EN1``, ``GO 10``, ``TH``; Fanuc B-63944EN, custom macro). Only under its dialect.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from controller.program.comments import without_comments
from controller.program.decoding import NEWLINE, Text
from controller.program.expressions import GAPS
from controller.program.marks import Mark, behind_bracket

GOTO, IF_GOTO, IF_THEN = "goto", "if goto", "if then"  # keywords; a loop is a while of an O-word
GOTO_WORDS, THEN_WORDS = ("goto", "go"), ("then", "th")  # as written

_BEGIN = r"(?<![^\r\n])[ \t]*(?P<deleted>/[1-9]?)?[ \t]*"
_STATEMENT = re.compile(
    _BEGIN + r"(?:N[ \t]*[0-9]+[ \t]*)?"
    r"(?P<word>(?:WH(?:ILE)?|IF)(?=[ \t]*\[)|GO(?:TO)?(?=[ \t]*[0-9#\[])|(?:DO|END?)(?=[ \t]*[0-9]))",
    re.IGNORECASE,
)
_DO = re.compile(rf"do[ \t]*([0-9]+)[{GAPS}]*$")
_NUMBER = re.compile(rf"[ \t]*([0-9]+)[{GAPS}]*$")
# A pattern for each letter: one that begins with a letter is looked for at a run.
_SIGNS = [
    re.compile(sign)
    for sign in (
        rb"W[hH](?:[iI][lL][eE])?[ \t]*\[",
        rb"w[hH](?:[iI][lL][eE])?[ \t]*\[",
        rb"G[oO](?:[tT][oO])?[ \t]*[0-9#\[]",
        rb"g[oO](?:[tT][oO])?[ \t]*[0-9#\[]",
        rb"I[fF][ \t]*\[",
        rb"i[fF][ \t]*\[",
        rb"D[oO][ \t]*[0-9]",
        rb"d[oO][ \t]*[0-9]",
    )
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
