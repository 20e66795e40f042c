"""The live state of the machine, declared once: what every tick leaves for others.

A row of ``Snapshot`` says all that there is to say of a value: type, unit, who writes it, what it means,
and where it is shown. Made of these rows are the layout in shared memory, the recorder's row (so the columns
of recordings), the fields of the status and of its OpenAPI model, the scope's signals, and the table in
README.md. Likewise ``DriveRow`` for what the status tells of a drive.

A value is taken from the attribute of the same name at its owner, a part of the tick; of ``DRIVES`` from that
of each drive. No place is counted, so no two values can be taken for one another. How they are taken is
compiled, as ``dataclasses`` does it: a tick reads its attributes and nothing else. What each axis has stands
in ``MAX_AXES`` places; those that a machine of fewer axes leaves are 0, and are not read.
"""

from __future__ import annotations

import itertools
import struct
from collections.abc import Callable, Iterator
from enum import Enum
from functools import cache
from typing import Annotated, Any, NamedTuple, get_args, get_type_hints

from controller.commands.table import SWITCHED, SWITCHES, Request
from controller.messages import Message
from controller.state.modes import MAX_AXES, Fault, Mode
from controller.state.queue_refusals import QueueRefusal
from controller.state.requests import ANSWERS, PLAN_IDS, Outcome, outcome

ANALOGUE = 4  # outputs at most
EACH_AXIS = 0  # in place of ``many``
DRIVES = "drives"  # the owner of what each drive has itself
Flat = tuple[float, ...]  # the values of one tick in the order in which they stand here


class Value(NamedTuple):
    """What the declaration of a value says besides its name and type.

    ``status`` and ``signal``: under which name it is shown, in which unit, and the factor from the unit
    inside to that one; a dot in the name: a field of an object.
    """

    owner: str  # a part of the tick; "part.attribute" where the attribute has another name
    meaning: str
    unit: str = ""
    column: str = ""  # of the recorder's row; of an axis' value: with its number behind
    status: str = ""
    signal: str = ""
    many: int = 1  # more than one: a tuple of so many; ``EACH_AXIS``: one of each axis
    code: str = ""  # of ``struct``, where it is not that of the type


def _value(owner: str, meaning: str, unit: str = "", column: str = "", **more: Any) -> Any:
    """The declaration of a value; stands where its default would, as those of ``dataclasses`` do."""
    return Value(owner, meaning, unit, column, **more)


# Bits of ``switches``: the operator's (``SWITCHES`` of the table of commands), and what else a run is made
# again by.
STOOD = 4  # stood still in this tick, after a long gap
WAITED = 8  # motion waited for spindle, coolant or clamps
SETTLED = 32  # the spindle stands where its thread does, or there is none
EXPIRED = 128  # in this tick a jog was ended that nobody asked for any more
OFF_PATH = 16  # the setpoints are where the drives were
PLAYED = 256  # played out of the stock: the tick of this period was late, and found it done
BRAKED = 512  # likewise, and after the end of the stock: a part of its stop, or at rest
TAKEN_BACK = 1024  # the step of the row before was not sent: the pump has gone on by the plan before, ...
TAKEN_BACK_BRAKED = 2048  # ... and that after the end of the stock


