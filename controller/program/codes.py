"""One line sorted: its codes by modal group, its other words by letter.

Codes and groups are those of ``code_table``; of one group a line takes one code.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from functools import cache, lru_cache

from controller.machine.model import Machine
from controller.program import foreign, own_codes
from controller.program.code_rows import AXES, Code, Fate, key_of
from controller.program.code_table import BY_DIALECT
from controller.program.program import Place, ProgramError
from controller.program.words import Line, Word

SIDES = ("G40", "G41", "G42")
SURFACES = ("G51", "G52", "G6.2")
CURVES = ("G5", "G5.1", "G5.2", "G5.3")
PROBES = ("G38.2", "G38.3", "G38.4", "G38.5", "G31")
CYCLES = ("G73", "G74", "G76", "G81", "G82", "G83", "G84", "G85", "G86", "G87", "G89")
TILTS = ("G68.2", "G68.3", "G68.4")
TO_PLANE = ("G53.1", "G53.3", "G53.6")  # turn the tool to it
CONE_WORDS = "XYZIJKHRD"


def group(name: str, dialect: str) -> list[str]:
    """The codes of a modal group that a dialect has, in the order of the table."""
    return [code.name for code in BY_DIALECT[dialect].values() if code.group == name]


@cache
def letters_of(code: str, dialect: str, axes: str, form: str = "") -> str:
    """The letters that a code takes on a machine with these axes, in one of its forms."""
    row = BY_DIALECT[dialect][code]
    letters = dict(row.forms).get(form, row.letters).replace(AXES, axes)
    if dialect == "fanuc":
        return letters
    left_out = "ABCK" if code in CYCLES else "UVW"
    return "".join(letter for letter in letters if letter not in left_out)


@dataclass(frozen=True, slots=True)
class ParsedLine:
    """What one line asks for; every refusal of it has its file and line."""

    line: Line
    codes: dict[str, tuple[str, Word]]  # modal group -> code as named in the table, and its word
    words: dict[str, Word]  # letter -> word, without G M N
    gear: tuple[Word, int] | None = None  # the code of a gear of the spindle, and its place among them
    switches: tuple[tuple[Word, int, bool], ...] = ()  # the machine's own codes: number of an output, on
    next_tool: Word | None = None  # the second T beside M6, of the tool behind this one (Mazak)
    dialect: str = "rs274"
    polar: tuple[float, float] | None = None  # @ (mm) and ^ (rad) under G91, for which X and Y stand
    takers: dict[str, str] = field(default_factory=dict)  # letter -> the one code that takes its word
    lenient: list[tuple[str, Word]] = field(default_factory=list)  # what is taken as such controls do: notes

    def of(self, code: str) -> ParsedLine:
        """The line as one of its codes has it: without the words that others take."""
        others = [letter for letter, taker in self.takers.items() if taker != code]
        if not others:
            return self
        words = {letter: word for letter, word in self.words.items() if letter not in others}
        made = (self.line, self.codes, words, self.gear, self.switches, self.next_tool, self.dialect)
        # By hand: ``replace`` takes four times as long.
        return ParsedLine(*made, self.polar, self.takers, self.lenient)

    def word(self, code: str, letter: str) -> Word | None:
        """The word of a letter, where no other code takes it."""
        return self.words.get(letter) if self.takers.get(letter, code) == code else None

    def code(self, group: str) -> str:
        return self.codes[group][0] if group in self.codes else ""

    def has(self, letters: str) -> bool:
        return any(letter in self.words for letter in letters)

    def refusal(self, word: Word, key: str, **values: object) -> ProgramError:
        """Of a word; the code of the line that takes its letter is to blame."""
        about = ""
        for code, _ in self.codes.values() if word.letter not in "GMFST" else ():
            row = BY_DIALECT[self.dialect][code]
            if word.letter in row.letters or (row.group == "side" and word.letter in "DPQR"):
                about = about or code
        return self.line.refusal(word, key, about, **values)

    def refuse_where(self, word: Word, *rows: tuple[object, str], **values: object) -> None:
        """Refuses the word for the first of what is so, with its key. Raises ProgramError."""
        if key := next((key for is_so, key in rows if is_so), ""):
            raise self.refusal(word, key, **values)

    def place(self, word: Word) -> Place:
        return self.line.place(word.column)

    def whole(self, word: Word) -> int:
        if word.value != math.floor(word.value) or word.value < 0.0:
            raise self.refusal(word, "word.not_a_count")
        return int(word.value)

    def not_negative(self, word: Word) -> float:
        if word.value < 0.0:
            raise self.refusal(word, "word.negative")
        return word.value


def sort(line: Line, machine: Machine) -> ParsedLine:
    """The line by groups and letters; ProgramError on unknown or doubled words."""
    codes: dict[str, tuple[str, Word]] = {}
    others: dict[str, Word] = {}
    switches, gears, rest = list[tuple[Word, int, bool]](), list[tuple[Word, int]](), list[Word]()
    lenient: list[tuple[str, Word]] = []
    for word in line.words:  # codes first: they are to blame before the letters that they take
        if word.letter not in "GM":
            if word.letter == "N" and machine.dialect == "fanuc":
                lenient.append(("note.number_inside", word))
            else:
                rest.append(word)
        elif (switch := _switch(word, machine)) is not None:
            switches.append(switch)
        elif (gear := _gear(word, machine)) is not None:
            gears.append(gear)
        else:
            _take_code(line, own_codes.read(word, machine), codes, machine.dialect)
    if len(gears) > 1:
        before, code = (word.text for word, _ in gears[:2])
        raise line.refusal(gears[1][0], "code.two_of_a_group", before=before, code=code)
    next_tool = _next_tool(rest) if "tool change" in codes and machine.dialect == "fanuc" else None
    for word in rest:
        if word is not next_tool:
            _check_letter(line, word, others, machine)
            others[word.letter] = word
    one = gears[0] if gears else None
    return ParsedLine(line, codes, others, one, tuple(switches), next_tool, machine.dialect, lenient=lenient)


def _next_tool(words: list[Word]) -> Word | None:
    """The second T of two beside M6."""
    tools = [word for word in words if word.letter == "T"]
    return tools[1] if len(tools) == 2 else None


def _switch(word: Word, machine: Machine) -> tuple[Word, int, bool] | None:
    """What a code of ``[io] m_codes`` switches; None of any other word."""
    if word.letter != "M" or machine.io is None:
        return None
    for code, name, on in machine.io.m_codes:
        if word.value == float(code[1:]):
            return word, machine.io.digital_out.index(name), on
    return None


def _gear(word: Word, machine: Machine) -> tuple[Word, int] | None:
    """A gear of the spindle that a code of its own shifts into; None of any other word."""
    if word.letter != "M" or machine.spindle is None:
        return None
    codes = [float(one.code[1:] or -1) for one in machine.spindle.gears]
    return (word, codes.index(word.value)) if word.value in codes else None


def _take_code(line: Line, word: Word, codes: dict[str, tuple[str, Word]], dialect: str) -> None:
    """Lay a code beside the others of the line; G80 beside another motion only ends what was before."""
    code = _code(line, word, dialect)
    if code.group not in codes:
        codes[code.group] = (code.name, word)
        return
    before = codes[code.group][0]
    if code.group == "motion" and "G80" in (before, code.name) and before != code.name:
        if before == "G80":
            codes["motion"] = (code.name, word)
        return
    raise line.refusal(
        word,
        "code.two_of_a_group",
        before=before,
        code=code.name,
        group=_named(code),
        allowed=" ".join(group(code.group, dialect)),
    )


def _named(code: Code) -> str:
    """The group of a code, for a sentence; a noted one is its own."""
    return code.name if code.group == code.name else key_of("group", re.sub("[ -]", "_", code.group), "")


def _code(line: Line, word: Word, dialect: str) -> Code:
    if (found := _row(word.letter, word.value, dialect)) is None:
        raise _unknown(line, word, dialect)
    if found.fate is Fate.REFUSED:
        raise line.refusal(word, "code.not_done", **found.refused_with())
    return found


@lru_cache
def _row(letter: str, value: float, dialect: str) -> Code | None:
    """The row of a code, of which no more than tenths are written."""
    tenths = round(value * 10.0)
    number = f"{tenths // 10}" if tenths % 10 == 0 else f"{tenths / 10:.1f}"
    return BY_DIALECT[dialect].get(f"{letter}{number}") if abs(value * 10.0 - tenths) < 1e-6 else None


def _unknown(line: Line, word: Word, dialect: str) -> ProgramError:
    """Of a code that there is not; what another would do in its place, its number does not tell."""
    other = next(one for one in BY_DIALECT if one != dialect)
    if (row := BY_DIALECT[other].get(f"{word.letter}{word.value:g}")) is not None:
        if row.fate is Fate.REFUSED:
            return line.refusal(word, "code.not_done", **row.refused_with())
        return line.refusal(word, "code.other_dialect", dialect=other)
    if (uses := foreign.known_uses(f"{word.letter}{word.value:g}")) is not None:
        return line.refusal(word, "code.foreign", **uses)
    done = (code.name for code in BY_DIALECT[dialect].values() if code.fate is Fate.DONE)
    known = sorted((c for c in done if c[0] == word.letter), key=lambda c: float(c[1:]))
    key = "code.unknown_m" if word.letter == "M" else "code.unknown"
    return line.refusal(word, key, known=" ".join(known))


def _check_letter(line: Line, word: Word, before: dict[str, Word], machine: Machine) -> None:
    if word.letter in "ABC" and word.letter not in (names := [axis.name for axis in machine.axes]):
        raise line.refusal(word, "word.no_such_axis", axes=" ".join(names))
    if word.letter == "N":
        raise line.refusal(word, "word.number_inside")
    if word.letter in before:
        raise line.refusal(word, "word.twice", before=before[word.letter].text)
