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
from controller.program.program import Block, JointArc, JointLine, Targets, Tip
from controller.program.words import Word

CODES = ("G12", "G13")
MAX_CIRCLES = 10_000  # of one line


def blocks(here: Here, code: str, word: Word) -> list[Block]:
    """The moves of a pocket. Raises ProgramError."""
    _check(here, code, word)
    radii, feed = _radii(here, code, word), here.state.feed(here.ask, code, word)
    way = _Way(here, code, word, feed)
    made: list[Block] = [*way.to_the_middle()]
    for depth in _depths(here, code, word, len(radii)):
        made += [*way.down(depth), *way.around(radii)]
    return made


def _check(here: Here, code: str, word: Word) -> None:
    state, key = here.state, ""
    if state.modal.tip is not Tip.OFF:
        key = "cycle.tip_control"
    elif state.inverse:
        key = "cycle.inverse"
    elif state.modal.plane != "G17":
        key = "pocket.plane"
    elif state.side != "G40":
        key = "cycle.beside"
    if key:
        raise here.ask.refusal(word, key, code=code, side=state.side)


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


class _Way:
    """Makes the blocks of one line."""

    def __init__(self, here: Here, code: str, word: Word, feed: float) -> None:
        self._here, self._feed = here, feed
        self._clockwise = code == "G12"
        self._place, self._modal = here.ask.place(word), here.state.modal

    def _targets(self, x: Coordinate, y: Coordinate, z: Coordinate) -> Targets:
        return to_place(self._here.machine, (x, y, z))

    def to_the_middle(self) -> list[Block]:
        """By X and Y of the line, at rapid."""
        x, y = self._here.length_mm("X"), self._here.length_mm("Y")
        if x is None and y is None:
            return []
        relative = not self._here.state.absolute
        return [JointLine(self._place, self._modal, self._targets(x, y, None), relative, False, None, None)]

    def down(self, z: Coordinate) -> list[Block]:
        if z is None:
            return []
        relative, targets = not self._here.state.absolute, self._targets(None, None, z)
        return [JointLine(self._place, self._modal, targets, relative, False, self._feed, self._feed)]

    def around(self, radii: list[float]) -> list[Block]:
        """Out, round and on, and back to the middle; the side changes with each half circle."""
        made, x = [self._half(radii[0])], radii[0]
        for following in (*radii[1:], 0.0):
            made.append(self._arc(0.0, -x, 0.0))
            end = -math.copysign(following, x)
            made.append(self._half(end - x))
            x = end
        return made

    def _half(self, dx: float) -> Block:
        return self._arc(dx, dx / 2.0, 0.0)

    def _arc(self, dx: float, i: float, j: float) -> Block:
        """An arc by distances; without any a whole circle."""
        targets = self._targets(dx, 0.0, None)
        centre, feed = (i, j), self._feed
        return JointArc(
            *(self._place, self._modal, PLANES["G17"], self._clockwise, targets, True, centre, None, 1, feed)
        )
