"""The spindle of a machine: its values, each with the key of ``[spindle]`` that fills it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial

from controller.machine import drive_profiles, inverter_profiles
from controller.machine.axes import (
    BUS,
    NODE,
    OF_IO,
    OVERRIDES,
    PROFILE,
    SHEET,
    UNSUPERVISED,
    USUAL_SHARE,
    Stopping,
)
from controller.machine.declaration import in_order, key, same_table, shared, spellings
from controller.machine.equipment import INT16, MAX_CHANNELS, listed
from controller.machine.forms import FLAG, NAMES, POSITIVE, TEXT, Choice, Integer, Number, Own, Rows, Sub
from controller.machine.reading import Reading, Rules
from controller.messages import Key
from drives.profile import Override
from drives.settings import INT32_MAX, INT32_MIN
from drives.text_file import Source

WAYS = ("drive", "inverter", "modbus", "hand")
FRAMES = ("8N1", "8N2", "8E1", "8O1")
ANALOGUE_OUTPUT, ANALOGUE_INPUT = 0x6411, 0x6401  # 16 bits each (CiA 401)
INT32 = INT32_MIN, INT32_MAX
MODES = {"csv": 9, "pv": 3}
TAPPING_REV_S2 = 50.0  # along a thread, where the file says nothing


@dataclass(frozen=True, slots=True)
class SpindlePosition:
    """The spindle's angle, told at every SYNC with those of the axes: what tapping follows."""

    counts_per_rev: float = key(
        Number(),
        "of what it tells; its sign is the direction of M3; left out: as above",
        silent=lambda here: here.above["counts_per_rev"],
        left_out="as of the spindle",
    )
    index: int = key(Integer(0x2000, 0x6FFF), "object of the position, 32 bits", default=0x6064)
    sub: int = key(Integer(0, 254), "its sub-index", default=0)
    tpdo: int = key(Integer(1, 4), "number of the one that takes it, at every SYNC", default=2)
    load: bool = key(FLAG, "the torque (6077h) goes beside it", default=False)
    gain_per_s: float = key(
        Number(1.0, 50.0), "of the loop that leads the spindle along a thread", default=10.0
    )
    acceleration_rev_s2: float = key(
        POSITIVE,
        "at most along a thread, in both directions; left out: as above",
        default=TAPPING_REV_S2,
        silent=lambda here: min(here.above["acceleration_rev_s2"], TAPPING_REV_S2),
        left_out=f"as of the spindle, {TAPPING_REV_S2:g} at most",
    )
    most_lag_rev: float = key(
        Number(0.01, 10.0), "behind the thread by more: held, with a fault", default=0.5
    )


@dataclass(frozen=True, slots=True)
class AdaptiveFeed:
    """The load of the spindle leads the feed; loads are shares of its rated torque. See ``tick.adaptive``."""

    target: float = key(
        Number(5.0, 150.0),
        "of the rated torque (6076h) that the feed is to keep",
        name="load_percent",
        per=100.0,
        default=0.6,
        needed=True,
    )
    min_share: float = key(Number(0.05, 1.0), "of F, below which the feed is not lowered", default=0.2)
    max_share: float = key(
        Number(1.0, 1.5),
        "of F; above 1 a light cut is made faster than F says, within the limits of the axes",
        default=1.0,
    )
    fall_s: float = key(Number(0.1, 10.0), "time constant of a share that falls", default=0.3)
    rise_s: float = key(Number(0.1, 100.0), "of one that rises, not shorter", default=3.0)
    overload: float = key(
        Number(10.0, 400.0),
        "of the rated torque: so high for `overload_s` is a dull or broken cutter: held",
        name="overload_percent",
        per=100.0,
        default=1.2,
        needed=True,
    )
    overload_s: float = key(Number(0.0, 10.0), "see `overload_percent`", default=0.5)


