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
from controller.program import surface_doubts
from controller.program.codes import Ask
from controller.program.modal import State
from controller.program.program import CutNurbs, ProgramError
from controller.program.surface_words import feed_of, missing, point_of
from controller.program.words import Line, Word

MAX_POINTS = 5000
SEEN_AT = 32  # rulings that are looked at to see which curve is above
NUMBERED = {"P": "upper", "Q": "lower"}


def refusal(line: Line, word: Word, found: str) -> ProgramError:
    """The refusal of anything that is not exactly one surface of G6.2."""
    return line.refusal(
        word,
        f"{found}: G6.2 cuts a ruled surface between two NURBS curves; it stands alone with P and Q, the "
        "orders of the upper and the lower curve, and F unless one is modal; then, first for the upper and "
        "then for the lower curve, come a line of K X Y Z (and R) for each control point and as many lines "
        "of K alone as the order; write exactly these",
    )


def surface(ask: Ask, state: State, machine: Machine, lines: Iterator[Line]) -> CutNurbs:
    """The surface of a line with G6.2; takes its points and knots from ``lines`` (mm)."""
    word = ask.codes["motion"][1]
    for other in ask.line.words:
        if other is not word and other.letter not in "PQF":
            raise refusal(ask.line, other, f"found {other.text}")
    if lacking := missing(ask.words, "PQ"):
        raise refusal(ask.line, word, lacking)
    orders = [_order(ask, ask.words[letter]) for letter in "PQ"]
    feed = feed_of(ask, "G6.2", word, state, machine)
    upper, lower = (
        _Reader(ask, name, order, state, lines).curve()
        for name, order in zip(NUMBERED.values(), orders, strict=True)
    )
    above, below = ([curve.at(k / SEEN_AT) for k in range(SEEN_AT + 1)] for curve in (upper, lower))
    if surface_doubts.is_upside_down(above, below, state.modal.frame(machine)):
        raise ask.refusal(
            word,
            "the upper curve of this G6.2, the first one, lies below the lower one, so the tool would stand"
            " upside down; exchange the two curves",
        )
    return CutNurbs(ask.place(word), state.modal, upper, lower, feed)


def _order(ask: Ask, word: Word) -> int:
    order = ask.whole(word)
    if order not in ORDERS:
        raise ask.refusal(
            word,
            f"{word.text} is no order of the {NUMBERED[word.letter]} curve: it is the degree + 1, from "
            f"{ORDERS[0]} (straight lines) to {ORDERS[-1]}, and 4 for a cubic; correct it",
        )
    return order


@dataclass(slots=True)
class _Reader:
    """One curve being read, with the line and word of everything it is made of."""

    ask: Ask
    name: str  # upper, lower
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
            sentence = f"the {self.name} curve of the G6.2 on line {self.ask.line.number} cannot be: {bad}"
            raise line.refusal(word, f"{sentence}; correct it") from None

    def _point(self) -> bool:
        """Take a line of a control point; False where its K stands alone, the first knot of the rest."""
        due = f"control point {len(self.points) + 1} of the {self.name} curve"
        line, given = self._line("KXYZR", due)
        if given.keys() == {"K"}:
            if not self.points:
                raise refusal(line, given["K"], f"found {given['K'].text} alone where {due} is due")
            return False
        if lacking := missing(given, "XYZ"):
            raise refusal(line, line.words[0], f"{lacking} in {due}")
        if len(self.points) == MAX_POINTS:
            sentence = f"the {self.name} curve has more than {MAX_POINTS} points"
            raise line.refusal(line.words[0], f"{sentence}: one G6.2 takes no more; split the surface")
        weight = given.get("R", given["K"])
        self.points.append(point_of(given, "XYZ", self.state))
        self.weights.append((weight.value if "R" in given else 1.0, line, weight))
        return True

    def _knot_alone(self, count: int) -> None:
        due = f"knot {count} of the {self.order} that follow the points of the {self.name} curve"
        line, given = self._line("K", due)
        if given.keys() != {"K"}:
            raise refusal(line, line.words[0], f"K missing in {due}")

    def _line(self, letters: str, due: str) -> tuple[Line, dict[str, Word]]:
        """The next line, with none but these letters and a K."""
        line = next(self.lines, None)
        of = f"of the G6.2 on line {self.ask.line.number}"
        if line is None:
            raise refusal(self.ask.line, self.ask.codes["motion"][1], f"the program ends where {due} is due")
        given: dict[str, Word] = {}
        for found in line.words:
            if found.letter not in letters or found.letter in given:
                raise refusal(line, found, f"found {found.text} where {due} {of} is due")
            given[found.letter] = found
        if "K" not in given:
            raise refusal(line, line.words[0], f"K missing in {due} {of}")
        self.knots.append((given["K"].value, line, given["K"]))
        return line, given
