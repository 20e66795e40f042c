"""What a row of the table of codes has."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from enum import Enum

from controller.messages import Key, Message, message, text

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
    note: str = ""  # of a noted one: the key of ``told``
    forms: tuple[tuple[str, str], ...] = ()  # a word, or a plane, and the letters that are taken beside it
    alone: bool = False  # axis words beside it are never those of the modal motion

    @property
    def holds_axes(self) -> bool:
        """Whether the axis words of its line are its own, or nobody's: no modal motion takes them."""
        return self.group != "motion" and (self.alone or any(c in self.letters for c in AXES + "XYZABC"))

    def refused_with(self) -> dict[str, str]:
        """The values of what is said where it is refused."""
        parts = {part: key_of(part, self.name, self.dialect) for part in ("meaning", "instead")}
        return {"code": self.name, **parts}

    def noted_with(self) -> Message:
        """What ``check`` tells of a noted one."""
        meaning = key_of("meaning", self.name, self.dialect)
        return message("note.needs_nothing", code=self.name, meaning=meaning, told=Key(self.note))


_SOURCES = {"NIST": NIST, "LinuxCNC": LINUXCNC, "Fanuc": FANUC, "Haas": HAAS, "paper": PAPER}
_WORDS = ("rs274", "fanuc", "alone")


def done(table: str, forms: Mapping[tuple[str, str], Mapping[str, str]]) -> Iterator[Code]:
    """Rows of a text: a group, and below it NAME SOURCE [dialect] [alone] [letters]: MEANING.

    ``forms``: of codes that take other letters beside a word or in a plane, by name and dialect.
    """
    group = ""
    for line in table.strip().splitlines():
        if not line.startswith(" "):
            group = line
            continue
        head, _, meaning = line.partition(": ")
        name, source, *rest = head.split()
        dialect = next((word for word in rest if word in _WORDS[:2]), "")
        letters = "".join(word for word in rest if word not in _WORDS)
        row = Code(name, group, letters, _SOURCES[source], meaning, dialect=dialect, alone="alone" in rest)
        yield replace(row, forms=tuple(forms.get((name, dialect), {}).items()))


BESIDE_MOTION = ("G9", "G15", "G62")  # what needs no action, and stands in the lines of a modal motion


def noted(source: str, *rows: tuple[str, str, str], dialect: str = "") -> list[Code]:
    """Rows of name, letters, and why it needs no action, as ``told`` of the catalogue has it.

    The G codes among them stand in a block of their own on the controls that have them, but for a few.
    """
    made = []
    for name, letters, why in rows:
        meaning, told = (text(message(key)) for key in (key_of("meaning", name, dialect), f"told.{why}"))
        own_line = name[0] == "G" and name not in BESIDE_MOTION
        row = Code(name, name, letters, source, meaning, told, Fate.NOTED, dialect, note=f"told.{why}")
        made.append(replace(row, alone=own_line))
    return made


def refused(source: str, names: str, dialect: str = "") -> list[Code]:
    """Rows of which the catalogue has the meaning, and what to write instead."""
    made = []
    for name in names.split():
        meaning, instead = (text(message(key_of(part, name, dialect))) for part in ("meaning", "instead"))
        made.append(Code(name, "", "", source, meaning, instead, Fate.REFUSED, dialect))
    return made


def only(word: str, *rows: tuple[str, str, str, str]) -> list[Code]:
    """Noted with one word, refused else, under fanuc: name, letters, source, why it needs no action."""
    made = []
    for name, letters, source, why in rows:
        (row,) = noted(source, (name, letters, why), dialect="fanuc")
        made.append(replace(row, only=word, instead=text(message(key_of("instead", name, "fanuc")))))
    return made


def key_of(part: str, name: str, dialect: str) -> Key:
    """Of the meaning of a code that is refused, of what to write instead, or of a group."""
    return Key(".".join(filter(None, (part, name, dialect))))
