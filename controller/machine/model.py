"""What a machine is: axes, buses, tools and offsets as frozen values.

Inside, lengths are millimetres, angles radians, times seconds, and a rotary's
position is the right-hand angle of the body it carries ("carried" sense). The
machine file's degrees and its configured sense end in ``config.py``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import TypeVar

from controller.geometry.vectors import ZERO, Frame, Vector
from drives.profile import Override
from drives.text_file import Source

T = TypeVar("T")

MAX_QUICK_STOP_S = 3.0  # where the machine file says nothing
ARC_TOLERANCE_MM = 0.05  # between the radii at both ends of an arc, where the machine file says nothing
JOINT_TOLERANCE_MM, JOINT_TOLERANCE_DEG = 0.005, 0.2  # the same; what is written in 0.01 mm keeps both
CALL_LEVELS = 10  # subs that call each other, where a machine file says nothing: LinuxCNC's own limit
PROGRAM_PASSES = 1_000_000  # the same: rounds of loops and calls of one run of a program
MAX_CALL_LEVELS, MAX_PROGRAM_PASSES = 1000, 1_000_000_000  # that it may allow
LONGEST_PROGRAM_H = 168.0  # the same: a week ...
MAX_PROGRAM_H = 10_000.0  # ... and what it may say at most
TOOL_AT_POWER_ON = 1  # number of the one in the spindle where nobody has said otherwise
MAX_WEAR_MM = 0.5  # of a cutter, at radius and length: beyond it is another one
TOOL_CHANGE_S = 60.0  # by hand, where the machine file says nothing
# What a device is expected to take until it is measured: a share of the longest that it may take,
USUAL_SHARE = 0.5
USUAL_STEP_S = 0.3  # and a step of a tool changer no longer than this
START_STATES = ("reset", "keep")  # of the modal state, where a program begins
DIALECTS = ("rs274", "fanuc")  # of programs: RS-274/NGC as LinuxCNC reads it, or as Fanuc-like controls do
MACRO_ROLES = ("operate", "set_up")  # who may press the button of a macro
MACRO_VARIABLES = ("fanuc", "haas")
WITHOUT_POINT = ("", "unit", "thousandth")  # what lengths without a decimal point count in under fanuc

# Work offsets as programs name them, in the order of ``Machine.offsets``.
OFFSETS = (
    *("G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"),
    *(f"G54.1 P{number}" for number in range(1, 49)),
)
FIXTURES = tuple(f"G54.2 P{number}" for number in range(1, 9))  # vectors that turn with the table
KEPT_OFFSETS = OFFSETS + FIXTURES
USUAL_OFFSETS = OFFSETS[:6]  # that every machine shows, set or not
REFERENCES = ("G28", "G30")  # the reference points, as programs name them
KEPT_NUMBERS = (31, 5000)  # parameters that a machine may keep from program to program

USUAL_BUILD = "two_rotaries"  # of those in ``controller.machine.kinematics``

Joints = tuple[float, ...]  # one of each axis of the machine, in the order of its file
Pair = tuple[float, float]
STILL: Pair = (0.0, 0.0)


class Kind(Enum):
    """Where an axis stands: a linear slide, a rotary under the work, a rotary in the head."""

    LINEAR = "linear"
    TABLE = "table"
    HEAD = "head"


class Sense(Enum):
    """Sign of a table rotary outside: of the carried body, or as if the tool turned (ISO 841)."""

    CARRIED = "carried"
    ISO = "iso"


@dataclass(frozen=True, slots=True)
class Limits:
    """Largest velocity, acceleration and jerk of one joint (mm or rad per s, s^2, s^3)."""

    velocity: float
    acceleration: float
    jerk: float


@dataclass(frozen=True, slots=True)
class Homing:
    """How the drive finds its zero (CiA 402-2 object 6098h and friends)."""

    method: int = 37
    group: int = 0
    position: float = 0.0  # joint position at the homed point, mm or rad
    absolute: bool = False  # the encoder knows its position after power-on: never homed, never moved
    fast: float = 0.0  # 6099h:01, search for the switch, mm/s or rad/s; 0 = as the drive has it
    slow: float = 0.0  # 6099h:02, search for the edge or the index
    acceleration: float = 0.0  # 609Ah, mm/s^2 or rad/s^2; 0 = as the drive has it


@dataclass(frozen=True, slots=True)
class Following:
    """How far an axis may be from what it was told (mm or rad): ``rest``, and more the faster it goes."""

    rest: float
    at_speed: float  # what is added at the axis' largest velocity, and in proportion below it
    in_position: float  # where motion must have arrived: spindle, coolant and clamps wait for it
    ticks: int = 3  # feedbacks in a row beyond it are a fault
    tightens: bool = False  # ``at_speed`` is a default: what is measured narrows it


@dataclass(frozen=True, slots=True)
class Temperature:
    """Where a drive tells how warm it is; every maker has another object."""

    index: int
    sub: int
    bits: int  # 8, 16 or 32, signed
    tpdo: int  # number of the one that takes it, twice a second at most
    per_degree: float  # of the object's unit


@dataclass(frozen=True, slots=True)
class Demand:
    """Where a drive tells the setpoint that it goes by, so that lost ones are counted."""

    index: int  # 60FCh: that setpoint; 60F4h: by which its position is off it
    tpdo: int  # number of the one that takes it
    every: int  # SYNCs
    per_count: float  # of the object's unit


@dataclass(frozen=True, slots=True)
class Clamp:
    """A clamp that holds a standing axis: the names of its output (1 = open) and input (1 = closed)."""

    output: str
    input: str  # "" = nothing reports; then it counts as moved after ``open_s``
    open_s: float  # most that opening or closing may take, s

    @property
    def usual_s(self) -> float:
        """What it is expected to take, s; one that does not report counts as moved at the end of its time."""
        return USUAL_SHARE * self.open_s if self.input else self.open_s


@dataclass(frozen=True, slots=True)
class Stopping:
    """How the drive should stop by itself, and its units; 0 = as ``nodes`` and the drive have it."""

    quick_stop: float = 0.0  # deceleration, mm/s^2 or rad/s^2; 0 = the largest acceleration
    velocity_unit_counts_s: float = 0.0  # of 6099h, 60B1h ...
    acceleration_unit_counts_s2: float = 0.0  # of 6085h, 609Ah ...; 0 with the former: that, per second


@dataclass(frozen=True, slots=True)
class Pitch:
    """What an axis misses of its targets (ISO 230-2): where it is, less where it was told to be (mm, rad)."""

    at: tuple[float, ...]  # rising
    up: tuple[float, ...]  # where it came in the positive sense
    down: tuple[float, ...]  # in the negative one


@dataclass(frozen=True, slots=True)
class Straightness:
    """By how much a linear axis is off (mm) while another one stands at each of some positions."""

    along: str  # axis whose position counts
    moves: str  # the one that is off by it
    at: tuple[float, ...]  # rising, mm or rad
    off: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Axis:
    """One joint: geometry, travel, limits, and the drive that moves it."""

    name: str
    kind: Kind
    direction: Vector
    point_mm: Vector  # a point on a rotary's axis, machine frame at zero; unused for linear axes
    sense: Sense
    travel_min: float
    travel_max: float
    limits: Limits
    counts_per_unit: float  # drive counts per mm or per radian, with the drive's sign
    bus: str
    node: int
    profile: Source
    homing: Homing
    following_error: float  # largest that the drive allows itself (6065h), mm or rad
    following: Following  # largest that the controller allows it
    brake: bool
    feedback_every: int = 1  # its position comes with every so many SYNCs
    feed_forward: bool = False  # the velocity goes with the target (60B1h)
    enable_group: int = 0  # lowest first; disabled in reverse
    unsupervised: bool = False  # a drive that does not notice a dead controller is accepted
    eds: Source = ""  # its data sheet, where the profile brings none
    serial: int = 0  # of the very drive that belongs here (1018h:04); 0 = any of its kind
    clamp: Clamp | None = None
    temperature: Temperature | None = None
    demand: Demand | None = None
    setpoint_deadline_s: float = 0.0  # for which setpoints may stay away from its drive; 0 = as our heartbeat
    stopping: Stopping = Stopping()
    overrides: tuple[Override, ...] = ()  # where its data sheet is wrong
    reference: float | None = None  # mm or rad, of G28; None: where it is homed to
    second_reference: float | None = None  # of G30; None: as of G28
    pitch: Pitch | None = None

    @property
    def is_rotary(self) -> bool:
        return self.kind is not Kind.LINEAR

    @property
    def shown_per_unit(self) -> float:
        """Factor from the inner value (mm, carried radians) to the shown one (mm, degrees, sense)."""
        if not self.is_rotary:
            return 1.0
        flip = self.kind is Kind.TABLE and self.sense is Sense.ISO
        return -math.degrees(1.0) if flip else math.degrees(1.0)


@dataclass(frozen=True, slots=True)
class Bus:
    """One CAN bus: how to open it and how fast it is."""

    name: str
    interface: str  # "virtual", "socketcan" or a python-can interface name
    channel: str
    bit_rate: int


@dataclass(frozen=True, slots=True)
class Offset:
    """A work offset: of X Y Z, seen from the table frame at zero, and of the two rotaries (rad, carried)."""

    frame: Frame
    turned_rad: Pair = STILL


@dataclass(frozen=True, slots=True)
class Shift:
    """A shift of coordinates: X Y Z (mm, along the axes of the frame it stands in) and the two rotaries."""

    xyz: Vector = ZERO
    turned_rad: Pair = STILL


@dataclass(frozen=True, slots=True)
class Tool:
    """A cutter; length is from the gauge line to the tip."""

    number: int
    name: str
    radius_mm: float  # at the end: of the end face where there is no corner, of the ball of a ball end
    length_mm: float
    flute_mm: float
    corner_mm: float = 0.0  # rounding between end and flank: 0 flat end, ``radius_mm`` ball end
    taper_rad: float = 0.0  # half angle of the flank, thicker upwards
    holder: tuple[tuple[float, float, float], ...] = ()  # (from, to, radius): cylinders, mm above the tip
    placement: str = ""  # on surfaces: "single", "double", "optimal", "auto"; "" = as the machine has it
    below_mm: float = 0.0  # so far the flank reaches below C1, beside what a corner takes
    tolerance_mm: float | None = None  # of the form of surfaces cut with it; None = as the machine has it
    wear_radius_mm: float = 0.0  # added to the radius: negative where the cutter has become thinner
    wear_length_mm: float = 0.0  # added to the length: negative where it has become shorter
    # In the spindle; None: unless it is the probe. No path depends on it, nor does a journal (repr).
    may_turn: bool | None = field(default=None, repr=False)
    # Its end cuts up to the axis: it may be plunged into stock. No path depends on it either.
    centre_cutting: bool = field(default=True, repr=False)

    @property
    def flank_mm(self) -> float:
        """How far above the lower edge of a surface it cuts: its flute but for corner and ``below_mm``."""
        return self.flute_mm - self.below_mm - self.corner_mm * (1.0 - math.sin(self.taper_rad))

    @property
    def worn(self) -> Tool:
        """The tool as it is, its wear laid into radius, length and holder; a ball stays a ball."""
        if not (self.wear_radius_mm or self.wear_length_mm):
            return self
        radius, shorter = self.radius_mm + self.wear_radius_mm, self.wear_length_mm
        ball = self.corner_mm == self.radius_mm
        return replace(
            self,
            radius_mm=radius,
            corner_mm=radius if ball else min(self.corner_mm, radius),
            length_mm=self.length_mm + shorter,
            holder=tuple((max(0.0, low + shorter), high + shorter, wide) for low, high, wide in self.holder),
            wear_radius_mm=0.0,
            wear_length_mm=0.0,
        )


@dataclass(frozen=True, slots=True)
class SpindlePosition:
    """The spindle's angle, told at every SYNC with those of the axes: what tapping follows."""

    counts_per_rev: float  # its sign is the direction of M3
    index: int = 0x6064
    sub: int = 0
    tpdo: int = 2  # number of the one that takes it
    load: bool = False  # 6077h goes beside it
    gain_per_s: float = 10.0  # of the loop that leads the spindle along the thread
    acceleration_rev_s2: float = 50.0  # at most along a thread, in both directions
    most_lag_rev: float = 0.5  # behind the thread by more: held, with a fault