class Snapshot(NamedTuple):
    """The state of the machine at the end of one tick; mm, radians, seconds.

    Those with a column come first: their order is that of the recorder's row, and is never changed.
    """

    tick: int = _value("cycle", "number of the tick", column="tick", status="tick.number")
    mode: Mode = _value("modes", "what the machine does", column="mode", status="mode", signal="mode")
    fault: Fault = _value("modes", "why it stopped", column="fault", signal="fault")
    motion_id: int = _value("status", "motion under the clock; below 0: none", column="motion_id")
    line: int = _value("follow", "line of the program, 0 = none", column="line", signal="line")
    cutting: bool = _value("status", "the motion cuts", column="cutting", signal="cutting")
    plan_time_s: float = _value("follow.tau", "the path clock", "s", "plan_time_s", signal="path_time s")
    s: float = _value("follow", "length along the motion", "mm", "s", signal="s mm")
    rate: float = _value(
        "follow",
        "1 on the plan, 0 standing; while stopping ds/dt over that of the plan where it was left",
        column="rate",
        signal="path_clock % 100",
    )
    feed_mm_s: float = _value(
        "follow.feed",
        "speed along the path",
        "mm/s",
        "feed_mm_s",
        status="feed_mm_min.actual mm/min 60",
        signal="feed mm/min 60",
    )
    joints: tuple[float, ...] = _value(
        "follow", "commanded positions of the axes", "mm, rad", "joint_command", many=EACH_AXIS
    )
    setpoints: tuple[int, ...] = _value(
        "encoder", "the same as sent to the drives", "counts", "setpoint", many=EACH_AXIS
    )
    actual: tuple[float, ...] = _value(
        "encoder", "positions that the drives have told", "mm, rad", "actual", many=EACH_AXIS
    )
    lateness_s: float = _value("sync", "of this tick", "s", "lateness_s", signal="lateness µs 1e6")
    sync_sent: bool = _value("cycle", "SYNC went out in this tick", column="sync_sent", signal="sync_sent")
    accepted_now: int = _value(
        "cycle", "sequence of the message taken in this tick; below 0: refused", column="accepted"
    )
    limited_by: int = _value(
        "follow", "what binds, see ``Binding``", column="limited_by", signal="limited_by"
    )
    override: float = _value(
        "modes",
        "of the programmed feed, 1 = 100 %",
        column="override",
        status="override",
        signal="override % 100",
    )
    rapid_override: float = _value(
        "modes",
        "of rapids, 1 = 100 %",
        column="rapid_override",
        status="rapid_override",
        signal="rapid_override % 100",
    )
    switches: int = _value(
        "cycle",
        "1 single block, 2 optional stop, 4 stood, 8 waited, 16 off path, 32 settled, 64 adaptive feed, "
        "128 jog expired, 256 played out of the stock, 512 after its end, "
        "1024 the step before was taken back, 2048 for one after its end",
        column="switches",
    )
    taken: int = _value("cycle", "number of the last request taken in this tick, 0 = none", column="request")
    bus_share: float = _value(
        "status",
        "of the period, that the frames of this tick take at most on the fullest bus",
        column="bus_share",
        signal="bus_load % 100",
    )
    thread_mm: float = _value(
        "coupling.led_mm", "along a thread: of the axes beyond the place s of its law", "mm", "thread_mm"
    )
    spindle_turns: float = _value(
        "coupling.turns",
        "that the spindle has made, where it tells its angle",
        "rev",
        "spindle_turns",
        status="spindle.turns rev",
        signal="spindle_turns rev",
    )
    spindle_load: float = _value(
        "coupling.load",
        "of the rated torque, where it is told",
        column="spindle_load",
        status="spindle.load % 100",
        signal="spindle_load % 100",
    )
    adaptive_share: float = _value(
        "adaptive.share",
        "of the feed, that the load of the spindle leaves where ``adaptive_on``, 1 = all",
        column="adaptive_share",
        status="adaptive.share",
        signal="adaptive_share % 100",
    )
    load_off: tuple[float, ...] = _value(
        "status",
        "by which the encoder at the load is ahead of the motor's since homing, 0 without one",
        "mm, rad",
        "load_off",
        many=EACH_AXIS,
    )
    # From here on no recording has them.
    fault_axis: int = _value("modes", "index of its axis, -1 = none")
    fault_off: float = _value("status", "of a following error: commanded less actual of its axis", "mm, rad")
    warning: Fault = _value("modes", "the last fault that stopped nothing", status="warning")
    warning_axis: int = _value("modes", "index of its axis, -1 = none")
    chatter_id: int = _value("chatter.can_id", "identifier of frames that come too often, -1 = none")
    chatter_per_s: float = _value("chatter.per_s", "how many of these frames come", "1/s")
    interlock: Fault = _value("modes", "what forbids motion now", status="interlock")
    commit_s: float = _value("follow", "plan time from which on the queue may be replaced", "s")
    queue_end_s: float = _value("follow", "plan time at which the queue ends", "s")
    at_rest: bool = _value("follow", "the commanded joints stand", status="at_rest")
    stopping: bool = _value("follow", "leaving the plan by a stop; at its end ``epoch`` counts up")
    epoch: int = _value("follow", "queues given up so far")
    homed: int = _value("modes", "axes that have their zero, bit mask")
    untrusted: int = _value("modes", "axes that must be homed before a start, bit mask")
    drive_states: tuple[int, ...] = _value("drives.state", "of CiA 402", many=EACH_AXIS)
    malformed: tuple[int, ...] = _value("drives", "frames of a wrong length from each drive", many=EACH_AXIS)
    missed: tuple[int, ...] = _value(
        "drives",
        "setpoints that each drive did not take with their SYNC, -1 = it does not tell",
        many=EACH_AXIS,
    )
    overdue: tuple[int, ...] = _value(
        "drives", "times that each drive has missed its setpoints for too long (8250h)", many=EACH_AXIS
    )
    skips: int = _value("sync", "ticks that sent no SYNC", status="tick.skips")
    late_max_s: float = _value("sync", "the latest tick so far", "s", status="tick.late_max_ms ms 1e3")
    played: int = _value(
        "sync", "periods that were played out of the stock, since their tick was late", status="tick.played"
    )
    braked: int = _value(
        "sync", "times that the stock was not enough: the axes braked, and went on", status="tick.braked"
    )
    latency: int = _value(
        "sync", "ticks from a setpoint to the position that should be there", status="tick.latency"
    )
    lost_frames: int = _value(
        "status", "received frames that were lost, since nobody took them in time", status="tick.lost_frames"
    )
    accepted: int = _value("cycle", "sequence of the last message taken")
    rejected: int = _value("cycle", "sequence of the last message refused")
    refusal: QueueRefusal = _value("cycle", "why the last message was not taken, NONE: it was")
    switched: int = _value("modes", "switches that are on, by the bits of their commands")
    adaptive_on: bool = _value(
        "adaptive.on", "it leads that of the motion under the clock", status="adaptive.on"
    )
    spindle_rev_min: float = _value(
        "peripherals.rev_min", "as told now, signed", "1/min", status="spindle.rev_min 1/min"
    )
    spindle_actual_rev_min: float = _value(
        "peripherals.actual_rev_min",
        "signed; where no drive reports it what is wanted, and in the status null",
        "1/min",
        status="spindle.actual_rev_min 1/min",
    )
    spindle_override: float = _value("modes", "of S, 1 = 100 %", status="spindle.override")
    spindle_at_speed: bool = _value(
        "peripherals.at_speed", "it turns as told; in the status null by hand", status="spindle.at_speed"
    )
    thread_rev: float = _value(
        "coupling.depth_rev",
        "turns that the tool is in a thread, 0 = in none",
        "rev",
        status="thread.turns rev",
    )
    thread_pitch_mm: float = _value(
        "coupling.pitch_mm", "of that thread, signed as it is turned into", "mm", status="thread.pitch_mm mm"
    )
    coolant: int = _value("peripherals", "1 mist, 2 flood, 3 both")
    waiting: bool = _value("peripherals", "motion stands until these are as told", status="waiting")
    feed_stopped: bool = _value("peripherals", "the input feed_stop is off", status="feed_stopped")
    own_feed: bool = _value("follow", "the override of feeds does not count: M49, M50 P0", status="own_feed")
    inputs: int = _value("peripherals", "bit n of the machine file's [io], 1 = on", code="Q")
    outputs: int = _value("peripherals", "likewise", code="Q")
    analogue: tuple[float, ...] = _value(
        "peripherals", "analogue outputs in the order of E, as M67 and M68 said them", many=ANALOGUE
    )
    jogging: bool = _value("jogging.active", "a jog moves, or is coming to rest")
    away: bool = _value("jogging", "jogged off the place of the hold; RESUME must wait")
    probing: int = _value(
        "probing.phase", "0 none, 1 about to begin, 2 on its way, 3 touched and not told yet, 4 at its end"
    )
    probings: int = _value("probing.count", "probings that have come to their end")
    probed: int = _value("probing.came", "what came of the last: 1 touched, 2 not")
    touch: tuple[float, ...] = _value("probing", "where the axes were then", "mm, rad", many=EACH_AXIS)
    answers: tuple[int, ...] = _value("answers.ring", "to the last requests, see ``came_of``", many=ANSWERS)

    def is_on(self, switch: Request) -> bool:
        """Whether the operator has switched that on."""
        return self.switched & SWITCHED[switch].bit != 0

    @property
    def feed_share(self) -> float:
        """Of the programmed feed of the motion under the clock, that override and adaptive feed leave."""
        adaptive = self.adaptive_share if self.adaptive_on else 1.0
        return 1.0 if self.own_feed else self.override * adaptive

    def came_of(self, number: int) -> tuple[Outcome, Fault]:
        """What came of the request of that number, and the interlock that forbade it; see ``Outcome``."""
        for one in self.answers:
            asked, came, why = outcome(one)
            if asked == number:
                return came, Fault(why)
        return Outcome.NONE, Fault.NONE

    def has_taken(self, number: int) -> bool:
        """Whether the request of that number has come to the tick; numbers of one sender rise."""
        of_plan = number >= PLAN_IDS
        taken = (one >> 16 for one in self.answers)
        return any(asked >= number and (asked >= PLAN_IDS) is of_plan for asked in taken)


