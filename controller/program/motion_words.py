"""G0 to G3, probing lines and G28 to G30.1: what their words say of lines, arcs and reference points."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from types import MappingProxyType

from controller.geometry.vectors import Vector
from controller.machine.model import Machine
from controller.messages import Key, chain, message
from controller.program.codes import ParsedLine
from controller.program.modal import State
from controller.program.offset_words import Here
from controller.program.position import Coordinate
from controller.program.program import (
    Block,
    JointArc,
    JointLine,
    Probing,
    Targets,
    Tip,
    TipLine,
)
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


def to_place(machine: Machine, words: Sequence[Coordinate], axes: Sequence[int] = (0, 1, 2)) -> Targets:
    """Targets of linear axes alone: ``words`` (mm) of ``axes``, which are 0 to 2 for X Y Z."""
    made: list[Coordinate] = [None] * len(machine.axes)
    for axis, word in zip(axes, words, strict=False):
        made[machine.linear()[axis]] = word
    return tuple(made)


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
_SIGNALS = MappingProxyType({"P": range(1, 5), "R": range(2)})  # of G31, by what is connected to Fanuc's


def probing_line(here: Here, code: str, word: Word) -> JointLine | TipLine:
    """The line of a probing move, the rotaries standing. Raises ProgramError."""
    _check_probing(here, code, word)
    made = line(here, "G1", word)
    return replace(made, probe=Probing(code, code in AWAY, code in MUST))


def _check_probing(here: Here, code: str, word: Word) -> None:
    """Whether this line can be probed along. Raises ProgramError."""
    ask, modal, machine = here.ask, here.state.modal, here.machine
    sensor, probe = machine.sensor(modal.tool), machine.probe
    if sensor is None:
        known = Key("probe.is_none") if probe is None else message("probe.is_tool", number=probe.tool)
        raise ask.refusal(word, "probe.none", code=code, tool=modal.tool, known=known)
    for axis in machine.axes:
        if axis.is_rotary and axis.name in ask.words:
            raise ask.refusal(ask.words[axis.name], "probe.turns", code=code)
    for letter, signals in _SIGNALS.items():
        if (signal := ask.words.get(letter)) is not None and signal.value not in signals:
            raise ask.refusal(signal, "probe.signal")
    ask.refuse_where(
        word,
        (not ask.has("XYZ"), "probe.no_way"),
        (modal.planar is not None, "probe.beside"),
        (here.state.inverse, "probe.inverse"),
        (modal.spindle_rev_min and sensor is probe, "probe.spindle"),
        code=code,
    )


MAX_TURNS = 1000  # of one arc

# Plane axes so that first x second = normal: counter-clockwise is the right hand about the normal.
PLANES = MappingProxyType({"G17": (0, 1, 2), "G18": (2, 0, 1), "G19": (1, 2, 0)})


def arc(here: Here, motion: str, word: Word) -> JointArc:
    """The arc of a line under G2 or G3 (``motion``, or the first word that it takes)."""
    ask, state = here.ask, here.state
    if state.modal.tip is not Tip.OFF:
        raise ask.refusal(word, "arc.turning_axis", motion=motion, code=state.modal.tip.code)
    time = state.time(ask, motion, word)
    centre, radius = _centre(here, motion, word)
    return JointArc(
        ask.place(word),
        state.modal,
        PLANES[state.modal.plane],
        motion == "G2",
        targets(here),
        not state.absolute,
        centre,
        radius,
        _turns(ask),
        0.0 if time else state.feed(ask, motion, word),
        time,
    )


def _turns(ask: ParsedLine) -> int:
    word = ask.words.get("P")
    turns = 1 if word is None else ask.whole(word)
    if word is not None and turns == 0:
        raise ask.refusal(word, "arc.no_turns")
    if word is not None and turns > MAX_TURNS:
        raise ask.refusal(word, "arc.too_many_turns", most=MAX_TURNS)
    return turns


def _centre(here: Here, motion: str, word: Word) -> tuple[tuple[float, float] | None, float | None]:
    """Centre from the start along the two plane axes, or the radius; one of them is given."""
    ask, plane = here.ask, here.state.modal.plane
    first, second, normal = PLANES[plane]
    given, radius = ask.words, ask.words.get("R")
    harmless = (
        here.machine.dialect == "fanuc" and given.get("IJK"[normal], word).value == 0.0
    )  # of some posts
    centre = [letter for letter in "IJK" if letter in given and not (harmless and letter == "IJK"[normal])]
    allowed = "IJK"[min(first, second)] + " " + "IJK"[max(first, second)]
    if "IJK"[normal] in given and not harmless:
        extra = given["IJK"[normal]]
        raise ask.refusal(extra, "arc.off_the_plane", plane=plane, allowed=allowed)
    if (radius is None) == (not centre):
        found = Key("arc.both" if centre else "arc.neither")
        raise ask.refusal(
            word, "arc.centre_or_radius", motion=motion, found=found, plane=plane, allowed=allowed
        )
    if radius is not None:
        return None, _radius(here, radius, ("XYZ"[first], "XYZ"[second]))
    i, j = (here.length_mm("IJK"[axis]) for axis in (first, second))
    if here.state.centres_absolute:
        return _from_start(here, word, (i, j), (first, second)), None
    return (i or 0.0, j or 0.0), None


def _from_start(
    here: Here, word: Word, centre: tuple[float | None, float | None], axes: tuple[int, int]
) -> tuple[float, float]:
    """A centre that is a position (G90.1) as the way to it."""
    if None in centre:
        lacks = "IJK"[axes[centre.index(None)]]
        raise here.ask.refusal(word, "arc.half_a_centre", lacks=lacks)
    now = here.position.in_frame(here.state.modal)
    x, y = here.known(word, [now[axis] for axis in axes], Key("position.centre"))
    i, j = (value or 0.0 for value in centre)
    return i - x, j - y


def _radius(here: Here, word: Word, plane: tuple[str, str]) -> float:
    if word.value == 0.0 or not here.ask.has("".join(plane)):
        raise here.ask.refusal(word, "arc.no_radius", axes=chain("or", plane))
    return word.value * here.state.mm_per_unit


INCREMENTS = {"U": "X", "V": "Y", "W": "Z"}


def store_reference(here: Here) -> State:
    """G28.1 and G30.1: the position becomes the point, from now on."""
    code, word = here.ask.codes["one-line"]
    joints = here.known(word, here.position.joints(), code)
    points = MappingProxyType({**here.state.references, code[:3]: joints})
    return here.state._replace(references=points)


def to_reference(here: Here) -> list[Block]:
    """G28 and G30: a rapid by the words, then one of the same axes to the point; without words all."""
    code, word = here.ask.codes["one-line"]
    if (number := here.ask.words.get("P")) is not None and number.value != 2.0:
        raise here.ask.refusal(number, "reference.number")
    to, relative = _with_increments(here, targets(here))
    place, modal = here.ask.place(word), here.state.modal
    point = reference(here.state, here.machine, code)
    made: list[Block] = []
    if any(target is not None for target in to):
        point = tuple(q if target is not None else None for q, target in zip(point, to, strict=True))
        if modal.tip is Tip.OFF:
            made.append(JointLine(place, modal, to, relative, False, None, None))
        else:
            x, y, z = (to[i] for i in here.machine.linear())
            turns = here.machine.pair(to, None)
            made.append(TipLine(place, modal, (x, y, z), turns, None, relative, None, None))
    return [*made, JointLine(place, modal, point, False, True, None, None)]


def _with_increments(here: Here, to: Targets) -> tuple[Targets, bool]:
    """U V W are distances along X Y Z, whatever G90 and G91 say."""
    words = {INCREMENTS[letter]: here.ask.words[letter] for letter in INCREMENTS if letter in here.ask.words}
    relative = not here.state.absolute
    if not words:
        return to, relative
    if any(target is not None for target in to) and not relative:
        raise here.ask.refusal(next(iter(words.values())), "reference.mixed")
    unit, axes = here.state.mm_per_unit, here.machine.axes
    made: list[Coordinate] = [
        words[axis.name].value * unit if axis.name in words else target
        for axis, target in zip(axes, to, strict=True)
    ]
    return tuple(made), True


def reference(state: State, machine: Machine, code: str) -> tuple[Coordinate, ...]:
    """The joints of a point: as the program stored it, else as the machine has it."""
    return state.references[code] if code in state.references else machine.reference(code)