@dataclass(frozen=True, slots=True)
class AdaptiveFeed:
    """The load of the spindle leads the feed; loads are shares of its rated torque. See ``tick.adaptive``."""

    target: float = 0.6
    min_share: float = 0.2  # of F, as slow as the tool bears
    max_share: float = 1.0  # above 1: faster than F where the cut is light
    fall_s: float = 0.3  # time constants of the share
    rise_s: float = 3.0
    overload: float = 1.2  # a load that is not borne ...
    overload_s: float = 0.5  # ... for longer: held, with a fault


@dataclass(frozen=True, slots=True)
class Spindle:
    """The spindle as programs need it, and its drive where the controller has one (``node`` > 0)."""

    max_rev_min: float
    bus: str = ""
    node: int = 0  # 0: switched by hand; M3, M4 and S are read and nothing is sent
    profile: Source = "simulated"
    counts_per_rev: float = 0.0  # its sign is the direction of M3
    mode: int = 9  # 6060h: 9 cyclic synchronous velocity, 3 profile velocity
    at_speed_share: float = 0.05  # at speed within this share of the wanted one
    spin_up_s: float = 10.0  # longest time until it is at speed, or stands
    acceleration_rev_s2: float = 50.0  # at which it is led to its speed in mode 9
    eds: Source = ""  # its data sheet; "" = the profile's
    stopping: Stopping = Stopping()  # its units alone
    unsupervised: bool = False  # as of an axis
    overrides: tuple[Override, ...] = ()
    position: SpindlePosition | None = None  # None: nothing is tied to its angle
    adaptive: AdaptiveFeed | None = None  # None: M52 P1 is refused

    @property
    def is_driven(self) -> bool:
        return self.node > 0


