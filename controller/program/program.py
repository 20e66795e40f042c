"""A program as read: blocks with their place in the text, and the error that refuses one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple

from controller.geometry.splines import BSpline
from controller.geometry.vectors import Frame, Vector
from controller.machine.changes import Change
from controller.machine.model import Joints, Machine, Tool
from controller.messages import Message, chain, message, several, text


class Caller(NamedTuple):
    """What called a sub: as written, and where."""

    written: str
    line: int
    file: str


Callers = tuple[Caller, ...]  # innermost first
MAX_CALLERS = 4  # that a sentence names


class ProgramError(Exception):
    """Why a program is refused, and where: file, 1-based line and column."""

    facts: Mapping[str, Any] = MappingProxyType({})  # beside the sentence, for JSON
    callers: Callers = ()  # of the sub that it stands in

    def __init__(self, file: str, line: int, column: int, why: Message, about: str = "") -> None:
        """``about``: the code or letter that is to blame, for counts."""
        super().__init__(file, line, column, why, about)
        self.file, self.line, self.column, self.said, self.about = file, line, column, why, about

    @property
    def sentence(self) -> str:
        """Why, in English."""
        return text(self.said)

    @property
    def placed(self) -> Message:
        """Where and why."""
        place = f"{self.file}:{self.line}:{self.column}"
        return message("program.refused", place=place, sentence=self.said)

    def __str__(self) -> str:
        return text(self.placed)

    def within(self, callers: Callers) -> ProgramError:
        """The same error inside of a sub, with who called it."""
        if not callers:
            return self
        told: list[Message | str] = [
            message("program.called", **one._asdict()) for one in callers[:MAX_CALLERS]
        ]
        if (more := len(callers) - MAX_CALLERS) > 0:
            told.append(message("program.more_calls", more=more))
        why = message("program.within", sentence=self.said, calls=chain("program.listed", told))
        found = type(self)(self.file, self.line, self.column, why, self.about)
        found.facts, found.callers = self.facts, callers
        return found

    def line_in(self, file: str) -> int | None:
        """Its line of a file: where it stands, else the one that has called what it stands in."""
        if self.file == file:
            return self.line
        return next((one.line for one in self.callers if one.file == file), None)


PROBED_IN_VAIN = ("probe.not_touched", "probe.not_free")


def refused_on_the_way(refusal: Message) -> Message:
    """What is said of a program whose block was refused when the tool had come to it (``placed``): a probing
    move is known to be in vain once it has been made."""
    why = refusal["values"].get("sentence")
    while isinstance(why, Mapping) and why["key"] == "program.within":  # subs
        why = why["values"]["sentence"]
    probed = isinstance(why, Mapping) and why["key"] in PROBED_IN_VAIN
    stands = message("stands_after_probing" if probed else "stands_before")
    return several(message("sentence", text=refusal), stands)


class GougeRefused(ProgramError):
    """Refused because the part would be cut into; gouge = "warn" allows it."""


class Place(NamedTuple):
    """Where a block's motion word stands: 1-based line and column.

    A line of a sub or loop is carried out more than once: ``order`` tells its turns apart. It rises
    from block to block, and is the line itself in a program without subs and loops. In a file that is
    called ``line`` is the program's that calls it.
    """

    line: int
    column: int
    step: int = 0
    calls: Callers = ()  # of the subs that it runs in
    file: str = ""  # that it stands in, and its line there; "" and 0: the program itself, ``line``
    file_line: int = 0

    @property
    def order(self) -> int:
        return self.step or self.line

    def refusal(self, program: str, why: Message, kind: type[ProgramError] = ProgramError) -> ProgramError:
        """Of what stands here: with the file that it stands in, and who called it."""
        file, line = self.file or program, self.file_line or self.line
        return kind(file, line, self.column, why).within(self.calls)


class Side(Enum):
    """Side of the surface on which the cutter runs, seen along the travel with C0 up."""

    RIGHT = 1.0  # Eq. 5: G42, and G40 on G51/G52
    LEFT = -1.0  # G41


class Planar(NamedTuple):
    """G41 or G42 for lines and arcs: the cutter beside the contour in the active plane."""

    place: Place  # of the code
    code: str
    off_mm: float  # so far left of the travel: the radius, negative on the right
    lines: bool  # D stands beside it, or a line came first; else what comes first decides
    joins: bool  # the first move ends beside what follows it (Fanuc), not beside its own end (RS-274/NGC)


class Tip(Enum):
    """What X Y Z of G0 and G1 mean, and how the tool axis is given."""

    OFF = 0  # positions of the machine's axes plus work offset
    ROTARIES = 1  # G43.4: the tool tip in the part frame; words of the rotary axes
    VECTORS = 2  # G43.5: the tool tip in the part frame; I J K along the tool axis

    @property
    def code(self) -> str:
        """The one that switches it on."""
        return ("G49", "G43.4", "G43.5")[self.value]


class Outputs(NamedTuple):
    """What the program has said of outputs so far: bit n is P of M62 to M65; of analogue ones E and Q."""

    on: int = 0
    off: int = 0
    levels: tuple[tuple[int, float], ...] = ()

    def switched(self, number: int, on: bool) -> Outputs:
        bit = 1 << number
        on_, off = (self.on | bit, self.off & ~bit) if on else (self.on & ~bit, self.off | bit)
        return self._replace(on=on_, off=off)

    def led(self, number: int, value: float) -> Outputs:
        return self._replace(levels=tuple(sorted({**dict(self.levels), number: value}.items())))


UNSAID = Outputs()


class Overrides(NamedTuple):
    """What M48 to M53 leave in the operator's hand."""

    feed: bool = True  # his override of feeds
    stop: bool = True  # the input feed_stop
    adaptive: bool = False  # the load of the spindle leads the feed, where his override counts


