"""G254, G54.2 and G255: the program's origin follows the part that a rotary table has turned.

G254 (Haas' dynamic work offset, operator's manual of mills, group 23) carries the origin of the active work
offset, as it lies with the rotaries at zero, about the axes of the tables. G54.2 P (Fanuc's dynamic fixture
offset) adds a vector to the work offset that turns with the tables; G10 L21 P says it, with the angles at
which it was measured. Both take the rotaries where the line ends, X Y Z stay parallel to the axes of the
machine, and nothing moves before the next word of X, Y or Z.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from controller.geometry.vectors import Frame
from controller.machine.kinematics import Kinematics
from controller.machine.model import FIXTURES, Kind, Machine, Pair
from controller.program import motion_words
from controller.program.modal import State
from controller.program.offset_words import Here
from controller.program.origins import Following, Origins, fixture_index
from controller.program.position import Coordinate, Position
from controller.program.words import Word

ON = ("G254", "G54.2")


def switched(here: Here) -> State:
    """The state after G254, G54.2 or G255. Raises ProgramError."""
    code, word = here.ask.codes["dynamic offset"]
    number = _number(here, word) if code == "G54.2" else 0
    if code == "G255" or (code == "G54.2" and number == 0):
        return _with(here.state, None, here.machine)
    if not _tables(here.machine):
        raise here.ask.refusal(word, "following.no_table", code=code)
    found = Following(code, number, Frame(), is_current=False)
    return _with(here.state, found, here.machine)


def _number(here: Here, word: Word) -> int:
    given = here.ask.words.get("P")
    if given is None or here.ask.whole(given) > len(FIXTURES):
        raise here.ask.refusal(given or word, "following.number", most=len(FIXTURES))
    number = int(given.value)
    if number and not here.state.origins.is_set(fixture_index(number), here.machine):
        raise here.ask.refusal(given, "following.not_set", number=number)
    return number


def followed(here: Here, motion: str) -> State:
    """The state in which the line moves: the origin as it lies where the line ends. Raises ProgramError."""
    state, following = here.state, here.state.origins.following
    if following is None:
        return state
    if other := here.own_frame(motion):
        word = here.word_of(other, *ON)
        raise here.ask.refusal(word, "following.beside", code=following.code, other=other)
    return standing(state, _at_end(here, motion), here.machine, here.position.chain())


def refreshed(state: State, position: Position, machine: Machine) -> State:
    """The state in which the next line is read: the origin as it lies where the rotaries stand."""
    if state.origins.following is None:
        return state
    return standing(state, position.rotaries, machine, position.chain())


def standing(state: State, rotaries: Sequence[Coordinate], machine: Machine, kinematics: Kinematics) -> State:
    """The state with the rotaries (rad, carried) there, as after a jog.

    Where one of them is not known, neither is how the table stands, and the state says so.
    """
    if (following := state.origins.following) is None:
        return state
    first, second = rotaries
    if first is None or second is None:
        return _with(state, replace(following, is_current=False), machine)
    found = replace(following, table=table_at(machine, kinematics, (first, second)), is_current=True)
    if following.number:
        measured_at = state.origins.offset(fixture_index(following.number), machine).turned_rad
        found = replace(found, reference=table_at(machine, kinematics, measured_at))
    return state if found == following else _with(state, found, machine)


def table_at(machine: Machine, kinematics: Kinematics, rotaries: Pair) -> Frame:
    """The table with the rotaries there (rad, carried), as the linear axes see it; heads play no part."""
    turned = [0.0, 0.0]
    for k in _tables(machine):
        turned[k] = rotaries[k]
    return kinematics.of_axes(Frame(), (turned[0], turned[1]), 0.0)


def _tables(machine: Machine) -> list[int]:
    """Which of the rotaries turn the part."""
    return [k for k, i in enumerate(machine.rotary()) if machine.axes[i].kind is Kind.TABLE]


def _with(state: State, following: Following | None, machine: Machine) -> State:
    origins: Origins = replace(state.origins, following=following)
    return state.with_origins(origins, machine)


def _at_end(here: Here, motion: str) -> Sequence[Coordinate]:
    """The rotaries where the line ends; not known where it is led to a reference point."""
    now = here.position.rotaries
    if here.ask.code("one-line") in ("G28", "G30"):
        return None, None
    if not motion:
        return now
    machine = here.machine
    targets = machine.pair(motion_words.targets(here), None)
    relative = not here.state.absolute and here.ask.code("one-line") != "G53"

    def end(q: Coordinate, target: Coordinate) -> Coordinate:
        if target is None or not relative:
            return q if target is None else target
        return None if q is None else q + target

    return [end(q, target) for q, target in zip(now, targets, strict=True)]