class DriveRow(NamedTuple):
    """What the status tells of one drive, as the service hears it on the bus."""

    axis: Annotated[str, "name of its axis"]
    node: Annotated[int, "its number on the bus"]
    bus: Annotated[str, "by the machine file"]
    state: Annotated[str, "of CiA 402, by its statusword"]
    cyclic_mode: Annotated[str, "in which it follows setpoints"]
    statusword: Annotated[int | None, "6041h as it came last"]
    error: Annotated[Message | None, "its last emergency"]
    heartbeat_age_s: Annotated[float | None, "since it showed life"]
    emcy: Annotated[int | None, "code of its last emergency"]
    homing: Annotated[bool, "it was asked to home and has not done it yet"]
    heard: Annotated[bool, "within the time after which the bus takes a node for dead"]
    malformed: Annotated[int, "frames of a wrong length that came from it so far"]
    missed_setpoints: Annotated[int | None, "that it did not take with their SYNC; null: it does not tell"]
    overdue_setpoints: Annotated[int, "times that it has missed them for too long (emergency 8250h)"]
    temperature_c: Annotated[float | None, "only of drives that tell it; as told last"]
    load_off: Annotated[
        float | None, "of axes with load_encoder: that less the motor's since homing, mm, deg"
    ]


class Shown(NamedTuple):
    """Where and how a value is shown outside."""

    name: str
    unit: str
    factor: float

    @classmethod
    def of(cls, said: str) -> Shown | None:
        """As a declaration says it."""
        name, _, rest = said.partition(" ")
        unit, _, factor = rest.partition(" ")
        return cls(name, unit, float(factor or 1.0)) if name else None


