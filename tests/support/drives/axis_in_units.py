"""One axis on a simulated drive in units of its own, judged by its motor.

What is physical is written down here and nowhere else: increments of the encoder per turn of the motor, turns
of the motor per turn of the shaft, and millimetres or degrees per turn of the shaft. The machine file and the
drive's objects are made from it; the motor is converted back by it, and by nothing of ``drives``.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from support.drives.group_bench import EDS

from controller.machine import drive_profiles, machine_file, nodes
from drives import commission, pdo
from drives.arranged import Arranged
from drives.bench.simulated import Parameters, SimulatedDrive, family_sheet, rig
from drives.bench.simulated.dictionary import Abort, Code
from drives.cia402 import Wanted
from drives.cyclic.drive import Drive
from drives.cyclic.group import Group
from drives.settings import BusSettings, MasterSettings, NodeSettings

PERIOD_S = 0.002
SIGN = {0x00: 1, 0xC0: -1}
STANDS_TICKS = 20  # a servo that comes back from behind its goal passes a moment of rest
SHEETS = itertools.count()  # data sheets are read once by their path


@dataclass(frozen=True)
class Mechanics:
    """``lead``: mm, or degrees of a rotary, per turn of the shaft."""

    increments: int  # per turn of the motor
    gear: tuple[int, int]  # turns of the motor, for so many of the shaft
    lead: float
    rotary: bool = False

    @property
    def per_increment(self) -> float:
        """mm or degrees."""
        return self.lead * self.gear[1] / (self.gear[0] * self.increments)

    @property
    def per_turn(self) -> float:
        """mm or degrees of the axis per turn of the motor."""
        return self.lead * self.gear[1] / self.gear[0]


@dataclass(frozen=True)
class Axis:
    """What the machine file says of it, in mm or degrees."""

    counts: float  # per mm or degree, with its sign
    velocity: float
    acceleration: float
    homing: str = "method = 37"
    extra: tuple[str, ...] = ()  # lines of the axis' table
    general: tuple[str, ...] = ()  # lines of [machine]
    profile: str = "generic"


@dataclass
class Sheet:
    """The simulated drive's data sheet as another maker would have it."""

    values: dict[tuple[int, int], int] = field(default_factory=dict)  # as delivered
    missing: set[int] = field(default_factory=set)
    fixed: set[int] = field(default_factory=set)  # read only
    ranges: dict[int, tuple[int, int]] = field(default_factory=dict)
    refusing: set[int] = field(default_factory=set)  # by SDO abort
    added: dict[tuple[int, int], int] = field(default_factory=dict)  # objects of the maker's

    def write(self, path: Path, profile: str) -> Path:
        own = profile == "generic"
        text = Path(EDS).read_text("latin-1") if own else family_sheet.text(drive_profiles.load(profile))
        for (index, sub), value in self.values.items():
            if f"[{index:04X}]" not in text:
                continue
            text = _changed(text, _name(text, index, sub), DefaultValue=f"0x{value & 0xFFFFFFFF:X}")
        for index in self.fixed:
            text = _changed(text, f"{index:04X}", AccessType="ro")
        for index, (low, high) in self.ranges.items():
            text = _changed(text, f"{index:04X}", LowLimit=str(low), HighLimit=str(high))
        for index in self.missing:
            text = re.sub(rf"\[{index:04X}(?:sub[0-9A-F]+)?\]\r?\n(?:(?!\[).*\r?\n)*", "", text)
        for (index, sub), value in self.added.items():
            if f"[{index:04X}]" not in text:
                text += f"\n[{index:04X}]\nParameterName=maker\nObjectType=0x9\n"
                text += f"\n[{index:04X}sub0]\n{_entry(5, 'const', 8)}"
            text += f"\n[{index:04X}sub{sub:X}]\n{_entry(7, 'ro', value)}"
        path.write_text(text, "latin-1")
        return path


def _entry(kind: int, access: str, value: int) -> str:
    return (
        f"ParameterName=maker\nObjectType=0x7\nDataType={kind}\nAccessType={access}\nDefaultValue={value}\n"
    )


def _name(text: str, index: int, sub: int) -> str:
    return f"{index:04X}sub{sub:X}" if f"[{index:04X}sub{sub:X}]" in text else f"{index:04X}"


