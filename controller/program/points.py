"""What a length or an angle without a decimal point counts in under the fanuc dialect.

Controls of this kind read X10 as 10 mm or as 0.01 mm, as one of their parameters says. Nothing in a program
tells which, so the machine file does (``without_point``), and such a word is refused where it does not.
"""

from __future__ import annotations

import re
from dataclasses import replace

from controller.machine.model import Machine
from controller.program.code_table import BY_DIALECT
from controller.program.codes import CYCLES, SIDES, SURFACES, TILTS, TO_PLANE, ParsedLine
from controller.program.line import ANGLES, LENGTHS, pointed
from controller.program.modal import INCHES, State
from controller.program.words import Word

POINTLESS = re.compile(r"[XYZABCIJKRxyzabcijkr][ \t]*+[+-]?[0-9]++(?![.0-9])")


def count(machine: Machine) -> bool:
    """Whether it matters that a decimal point is written."""
    return machine.dialect == "fanuc" and machine.without_point != "unit"


def counted(ask: ParsedLine, state: State, machine: Machine) -> ParsedLine:
    """The line with words without a point as the machine file has them. Raises ProgramError."""
    if not count(machine) or _has_its_own(ask):
        return ask
    inches = ask.code("unit") in INCHES if "unit" in ask.codes else state.mm_per_unit != 1.0
    noted = _letters_of_noted(ask)
    lengths, angles = ("".join(c for c in letters if c not in noted) for letters in _letters(ask, state))
    words = {letter: _word(ask, word, lengths, angles, inches, machine) for letter, word in ask.words.items()}
    return replace(ask, words=words)


def _letters(ask: ParsedLine, state: State) -> tuple[str, str]:
    """The words of the line that are lengths, and those that are angles."""
    if ask.code("rotation") in TILTS or ask.code("one-line") in TO_PLANE:
        return "XYZ", "IJKR"
    counts = "K" if _in_cycle(ask, state) else "R" if ask.code("motion") == "G31" else ""
    counts += "Q" if "tool change" in ask.codes else ""
    return "".join(letter for letter in LENGTHS if letter not in counts), ANGLES


def _has_its_own(ask: ParsedLine) -> bool:
    """Surfaces count in BLU, dwells in milliseconds."""
    motion = ask.code("motion")
    own = motion in SURFACES and not (motion == "G52" and "F" not in ask.words)
    return own or ask.code("one-line") == "G4"


def _letters_of_noted(ask: ParsedLine) -> str:
    """The words of codes that need no action count nothing."""
    return "".join(
        BY_DIALECT["fanuc"][code].letters for group, (code, _) in ask.codes.items() if group == code
    )


def _in_cycle(ask: ParsedLine, state: State) -> bool:
    return (ask.code("motion") or state.motion) in CYCLES and ask.code("side") not in SIDES[1:]


def _word(ask: ParsedLine, word: Word, lengths: str, angles: str, inches: bool, machine: Machine) -> Word:
    if word.letter not in lengths + angles:
        return word
    return pointed(word, machine.without_point, inches and word.letter in lengths, ask.refusal)
