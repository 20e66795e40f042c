"""G51.1 and G50.1 of Fanuc's: positions mirrored at a place of each axis (B-64484EN, programmable mirror).

A word X under G51.1 X10. means 20 - X. It stands inside of G68, so the coordinates are mirrored, then turned,
then shifted; arcs go round the other way and G41 is G42, seen from the machine. G50.1 with words ends it for
these axes, without any for all. Tool-centre control, tilted planes and surfaces have no mirrored meaning.
"""

from __future__ import annotations

from dataclasses import replace

from controller.program.codes import SURFACES
from controller.program.modal import State
from controller.program.offset_words import Here
from controller.program.origins import Mirror
from controller.program.program import ProgramError, Tip


def switched(here: Here) -> State:
    """The state after G51.1 or G50.1. Raises ProgramError."""
    code, word = here.ask.codes["mirror"]
    said, mirror = here.lengths_mm(), here.state.origins.mirror or (None, None, None)
    if code == "G51.1":
        if all(value is None for value in said):
            raise here.ask.refusal(word, "mirror.nowhere")
        made = [old if value is None else value for old, value in zip(mirror, said, strict=True)]
    else:
        ends = all(value is None for value in said)
        made = [None if ends or value is not None else old for old, value in zip(mirror, said, strict=True)]
    found: Mirror | None = (made[0], made[1], made[2])
    if made == [None, None, None]:
        found = None
    return here.state.with_origins(replace(here.state.origins, mirror=found), here.machine)


def check(here: Here, motion: str) -> None:
    """Refuses what has no mirrored meaning. Raises ProgramError."""
    state, once = here.state, here.ask.code("one-line")
    other = ""
    if state.modal.tip is not Tip.OFF:
        other = "G43.4" if state.modal.tip is Tip.ROTARIES else "G43.5"
    elif state.modal.tilted or state.origins.waiting is not None:
        other = "G68.2"
    elif motion in SURFACES:
        other = motion
    elif once == "G92" or here.ask.code("motion") == "G52":
        other = once or "G52"
    elif once == "G10":
        other = "G10 L20" if here.ask.words["L"].value in (20.0, 120.0) and not _is_plain(here) else ""
    if other:
        raise _beside(here, other)


def _is_plain(here: Here) -> bool:
    """Whether L20 sets an offset by its values (Fanuc's G54.1), and not by where the tool stands."""
    return here.machine.dialect == "fanuc" and here.ask.words["L"].value == 20.0


def _beside(here: Here, other: str) -> ProgramError:
    named = (word for code, word in here.ask.codes.values() if code in (other, "G51.1"))
    return here.ask.refusal(next(named, here.ask.line.words[0]), "mirror.beside", other=other)
