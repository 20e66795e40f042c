"""What a machine has besides its axes and its spindle: inputs and outputs, probe, tool setter, work table.

Each value has the keys of its table of the machine file.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from controller.geometry.vectors import ZERO, Vector, Z, norm, scale
from controller.machine.axes import BUS, NODE, OF_IO, OVERRIDES, SHEET, UNSUPERVISED, USUAL_SHARE
from controller.machine.declaration import key, shared
from controller.machine.forms import FLAG, NAMES, POSITIVE, TEXT, VECTOR, Choice, Integer, Number, Own, Sub
from controller.machine.reading import Reading, Rules, Unread
from controller.messages import Key, message
from drives.profile import Override
from drives.text_file import Source

SENSORS = ("probe", "setter")  # on = touched
INPUTS = (
    "estop",
    "door",
    "power",
    "tool_clamped",
    "coolant_flow",
    "feed_stop",
    *SENSORS,
)  # beside those that clamps name
OUTPUTS = ("coolant", "mist")
# Of a spindle that an inverter turns: 1 where it is well, and where it has its speed; whether and which way
# it turns, and a pulse that resets its own fault.
INVERTER_INPUTS = ("spindle_ready", "spindle_at_speed")
INVERTER_OUTPUTS = ("spindle_run", "spindle_reverse", "spindle_reset")
MAX_BITS = 64  # of a PDO
MAX_CHANNELS = 4  # of 16 bits in one
INT16 = -(2**15), 2**15 - 1
# That programs have for what is the machine's own.
M_CODE = re.compile(r"M(1[0-8]|2[0-8]|3[1-9]|4[0-7]|5[4-9]|69|7[4-9]|8[0-9]|9[0-7]|[1-9][0-9][0-9])")
M_CODES = "M10-M18, M20-M28, M31-M47, M54-M59, M69, M74-M97, M100-M999"


@dataclass(frozen=True, slots=True)
class AnalogueOut:
    """A channel of 6411h: what Q of M67 and M68 may be, and the counts that go with its ends."""

    name: str
    channel: int = key(Integer(1, MAX_CHANNELS), "sub-index of 6411h")
    low: float = key(Number(), "least Q", silent=0.0)  # in whatever unit the machine's builder thinks of
    high: float = key(Number(), "largest Q")
    low_counts: int = key(Integer(*INT16), "what the node is told for the least", silent=0)
    high_counts: int = key(Integer(*INT16), "what it is told for the largest", silent=INT16[1])

    @property
    def idle(self) -> float:
        """Its value without a program: the one nearest to nothing."""
        return min(max(0.0, self.low), self.high)

    def counts(self, value: float) -> int:
        """What the node is told for a Q between ``low`` and ``high``."""
        share = (value - self.low) / (self.high - self.low)
        return round(self.low_counts + share * (self.high_counts - self.low_counts))


@dataclass(frozen=True, slots=True)
class MCode:
    """What a code of the machine's own switches, as it is written."""

    output: str = key(
        Choice(lambda here: here.above["digital_out"]),
        "of `digital_out`",
        may_be=message("file.may.name_of", of="digital_out"),
    )
    on: bool = key(FLAG, "whether it is switched on or off", default=True)


@dataclass(frozen=True, slots=True)
class Orient:
    """M19: while the output is on, the spindle's drive brings it to its angle; the input says it is there."""

    output: str = key(TEXT, "on while the spindle is to be at its angle", may_be=OF_IO)
    input: str = key(TEXT, "1: it is there", may_be=OF_IO)
    angle_deg: float = key(Number(0.0, 360.0), "where that is", silent=0.0)
    within_s: float = key(Number(0.1, 120.0), "not there by then: held, with a fault", silent=10.0)
    shift: str = key(  # X+ X- Y+ or Y-: that way leads the tip of a boring bar off the wall; "" = unknown
        Choice(("X+", "X-", "Y+", "Y-")),
        "which way then leads the tip off the wall, for G76 and G87; left out: they are refused",
        default="",
    )

    @property
    def usual_s(self) -> float:
        """What it is expected to take, s."""
        return USUAL_SHARE * self.within_s