@dataclass(frozen=True, slots=True)
class AnalogueOut:
    """A channel of 6411h: what Q of M67 and M68 may be, and the counts that go with its ends."""

    name: str
    channel: int  # its sub-index, from 1
    low: float  # Q in whatever unit the machine's builder thinks of
    high: float
    low_counts: int
    high_counts: int

    @property
    def idle(self) -> float:
        """Its value without a program: the one nearest to nothing."""
        return min(max(0.0, self.low), self.high)

    def counts(self, value: float) -> int:
        """What the node is told for a Q between ``low`` and ``high``."""
        share = (value - self.low) / (self.high - self.low)
        return round(self.low_counts + share * (self.high_counts - self.low_counts))


@dataclass(frozen=True, slots=True)
class Orient:
    """M19: while the output is on, the spindle's drive brings it to its angle; the input says it is there."""

    output: str
    input: str
    angle_deg: float
    within_s: float
    shift: str = ""  # X+ X- Y+ or Y-: that way leads the tip of a boring bar off the wall; "" = unknown

    @property
    def usual_s(self) -> float:
        """What it is expected to take, s."""
        return USUAL_SHARE * self.within_s


@dataclass(frozen=True, slots=True)
class Io:
    """A CiA 401 node: its bits by name. A bit is told and read as 1 = on, after ``inverted``."""

    bus: str
    node: int
    eds: Source  # its data sheet; "" = the shipped simulated one
    inputs: tuple[tuple[str, int], ...]  # (name, bit): "estop", "door" ... and those of clamps
    outputs: tuple[tuple[str, int], ...]  # "coolant", "mist", those of clamps and of programs
    inverted: tuple[str, ...] = ()  # names whose wire is 0 when they are on
    unsupervised: bool = False  # as of an axis
    overrides: tuple[Override, ...] = ()
    digital_in: tuple[str, ...] = ()  # names of inputs that programs wait for: P0, P1 ... of M66
    digital_out: tuple[str, ...] = ()  # names of outputs that they switch: P0, P1 ... of M62 to M65
    held: tuple[str, ...] = ()  # of them those that stay as they are at a program's end, a stop and a fault
    m_codes: tuple[tuple[str, str, bool], ...] = ()  # ("M10", name of a digital_out, on)
    analogue_out: tuple[AnalogueOut, ...] = ()  # E0, E1 ... of M67 and M68
    orient: Orient | None = None  # of M19
    changer_out: tuple[str, ...] = ()  # outputs of the tool changer, which no program has by number ...
    changer_in: tuple[str, ...] = ()  # ... and the inputs that it waits for

    @property
    def switched(self) -> tuple[str, ...]:
        """The outputs that a program switches, by number: those of M62 to M65, that of M19, the changer's."""
        return self.digital_out + ((self.orient.output,) if self.orient else ()) + self.changer_out

    @property
    def awaited(self) -> tuple[str, ...]:
        """The inputs that it waits for, likewise."""
        return self.digital_in + ((self.orient.input,) if self.orient else ()) + self.changer_in

    def input(self, name: str) -> int | None:
        """The bit of an input; None where the machine has none of that name."""
        return dict(self.inputs).get(name)

    def output(self, name: str) -> int | None:
        """The bit of an output; None where the machine has none of that name."""
        return dict(self.outputs).get(name)