@dataclass(frozen=True, slots=True)
class SpeedFeedback:
    """What the I/O node measures of a spindle that an inverter turns: by a voltage, or by pulses."""

    channel: int = key(Integer(0, 254), "sub-index of the object that the node measures")
    index: int = key(Integer(0x2000, 0x6FFF), "of that object: 6401h, or a counter's", default=ANALOGUE_INPUT)
    bits: int = key(Integer(16, 32), "its size: 16 or 32", default=16)
    tpdo: int = key(Integer(2, 4), "number of the one that takes it", default=2)
    zero_counts: int = key(Integer(*INT16), "what it measures at a standstill", default=0)
    full_counts: int = key(Integer(*INT16), "what it measures at `full_rev_min`", default=INT16[1])
    pulses_per_rev: float = key(
        Number(0.0, 1e6), "of an object that counts pulses, upwards; 0: it measures a voltage", default=0.0
    )


@dataclass(frozen=True, slots=True)
class Inverter:
    """An inverter on the I/O node: an analogue output says how fast, ``spindle_run`` whether it turns."""

    channel: int = key(Integer(0, 254), "sub-index of the object that says how fast")
    full_rev_min: float = key(
        POSITIVE,
        "at which it turns with `full_counts`, as measured (`directrix calibrate spindle`)",
        silent=lambda here: fastest(here.above),
        left_out="as `max_rev_min`, or the fastest of the gears",
    )
    index: int = key(
        Integer(0x2000, 0x6FFF),
        "of that object: 6411h, or that of a PWM or a frequency",
        default=ANALOGUE_OUTPUT,
    )
    bits: int = key(Integer(16, 32), "its size: 16 or 32", default=16)
    zero_counts: int = key(Integer(*INT32), "what it is told to stand", default=0)
    full_counts: int = key(Integer(*INT32), "what it is told for `full_rev_min`", default=INT16[1])
    signed: bool = key(
        FLAG,
        "counts beyond `zero_counts` turn it counter-clockwise (-10 to 10 V); else `spindle_reverse` says so",
        default=False,
    )
    settle_s: float = key(
        Number(0.0, 60.0),
        "after its ramp (`acceleration_rev_s2`), where no input spindle_at_speed says that it is there",
        default=0.5,
    )
    feedback: SpeedFeedback | None = key(
        Sub(SpeedFeedback), "what the node measures of its speed: that counts before all else", default=None
    )

    def counts(self, rev_min: float) -> int:
        """What the output is told for a speed; where it is not ``signed``, that of either direction."""
        speed = rev_min if self.signed else abs(rev_min)
        return round(self.zero_counts + speed / self.full_rev_min * (self.full_counts - self.zero_counts))


def _inverter_profile(here: Reading, _: str) -> Source:
    here.top["file"]  # which may be refused
    found: Source = here.file.files.inverter(here.table)
    return found


