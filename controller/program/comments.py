"""Comments of a line: blanked out, but for those that say something to the operator.

``(MSG, text)``, ``(DEBUG, text)``, ``(PRINT, text)`` and ``(LOG, text)`` are shown at their place in the run;
in DEBUG, PRINT and LOG parameters such as ``#1`` and ``#<name>`` stand for their values.
"""

from __future__ import annotations

import re
from collections.abc import Callable

from controller.messages import said
from controller.program.program import ProgramError

_COMMENT = re.compile(r"[();]")
_SAYS = re.compile(r"\([ \t]*(msg|debug|print|log)[ \t]*,([^()]*)\)", re.IGNORECASE)
_VALUE = re.compile(r"(%d|%\.[0-9]f|%f|%lf)?(##*(?:<[^<>]*>|[0-9]+))")
LONGEST = 200  # characters of what is shown


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
            raise ProgramError(name, number, at + 1, said("text.parenthesis"))
        start = close + 1
        parts.append("\0" * (start - at))
    return "".join([*parts, raw[start:]]) if parts else raw


def message(raw: str, values: Callable[[str], float], debug: bool = True) -> str:
    """What the comments of a line say to the operator, or ""; ``values``: that of a ``#1`` or ``#<name>``.

    ``debug``: DEBUG says something, too.

    DEBUG, PRINT and LOG show them with six decimals, behind %d or %.2f so many (as LinuxCNC).
    """
    told = []
    for found in _SAYS.finditer(raw):
        if ";" in raw[: found.start()].split(")")[-1]:
            break
        kind, text = found[1].lower(), found[2]
        if kind == "debug" and not debug:
            continue
        told.append(text if kind == "msg" else _VALUE.sub(lambda at: _shown(at[1], values(at[2])), text))
    return " ".join(" ".join(told).split())[:LONGEST]


def _shown(form: str | None, value: float) -> str:
    if form is None or form in ("%f", "%lf"):
        return f"{value:.6f}"
    return f"{round(value)}" if form == "%d" else f"{value:.{form[2]}f}"
