"""G0 and G1: what their words say of a line, of the axes or of the tool."""

from __future__ import annotations

import math
from dataclasses import replace

from controller.geometry.vectors import Vector
from controller.messages import Key, message
from controller.program.offset_words import Here
from controller.program.program import JointLine, Probing, ProgramError, Targets, Tip, TipLine
from controller.program.words import Word

SHORTEST_VECTOR = 1e-6  # of I J K; shorter ones have no sure direction


def targets(here: Here) -> Targets:
    """A value per axis of the machine: mm, or radians of the carried body."""
    check_rotaries(here)
    found: list[float | None] = []
    turned = iter(here.state.modal.turned_rad)
    shifts = here.state.absolute and here.ask.code("one-line") != "G53"
    for axis in here.machine.axes:
        word = here.ask.words.get(axis.name)
        shift = next(turned) if axis.is_rotary else 0.0
        if word is None:
            found.append(None)
        elif axis.is_rotary:
            found.append(word.value / axis.shown_per_unit + (shift if shifts else 0.0))
        else:
            found.append(word.value * here.state.mm_per_unit)
    return tuple(found)


def check_rotaries(here: Here) -> None:
    """In a tilted plane X Y Z are places on the part, to which no straight way leads while rotaries turn."""
    ask, modal = here.ask, here.state.modal
    if not modal.tilted or modal.tip is not Tip.OFF or ask.code("one-line") == "G53":
        return
    rotary = [here.machine.axes[i].name for i in here.machine.rotary()]
    if ask.has("XYZUVW") and ask.has("".join(rotary)):
        word = next(ask.words[name] for name in rotary if name in ask.words)
        raise ask.refusal(word, "line.turns_in_plane")


def line(here: Here, motion: str, word: Word) -> JointLine | TipLine:
    """The line of G0 or G1 (``motion``, or the first word that it takes)."""
    ask, state = here.ask, here.state
    mm = degrees = time = None
    if motion == "G1":
        time = state.time(ask, "G1", word)
        mm = 0.0 if time else state.feed(ask, "G1", word)
        degrees = 0.0 if time else state.feed_deg_s
    machine_frame = ask.code("one-line") == "G53"
    relative = not state.absolute and not machine_frame
    place, values = ask.place(word), targets(here)
    if state.modal.tip is Tip.OFF or machine_frame:
        return JointLine(place, state.modal, values, relative, machine_frame, mm, degrees, time)
    x, y, z = (values[i] for i in here.machine.linear())
    turns = here.machine.pair(values, None)
    return TipLine(place, state.modal, (x, y, z), turns, _axis(here), relative, mm, degrees, time)


def _axis(here: Here) -> Vector | None:
    """I J K along the tool axis (G43.5): all of them or none."""
    words = [here.ask.words[letter] for letter in "IJK" if letter in here.ask.words]
    if not words:
        return None
    found = " ".join(word.text for word in words)
    if len(words) < 3:
        raise here.ask.refusal(words[0], "line.half_a_vector", found=found)
    if not here.state.absolute:
        raise here.ask.refusal(words[0], "line.vector_relative", found=found)
    i, j, k = (word.value for word in words)
    if math.sqrt(i * i + j * j + k * k) < SHORTEST_VECTOR:
        raise here.ask.refusal(words[0], "line.no_length", found=found, least=SHORTEST_VECTOR)
    return i, j, k


# G38.2 to G38.5 and G31: lines that end where the probe touches, or is free.

AWAY, MUST = ("G38.4", "G38.5"), ("G38.2", "G38.4")


def probing_line(here: Here, code: str, word: Word) -> JointLine | TipLine:
    """The line of a probing move, the rotaries standing. Raises ProgramError."""
    if (wrong := _no_probing(here, code, word)) is not None:
        raise wrong
    made = line(here, "G1", word)
    return replace(made, probe=Probing(code, code in AWAY, code in MUST))


def _no_probing(here: Here, code: str, word: Word) -> ProgramError | None:
    """Why this line cannot be probed along."""
    ask, modal, machine = here.ask, here.state.modal, here.machine
    sensor = machine.sensor(modal.tool)
    rotaries = [axis.name for axis in machine.axes if axis.is_rotary and axis.name in ask.words]
    key, values = "", dict[str, object]()
    if sensor is None:
        number = None if machine.probe is None else machine.probe.tool
        known = Key("probe.is_none") if number is None else message("probe.is_tool", number=number)
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
