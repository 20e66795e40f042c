"""G2 and G3: what their words say of an arc."""

from __future__ import annotations

from types import MappingProxyType

from controller.messages import Key, chain
from controller.program.codes import ParsedLine
from controller.program.line_words import targets
from controller.program.offset_words import Here
from controller.program.program import JointArc, Tip
from controller.program.words import Word

MAX_TURNS = 1000  # of one arc

# Plane axes so that first x second = normal: counter-clockwise is the right hand about the normal.
PLANES = MappingProxyType({"G17": (0, 1, 2), "G18": (2, 0, 1), "G19": (1, 2, 0)})


def arc(here: Here, motion: str, word: Word) -> JointArc:
    """The arc of a line under G2 or G3 (``motion``, or the first word that it takes)."""
    ask, state = here.ask, here.state
    if state.modal.tip is not Tip.OFF:
        code = "G43.4" if state.modal.tip is Tip.ROTARIES else "G43.5"
        raise ask.refusal(word, "arc.turning_axis", motion=motion, code=code)
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
