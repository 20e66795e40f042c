"""G68.2 to G68.4: the tilted plane that their words define; G53.1, G53.3, G53.6: the tool along its Z.

Two dialects, two meanings (the table in config/programs/README.md): Fanuc's feature coordinate system, whose
shift and R are those of the plane, and LinuxCNC's tilted work plane, a remap in progress, where R turns about
the Z outside of it, Q has more orders, and the plane counts from G53.1 on.

A plane is a frame as seen from the work offset with its shifts, that of G68.4 from the plane before it.

G53.1 moves the rotaries alone until the tool stands along Z of the plane, G53.6 keeps the tip where it is
on the part, G53.3 goes to X Y Z meanwhile.
Two positions of the rotaries, in many turns, put the tool there. P chooses: 0 the nearest; 1 and 2 under
rs274 the ones to which the primary rotary goes in its positive or negative direction, under fanuc those where
it stands from 0 to 180 or from -180 to 0 degrees. Primary is the rotary next to the base, of one on either
side the table.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from controller import messages
from controller.geometry.vectors import (
    ROUNDING,
    ZERO,
    Frame,
    Vector,
    X,
    Y,
    Z,
    angle_between,
    cross,
    dot,
    norm,
    rotate,
    scale,
    subtract,
    unit,
)
from controller.machine.kinematics import Pair
from controller.machine.model import Kind, Machine
from controller.messages import Message, chain, message
from controller.program.codes import ParsedLine
from controller.program.modal import Begun, State, tool_list
from controller.program.offset_words import Here
from controller.program.origins import within
from controller.program.program import Block, JointLine, ProgramError, Remark, TipLine
from controller.program.words import Word

AXES = (X, Y, Z)
EULER = ("121", "131", "212", "232", "313", "323")
TURNS = ("123", "132", "213", "231", "312", "321")
MIN_MM = 0.1  # of a point from the line through the others
SHORTEST = 1e-6  # of a vector
SQUARE_DEG = 5.0  # by which Fanuc's two vectors may miss a right angle ...
SQUARE_COSINE = 0.001  # ... and LinuxCNC's
TOLD_DEG = 0.01  # by which they miss it for more than the rounding of their words
MIN_DEG = 1.0  # between two projections
UPRIGHT = 1e-6  # sine of the angle to the work offset's Z below which a tool stands upright

Turn = tuple[Vector, float]  # about an axis, degrees
Triad = tuple[Vector, Vector, Vector]


@dataclass(frozen=True, slots=True)
class PlaneWords:
    """What all lines of a definition say, by Q, in mm, degrees and components of vectors."""

    rows: Mapping[int, Mapping[str, float]]
    order: str  # Q of a definition of one line, "" without one
    refusal: Callable[..., ProgramError]  # of a key and its values
    tell: Callable[..., None]  # a key and its values

    def get(self, letters: str, q: int = 0) -> Vector:
        row = self.rows.get(q, {})
        a, b, c = (row.get(letter, 0.0) for letter in letters)
        return a, b, c

    @property
    def turn(self) -> float:
        """R, degrees."""
        return self.rows.get(0, {}).get("R", 0.0)

    def order_of(self, allowed: tuple[str, ...], otherwise: str) -> list[int]:
        """The axes (0 to 2) that are turned about, one after the other."""
        order = self.order or otherwise
        if order not in allowed:
            raise self.refusal("plane.order", order=order, allowed=" ".join(allowed))
        return [int(digit) - 1 for digit in order]


@dataclass(frozen=True, slots=True)
class Form:
    """One way to define a plane: the letters of its lines by Q, and what comes of them."""

    letters: Mapping[int, str]  # a definition of one line has the row 0
    made: Callable[[PlaneWords], Frame]
    optional: tuple[int, ...] = ()  # rows that may be left out
    points: str = "XYZ"  # letters in the active unit of length in row 0; X Y Z are in each

    @property
    def rows(self) -> bool:
        """Whether it takes more lines than one."""
        return len(self.letters) > 1


def defined(here: Here) -> tuple[State, list[Block]]:
    """The state after a line of G68.2 to G68.4, and what ``check`` is to tell. Raises ProgramError."""
    code, word = here.ask.codes["rotation"]
    _check_state(here, code, word)
    if code == "G68.3":
        return _taken(here, _of_tool(here, word)), []
    p, form = _form(here, code, word)
    rows = _rows(here, code, p, form)
    if any(q not in rows and q not in form.optional for q in form.letters):
        begun = here.state.begun
        line = begun.line if begun is not None else here.ask.line.number
        return here.state._replace(begun=Begun(code, p, line, rows)), []
    told: list[Block] = []

    def tell(key: str, **values: object) -> None:
        told.append(
            Remark(here.ask.place(word), here.state.modal, messages.message(key, code=code, p=p, **values))
        )

    given = None if form.rows else here.ask.words.get("Q")
    said = PlaneWords(
        rows,
        f"{given.value:g}" if given is not None else "",
        lambda key, **values: here.ask.refusal(word, key, code=code, p=p, **values),
        tell,
    )
    frame = form.made(said)
    return _taken(here, within(here.state.origins.inside(), frame) if code == "G68.4" else frame), told


def check_whole(ask: ParsedLine, state: State) -> None:
    """Nothing stands between the lines of one definition but what has no words of its own left, as M71;
    G69 gives it up.

    Raises ProgramError.
    """
    begun = state.begun
    if begun is not None and ask.line.words and ask.code("rotation") not in (begun.code, "G69"):
        raise _not_whole(ask, begun)


def _not_whole(ask: ParsedLine, begun: Begun) -> ProgramError:
    given = " ".join(f"Q{q}" for q in sorted(begun.rows))
    return ask.refusal(
        ask.line.words[0], "plane.not_whole", code=begun.code, p=begun.p, line=begun.line, given=given
    )


def _taken(here: Here, frame: Frame) -> State:
    """Under fanuc the plane counts from here on, under rs274 from G53.1 on."""
    state, origins = here.state._replace(begun=None, cycle=None), here.state.origins
    if here.machine.dialect == "fanuc":
        return state.with_origins(origins.tilted(frame), here.machine)
    return state._replace(origins=replace(origins, waiting=frame))


def _check_state(here: Here, code: str, word: Word) -> None:
    """Whether a plane may be defined in this state."""
    origins, rs274, first = here.state.origins, here.machine.dialect == "rs274", code != "G68.4"
    here.ask.refuse_where(
        word,
        (origins.aside != (0.0, 0.0), "tool.aside"),
        (not first and origins.plane is None, "plane.none_rs274" if rs274 else "plane.none"),
        (first and origins.turn is not None, "plane.turned"),
        (rs274 and origins.waiting is not None, "plane.waiting"),
        (rs274 and first and origins.plane is not None, "plane.in_a_plane"),
        code=code,
    )


# ---- words ---------------------------------------------------------------------------


def _form(here: Here, code: str, word: Word) -> tuple[int, Form]:
    given, forms = here.ask.words.get("P"), FORMS[here.machine.dialect]
    p = 0 if given is None else here.ask.whole(given)
    if p not in forms:
        key = "plane.no_definition" if 4 in forms else "plane.no_definition_rs274"
        raise here.ask.refusal(given or word, key, code=code, p=p)
    return p, forms[p]


def _rows(here: Here, code: str, p: int, form: Form) -> Mapping[int, Mapping[str, float]]:
    """The lines of the definition by Q, this one with them."""
    ask, begun = here.ask, here.state.begun
    if begun is not None and begun.p != p:
        raise _not_whole(ask, begun)
    before = begun.rows if begun is not None else {}
    given = ask.words.get("Q") if form.rows else None
    q = 0 if given is None else ask.whole(given)
    word = given or ask.codes["rotation"][1]
    if q not in form.letters:
        known = " ".join(f"Q{one}" for one in form.letters)
        raise ask.refusal(word, "plane.no_row", code=code, p=p, q=q, known=known)
    if q in before:
        raise ask.refusal(word, "plane.row_twice", code=code, p=p, q=q)
    _check_letters(ask, code, p, form, q)
    points = form.points if q == 0 else "XYZ"
    row = {
        letter: given.value * (here.state.mm_per_unit if letter in points else 1.0)
        for letter, given in ask.words.items()
        if letter in form.letters[q] and letter != "Q"
    }
    return {**before, q: row}


def _check_letters(ask: ParsedLine, code: str, p: int, form: Form, q: int) -> None:
    """Each line of each definition has its own words."""
    letters = form.letters[q] + "P" + ("Q" if form.rows else "")
    for letter in "XYZIJKRQ":
        if letter in ask.words and letter not in letters:
            raise ask.refusal(
                ask.words[letter],
                "plane.letter",
                code=code,
                p=p,
                row=f" Q{q}" if form.rows else "",
                letters=" ".join(form.letters[q]),
            )


# ---- frames --------------------------------------------------------------------------


def _spun(turns: list[Turn], v: Vector) -> Vector:
    """Turned about fixed axes, one after the other."""
    for axis, degrees in turns:
        v = rotate(axis, math.radians(degrees), v)
    return v


def _turned(origin: Vector, turns: list[Turn]) -> Frame:
    return Frame(origin, *(_spun(turns, v) for v in AXES))


def _carried(order: list[int], angles: Vector) -> list[Turn]:
    """Turns about the axes of a frame that each of them carries along, as turns about fixed ones."""
    return [(AXES[i], angle) for i, angle in zip(order, angles, strict=True)][::-1]


def _euler(said: PlaneWords) -> Frame:
    """Fanuc P0: I about Z, J about the new X, K about the new Z."""
    return _turned(said.get("XYZ"), _carried([2, 0, 2], said.get("IJK")))


def _roll_pitch_yaw(said: PlaneWords) -> Frame:
    """Fanuc P1: I, J, K about X, Y, Z of the work offset, in the order of Q."""
    angles = said.get("IJK")
    return _turned(said.get("XYZ"), [(AXES[i], angles[i]) for i in said.order_of(TURNS, "123")])


def _in_order(allowed: tuple[str, ...], otherwise: str) -> Callable[[PlaneWords], Frame]:
    """LinuxCNC P0 and P1: I, J, K are first, second and third turn about carried axes; then R."""

    def made(said: PlaneWords) -> Frame:
        turns = _carried(said.order_of(allowed, otherwise), said.get("IJK"))
        return _turned(said.get("XYZ"), [*turns, (Z, said.turn)])

    return made


def _points(said: PlaneWords) -> Triad:
    """X from the first point to the second, Y to the side of the third."""
    first, second, third = (said.get("XYZ", q) for q in (1, 2, 3))
    along, other = subtract(second, first), subtract(third, first)
    longest = max(norm(along), norm(other), norm(subtract(third, second)))
    across = cross(along, other)
    if longest < MIN_MM or norm(along) < MIN_MM or norm(across) / longest < MIN_MM:
        raise said.refusal("plane.points_on_a_line", least=MIN_MM)
    x, z = unit(along), unit(across)
    return x, cross(z, x), z


def _by_points(said: PlaneWords) -> Frame:
    """Fanuc P2: the origin is the first point, Q0 moves it along the plane's own axes and turns by R."""
    frame = Frame(said.get("XYZ", 1), *_points(said))
    return within(frame, _turned(said.get("XYZ"), [(Z, said.turn)]))