MAX_BESIDE = 24  # outputs of a changer's preparation ...
BESIDE = 1 << MAX_BESIDE  # ... which travel as two masks in one number: on + off * BESIDE


@dataclass(frozen=True, slots=True)
class ChangerStep:
    """One step of a tool changer: its moves, then its outputs, then the input that says it is done."""

    name: str  # as the operator calls it
    within_s: float  # not done by then: held
    fails: str  # what he is told then
    # Of each axis that moves where to (mm, rad): one place, or one of each pocket.
    move: tuple[tuple[str, tuple[float, ...]], ...] = ()
    orient: bool = False  # as by M19
    on: tuple[str, ...] = ()  # outputs
    off: tuple[str, ...] = ()
    pocket: tuple[str, ...] = ()  # outputs with the pocket's number in binary, the least bit first
    input: str = ""  # "": nothing is waited for
    level: str = "rise"  # or "fall", "on", "off"
    carries: bool = False  # the tool goes from the spindle into its pocket, or the other way

    @property
    def usual_s(self) -> float:
        """What its input is expected to take, s."""
        return min(USUAL_SHARE * self.within_s, USUAL_STEP_S)

    @property
    def switches(self) -> tuple[str, ...]:
        """Names of all outputs that it tells."""
        return (*self.on, *self.off, *self.pocket)

    def outputs(self, pocket: int) -> list[tuple[str, bool]]:
        """Outputs and whether each is on: a pocket's number before what begins the motion to it."""
        number = [(name, bool(pocket >> bit & 1)) for bit, name in enumerate(self.pocket)]
        return [*number, *((name, True) for name in self.on), *((name, False) for name in self.off)]


