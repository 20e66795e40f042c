"""Values as a program writes them (RS-274/NGC 3.3.2, LinuxCNC's comparisons, names and EXISTS).

A value is a number, a parameter ``#1`` or ``#<name>``, an expression ``[1 + 2]`` or a function
``sin[30]`` (degrees). Truth is 1 and 0; what is not 0 counts as true. Under ``fanuc`` AND, OR and XOR
are of bits and bind as * and + do, and ROUND in a word rounds to its least increment (Fanuc B-64484EN,
16.2: arithmetic and logic operation).
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable
from typing import Any

from controller.messages import Key, message
from controller.program.parameters import Name, NoValue, Parameters
from controller.program.program import ProgramError

SHOWN = 40  # characters of a number in a sentence
DEEPEST = 30  # nesting of brackets, so that no text can exhaust the stack
NUMBERED = range(1, 6000)
OF_FANUC = range(1, 100_000)  # system variables among them
NOTHING = 0  # on controls as Fanuc's #0, which never has a value
GAPS = " \t\0"  # \0 marks where a comment stood: it ends a number, a space does not
SAME = 1e-4  # values that EQ takes for one, as LinuxCNC's interpreter
MAX_BITS = 2.0**31  # of a value that is taken bit by bit

_NUMBER = re.compile(r"[+-]?[ \t]*(?:[0-9][0-9 \t]*(?:\.[0-9 \t]*)?|\.[ \t]*[0-9][0-9 \t]*)")
_NAME = re.compile(r"<((?:[^<>\[\]#;\0]|_(?:ini|hal)\[[^<>\[\]#;\0]*\])*)>")


def _mod(a: float, b: float) -> float:
    """The remainder, never negative, whatever the sign of the divisor (as LinuxCNC's)."""
    if b == 0.0:
        raise ZeroDivisionError
    rest = math.fmod(a, b)
    return rest + abs(b) if rest < 0.0 else rest


class _NoBits(ArithmeticError):
    """A value that has no bits."""


def _bitwise(function: Callable[[int, int], int]) -> Callable[[float, float], float]:
    """Of whole numbers, bit by bit; of truths, which are 1 and 0, that is what people mean."""

    def of(*values: float) -> float:
        for value in values:
            if abs(value - round(value)) >= SAME or abs(value) > MAX_BITS:
                raise _NoBits(value)
        return float(function(*map(round, values)))

    return of


# ** first, then * / mod, then + -, then comparisons, then the rest; equals from left to right.
_OPERATIONS: dict[str, tuple[int, Callable[[float, float], float]]] = {
    "**": (5, math.pow),
    "*": (4, operator.mul),
    "/": (4, operator.truediv),
    "mod": (4, _mod),
    "+": (3, operator.add),
    "-": (3, operator.sub),
    "eq": (2, lambda a, b: float(abs(a - b) < SAME)),
    "ne": (2, lambda a, b: float(abs(a - b) >= SAME)),
    "gt": (2, lambda a, b: float(a > b)),
    "ge": (2, lambda a, b: float(a >= b)),
    "lt": (2, lambda a, b: float(a < b)),
    "le": (2, lambda a, b: float(a <= b)),
    "and": (1, lambda a, b: float(a != 0.0 and b != 0.0)),
    "or": (1, lambda a, b: float(a != 0.0 or b != 0.0)),
    "xor": (1, lambda a, b: float((a != 0.0) != (b != 0.0))),
}
_OF_FANUC_OPERATIONS = _OPERATIONS | {
    "and": (4, _bitwise(operator.and_)),
    "or": (3, _bitwise(operator.or_)),
    "xor": (3, _bitwise(operator.xor)),
}
COMPARISON = 2
# Fanuc's macros know most words by their first two letters, too (B-63944EN, custom macro).
_IN_SHORT = {name[:2]: name for name in ("and", "xor")}
_OPERATOR = re.compile("|".join(re.escape(name) for name in _OPERATIONS))
_OF_FANUC_OPERATOR = re.compile(f"{_OPERATOR.pattern}|{'|'.join(_IN_SHORT)}")
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
_OF_FANUC_FUNCTIONS = _FUNCTIONS | {
    "fix": lambda x: float(math.trunc(x)),
    "fup": lambda x: math.copysign(math.ceil(abs(x)), x),
}
ARITHMETIC = 3  # the least level of an operator that makes a number of numbers
LINE = "_line"  # the name of the line number, which each line has by itself
_NAMES = (*_FUNCTIONS, "atan", "exists", "pow")
_FUNCTION = re.compile(rf"({'|'.join(_NAMES)})[ \t]*(?=\[)")
_FUNCTIONS_IN_SHORT = {name[:2]: name for name in (*_FUNCTIONS, "atan")}
_OF_FANUC_FUNCTION = re.compile(rf"({'|'.join(_NAMES)}|{'|'.join(_FUNCTIONS_IN_SHORT)})[ \t]*(?=\[)")


class Values:
    """Reads values from one line of text, in small letters and without comments, from left to right."""

    def __init__(self, text: str, name: str, number: int, parameters: Parameters) -> None:
        self._text = text
        self._name = name
        self._number = number
        self._parameters = parameters
        self._at = 0
        self._depth = 0
        self._step = 1.0  # that ROUND rounds to
        self._vacant = -1  # number of the parameter that the last operand was, if nobody has set it

    def refusal(self, at: int, key: str, **values: object) -> ProgramError:
        """The error of this line at the 0-based place ``at``."""
        return ProgramError(self._name, self._number, at + 1, message(key, **values))

    def peek(self) -> str:
        """The next character that is no gap, or nothing at the end of the line."""
        text, at = self._text, self._at
        while at < len(text) and text[at] in GAPS:
            at += 1
        self._at = at
        return text[at] if at < len(text) else ""

    def take(self, character: str) -> bool:
        if self.peek() != character:
            return False
        self._at += 1
        return True

    def go(self, at: int) -> None:
        """Read on from a place of the line."""
        self._at = at

    @property
    def rest(self) -> str:
        """What has not been read yet."""
        return self._text[self._at :]

    def skip(self, word: str) -> bool:
        """Read over a word, if it comes next."""
        self.peek()
        found = self._text.startswith(word, self._at)
        self._at += len(word) if found else 0
        return found

    def value(self, start: int, what: str) -> tuple[float, bool]:
        """A value, and whether it counts as written with a decimal point."""
        self.peek()
        at = self._at
        value = self._operand()
        if value is None:
            key = "value.o_behind" if self.peek() == "o" else "value.no_number"
            raise self.refusal(start, key, what=what)
        written = self._text[at : self._at]
        return value, any(mark in written for mark in ".#[")

    def bracket(self) -> float:
        start = self._at
        if not self.take("["):
            raise self.refusal(start, "value.no_bracket")
        value = self._chain(1)
        if not self.take("]"):
            raise self.refusal(start, "value.open_bracket")
        return value

    def key(self) -> Name:
        """The number or name of a parameter, with its #."""
        start = self._at
        self.take("#")
        if self.peek() == "<":
            return self._named()
        return self._in_range(start, self.value(start, "#")[0])

    def _in_range(self, start: int, value: float) -> int:
        if value == NOTHING and self._parameters.of_fanuc:
            return NOTHING
        numbers = OF_FANUC if self._parameters.of_fanuc else NUMBERED
        if value != math.floor(value) or int(value) not in numbers:
            first, last = numbers.start, numbers.stop - 1
            raise self.refusal(start, "value.no_parameter", value=value, first=first, last=last)
        return int(value)

    def _named(self) -> str:
        found = _NAME.match(self._text, self._at)
        name = "".join(found.group(1).split()) if found else ""
        if found is None or not name:
            raise self.refusal(self._at, "value.no_name")
        self._at = found.end()
        return name

    def _operand(self) -> float | None:
        """A number, parameter, bracket or function with an optional sign; None where none stands."""
        self.peek()
        self._vacant = -1
        if number := _NUMBER.match(self._text, self._at):
            self._at = number.end()
            written = "".join(number.group().split())
            return self._sound(number.start(), written[:SHOWN], float, written)
        negative = self.take("-")
        if not negative:
            self.take("+")
        self._depth += 1
        if self._depth > DEEPEST:
            raise self.refusal(self._at, "value.too_deep", most=DEEPEST)
        value = self._compound()
        self._depth -= 1
        if negative:
            self._vacant = -1
        return -value if negative and value is not None else value

    def _compound(self) -> float | None:
        start = self.peek()
        if start == "#":
            return self._parameter()
        if start == "[":
            return self.bracket()
        functions = _OF_FANUC_FUNCTION if self._parameters.of_fanuc else _FUNCTION
        if function := functions.match(self._text, self._at):
            self._at = function.end()
            value = self._function(_FUNCTIONS_IN_SHORT.get(function.group(1), function.group(1)))
            self._vacant = -1
            return value
        return None

    def _parameter(self) -> float:
        start = self._at
        key = self.key()
        if key == LINE:
            return float(self._number)
        try:
            value = self._parameters.value(key)
        except NoValue as why:
            raise self.refusal(start, why.key, **why.values) from None
        self._vacant = key if isinstance(key, int) and self._parameters.is_vacant(key) else -1
        return value

    @property
    def is_vacant(self) -> bool:
        """Whether what was read last is a parameter that nobody has set, and nothing else."""
        return self._vacant >= 0

    def check_set(self, at: int) -> None:
        """Refuses what was read last where it counts that it is vacant; in a sum it is 0."""
        if self.is_vacant:
            key = "value.nothing" if self._vacant == NOTHING else "value.vacant"
            raise self.refusal(at, key, number=self._vacant)

    def _chain(self, level: int) -> float:
        """Operands joined by operators of ``level`` or above."""
        self.peek()
        return self.joined(self.value(self._at, Key("value.expression"))[0], level)

    def joined(self, value: float, level: int) -> float:
        """A value with the operands that follow it, by operators of ``level`` or above."""
        of_fanuc, compared = self._parameters.of_fanuc, False
        operations = _OF_FANUC_OPERATIONS if of_fanuc else _OPERATIONS
        operators = _OF_FANUC_OPERATOR if of_fanuc else _OPERATOR
        while self.peek() and (found := operators.match(self._text, self._at)):
            binds, function = operations[_IN_SHORT.get(found.group(), found.group())]
            if binds < level:
                break
            if compared and of_fanuc:  # AND has bound the values between, not the comparisons
                raise self.refusal(found.start(), "value.two_comparisons", what=found.group().upper())
            compared, left, self._vacant = binds == COMPARISON, self._vacant, -1
            self._at = found.end()
            right = self._chain(binds + 1)
            if found.group() in ("eq", "ne") and (left >= 0 or self._vacant >= 0):
                # What is vacant equals what is vacant, and no number (B-63944EN: undefined variable).
                value, right = float(left >= 0), float(self._vacant >= 0)
            self._vacant = -1
            value = self._sound(found.start(), found.group(), function, value, right)
        return value

    def _function(self, name: str) -> float:
        if name == "exists":
            return self._exists()
        start = self._at
        if name == "pow" and not self._parameters.of_fanuc:
            raise self.refusal(start - len(name), "value.pow")
        if self._parameters.of_fanuc and name in ("pow", "atan"):
            value, other = self._pair()
            if other is not None:
                function = math.pow if name == "pow" else lambda y, x: math.degrees(math.atan2(y, x))
                return self._sound(start - len(name), name, function, value, other)
        else:
            value = self.bracket()
        if name == "pow":
            raise self.refusal(start - len(name), "value.pow")
        if name != "atan":
            functions = _OF_FANUC_FUNCTIONS if self._parameters.of_fanuc else _FUNCTIONS
            step = self._step if name == "round" else 1.0
            return self._sound(start - len(name), name, functions[name], value / step) * step
        if not self.take("/"):  # atan[y]/[x] keeps the quadrant (RS-274/NGC 3.3.2.4)
            raise self.refusal(self._at, "value.atan")
        self.peek()
        return math.degrees(math.atan2(value, self.bracket()))

    def _pair(self) -> tuple[float, float | None]:
        """One value in brackets, or two with a comma between them: POW[#1,2], ATAN[#1,#2] (Fanuc)."""
        start = self._at
        self.take("[")
        values = [self._chain(1)]
        while len(values) < 2 and self.take(","):
            values.append(self._chain(1))
        if not self.take("]"):
            raise self.refusal(start, "value.open_bracket")
        return values[0], values[1] if len(values) == 2 else None

    def _exists(self) -> float:
        """EXISTS[#<name>]: whether a parameter may be read here."""
        start = self._at
        self.take("[")
        if self.peek() != "#":
            raise self.refusal(start, "value.exists")
        at = self._at
        self.take("#")
        key: Name | float = self._named() if self.peek() == "<" else self.value(at, "#")[0]
        if not self.take("]"):
            raise self.refusal(start, "value.exists_open")
        if isinstance(key, float):  # no number is no parameter, rather than a mistake
            return float(key in NUMBERED and self._parameters.exists(int(key)))
        return float(key == LINE or self._parameters.exists(key))

    def _sound(self, start: int, what: str, function: Callable[..., float], *arguments: Any) -> float:
        """A finite real value; what has none is to blame, not the word that it is for."""
        try:
            value = function(*arguments)
        except ZeroDivisionError:
            raise self.refusal(start, "value.by_zero", what=what) from None
        except _NoBits as none:
            value = none.args[0]
            raise self.refusal(start, "value.no_bits", what=what.upper(), value=value) from None
        except (ValueError, OverflowError):
            value = math.nan
        if not math.isfinite(value):
            raise self.refusal(start, "value.not_finite", what=what)
        return value