def _by_points_apart(said: PlaneWords) -> Frame:
    """LinuxCNC P2: the points are directions alone, the origin is that of Q0; R turns about Z outside."""
    x, y, z = (_spun([(Z, said.turn)], v) for v in _points(said))
    return Frame(said.get("XYZ"), x, y, z)


def _squared(said: PlaneWords, along: Vector, normal: Vector, most_deg: float) -> Triad:
    """X and Z of two vectors; where they miss the right angle Z stays and X gives way."""
    for v, name in ((along, "X"), (normal, "Z")):
        if norm(v) < SHORTEST:
            raise said.refusal("plane.no_length", axis=name)
    off = math.degrees(angle_between(along, normal)) - 90.0
    if abs(off) > most_deg:
        raise said.refusal("plane.not_square", off=off + 90.0, low=90.0 - most_deg, high=90.0 + most_deg)
    if abs(off) > TOLD_DEG:
        said.tell("note.not_square", off=off + 90.0)
    z = unit(normal)
    x = unit(subtract(along, scale(z, dot(z, along))))
    return x, cross(z, x), z


def _by_vectors(said: PlaneWords) -> Frame:
    """Fanuc P3: Q1 the origin and X, Q2 Z."""
    return Frame(said.get("XYZ", 1), *_squared(said, said.get("IJK", 1), said.get("IJK", 2), SQUARE_DEG))


