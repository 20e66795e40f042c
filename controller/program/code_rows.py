"""What a row of the table of codes has."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import Enum

from controller.messages import Key, Message, message, text

AXES = "@"  # in ``letters``: the axes of the machine


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


_SOURCES = {"NIST": "RS-274/NGC", "paper": "Lin & Koren"}  # of those that are not as written
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
        source, others = _SOURCES.get(source, source), tuple(forms.get((name, dialect), {}).items())
        alone = "alone" in rest
        yield Code(name, group, letters, source, meaning, dialect=dialect, forms=others, alone=alone)


BESIDE_MOTION = ("G9", "G15", "G62")  # what needs no action, and stands in the lines of a modal motion
_ONLY = {"G54.4": "P0", "G10.9": "X0"}  # with this word alone; refused with any other
_GROUPS = {"M51": "overrides"}  # of what needs no action, and is no group of its own


def _sections(table: str) -> Iterator[tuple[str, str, str]]:
    """Source, dialect and rows of each line of a text."""
    for line in table.strip().splitlines():
        head, _, rows = line.partition(": ")
        source, _, dialect = head.partition(" ")
        yield source, dialect, rows


def noted(table: str) -> Iterator[Code]:
    """Rows of a text: SOURCE [dialect]: NAME [letters] WHY, ...

    The G codes among them stand in a block of their own on the controls that have them, but for a few.
    """
    for source, dialect, rows in _sections(table):
        for one in rows.split(", "):
            name, *letters, why = one.split()
            only = _ONLY.get(name, "")
            keys = key_of("meaning", name, dialect), f"told.{why}", key_of("instead", name, dialect)
            meaning, told = (text(message(key)) for key in keys[:2])
            instead = text(message(keys[2])) if only else ""
            yield Code(
                name,
                _GROUPS.get(name, name),
                "".join(letters),
                source,
                meaning,
                told,
                Fate.NOTED,
                dialect,
                only,
                instead,
                keys[1],
                alone=name[0] == "G" and name not in BESIDE_MOTION,
            )


def refused(table: str) -> Iterator[Code]:
    """Rows of a text, SOURCE [dialect]: NAME ...; the catalogue says what they mean and what to write."""
    for source, dialect, rows in _sections(table):
        for name in rows.split():
            meaning, instead = (text(message(key_of(part, name, dialect))) for part in ("meaning", "instead"))
            yield Code(name, "", "", source, meaning, instead, Fate.REFUSED, dialect)


def key_of(part: str, name: str, dialect: str) -> Key:
    """Of the meaning of a code that is refused, of what to write instead, or of a group."""
    return Key(".".join(filter(None, (part, name, dialect))))
