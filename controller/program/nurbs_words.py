"""G6.2: a ruled surface between two NURBS curves, in the words of other controls' G06.2.

    G6.2 P4 Q3 F1000.          P: order of the upper curve, Q: of the lower (degree + 1)
    K0. X0. Y0. Z10. R1.       the upper curve: a line for each control point with one
    K0. X5. Y2. Z10.           knot K, the point X Y Z and its weight R (1 if left out)
    ...
    K9.                        and the rest of its knots: as many lines of K alone as
    K9.                        its order
    ...
    K0. X0. Y0. Z0.            then the lower curve alike
    ...

So the knots of n points of order k are the n + k numbers K from top to bottom. As with
G52, X Y Z are absolute, and X Y Z and F without a decimal point count in BLU; K and R
are plain numbers. The surface joins points of equal share of the two knot ranges.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from controller.geometry.splines import ORDERS, BadSpline, BSpline
from controller.geometry.vectors import Vector
from controller.machine.model import Machine
from controller.messages import Key, Message, message
from controller.program import surface_words
from controller.program.codes import ParsedLine
from controller.program.modal import State
from controller.program.program import CutNurbs, ProgramError
from controller.program.surface_words import feed_of, missing, point_of
from controller.program.words import Line, Word

MAX_POINTS = 5000
SEEN_AT = 32  # rulings that are looked at to see which curve is above
NUMBERED = {"P": Key("surface.upper"), "Q": Key("surface.lower")}


def refusal(line: Line, word: Word, found: Message) -> ProgramError:
    """The refusal of anything that is not exactly one surface of G6.2."""
    return line.refusal(word, "surface.not_nurbs", found=found)


def surface(ask: ParsedLine, state: State, machine: Machine, lines: Iterator[Line]) -> CutNurbs:
    """The surface of a line with G6.2; takes its points and knots from ``lines`` (mm)."""
    word = ask.codes["motion"][1]
    for other in ask.line.words:
        if other is not word and other.letter not in "PQF":
            raise refusal(ask.line, other, message("surface.found", found=other.text))
    if lacking := missing(ask.words, "PQ"):
        raise refusal(ask.line, word, message("surface.missing", letters=lacking))
    orders = [_order(ask, ask.words[letter]) for letter in "PQ"]
    feed = feed_of(ask, "G6.2", word, state, machine)
    upper, lower = (
        _Reader(ask, name, order, state, lines).curve()
        for name, order in zip(NUMBERED.values(), orders, strict=True)
    )
    above, below = ([curve.at(k / SEEN_AT) for k in range(SEEN_AT + 1)] for curve in (upper, lower))
    if surface_words.is_upside_down(above, below, state.modal.frame(machine)):
        raise ask.refusal(word, "surface.nurbs_upside_down")
    return CutNurbs(ask.place(word), state.modal, upper, lower, feed)


def _order(ask: ParsedLine, word: Word) -> int:
    order = ask.whole(word)
    if order not in ORDERS:
        curve = NUMBERED[word.letter]
        raise ask.refusal(word, "surface.order", curve=curve, least=ORDERS[0], most=ORDERS[-1])
    return order


@dataclass(slots=True)
class _Reader:
    """One curve being read, with the line and word of everything it is made of."""

    ask: ParsedLine
    name: Key  # upper, lower
    order: int
    state: State
    lines: Iterator[Line]
    points: list[Vector] = field(default_factory=list)
    weights: list[tuple[float, Line, Word]] = field(default_factory=list)
    knots: list[tuple[float, Line, Word]] = field(default_factory=list)

    def curve(self) -> BSpline:
        while self._point():
            pass
        for count in range(2, self.order + 1):
            self._knot_alone(count)
        try:
            return BSpline.of(
                self.order, [k for k, _, _ in self.knots], self.points, [w for w, _, _ in self.weights]
            )
        except BadSpline as bad:
            rows = self.weights if bad.what == "weights" else self.knots
            _, line, word = rows[len(self.points) if bad.what == "points" else bad.index]
            number = self.ask.line.number
            raise line.refusal(
                word, "surface.no_spline", curve=self.name, number=number, bad=bad.said
            ) from None

    def _point(self) -> bool:
        """Take a line of a control point; False where its K stands alone, the first knot of the rest."""
        due = message("surface.control_point", number=len(self.points) + 1, curve=self.name)
        line, given = self._line("KXYZR", due)
        if given.keys() == {"K"}:
            if not self.points:
                raise refusal(line, given["K"], message("surface.alone_for", found=given["K"].text, due=due))
            return False
        if lacking := missing(given, "XYZ"):
            raise refusal(line, line.words[0], message("surface.missing_in", letters=lacking, due=due))
        if len(self.points) == MAX_POINTS:
            raise line.refusal(line.words[0], "surface.too_many", curve=self.name, most=MAX_POINTS)
        weight = given.get("R", given["K"])
        self.points.append(point_of(given, "XYZ", self.state))
        self.weights.append((weight.value if "R" in given else 1.0, line, weight))
        return True

    def _knot_alone(self, count: int) -> None:
        due = message("surface.knot", count=count, order=self.order, curve=self.name)
        line, given = self._line("K", due)
        if given.keys() != {"K"}:
            raise refusal(line, line.words[0], message("surface.missing_in", letters="K", due=due))

    def _line(self, letters: str, due: Message) -> tuple[Line, dict[str, Word]]:
        """The next line, with none but these letters and a K."""
        line = next(self.lines, None)
        of = message("surface.of_nurbs", due=due, line=self.ask.line.number)
        if line is None:
            raise refusal(self.ask.line, self.ask.codes["motion"][1], message("surface.ends_for", due=due))
        given: dict[str, Word] = {}
        for found in line.words:
            if found.letter not in letters or found.letter in given:
                raise refusal(line, found, message("surface.found_for", found=found.text, due=of))
            given[found.letter] = found
        if "K" not in given:
            raise refusal(line, line.words[0], message("surface.missing_in", letters="K", due=of))
        self.knots.append((given["K"].value, line, given["K"]))
        return line, given