# ---- names of bits, and what is told of them


def _taken(here: Reading, kind: str) -> list[str]:
    """The inputs or the outputs that the machine itself uses. Raises Unread where that is not known."""
    is_input = kind == "inputs"
    orient, changer = here["orient"], here.top["changer"]
    clamps = [axis.clamp for axis in here.top["axis"] if axis.clamp is not None]
    ends = [axis.limit_inputs for axis in here.top["axis"] if is_input and axis.limit_inputs is not None]
    of_ends = [name for one in ends for name in (one.lower, one.upper)]
    of_clamps = [clamp.input if is_input else clamp.output for clamp in clamps]
    of_orient = [orient.input if is_input else orient.output] if orient is not None else []
    of_changer = changer.names[is_input] if changer is not None else ()
    of_inverter = _of_inverter(here, is_input)
    own = INPUTS if is_input else OUTPUTS
    return [
        *own,
        *of_inverter,
        *_of_gears(here, is_input),
        *filter(None, (*of_clamps, *of_ends)),
        *of_orient,
        *of_changer,
    ]


def _of_inverter(here: Reading, is_input: bool) -> tuple[str, ...]:
    """Those of a spindle that an inverter turns."""
    spindle = here.top["spindle"]
    if spindle is None or spindle.by != "inverter":
        return ()
    return INVERTER_INPUTS if is_input else INVERTER_OUTPUTS


def _names(here: Reading, kind: str) -> list[str]:
    """Those that something uses, each once."""
    of_programs = here["digital_in" if kind == "inputs" else "digital_out"]
    return list(dict.fromkeys((*_taken(here, kind), *of_programs)))


def _bits(here: Reading, kind: str) -> tuple[tuple[str, int], ...]:
    """``{ name = bit, ... }`` in the order of the bits."""
    entry = here.table.table(kind, f"{here.table.name} {kind}")
    known: list[str] | None = None
    with here.file.collecting():
        known = _names(here, kind)
    found: dict[str, int] = {}
    for name in entry.written if known is None else known:
        with here.file.collecting():
            if entry.holds(name):
                bit = entry.integer(name, 0, MAX_BITS - 1)
                if twin := next((other for other, taken in found.items() if taken == bit), None):
                    entry.refuse(name, "bit_twice", other=twin)
                found[name] = bit
    if known is not None:
        here.file.mistakes += entry.foreign(known)
    if len(found) < len(entry.written):
        raise Unread(kind)
    return tuple(sorted(found.items(), key=lambda row: row[1]))


def _inverted(here: Reading, name: str) -> tuple[str, ...]:
    names = [one for one, _ in (*here["inputs"], *here["outputs"])]
    allowed = message("file.may.inverted", names=", ".join(names) or Key("file.bits"))
    value = here.table.get(name, allowed)
    if not isinstance(value, list) or not all(one in names for one in value):
        here.table.refuse(name, "inverted_unknown", allowed=allowed)
    return tuple(value)


_BITS = Own(
    _bits,
    message("file.may.table"),
    {"type": "object", "additionalProperties": {"type": "integer", "minimum": 0, "maximum": MAX_BITS - 1}},
)


