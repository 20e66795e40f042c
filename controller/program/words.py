"""Program text to words (RS-274/NGC sections 3.3 and 3.4): what is written, not what it means.

A line is an optional ``/``, an optional N word, then words, parameter settings and
comments; case and spaces mean nothing. A word is a letter with a value. As parameters
change from line to line, lines are read in the order in which they are carried out,
each as often as it is.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping

from controller.messages import message
from controller.program import foreign, linked, macros, marks, own_codes
from controller.program.expressions import ARITHMETIC, GAPS, NOTHING, Values
from controller.program.flow import Limits, Run, Source
from controller.program.line import (
    COMMON,
    MAX_RUN,
    NOTHING_ASIDE,
    SIMPLE,
    Asides,
    CommonRun,
    Line,
    Other,
    Rows,
    Word,
    simple,
    waits,
)
from controller.program.parameters import (
    ALARM,
    OUTPUTS,
    SAYS_DEBUG,
    STOP,
    Name,
    NoValue,
    Parameters,
    System,
    written,
)
from controller.program.program import Block, Callers, ProgramError
from controller.program.source_text import LONGEST, Text, aborted, ended, message_text, without_comments

__all__ = ["LARGEST", "Line", "Word", "read"]

# No machine and no feed needs more; far below what squares and cubes could overflow.
LARGEST = 1e9
LENGTHS = frozenset("xyzabcuvwijkrq")  # letters of lengths and angles

Take = Callable[[Rows, list[Block]], Other | None]

_O_WORD = re.compile(r"o[ \t]*(?:<[^<>]*>|[0-9 \t]+)[ \t]*[a-z]{2}")
_CORNER = re.compile(r",[ \t]*([rc])")
_TEXT = re.compile(r"\(([^()]*)\)")
# Statements of Fanuc's macros for a printer: DPRNT tells the operator, the others do nothing here.
_SERIAL = re.compile(
    rf"[{GAPS}]*(?:N[ \t]*[0-9]+[ \t]*)?((?:POPEN|PCLOS|SETVN)(?![A-Z]).*|DPRNT[ \t]*\[(.*)\])[{GAPS}]*",
    re.IGNORECASE,
)
_DECIMALS = re.compile(r"(#[0-9]+)[ \t]*\[[0-9]?([0-9])\]")
_FILE = re.compile(r"[mM][ \t]*0*98[ \t]*(?:[lL][ \t]*[0-9]+[ \t]*)?\(([^()]+)\)")
_LEVEL = re.compile(rf"[1-9][{GAPS}]*[a-z#]")
# As controls name programs before the first block: O1234, :1234, O1234 <PART>, <PART>.
_TITLE = re.compile(rf"[{GAPS}]*(?:[oO:][ \t]*[0-9]{{1,8}}[{GAPS}]*)?(?:[oO]?[{GAPS}]*<[^<>]*>)?[{GAPS}]*")


def read(
    whole: Text,
    name: str,
    block_delete: bool = False,
    parameters: Parameters | None = None,
    limits: Limits | None = None,
    files: Mapping[str, tuple[str, str]] | None = None,
    refused: list[ProgramError] | None = None,
    take: Take | None = None,
    system: System | None = None,
) -> Iterator[Line | CommonRun]:
    """The lines of a text that have words or say something, as they are carried out, up to the closing
    ``%`` or the end.

    ``block_delete`` skips lines that begin with ``/``; off (the power-on state) they are read. ``files``:
    other texts with their names, whose subs may be called, by label. ``take`` reads common lines to blocks,
    ``MAX_RUN`` at most, and gives the first other line; runs of them then come in their place. Raises
    ProgramError while iterating for text that is no word, or when the end comes before any word; with
    ``refused``, a line that is none is noted there and left out.
    """
    scan = _Scan(parameters or Parameters(), block_delete, refused, system)
    of_fanuc, limits = scan.parameters.of_fanuc, limits or Limits()
    own = own_codes.may_stand_in(whole, limits.own_codes)
    plain = not own and marks.plain(whole) and not (of_fanuc and macros.may_stand_in(whole))
    source = None if plain else Source.of(name, whole.whole(), of_fanuc)
    if source is None or (source.marks.none and not own):
        yield from scan.lines(enumerate(whole.lines(), start=1), name, take or _first)
    else:
        run = Run(source, scan.line, scan.parameters, limits, files or {}, block_delete)
        yield from run.lines()
    if not scan.found:
        if source is not None and source.marks.subs:
            raise ProgramError(name, 1, 1, message("text.only_subs", label=next(iter(source.marks.subs))))
        raise ProgramError(name, 1, 1, message("text.only_comments" if whole.body else "text.empty"))


class _Scan:
    """Raw lines to lines of words."""

    def __init__(
        self,
        parameters: Parameters,
        block_delete: bool,
        refused: list[ProgramError] | None,
        system: System | None,
    ) -> None:
        self.parameters, self._refused, self._system = parameters, refused, system
        self._block_delete = block_delete
        self.found = False  # a word
        self._opened = self._named = self._told_serial = False

    def lines(self, rows: Rows, name: str, take: Take) -> Iterator[Line | CommonRun]:
        """All of a text, as it stands."""
        while True:
            run: list[Block] = []
            other = take(rows, run)
            if run:
                self.found = self._opened = True
                yield CommonRun(run)
            if other is None:
                if len(run) < MAX_RUN:
                    return
                continue
            number, raw, common = other
            if common is not None and common.lastindex is not None:
                self.found = self._opened = True
                yield Line(name, number, (), common, _plain_words)
            elif marks.PERCENT.fullmatch(raw):
                if self._opened:
                    return
                self._opened = True
            else:
                line = self._general(raw, name, number)
                yield from waits(self.parameters.taken_reads(), name, number)
                if line is not None:
                    yield line

    def line(self, raw: str, name: str, number: int, callers: Callers) -> Line | None:
        """One line that is carried out; None where it says nothing. ``callers``: of its sub."""
        if (common := COMMON.fullmatch(raw)) is not None and common.lastindex is not None:
            self.found = True
            return Line(name, number, (), common, _plain_words)
        return None if marks.PERCENT.fullmatch(raw) else self._general(raw, name, number, callers)

    def _general(self, raw: str, name: str, number: int, callers: Callers = ()) -> Line | None:
        try:
            return self._words_of(raw, name, number)
        except ProgramError as error:
            error = foreign.statement(raw, name, number) or error
            if self._refused is None:
                raise error from None
            self._refused.append(error.within(callers))
            self.found = self._opened = True
            return None

    def _words_of(self, raw: str, name: str, number: int) -> Line | None:
        if (found := SIMPLE.fullmatch(raw)) is not None and (simple_words := simple(found, LARGEST)):
            self.found = self._opened = True
            return Line(name, number, simple_words)
        text = without_comments(raw, name, number)
        bare = text.strip(GAPS)
        if self._block_delete and bare.startswith("/"):
            return None
        words: tuple[Word, ...] = ()
        if bare:
            if not self.found and not self._named and _TITLE.fullmatch(text):
                self._named = self._opened = True
                return None
            self._opened = True
            if self.parameters.of_fanuc and (serial := _SERIAL.fullmatch(text)) is not None:
                return self._printed(serial[1], serial[2], name, number)
            words = _Words(text, name, number, self.parameters).words()
            self.found |= bool(words) or "#" in text
        asides = NOTHING_ASIDE
        if "#" in text:
            asides = Asides(kept=self.parameters.fresh())
            if self._system is not None:
                stop, asides = self._system_requests(self._system, raw, name, number, asides)
                words = (*words, *stop)
        if said := self._message(raw, name, number):
            asides = asides._replace(message=asides.message or said)
        self.found |= bool(asides.message)
        if not (words or any(asides)):
            return None
        line = Line(name, number, words)
        line.asides = asides
        if self.parameters.of_fanuc and (called := _FILE.search(raw)) is not None:
            line.file = linked.file_label(called[1])
        return line

    def _printed(self, written: str, text: str | None, name: str, number: int) -> Line | None:
        """What DPRNT tells the operator, a * for a blank; of the others a note, once."""
        self.found, line = True, Line(name, number, ())
        if text is not None:
            said = _DECIMALS.sub(r"%.\2f\1", text).replace("*", " ")
            line.asides = Asides(message_text(f"(PRINT,{said})", self._reads(name, number)))
        elif not self._told_serial:
            self._told_serial = True
            line.asides = Asides(notes=[message("note.serial", line=written.strip(GAPS))])
        return line if line.says else None

    def _system_requests(
        self, system: System, raw: str, name: str, number: int, asides: Asides
    ) -> tuple[tuple[Word, ...], Asides]:
        """The word, and what stands aside, that settings of system variables ask for. Raises ProgramError."""
        asks, system.asks = system.asks, {}
        notes, system.notes = system.notes, []
        changes, system.changes = system.changes, []
        at, text = raw.find("#") + 1, " ".join(" ".join(_TEXT.findall(raw)).split())[:LONGEST]
        if (alarm := asks.get(ALARM)) is not None:
            raise ProgramError(name, number, at, message("text.alarm", number=alarm, text=text))
        words: list[Word] = []
        for key, value in asks.items():
            switch = ("M", 64.0 if value else 65.0), ("P", float(key - OUTPUTS))
            for letter, number_ in switch if key != STOP else (("M", 0.0),):
                words.append(Word(letter, number_, True, at, f"#{key}"))
        if STOP not in asks:
            return tuple(words), asides._replace(notes=notes, changes=changes)
        return tuple(words), Asides(text, notes, changes, asides.kept)

    def _reads(self, name: str, number: int) -> Callable[[str], float]:
        """Values of parameters as they are written."""
        return lambda written: Values(written.lower(), name, number, self.parameters).value(0, written)[0]

    def _message(self, raw: str, name: str, number: int) -> str:
        """What the comments of a line say to the operator. Raises ProgramError where they end the program."""
        if "," not in raw or "(" not in raw:
            return ""
        value = self._reads(name, number)
        if ends := aborted(raw, value):
            raise ProgramError(name, number, ends[0], ended(ends[1]))
        return message_text(raw, value, self.parameters.value(SAYS_DEBUG) != 0.0)


def _first(rows: Rows, _run: list[Block]) -> Other | None:
    """No line is common."""
    row = next(rows, None)
    return None if row is None else (*row, COMMON.fullmatch(row[1]))


def _plain_words(text: str, name: str, number: int) -> tuple[Word, ...]:
    return _Words(without_comments(text, name, number), name, number, Parameters()).words()


class _Words(Values):
    """Reads one line from left to right."""

    def words(self) -> tuple[Word, ...]:
        """All words of the line; parameter settings take effect after it, together."""
        self._check_ascii()
        self._text = self._text.lower()
        words: list[Word] = []
        settings: dict[Name, float | None] = {}
        if self.take("/") and self.peek() in "123456789" and _LEVEL.match(self._text, self._at):
            self._at += 1  # Fanuc's /2: there is one switch for all of them
        if self.peek() == "n":
            self._line_number()
        while self.peek():
            if self.peek() == "#":
                key, value = self._setting()
                settings[key] = value
            else:
                words += self._word()
        try:
            self._parameters.set(settings)
        except NoValue as why:
            raise self.refusal(self._text.find("#"), why.key, **why.values) from None
        return tuple(words)

    def _check_ascii(self) -> None:
        if not self._text.isascii():
            raise self._stray(next(at for at, c in enumerate(self._text) if not c.isascii()))

    def _stray(self, at: int) -> ProgramError:
        found = self._text[at]
        if found == "%":
            return self.refusal(at, "text.percent")
        if found == "," and self._text[at + 1 :].lstrip()[:1] in ("c", "r"):
            return self.refusal(at, "text.corner")
        return self.refusal(at, "text.stray", found=found)

    def _line_number(self) -> None:
        (word,) = self._word()
        if word.value < 0.0:
            raise self.refusal(word.column - 1, "word.no_number", word=word.text)

    def _word(self) -> tuple[Word, ...]:
        """The next word; nothing of one whose value is an argument that its macro was not given."""
        letter, start = self.peek(), self._at
        if letter == "," and self._parameters.of_fanuc and (corner := _CORNER.match(self._text, start)):
            self._at = corner.end()
            value, point = self.value(start, f",{corner[1].upper()}")
            self.check_set(start)
            text = "".join(self._text[start : self._at].split()).upper()
            return (Word(corner[1], value, point, start + 1, text[:40]),)
        if not (letter.isalpha() or letter in "@^"):
            raise self._stray(start)
        if letter == "o":
            raise self._stray_o(start)
        self._at += 1
        if letter in LENGTHS and self._parameters.of_fanuc:
            self._step = 1e-3 if self._parameters.value("_metric") else 1e-4
        value, point = self.value(start, letter.upper())
        self._step = 1.0
        text = "".join(self._text[start : self._at].split()).replace("\0", "").upper()
        if letter != "n" and self.is_vacant and self._parameters.leave_out(self._vacant, text):
            return ()
        self.check_set(start)
        if abs(value) > LARGEST:
            raise self.refusal(start, "word.too_large", letter=letter.upper(), value=value, most=LARGEST)
        return (Word(letter.upper(), value, point, start + 1, text[:40]),)

    def _stray_o(self, at: int) -> ProgramError:
        before = self._text[:at].rstrip(GAPS)
        is_word = _O_WORD.match(self._text, at) is not None
        if not is_word and (before[-1:].isdigit() or before[-1:] == "."):
            return self.refusal(at, "value.o_for_zero", before=before[-1])
        return self.refusal(at, "text.o_inside")

    def _setting(self) -> tuple[Name, float | None]:
        """``#n = value``; as Fanuc has it also ``#n = #m + 1``, without brackets; None of ``#n = #0``."""
        start = self._at
        key = self.key()
        name = written(key)
        try:
            self._parameters.check_settable(key)
        except NoValue as why:
            raise self.refusal(start, why.key, **why.values) from None
        if not self.take("="):
            raise self.refusal(start, "value.alone", written=name)
        if key == NOTHING:
            raise self.refusal(start, "value.nothing")
        value = self.value(start, f"{name}=")[0]
        value = self.joined(value, ARITHMETIC) if self._parameters.of_fanuc else value
        if self.is_vacant and self._parameters.may_be_vacant(key):
            return key, None
        self.check_set(start)
        return key, value
