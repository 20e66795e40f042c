"""Comments of a line: blanked out, but for those that say something to the operator.

``(MSG, text)``, ``(DEBUG, text)``, ``(PRINT, text)`` and ``(LOG, text)`` are shown at their place in the run;
``(ABORT, text)`` ends the program there, in the reader's language where the text is ``cycle.NAME value=...``
and the catalogue has a sentence of that name. In all but MSG parameters such as ``#1`` and ``#<name>``
stand for their values, with six decimals; behind ``%d``, ``%f`` or ``%.2f`` with none, four or so many, to
the end of the comment (as LinuxCNC).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator

from controller.messages import DEFAULT, LANGUAGES, Message, message
from controller.program.program import ProgramError

_COMMENT = re.compile(r"[();]")
_SAYS = re.compile(r"\([ \t]*(msg|debug|print|log|abort)[ \t]*,([^()]*)\)", re.IGNORECASE)
_VALUE = re.compile(r"%d|%f|%\.([0-9])f|(##*(?:<[^<>]*>|[0-9]+))")
_OF_CYCLE = re.compile(r"(cycle\.[a-z_]+)((?: [a-z_]+=[-+.0-9#]+)*)")
_PLACE = re.compile(r"\{([a-z_]+)\}")
_PAIR = re.compile(r"([a-z_]+)=(\S+)")
_UNSET = "######"  # shown of what has no value
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
            raise ProgramError(name, number, at + 1, message("text.parenthesis"))
        start = close + 1
        parts.append("\0" * (start - at))
    return "".join([*parts, raw[start:]]) if parts else raw


def message_text(raw: str, values: Callable[[str], float], debug: bool = True) -> str:
    """What the comments of a line say to the operator, or ""; ``values``: that of a ``#1`` or ``#<name>``.

    ``debug``: DEBUG says something, too.
    """
    silent = ("abort",) if debug else ("abort", "debug")
    shown = [_shown(found, values) for found in _saying(raw) if found[1].lower() not in silent]
    return _short(" ".join(shown))


def aborted(raw: str, values: Callable[[str], float]) -> tuple[int, str] | None:
    """Column and text of what ends the program on a line; None: nothing does."""
    found = next((found for found in _saying(raw) if found[1].lower() == "abort"), None)
    return None if found is None else (found.start() + 1, _short(_shown(found, values)))


def ended(text: str) -> Message:
    """Why a program ends itself by ABORT."""
    found = _OF_CYCLE.fullmatch(text)
    sentence = "" if found is None else LANGUAGES[DEFAULT].texts.get(found[1], "")
    values = {} if found is None else dict(_PAIR.findall(found[2]))
    if found is None or not sentence or not values.keys() >= set(_PLACE.findall(sentence)):
        return message("text.abort", text=text)
    return message(found[1], **values)


def _saying(raw: str) -> Iterator[re.Match[str]]:
    """The comments that say something, up to a ;."""
    for found in _SAYS.finditer(raw):
        if ";" in raw[: found.start()].split(")")[-1]:
            return
        yield found


def _shown(found: re.Match[str], values: Callable[[str], float]) -> str:
    """The text of one of them."""
    if found[1].lower() == "msg":
        return found[2]
    decimals = 6

    def put(at: re.Match[str]) -> str:
        nonlocal decimals
        if at[2] is None:
            decimals = int(at[1]) if at[1] else 4 if at[0] == "%f" else 0
            return ""
        try:
            return f"{round(values(at[2]), decimals) + 0.0:.{decimals}f}"
        except ProgramError:
            return _UNSET

    return _VALUE.sub(put, found[2])


def _short(text: str) -> str:
    return " ".join(text.split())[:LONGEST]