@dataclass(frozen=True, slots=True)
class Io:
    """A CiA 401 node: its bits by name. A bit is told and read as 1 = on, after ``inverted``."""

    bus: str = shared(BUS)
    node: int = shared(NODE)
    eds: Source = shared(SHEET)  # "" = the shipped simulated one
    inputs: tuple[tuple[str, int], ...] = key(  # (name, bit): "estop", "door" ... and those of clamps
        _BITS, "name and bit; an input is 1 where all is well", silent=()
    )
    outputs: tuple[tuple[str, int], ...] = key(  # "coolant", "mist", those of clamps and of programs
        _BITS, "name and bit", silent=()
    )
    inverted: tuple[str, ...] = key(
        Own(_inverted, message("file.may.name_list"), NAMES.schema()),
        "names whose wire is 0 when they are on",
        default=(),
        may_be="names of `[io]`",
    )
    unsupervised: bool = shared(UNSUPERVISED)
    overrides: tuple[Override, ...] = shared(OVERRIDES)
    digital_in: tuple[str, ...] = key(
        NAMES, "names of inputs that programs wait for: P0, P1 ... of M66", default=()
    )
    digital_out: tuple[str, ...] = key(
        NAMES, "names of outputs that they switch: P0, P1 ... of M62 to M65", default=()
    )
    held: tuple[str, ...] = key(
        NAMES, "of them those that stay as they are at a program's end, a stop and a fault", default=()
    )
    m_codes: tuple[tuple[str, str, bool], ...] = key(  # ("M10", name of a digital_out, on)
        Sub(MCode, named=True), f"what {M_CODES} switch", default=()
    )
    analogue_out: tuple[AnalogueOut, ...] = key(
        Sub(AnalogueOut, named=True), "E0, E1 ... of M67 and M68, by name", default=()
    )
    orient: Orient | None = key(Sub(Orient), "of M19: the spindle's drive goes to its angle", default=None)
    read_on: tuple[str, ...] = key(
        NAMES,
        "of `digital_in` those that programs read as 1 (#1000 is P0 of M66): they go on where they are on",
        default=(),
    )
    read_off: tuple[str, ...] = key(NAMES, "likewise as 0, where they are off", default=())
    changer_out: tuple[str, ...] = ()  # outputs of the tool changer, which no program has by number ...
    changer_in: tuple[str, ...] = ()  # ... and the inputs that it waits for
    gear_out: tuple[str, ...] = ()  # likewise of the spindle's gears
    gear_in: tuple[str, ...] = ()

    def read_as(self, number: int) -> bool | None:
        """What programs read of one of ``digital_in``; None: it is known only while they run."""
        name = self.digital_in[number]
        return name in self.read_on if name in (*self.read_on, *self.read_off) else None

    @property
    def switched(self) -> tuple[str, ...]:
        """The outputs that a program switches: of M62 to M65, of M19, of the changer, of the gears."""
        oriented = (self.orient.output,) if self.orient else ()
        return self.digital_out + oriented + self.changer_out + self.gear_out

    @property
    def awaited(self) -> tuple[str, ...]:
        """The inputs that it waits for, likewise."""
        return (
            self.digital_in + ((self.orient.input,) if self.orient else ()) + self.changer_in + self.gear_in
        )

    def switched_masks(self, on: Sequence[str], off: Sequence[str]) -> tuple[int, int]:
        """Outputs by name as programs number them, bit masks: those that are on, and those that are off."""
        told = [sum(1 << self.switched.index(name) for name in names) for names in (on, off)]
        return told[0], told[1]

    def input(self, name: str) -> int | None:
        """The bit of an input; None where the machine has none of that name."""
        return dict(self.inputs).get(name)

    def output(self, name: str) -> int | None:
        """The bit of an output; None where the machine has none of that name."""
        return dict(self.outputs).get(name)


def _changer_out(here: Reading) -> tuple[str, ...]:
    changer = here.top["changer"]
    return () if changer is None else tuple(changer.names[False])


def _changer_in(here: Reading) -> tuple[str, ...]:
    changer = here.top["changer"]
    return () if changer is None else tuple(one for one in changer.names[True] if one in dict(here["inputs"]))


def _of_gears(here: Reading, is_input: bool) -> tuple[str, ...]:
    """The outputs, or the inputs, of the gears of the spindle, each once."""
    gears = here.top["spindle"].gears if here.top["spindle"] is not None else ()
    names = [one.input for one in gears] if is_input else [n for one in gears for n in (*one.on, *one.off)]
    return tuple(dict.fromkeys(names))


