"""M6 where the machine has a changer: its steps as blocks, each behind a stop.

    M6 -> stop | step | stop | step | ... | stop | the program goes on

At each stop somebody keeps in a journal which step comes, before it moves anything, and only then lets the
machine go on (``service/tool_changer``). What a step switches is told at its place alone, and is no part of
the program's modal state: no restart brings it back.
"""

from __future__ import annotations

from dataclasses import replace

from controller.machine.model import Changer, ChangerStep, Machine
from controller.program.codes import Ask
from controller.program.program import (
    UNSAID,
    Act,
    Action,
    Await,
    Block,
    Changing,
    JointLine,
    Level,
    Modal,
    Place,
)
from controller.program.words import Word

LEVELS = {"rise": Level.RISE, "fall": Level.FALL, "on": Level.HIGH, "off": Level.LOW}


def steps_of(changer: Changer, tool_out: int, tool_in: int) -> list[tuple[ChangerStep, int]]:
    """The steps of a change with the pocket of each: the tool of the spindle away, then the other."""
    rows = [(step, changer.pocket(tool_out) or 0) for step in changer.put_away] if tool_out else []
    return rows + ([(step, changer.pocket(tool_in) or 0) for step in changer.take] if tool_in else [])


def blocks(
    ask: Ask, word: Word, before: Modal, after: Modal, machine: Machine, number: int
) -> tuple[list[Block], int]:
    """What M6 makes, and the number of the next stop. Raises ProgramError.

    ``before``, ``after``: the modal state without coolant, with the one and the other tool.
    """
    changer = machine.changer
    if changer is None or before.tool == after.tool == 0:
        return [], number
    place, still, made = ask.place(word), replace(after, spindle_rev_min=0.0, coolant=0), list[Block]()
    if before.tool == after.tool:  # nothing moves, but where the tool's life is over the run is held here
        return [_stop(place, still, Changing(number, before.tool, after.tool, 0, True))], number + 1
    for tool in (before.tool, after.tool):
        if tool and changer.pocket(tool) is None:
            known = ", ".join(f"T{one}" for one in changer.pockets if one) or "–"
            raise ask.refusal(word, "tool.no_pocket", tool=tool, known=known)
    if before.planar is not None:
        raise ask.refusal(word, "tool.change_beside")
    rows = steps_of(changer, before.tool, after.tool)
    for k, (step, pocket) in enumerate(rows):
        made.append(_stop(place, still, Changing(number + k, before.tool, after.tool, k, False)))
        made += _step(place, still, step, pocket, machine)
    last = Changing(number + len(rows), before.tool, after.tool, len(rows), True)
    made.append(_stop(place, still, last))
    return made, number + len(rows) + 1


def _stop(place: Place, modal: Modal, changing: Changing) -> Action:
    return Action(place, modal, Act.STOP, changing)


def _step(place: Place, modal: Modal, step: ChangerStep, pocket: int, machine: Machine) -> list[Block]:
    """Moves, then the spindle's angle, then outputs, then the input."""
    made: list[Block] = []
    if step.move:
        goes = dict(step.move)
        targets = tuple(
            None if axis.name not in goes else _of(goes[axis.name], pocket) for axis in machine.axes
        )
        made.append(JointLine(place, modal, targets, False, True, None, None))
    io = machine.io
    if io is None:
        return made
    if step.orient and io.orient is not None:
        outputs = UNSAID.switched(io.switched.index(io.orient.output), True)
        made.append(Action(place, modal, Act.OUTPUT, outputs=outputs))
        back = io.awaited.index(io.orient.input)
        made.append(Await(place, modal, back, Level.HIGH, io.orient.within_s))
    said = UNSAID
    for name, on in step.outputs(pocket):
        said = said.switched(io.switched.index(name), on)
    if (
        step.input
    ):  # in one with the outputs, or a switch that is quick would have changed before it is awaited
        number = io.awaited.index(step.input)
        made.append(Await(place, modal, number, LEVELS[step.level], step.within_s, said))
    elif said != UNSAID:
        made.append(Action(place, modal, Act.OUTPUT, outputs=said))
    return made


def _of(places: tuple[float, ...], pocket: int) -> float:
    """The only place, or that of the pocket."""
    return places[0] if len(places) == 1 else places[pocket - 1]
