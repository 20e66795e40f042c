"""What a machine is: axes, buses, tools and offsets as frozen values, with the keys of their tables.

Inside, lengths are millimetres, angles radians, times seconds, and a rotary's position is the right-hand
angle of the body it carries ("carried" sense). A field that a key of the machine file fills is declared by
``key``; what a key may be and means is nowhere else.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar, TypeVar

from controller.geometry.vectors import ZERO, Frame, Vector
from controller.machine.axes import Axis as Axis
from controller.machine.axes import Clamp as Clamp
from controller.machine.axes import Demand as Demand
from controller.machine.axes import Following as Following
from controller.machine.axes import Homing as Homing
from controller.machine.axes import Kind as Kind
from controller.machine.axes import Limits as Limits
from controller.machine.axes import LoadEncoder as LoadEncoder
from controller.machine.axes import Sense as Sense
from controller.machine.axes import Stopping as Stopping
from controller.machine.axes import Temperature as Temperature
from controller.machine.changer_table import BESIDE as BESIDE
from controller.machine.changer_table import Changer as Changer
from controller.machine.changer_table import ChangerStep as ChangerStep
from controller.machine.declaration import Key, declared, key
from controller.machine.deviation_tables import Pitch as Pitch
from controller.machine.deviation_tables import Straightness as Straightness
from controller.machine.equipment import AnalogueOut as AnalogueOut
from controller.machine.equipment import Io as Io
from controller.machine.equipment import Orient as Orient
from controller.machine.equipment import Sensor as Sensor
from controller.machine.equipment import WorkTable as WorkTable
from controller.machine.forms import FLAG, POSITIVE, TEXT, Choice, Integer, Number, Own, Rows
from controller.machine.macro_table import Macro as Macro
from controller.machine.offset_table import FIXTURES as FIXTURES
from controller.machine.offset_table import KEPT, KEPT_BY_DIALECT
from controller.machine.offset_table import KEPT_OFFSETS as KEPT_OFFSETS
from controller.machine.offset_table import OFFSETS as OFFSETS
from controller.machine.offset_table import STILL as STILL
from controller.machine.offset_table import Offset as Offset
from controller.machine.offset_table import Pair as Pair
from controller.machine.program_table import NAMED, OWN, OWN_CODES, SUB_FOLDERS
from controller.machine.reading import Reading, Rules
from controller.machine.records_table import Records
from controller.machine.spindle import AdaptiveFeed as AdaptiveFeed
from controller.machine.spindle import Spindle as Spindle
from controller.machine.spindle import SpindlePosition as SpindlePosition
from controller.machine.toml_table import span
from controller.messages import message

T = TypeVar("T")

CALL_LEVELS = 10  # subs that call each other, where a machine file says nothing: LinuxCNC's own limit
PROGRAM_PASSES = 1_000_000  # the same: rounds of loops and calls of one run of a program
JOINT_TOLERANCE_DEG = 0.2  # of surfaces at a joint, the same
MAX_PROGRAM_H = 10_000.0  # that a machine file may allow
TOOL_AT_POWER_ON = 1  # number of the one in the spindle where nobody has said otherwise
MAX_WEAR_MM = 0.5  # of a cutter, at radius and length: beyond it is another one
SET = "set"  # what the table of a tool that was set at the machine is called ...
SHORTEST_SET_MM = -10_000.0  # ... for G10 sets lengths below 0, too, as against a longer one
PERIODS_S = (0.0005, 0.01)
PLACEMENTS = ("single", "double", "optimal", "auto")  # of the cutter on surfaces
MACRO_VARIABLES = ("fanuc", "haas")
BIT_RATES = (10_000, 20_000, 50_000, 125_000, 250_000, 500_000, 800_000, 1_000_000)  # CiA 301, table 1
USUAL_OFFSETS = OFFSETS[:6]  # that every machine shows, set or not
REFERENCES = ("G28", "G30")  # the reference points, as programs name them
USUAL_BUILD = "two_rotaries"  # of those in ``controller.machine.kinematics``

Joints = tuple[float, ...]  # one of each axis of the machine, in the order of its file


@dataclass(frozen=True, slots=True)
class Bus:
    """One CAN bus: how to open it and how fast it is."""

    name: str = key(TEXT, "by which axes and devices name it")
    interface: str = key(TEXT, "`virtual`, `socketcan`, or another of python-can's", silent="virtual")
    channel: str = key(TEXT, "of the interface, as `can0`", silent="")
    bit_rate: int = key(
        Integer(0, BIT_RATES[-1]), "bit/s; 0 on a virtual bus: frames take no time", silent=BIT_RATES[-1]
    )


def _check_rate(here: Reading) -> None:
    is_free = here["interface"] == "virtual" and here["bit_rate"] == 0
    if here["bit_rate"] not in BIT_RATES and not is_free:
        rates = message("file.may.bit_rate", rates=", ".join(map(str, BIT_RATES)))
        here.table.refuse("bit_rate", "no_bit_rate", allowed=rates)


def _check_channel(here: Reading) -> None:
    if here["interface"] != "virtual" and not here["channel"]:
        here.table.refuse("channel", "no_channel")


@dataclass(frozen=True, slots=True)
class Shift:
    """A shift of coordinates: X Y Z (mm, along the axes of the frame it stands in) and the two rotaries."""

    xyz: Vector = ZERO
    turned_rad: Pair = STILL


Cylinders = tuple[tuple[float, float, float], ...]  # (from, to, radius), mm above the tip


@dataclass(frozen=True, slots=True, kw_only=True)
class HolderRow:
    """A cylinder of a holder as it is written."""

    from_mm: float | None = key(
        Number(0.0), "above the tip", default=None, left_out="0, or where the one before ends"
    )
    length_mm: float = key(POSITIVE, "of the cylinder")
    radius_mm: float = key(POSITIVE, "of the cylinder")


class Holder(Rows):
    """The cylinders of a holder, from the tip's end upwards."""

    def read(self, here: Reading, name: str) -> Cylinders:
        found: list[tuple[float, float, float]] = []
        for row in super().read(here, name):
            start = (found[-1][1] if found else 0.0) if row.from_mm is None else row.from_mm
            found.append((start, start + row.length_mm, row.radius_mm))
        return tuple(found)