@dataclass(frozen=True, slots=True)
class Changer:
    """What M6 does where a machine changes its tools by itself."""

    pockets: tuple[int, ...]  # of pocket 1, 2 ... the number of its tool; 0 = it is nobody's
    put_away: tuple[ChangerStep, ...]  # the tool of the spindle into its pocket
    take: tuple[ChangerStep, ...]  # a tool out of its pocket into the empty spindle
    prepare: tuple[ChangerStep, ...] = ()  # its pocket to where it is taken, while the cut goes on

    @property
    def beside(self) -> tuple[str, ...]:
        """The outputs that a preparation switches, each once."""
        return tuple(dict.fromkeys(name for step in self.prepare for name in step.switches))

    def told(self, step: ChangerStep, pocket: int) -> float:
        """A step of the preparation as the tick is asked for it; 0.0: it switches nothing."""
        bits = {name: 1 << i for i, name in enumerate(self.beside)}
        rows = step.outputs(pocket)
        on, off = (sum(bits[name] for name, is_on in rows if is_on is which) for which in (True, False))
        return float(on + off * BESIDE)

    def pocket(self, tool: int) -> int | None:
        """The pocket of a tool, from 1; None where it has none."""
        return self.pockets.index(tool) + 1 if tool and tool in self.pockets else None


