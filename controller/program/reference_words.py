"""G28, G28.1, G30 and G30.1: to the reference points of the machine, and setting them."""

from __future__ import annotations

from types import MappingProxyType

from controller.machine.model import Machine
from controller.program import line_words
from controller.program.codes import ParsedLine
from controller.program.modal import State
from controller.program.offset_words import Here
from controller.program.position import Coordinate
from controller.program.program import Block, JointLine, Targets, Tip, TipLine
from controller.program.words import Word

INCREMENTS = {"U": "X", "V": "Y", "W": "Z"}


def stored(here: Here) -> State:
    """G28.1 and G30.1: the position becomes the point, from now on."""
    code, word = here.ask.codes["one-line"]
    joints = here.known(word, here.position.joints(), code)
    points = MappingProxyType({**here.state.references, code[:3]: joints})
    return here.state._replace(references=points)


def moves(here: Here) -> list[Block]:
    """G28 and G30: a rapid by the words, then one of the same axes to the point; without words all."""
    code, word = here.ask.codes["one-line"]
    if (number := here.ask.words.get("P")) is not None and number.value != 2.0:
        raise here.ask.refusal(number, "reference.number")
    targets, relative = _with_increments(here, line_words.targets(here))
    place, modal = here.ask.place(word), here.state.modal
    point = reference(here.state, here.machine, code)
    made: list[Block] = []
    if any(target is not None for target in targets):
        point = tuple(q if target is not None else None for q, target in zip(point, targets, strict=True))
        if modal.tip is Tip.OFF:
            made.append(JointLine(place, modal, targets, relative, False, None, None))
        else:
            x, y, z = (targets[i] for i in here.machine.linear())
            turns = here.machine.pair(targets, None)
            made.append(TipLine(place, modal, (x, y, z), turns, None, relative, None, None))
    return [*made, JointLine(place, modal, point, False, True, None, None)]


def _with_increments(here: Here, targets: Targets) -> tuple[Targets, bool]:
    """U V W are distances along X Y Z, whatever G90 and G91 say."""
    words = {INCREMENTS[letter]: here.ask.words[letter] for letter in INCREMENTS if letter in here.ask.words}
    relative = not here.state.absolute
    if not words:
        return targets, relative
    if any(target is not None for target in targets) and not relative:
        raise _mixed(here.ask, next(iter(words.values())))
    unit, axes = here.state.mm_per_unit, here.machine.axes
    made: list[Coordinate] = [
        words[axis.name].value * unit if axis.name in words else target
        for axis, target in zip(axes, targets, strict=True)
    ]
    return tuple(made), True


def _mixed(ask: ParsedLine, word: Word) -> Exception:
    return ask.refusal(word, "reference.mixed")


def reference(state: State, machine: Machine, code: str) -> tuple[Coordinate, ...]:
    """The joints of a point: as the program stored it, else as the machine has it."""
    return state.references[code] if code in state.references else machine.reference(code)