def _most_wear(here: Reading) -> float:
    """Of the radius: one that has lost half of it is another tool."""
    return float(min(MAX_WEAR_MM, 0.5 * here["radius_mm"]))


@dataclass(frozen=True, slots=True)
class Tool:
    """A cutter; length is from the gauge line to the tip.

    Of a tool that the machine has already, what is set leaves the shape as it was (``Reading.before``).
    """

    number: int = key(Integer(1, 99999), "T of programs; T1 is in the spindle at power-on")
    name: str = key(TEXT, "as the operator calls it")
    # At the end: of the end face where there is no corner, of the ball of a ball end.
    radius_mm: float = key(POSITIVE, "at the end; of a ball end that of the ball", usual=(0.02, 200.0))
    length_mm: float = key(
        Number(lambda here: SHORTEST_SET_MM if here.called == SET else 0.0),
        "from the gauge line to the tip",
        may_be=message("file.may.number", span=span(0, math.inf)),
        usual=(0.0, 1000.0),
    )
    flute_mm: float = key(
        POSITIVE, "length that cuts, from the tip; what is above cuts nothing", usual=(0.02, 500.0)
    )
    corner_mm: float = key(
        Number(0.0, lambda here: here["radius_mm"]),
        "rounding between end and flank: 0 flat end, `radius_mm` ball end",
        default=0.0,
        silent=lambda here: min(here.before.corner_mm, here["radius_mm"]) if here.before else 0.0,
        may_be="up to `radius_mm`",
        left_out="`0`",
    )
    taper_rad: float = key(
        Number(0.0, 45.0),
        "half angle of the flank, thicker upwards",
        name="taper_deg",
        scale=math.radians(1.0),
        default=0.0,
    )
    end_mm: float | None = key(
        Number(lambda here: here["radius_mm"]),
        "radius of the end of a lens cutter, about a point of its axis",
        default=None,
        may_be="from `radius_mm`",
        left_out="as `point_deg` has it",
    )
    point_rad: float = key(
        Number(10.0, 180.0),
        "angle of the point, as of a drill; 180: a flat end",
        name="point_deg",
        scale=math.radians(1.0),
        default=math.pi,
    )
    barrel_mm: float | None = key(
        Number(lambda here: 2.0 * here["flute_mm"]),
        "radius of a flank that bows outward, its middle leaning by `taper_deg`",
        default=None,
        may_be="from twice `flute_mm`",
        left_out="straight",
    )
    back_mm: float = key(
        Number(0.0, lambda here: here["radius_mm"]),
        "rounding above the flank, of a T-slot cutter; with `corner_mm` = `radius_mm`: a lollipop",
        default=0.0,
        may_be="up to `radius_mm`",
        left_out="`0`",
    )
    holder: Cylinders = key(
        Holder(HolderRow),
        "cylinders above the tip, a neck or a thick shank first; below them it is as the flute",
        default=(),
    )
    placement: str = key(Choice(("", *PLACEMENTS)), "on surfaces; empty: as the machine has it", default="")
    below_mm: float = key(
        Number(0.0, 1000.0),
        "so far the flank reaches below the lower edge, beside what a corner takes",
        default=0.0,
    )
    tolerance_mm: float | None = key(
        POSITIVE, "of the form of surfaces cut with it; left out: as the machine has it", default=None
    )
    wear_radius_mm: float = key(
        Number(lambda here: -_most_wear(here), MAX_WEAR_MM),
        "added to the radius; negative where the cutter has become thinner",
        default=0.0,
        silent=lambda here: max(here.before.wear_radius_mm, -_most_wear(here)) if here.before else 0.0,
        may_be=f"up to {MAX_WEAR_MM:g} mm, and to half of the radius",
        left_out="`0`",
    )
    wear_length_mm: float = key(
        Number(-MAX_WEAR_MM, MAX_WEAR_MM),
        "added to the length; negative where it has become shorter",
        default=0.0,
    )
    # In the spindle; None: unless it is the probe. No path depends on it, nor does a journal (repr).
    may_turn: bool | None = key(
        FLAG,
        "whether the spindle may turn with it; the probe of `[probe]` breaks of it",
        default=None,
        shown=False,
        left_out="true, but false of a probe",
    )
    max_rev_min: float | None = key(
        POSITIVE,
        "largest S with it in the spindle, whatever the override",
        default=None,
        shown=False,
        left_out="as the spindle",
        usual=(50.0, 300_000.0),
    )
    # Its end cuts up to the axis: it may be plunged into stock. No path depends on it either.
    centre_cutting: bool = key(
        FLAG,
        "its end cuts up to the axis; false: a plunge along stock of a surface is refused",
        default=True,
        shown=False,
    )

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