def _by_vectors_apart(said: PlaneWords) -> Frame:
    """LinuxCNC P3: Q0 the origin and a point I J K on X, Q1 Z; R turns about Z outside."""
    origin, most = said.get("XYZ"), math.degrees(math.asin(SQUARE_COSINE))
    axes = _squared(said, subtract(said.get("IJK"), origin), said.get("IJK", 1), most)
    x, y, z = (_spun([(Z, said.turn)], v) for v in axes)
    return Frame(origin, x, y, z)


def _projected(said: PlaneWords) -> Frame:
    """Fanuc P4: X turned by I about Y and Y turned by J about X lie in the plane; K turns in it."""
    i, j, k = said.get("IJK")
    x, other = _spun([(Y, i)], X), _spun([(X, j)], Y)
    apart = math.degrees(angle_between(x, other))
    if not MIN_DEG <= apart <= 180.0 - MIN_DEG:
        raise said.refusal("plane.projected", apart=round(apart, 4), low=MIN_DEG, high=180.0 - MIN_DEG)
    z = unit(cross(x, other))
    return within(Frame(said.get("XYZ"), x, cross(z, x), z), _turned(ZERO, [(Z, k)]))


def _of_tool(here: Here, word: Word) -> Frame:
    """G68.3: Z along the tool, X level (across Z of the work offset), turned by R about the tool."""
    first, second = here.known(word, here.position.rotaries, "G68.3")
    axis = here.position.chain().tool_axis((first, second))
    out = here.state.with_origins(here.state.origins.outside(), here.machine)
    frame = out.modal.frame(here.machine)
    z = frame.turn_back(axis)
    level = cross(Z, z)
    x = unit(level) if norm(level) > UPRIGHT else X
    x = unit(subtract(x, scale(z, dot(x, z))))
    r = here.ask.words.get("R")
    turned = _turned(ZERO, [(Z, 0.0 if r is None else r.value)])
    return within(Frame(_origin(here, out, word), x, cross(z, x), z), turned)