ENABLED = Overrides()


@dataclass(frozen=True, slots=True)
class Modal:
    """The modal state in which a block runs."""

    tool: int  # number of the tool in the spindle
    offset: int  # 0 = G54, as ``machine.OFFSETS`` counts
    side: Side
    length_mm: float  # tool length that G43 adds to Z of joint moves, 0 under G49
    exact: bool  # G61; False = G64
    # G64 P and Q, how far the path may be left; 0.0 where the word is missing: the machine's tolerance
    # of joints.
    blend_mm: float
    blend_deg: float
    feed_mm_s: float | None  # modal F as lengths read it
    spindle_rev_min: float  # signed; 0 = off
    coolant: int  # 0 off, 1 mist, 2 flood, 3 both
    tip: Tip = Tip.OFF
    placement: int = 0  # P of G40, G41, G42: 1 single .. 4 auto (``Strategy``); 0 as tool or machine has it
    allowance_mm: float = 0.0  # Q of the same: what stays on G51, G52 and G6.2
    # G61 was written: surfaces and lines meet exactly. At power-on they do within the machine's
    # tolerance of joints.
    exact_joints: bool = False
    tolerance_mm: float | None = None  # R of the same: of their form; None as tool or machine has it
    # The frame of the program's positions where it is not the machine's work offset as it stands:
    # set by G10, shifted by G92 or G52, turned by G68, tilted by G68.2.
    part: Frame | None = None
    turned_rad: tuple[float, float] = (0.0, 0.0)  # what the rotaries' words are shifted by, carried sense
    plane: str = "G17"  # of arcs and canned cycles
    cutter: Tool | None = None  # the tool in the spindle where G10 has changed it
    # A tilted plane: X Y Z are places of the tool tip in it, fixed to the part, with or without G43.4.
    tilted: bool = False
    outputs: Outputs = UNSAID  # of M62 to M65 and of the machine's own codes
    overrides: Overrides = ENABLED
    planar: Planar | None = None  # cutter compensation of lines and arcs
    # By that, which has been done: as ``Planar.off_mm``, of lines and arcs; 0 where it is not on.
    beside_mm: float = field(default=0.0, compare=False)

    @property
    def compensated(self) -> bool:
        """Whether the cutter is led beside the contour as written."""
        return self.beside_mm != 0.0

    def frame(self, machine: Machine) -> Frame:
        """The program's frame seen from the table frame at zero."""
        return self.part if self.part is not None else machine.offsets[self.offset]

    def tool_in(self, machine: Machine) -> Tool | None:
        """The tool in the spindle; None where the table has none of its number."""
        return self.cutter if self.cutter is not None else machine.tool(self.tool)


@dataclass(frozen=True, slots=True)
class CutCone:
    """G51: right circular cone frustum, axis +Z, absolute part-frame coordinates in mm."""

    place: Place
    modal: Modal
    start: Vector
    centre: Vector
    height_mm: float
    upper_radius_mm: float
    sweep_rad: float  # positive counter-clockwise seen from +Z
    feed_mm_s: float
    doubt: Message | None = field(default=None, compare=False)  # whether its words mean what they say