class Field(NamedTuple):
    """One value of the live state as it is declared."""

    name: str
    type: Any  # of one: int, float, bool or an enum
    code: str  # of ``struct``
    value: Value

    @property
    def many(self) -> int:
        """Places that it takes in the layout."""
        return MAX_AXES if self.is_of_axes else self.value.many

    @property
    def is_of_axes(self) -> bool:
        return self.value.many == EACH_AXIS

    @property
    def part(self) -> str:
        return self.value.owner.partition(".")[0]

    @property
    def attribute(self) -> str:
        return self.value.owner.partition(".")[2] or self.name

    @property
    def status(self) -> Shown | None:
        return Shown.of(self.value.status)

    @property
    def signal(self) -> Shown | None:
        return Shown.of(self.value.signal)

    @property
    def columns(self) -> tuple[str, ...]:
        name, many = self.value.column, self.many
        return (name,) if many == 1 else tuple(f"{name}_{i}" for i in range(many))


_CODES = {bool: "?", float: "d"}  # of ``struct``; all others are whole numbers


def _declared() -> Iterator[Field]:
    hints = get_type_hints(Snapshot)
    for name, value in Snapshot._field_defaults.items():
        kind = hints[name] if value.many == 1 else get_args(hints[name])[0]
        yield Field(name, kind, value.code or _CODES.get(kind, "q"), value)


FIELDS = tuple(_declared())
Snapshot.__new__.__defaults__ = None  # they have been read: a value has no default
OWNERS = tuple(sorted({field.part for field in FIELDS}))  # of the tick, that write
LAYOUT = struct.Struct("<" + "".join(f"{field.many}{field.code}" for field in FIELDS))
ROW = tuple(column for field in FIELDS if field.value.column for column in field.columns)
COLUMN = {name: i for i, name in enumerate(ROW)}

_IN_STATUS = [(field.name, shown) for field in FIELDS if (shown := field.status) is not None]
SIGNALS = {  # of the scope, that are columns; by their names
    signal.name: (signal.unit, field.columns[0], signal.factor)
    for field in FIELDS
    if (signal := field.signal) is not None
}


