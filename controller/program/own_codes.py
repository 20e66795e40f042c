"""G and M codes of the machine's own: ``own_codes`` of the machine file.

    M428 = "G43.4"        a name for a code of this control, which is read in its place
    M200 = "clamp_part"   a sub: of a file of that name, or o<clamp_part> sub; a number is that of M98

The words beside such a call are the sub's own: #<x> of X (as LinuxCNC's REMAP has them with ``argspec``), and
under the dialect of Fanuc #24, too, as G65 numbers them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from types import MappingProxyType

from controller.machine.model import Machine
from controller.machine.program_table import CODE
from controller.program.line import Line, Word
from controller.program.source_text import Text

Codes = Mapping[tuple[str, float], str]  # letter and number -> what is meant


def subs(machine: Machine) -> dict[str, str]:
    """Codes, and labels of the subs that they call."""
    return {code: _label(meant) for code, meant in machine.own_codes if not CODE.fullmatch(meant)}


def _label(name: str) -> str:
    return str(int(name)) if name.isdigit() else name


def calls(machine: Machine) -> Codes:
    """The same by letter and number."""
    return MappingProxyType({_key(code): label for code, label in subs(machine).items()})


@cache
def _meant(own: tuple[tuple[str, str], ...]) -> Codes:
    return MappingProxyType({_key(code): meant for code, meant in own if CODE.fullmatch(meant)})


def _key(code: str) -> tuple[str, float]:
    return code[0], float(code[1:])


def read(word: Word, machine: Machine) -> Word:
    """The word that is meant; it is told of as it is written."""
    if not machine.own_codes:
        return word
    meant = _meant(machine.own_codes).get((word.letter, word.value))
    return word if meant is None else word._replace(letter=meant[0], value=float(meant[1:]))


def call_in(line: Line, codes: Codes) -> Word | None:
    """The word of a line that calls a sub."""
    return next((word for word in line.words if (word.letter, word.value) in codes), None)


@cache
def pattern(code: str) -> re.Pattern[bytes]:
    """Finds a code in a text."""
    whole, _, tenth = code[1:].partition(".")
    ends = rf"\.{tenth}0*" if tenth else r"(?:\.0*)?"
    letter = rf"[{code[0]}{code[0].lower()}]"
    return re.compile(rf"{letter}[ \t]*0*{whole}{ends}(?![0-9.])".encode())


def may_stand_in(text: Text, codes: Codes) -> bool:
    """Whether a text may have a call."""
    return any(pattern(f"{letter}{number:g}").search(text.body) for letter, number in codes)