def _origin(here: Here, out: State, word: Word) -> Vector:
    """X Y Z of G68.3; under fanuc all of them or none, which is where the tip stands."""
    said = here.lengths_mm()
    missing = ["XYZ"[i] for i, value in enumerate(said) if value is None]
    if here.machine.dialect == "rs274" or not missing:
        x, y, z = (value or 0.0 for value in said)
        return x, y, z
    if len(missing) < 3:
        raise here.ask.refusal(word, "plane.origin", missing=" ".join(missing))
    x, y, z = here.known(word, here.position.in_frame(replace(out.modal, tilted=True)), "G68.3")
    return x, y, z


_THREE = {0: "XYZR", 1: "XYZ", 2: "XYZ", 3: "XYZ"}
FORMS: Mapping[str, Mapping[int, Form]] = MappingProxyType(
    {
        "fanuc": MappingProxyType(
            {
                0: Form({0: "XYZIJK"}, _euler),
                1: Form({0: "XYZIJKQ"}, _roll_pitch_yaw),
                2: Form(_THREE, _by_points, optional=(0,)),
                3: Form({1: "XYZIJK", 2: "IJK"}, _by_vectors),
                4: Form({0: "XYZIJK"}, _projected),
            }
        ),
        "rs274": MappingProxyType(
            {
                0: Form({0: "XYZIJKQR"}, _in_order(EULER, "313")),
                1: Form({0: "XYZIJKQR"}, _in_order(TURNS, "123")),
                2: Form(_THREE, _by_points_apart),
                3: Form({0: "XYZIJKR", 1: "IJK"}, _by_vectors_apart, points="XYZIJK"),
            }
        ),
    }
)


# Under an oblique rotary a plane at the end of its reach, such as a side of the part, misses it by as much as
# words of three decimals do.
ROUNDING_RAD = math.radians(0.001)
HALF = math.pi


def turned(here: Here) -> tuple[State, list[Block]]:
    """The state after a G53.1, G53.3 or G53.6, and its rapid. Raises ProgramError."""
    code, word = here.ask.codes["one-line"]
    state = _active(here, code, word)
    state = _with_length(here, state)
    modal, place = state.modal, here.ask.place(word)
    first, second = here.known(word, here.position.rotaries, code)
    pair = _chosen(here, code, word, (first, second), modal.frame(here.machine).z)
    tip = here.lengths_mm()
    if code == "G53.3" and not here.state.absolute:
        raise here.ask.refusal(word, "plane.g53_3_relative")
    if code == "G53.6" or tip != (None, None, None):
        stands = code == "G53.6"
        return state, [TipLine(place, modal, tip, pair, None, False, None, None, stands=stands)]
    targets: list[float | None] = [None] * len(here.machine.axes)
    for i, value in zip(here.machine.rotary(), pair, strict=False):
        targets[i] = value
    return state, [JointLine(place, modal, tuple(targets), False, False, None, None)]


def _active(here: Here, code: str, word: Word) -> State:
    """The state in the plane: one that waits for the tool (rs274) counts from here on."""
    origins, state = here.state.origins, here.state
    if origins.waiting is not None:
        return state._replace(cycle=None).with_origins(origins.tilted(origins.waiting), here.machine)
    if origins.plane is None:
        raise here.ask.refusal(word, "plane.none_defined", code=code)
    return state