@dataclass(frozen=True, slots=True)
class CutRuled:
    """G52: two cubic Beziers, upper and lower, absolute part-frame coordinates in mm."""

    place: Place
    modal: Modal
    upper: tuple[Vector, Vector, Vector, Vector]
    lower: tuple[Vector, Vector, Vector, Vector]
    feed_mm_s: float
    doubt: Message | None = field(default=None, compare=False)  # as of a cone


@dataclass(frozen=True, slots=True)
class CutNurbs:
    """G6.2: upper and lower rational B-spline, absolute part-frame coordinates in mm."""

    place: Place
    modal: Modal
    upper: BSpline
    lower: BSpline
    feed_mm_s: float


# A target per axis of the machine: None keeps the axis where it is, otherwise a
# program value in mm or radians (carried sense) and whether it is a distance (G91)
# or a machine position (G53, no offset).
Targets = tuple[float | None, ...]


class Probed(NamedTuple):
    """What came of a probing move, joints in mm and rad."""

    touched: bool
    at: Joints  # where the axes were at the edge
    rest: Joints  # where they have come to rest


@dataclass(slots=True, eq=False)
class Probing:
    """A line that ends where the probe touches, or is free: nobody knows where, before it has run."""

    code: str
    away: bool  # it ends where the probe is free
    must: bool  # without it the program ends
    came: Probed | None = None  # told by the run; a check takes the end of the line for it


# Lines and arcs come in millions: as frozen ones each would take as long to be made as to be read.
class Thread(NamedTuple):
    """How a line is tied to the spindle: ``rev_per_mm`` of it, positive as M3 turns.

    ``begin_rev``: what the spindle has turned in the thread where the line begins; None: the line leads
    out of it, to 0.
    """

    rev_per_mm: float
    begin_rev: float | None = 0.0


@dataclass(slots=True, unsafe_hash=True)
class JointLine:
    """G0 or G1 to joint targets; both feeds None: rapid.

    ``feed_deg_s`` counts where only rotaries move, whatever words are written (RS274/NGC 2.1.2.5).
    """

    place: Place
    modal: Modal
    targets: Targets
    relative: bool
    machine_frame: bool
    feed_mm_s: float | None
    feed_deg_s: float | None
    time_s: float | None = None  # G93: what the whole block takes; both feeds are 0 then
    thread: Thread | None = None  # the spindle leads it
    probe: Probing | None = None  # G38.2 to G38.5, G31
    hole: str = ""  # "drill", "tap" or "thread": what is done at feed by a cycle, G33 or G33.1


@dataclass(slots=True, unsafe_hash=True)
class TipLine:
    """G0 or G1 under G43.4 or G43.5: the tip to a place of the part frame, the tool axis with it.

    None keeps a value where it is; ``axis`` is as written, not of unit length. Both
    feeds None: rapid. ``feed_deg_s`` counts where only the axis turns.
    """

    place: Place
    modal: Modal
    tip: tuple[float | None, float | None, float | None]  # mm
    rotaries: tuple[float | None, float | None]  # rad, carried sense; not under G43.5
    axis: Vector | None  # not under G43.4
    relative: bool  # tip and rotaries are distances (G91)
    feed_mm_s: float | None
    feed_deg_s: float | None
    time_s: float | None = None  # G93
    stands: bool = False  # a rapid on which the tip keeps its place on the part: G53.6
    probe: Probing | None = None  # as JointLine


@dataclass(slots=True, unsafe_hash=True)
class JointArc:
    """G2/G3 in the plane (a, b) with a helix along the third axis; centre by I J K or R."""

    machine_frame: ClassVar[bool] = False  # as JointLine
    thread: ClassVar[None] = None
    probe: ClassVar[None] = None
    place: Place
    modal: Modal
    plane: tuple[int, int, int]  # 0..2 for X Y Z: first, second, normal axis of the plane
    clockwise: bool
    targets: Targets
    relative: bool
    centre_mm: tuple[float, float] | None  # from the start point (G91.1), plane axes
    radius_mm: float | None  # R form; negative = the long way
    turns: int  # P: 1 is the arc itself, each more adds a whole turn
    feed_mm_s: float
    time_s: float | None = None  # as JointLine


class Control(NamedTuple):
    """A control point in the plane XY, mm: where its words lead, and how far it lies from there."""

    x: float | None  # as a target: None keeps what the start of the curve has
    y: float | None
    off: tuple[float, float] = (0.0, 0.0)
    weight: float = 1.0


