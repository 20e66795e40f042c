"""G5, G5.1 and G5.2: curves of X and Y, as LinuxCNC has them.

    G5 X Y I J P Q     cubic: I J from the start to the first control point, P Q from the end to the second;
                       right behind another G5 it may go on in its direction, without I J
    G5.1 X Y I J       quadratic: I J from the start to the control point
    G5.2 X Y P L       NURBS: the first control point behind the start with its weight P, and the order L
    X Y P              (degree + 1, 3 where it is missing); then a line for each further point
    G5.3               and its end

A P alone beside the first G5.2 is the weight of the start. Each curve names its code: what comes behind
it needs a code of its own.
"""

from __future__ import annotations

from collections.abc import Iterator

from controller.messages import Key
from controller.program import motion_words
from controller.program.modal import State
from controller.program.offset_words import Here
from controller.program.program import Control, JointCurve, ProgramError, Tip
from controller.program.words import Line, Word

ORDERS = range(3, 9)
MAX_POINTS = 5000
START = Control(None, None)


def refusal(line: Line, word: Word, motion: str) -> ProgramError:
    """The refusal of a word that a curve does not take."""
    if motion == "G5.3":
        return line.refusal(word, "curve.end_with_words", motion)
    takes = {"G5": "X Y I J P Q F", "G5.1": "X Y I J F", "G5.2": "X Y P L F"}[motion]
    key = "curve.other_axis" if word.letter in "ZABCUVW" else "curve.letter"
    return line.refusal(word, key, motion, motion=motion, takes=takes)


def curve(here: Here, motion: str, word: Word, lines: Iterator[Line]) -> tuple[JointCurve, State]:
    """The curve of a line and the state behind it; takes the points of G5.2 from ``lines``."""
    _check(here, motion, word)
    time = here.state.time(here.ask, motion, word)
    feed = 0.0 if time else here.state.feed(here.ask, motion, word)
    state = here.state._replace(curve_goes=None)
    if motion == "G5.2":
        controls, order = _nurbs(here, word, lines)
    else:
        controls = _cubic(here, word) if motion == "G5" else _quadratic(here, word)
        order = len(controls)
    if motion == "G5":
        p, q = controls[2].off
        state = state._replace(curve_goes=(-p, -q))
    place, ends = here.ask.place(word), motion_words.to_place(here.machine, controls[-1][:2])
    relative = not state.absolute
    return JointCurve(place, state.modal, order, controls, ends, relative, feed, time), state


def _check(here: Here, motion: str, word: Word) -> None:
    """Refuses a curve in a state that has none."""
    modal, side = here.state.modal, here.state.side
    here.ask.refuse_where(
        word,
        (motion == "G5.3", "curve.end_alone"),
        (modal.plane != "G17", "curve.plane"),
        (side != "G40", "curve.beside"),
        (modal.tip is not Tip.OFF, "curve.tip_control"),
        **{"motion": motion, "plane": modal.plane, "side": side},
    )


def _both(here: Here, word: Word, pair: str, what: str) -> tuple[float, float]:
    """Two words that stand together, mm."""
    a, b = (here.length_mm(letter) for letter in pair)
    if a is None or b is None:
        lacks = " ".join(x for x in pair if x not in here.ask.words)
        raise here.ask.refusal(word, "curve.half", lacks=lacks, first=pair[0], second=pair[1], what=Key(what))
    return a, b


def _end(here: Here, word: Word) -> tuple[float | None, float | None]:
    if not here.ask.has("XY"):
        raise here.ask.refusal(word, "curve.no_end")
    return here.length_mm("X"), here.length_mm("Y")


def _cubic(here: Here, word: Word) -> tuple[Control, ...]:
    end, to_end = (
        _end(here, word),
        _both(here, word, "PQ", "curve.to_end"),
    )
    goes = here.state.curve_goes if here.state.motion == "" else None
    if here.ask.has("IJ") or goes is None:
        goes = _both(
            here,
            word,
            "IJ",
            "curve.to_first",
        )
    return START, START._replace(off=goes), Control(*end, to_end), Control(*end)


def _quadratic(here: Here, word: Word) -> tuple[Control, ...]:
    end, off = _end(here, word), _both(here, word, "IJ", "curve.to_control")
    return START, START._replace(off=off), Control(*end)


def _nurbs(here: Here, word: Word, lines: Iterator[Line]) -> tuple[tuple[Control, ...], int]:
    """Control points and order of a G5.2; takes its lines up to G5.3."""
    line, start, order, points = here.ask.line, START, ORDERS[0], []
    given: dict[str, Word] | None = {letter: w for letter, w in here.ask.words.items() if letter != "F"}
    if given and "P" in given and not here.ask.has("XY"):
        start = START._replace(weight=_weight(line, given.pop("P")))
    while given is not None:
        if "L" in given:
            order = _order(line, given["L"])
        if given.keys() & set("XYP"):
            points.append(_control(line, given, here.state.mm_per_unit))
        if len(points) >= MAX_POINTS:
            raise line.refusal(line.words[0], "curve.too_many", most=MAX_POINTS)
        line, given = _next(here, word, lines)
    if len(points) + 1 < order:
        raise line.refusal(
            line.words[0], "curve.too_few", line=here.ask.line.number, count=len(points) + 1, order=order
        )
    return (start, *points), order


def _next(here: Here, begun: Word, lines: Iterator[Line]) -> tuple[Line, dict[str, Word] | None]:
    """The next line and its words; None in their place where it is G5.3."""
    line = next(lines, None)
    if line is None:
        raise here.ask.refusal(begun, "curve.unended")
    given: dict[str, Word] = {}
    ends = False
    for word in line.words:
        code = word.value if word.letter == "G" else None
        ends = ends or code == 5.3
        if (code not in (5.2, 5.3) and word.letter not in "XYPL") or word.letter in given:
            raise line.refusal(word, "curve.surplus", line=here.ask.line.number)
        given[word.letter] = word
    given.pop("G", None)
    if ends and given:
        raise refusal(line, next(iter(given.values())), "G5.3")
    return line, None if ends else given


def _control(line: Line, given: dict[str, Word], unit: float) -> Control:
    for letter in "XYP":
        if letter not in given:
            raise line.refusal(line.words[0], "curve.half_a_point", lacks=letter)
    x, y = (given[letter].value * unit for letter in "XY")
    return Control(x, y, weight=_weight(line, given["P"]))


def _weight(line: Line, word: Word) -> float:
    if word.value <= 0.0:
        raise line.refusal(word, "curve.no_weight")
    return word.value


def _order(line: Line, word: Word) -> int:
    """Of L; 2 is taken as the least, as LinuxCNC does, and ``check`` tells so."""
    if word.value == 2.0:
        return ORDERS[0]
    if word.value not in ORDERS:
        raise line.refusal(word, "curve.no_order", least=ORDERS[0], most=ORDERS[-1])
    return int(word.value)