def _check_of_programs(here: Reading, kind: str) -> None:
    """What programs switch or wait for has a bit, and is nobody else's."""
    is_input = kind == "digital_in"
    taken = () if is_input else _taken(here, "outputs")
    known = [name for name, _ in here["inputs" if is_input else "outputs"] if name not in taken]
    for name in here[kind]:
        if name not in known:
            allowed = ", ".join(known) or Key("file.no_named_bit")
            what = Key("file.input" if is_input else "file.output")
            here.table.refuse(kind, "not_of_programs", name=name, kind=what, allowed=allowed)


def _check_listed(here: Reading) -> None:
    """What is said of inputs and outputs of programs is of such, and once."""
    for what, names, others in (
        ("held", "digital_out", ()),
        ("read_on", "digital_in", ()),
        ("read_off", "digital_in", here["read_on"]),
    ):
        known = [name for name in here[names] if name not in others]
        if any(name not in known for name in here[what]):
            allowed = ", ".join(known) or Key("file.no_free_name")
            here.table.refuse(what, "not_listed", names=names, allowed=allowed)


def _check_orient(here: Reading) -> None:
    """The output and the input of ``orient`` are bits of the node, and no program switches them by number."""
    if here["orient"] is None:
        return
    for key_, name, bits, others in (
        ("output", here["orient"].output, here["outputs"], here["digital_out"]),
        ("input", here["orient"].input, here["inputs"], here["digital_in"]),
    ):
        if name not in dict(bits) or name in others:
            allowed = ", ".join(one for one, _ in bits if one not in others) or Key("file.no_free_bit")
            here.table.refuse("orient", "orient_bit", key=key_, name=name, allowed=allowed)


def _check_channels(here: Reading) -> None:
    found: dict[int, str] = {}
    for one in here.below.get("analogue_out", ()):
        with here.file.collecting():
            if (channel := one["channel"]) in found:
                one.table.refuse("channel", "channel_twice", other=found[channel])
            found[channel] = one.called


def _check_high(here: Reading) -> None:
    if here["high"] <= here["low"]:
        here.table.refuse("high", "high_low", low=here["low"])


def _check_code(here: Reading) -> None:
    if here.within is not None and not M_CODE.fullmatch(here.called):
        here.within.refuse(here.called, "no_m_code", allowed=M_CODES)


@dataclass(frozen=True, slots=True)
class Sensor:
    """A touch probe in the spindle, whose ball and length are those of ``tool``, or a tool setter."""

    input: str = key(
        Choice(SENSORS), "of `[io]`, on = touched", silent=lambda here: here.called, left_out="its own name"
    )
    overtravel_mm: float = key(
        Number(0.05, 50.0),
        "so far it gives behind a touch; a feed at which its stop is longer is refused",
        silent=2.0,
    )
    latency_s: float = key(
        Number(0.0, 50.0),
        "from the touch to the frame of the input",
        name="latency_ms",
        scale=1e-3,
        default=0.0,
    )
    latch_tpdo: int = key(
        Integer(0, 4),
        "number of the TPDO with which the drives tell where they were (60BAh); 0: none",
        default=0,
    )
    tool: int = key(
        Integer(1, 99999),
        "its number in the tool table, which has its ball and length",
        default=0,
        tables=("probe",),
        needed=("probe",),
    )
    release_mm: float = key(
        Number(0.1, 20.0), "behind a touch it is free again within so much", default=2.0, tables=("probe",)
    )
    point: Vector = key(
        VECTOR,
        "the middle of its face, seen from the table with all rotaries at zero",
        name="point_mm",
        default=ZERO,
        tables=("setter",),
        needed=("setter",),
    )
    radius_mm: float = key(POSITIVE, "of its face", default=0.0, tables=("setter",), needed=("setter",))


