"""One line sorted: its codes by modal group, its other words by letter.

The groups are those of RS-274/NGC table 4 as far as the control knows their codes;
of one group a line takes one code. G51 and G52 stand among the motions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from types import MappingProxyType

from controller.machine import Machine
from controller.plan.text.program import Place, ProgramError
from controller.plan.text.words import Line, Word

SIDES = ("G40", "G41", "G42")
SURFACES = ("G51", "G52", "G6.2")
CONE_WORDS = "XYZIJKHRD"
GROUPS = MappingProxyType(
    {
        "motion": ("G0", "G1", "G2", "G3", "G51", "G52", "G6.2", "G80"),
        "one-line": ("G4", "G53"),
        "plane": ("G17", "G18", "G19"),
        "unit": ("G20", "G21"),
        "side": ("G40", "G41", "G42"),
        "length": ("G43", "G43.4", "G43.5", "G49"),
        "offset": ("G54", "G55", "G56", "G57", "G58", "G59"),
        "path": ("G61", "G64"),
        "distance": ("G90", "G91"),
        "centre": ("G91.1",),
        "feed": ("G93", "G94"),
        "stop": ("M0", "M1", "M2", "M30"),
        "spindle": ("M3", "M4", "M5"),
        "tool change": ("M6",),
        "coolant": ("M7", "M8", "M9"),
    }
)
GROUP_OF = MappingProxyType({code: group for group, codes in GROUPS.items() for code in codes})
_HINTS = MappingProxyType(
    {
        "G50": "scaling is not done here, so there is none to cancel",
        "G90.1": "arc centres I J K are always distances from the start (G91.1)",
        "G92": "use a work offset G54 to G59 of the machine file",
        "G95": "feeds are per minute (G94) or inverse times (G93)",
    }
)


@dataclass(frozen=True, slots=True)
class Ask:
    """What one line asks for; every refusal of it has its file and line."""

    line: Line
    codes: dict[str, tuple[str, Word]]  # modal group -> code as named in GROUPS, and its word
    words: dict[str, Word]  # letter -> word, without G M N

    def code(self, group: str) -> str:
        return self.codes[group][0] if group in self.codes else ""

    def has(self, letters: str) -> bool:
        return any(letter in self.words for letter in letters)

    def refusal(self, word: Word, sentence: str) -> ProgramError:
        return self.line.refusal(word, sentence)

    def place(self, word: Word) -> Place:
        return self.line.place(word.column)

    def whole(self, word: Word) -> int:
        if word.value != math.floor(word.value) or word.value < 0.0:
            raise self.refusal(
                word, f"{word.text} is not a count: {word.letter} takes a whole number from 0 up; correct it"
            )
        return int(word.value)

    def not_negative(self, word: Word) -> float:
        if word.value < 0.0:
            raise self.refusal(word, f"{word.text} is negative: {word.letter} is 0 or more here; correct it")
        return word.value


def sort(line: Line, machine: Machine) -> Ask:
    """The line by groups and letters; ProgramError on unknown or doubled words."""
    codes: dict[str, tuple[str, Word]] = {}
    others: dict[str, Word] = {}
    for word in line.words:  # codes first: they are to blame before the letters that they take
        if word.letter in "GM":
            group, code = _code(line, word)
            if group in codes:
                raise line.refusal(
                    word,
                    f"{codes[group][0]} and {code} are both {group} codes: one line takes one of "
                    f"{' '.join(GROUPS[group])}; remove one or write two lines",
                )
            codes[group] = (code, word)
    for word in line.words:
        if word.letter not in "GM":
            _check_letter(line, word, others, machine)
            others[word.letter] = word
    return Ask(line, codes, others)


def _code(line: Line, word: Word) -> tuple[str, str]:
    tenths = round(word.value * 10.0)
    number = f"{tenths // 10}" if tenths % 10 == 0 else f"{tenths / 10:.1f}"
    code = f"{word.letter}{number}"
    if abs(word.value * 10.0 - tenths) < 1e-6 and code in GROUP_OF:
        return GROUP_OF[code], code
    hint = f" ({_HINTS[code]})" if code in _HINTS else ""
    known = " ".join(sorted((c for c in GROUP_OF if c[0] == word.letter), key=lambda c: float(c[1:])))
    raise line.refusal(
        word, f"{word.text} is not a code of this control{hint}: it knows {known}; use one of these"
    )


def _check_letter(line: Line, word: Word, before: dict[str, Word], machine: Machine) -> None:
    names = [axis.name for axis in machine.axes]
    if word.letter in "ABC" and word.letter not in names:
        raise line.refusal(
            word,
            f"{word.text} moves an axis that this machine does not have: its axes are {' '.join(names)}; "
            "use one of these, or choose the machine that the program was written for",
        )
    if word.letter in "EUVW":
        raise line.refusal(
            word,
            f"{word.text} is taken by no code of this line: there are no axes U V W and no exponents; write "
            "the number without an exponent, or leave the word out",
        )
    if word.letter == "N":
        raise line.refusal(
            word, f"{word.text} stands inside the line: N is the first word; move or remove it"
        )
    if word.letter in before:
        raise line.refusal(
            word,
            f"{before[word.letter].text} and {word.text} stand on one line: each letter but G and M may "
            "stand once; remove one",
        )
