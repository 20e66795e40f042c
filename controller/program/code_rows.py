"""What a row of the table of codes has."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

AXES = "@"  # in ``letters``: the axes of the machine

NIST = "RS-274/NGC"
LINUXCNC = "LinuxCNC"
FANUC = "Fanuc"
HAAS = "Haas"
PAPER = "Lin & Koren"
HURCO = "Hurco"
MAZAK = "Mazak"
BROTHER = "Brother"
OURS = "Directrix"


class Fate(Enum):
    """What comes of a code."""

    DONE = "done"
    NOTED = "noted"
    REFUSED = "refused"


@dataclass(frozen=True, slots=True)
class Code:
    """One row; ``told`` is what is done, or what a noted one would have done, or what to use instead."""

    name: str
    group: str  # of one group a line takes one code; a noted code is a group of its own
    letters: str  # the words that it takes
    source: str
    meaning: str
    told: str = ""
    fate: Fate = Fate.DONE
    dialect: str = ""  # "" = both
    only: str = ""  # of a noted one: the word with which alone it needs no action ...
    instead: str = ""  # ... and what to write in place of any other


def done(group: str, source: str, *rows: tuple[str, str, str], dialect: str = "") -> list[Code]:
    """Rows of name, letters, meaning."""
    return [Code(name, group, letters, source, meaning, dialect=dialect) for name, letters, meaning in rows]


def noted(source: str, *rows: tuple[str, str, str, str], dialect: str = "") -> list[Code]:
    """Rows of name, letters, meaning, what they would have done."""
    made = []
    for name, letters, meaning, told in rows:
        made.append(Code(name, name, letters, source, meaning, told, Fate.NOTED, dialect))
    return made


def refused(source: str, *rows: tuple[str, str, str], dialect: str = "") -> list[Code]:
    """Rows of name, meaning, what to write instead."""
    return [Code(name, "", "", source, meaning, told, Fate.REFUSED, dialect) for name, meaning, told in rows]


def only(word: str, *rows: tuple[str, str, str, str, str, str]) -> list[Code]:
    """Noted with one word, refused else, under fanuc: name, letters, source, meaning, told, what instead."""
    made = []
    for name, letters, source, meaning, told, instead in rows:
        made.append(Code(name, name, letters, source, meaning, told, Fate.NOTED, "fanuc", word, instead))
    return made