def _check_form(here: Reading) -> None:
    """End, barrel and back are of cutters of different kinds, of which only the barrel leans."""
    forms = [name for name, usual in _FORMS.items() if here[name] not in (None, usual)]
    if here["taper_rad"] and forms not in ([], ["barrel_mm"]):
        forms.append("taper_rad")
    if len(forms) > 1:
        first, second = (one.replace("rad", "deg") for one in forms[:2])
        here.table.refuse(second, "two_forms", other=first)


_FORMS = {"end_mm": None, "point_rad": math.pi, "barrel_mm": None, "back_mm": 0.0}


def _sync(here: Reading, name: str) -> str:
    """Nobody chooses it."""
    if here.table.get(name, "") != "tick":
        here.table.refuse(name, "sync_chosen")
    return "tick"


@dataclass(frozen=True, slots=True, kw_only=True)
class Machine:
    """Everything of a machine file; ``text`` is the file itself, kept for traces and recordings.

    The keys are those of ``[machine]``; other tables fill the fields without one.
    """

    name: str = key(TEXT, "as page and records call it")
    period_s: float = key(Number(*PERIODS_S), "one tick: a setpoint of every axis", silent=0.002)
    sync: ClassVar[Key] = declared(  # files from before the pump have it
        Own(_sync, '"tick"', {"const": "tick"}),
        "nothing is left to choose: `directrix-pump` sends SYNC, without a stock the tick",
        silent="tick",
    )
    clearance_mm: float = key(
        POSITIVE, "above a block's highest point, where the tool goes down with feed", usual=(0.05, 200.0)
    )
    lead_mm: float = key(POSITIVE, "so far off a surface its leads begin and end", usual=(0.01, 100.0))
    retract_mm: float = key(Number(), "machine position of Z at which the rotaries may turn freely")
    rapid_share: float = key(Number(0.01, 1.0), "of the axes' limits that rapids use", silent=1.0)
    gouge: str = key(
        Choice(("refuse", "warn")),
        "what overcut, and a form tolerance that is exceeded, do to a program",
        silent="refuse",
    )
    max_bus_share: float = key(
        Number(0.01, 1.0), "of a tick that the frames of a bus may take at their worst", silent=0.8
    )
    skip_limit_per_s: float = key(Number(0.0), "late ticks within a second of running", silent=25.0)
    axes: tuple[Axis, ...]
    buses: tuple[Bus, ...]
    tools: tuple[Tool, ...]
    offsets: tuple[Frame, ...]  # as ``KEPT_OFFSETS``, or its first: frames seen from the table at zero
    spindle: Spindle | None
    text: str
    tool_lines: str = key(
        Choice(("great_circle", "joints")),
        "how the tool's axis goes between rotary words under G43.4",
        default="great_circle",
    )
    tip_acceleration_mm_s2: float | None = key(
        POSITIVE,
        "largest of the tool's tip in the part, on feed moves",
        default=None,
        usual=(10.0, 100_000.0),
    )
    axis_speed_rad_s: float | None = key(
        POSITIVE,
        "largest angular speed of the tool's axis in the part",
        name="axis_speed_deg_s",
        scale=math.radians(1.0),
        default=None,
        usual=(0.5, 20_000.0),
    )
    io: Io | None = None
    probe: Sensor | None = None  # in the spindle
    setter: Sensor | None = None  # of tools, on the table
    table: WorkTable | None = None  # for the check of collisions; None: nobody has told its size
    placement: str = key(Choice(PLACEMENTS), "of the cutter on surfaces", default="single")
    max_quick_stop_s: float = key(
        Number(0.01, 60.0), "a drive that takes longer to stop by itself is refused", default=3.0
    )
    unset: tuple[str, ...] = ()  # of the work offsets those that nobody has set: no program may use them
    tool_change_s: float = 60.0  # what a change by hand takes, for those who plan the shop
    tolerance_mm: float | None = key(
        POSITIVE,
        "of the form of surfaces, ends included; left out: none is held",
        default=None,
        usual=(0.0005, 2.0),
    )
    max_overcut_mm: float | None = key(
        POSITIVE, "what is deeper is a gouge wherever it comes from", default=None
    )
    longest_program_h: float = key(
        Number(0.01, MAX_PROGRAM_H),
        "a program that takes longer at its feeds and with its dwells is refused",
        default=168.0,
    )
    stock_s: float = key(
        Number(0.0, 500.0),
        "for which the drives get their setpoints on time though a tick is late; 0: no stock",
        name="stock_ms",
        per=1000.0,
        default=0.016,
    )
    late: str = key(
        Choice(("stop", "count")), "what more late ticks than `skip_limit_per_s` do", default="stop"
    )
    contour_error: str = key(
        Choice(("warn", "slow", "hold")),
        "what is done where drives lead the tool off its path by more than `tolerance_mm`",
        default="warn",
    )
    # Surfaces that meet within both run through, blended, and leave themselves by the first at most.
    joint_tolerance_mm: float = key(  # what is written in 0.01 mm keeps both
        Number(0.0, 1.0), "gap between two surfaces that is rounding; 0: no blends", default=0.005
    )
    joint_tolerance_deg: float = key(
        Number(0.0, 5.0), "the same for their normals at the contact", default=JOINT_TOLERANCE_DEG
    )
    lead_feed_mm_s: float | None = key(
        POSITIVE,
        "of the tip on leads, mm/min; left out: as fast as the limits allow",
        name="lead_feed",
        scale=1.0 / 60.0,
        default=None,
    )
    link_mm: float = key(
        Number(0.0, 100.0),
        "from surface to surface without a retract, where the way is no longer",
        default=0.0,
    )
    arc_tolerance_mm: float = key(
        Number(0.001, 3.0), "most by which the ends of an arc may differ in their radius", default=0.05
    )
    call_levels: int = key(
        Integer(1, 1000), "subs of a program that may call each other", default=CALL_LEVELS
    )
    program_passes: int = key(
        Integer(1, 1_000_000_000),
        "rounds of loops and calls of subs, together, in one run",
        default=PROGRAM_PASSES,
    )
    # RS-274/NGC as LinuxCNC reads it, or as Fanuc-like controls do.
    dialect: str = key(
        Choice(("rs274", "fanuc")), "how what differs between controls is read", default="rs274"
    )
    start_state: str = key(
        Choice(("reset", "keep")),
        "the modal state in which a program begins: that of power-on, or the one in force",
        default="reset",
        shown=False,
    )
    without_point: str = key(
        Choice(("", "unit", "thousandth")),
        'what a length without a decimal point counts in under `fanuc`; "": refused',
        default="",
    )
    macro_variables: str = key(
        Choice(("", *MACRO_VARIABLES)),
        "whose tool offsets #2001 to #2800 and groups of modal codes are under `fanuc`",
        default="",
    )
    sub_folders: tuple[str, ...] = key(
        SUB_FOLDERS, "folders of subs, searched in their order behind that of the program", default=()
    )
    own_codes: tuple[tuple[str, str], ...] = key(
        OWN, f"codes of the machine's own ({OWN_CODES}): the name of a sub, or the code meant", default=()
    )
    named_values: tuple[tuple[str, float], ...] = key(
        NAMED,
        "of what programs for LinuxCNC read as `#<_ini[SECTION]NAME>` and `#<_hal[PIN]>`",
        default=(),
    )
    turned_rad: tuple[Pair, ...] = ()  # of the work offsets, in their order; one that is missing stands still
    shift: Shift = Shift()  # of G92, from one program to the next ...
    suspended: bool = False  # ... but for G92.2
    kept: tuple[tuple[int, int], ...] = key(  # from, to
        KEPT,
        "numbers, or [first, last], that outlive a program and a loss of power",
        name="kept_parameters",
        default=(),
        silent=lambda here: KEPT_BY_DIALECT[here["dialect"]],
        left_out="none; under `fanuc` [[500, 999]]",
    )
    parameters: tuple[tuple[int, float], ...] = ()  # their values, where one has set them
    kinematics: str = key(  # which there are is found where they are, by ``machine_file``
        TEXT,
        "what axes the machine has",
        default=USUAL_BUILD,
        may_be='"two_rotaries" or "one_rotary" or "no_rotary"',
    )
    straightness: tuple[Straightness, ...] = ()
    changer: Changer | None = None  # None: tools are changed by hand
    in_spindle: int = TOOL_AT_POWER_ON  # of a changer: the tool with which a program begins, 0 = none
    sisters: tuple[tuple[int, int], ...] = ()  # of tools that are worn, and those that come in their place
    macros: tuple[Macro, ...] = field(default=(), repr=False)
    records: Records = field(default_factory=Records)  # how much of the disk they may take
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
        found = self.table_tool(tool)
        if found is not None and found.may_turn is not None:
            return found.may_turn
        return self.probe is None or self.probe.tool != tool

    def max_rev_min(self, tool: int) -> float:
        """How fast the spindle may turn with the tool of this number (1/min); inf where no file says."""
        most, found = math.inf if self.spindle is None else self.spindle.max_rev_min, self.table_tool(tool)
        return most if found is None or found.max_rev_min is None else min(most, found.max_rev_min)

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
    def may_turn_back(self) -> bool:
        """Whether something tells the spindle to turn counter-clockwise: an inverter by sign or output."""
        told = self.spindle.inverter if self.spindle is not None else None
        has_output = self.io is not None and self.io.output("spindle_reverse") is not None
        return told is None or told.signed or has_output

    @property
    def is_simulated(self) -> bool:
        """Whether all that it drives is simulated."""
        return all(bus.interface == "virtual" for bus in self.buses)

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
        found = self.table_tool(number)
        return None if found is None else found.worn

    def table_tool(self, number: int) -> Tool | None:
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


RULES: Mapping[type, Rules] = {
    Bus: Rules(checks=(_check_rate, _check_channel)),
    Machine: Rules(part=True),
    Tool: Rules(checks=(_check_form,)),
}
