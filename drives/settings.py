"""What the bus side must know about a machine, as frozen values in drive counts.

Nothing here knows millimetres or degrees: the controller converts once, when it
makes these from its machine file. They are read only, so the tick, the
commissioning and the simulated drives may share them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from drives import pdo
from drives.pdo import INT32_MAX as INT32_MAX
from drives.pdo import INT32_MIN as INT32_MIN
from drives.profile import GENERIC, Override, Profile
from drives.text_file import Source

MODE_EVERY_MS = 50  # a drive tells its mode when it changes, and so often where it can
TEMPERATURE_EVERY_MS = 500  # a drive tells its temperature at most so often


ADDITIONAL_POSITION = 0x60E4  # of a second encoder (CiA 402-2)
DEMAND, OFF_DEMAND = 0x60FC, 0x60F4  # what a drive tells of the setpoint that it goes by


@dataclass(frozen=True, slots=True)
class BusSettings:
    """One CAN bus: how to open it and how fast it is (bit/s; 0 = virtual without bit timing)."""

    name: str
    interface: str  # "virtual", "socketcan" or a python-can interface name
    channel: str  # path of the hub's socket, "can0", or the adapter's channel
    bit_rate: int


@dataclass(frozen=True, slots=True)
class FollowingWindow:
    """How far a drive may be from what it was told, the bus' latency counted: rest + speed_s * speed.

    ``ticks`` feedbacks in a row beyond it are a following error. ``tightens``: the part by speed is a
    default and may be narrowed by what is measured.
    """

    rest_counts: float = math.inf  # inf: nothing is compared
    speed_s: float = 0.0
    in_position_counts: float = math.inf  # at rest: motion has arrived
    ticks: int = 3
    velocity_counts_s: float = 0.0  # the axis' largest
    tightens: bool = False


@dataclass(frozen=True, slots=True)
class NodeSettings:
    """One CiA 402 drive: where it is and what is written to it at commissioning."""

    name: str  # of the axis, for sentences
    bus: str  # BusSettings.name
    node: int  # CANopen node id, 1 .. 126
    eds: Source  # its electronic data sheet
    counts_min: int = INT32_MIN  # software limits, 607Dh
    counts_max: int = INT32_MAX
    following_error_counts: int = 0xFFFF_FFFF  # 6065h; FFFFFFFFh switches the check off
    homing_method: int = 37  # 6098h
    homing_position_counts: int = 0  # position at the homed point, 607Ch
    period_s: float = 0.002  # interpolation time, 60C2h; equals the tick
    brake: bool = False  # a gravity axis: braked before it is disabled
    profile: Profile = GENERIC
    feedback_every: int = 1  # transmission type of the feedback's TPDO: every so many SYNCs
    probe_tpdo: int = 0  # number of the event-driven TPDO with 60B9h and 60BAh; 0 = no touch probe
    temperature_tpdo: int = 0  # number of the TPDO with the drive's temperature; 0 = it tells none
    temperature_entry: int = 0  # what is mapped into it: index << 16 | sub << 8 | bits
    demand_tpdo: int = 0  # number of the TPDO with the setpoint that the drive goes by; 0 = it tells none
    demand_index: int = DEMAND  # what is mapped into it: that setpoint, or 60F4h, by which it is off it
    demand_every: int = 1  # every so many SYNCs
    demand_per_count: float = 1.0  # of that object's unit
    load_tpdo: int = 0  # number of the TPDO with the encoder at the load; 0 = there is none
    load_node: int = 0  # of an encoder that is a node of its own, and not ours to set up; 0 = the drive tells
    load_entry: int = 0  # what is mapped into it: index << 16 | sub << 8 | 32
    load_every: int = 1  # every so many SYNCs
    load_per_count: float = 1.0  # of that encoder's counts in one of the drive's, signed
    most_load_off_counts: float = math.inf  # between the two, since homing
    setpoint_deadline_s: float = 0.0  # 1400h:05; 0 = as for our heartbeat
    feed_forward: bool = False  # the velocity goes with the target (60B1h); the controlword apart
    enable_group: int = 0  # drives are enabled group by group, lowest first, and disabled in reverse
    unsupervised: bool = False  # the operator accepts a drive that does not notice a dead controller
    serial: int = 0  # 1018h:04 of the very drive that belongs here; 0 = any of its kind
    absolute: bool = False  # the encoder knows its position after power-on; the axis is not homed
    homing_fast_counts_s: int = 0  # 6099h:01; 0 = left as the drive has it
    homing_slow_counts_s: int = 0  # 6099h:02
    homing_acceleration_counts_s2: int = 0  # 609Ah
    following: FollowingWindow = FollowingWindow()  # the controller's own, beside the drive's 6065h
    velocity_counts_s: float = 0.0  # largest of the axis; 0 = not known: how it stops is left to the drive
    acceleration_counts_s2: float = 0.0
    quick_stop_counts_s2: float = 0.0  # the machine file's own word; 0 = the largest acceleration
    most_quick_stop_s: float = 3.0  # a drive that takes longer to stop by itself is refused
    rotary: bool = False
    counts_per_si: float = 0.0  # counts per metre, or radian of a rotary; 0 = not known
    velocity_unit_counts_s: float = 0.0  # the machine file's own word; 0 = the drive says what its units are
    acceleration_unit_counts_s2: float = 0.0
    velocity_units: float = 1.0  # units of 60B1h in one count per second, until commissioning has told
    overrides: tuple[Override, ...] = ()  # where its data sheet is wrong, beside the profile's

    @property
    def mode_tpdo(self) -> int:
        """Number of the TPDO with the mode of operation display (6061h): the first that is free; 0 = none."""
        return next((number for number in range(1, 5) if number not in self.taken_tpdos), 0)

    @property
    def load_can_id(self) -> int:
        """Of the frames with the encoder at the load."""
        return pdo.tpdo(self.load_tpdo, self.load_node or self.node)

    @property
    def taken_tpdos(self) -> tuple[int, ...]:
        """Numbers of the TPDOs that something goes by, but for the mode; 0 of what it does not tell."""
        load_tpdo = 0 if self.load_node else self.load_tpdo
        asked = (self.probe_tpdo, self.temperature_tpdo, self.demand_tpdo, load_tpdo)
        return (self.profile.tpdo, *asked)


@dataclass(frozen=True, slots=True)
class SpindleSettings:
    """A spindle drive in a velocity mode (CiA 402), not part of the path.

    Layout: RPDO ``profile.rpdo`` = 6040h u16 + 60FFh i32, type 255, sent on change and once
    a heartbeat; TPDO ``profile.tpdo`` = 6041h u16 + 606Ch i32, type ``feedback_every``. Where axes follow
    it, TPDO ``position_tpdo`` = its position i32 (and 6077h i16), type 1: sampled with those of the axes.
    """

    name: str
    bus: str
    node: int
    eds: Source
    counts_per_rev: float  # position units of a revolution; its sign is the direction of M3
    mode: int = 9  # 6060h: 9 cyclic synchronous velocity, 3 profile velocity
    at_speed_share: float = 0.05  # at speed within this share of the wanted one
    profile: Profile = GENERIC
    feedback_every: int = 10  # SYNCs from one actual speed to the next
    acceleration_rev_s2: float = 50.0  # of the wanted speed in mode 9; in mode 3 the drive has its own ramp
    most_rev_min: float = 0.0  # fastest that is asked for; 0 = not known
    velocity_unit_counts_s: float = 0.0  # as of an axis
    acceleration_unit_counts_s2: float = 0.0
    velocity_units: float = 1.0  # units of 60FFh and 606Ch in one count per second, as of an axis
    position_tpdo: int = 0  # number of the TPDO with its position, at every SYNC; 0 = it tells none
    position_entry: int = 0x6064_0020  # what is mapped into it: index << 16 | sub << 8 | bits
    position_per_rev: float = 0.0  # what that counts in a revolution; its sign is the direction of M3
    tells_load: bool = False  # 6077h goes beside it
    unsupervised: bool = False  # as of an axis
    overrides: tuple[Override, ...] = ()


@dataclass(frozen=True, slots=True)
class IoSettings:
    """A CiA 401 node: digital inputs 6000h by TPDO 1 on change, digital outputs 6200h by RPDO 1.

    Both type 255, ``inputs`` and ``outputs`` bytes long. The TPDO's event timer (1800h:05)
    repeats the inputs every ``inputs_every_s``, so that a change whose frame was lost is
    not lost; the RPDO goes out on change and once a heartbeat. Analogue outputs 6411h, and an
    object of a spindle's speed, where the machine has any, are RPDO 2, likewise.
    """

    name: str
    bus: str
    node: int
    eds: Source
    inputs: int = 1  # bytes
    outputs: int = 1
    analogue: tuple[int, ...] = ()  # counts of 6411h:01, :02 ... when all is off; none: no such outputs
    speed_entry: int = 0  # an object behind them, of a spindle: index << 16 | sub << 8 | bits; 0 = none
    speed_idle: int = 0  # its counts when all is off
    feedback_entry: int = 0  # what it measures of the spindle's speed; 0 = nothing
    feedback_tpdo: int = 2  # number of the TPDO with that, repeated every ``feedback_every_s``
    feedback_every_s: float = 0.02
    heartbeat_s: float = 0.05
    inputs_every_s: float = 0.05  # 0: the node has no event timer; the age of inputs is not judged then
    unsupervised: bool = False  # as of an axis
    overrides: tuple[Override, ...] = ()


@dataclass(frozen=True, slots=True)
class MasterSettings:
    """The controller as a CANopen node: heartbeats both ways, and the period of its SYNC."""

    node_id: int = 127
    heartbeat_s: float = 0.05  # produced by us, and asked of the drives (1017h)
    consumer_s: float = 0.2  # silence after which either side takes the other for dead (1016h)
    period_s: float = 0.002