def _changed(text: str, section: str, **entries: str) -> str:
    head = f"[{section}]"
    begin = text.index(head)
    end = text.find("\n[", begin)
    body = text[begin : end if end > 0 else len(text)]
    for name, value in entries.items():
        body = re.sub(rf"(?m)^{name}=.*\r?\n?", "", body).rstrip("\r\n") + f"\n{name}={value}\n"
    return text[:begin] + body + (text[end:] if end > 0 else "")


def settings(axis: Axis, rotary: bool, eds: Path, folder: Path) -> tuple[NodeSettings, float]:
    """The node as the controller makes it from a machine file, and the largest stop that this allows (s)."""
    text = (machine_file.SHIPPED / "trunnion.toml").read_text()
    unit, name = ("deg", "C") if rotary else ("mm", "X")
    head, *tables = text.split("[[axis]]")
    travel = min(1000.0, round(2e9 / abs(axis.counts), 3))
    which = next(i for i, table in enumerate(tables) if f'name = "{name}"' in table)
    table = tables[which]
    for key, value in (
        ("velocity", f"velocity_{unit}_s = {axis.velocity!r}"),
        ("acceleration", f"acceleration_{unit}_s2 = {axis.acceleration!r}"),
        ("jerk", f"jerk_{unit}_s3 = {axis.acceleration * 25.0!r}"),
        ("counts_per", f"counts_per_{unit} = {axis.counts!r}"),
        ("following_error", f"following_error_{unit} = {axis.velocity * 0.02!r}"),
        ("profile", f'profile = "{axis.profile}"\neds = "{eds}"'),
        ("homing", f"homing = {{ {axis.homing} }}"),
        ("travel", f"travel_{unit} = [{-travel!r}, {travel!r}]"),
    ):
        table = re.sub(rf"(?m)^{key}.*$", lambda _, line=value: line, table, count=1)
    tables[which] = table.rstrip() + "\n" + "\n".join(axis.extra) + "\n\n"
    head = head.replace("[machine]", "[machine]\n" + "\n".join(axis.general), 1)
    path = folder / "mine.toml"
    path.write_text("[[axis]]".join([head, *tables]))
    (folder / "tools.toml").write_bytes((machine_file.SHIPPED / "tools.toml").read_bytes())
    machine = machine_file.load(path)
    node = next(n for n in nodes.node_settings(machine) if n.name == name)
    return node, machine.max_quick_stop_s


