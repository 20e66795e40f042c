"""How a family of drives is commissioned and driven: what its data sheet does not say by itself.

A profile holds facts about a product (which supervision it has, which periods it takes,
which option codes), never about a machine. ``config/drives/*.toml`` are the shipped ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from drives.text_file import Source

# Methods of CiA 402-2; 15, 16, 31, 32 are reserved, 36 was never given.
STANDARD_HOMING = (*range(1, 15), *range(17, 31), 33, 34, 35, 37)


class CyclicMode(Enum):
    """Mode of operation in which setpoints come (CiA 402, 6060h)."""

    CSP = 8  # cyclic synchronous position
    IP = 7  # interpolated position, submode 0 (linear), for drives without CSP


class Supervision(Enum):
    """How a drive notices that the controller is silent."""

    HEARTBEAT = "heartbeat"  # consumer heartbeat time, 1016h
    GUARDING = "guarding"  # node guarding: 100Ch, 100Dh
    NONE = "none"  # neither: the machine file must accept that with unsupervised = true


@dataclass(frozen=True, slots=True)
class Write:
    """One object more that a drive is told at commissioning."""

    index: int
    sub: int
    value: int
    why: str  # completes "node 3: object 2xxxh: ..." in a sentence; a Key (``texts``): of the catalogue


@dataclass(frozen=True, slots=True)
class Encoder:
    """An object of the maker's that tells the counts of a revolution of the motor."""

    index: int
    sub: int
    times: int = 1  # counts per what it tells: 4 where those are pulses


@dataclass(frozen=True, slots=True)
class Override:
    """What a drive says of an entry that its data sheet is wrong about; None = the sheet's word stays."""

    index: int
    sub: int
    reason: str  # who says so, for the person who commissions it; a Key as of a Write
    low: int | None = None
    high: int | None = None
    access: str | None = None  # as in a data sheet: "ro", "rw", ...
    default: int | None = None
    mappable: bool | None = None
    data_type: int | None = None  # CiA 301, 7.4.7.1; with it, an entry that the sheet lacks


@dataclass(frozen=True, slots=True)
class Profile:
    """A family of CiA 402 drives."""

    name: str = "generic"
    eds: Source = ""  # the data sheet that comes with it; "" = the machine file names one
    mode: CyclicMode = CyclicMode.CSP
    rpdo: int = 1  # number (1 .. 4) of the RPDO that carries controlword and target
    tpdo: int = 1  # number of the TPDO that carries statusword and actual position
    command_rpdo: int = 2  # with feed-forward: the event-driven RPDO that carries the controlword
    takes_feed_forward: bool = True  # 60B1h can be mapped beside the target
    most_feedback_every: int = 240  # largest transmission type of the TPDO that works
    period_exponents: tuple[int, ...] = (-3, -4, -5, -6)  # what 60C2h:02 takes
    period_step_s: float = 0.0001  # periods must be multiples of this
    period_min_s: float = 0.0005
    period_max_s: float = 0.02
    supervision: Supervision = Supervision.HEARTBEAT
    quick_stop_code: int | None = 2  # 605Ah; 2 = ramp, then off; 6 = ramp, then stay; None: no such object
    abort_code: int | None = 3  # 6007h; 3 = quick stop; None: the drive has no such object
    error_behaviour: int | None = None  # 1029h:01; None = left alone
    most_following_error: int = 0xFFFF_FFFF  # largest window that 6065h takes
    homing_methods: tuple[int, ...] = STANDARD_HOMING  # what 6098h takes; 0 = none: absolute encoder
    home_offset: int | None = 0x607C  # object that holds the position at the homed point; None: there is none
    vendor: int | None = None  # 1018h:01 and :02, where the data sheet does not say them
    product: int | None = None
    optional: tuple[int, ...] = ()  # objects (index) that may be missing without harm
    writes: tuple[Write, ...] = ()
    velocity_unit_counts_s: float = 0.0  # one unit of velocity, where 60A9h is 0 or missing; 0 = 6096h says
    acceleration_unit_counts_s2: float = 0.0
    revolution: str = "motor"  # of which 60A9h speaks, before or behind 6091h: "motor" or "shaft"
    encoder_resolution: tuple[Encoder, ...] = ()  # instead of 608Fh; the first that is not 0
    overrides: tuple[Override, ...] = ()  # where the family's data sheets are wrong
    quirks: tuple[str, ...] = ()  # sentences for the person who commissions it; Keys as of a Write


GENERIC = Profile()
