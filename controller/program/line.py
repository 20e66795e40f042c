"""One line of a program as its words, and the short way for the common lines of CAM systems."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import NamedTuple

from controller.machine.changes import Change
from controller.messages import Message, message
from controller.program.parameters import INPUTS
from controller.program.program import Block, Callers, Place, ProgramError

# A common line as programs from CAM systems have them in millions: an N, G0 to G3, words in the usual order,
# one M of spindle or coolant, a comment. Nothing in it can be refused as text, or says something. Nine digits
# are below what any word may be. Only single characters repeat possessively: Python before 3.11.5 goes on
# behind the begin of a group that it gave up (gh-106052), so that "G0X" would match as G0. What may be
# missing is a choice of it or nothing: tried at half the time of a group that is repeated once or never.
MAX_RUN = 60  # of them together: what lives long costs full collections of garbage
_SHORT_NUMBER = r"[+-]?(?:[0-9]{1,9}+(?:\.[0-9]*+|)|\.[0-9]++)"
LETTERS = "XYZABCIJKRFS"
LENGTHS, ANGLES = "XYZIJKRQUVWrc", "ABC"  # r and c: of corners, ,R and ,C


def _words(letters: str, others: str = "", behind: str = "") -> str:
    """Any of these in their order; where none of them comes, which one look tells, it is over."""
    each = "".join(rf"(?:[{letter}{letter.lower()}]({_SHORT_NUMBER})[ \t]*+|)" for letter in letters)
    return rf"(?:(?=[{letters}{letters.lower()}{others}]){each}{behind}|)"


@cache
def common(axes: str) -> re.Pattern[str]:
    """Of lines with words of these axes alone; the groups of others are there, and match nothing."""
    turns = "".join(_words(letter) if letter in axes else "(?:(?!)()|)" for letter in "ABC")
    return re.compile(
        r"[ \t]*+(?:[Nn][0-9]++[ \t]*+|)(?:[Gg](0?[0-3])[ \t]*+|)"
        + _words("XYZ")
        + rf"(?:(?=[ABCabc]){turns}|)"
        + _words("IJKR")
        + _words("FS", "Mm(;", r"(?:[Mm](0?[3-57-9])[ \t]*+|)(?:\([^(),;]*+\)[ \t]*+|)(?:;.*+|)"),
        re.DOTALL,
    )


COMMON = common("ABC")
Rows = Iterator[tuple[int, str]]  # numbers and texts of lines
Other = tuple[int, str, re.Match[str] | None]  # one of them, and what COMMON finds in it
READ_S = 10.0  # within which an input has to be as a program has read it; else it is held
# Of ``Line.parts``, and of the groups of a match less one.
MOTION, AXES, CENTRE, RADIUS, FEED, SPEED, FUNCTION = 0, 1, 7, 10, 11, 12, 13
PARTS = MappingProxyType(
    {"G": MOTION, **{letter: AXES + k for k, letter in enumerate(LETTERS)}, "M": FUNCTION}
)
Part = str | float | None
# Any words with plain numbers, behind an N: no comment, parameter, expression or O-word.
_NUMBER = r"[+-]?(?:[0-9]++\.?[0-9]*+|\.[0-9]++)"
SIMPLE = re.compile(rf"[ \t]*+(?:[Nn][ \t]*+[0-9]++[ \t]*+)?((?:[A-MP-Za-mp-z][ \t]*+{_NUMBER}[ \t]*+)+)")
_ONE = re.compile(rf"([A-Za-z])[ \t]*({_NUMBER})")


class Word(NamedTuple):
    """A letter with its value; ``point``: a decimal point was written, or the value was computed."""

    letter: str
    value: float
    point: bool
    column: int
    text: str  # as written, without spaces, in capitals


def pointed(word: Word, rule: str, inches: bool, refusal: Callable[..., ProgramError]) -> Word:
    """A length or an angle, without a decimal point counted by the ``rule`` of the machine file.

    ``inches``: it is a length in inches. Raises ProgramError where there is no rule.
    """
    if word.point or word.value == 0.0 or rule == "unit":
        return word
    if rule == "thousandth":
        return word._replace(value=word.value * 0.001 * (0.1 if inches else 1.0), point=True)
    raise refusal(word, "word.no_point", whole=word.value, thousandth=word.value * 0.001)


def simple(found: re.Match[str], largest: float) -> tuple[Word, ...] | None:
    """The words of a match of SIMPLE; None where one is beyond +-``largest``."""
    words = []
    for word in _ONE.finditer(found.string, found.start(1)):
        letter, number = word.groups()
        value = float(number)
        if not -largest <= value <= largest:
            return None
        letter = letter.upper()
        words.append(Word(letter, value, "." in number, word.start() + 1, (letter + number)[:40]))
    return tuple(words)


def _parts(words: Sequence[Word]) -> Sequence[Part] | None:
    """Of words in any order; None where one is another, or stands twice."""
    found: list[Part] = [None] * len(PARTS)
    for word in words:
        at = PARTS.get(word.letter)
        if at is None or found[at] is not None:
            return None
        found[at] = word.value
    return found


@dataclass(frozen=True, slots=True)
class Where:
    """Where a line stands in the order in which lines are carried out."""

    line: int  # of the program: its own, or the one that calls the file it stands in
    step: int  # rises from line to line; the line's number while nothing goes back
    sub: int  # number of the call that it belongs to; 0: of the program itself
    calls: Callers


class Asides(NamedTuple):
    """What stands aside of the words of a line."""

    message: str = ""  # to the operator, before the words
    notes: Sequence[Message] = ()  # what ``check`` is to tell of it
    changes: Sequence[Change] = ()  # that its settings make for good
    kept: Mapping[int, float] = MappingProxyType({})  # parameters that it sets for good


NOTHING_ASIDE = Asides()


class Line:
    """The words of one text line, N and parameter settings taken off.

    Of a common line (``match`` of COMMON) they are only read when they are asked for, by ``scan`` from
    text, name and number.
    """

    __slots__ = ("_match", "_scan", "_words", "asides", "file", "name", "number", "where")

    def __init__(
        self,
        name: str,
        number: int,
        words: tuple[Word, ...],
        match: re.Match[str] | None = None,
        scan: Callable[[str, str, int], tuple[Word, ...]] | None = None,
    ) -> None:
        self.name, self.number = name, number
        self.where: Where | None = None  # None: lines are carried out as they stand
        self.asides = NOTHING_ASIDE
        self.file = ""  # that M98 calls by its name
        self._words, self._match, self._scan = words, match, scan

    @property
    def words(self) -> tuple[Word, ...]:
        if not self._words and self._match is not None and self._scan is not None:
            self._words = self._scan(self._match.string, self.name, self.number)
        return self._words

    @property
    def text(self) -> str:
        """As written, of a common line; else empty."""
        return self._match.string if self._match is not None else ""

    @property
    def parts(self) -> Sequence[Part] | None:
        """The values of a line of nothing but common words, by ``PARTS``; None of any other.

        Numbers, or texts of which ``float`` makes them.
        """
        return self._match.groups() if self._match is not None else _parts(self._words)

    def column(self, part: int) -> int:
        """Of the word of one of ``parts``."""
        if self._match is not None:
            return self._match.start(part + 1)
        return next(word.column for word in self._words if PARTS[word.letter] == part)

    @property
    def is_plain(self) -> bool:
        return self._match is not None

    @property
    def says(self) -> bool:
        """Whether something stands aside of its words."""
        return any(self.asides)

    @property
    def sub(self) -> int:
        """Number of the call that it belongs to, counted over the run; 0: of the program itself."""
        return self.where.sub if self.where is not None else 0

    @property
    def order(self) -> int:
        """As ``Place.order`` of what stands in it."""
        return self.where.step or self.where.line if self.where is not None else self.number

    def with_words(self, words: tuple[Word, ...]) -> Line:
        """The same line with other words."""
        made = Line(self.name, self.number, words)
        made.where, made.asides, made.file = self.where, self.asides, self.file
        return made

    def place_of(self, part: int) -> Place:
        """Where the word of one of ``parts`` stands."""
        if self.where is None and self._match is not None:  # millions of lines
            return Place._make((self.number, self._match.start(part + 1), 0, (), "", 0))
        return self.place(self.column(part))

    def place(self, column: int) -> Place:
        if self.where is None:
            return Place._make((self.number, column, 0, (), "", 0))
        return Place(self.where.line, column, self.where.step, self.where.calls, self.name, self.number)

    def refusal(self, word: Word, key: str, about: str = "", **values: object) -> ProgramError:
        """Of a word; the text of ``key`` may name it as {word} and {letter} beside its own values."""
        why = message(key, **{"word": word.text, "letter": word.letter, **values})
        about = about or (word.text if word.letter in "GM" else word.letter)
        error = ProgramError(self.name, self.number, word.column, why, about)
        return error.within(self.where.calls) if self.where is not None else error


def waits(reads: Mapping[int, bool], name: str, number: int) -> Iterator[Line]:
    """Lines of M66 for inputs that a program has read as #1000 and on: it goes on where they are so."""
    for k, on in reads.items():
        values = (("M", 66.0), ("P", float(k)), ("L", 3.0 if on else 4.0), ("Q", READ_S))
        yield Line(name, number, tuple(Word(*one, True, 1, f"#{INPUTS + k}") for one in values))


@dataclass(frozen=True, slots=True)
class CommonRun:
    """Common lines that follow each other: of one modal state but for motion, F, spindle and coolant."""

    blocks: list[Block]


class Upcoming(Iterator[Line]):
    """The lines of a program; while one of them is carried out, those that follow it can be taken or seen.

    Among ``items`` are runs of common lines, too, which are made while no other line is carried out.
    """

    def __init__(self, read: Iterator[Line | CommonRun]) -> None:
        self._read = read
        self._seen: list[Line] = []
        self.told: list[Line] = []  # those that say something, until it is told
        self.items = self._items()

    def _items(self) -> Iterator[Line | CommonRun]:
        for item in self._read:
            if isinstance(item, Line) and not item.is_plain:
                if item.says:
                    self.told.append(item)
                if not item.words:
                    continue
            yield item
            while self._seen:
                yield self._seen.pop()

    def __next__(self) -> Line:
        line = next(self.items)
        assert isinstance(line, Line)
        return line

    def look(self) -> Line | None:
        """The next line, which then comes in its turn; None at the end."""
        line = next(self, None)
        if line is not None:
            self._seen.append(line)
        return line
