"""The axes of a machine: their values, each with the key that fills it.

Inside, lengths are millimetres, angles radians, times seconds, and a rotary's position is the right-hand
angle of the body it carries ("carried" sense). The machine file's degrees and its configured sense end here.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum
from typing import ClassVar

from controller.geometry.vectors import ZERO, Vector, norm
from controller.machine.declaration import Key, declared, key, same_table, shared
from controller.machine.deviation_tables import Pitch, PitchTable
from controller.machine.drive_profiles import OverrideTable
from controller.machine.forms import (
    FLAG,
    POSITIVE,
    TEXT,
    VECTOR,
    Choice,
    Integer,
    Number,
    Numbers,
    Own,
    Rows,
    Sub,
    any_of,
)
from controller.machine.reading import Reading, Rules, Unread
from controller.messages import message
from drives.profile import Override
from drives.settings import ADDITIONAL_POSITION, DEMAND, INT32_MAX, OFF_DEMAND
from drives.text_file import Source

# What a device is expected to take until it is measured: a share of the longest that it may take,
USUAL_SHARE = 0.5
# Of the drive's own window (following_error): what the controller allows at rest, and of that in position.
REST_SHARE = IN_POSITION_SHARE = 0.1
PARALLEL = 1e-6
WITHIN_TRAVEL = "within the travel"
OF_IO = message("file.may.name_of", of="[io]")
SLIDES, ROTARIES = ("X", "Y", "Z"), ("A", "B", "C")
# What real machines have, from heavy gantries to linear motors; of a count 0.01 mm and 0.02 degree at most.
VELOCITY = {"mm": (1.0, 5000.0), "deg": (0.5, 20_000.0)}
ACCELERATION = {"mm": (10.0, 1e5), "deg": (5.0, 1e6)}
JERK = {"mm": (100.0, 1e8), "deg": (50.0, 1e9)}
HOMING = {"mm": (0.01, 500.0), "deg": (0.01, 720.0)}
FOLLOWING = {"mm": (0.0, 100.0), "deg": (0.0, 90.0)}
COUNTS = {"mm": (100.0, 1e8), "deg": (50.0, 1e8)}


class Kind(Enum):
    """Where an axis stands: a linear slide, a rotary under the work, a rotary in the head."""

    LINEAR = "linear"
    TABLE = "table"
    HEAD = "head"


class Sense(Enum):
    """Sign of a table rotary outside: of the carried body, or as if the tool turned (ISO 841)."""

    CARRIED = "carried"
    ISO = "iso"


def _inner(here: Reading) -> float:
    return here.inner


def _size(here: Reading) -> float:
    return abs(here.inner)


class _OfName(Choice):
    """The kind of an axis, which its name tells, too: where the two differ that is the one mistake."""

    def read(self, here: Reading, name: str) -> Kind:
        found: Kind = super().read(here, name)
        called = here.table.get("name", "", "")
        if called in (ROTARIES if found is Kind.LINEAR else SLIDES):
            allowed = any_of([one.value for one in Kind if (one is Kind.LINEAR) is (called in SLIDES)])
            here.table.refuse(name, "kind_of_name", name=called, allowed=allowed)
        return found


def _is_rotary(here: Reading) -> bool:
    return here["kind"] is not Kind.LINEAR


def _axis(here: Reading) -> Reading:
    """The reading of the axis to which a table belongs."""
    return here if here.of is Axis or here.above is None else _axis(here.above)


def _lower(here: Reading) -> float:
    return _travelled(here)[0]


def _upper(here: Reading) -> float:
    return _travelled(here)[1]


def _travelled(here: Reading) -> tuple[float, float]:
    """The travel as it is written. Raises Unread where its ends are swapped, which is refused by itself."""
    lower, upper = _axis(here)["travel"]
    if lower >= upper:
        raise Unread("travel")
    return float(lower), float(upper)


# ---- keys of everything that is a node on a bus


def _bus(here: Reading, name: str) -> str:
    buses = [bus.name for bus in here.top["bus"]]
    found = here.table.get(name, "")
    if isinstance(found, str) and found not in buses and not here.file.misses("bus", found):
        raise Unread(name)
    return here.table.text(name, buses)


BUS = declared(
    Own(_bus, TEXT.allowed(None), TEXT.schema()),
    "on which it is",
    name="bus",
    silent=lambda here: here.top["bus"][0].name,
    may_be="the name of a `[[bus]]`",
    left_out="the first",
)
NODE = declared(Integer(1, 126), "its CANopen node id", name="node")


def _profile(here: Reading, _: str) -> Source:
    here.top["file"]  # which may be refused
    found: Source = here.file.files.profile(here.table)
    return found


def _sheet(here: Reading, _: str) -> Source:
    here.top["file"]
    found: Source = here.file.files.sheet(here.table)
    return found


PROFILE = Own(_profile, TEXT.allowed(None), TEXT.schema())
SHEET = declared(
    Own(_sheet, TEXT.allowed(None), TEXT.schema()),
    "its data sheet, seen from the machine file",
    name="eds",
    silent="",
)
UNSUPERVISED = declared(
    FLAG,
    "accept it though it does not notice a dead controller, with a warning each time",
    name="unsupervised",
    default=False,
)
OVERRIDES = declared(
    Rows(OverrideTable, beneath=True), "where its data sheet is wrong", name="override", default=()
)


@dataclass(frozen=True, slots=True)
class Limits:
    """Largest velocity, acceleration and jerk of one joint (mm or rad per s, s^2, s^3)."""

    velocity: float = key(
        POSITIVE, "largest of this axis", name="velocity_{unit}_s", scale=_size, usual=VELOCITY
    )
    acceleration: float = key(
        POSITIVE, "largest of this axis", name="acceleration_{unit}_s2", scale=_size, usual=ACCELERATION
    )
    jerk: float = key(POSITIVE, "largest of this axis", name="jerk_{unit}_s3", scale=_size, usual=JERK)


@dataclass(frozen=True, slots=True)
class Homing:
    """How the drive finds its zero (CiA 402-2 object 6098h and friends)."""

    method: int = key(Integer(-128, 127), "of CiA 402-2 (6098h); 0: the encoder is absolute", default=37)
    group: int = key(Integer(0, 99), "axes of a group home side by side, the groups in order", default=0)
    position: float = key(
        Number(_lower, _upper),
        "of the axis at the homed point",
        name="position_{unit}",
        scale=_inner,
        default=0.0,
        may_be=WITHIN_TRAVEL,
    )
    absolute: bool = key(FLAG, "the encoder knows where it is: never homed", default=False)
    fast: float = key(
        POSITIVE,
        "search for the switch (6099h:01); left out: as the drive has it",
        name="fast_{unit}_s",
        scale=_size,
        default=0.0,
        usual=HOMING,
        left_out="–",
    )
    slow: float = key(
        POSITIVE,
        "search for the edge or the index (6099h:02); left out: as the drive has it",
        name="slow_{unit}_s",
        scale=_size,
        default=0.0,
        usual=HOMING,
        left_out="–",
    )
    acceleration: float = key(
        POSITIVE,
        "609Ah; left out: as the drive has it",
        name="acceleration_{unit}_s2",
        scale=_size,
        default=0.0,
        usual=ACCELERATION,
        left_out="–",
    )


@dataclass(frozen=True, slots=True)
class Following:
    """How far an axis may be from what it was told (mm or rad): ``rest``, and more the faster it goes."""

    rest: float = key(
        POSITIVE,
        "at rest",
        name="rest_{unit}",
        scale=_size,
        silent=lambda here: REST_SHARE * _axis(here).as_written("following_error"),
        usual=FOLLOWING,
        left_out="a tenth of `following_error`",
    )
    at_speed: float = key(
        Number(0.0),
        "added at the largest velocity, and in proportion below it",
        name="at_speed_{unit}",
        scale=_size,
        silent=lambda here: _axis(here).as_written("following_error"),
        usual=FOLLOWING,
        left_out="`following_error`, narrowed as measured",
    )
    in_position: float = key(
        Number(0.0, lambda here: here.as_written("rest")),
        "where motion has arrived: spindle, coolant and clamps wait for it",
        name="in_position_{unit}",
        scale=_size,
        silent=lambda here: IN_POSITION_SHARE * here.as_written("rest"),
        may_be="up to `rest`",
        left_out="a tenth of `rest`",
    )
    ticks: int = key(Integer(1, 10), "feedbacks in a row beyond it are a fault", default=3)
    tightens: bool = False  # ``at_speed`` is a default: what is measured narrows it


@dataclass(frozen=True, slots=True)
class Temperature:
    """Where a drive tells how warm it is; every maker has another object."""

    index: int = key(Integer(0x2000, 0x6FFF), "of the object")
    sub: int = key(Integer(0, 254), "its sub-index", silent=0)
    bits: int = key(Integer(8, 32), "its size, signed: 8, 16 or 32", silent=16)
    tpdo: int = key(Integer(1, 4), "number of the one that takes it, twice a second at most")
    per_degree: float = key(POSITIVE, "of its unit", silent=1.0)


@dataclass(frozen=True, slots=True)
class Demand:
    """Where a drive tells the setpoint that it goes by, so that lost ones are counted."""

    index: int = key(
        Integer(OFF_DEMAND, DEMAND),
        "60FCh: that setpoint; 60F4h: by which the position is off it",
        silent=DEMAND,
    )
    tpdo: int = key(Integer(1, 4), "number of the one that takes it")
    every: int = key(Integer(1, 240), "with every so many SYNCs", silent=1)
    per_count: float = key(POSITIVE, "of the object's unit in one count of the axis", silent=1.0)


@dataclass(frozen=True, slots=True)
class Clamp:
    """A clamp that holds a standing axis: the names of its output (1 = open) and input (1 = closed)."""

    output: str = key(TEXT, "of `[io]`; 1: open", may_be=OF_IO)
    input: str = key(TEXT, "of `[io]`; 1: closed; left out: nothing reports", silent="", may_be=OF_IO)
    open_s: float = key(Number(0.01, 30.0), "most that opening or closing may take", silent=0.5)

    @property
    def usual_s(self) -> float:
        """What it is expected to take, s; one that does not report counts as moved at the end of its time."""
        return USUAL_SHARE * self.open_s if self.input else self.open_s


@dataclass(frozen=True, slots=True)
class LoadEncoder:
    """A second encoder at the load, which the drive tells beside its motor's: the two are compared."""

    index: int = key(Integer(0x2000, 0x6FFF), "object of its position, 32 bits", silent=ADDITIONAL_POSITION)
    sub: int = key(Integer(0, 254), "its sub-index", silent=1)
    tpdo: int = key(Integer(1, 4), "number of the one that takes it")
    every: int = key(Integer(1, 240), "with every so many SYNCs", silent=1)
    counts_per_unit: float = key(
        Number(),
        "of it; its sign is the direction; left out: as of the drive's position",
        name="counts_per_{unit}",
        per=_inner,
        silent=lambda here: _axis(here).as_written("counts_per_unit"),
        left_out="as of the axis",
    )
    most_off: float = key(
        POSITIVE,
        "by which it may differ from the motor since homing (absolute: since enabling): more is a fault",
        name="most_off_{unit}",
        scale=_size,
        usual=FOLLOWING,
    )
    node: int = key(
        Integer(1, 126),
        "of an encoder that is a node on the axis' bus, set up to start by itself and to send with SYNC; "
        "left out: the drive tells it",
        default=0,
        left_out="–",
    )