@dataclass(frozen=True, slots=True)
class Modbus:
    """An inverter on a serial line (RS-485, Modbus RTU), which a process of its own asks and orders."""

    port: str = key(TEXT, "the serial port, best by its name in /dev/serial/by-id")
    profile: Source = key(
        Own(_inverter_profile, TEXT.allowed(None), TEXT.schema()),
        "its register map: one of `config/inverters`, or a file beside the machine file",
    )
    station: int = key(Integer(1, 247), "its address on the line", default=1)
    baud: int = key(Integer(4800, 115_200), "as set in the inverter", default=9600)
    frame: str = key(Choice(FRAMES), "bits, parity and stop bits, as set in the inverter", default="8N1")
    rev_min_per_hz: float = key(
        POSITIVE, "speed of the spindle at 1 Hz: 60 of a motor with one pole pair", default=60.0
    )
    silent_s: float = key(
        Number(0.5, 10.0),
        "nothing heard of it for so long while it is to turn: stopped, with a fault",
        default=1.0,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Gear:
    """One of several gears between what turns the spindle and the spindle: shifted at a standstill."""

    low_rev_min: float = key(Number(0.0), "least S in it", default=0.0)
    high_rev_min: float = key(POSITIVE, "largest S in it")
    turns: float = key(POSITIVE, "of what turns it, in one turn of the spindle")
    on: tuple[str, ...] = key(NAMES, "outputs of `[io]` that are switched on to shift into it", default=())
    off: tuple[str, ...] = key(NAMES, "outputs of `[io]` that are switched off", default=())
    input: str = key(TEXT, "of `[io]`; 1: it is in", may_be=OF_IO)
    within_s: float = key(Number(0.1, 60.0), "not in by then: held, with a fault", default=10.0)
    code: str = key(
        Choice(("", "M41", "M42", "M43", "M44")),
        "that shifts into it; with none of any gear S chooses: the one that is in, or the first that has it",
        default="",
    )

    @property
    def usual_s(self) -> float:
        """What a shift is expected to take, s."""
        return USUAL_SHARE * self.within_s

    def holds(self, rev_min: float) -> bool:
        """Whether S (1/min) is one of this gear's."""
        return self.low_rev_min <= rev_min <= self.high_rev_min

    def contradicts(self, other: Gear) -> bool:
        """Whether no outputs are those of both."""
        return not {*self.on}.isdisjoint(other.off) or not {*self.off}.isdisjoint(other.on)


def fastest(spindle: Spindle | Reading) -> float:
    """What turns a spindle turns so fast at most (1/min)."""
    has = spindle.__getitem__ if isinstance(spindle, Reading) else partial(getattr, spindle)
    return float(max((one.turns * one.high_rev_min for one in has("gears")), default=has("max_rev_min")))


def _driven(here: Reading) -> bool:
    return bool(here["by"] == "drive")


def _turned(here: Reading) -> bool:
    return bool(here["by"] != "hand")


def _inverted(here: Reading) -> bool:
    return bool(here["by"] == "inverter")


def _by_modbus(here: Reading) -> bool:
    return bool(here["by"] == "modbus")


def _heard(here: Reading) -> bool:
    """Whether somebody reports how it turns."""
    if _inverted(here):
        return here["inverter"] is not None and here["inverter"].feedback is not None
    return bool(here["by"] in ("drive", "modbus"))


def _left_out(here: Reading) -> str:
    """What a file means that is silent about ``by``: any key of a drive means one."""
    for way in ("inverter", "modbus"):
        if here.table.holds(way):
            return way
    keys = (one for one in in_order(Spindle) if one.only in (_driven, _turned))
    of_drive = {name for one in keys for name in one.spelled} | spellings(Stopping)
    return "drive" if any(here.table.holds(name) for name in of_drive) else "hand"


@dataclass(frozen=True, slots=True)
class Spindle:
    """The spindle as programs need it, and what turns it."""

    max_rev_min: float = key(POSITIVE, "largest S", usual=(50.0, 300_000.0))
    by: str = key(
        Choice(WAYS),
        "what turns it: a drive of its own (60FFh), an inverter on `[io]` or on a serial line, or the hand "
        "of the operator, who is asked wherever a program turns it otherwise than before",
        default="hand",
        silent=_left_out,
        left_out='"inverter" or "modbus" where its table is there, "drive" with a key of one, else "hand"',
    )
    by_hand_s: float = key(
        Number(0.0, 600.0),
        "what it takes the operator, where it is by hand; counted in `waits_s` of a check",
        default=10.0,
    )
    bus: str = shared(BUS, default="", only=_driven)
    node: int = shared(NODE, default=0, needed=True, only=_driven)
    profile: Source = key(PROFILE, "of the drive, as of an axis", default="simulated", only=_driven)
    counts_per_rev: float = key(
        Number(), "of its encoder; its sign is the direction of M3", default=0.0, needed=True, only=_driven
    )
    mode: int = key(Choice(MODES), "60FFh in mode 9 (csv) or 3 (pv)", default=9, only=_driven)
    at_speed_share: float = key(
        Number(0.001, 0.5), "at speed within this share of the wanted one", default=0.05, only=_heard
    )
    spin_up_s: float = key(
        Number(0.1, 120.0),
        "not at speed, or standing, by then: held, with a fault",
        default=10.0,
        only=_turned,
    )
    acceleration_rev_s2: float = key(
        POSITIVE,
        "at which it is led to its speed in mode 9, or which the inverter has as its ramp",
        default=50.0,
        only=_turned,
        usual=(0.5, 5000.0),
    )
    eds: Source = shared(SHEET, default="", only=_driven)
    stopping: Stopping = same_table(Stopping, Stopping(), _driven)  # its units alone
    unsupervised: bool = shared(UNSUPERVISED, only=_driven)
    overrides: tuple[Override, ...] = shared(OVERRIDES, only=_driven)
    position: SpindlePosition | None = key(  # None: nothing is tied to its angle
        Sub(SpindlePosition),
        "its angle at every SYNC: G33, G33.1, G84 and G74 follow it",
        default=None,
        only=_driven,
    )
    inverter: Inverter | None = key(
        Sub(Inverter),
        "how an inverter is told its speed; of `[io]` it has the output spindle_run, and where they are "
        "there spindle_reverse, spindle_reset and the inputs spindle_ready and spindle_at_speed",
        default=None,
        needed=True,
        only=_inverted,
    )
    modbus: Modbus | None = key(
        Sub(Modbus), "how an inverter on a serial line is reached", default=None, needed=True, only=_by_modbus
    )
    gears: tuple[Gear, ...] = key(
        Rows(Gear), "gears, each with its speeds", name="gear", default=(), only=_turned
    )
    adaptive: AdaptiveFeed | None = key(  # None: M52 P1 is refused
        Sub(AdaptiveFeed),
        "its load leads the feed under M52 P1; left out: M52 P1 is refused",
        default=None,
        only=_driven,
    )

    @property
    def is_driven(self) -> bool:
        """Whether the controller turns it."""
        return self.by in ("drive", "inverter", "modbus")

    @property
    def has_drive(self) -> bool:
        """Whether that is a drive of its own."""
        return self.by == "drive"

    @property
    def reports_speed(self) -> bool:
        """Whether somebody reports how it turns."""
        measured = self.inverter is not None and self.inverter.feedback is not None
        return self.by in ("drive", "modbus") or measured


def unasked(spindle: Spindle | None) -> Spindle:
    """The spindle of runs that were recorded before operators were asked: S is read, and nobody waits."""
    if spindle is None:
        return Spindle(math.inf, "")
    return spindle if spindle.is_driven else replace(spindle, by="")


def _check_speed(here: Reading) -> None:
    """The target is at most an int32 (60FFh), in counts per second where the drive has no other unit."""
    if not _driven(here):
        return
    if here["counts_per_rev"] == 0.0:
        here.table.refuse("counts_per_rev", "zero_encoder")
    most = INT32_MAX / abs(here["counts_per_rev"]) * 60.0
    if (speed := fastest(here)) > most:
        here.table.refuse("max_rev_min", "speed_fits", speed=speed, most=most)


def _check_inverter(here: Reading) -> None:
    """Every speed is one that the output can be told."""
    if here["full_counts"] == here["zero_counts"]:
        here.table.refuse("full_counts", "no_span")
    _check_bits(here)
    if here["index"] == ANALOGUE_OUTPUT and not 1 <= here["channel"] <= MAX_CHANNELS:
        here.table.refuse("channel", "no_analogue_channel", most=MAX_CHANNELS)
    size = here["bits"]
    least, most = INT16 if here["index"] == ANALOGUE_OUTPUT else (-(1 << size - 1), (1 << size) - 1)
    whole = here["full_counts"] - here["zero_counts"]
    share = fastest(here.above) / here["full_rev_min"] if here.above is not None else 1.0
    for sign in (1.0, -1.0) if here["signed"] else (1.0,):
        if not least <= round(here["zero_counts"] + sign * share * whole) <= most:
            here.table.refuse("full_counts", "speed_beyond_counts", least=least, most=most)


def _check_bits(here: Reading) -> None:
    if here["bits"] not in (16, 32):
        here.table.refuse("bits", "no_word")


def _check_measured(here: Reading) -> None:
    """What is measured tells one speed from another."""
    _check_bits(here)
    if not here["pulses_per_rev"] and here["full_counts"] == here["zero_counts"]:
        here.table.refuse("full_counts", "no_span")


def _check_highest(here: Reading) -> None:
    """Every speed is one that the set-point's register can be told."""
    profile = inverter_profiles.load(here["profile"])
    most = profile.highest_hz() * here["rev_min_per_hz"]
    if here.above is not None and fastest(here.above) > most:
        here.table.refuse("rev_min_per_hz", "speed_beyond_register", most=most)


def _check_gear(here: Reading) -> None:
    if here["high_rev_min"] <= here["low_rev_min"]:
        here.table.refuse("high_rev_min", "gear_range", low=here["low_rev_min"])


def check_gears(here: Reading) -> None:
    """Each has its own outputs, input and code, and none is beyond the spindle."""
    io, rows = here.top["io"], here.below.get("gear", ())
    switches = () if io is None else tuple((code, name) for code, name, _ in io.m_codes)
    taken = (*switches, *here.top.one_below("machine")["own_codes"])
    for n, row in enumerate(rows):
        for kind in ("on", "off"):
            if any(io is None or io.output(name) is None for name in row[kind]):
                row.table.refuse(kind, "no_output", allowed=listed(io, io.outputs if io else ()))
        if io is None or io.input(row["input"]) is None:
            row.table.refuse("input", "no_input", allowed=listed(io, io.inputs if io else ()))
        if row["code"] in dict(taken):
            row.table.refuse("code", "gear_code_taken")
        if row["high_rev_min"] > here["max_rev_min"]:
            row.table.refuse("high_rev_min", "gear_too_fast", most=here["max_rev_min"])
        for other in here["gears"][:n]:
            if row["code"] and row["code"] == other.code:
                row.table.refuse("code", "gear_code_twice")
            if not here["gears"][n].contradicts(other):
                row.table.refuse("input", "gears_alike", other=other.input)
    if here["gears"] and here["position"] is not None:
        here.table.refuse("position", "thread_of_gears")


def check_outputs(here: Reading) -> None:
    """What tells an inverter to turn is there, and its channel is nobody else's."""
    if here["by"] != "inverter":
        return
    io = here.top["io"]
    if io is None or io.output("spindle_run") is None:
        here.table.refuse("by", "no_spindle_run")
    own = here["inverter"].channel
    if here["inverter"].index == ANALOGUE_OUTPUT and any(out.channel == own for out in io.analogue_out):
        here.one_below("inverter").table.refuse("channel", "channel_twice", other=Key("file.an_output_of_io"))


def _check_mode(here: Reading) -> None:
    if here["position"] is not None and here["mode"] != MODES["csv"]:
        here.table.refuse("position", "thread_of_pv")


def _check_load(here: Reading) -> None:
    if here["adaptive"] is not None and (here["position"] is None or not here["position"].load):
        here.table.refuse("adaptive", "load_untold")


def _check_counts(here: Reading) -> None:
    if here["counts_per_rev"] == 0.0 and here.table.holds("counts_per_rev"):
        here.table.refuse("counts_per_rev", "zero_encoder")


def _check_tpdo(here: Reading) -> None:
    if here.above is not None and here["tpdo"] == drive_profiles.load(here.above["profile"]).tpdo:
        here.table.refuse("tpdo", "tpdo_taken")


def _check_rise(here: Reading) -> None:
    if here["rise_s"] < here["fall_s"]:
        here.table.refuse("rise_s", "rise_short", fall_s=here["fall_s"])


def _check_overload(here: Reading) -> None:
    if here["overload"] <= here["target"]:
        here.table.refuse("overload_percent", "overload_low", percent=100.0 * here["target"])


RULES: Mapping[type, Rules] = {
    Spindle: Rules(checks=(_check_speed, _check_mode, _check_load)),
    Inverter: Rules(checks=(_check_inverter,)),
    SpeedFeedback: Rules(checks=(_check_measured,)),
    Gear: Rules(checks=(_check_gear,)),
    Modbus: Rules(checks=(_check_highest,)),
    SpindlePosition: Rules(checks=(_check_counts, _check_tpdo)),
    AdaptiveFeed: Rules(checks=(_check_rise, _check_overload)),
}
