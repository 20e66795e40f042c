"""Fine boring and back boring, G76 and G87 of Fanuc-like controls: the spindle stands, the tool goes aside.

    G76   down at feed; stands, goes aside by Q, up at rapid, back to the middle, turns
    G87   stands, goes aside, down at rapid to R below the part, back to the middle, turns; up at feed to Z;
          stands, goes aside, up at rapid, back to the middle, turns

Q is how far the tip is led off the wall. Which way that is, with the spindle at its angle, only the machine
knows: ``shift`` of ``orient`` in [io]. I J say it in program coordinates instead, as some controls have it.
Both are done in G17, where K can still be how often.
"""

from __future__ import annotations

from types import MappingProxyType

from controller.geometry.vectors import Vector
from controller.program import output_words
from controller.program.cycle_way import Way
from controller.program.modal import Cycle
from controller.program.offset_words import Here
from controller.program.words import Word

CODES = ("G76", "G87")
_WAYS: MappingProxyType[str, Vector] = MappingProxyType(
    {"X+": (1.0, 0.0, 0.0), "X-": (-1.0, 0.0, 0.0), "Y+": (0.0, 1.0, 0.0), "Y-": (0.0, -1.0, 0.0)}
)
_STRAIGHT = 1e-9  # of a unit vector: it lies in the plane


def shift(here: Here, code: str, word: Word, before: Cycle | None) -> tuple[float, float] | None:
    """The way aside in the plane, mm; kept from the lines of the same code before. None for other cycles."""
    if code not in CODES:
        return None
    output_words.standing(here.ask, word, here.machine, code)
    if (plane := here.state.modal.plane) != "G17":
        raise here.ask.refusal(word, "boring.plane", code=code, plane=plane)
    if here.ask.has("IJ"):
        i, j = here.length_mm("I") or 0.0, here.length_mm("J") or 0.0
        return _checked(here, code, word, (i, j))
    if "Q" in here.ask.words:
        return _checked(here, code, here.ask.words["Q"], _by_q(here, code))
    if before is not None and before.code == code and before.shift is not None:
        return before.shift
    raise here.ask.refusal(word, "boring.no_shift", code=code)


def _checked(here: Here, code: str, word: Word, found: tuple[float, float]) -> tuple[float, float]:
    if found == (0.0, 0.0):
        raise here.ask.refusal(word, "boring.shift_of_nothing", code=code)
    return found


def _by_q(here: Here, code: str) -> tuple[float, float]:
    """Q along the machine's own way, in the plane of the program."""
    word, io, modal = here.ask.words["Q"], here.machine.io, here.state.modal
    far = here.length_mm("Q") or 0.0
    if far < 0.0:
        raise here.ask.refusal(word, "boring.negative")
    if io is None or io.orient is None or not io.orient.shift:
        raise here.ask.refusal(word, "boring.no_direction")
    x, y, z = modal.frame(here.machine).turn_back(_WAYS[io.orient.shift])
    if modal.tilted or abs(z) > _STRAIGHT:
        raise here.ask.refusal(word, "boring.off_the_plane", shift=io.orient.shift)
    return far * x, far * y


def check_heights(here: Here, word: Word, below: float, end: float, level: float) -> None:
    """Of G87: R is below Z, where the cut upwards ends, and Z below where the tool comes from."""
    if not below < end <= level:
        raise here.ask.refusal(word, "boring.heights", below=below, end=end, level=level)


def fine(way: Way, cycle: Cycle, clearance: float, bottom: float) -> None:
    """G76."""
    way.cut(bottom)
    way.wait(cycle.seconds)
    _aside(way, cycle, way.end)


def back(way: Way, cycle: Cycle, below: float, end: float) -> None:
    """G87."""
    _aside(way, cycle, below)
    way.cut(end)
    way.wait(cycle.seconds)
    _aside(way, cycle, way.end)


def _aside(way: Way, cycle: Cycle, height: float) -> None:
    """To another height with the tip off the wall."""
    assert cycle.shift is not None
    way.stand()
    way.aside(cycle.shift)
    way.rapid(None, None, height)
    way.aside((0.0, 0.0))
    way.turn()
