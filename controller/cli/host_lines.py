"""What a look at a computer finds, line by line: whether it is good, and what is to be written where.

``service self-test`` and ``host check`` are made of these, and the report of ``host measure`` too.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from controller.verify import console

WIDTH = 80  # columns of a terminal
INDENT = 23  # of what is found: a verdict, and a name of 16 letters


@dataclass(frozen=True, slots=True)
class Write:
    """A line for a file of the computer, and the name of what makes it count (``host.then.NAME``)."""

    file: str
    line: str
    then: str

    @property
    def where(self) -> str:
        """The file, and whether the line is one of its own there."""
        return _say("at_end" if self.then == "one_line" else "in_file", file=self.file)


@dataclass(frozen=True, slots=True)
class Line:
    """One thing that was looked at."""

    what: str
    passed: bool | None  # None: it cannot be seen from here
    found: str
    remedy: str = ""  # "" where it passed
    bus: str = ""  # whose it is, if of one
    good: str = ""  # what is wanted, where ``host check`` says it
    writes: tuple[Write, ...] = ()
    needed: bool = True  # otherwise it helps, and a computer is fit without it

    @property
    def name(self) -> str:
        """Of the line, whatever language is spoken."""
        return f"{self.bus} {self.what}".strip()

    @property
    def shown(self) -> str:
        """The name for people."""
        return f"{self.bus} {_say('name.' + self.what.replace(' ', '_'))}".strip()

    @property
    def is_fit(self) -> bool:
        """What cannot be seen, and is needed, is not known to be good."""
        return bool(self.passed) or not self.needed

    @property
    def verdict(self) -> str:
        """``pass``, ``hint``, ``fail`` or ``unseen``."""
        if self.passed is None:
            return "unseen"
        return "pass" if self.passed else "fail" if self.needed else "hint"

    @property
    def advice(self) -> str:
        """What to do, in one sentence; "" where it passed."""
        written = [f"{one.where} {one.line}" for one in self.writes]
        return "; ".join(filter(None, (self.remedy, *written)))

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        written = [{"file": one.file, "line": one.line, "then": say_then(one.then)} for one in self.writes]
        return {
            "name": self.name,
            "passed": self.passed is True,
            "verdict": self.verdict,
            "needed": self.needed,
            "found": self.found,
            "good": self.good,
            "remedy": self.advice,
            "write": written,
        }


def line(
    what: str,
    passed: bool | None,
    found: str,
    remedy: str = "",
    *writes: Write,
    bus: str = "",
    good: str = "",
    needed: bool = True,
) -> Line:
    """A line that has a remedy only where it did not pass."""
    if passed:
        return Line(what, passed, found, "", bus, good, (), needed)
    return Line(what, passed, found, remedy, bus, good, writes, needed)


def say_then(then: str) -> str:
    """What makes a written line count."""
    return _say(f"then.{then}")


def text_rows(one: Line) -> Iterator[str]:
    """A line for people, in rows of 80 columns; a row to be copied is whole."""
    first = f"{_say(one.verdict):<4}  {one.shown:<16} "
    yield from _wrapped(first, one.found)
    yield from _labelled("good", one.good)
    yield from _labelled("remedy", one.remedy)
    for written in one.writes:
        yield from _labelled("write", written.where)
        yield f"  {written.line}"
        yield from _labelled("next", say_then(written.then))


def _labelled(label: str, text: str) -> Iterator[str]:
    if text:
        yield from _wrapped(f"{'':<6}{_say('label.' + label):<16} ", text)


def _wrapped(first: str, text: str) -> list[str]:
    later = " " * INDENT
    return textwrap.wrap(
        text, WIDTH, initial_indent=first, subsequent_indent=later, break_on_hyphens=False
    ) or [first.rstrip()]


def _say(key: str, **values: object) -> str:
    return console.say(f"host.{key}", **values)
