"""G51, G52 and G6.2: the paper's cone and ruled surface, word for word, and the one between two NURBS curves.

G51 and G52 mean something else on other controls (scaling, local shift), so a set of
words that is not exactly the paper's is refused with a sentence that says so. Seven lines of
X Y Z after a G52 could be moves under a modal G1 as well. So F beside it makes it a surface. Without F
the next line says what it is: bare coordinates are points where no G0 to G3 is active, or a surface came
before, which programs for other controls have none of, and are refused elsewhere; anything else makes
it a shift. Under the fanuc dialect a G52 without F always is one.

G6.2 has the words of other controls' G06.2:

    G6.2 P4 Q3 F1000.          P: order of the upper curve, Q: of the lower (degree + 1)
    K0. X0. Y0. Z10. R1.       the upper curve: a line for each control point with one
    K0. X5. Y2. Z10.           knot K, the point X Y Z and its weight R (1 if left out)
    ...
    K9.                        and the rest of its knots: as many lines of K alone as
    K9.                        its order
    ...
    K0. X0. Y0. Z0.            then the lower curve alike
    ...

So the knots of n points of order k are the n + k numbers K from top to bottom. The surface joins points of
equal share of the two knot ranges.

X Y Z are absolute. Words follow the paper: without a decimal point they count in BLU (0.01 mm,
0.001 degree), with one in the active unit; K and R of G6.2 are plain numbers.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from controller.geometry.splines import ORDERS, BadSpline, BSpline
from controller.geometry.vectors import Frame, Vector, norm, subtract
from controller.machine.model import Machine
from controller.messages import Key, Message, message
from controller.program.codes import CONE_WORDS, ParsedLine
from controller.program.line import Upcoming
from controller.program.modal import BLU_PER_MM, State, tool_list
from controller.program.origins import NONE
from controller.program.program import CutCone, CutNurbs, CutRuled, ProgramError, Remark
from controller.program.words import Line, Word

BLU_PER_DEGREE = 1000.0
MAX_SWEEP_DEG = 36_000.0  # a hundred turns; no rotary that is told in degrees goes much further
LENGTHS = "XYZIJKHR"  # of a cone
AXES = "XYZABC"  # of a shift
LEVEL_MM = 1e-9  # start and centre of a cone are on one level, a radius is not 0, beyond this


def surplus(ask: ParsedLine, motion: str, word: Word) -> ProgramError:
    """The refusal of a word that the G51 or G52 of this line does not take."""
    make = _not_a_cone if motion == "G51" else _not_a_ruled
    return make(ask.line, word, message("surface.found", found=word.text))


def _not_a_cone(line: Line, word: Word, found: Message) -> ProgramError:
    return line.refusal(word, "surface.no_cone", found=found)


def _not_a_ruled(line: Line, word: Word, found: Message) -> ProgramError:
    return line.refusal(word, "surface.not_ruled", found=found)


def is_shift(ask: ParsedLine, state: State, machine: Machine, ahead: Upcoming) -> bool:
    """Whether the G52 of a line shifts coordinates; False: it is a surface.

    Raises ProgramError where bare coordinates after it leave open what it is.
    """
    axes = [given for letter, given in ask.words.items() if letter in AXES]
    if "F" in ask.words or not axes:
        return False
    if machine.dialect == "fanuc":
        return True
    after = None if ask.code("stop") in ("M2", "M30") else ahead.look()
    if after is None or any(given.letter not in "XYZ" for given in after.words):
        return True  # neither a point nor a modal move follows
    if not state.motion:
        return False  # bare coordinates are moves only where a motion is modal
    found = " ".join(["G52", *(given.text for given in axes)])
    raise ask.refusal(
        ask.codes["motion"][1], "surface.or_shift", found=found, motion=state.motion, line=after.number
    )


def shift_remark(ask: ParsedLine, state: State) -> Remark:
    """What ``check`` reports of a G52 that shifts."""
    origins = state.origins
    key = "note.no_shift"
    if origins.local != NONE or (origins.shift != NONE and not origins.suspended):
        key = "note.shift" if origins.plane is None else "note.shift_of_plane"
    return Remark(ask.place(ask.codes["motion"][1]), state.modal, message(key))


def cone(ask: ParsedLine, state: State, machine: Machine) -> CutCone:
    """The cone of a line with G51 (mm, radians, part frame)."""
    word, given = ask.codes["motion"][1], ask.words
    if lacking := missing(given, CONE_WORDS):
        raise _not_a_cone(ask.line, word, message("surface.missing", letters=lacking))
    start, centre = point_of(given, "XYZ", state), point_of(given, "IJK", state)
    sweep = given["D"].value if given["D"].point else given["D"].value / BLU_PER_DEGREE
    _check_cone(ask, start, centre, sweep)
    height, radius = _length_mm(given["H"], state), _length_mm(given["R"], state)
    feed = feed_of(ask, "G51", word, state, machine)
    sweep_rad = math.radians(sweep)
    contact_mm = abs(sweep_rad) * math.hypot(start[0] - centre[0], start[1] - centre[1])
    doubt = doubt_of_words("G51", _counted(given, LENGTHS + "F"), contact_mm, feed)
    return CutCone(ask.place(word), state.modal, start, centre, height, radius, sweep_rad, feed, doubt)


def _check_cone(ask: ParsedLine, start: Vector, centre: Vector, sweep_deg: float) -> None:
    given = ask.words
    radius = math.hypot(start[0] - centre[0], start[1] - centre[1])
    forbidden = (
        ("H", given["H"].value <= 0.0, "surface.cone_height"),
        ("R", given["R"].value < 0.0, "surface.cone_radius"),
        ("D", given["D"].value == 0.0, "surface.cone_sweep"),
        ("K", abs(start[2] - centre[2]) > LEVEL_MM, "surface.cone_level"),
        ("I", radius <= LEVEL_MM, "surface.cone_bottom"),
        ("D", abs(sweep_deg) > MAX_SWEEP_DEG, "surface.cone_turns"),
    )
    for letter, is_so, key in forbidden:
        if is_so:
            raise ask.refusal(given[letter], key, most=MAX_SWEEP_DEG)


def ruled(ask: ParsedLine, state: State, machine: Machine, lines: Iterator[Line]) -> CutRuled:
    """The ruled surface of a line with G52; takes its other seven points from ``lines`` (mm)."""
    word, given = ask.codes["motion"][1], ask.words
    if lacking := missing(given, "XYZ"):
        raise _not_a_ruled(ask.line, word, message("surface.missing", letters=lacking))
    if "stop" in ask.codes:
        raise _not_a_ruled(ask.line, ask.codes["stop"][1], message("surface.found", found=ask.code("stop")))
    p, words = [point_of(given, "XYZ", state)], _counted(given, "XYZF")
    while len(p) < 8:
        line = next(lines, None)
        if line is None:
            raise _not_a_ruled(ask.line, word, message("surface.ends_after", count=len(p)))
        due = message("surface.point", number=len(p) + 1, line=ask.line.number)
        point = _point_words(line, due)
        p.append(point_of(point, "XYZ", state))
        words += point.values()
    feed = feed_of(ask, "G52", word, state, machine)
    upper, lower = (p[0], p[1], p[2], p[3]), (p[4], p[5], p[6], p[7])
    if is_upside_down(upper, lower, state.modal.frame(machine)):
        raise ask.refusal(word, "surface.upside_down")
    doubt = doubt_of_words("G52", words, length_mm(lower), feed)
    return CutRuled(ask.place(word), state.modal, upper, lower, feed, doubt)


def _point_words(line: Line, due: Message) -> dict[str, Word]:
    """Exactly X Y Z."""
    given: dict[str, Word] = {}
    for found in line.words:
        if found.letter not in "XYZ" or found.letter in given:
            raise _not_a_ruled(line, found, message("surface.found_for", found=found.text, due=due))
        given[found.letter] = found
    if lacking := missing(given, "XYZ"):
        raise _not_a_ruled(line, line.words[0], message("surface.missing_in", letters=lacking, due=due))
    return given


def missing(given: dict[str, Word], needed: str) -> str:
    """Letters that are needed and not given."""
    return " ".join(letter for letter in needed if letter not in given)


def _length_mm(word: Word, state: State) -> float:
    # Divided, not multiplied, so that x7 and x0.07 are the same number to the last bit.
    return word.value * state.mm_per_unit if word.point else word.value / BLU_PER_MM


def point_of(given: dict[str, Word], letters: str, state: State) -> Vector:
    x, y, z = (_length_mm(given[letter], state) for letter in letters)
    return x, y, z


def feed_of(ask: ParsedLine, code: str, word: Word, state: State, machine: Machine) -> float:
    """The feed in mm/s, once all that a surface needs of the state is there."""
    modal = state.modal
    if not state.absolute:
        raise ask.refusal(word, "surface.relative", code=code)
    if modal.tool_in(machine) is None:
        raise ask.refusal(word, "surface.no_tool", code=code, tool=modal.tool, tools=tool_list(machine))
    if machine.spindle is not None and machine.spindle.is_driven and modal.spindle_rev_min == 0.0:
        raise ask.refusal(word, "surface.spindle_off", code=code)
    return state.feed(ask, code, word)


# What makes doubtful that a G51 or G52 means what it says: told by ``check``, or refused.
#
# In these blocks a word without a decimal point counts 0.01 mm (the paper's unit), with one the active
# unit. Whoever writes X15 for 15 mm gets 0.15 mm, and a wall of 300 mm is one of 3 mm.

SMALL_MM = 5.0  # a contact that is shorter is more likely written in millimetres than meant
UPSIDE_DOWN = -0.5  # cosine of the ruling's angle to the table's normal


def _counted(given: Mapping[str, Word], letters: str) -> list[Word]:
    """The words of these letters that a line has."""
    return [given[letter] for letter in letters if letter in given]


def doubt_of_words(code: str, words: Iterable[Word], contact_mm: float, feed_mm_s: float) -> Message | None:
    """A doubt about the units of the words (``contact_mm``: of the contact), or None.

    What is written with decimal points is meant as it stands, however small; a feed with one may stand beside
    lengths without.
    """
    counted = [word for word in words if word.value != 0.0]
    lengths = [word for word in counted if word.letter != "F"]
    plain = next((word for word in lengths if not word.point), None)
    if plain is None:
        feed = next((word for word in counted if word.letter == "F" and not word.point), None)
        return message("doubt.feed", code=code, word=feed.text, feed=feed_mm_s * 60.0) if feed else None
    pointed = next((word for word in lengths if word.point), None)
    means = {"code": code, "word": plain.text, "mm": abs(plain.value) / BLU_PER_MM}
    if pointed is not None:
        return message("doubt.mixed", pointed=pointed.text, **means)
    if contact_mm >= SMALL_MM:
        return None
    return message("doubt.small", contact=contact_mm, feed=feed_mm_s * 60.0, **means)


def length_mm(points: Sequence[Vector]) -> float:
    """About the length of a curve, by its control points."""
    return float(sum(norm(subtract(b, a)) for a, b in itertools.pairwise(points)))


def is_upside_down(upper: Sequence[Vector], lower: Sequence[Vector], part: Frame) -> bool:
    """Whether the tool would point up out of the table all along: the two curves are exchanged."""
    rulings = [subtract(a, b) for a, b in zip(upper, lower, strict=True)]
    return all(part.turn(ruling)[2] < UPSIDE_DOWN * norm(ruling) for ruling in rulings)


MAX_POINTS = 5000
SEEN_AT = 32  # rulings that are looked at to see which curve is above
NUMBERED = {"P": Key("surface.upper"), "Q": Key("surface.lower")}


def nurbs_refusal(line: Line, word: Word, found: Message) -> ProgramError:
    """The refusal of anything that is not exactly one surface of G6.2."""
    return line.refusal(word, "surface.not_nurbs", found=found)


def nurbs(ask: ParsedLine, state: State, machine: Machine, lines: Iterator[Line]) -> CutNurbs:
    """The surface of a line with G6.2; takes its points and knots from ``lines`` (mm)."""
    word = ask.codes["motion"][1]
    for other in ask.line.words:
        if other is not word and other.letter not in "PQF":
            raise nurbs_refusal(ask.line, other, message("surface.found", found=other.text))
    if lacking := missing(ask.words, "PQ"):
        raise nurbs_refusal(ask.line, word, message("surface.missing", letters=lacking))
    orders = [_order(ask, ask.words[letter]) for letter in "PQ"]
    feed = feed_of(ask, "G6.2", word, state, machine)
    upper, lower = (
        _Reader(ask, name, order, state, lines).curve()
        for name, order in zip(NUMBERED.values(), orders, strict=True)
    )
    above, below = ([curve.at(k / SEEN_AT) for k in range(SEEN_AT + 1)] for curve in (upper, lower))
    if is_upside_down(above, below, state.modal.frame(machine)):
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
                raise nurbs_refusal(
                    line, given["K"], message("surface.alone_for", found=given["K"].text, due=due)
                )
            return False
        if lacking := missing(given, "XYZ"):
            raise nurbs_refusal(line, line.words[0], message("surface.missing_in", letters=lacking, due=due))
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
            raise nurbs_refusal(line, line.words[0], message("surface.missing_in", letters="K", due=due))

    def _line(self, letters: str, due: Message) -> tuple[Line, dict[str, Word]]:
        """The next line, with none but these letters and a K."""
        line = next(self.lines, None)
        of = message("surface.of_nurbs", due=due, line=self.ask.line.number)
        if line is None:
            raise nurbs_refusal(
                self.ask.line, self.ask.codes["motion"][1], message("surface.ends_for", due=due)
            )
        given: dict[str, Word] = {}
        for found in line.words:
            if found.letter not in letters or found.letter in given:
                raise nurbs_refusal(line, found, message("surface.found_for", found=found.text, due=of))
            given[found.letter] = found
        if "K" not in given:
            raise nurbs_refusal(line, line.words[0], message("surface.missing_in", letters="K", due=of))
        self.knots.append((given["K"].value, line, given["K"]))
        return line, given
