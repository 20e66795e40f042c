"""G38.2 to G38.5 and G31: lines that end where the probe touches, or is free."""

from __future__ import annotations

from dataclasses import replace

from controller.messages import Key, said
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
    key, values = "", dict[str, object]()
    if sensor is None:
        number = None if machine.probe is None else machine.probe.tool
        known = Key("probe.is_none") if number is None else said("probe.is_tool", number=number)
        key, values = "probe.none", {"tool": modal.tool, "known": known}
    elif rotaries:
        key, word = "probe.turns", ask.words[rotaries[0]]
    elif not ask.has("XYZ"):
        key = "probe.no_way"
    elif modal.planar is not None:
        key = "probe.beside"
    elif here.state.inverse:
        key = "probe.inverse"
    elif modal.spindle_rev_min and sensor is machine.probe:
        key = "probe.spindle"
    return ask.refusal(word, key, code=code, **values) if key else None