def _with_length(here: Here, state: State) -> State:
    """H of Fanuc's G53.6: the length of that tool, as of G43."""
    word = here.ask.words.get("H")
    if word is None or here.ask.code("length"):
        return state
    tool, number = None, here.ask.whole(word)
    if number and (tool := state.named(number, here.machine)) is None:
        raise here.ask.refusal(word, "tool.unknown_here", tools=tool_list(here.machine))
    return state._replace(modal=replace(state.modal, length_mm=tool.length_mm if tool is not None else 0.0))


# ---- the choice ------------------------------------------------------------------------


def primary(machine: Machine) -> int:
    """Which of the two rotaries (0 or 1) P chooses by."""
    first, second = machine.pair([axis.kind for axis in machine.axes], Kind.LINEAR)
    return 1 if first is Kind.HEAD and second is Kind.TABLE else 0


def _chosen(here: Here, code: str, word: Word, now: Pair, axis: Vector) -> Pair:
    """The rotaries (rad) that put the tool along ``axis`` of the table frame."""
    given = here.ask.words.get("P")
    p = 0 if given is None else here.ask.whole(given)
    if p > 2:
        raise here.ask.refusal(given or word, "plane.no_solution_chosen", code=code, p=p)
    machine, kinematics = here.machine, here.position.chain()
    axis = kinematics.nearest_reached(axis, ROUNDING_RAD)
    found = kinematics.candidates(axis, None, machine.turns(), now)
    lead = primary(machine)
    allowed = [pair for pair in found if p == 0 or _is_on_side(machine, p, lead, pair, now)]
    if not allowed:
        everywhere = [q for q in kinematics.branches(axis, math, None, now) if not any(map(math.isnan, q))]
        raise _unreachable(here, code, word, everywhere, found, p, axis)
    return min(allowed, key=lambda pair: _way(pair, now, lead))


def _is_on_side(machine: Machine, p: int, lead: int, pair: Pair, now: Pair) -> bool:
    """Whether the primary rotary goes (rs274) or stands (fanuc) on the side of P1 or P2, as it is shown."""
    shown = machine.pair([axis.shown_per_unit for axis in machine.axes], 1.0)[lead]
    sign = math.copysign(1.0, shown) * (1.0 if p == 1 else -1.0)
    if machine.dialect == "rs274":
        return sign * (pair[lead] - now[lead]) >= -ROUNDING
    angle = math.remainder(sign * pair[lead], 2.0 * HALF)
    return angle >= -ROUNDING or angle <= ROUNDING - HALF


def _way(pair: Pair, now: Pair, lead: int) -> tuple[float, ...]:
    """What is made least, one after the other, as Fanuc judges: ways, then angles, of the primary first."""
    order = (lead, 1 - lead)
    ways = [abs(pair[k] - now[k]) for k in order]
    angles = [abs(math.remainder(pair[k], 2.0 * HALF)) for k in order]
    return (*(round(value, 9) for value in (*ways, *angles)), -pair[lead], -pair[1 - lead])


def _unreachable(
    here: Here, code: str, word: Word, pairs: list[Pair], within: list[Pair], p: int, axis: Vector
) -> ProgramError:
    """Why no position is left: of ``pairs`` in any turn those ``within`` the travel are not as P asks."""
    machine, listed = here.machine, within or pairs
    names = chain("and", [machine.axes[i].name for i in machine.rotary()]) if machine.rotary() else ""
    nearest = sorted(listed, key=lambda pair: _way(pair, (0.0, 0.0), 0))[:4]
    key = "plane.p_leaves_none" if within else "plane.beyond_travel" if pairs else "plane.no_axis"
    return here.ask.refusal(
        word,
        key if names else "plane.no_rotary",
        **dict(zip("ijk", (0.0 if abs(c) < 5e-7 else c for c in axis), strict=True)),
        code=code,
        p=p,
        names=names,
        shown=chain("or", [_shown(machine, pair) for pair in nearest]) if nearest else "",
        travel=chain("program.listed", _travel(machine)) if names else "",
    )


def _shown(machine: Machine, pair: Pair) -> str:
    axes = (machine.axes[i] for i in machine.rotary())
    rows = (f"{axis.name}{q * axis.shown_per_unit:.4f}" for axis, q in zip(axes, pair, strict=False))
    return " ".join(rows)


def _travel(machine: Machine) -> list[Message | str]:
    told: list[Message | str] = []
    for axis in (machine.axes[i] for i in machine.rotary()):
        low, high = sorted(q * axis.shown_per_unit for q in (axis.travel_min, axis.travel_max))
        told.append(message("plane.travel", axis=axis.name, low=low, high=high))
    return told
