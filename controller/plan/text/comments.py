"""Comments of a line: blanked out, but for those that say something to the operator.

``(MSG, text)``, ``(DEBUG, text)``, ``(PRINT, text)`` and ``(LOG, text)`` are shown at their place in the run;
in DEBUG, PRINT and LOG parameters such as ``#1`` and ``#<name>`` stand for their values.
"""

from __future__ import annotations

import re

from controller.plan.text.program import ProgramError

_COMMENT = re.compile(r"[();]")


def without_comments(raw: str, name: str, number: int) -> str:
    """The line with every comment blanked out by marks, so that columns stay."""
    parts: list[str] = []
    start = 0
    while mark := _COMMENT.search(raw, start):
        at = mark.start()
        parts.append(raw[start:at])
        if mark.group() == ";":
            return "".join([*parts, "\0" * (len(raw) - at)])
        close = raw.find(")", at)
        if mark.group() == ")" or close < 0 or raw.find("(", at + 1, close) >= 0:
            raise ProgramError(
                name,
                number,
                at + 1,
                "this parenthesis has no partner: a comment runs from ( to the next ) on one line, without "
                "another ( inside; close it, or write the comment after a ;",
            )
        start = close + 1
        parts.append("\0" * (start - at))
    return "".join([*parts, raw[start:]]) if parts else raw