class Bench:
    """Commissioned, and ticked one period at a time; ``setpoint`` is in mm or degrees."""

    def __init__(
        self,
        mechanics: Mechanics,
        axis: Axis,
        sheet: Sheet,
        folder: Path,
        switches: tuple[float, float] = (-1e9, 1e9),
        change: Callable[[SimulatedDrive], None] = lambda _: None,
        **nature: float,
    ) -> None:
        """``switches`` in increments. Raises CommissionError."""
        self.mechanics, self.axis = mechanics, axis
        self.node, self.most_stop_s = settings(
            axis, mechanics.rotary, sheet.write(folder / f"drive_{next(SHEETS)}.eds", axis.profile), folder
        )
        self.rig = rig(
            [self.node],
            [BusSettings("can0", "virtual", "", 1_000_000)],
            parameters=Parameters(switches=switches, **nature),  # type: ignore[arg-type]
        )
        self.device = self.rig.drives[self.node.name]
        for index in sheet.refusing:
            self.device.dictionary.writers[index << 8] = _refuse
        change(self.device)
        self.sign = SIGN.get(sheet.values.get((0x607E, 0), 0) & 0xC0, 1) * (1 if axis.counts > 0 else -1)
        self.network = commission.Network(
            self.rig.port(pdo.SERVICE_FILTERS), commission.stepped_pump(self.rig)
        )
        self.master = MasterSettings(period_s=PERIOD_S)
        outcome = commission.commission(self.network, [self.node], self.master)[0]
        assert outcome.arranged is not None
        self.found: Arranged = outcome.arranged
        self.drive = Drive(self.node)
        self.drive.set_velocity_units(self.found.velocity_units)
        self.group = Group([self.drive], {"can0": self.rig.port(pdo.TICK_FILTERS)}, self.master, None, [])
        self.setpoint = 0.0

    @property
    def place(self) -> float:
        """Where the axis truly is since power-on, in mm or degrees along the machine's positive direction."""
        return (
            self.sign * (self.device.motor_counts - self.device.origin_counts) * self.mechanics.per_increment
        )

    @property
    def speed(self) -> float:
        return self.sign * self.device.motor_counts_s * self.mechanics.per_increment

    @property
    def lag(self) -> float:
        """What the servo is behind its own demand."""
        servo = self.device.axis.servo
        return self.sign * (servo.start - servo.position) * self.mechanics.per_increment

    @property
    def joint(self) -> float:
        """Where the drive says that it is."""
        return self.drive.position / self.axis.counts

    def tick(self) -> None:
        self.rig.advance(self.rig.now_s + PERIOD_S)
        self.group.receive(self.rig.now_s)
        fault = self.group.fault(self.rig.now_s)
        if self.drive.following or self.drive.wanted is Wanted.ENABLED:
            assert fault[0].name == "NONE", fault
        if self.group.sync(self.rig.now_s):
            if not self.drive.following:
                self.setpoint = self.joint
            self.group.command([round(self.setpoint * self.axis.counts)], self.rig.now_s)

    def until(self, done: Callable[[], bool], most: int, look: Callable[[], None] = lambda: None) -> int:
        for ticks in range(most):
            if done():
                return ticks
            self.tick()
            look()
        raise AssertionError(
            f"not after {most} ticks: {self.drive.state}, {self.group.fault(self.rig.now_s)}"
        )

    def enable(self) -> None:
        self.group.want(Wanted.ENABLED)
        self.until(lambda: self.drive.following, 500)

    def home(self, most_s: float = 30.0) -> list[float]:
        """Speeds of the motor on the way, mm/s or degrees/s, tick by tick."""
        speeds: list[float] = []
        commission.set_mode(self.network, self.node, 6)
        for _ in range(5):  # what the drive has said meanwhile is heard
            self.tick()
        self.drive.homing(True)
        self.group.want(Wanted.ENABLED)
        self.until(
            lambda: self.drive.homing_done or self.drive.homing_error,
            round(most_s / PERIOD_S),
            lambda: speeds.append(self.speed),
        )
        assert self.drive.homing_done and not self.drive.homing_error
        self.drive.homing(False)
        self.group.want(Wanted.OFF)
        self.until(lambda: self.drive.state.name != "OPERATION_ENABLED", 500)
        commission.set_mode(self.network, self.node, 8)
        for _ in range(5):  # what the drive has said meanwhile is heard
            self.tick()
        self.drive.resume_cyclic()
        return speeds

    def run_up(self, wanted: float, steady_s: float = 0.1, share: float = 0.5) -> None:
        """To a speed by a share of the largest acceleration, and steadily on."""
        speed, change = 0.0, share * self.axis.acceleration * PERIOD_S
        while abs(speed) < abs(wanted):
            speed = max(-abs(wanted), min(abs(wanted), speed + (change if wanted > 0 else -change)))
            self._step(speed)
        for _ in range(round(steady_s / PERIOD_S)):
            self._step(wanted)

    def _step(self, speed: float) -> None:
        self.setpoint += speed * PERIOD_S
        self.tick()
        assert self.drive.following, self.drive.state

    def stop_on_path(self, speed: float, share: float = 0.5) -> None:
        change = share * self.axis.acceleration * PERIOD_S
        while speed:
            speed = max(0.0, abs(speed) - change) * (1 if speed > 0 else -1)
            self._step(speed)
        for _ in range(60):
            self.tick()

    def quick_stop(self, most_s: float) -> tuple[float, float]:
        """Seconds from the request to where the motor stands for good, and the farthest that it went."""
        begun, fastest = self.place, abs(self.speed)
        farthest, moved, ticks = 0.0, 0, 0
        self.group.want(Wanted.QUICK_STOP)
        while ticks - moved < STANDS_TICKS:
            assert ticks * PERIOD_S < most_s, f"it moves after {ticks} ticks, at {self.speed}"
            self.tick()
            ticks += 1
            if abs(self.speed) >= 1e-3 * fastest:
                moved = ticks
            way = self.place - begun
            farthest = way if abs(way) > abs(farthest) else farthest
        return (moved + 1) * PERIOD_S, farthest


def _refuse(_: int) -> None:
    raise Abort(Code.VALUE)
