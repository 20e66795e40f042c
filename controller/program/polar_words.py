"""@ and ^ of LinuxCNC: distance from the program's origin and angle about it, in X and Y; and G16 of Fanuc's.

Under G90 they are where the line ends, under G91 steps from where it begins; one that is left out stays.

Under G16 the words of the plane's axes are a radius and an angle (B-64484EN, polar coordinate command). A
radius under G90 is about the program's origin, one under G91 about where the tool stands; an angle under G91
is added to the last one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from controller.machine.model import Machine
from controller.messages import Key
from controller.program.codes import SURFACES, ParsedLine
from controller.program.modal import INCHES, State
from controller.program.motion_words import PLANES
from controller.program.offset_words import Here
from controller.program.position import Coordinate, Position
from controller.program.words import Word

MIN_MM = 1e-9  # from the origin: nearer there is no direction


def cartesian(ask: ParsedLine, state: State, position: Position, machine: Machine) -> ParsedLine:
    """The line with X and Y in place of @ and ^. Raises ProgramError."""
    if "@" not in ask.words and "^" not in ask.words:
        return ask
    word = ask.words.get("@") or ask.words["^"]
    _check(ask, word, ask.code("plane") or state.modal.plane, machine)
    state = _under(ask, state)
    here, absolute = Here(ask, state, position, machine), state.absolute
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
    if angle is None and far < MIN_MM:
        raise ask.refusal(word, "polar.no_angle")
    end = _at(far if distance is None else distance, turned if angle is None else steps[1])
    return _with(ask, word, end, state.mm_per_unit)


_NOT_POLAR = ("G4", "G10", "G28", "G30", "G53", "G92", "G92.1", "G92.2", "G92.3")


def programmed(
    ask: ParsedLine, state: State, position: Position, machine: Machine
) -> tuple[ParsedLine, State]:
    """The line with positions in place of radius and angle, and the state with both. Raises ProgramError."""
    code = ask.code("polar")
    if code == "G15":
        return ask, state._replace(polar=None)
    plane = ask.code("plane") or state.modal.plane
    names = ["XYZ"[i] for i in PLANES[plane][:2]]
    here = Here(ask, _under(ask, state), position, machine)
    if state.polar is None or plane != state.modal.plane:
        a, b = here.known(ask.line.words[0], _in_plane(here, plane), Key("position.polar"))
        state = state._replace(polar=(0.0, 0.0, math.hypot(a, b), math.atan2(b, a)))
    taken = ask.code("one-line") in _NOT_POLAR or "rotation" in ask.codes or "mirror" in ask.codes
    if taken or ask.code("motion") in SURFACES or not ask.has("".join(names)):
        return ask, state
    absolute = here.state.absolute
    begin = here.known(ask.line.words[0], _in_plane(here, plane), Key("position.polar"))
    radius_mm, turn = here.length_mm(names[0]), ask.words.get(names[1])
    assert state.polar is not None
    *pole, radius, angle = state.polar
    if radius_mm is not None:
        pole, radius = [0.0, 0.0] if absolute else [*begin], radius_mm
    steps = 0.0 if turn is None else math.radians(turn.value)
    angle = angle if turn is None else steps if absolute else angle + steps
    along, across = _at(radius, angle)
    end = (pole[0] + along, pole[1] + across)
    less = (0.0, 0.0) if absolute else begin
    word = ask.words.get(names[0]) or ask.words[names[1]]
    words = dict(ask.words)
    for name, q, off in zip(names, end, less, strict=True):
        words[name] = Word(name, (q - off) / here.state.mm_per_unit, True, word.column, word.text)
    made = replace(ask, words=words)
    if not absolute and radius_mm is None and pole == [0.0, 0.0]:
        made = replace(made, polar=(0.0, steps))
    return made, state._replace(polar=(pole[0], pole[1], radius, angle))


def _under(ask: ParsedLine, state: State) -> State:
    """The state with the unit and the distances of the line."""
    absolute = {"G90": True, "G91": False}.get(ask.code("distance"), state.absolute)
    unit = (25.4 if ask.code("unit") in INCHES else 1.0) if "unit" in ask.codes else state.mm_per_unit
    return state._replace(mm_per_unit=unit, absolute=absolute)


def _in_plane(here: Here, plane: str) -> Sequence[Coordinate]:
    """Where the tool stands, along the plane's two axes."""
    now = here.position.in_frame(here.state.modal)
    return [now[i] for i in PLANES[plane][:2]]


def stepped(
    ask: ParsedLine, word: Word, begin: Sequence[float], steps: tuple[float, float]
) -> tuple[float, float]:
    """X and Y one step of distance (mm) and angle (rad) on. Raises ProgramError."""
    far = math.hypot(*begin)
    if far < MIN_MM:
        raise ask.refusal(word, "polar.no_direction")
    return _at(far + steps[0], math.atan2(begin[1], begin[0]) + steps[1])


def _at(distance: float, angle: float) -> tuple[float, float]:
    return distance * math.cos(angle), distance * math.sin(angle)


def _check(ask: ParsedLine, word: Word, plane: str, machine: Machine) -> None:
    code = ask.code("one-line")
    ask.refuse_where(
        word,
        (machine.dialect != "rs274", "polar.dialect"),
        (ask.has("XY"), "polar.beside_xy"),
        (code not in ("", "G53"), "polar.beside_code"),
        (plane != "G17", "polar.plane"),
        **{"code": code, "plane": plane},
    )


def _with(ask: ParsedLine, word: Word, end: tuple[float, float], mm_per_unit: float) -> ParsedLine:
    words = {letter: one for letter, one in ask.words.items() if letter not in "@^"}
    for letter, value in zip("XY", end, strict=True):
        words[letter] = Word(letter, value / mm_per_unit, True, word.column, word.text)
    return replace(ask, words=words)
