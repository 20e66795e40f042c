"""Program text to words (RS-274/NGC sections 3.3 and 3.4): what is written, not what it means.

A line is an optional ``/``, an optional N word, then words, parameter settings and
comments; case and spaces mean nothing. A word is a letter with a value: a number, a
parameter ``#1``, an expression ``[1 + 2]`` or a function ``sin[30]`` (degrees). As
parameters change from line to line, the text is read in order, once.
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Iterator

from controller.plan.text.decoding import lines_of
from controller.plan.text.line import PLAIN, Line, Word
from controller.plan.text.program import ProgramError

__all__ = ["LARGEST", "Line", "Word", "read"]

# No machine and no feed needs more; far below what squares and cubes could overflow.
LARGEST = 1e9
LETTERS = "ABCDEFGHIJKLMNPQRSTUVWXYZ"
DEEPEST = 30  # nesting of brackets, so that no text can exhaust the stack
PARAMETERS = range(1, 6000)
MACHINE_PARAMETERS = range(5061, 5603)  # positions, offsets and tools on other controls

_GAPS = " \t\0"  # \0 marks where a comment stood: it ends a number, a space does not
_COMMENT = re.compile(r"[();]")
_NUMBER = re.compile(r"[+-]?[ \t]*(?:[0-9][0-9 \t]*(?:\.[0-9 \t]*)?|\.[ \t]*[0-9][0-9 \t]*)")
_PROGRAM_NUMBER = re.compile(rf"[{_GAPS}]*[oO:][ \t]*[0-9]{{1,8}}[{_GAPS}]*")
_OPERATOR = re.compile(r"\*\*|[*/+-]|mod|and|or|xor")


def read(whole: str, name: str, block_delete: bool = False) -> Iterator[Line]:
    """The lines of a text that have words, in order, up to the closing ``%`` or the end.

    ``block_delete`` skips lines that begin with ``/``; off (the power-on state) they are read.
    Raises ProgramError while iterating for text that is no word, or when the end comes before any word.
    """
    parameters: dict[int, float] = {}
    opened = found = numbered = False
    for number, raw in enumerate(lines_of(whole), start=1):
        if plain := PLAIN.fullmatch(raw):
            opened = found = True
            yield Line(name, number, (), plain, _plain_words)
            continue
        text = _without_comments(raw, name, number)
        bare = text.strip(_GAPS)
        if not bare or (block_delete and bare[0] == "/"):
            continue
        if bare == "%":
            if opened or found:
                break
            opened = True
            continue
        if not found and not numbered and _PROGRAM_NUMBER.fullmatch(text):
            numbered = opened = True  # as controls name programs: O1234 or :1234 before the first block
            continue
        words = _Scanner(text, name, number, parameters).words()
        opened = True
        if words:
            found = True
            yield Line(name, number, words)
    if not found:
        what = "only blank lines and comments" if whole.strip() else "nothing"
        raise ProgramError(
            name, 1, 1, f"the file holds {what}: a program needs at least one word; send the whole program"
        )


def _plain_words(text: str, name: str, number: int) -> tuple[Word, ...]:
    return _Scanner(text, name, number, {}).words()


def _without_comments(raw: str, name: str, number: int) -> str:
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


class _Unsound(Exception):
    """An expression without a finite real value; becomes a ProgramError where it stands."""


# Levels as in RS-274/NGC 3.3.2.3: ** first, then * / mod, then the rest; equals from left to right.
_LEVELS = {"**": 3, "*": 2, "/": 2, "mod": 2, "+": 1, "-": 1, "and": 1, "or": 1, "xor": 1}
_OPERATIONS: dict[str, Callable[[float, float], float]] = {
    "**": math.pow,
    "*": operator.mul,
    "/": operator.truediv,
    "mod": operator.mod,  # never negative for a positive divisor
    "+": operator.add,
    "-": operator.sub,
    "and": lambda a, b: float(a != 0.0 and b != 0.0),
    "or": lambda a, b: float(a != 0.0 or b != 0.0),
    "xor": lambda a, b: float((a != 0.0) != (b != 0.0)),
}
_FUNCTIONS: dict[str, Callable[[float], float]] = {
    "abs": abs,
    "acos": lambda x: math.degrees(math.acos(x)),
    "asin": lambda x: math.degrees(math.asin(x)),
    "cos": lambda x: math.cos(math.radians(x)),
    "exp": math.exp,
    "fix": lambda x: float(math.floor(x)),
    "fup": lambda x: float(math.ceil(x)),
    "ln": math.log,
    "round": lambda x: math.copysign(math.floor(abs(x) + 0.5), x),
    "sin": lambda x: math.sin(math.radians(x)),
    "sqrt": math.sqrt,
    "tan": lambda x: math.tan(math.radians(x)),
}
_FUNCTION = re.compile(rf"({'|'.join(_FUNCTIONS)}|atan)[ \t]*(?=\[)")


def _sound(function: Callable[..., float], *arguments: float) -> float:
    try:
        return _finite(function(*arguments))
    except (ValueError, OverflowError, ZeroDivisionError) as error:
        raise _Unsound from error


def _finite(value: float) -> float:
    if not math.isfinite(value):
        raise _Unsound
    return value


class _Scanner:
    """Reads one line from left to right."""

    def __init__(self, text: str, name: str, number: int, parameters: dict[int, float]) -> None:
        self._text = text
        self._name = name
        self._number = number
        self._parameters = parameters
        self._at = 0
        self._depth = 0

    def words(self) -> tuple[Word, ...]:
        """All words of the line; parameter settings take effect after it, together."""
        self._check_ascii()
        self._text = self._text.lower()
        words: list[Word] = []
        settings: dict[int, float] = {}
        self._take("/")
        if self._peek() == "n":
            self._line_number()
        while self._peek():
            if self._peek() == "#":
                index, value = self._setting()
                settings[index] = value
            else:
                words.append(self._word())
        self._parameters.update(settings)
        return tuple(words)

    def _refusal(self, at: int, sentence: str) -> ProgramError:
        return ProgramError(self._name, self._number, at + 1, sentence)

    def _check_ascii(self) -> None:
        if not self._text.isascii():
            raise self._stray(next(at for at, c in enumerate(self._text) if not c.isascii()))

    def _stray(self, at: int) -> ProgramError:
        found = self._text[at]
        if found == "%":
            return self._refusal(at, "% marks the start and end of a program and stands alone on its line")
        return self._refusal(
            at,
            f"{found!r} cannot stand here: a line is made of words such as X12.5 (a letter and its number, "
            "with a decimal point, not a comma), parameter settings and comments; correct or remove it",
        )

    def _peek(self) -> str:
        """The next character that is no gap, or nothing at the end of the line."""
        text, at = self._text, self._at
        while at < len(text) and text[at] in _GAPS:
            at += 1
        self._at = at
        return text[at] if at < len(text) else ""

    def _take(self, character: str) -> bool:
        if self._peek() != character:
            return False
        self._at += 1
        return True

    def _line_number(self) -> None:
        word = self._word()
        if word.point or word.value < 0.0:
            raise self._refusal(
                word.column - 1,
                f"{word.text} is no line number: N takes a whole number from 0 up; correct it or "
                "leave it out",
            )

    def _word(self) -> Word:
        letter, start = self._peek(), self._at
        if not letter.isalpha():
            raise self._stray(start)
        if letter.upper() not in LETTERS:
            raise self._refusal(
                start,
                f"{letter.upper()} is not a word of this control: it knows the letters {' '.join(LETTERS)} "
                "(no subroutines, loops, exponents or axes U V W); remove it",
            )
        self._at += 1
        value, point = self._value(start, letter.upper())
        if abs(value) > LARGEST:
            raise self._refusal(
                start,
                f"{letter.upper()} has the value {value:g}: no word may be beyond +-{LARGEST:.0f}; "
                "correct it",
            )
        text = "".join(self._text[start : self._at].split()).replace("\0", "").upper()
        return Word(letter.upper(), value, point, start + 1, text[:40])

    def _setting(self) -> tuple[int, float]:
        """``#n = value``."""
        start = self._at
        index = self._index()
        if index in MACHINE_PARAMETERS:
            raise self._refusal(
                start,
                f"#{index} cannot be set: parameters {MACHINE_PARAMETERS.start} to "
                f"{MACHINE_PARAMETERS.stop - 1} are offsets and tools of the machine on other controls; "
                "use another number, and set offsets and tools in the machine file",
            )
        if not self._take("="):
            raise self._refusal(
                start,
                f"#{index} stands alone: a parameter is set with #{index}=value or used after a letter, "
                f"as X#{index}; add what is missing",
            )
        return index, self._value(start, f"#{index}=")[0]

    def _value(self, start: int, what: str) -> tuple[float, bool]:
        """A value, and whether it counts as written with a decimal point."""
        self._peek()
        at = self._at
        try:
            value = self._operand()
        except _Unsound:
            raise self._refusal(
                start,
                f"{what} has no finite value: it is too large, divides by zero or leaves the range of a "
                "function; correct it",
            ) from None
        if value is None:
            raise self._refusal(
                start,
                f"{what} has no number: it takes a number such as 12.5, a parameter #1, an expression [1+2] "
                "or a function sin[30]; write the number or take the word out",
            )
        written = self._text[at : self._at]
        return value, any(mark in written for mark in ".#[")

    def _operand(self) -> float | None:
        """A number, parameter, bracket or function with an optional sign; None where none stands."""
        self._peek()
        if number := _NUMBER.match(self._text, self._at):
            self._at = number.end()
            return _finite(float("".join(number.group().split())))
        negative = self._take("-")
        if not negative:
            self._take("+")
        self._depth += 1
        if self._depth > DEEPEST:
            raise self._refusal(
                self._at, f"brackets are nested deeper than {DEEPEST}: split it with parameters #1, #2, ..."
            )
        value = self._compound()
        self._depth -= 1
        return -value if negative and value is not None else value

    def _compound(self) -> float | None:
        start = self._peek()
        if start == "#":
            return self._parameter()
        if start == "[":
            return self._bracket()
        if function := _FUNCTION.match(self._text, self._at):
            self._at = function.end()
            return self._function(function.group(1))
        return None

    def _index(self) -> int:
        start = self._at
        self._take("#")
        value = self._value(start, "#")[0]
        if value != math.floor(value) or int(value) not in PARAMETERS:
            raise self._refusal(
                start,
                f"#{value:g} is no parameter: they are numbered {PARAMETERS.start} to {PARAMETERS.stop - 1}; "
                "use one of these",
            )
        return int(value)

    def _parameter(self) -> float:
        start = self._at
        index = self._index()
        if index not in self._parameters:
            raise self._refusal(
                start, f"#{index} has no value yet: set it on an earlier line with #{index}=value"
            )
        return self._parameters[index]

    def _bracket(self) -> float:
        start = self._at
        if not self._take("["):
            raise self._refusal(start, "[ is missing: the value of a function stands in brackets, as sin[30]")
        value = self._chain(1)
        if not self._take("]"):
            raise self._refusal(
                start, "this [ is not closed: an expression runs from [ to ] on one line; add the ]"
            )
        return value

    def _chain(self, level: int) -> float:
        """Operands joined by operators of ``level`` or above."""
        self._peek()
        value = self._value(self._at, "the expression")[0]
        while self._peek() and (found := _OPERATOR.match(self._text, self._at)):
            name = found.group()
            if _LEVELS[name] < level:
                break
            self._at = found.end()
            value = _sound(_OPERATIONS[name], value, self._chain(_LEVELS[name] + 1))
        return value

    def _function(self, name: str) -> float:
        value = self._bracket()
        if name != "atan":
            return _sound(_FUNCTIONS[name], value)
        if not self._take("/"):  # atan[y]/[x] keeps the quadrant (RS-274/NGC 3.3.2.4)
            raise self._refusal(self._at, "atan takes two values: write atan[y]/[x]")
        self._peek()
        return math.degrees(math.atan2(value, self._bracket()))
