"""The statements of Fanuc's custom macros as marks of a text: loops, jumps and conditions.

    WHILE [condition] DO1 ... END1      DO1 ... END1, which only a jump leaves
    GOTO 100                            to the line N100: the next one, else the first from the top
    IF [condition] GOTO 100             IF [condition] THEN #1=2.

They are written without an O-word and stand alone on their line. Only under the dialect of Fanuc.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from controller.program.comments import without_comments
from controller.program.decoding import NEWLINE, Text
from controller.program.expressions import GAPS
from controller.program.marks import Mark, behind_bracket

GOTO, IF_GOTO, IF_THEN = "goto", "if goto", "if then"  # keywords; a loop is a while of an O-word

_BEGIN = r"(?<![^\r\n])[ \t]*(?P<deleted>/?)[1-9]?[ \t]*(?:N[ \t]*[0-9]+[ \t]*)?"
_STATEMENT = re.compile(
    _BEGIN + r"(?P<word>WHILE(?=[ \t]*\[)|IF(?=[ \t]*\[)|GOTO(?=[ \t]*[0-9#\[])|(?:DO|END)(?=[ \t]*[0-9]))",
    re.IGNORECASE,
)
_DO = re.compile(rf"do[ \t]*([0-9]+)[{GAPS}]*$")
_NUMBER = re.compile(rf"[ \t]*([0-9]+)[{GAPS}]*$")
# A pattern for each letter: one that begins with a letter is looked for at a run.
_SIGNS = [
    re.compile(sign)
    for sign in (
        rb"W[hH][iI][lL][eE]",
        rb"w[hH][iI][lL][eE]",
        rb"G[oO][tT][oO]",
        rb"g[oO][tT][oO]",
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
    opened: list[tuple[str, str]] = []  # number and label of the loops under way
    number, before, count = 1, 0, 0
    for found in _STATEMENT.finditer(text, 0, end):
        at = found.start()
        number, before = number + sum(1 for _ in NEWLINE.finditer(text, before, at)), at
        newline = NEWLINE.search(text, found.end())
        raw = text[at : newline.start() if newline else len(text)]
        bare, word, begins = (
            without_comments(raw, name, number).lower(),
            found["word"].lower(),
            found.start("word") - at,
        )
        keyword, label, rest = word, "", begins + len(word)
        if word in ("while", "do"):
            loop = _DO.search(bare, begins)
            if loop is None:
                continue
            count += 1
            keyword, label = "while", f"{loop[1]}.{count}"
            opened.append((loop[1], label))
            bare = bare[: loop.start()] if word == "while" else bare[:begins] + "[1]"
            rest = rest if word == "while" else begins
        elif word == "end":
            if (closed := _NUMBER.match(bare, rest)) is None:
                continue
            one = next((one for one in reversed(opened) if one[0] == closed[1]), (closed[1], closed[1]))
            opened = [other for other in opened if other != one]
            keyword, label, bare = "endwhile", one[1], bare[:rest]
        elif word == "if":
            behind = behind_bracket(bare, rest).lstrip(GAPS)
            keyword = IF_GOTO if behind.startswith("goto") else IF_THEN
            if keyword == IF_THEN and not behind.startswith("then"):
                continue
        after = newline.end() if newline else len(text) + 1
        written = " ".join(raw[begins:].split())
        yield Mark(at, after, number, label, keyword, bare, rest, bool(found["deleted"]), written, begins + 1)


def line_of(text: str, number: int, low: int, high: int) -> int | None:
    """The offset of the line N ``number`` between two offsets; None where there is none."""
    found = re.compile(rf"{_BEGIN.split('(?:N')[0]}[nN][ \t]*0*{number}(?![0-9.])").search(text, low, high)
    return found.start() if found else None