def _written(axes: int) -> str:
    """A function that takes the parts of the tick and gives the flat values."""
    return f"lambda {', '.join(OWNERS)}: ({', '.join(_written_as(field, axes) for field in FIELDS)})"


def _written_as(field: Field, axes: int) -> str:
    left = ", 0" * (MAX_AXES - axes) * field.is_of_axes
    if field.part == DRIVES:
        return ", ".join(f"{DRIVES}[{i}].{field.attribute}" for i in range(axes)) + left
    return f"{'*' * (field.many > 1)}{field.part}.{field.attribute}{left}"


def _read(axes: int) -> str:
    """A function that takes the flat values and gives the snapshot."""
    values, at = [], 0
    for field in FIELDS:
        end = at + (axes if field.is_of_axes else field.many)
        one = f"v[{at}]" if field.many == 1 else f"v[{at}:{end}]"
        values.append(f"{field.type.__name__}[{one}]" if issubclass(field.type, Enum) else one)
        at += field.many
    return f"lambda v: Snapshot({', '.join(values)})"


def _compiled(source: str) -> Any:
    enums = {f.type.__name__: {one.value: one for one in f.type} for f in FIELDS if issubclass(f.type, Enum)}
    return eval(source, {"Snapshot": Snapshot, **enums})


@cache
def gather(axes: int) -> Callable[..., Flat]:
    """Of a machine of so many axes: takes the parts of the tick in the order of ``OWNERS``."""
    return _compiled(_written(axes))  # type: ignore[no-any-return]


@cache
def snapshot_of(axes: int) -> Callable[[Flat], Snapshot]:
    """Of a machine of so many axes: takes the flat values."""
    return _compiled(_read(axes))  # type: ignore[no-any-return]


def flat(now: Snapshot) -> Flat:
    """The values of a snapshot as they are written; what a test makes up, for instance."""
    left = (0,) * (MAX_AXES - len(now.joints))
    rows = zip(FIELDS, now, strict=True)
    each = ((*value, *left * f.is_of_axes) if isinstance(value, tuple) else (value,) for f, value in rows)
    return tuple(itertools.chain.from_iterable(each))


def again(values: Flat) -> Flat:
    """The values of the next tick, where nothing else has changed; compiled, its number would be a float."""
    return (values[0] + 1, *values[1:])


def blank(axes: int = MAX_AXES) -> Snapshot:
    """In place of the first snapshot: nothing is on, and no axis has found its zero."""
    return snapshot_of(axes)(LAYOUT.unpack(bytes(LAYOUT.size)))


def of_axes(column: str, axes: int) -> slice:
    """The columns of so many axes in the recorder's row, by the name that they share."""
    first = COLUMN[f"{column}_0"]
    return slice(first, first + axes)


def status_values(now: Snapshot) -> dict[str, Any]:
    """The fields of the status that are values of a snapshot, as JSON has them."""
    found: dict[str, Any] = {}
    for name, shown in _IN_STATUS:
        group, _, key = shown.name.rpartition(".")
        place = found.setdefault(group, {}) if group else found
        place[key] = _plain(getattr(now, name), shown.factor)
    return found | {switch.name: bool(now.switched & switch.bit) for switch in SWITCHES}


def _plain(value: Any, factor: float) -> Any:
    if isinstance(value, Enum):
        return None if value.name == "NONE" else value.name
    return value if factor == 1.0 else value * factor


def markdown() -> str:
    """The table in README.md, a line per value."""
    head = ("value", "type", "unit", "written by", "column", "status", "signal", "meaning")
    return "".join(f"| {' | '.join(row)} |\n" for row in (head, ("---",) * len(head), *map(_line, FIELDS)))


def _line(field: Field) -> tuple[str, ...]:
    many, value = field.many, field.value
    count = "axes x " if field.is_of_axes else f"{many} x " * (many > 1)
    kind = f"{count}{field.type.__name__}"
    column = f"{value.column}_0 ..." if many > 1 and value.column else value.column
    shown = (" ".join(one[:2]).strip() if one else "" for one in (field.status, field.signal))
    owner = f"{field.part}.{field.attribute}"
    return field.name, kind, value.unit, owner, column, *shown, value.meaning.replace("``", "")