@dataclass(frozen=True, slots=True)
class WorkTable:
    """The body under the work that no tool may touch: a disc, seen with all rotaries at zero."""

    centre: Vector = key(
        VECTOR, "of the disc's upper face, with all rotaries at zero", name="centre_mm"
    )  # mm
    normal: Vector = key(VECTOR, "out of that face", silent=Z)  # a unit vector
    radius_mm: float = key(POSITIVE, "of the disc, for the check of collisions")
    thickness_mm: float = key(POSITIVE, "of the disc", silent=20.0)


def _check_normal(here: Reading) -> None:
    if norm(here["normal"]) < 1e-9:
        here.table.refuse("normal", "no_face")


RULES: Mapping[type, Rules] = {
    AnalogueOut: Rules(fills={"name": lambda here: here.called}, checks=(_check_high,)),
    MCode: Rules(checks=(_check_code,), made=lambda code, here: (here.called, code.output, code.on)),
    Io: Rules(
        fills={
            "changer_out": _changer_out,
            "changer_in": _changer_in,
            "gear_out": lambda here: _of_gears(here, False),
            "gear_in": lambda here: _of_gears(here, True),
        },
        checks=(
            lambda here: _check_of_programs(here, "digital_in"),
            lambda here: _check_of_programs(here, "digital_out"),
            _check_listed,
            _check_orient,
            _check_channels,
        ),
    ),
    WorkTable: Rules(
        checks=(_check_normal,),
        made=lambda table, _: replace(table, normal=scale(table.normal, 1.0 / norm(table.normal))),
    ),
}


# ---- what only the whole file can show


def check_clamp(axis: Reading) -> None:
    """The output and the input of its clamp are bits of the node."""
    clamp, io = axis["clamp"], axis.top["io"]
    if clamp is None:
        return
    table = axis.one_below("clamp").table
    if io is None or io.output(clamp.output) is None:
        table.refuse("output", "no_output", allowed=listed(io, io.outputs if io else ()))
    if clamp.input and io.input(clamp.input) is None:
        table.refuse("input", "no_input", allowed=listed(io, io.inputs))


def check_limits(axis: Reading) -> None:
    """Each of its limit switches is an input of the node, and no other switch is on that."""
    if axis["limit_inputs"] is None:
        return
    table, io = axis.one_below("limit_inputs").table, axis.top["io"]
    switches = [
        (one.name, end, getattr(one.limit_inputs, end))
        for one in axis.top["axis"]
        if one.limit_inputs is not None
        for end in ("lower", "upper")
    ]
    if not any(name for owner, _, name in switches if owner == axis["name"]):
        axis.table.refuse("limit_inputs", "no_limits")
    for n, (owner, end, name) in enumerate(switches):
        if owner != axis["name"] or not name:
            continue
        if io is None or io.input(name) is None:
            table.refuse(end, "no_input", allowed=listed(io, io.inputs if io else ()))
        if twin := next((one for one in switches[:n] if one[2] == name), None):
            table.refuse(end, "limit_twice", other=f"{twin[0]} {twin[1]}")


def listed(io: Io | None, bits: Sequence[tuple[str, int]]) -> str:
    """The names of bits, or that there are none."""
    return ", ".join(name for name, _ in bits) or Key("file.none" if io else "file.no_io")


def check_sensor(sensor: Reading) -> None:
    """Its input is a bit of the node."""
    io = sensor.top["io"]
    inputs = io.inputs if io is not None else ()
    if sensor["input"] not in dict(inputs):
        sensor.table.refuse("input", "no_input", allowed=listed(io, inputs))


def check_probe(sensor: Reading) -> None:
    """The probe is a tool of the table."""
    tools = [tool.number for tool in sensor.top["tool"]]
    if sensor.called == "probe" and sensor["tool"] not in tools:
        known = ", ".join(map(str, tools)) or Key("file.no_tools")
        sensor.table.refuse("tool", "no_probe", allowed=known)
