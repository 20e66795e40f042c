"""G38.2 to G38.5 and G31: lines that end where the probe touches, or is free."""

from __future__ import annotations

from dataclasses import replace

from controller.program import line_words
from controller.program.offset_words import Here
from controller.program.program import JointLine, Probing, ProgramError, TipLine
from controller.program.words import Word

AWAY, MUST = ("G38.4", "G38.5"), ("G38.2", "G38.4")


def line(here: Here, code: str, word: Word) -> JointLine | TipLine:
    """The line of a probing move, the rotaries standing. Raises ProgramError."""
    if (wrong := _wrong(here, code, word)) is not None:
        raise wrong
    made = line_words.line(here, "G1", word)
    return replace(made, probe=Probing(code, code in AWAY, code in MUST))


def _wrong(here: Here, code: str, word: Word) -> ProgramError | None:
    """Why this line cannot be probed along."""
    ask, modal, machine = here.ask, here.state.modal, here.machine
    sensor = machine.sensor(modal.tool)
    rotaries = [axis.name for axis in machine.axes if axis.is_rotary and axis.name in ask.words]
    if sensor is None:
        known = f"its probe is T{machine.probe.tool}" if machine.probe is not None else "it has none"
        why = (
            f"{code} asks for a probe, and T{modal.tool} is none on this machine: {known}; put it into the "
            "spindle with T and M6, or add [probe] (for tools [setter]) to the machine file"
        )
    elif rotaries:
        word = ask.words[rotaries[0]]
        why = f"{word.text} would turn the part while it is probed: rotaries stand under {code}; remove it"
    elif not ask.has("XYZ"):
        why = f"{code} has no way: it goes with X, Y or Z; write where it may lead at most"
    elif modal.planar is not None:
        why = f"{code} beside a contour (G41, G42) has no meaning; write G40 before it"
    elif here.state.inverse:
        why = f"{code} takes its feed per minute, for nobody knows how far it goes; write G94 before it"
    elif modal.spindle_rev_min and sensor is machine.probe:
        why = f"{code}: a probe must not turn, and the spindle does; write M5 before it"
    else:
        return None
    return ask.refusal(word, why)
