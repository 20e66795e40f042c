"""G12 and G13 of Haas': a circular pocket around where the tool stands, clockwise or counter-clockwise.

    G13 I10. Z-5. D1 F300.            one circle of radius 10
    G13 I5. K20. Q3. Z-5. D1 F300.    circles of 5, 8, 11 ... and 20
    G91 G13 I10. Z-2. L3 D1 F300.     three times, each 2 deeper

(Haas' operator's manual of mills, G12 and G13.) I, K and Q are radii of the pocket: the cutter's centre goes
inside of them by the radius of tool D, or of that in the spindle (D0: they are the centre's). It goes down
at F in the middle, out by half a circle, round, on to the next radius by half a circle, and back by another.
Done in G17, without a cutter beside (G40) and without tool-centre control.
"""

from __future__ import annotations

import math

from controller.geometry.vectors import ROUNDING
from controller.program import planar_words
from controller.program.motion_words import PLANES, to_place
from controller.program.offset_words import Here
from controller.program.position import Coordinate
from controller.program.program import Block, JointArc, JointLine, Tip
from controller.program.words import Word

CODES = ("G12", "G13")
MAX_CIRCLES = 10_000  # of one line


def blocks(here: Here, code: str, word: Word) -> list[Block]:
    """The moves of a pocket. Raises ProgramError."""
    _check(here, code, word)
    radii, feed = _radii(here, code, word), here.state.feed(here.ask, code, word)
    place, modal, machine = here.ask.place(word), here.state.modal, here.machine

    def line(x: Coordinate, y: Coordinate, z: Coordinate, feed: float | None) -> Block:
        """As the line counts it; without a feed at rapid."""
        targets = to_place(machine, (x, y, z))
        return JointLine(place, modal, targets, not here.state.absolute, False, feed, feed)

    def arc(dx: float, i: float) -> Block:
        """An arc by distances; without any a whole circle."""
        plane, targets = PLANES["G17"], to_place(machine, (dx, 0.0, None))
        return JointArc(place, modal, plane, code == "G12", targets, True, (i, 0.0), None, 1, feed)

    x, y, _ = here.lengths_mm()
    made = [] if x is None and y is None else [line(x, y, None, None)]  # to the middle
    for depth in _depths(here, code, word, len(radii)):
        if depth is not None:
            made.append(line(None, None, depth, feed))
        # Out, round and on, and back to the middle; the side changes with each half circle.
        at = radii[0]
        made.append(arc(at, at / 2.0))
        for following in (*radii[1:], 0.0):
            end = -math.copysign(following, at)
            made += [arc(0.0, -at), arc(end - at, (end - at) / 2.0)]
            at = end
    return made


def _check(here: Here, code: str, word: Word) -> None:
    state = here.state
    here.ask.refuse_where(
        word,
        (state.modal.tip is not Tip.OFF, "cycle.tip_control"),
        (state.inverse, "cycle.inverse"),
        (state.modal.plane != "G17", "pocket.plane"),
        (state.side != "G40", "cycle.beside"),
        code=code,
        side=state.side,
    )


def _radii(here: Here, code: str, word: Word) -> list[float]:
    """Of the cutter's centre, from the first circle to the last, mm."""
    i, k, q = (here.length_mm(letter) for letter in "IKQ")
    if i is None or (k is None) != (q is None):
        raise here.ask.refusal(word, "pocket.radii", code=code)
    off = planar_words.radius_of(here.ask, here.ask.words.get("D"), here.state, here.machine) or 0.0
    radii = [i]
    if k is not None and q is not None:
        if q <= 0.0 or k <= i:
            raise here.ask.refusal(here.ask.words["Q" if q <= 0.0 else "K"], "pocket.steps", code=code)
        count = math.ceil((k - i) / q - ROUNDING)
        if count > MAX_CIRCLES:
            raise here.ask.refusal(here.ask.words["Q"], "pocket.too_many", code=code, most=MAX_CIRCLES)
        radii += [*(i + n * q for n in range(1, count)), k]
    if radii[0] - off <= ROUNDING:
        raise here.ask.refusal(here.ask.words["I"], "pocket.too_small", code=code, radius=radii[0], off=off)
    return [radius - off for radius in radii]


def _depths(here: Here, code: str, word: Word, circles: int) -> list[float | None]:
    """Z of each time, in the way the line counts it; None: as the tool stands."""
    given = here.ask.words.get("L")
    times = 1 if given is None else here.ask.whole(given)
    if given is not None and (times == 0 or here.state.absolute):
        raise here.ask.refusal(given, "pocket.times", code=code)
    if times * circles > MAX_CIRCLES:
        raise here.ask.refusal(given or word, "pocket.too_many", code=code, most=MAX_CIRCLES)
    return [here.length_mm("Z")] * times