@dataclass(frozen=True, slots=True)
class LimitInputs:
    """Limit switches of an axis that are wired to the I/O node: names of inputs, 1 where they are free."""

    lower: str = key(TEXT, "of `[io]`: the switch at the lower end of the travel", silent="", may_be=OF_IO)
    upper: str = key(TEXT, "of `[io]`: that at the upper end", silent="", may_be=OF_IO)


@dataclass(frozen=True, slots=True)
class Stopping:
    """How the drive should stop by itself, and its units; 0 = as ``nodes`` and the drive have it."""

    quick_stop: float = key(
        POSITIVE,
        "of the drive's own stop (6085h); left out: the largest acceleration",
        name="quick_stop_{unit}_s2",
        scale=_size,
        default=0.0,
        usual=ACCELERATION,
        tables=("axis",),  # a spindle has its units alone
        left_out="–",
    )
    velocity_unit_counts_s: float = key(
        POSITIVE,
        "one unit of 6099h, 60B1h and 60FFh, where the drive does not tell",
        default=0.0,
        left_out="–",
    )
    acceleration_unit_counts_s2: float = key(
        POSITIVE,
        "one unit of 6085h and 609Ah; left out: that of velocity, per second",
        default=0.0,
        left_out="–",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """One joint: geometry, travel, limits, and the drive that moves it."""

    name: str = key(
        Choice(lambda here: ROTARIES if _is_rotary(here) else SLIDES),
        "X, Y, Z of a slide, A, B, C of a rotary",
        may_be=message("file.may.letters", slides=any_of(SLIDES), rotaries=any_of(ROTARIES)),
    )
    kind: Kind = key(
        _OfName({one.value: one for one in Kind}), "a slide, a rotary under the work, or a rotary in the head"
    )
    direction: Vector = key(
        VECTOR,
        "of positive travel; a slide that is not square leans up to 30 degrees, which is compensated; a "
        "rotary turns the carried body about it, right-handed",
    )
    point_mm: Vector = key(  # machine frame at zero; unused for linear axes
        VECTOR,
        "of a rotary: a point on its axis, with the machine at zero",
        needed=True,
        silent=ZERO,
        only=_is_rotary,
        usual=(0.0, 5000.0),
    )
    sense: Sense = key(
        Choice({one.value: one for one in Sense}),
        "how a table rotary is shown: as the body turns, or as if the tool did (ISO 841)",
        silent=Sense.CARRIED,
        only=_is_rotary,
    )
    travel: ClassVar[Key] = declared(Numbers(2), "[lower, upper]", name="travel_{unit}")
    travel_min: float
    travel_max: float
    limits: Limits = same_table(Limits)
    counts_per_unit: float = key(  # drive counts per mm or per radian, with the drive's sign
        Number(),
        "of the drive's position; its sign is the direction",
        name="counts_per_{unit}",
        per=_inner,
        usual=COUNTS,
    )
    bus: str = shared(BUS)
    node: int = shared(NODE)
    profile: Source = key(
        PROFILE, "of the drive: a shipped one, or a file beside the machine file", silent="simulated"
    )
    homing: Homing = key(Sub(Homing, always=True), "how it finds its zero")
    following_error: float = key(  # mm or rad
        POSITIVE,
        "largest that the drive allows itself (6065h)",
        name="following_error_{unit}",
        scale=_size,
        usual=FOLLOWING,
    )
    following: Following = key(Sub(Following, always=True), "largest that the controller allows it")
    brake: bool = key(FLAG, "whether it has a holding brake", silent=False)
    feedback_every: int = key(Integer(1, 240), "its position comes with every so many SYNCs", default=1)
    feed_forward: bool = key(FLAG, "whether the velocity goes with the target (60B1h)", default=False)
    enable_group: int = key(Integer(0, 99), "lowest first; disabled in reverse", default=0)
    unsupervised: bool = shared(UNSUPERVISED)
    eds: Source = shared(SHEET, default="")
    serial: int = key(
        Integer(0, 0xFFFF_FFFF),
        "of the very drive that belongs here (1018h:04); 0: any of its kind",
        default=0,
    )
    clamp: Clamp | None = key(Sub(Clamp), "that holds it where it stands", default=None)
    load_encoder: LoadEncoder | None = key(
        Sub(LoadEncoder), "a second encoder at the load: compared with the motor's", default=None
    )
    limit_inputs: LimitInputs | None = key(
        Sub(LimitInputs),
        "its limit switches, where they are wired to the I/O node: motion into one that is pressed stops",
        default=None,
    )
    temperature: Temperature | None = key(
        Sub(Temperature), "where the drive tells how warm it is", default=None
    )
    demand: Demand | None = key(
        Sub(Demand),
        "where the drive tells the setpoint that it goes by: those that it has missed are counted",
        default=None,
    )
    setpoint_deadline_s: float = key(  # 0 = as our heartbeat
        Number(0.0, 10_000.0),
        "without setpoints for so long (1400h:05) the drive says so, and stops",
        name="setpoint_deadline_ms",
        scale=1e-3,
        default=0.0,
    )
    stopping: Stopping = same_table(Stopping, Stopping())
    overrides: tuple[Override, ...] = shared(OVERRIDES)
    reference: float | None = key(  # mm or rad
        Number(_lower, _upper),
        "where G28 leads",
        name="reference_{unit}",
        scale=_inner,
        default=None,
        may_be=WITHIN_TRAVEL,
        left_out="where it is homed",
    )
    second_reference: float | None = key(
        Number(_lower, _upper),
        "where G30 leads",
        name="second_reference_{unit}",
        scale=_inner,
        default=None,
        may_be=WITHIN_TRAVEL,
        left_out="as `reference`",
    )
    pitch: Pitch | None = key(
        Sub(PitchTable),
        "what it misses of its targets: pitch and backlash, as ISO 230-2 has them",
        default=None,
    )

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


# ---- the rules of their tables


def _unit(here: Reading) -> str:
    return "deg" if _is_rotary(here) else "mm"


def _radians(here: Reading) -> float:
    """What one unit of an axis is inside: of a rotary in radians of the carried body."""
    if not _is_rotary(here):
        return 1.0
    flipped = here["kind"] is Kind.TABLE and here["sense"] is Sense.ISO
    return math.radians(-1.0 if flipped else 1.0)


def _ends(here: Reading) -> tuple[float, float]:
    lower, upper = (end * here.inner for end in here["travel"])
    return min(lower, upper), max(lower, upper)


def _check_travel(here: Reading) -> None:
    lower, upper = here["travel"]
    if lower >= upper:
        here.table.refuse(f"travel_{here.unit}", "no_travel")


def _check_direction(here: Reading) -> None:
    if norm(here["direction"]) < PARALLEL:
        here.table.refuse("direction", "no_direction")


def _check_counts(here: Reading) -> None:
    """A setpoint is an int32, so all of the travel must fit (607Ah)."""
    name, counts = f"counts_per_{here.unit}", abs(here.as_written("counts_per_unit"))
    if counts == 0.0:
        here.table.refuse(name, "zero_drive")
    farthest = max(map(abs, here["travel"]))
    if counts * farthest > INT32_MAX:
        most = INT32_MAX / counts
        here.table.refuse(
            f"travel_{here.unit}",
            "travel_fits",
            farthest=farthest,
            unit=here.unit,
            counts=counts,
            most=most,
            key=name,
        )


def _check_load_feedback(here: Reading) -> None:
    """Load and motor are compared as of one moment, so the motor's position must come with every SYNC."""
    if here["load_encoder"] is not None and here["feedback_every"] != 1:
        here.table.refuse("feedback_every", "load_feedback", every=here["feedback_every"])


def _check_temperature(here: Reading) -> None:
    if here["bits"] not in (8, 16, 32):
        here.table.refuse("bits", "no_bits")


def _check_demand(here: Reading) -> None:
    if here["index"] not in (OFF_DEMAND, DEMAND):
        here.table.refuse("index", "no_demand")


def _check_units(here: Reading) -> None:
    if here["acceleration_unit_counts_s2"] and not here["velocity_unit_counts_s"]:
        here.table.refuse("acceleration_unit_counts_s2", "unit_alone")


def _check_load_encoder(here: Reading) -> None:
    if here["counts_per_unit"] == 0.0:
        here.table.refuse(f"counts_per_{here.unit}", "zero_encoder")


def _homing(homing: Homing, _: Reading) -> Homing:
    """Method 0 is CiA 402's "no homing required": the encoder is absolute."""
    absolute = homing.absolute or homing.method == 0
    return replace(homing, method=0 if absolute else homing.method, absolute=absolute)


RULES: Mapping[type, Rules] = {
    Axis: Rules(
        unit=_unit,
        inner=_radians,
        fills={"travel_min": lambda here: _ends(here)[0], "travel_max": lambda here: _ends(here)[1]},
        checks=(_check_travel, _check_direction, _check_counts, _check_load_feedback),
    ),
    Stopping: Rules(checks=(_check_units,)),
    Homing: Rules(made=_homing),
    Following: Rules(fills={"tightens": lambda here: not here.table.holds(f"at_speed_{here.unit}")}),
    Temperature: Rules(checks=(_check_temperature,)),
    Demand: Rules(checks=(_check_demand,)),
    LoadEncoder: Rules(checks=(_check_load_encoder,)),
}
