"""@ and ^ of LinuxCNC: distance from the program's origin and angle about it, in X and Y.

Under G90 they are where the line ends, under G91 steps from where it begins; one that is left out stays.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from controller.machine.model import Machine
from controller.messages import Key
from controller.program.codes import Ask
from controller.program.modal import INCHES, State
from controller.program.offset_words import Here
from controller.program.position import Position
from controller.program.words import Word

MIN_MM = 1e-9  # from the origin: nearer there is no direction


def cartesian(ask: Ask, state: State, position: Position, machine: Machine) -> Ask:
    """The line with X and Y in place of @ and ^. Raises ProgramError."""
    if "@" not in ask.words and "^" not in ask.words:
        return ask
    word = ask.words.get("@") or ask.words["^"]
    _check(ask, word, machine)
    if "unit" in ask.codes:
        state = state._replace(mm_per_unit=25.4 if ask.code("unit") in INCHES else 1.0)
    absolute = {"G90": True, "G91": False}.get(ask.code("distance"), state.absolute)
    here = Here(ask, state, position, machine)
    distance, angle = here.length_mm("@"), ask.words["^"].value if "^" in ask.words else None
    if absolute and distance is not None and angle is not None:
        x, y = _at(distance, math.radians(angle))
        return _with(ask, word, (x, y), state.mm_per_unit)
    begin = here.known(word, position.in_frame(state.modal)[:2], Key("position.polar"))
    steps = (distance or 0.0, math.radians(angle or 0.0))
    if not absolute:
        x, y = stepped(ask, word, begin, steps)
        made = _with(ask, word, (x - begin[0], y - begin[1]), state.mm_per_unit)
        return replace(made, polar=steps)
    far, turned = math.hypot(*begin), math.atan2(begin[1], begin[0])
    end = _at(far if distance is None else distance, turned if angle is None else steps[1])
    return _with(ask, word, end, state.mm_per_unit)


def stepped(ask: Ask, word: Word, begin: Sequence[float], steps: tuple[float, float]) -> tuple[float, float]:
    """X and Y one step of distance (mm) and angle (rad) on. Raises ProgramError."""
    far = math.hypot(*begin)
    if far < MIN_MM:
        raise ask.refusal(word, "polar.no_direction")
    return _at(far + steps[0], math.atan2(begin[1], begin[0]) + steps[1])


def _at(distance: float, angle: float) -> tuple[float, float]:
    return distance * math.cos(angle), distance * math.sin(angle)


def _check(ask: Ask, word: Word, machine: Machine) -> None:
    key = ""
    if machine.dialect != "rs274":
        key = "polar.dialect"
    elif ask.has("XY"):
        key = "polar.beside_xy"
    elif "one-line" in ask.codes and ask.code("one-line") != "G53":
        key = "polar.beside_code"
    if key:
        raise ask.refusal(word, key, code=ask.code("one-line"))


def _with(ask: Ask, word: Word, end: tuple[float, float], mm_per_unit: float) -> Ask:
    words = {letter: one for letter, one in ask.words.items() if letter not in "@^"}
    for letter, value in zip("XY", end, strict=True):
        words[letter] = Word(letter, value / mm_per_unit, True, word.column, word.text)
    return replace(ask, words=words)