@dataclass(slots=True, unsafe_hash=True)
class JointCurve:
    """G5, G5.1 and G5.2: a B-spline in X and Y with even knots, from the start to the last point."""

    machine_frame: ClassVar[bool] = False  # as JointLine
    place: Place
    modal: Modal
    order: int  # degree + 1
    controls: tuple[Control, ...]  # the first is the start
    targets: Targets  # the last
    relative: bool
    feed_mm_s: float
    time_s: float | None = None  # as JointLine


JointMotion = JointLine | JointArc | JointCurve


@dataclass(frozen=True, slots=True)
class Dwell:
    """G4 P: standstill for a time that runs on ticks."""

    place: Place
    modal: Modal
    seconds: float


class Act(Enum):
    """What the machine does between motions; comes at standstill."""

    STOP = "M0"
    OPTIONAL_STOP = "M1"
    END = "M30"
    SPINDLE = "M3/M4/M5"
    TOOL = "M6"
    COOLANT = "M7/M8/M9"
    OUTPUT = "M64/M65/M68"
    INPUT = "M66"
    PROBE = "G38/G31"  # begins, and ends
    CLAMP = "clamp"  # no word of a program: the path asks for it between motions


class Changing(NamedTuple):
    """A stop between two steps of a tool changer: what lies before it is over, what comes has not begun."""

    number: int  # counted along the program, from 0
    tool_out: int  # that goes from the spindle into its pocket; 0 = none
    tool_in: int  # that comes out of its own; 0 = none
    step: int  # of all steps of the change the one that comes; their count: the change is over
    last: bool  # the change is over

    @property
    def moves_nothing(self) -> bool:
        """M6 with the tool that is there: a stop for one whose life is over."""
        return self.tool_out == self.tool_in


# Of the inputs that forbid motion while they are off, those that do not: while a step of the tool changer
# waits, and after it. Bit masks of [io].
Lifts = tuple[int, int]


@dataclass(slots=True, unsafe_hash=True)  # as lines
class Action:
    """A machine function; ``modal`` is the state after it."""

    place: Place
    modal: Modal
    act: Act
    changing: Changing | None = None
    outputs: Outputs | None = None  # that are switched here, and are no part of the modal state
    lifts: Lifts | None = None  # from here on; None: as before


class Level(Enum):
    """What M66 waits for, by its L."""

    RISE = 1
    FALL = 2
    HIGH = 3
    LOW = 4


@dataclass(frozen=True, slots=True)
class Await:
    """M66 and M19: standstill until an input is as asked; the program is held where it is not in time."""

    place: Place
    modal: Modal
    number: int  # P; that of M19 comes behind them
    level: Level
    seconds: float  # Q, at most
    outputs: Outputs = UNSAID  # that are switched as the wait begins, and are no part of the modal state
    lifts: Lifts | None = None  # as of an action


@dataclass(frozen=True, slots=True)
class Remark:
    """Words that need no action here: nothing moves or stops; ``check`` tells why."""

    place: Place
    modal: Modal
    said: Message

    @property
    def sentence(self) -> str:
        """In English."""
        return text(self.said)


@dataclass(frozen=True, slots=True)
class OperatorMessage:
    """What the program says to the operator at its place in the run; nothing moves or stops."""

    place: Place
    modal: Modal
    text: str


@dataclass(frozen=True, slots=True)
class Setting:
    """What the program changes for good, from its place in the run on; nothing moves or stops."""

    place: Place
    modal: Modal
    changes: tuple[Change, ...]


CutBlock = CutCone | CutRuled | CutNurbs


@dataclass(frozen=True, slots=True)
class Select:
    """T: the tool of the next M6, whose pocket a changer may prepare from here on."""

    place: Place
    modal: Modal
    tool: int  # 0 = none


Aside = OperatorMessage | Setting | Select  # parts no motions
Block = CutBlock | JointMotion | TipLine | Dwell | Await | Action | Remark | Aside


def probing_of(block: Block) -> Probing | None:
    """What a line probes for."""
    return block.probe if isinstance(block, JointLine | TipLine) else None


def is_by_offset(block: Block) -> bool:
    """Whether it moves to a place of the work offset, and not of the machine."""
    if isinstance(block, JointLine):
        return not block.machine_frame
    return isinstance(block, CutCone | CutRuled | CutNurbs | JointArc | JointCurve | TipLine)


@dataclass(frozen=True, slots=True)
class Program:
    """A whole program, read and found sound as text."""

    name: str
    blocks: tuple[Block, ...]