@dataclass(frozen=True, slots=True)
class Sensor:
    """A touch probe in the spindle, whose ball and length are those of ``tool``, or a tool setter."""

    input: str  # of [io], on = touched
    overtravel_mm: float  # so far it gives behind a touch before it is harmed
    latency_s: float = 0.0  # from the touch to the frame of the input
    latch_tpdo: int = 0  # with which the drives tell where they were (60BAh); 0: the input's time tells it
    tool: int = 0  # of a probe: its number in the tool table
    release_mm: float = 2.0  # of a probe: so far behind a touch it is free again
    point: Vector = ZERO  # of a setter: the middle of its face, seen from the table with all rotaries at zero
    radius_mm: float = 0.0  # of a setter: of that face


@dataclass(frozen=True, slots=True)
class WorkTable:
    """The body under the work that no tool may touch: a disc, seen with all rotaries at zero."""

    centre: Vector  # of its upper face, mm
    normal: Vector  # unit vector out of that face
    radius_mm: float
    thickness_mm: float


@dataclass(frozen=True, slots=True)
class Macro:
    """Lines of program that are run as typed by hand, by a button with their name."""

    name: str
    lines: tuple[str, ...]
    role: str  # of MACRO_ROLES: the least that its button asks for


@dataclass(frozen=True, slots=True)
class Machine:
    """Everything of a machine file; ``text`` is the file itself, kept for traces and recordings."""

    name: str
    period_s: float
    clearance_mm: float
    lead_mm: float
    retract_mm: float
    rapid_share: float  # share of the axis limits that rapids use, 0 < x <= 1
    gouge: str  # "refuse" or "warn"
    max_bus_share: float
    skip_limit_per_s: float
    axes: tuple[Axis, ...]
    buses: tuple[Bus, ...]
    tools: tuple[Tool, ...]
    offsets: tuple[Frame, ...]  # as ``KEPT_OFFSETS``, or its first: frames seen from the table at zero
    spindle: Spindle | None
    text: str
    tool_lines: str = "great_circle"  # or "joints": how the axis goes between rotary words under G43.4
    tip_acceleration_mm_s2: float | None = None  # largest of the tool's tip in the part frame, on feed moves
    axis_speed_rad_s: float | None = None  # largest angular speed of the tool's axis there
    io: Io | None = None
    probe: Sensor | None = None  # in the spindle
    setter: Sensor | None = None  # of tools, on the table
    table: WorkTable | None = None  # for the check of collisions; None: nobody has told its size
    placement: str = "single"  # of the cutter on surfaces: "single" (the paper), "double", "optimal", "auto"
    max_quick_stop_s: float = MAX_QUICK_STOP_S  # a drive that takes longer to stop by itself is refused
    unset: tuple[str, ...] = ()  # of the work offsets those that nobody has set: no program may use them
    tool_change_s: float = TOOL_CHANGE_S  # what a change by hand takes, for those who plan the shop
    tolerance_mm: float | None = None  # of the form of surfaces, ends included; None: none is held
    max_overcut_mm: float | None = None  # deeper overcut than this is a gouge wherever it comes from
    longest_program_h: float = LONGEST_PROGRAM_H  # a program that takes longer is refused
    stock_s: float = 0.016  # for which the pump can go on without a tick
    late: str = "stop"  # what more late ticks than ``skip_limit_per_s`` do; "count": they are told only
    contour_error: str = "warn"  # what the tool off its path by more than its tolerance does
    # Surfaces that meet within both run through, blended, and leave themselves by the first at most.
    joint_tolerance_mm: float = JOINT_TOLERANCE_MM
    joint_tolerance_deg: float = JOINT_TOLERANCE_DEG
    lead_feed_mm_s: float | None = None  # of the tip on leads; None: as fast as the limits allow
    # From the end of a surface to the begin of the next: up to here the tool goes there without a retract.
    link_mm: float = 0.0
    arc_tolerance_mm: float = ARC_TOLERANCE_MM  # most by which an arc's ends may differ in their radius
    call_levels: int = CALL_LEVELS  # subs of a program, one in the other
    program_passes: int = PROGRAM_PASSES  # rounds of loops and calls of subs, together, in one run
    dialect: str = "rs274"  # or "fanuc": how what differs between controls is read
    start_state: str = field(default="reset", repr=False)  # a program begins as at power-on; "keep": as it is
    without_point: str = ""  # under fanuc: "unit", "thousandth", or "" where such lengths are refused
    macro_variables: str = ""  # under fanuc: "fanuc" or "haas": whose #2001 to #2800 are; "": refused
    sub_folders: tuple[str, ...] = ()  # where subs are looked for, behind the folder of the program
    own_codes: tuple[tuple[str, str], ...] = ()  # ("M200", name of a sub, or the code that it stands for)
    turned_rad: tuple[Pair, ...] = ()  # of the work offsets, in their order; one that is missing stands still
    shift: Shift = Shift()  # of G92, from one program to the next ...
    suspended: bool = False  # ... but for G92.2
    kept: tuple[tuple[int, int], ...] = ()  # numbered parameters, from to, that outlive a program ...
    parameters: tuple[tuple[int, float], ...] = ()  # ... and their values, where one has set them
    kinematics: str = USUAL_BUILD
    straightness: tuple[Straightness, ...] = ()
    changer: Changer | None = None  # None: tools are changed by hand
    in_spindle: int = TOOL_AT_POWER_ON  # of a changer: the tool with which a program begins, 0 = none
    sisters: tuple[tuple[int, int], ...] = ()  # of tools that are worn, and those that come in their place
    macros: tuple[Macro, ...] = field(default=(), repr=False)
    thermal_shift_mm: Vector = ZERO  # of X Y Z since the machine was calibrated: where the tool is too far

    def comes(self, tool: int) -> int:
        """Which tool M6 puts in for a T: its sister where it is worn and has one."""
        return dict(self.sisters).get(tool, tool)

    def offset(self, index: int) -> Offset:
        """A work offset, as ``KEPT_OFFSETS`` counts; one that nobody has set is the machine's zero."""
        frame = self.offsets[index] if index < len(self.offsets) else Frame()
        return Offset(frame, self.turned_rad[index] if index < len(self.turned_rad) else STILL)

    def reference(self, code: str) -> Joints:
        """Where G28 or G30 leads: as set, else where the axes are homed to (mm, rad)."""
        return tuple(_reference(axis, code == REFERENCES[1]) for axis in self.axes)

    def part(self, index: int = 0) -> Frame:
        """The frame in which a program begins to read positions: a work offset under the shift of G92."""
        frame = self.offset(index).frame
        if self.suspended or self.shift.xyz == ZERO:
            return frame
        return frame._replace(origin=frame.to_parent(self.shift.xyz))

    def may_turn(self, tool: int) -> bool:
        """Whether the spindle may turn with the tool of this number; a probe breaks of it."""
        found = self.tool_as_told(tool)
        if found is not None and found.may_turn is not None:
            return found.may_turn
        return self.probe is None or self.probe.tool != tool

    def sensor(self, tool: int) -> Sensor | None:
        """What a probing move with this tool in the spindle listens to: the probe itself, else the setter."""
        if self.probe is not None and self.probe.tool == tool:
            return self.probe
        return self.setter

    def sensor_mask(self, sensor: Sensor | None) -> int:
        """Bit mask of its input; 0 where there is none."""
        bit = self.io.input(sensor.input) if sensor is not None and self.io is not None else None
        return 0 if bit is None else 1 << bit

    @property
    def latch_tpdo(self) -> int:
        """Number of the TPDO of the linear axes' touch probes, 0 = they have none."""
        return max((one.latch_tpdo for one in (self.probe, self.setter) if one is not None), default=0)

    @property
    def has_peripherals(self) -> bool:
        """Whether anything but the axes is driven: what M3 to M9 ask for is then waited for."""
        return self.io is not None or (self.spindle is not None and self.spindle.is_driven)

    def turned(self) -> Pair:
        """Likewise what the words of the rotaries are shifted by (rad, carried)."""
        (a, b), (c, d) = self.offset(0).turned_rad, STILL if self.suspended else self.shift.turned_rad
        return a + c, b + d

    @property
    def every_axis(self) -> int:
        """Bit mask of all axes."""
        return (1 << len(self.axes)) - 1

    @property
    def has_pump(self) -> bool:
        """Whether the setpoints come out of a stock, and not from the tick itself."""
        return self.stock_s > 0.0

    @property
    def has_threads(self) -> bool:
        """Whether the axes can follow the spindle's angle."""
        return self.spindle is not None and self.spindle.position is not None

    def linear(self) -> tuple[int, int, int]:
        """Indices of X, Y and Z in ``axes``."""
        names = [axis.name for axis in self.axes]
        return names.index("X"), names.index("Y"), names.index("Z")

    def rotary(self) -> tuple[int, ...]:
        """Indices of the rotaries, in the file's order: two, or as many as the machine has."""
        return tuple(i for i, axis in enumerate(self.axes) if axis.is_rotary)

    def pair(self, values: Sequence[T], none: T) -> tuple[T, T]:
        """Of the values of all axes those of the two rotaries; ``none`` for one that the machine has not."""
        first, second = (*(values[i] for i in self.rotary()), none, none)[:2]
        return first, second

    def turns(self) -> tuple[Pair, Pair]:
        """The travel of the two rotaries, (least, most) in rad; of one that the machine has not its 0."""
        return self.pair([(axis.travel_min, axis.travel_max) for axis in self.axes], STILL)

    def tool(self, number: int) -> Tool | None:
        """A tool of the table as it is cut with: worn."""
        found = self.tool_as_told(number)
        return None if found is None else found.worn

    def tool_as_told(self, number: int) -> Tool | None:
        """A tool of the table with its wear beside its size."""
        return next((tool for tool in self.tools if tool.number == number), None)

    def axis_off(self, index: int, off: float = 0.0) -> str:
        """An axis by name, with how far it is from its command (mm, rad) where it is; "" for index -1."""
        if index < 0:
            return ""
        axis = self.axes[index]
        unit = "°" if axis.is_rotary else " mm"
        return f"{axis.name} ({abs(off * axis.shown_per_unit):.3g}{unit})" if off else axis.name

    def shown(self, joints: Sequence[float]) -> tuple[float, ...]:
        """Joints as programs, page and trace show them: mm and degrees in the configured sense."""
        return tuple(q * axis.shown_per_unit for q, axis in zip(joints, self.axes, strict=True))


def _reference(axis: Axis, second: bool) -> float:
    first = axis.homing.position if axis.reference is None else axis.reference
    return first if not second or axis.second_reference is None else axis.second_reference
