"""One axis, for a script: the drives package used alone.

    sheet = "config/eds/simulated_drive.eds"
    with OneAxis("virtual", "/tmp/can", node=1, eds=sheet, quick_stop=400_000) as axis:
        axis.enable()
        axis.move_to(20_000, speed=40_000, acceleration=200_000)

Opening commissions the drive (``commission``); after that a ``Group`` of one drive is
ticked while a method runs: SYNC, setpoint, heartbeat. Nothing runs in the background.
A script that is silent for longer than ``MasterSettings.consumer_s`` finds its drive
stopped and disabled by its own supervision, as it must be; ``hold`` keeps it going.

Python's own clock paces the ticks, hence their default of 10 ms; a late tick is left
out and the motion waits for it, so a busy computer makes it slower, never rougher.
"""

from __future__ import annotations

import contextlib
import math
import select
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Protocol, Self

from drives import bus, commission, emergency_codes, pdo
from drives.bus import Port
from drives.cia402 import State, Wanted
from drives.commission import Pump
from drives.cyclic.drive import Drive
from drives.cyclic.drive_fault import DriveFault
from drives.cyclic.group import Group
from drives.profile import GENERIC, Profile
from drives.settings import INT32_MAX, INT32_MIN, BusSettings, MasterSettings, NodeSettings
from drives.texts import Key, Message, TextError, message

Filters = Sequence[tuple[int, int]]

CHANGE_S = 5.0  # longest a drive may take to enable or disable (brakes), counted in ticks
SETTLE_S = 1.0  # longest it may take to arrive after the last setpoint


class AxisError(TextError):
    """The axis does not do what it was told; the text says what is wrong."""


class Clock(Protocol):
    """Where time and the bus come from; a stepped bus in tests."""

    def open(self, settings: BusSettings, filters: Filters) -> Port: ...

    def pump(self, port: Port) -> Pump: ...

    def wait(self, until_s: float) -> float:
        """Let time pass until ``until_s``, or not at all; the time then."""


class WallClock:
    """CLOCK_MONOTONIC, and real ports."""

    def open(self, settings: BusSettings, filters: Filters) -> Port:
        return bus.open(settings, filters)

    def pump(self, port: Port) -> Pump:
        fileno: Callable[[], int] = getattr(port, "fileno", lambda: -1)
        return commission.wall_pump(fileno())

    def wait(self, until_s: float) -> float:
        left_s = until_s - time.monotonic()
        if left_s > 0.0:
            select.select([], [], [], left_s)
        return time.monotonic()


class OneAxis:
    """A drive on a bus; positions in counts. Close it, or use it in a ``with``."""

    def __init__(
        self,
        interface: str,
        channel: str,
        *,
        node: int,
        eds: str,
        bit_rate: int = 1_000_000,
        period_s: float = 0.01,
        quick_stop: float = 0.0,
        profile: Profile = GENERIC,
        clock: Clock | None = None,
    ) -> None:
        """``interface`` and ``channel`` as in ``BusSettings``; ``quick_stop``: how hard the drive brakes by
        itself, counts/s^2. It is written (6085h) and read back; without it the drive is refused.

        Raises BusError, CommissionError, OSError.
        """
        if not quick_stop > 0.0:
            raise commission.CommissionError(message("axis.no_quick_stop", node=node))
        self._clock: Clock = clock or WallClock()
        where = BusSettings("can", interface, channel, bit_rate)
        settings = NodeSettings(
            f"node {node}",
            "can",
            node,
            eds,
            period_s=period_s,
            profile=profile,
            homing_method=_unused_method(profile),
            quick_stop_counts_s2=quick_stop,
        )
        master = MasterSettings(period_s=period_s)
        self._commission(where, settings, master)
        self._drive = Drive(settings)
        self._group = Group([self._drive], {"can": self._clock.open(where, pdo.TICK_FILTERS)}, master)
        self._period_s = period_s
        self._due_s = -math.inf
        self._setpoint = 0

    def _commission(self, where: BusSettings, settings: NodeSettings, master: MasterSettings) -> None:
        port = self._clock.open(where, pdo.SERVICE_FILTERS)
        try:
            network = commission.Network(port, self._clock.pump(port))
            commission.commission(network, [settings], master, bit_rate=where.bit_rate)
        finally:
            port.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """What went wrong inside is what the script hears of."""
        with contextlib.suppress(*(() if kind is None else (AxisError,))):
            self.close()

    def close(self) -> None:
        """Disable the drive and leave the bus."""
        try:
            self.disable()
        finally:
            self._group.close()

    @property
    def position(self) -> int:
        """Where the drive said it was, in the newest tick."""
        return self._drive.position

    def enable(self) -> None:
        """Torque on, standing where it is. Raises AxisError."""
        self._group.want(Wanted.ENABLED)
        self._until(lambda: self._drive.following, CHANGE_S, "axis.not_enabled", follow=True)

    def disable(self) -> None:
        """Torque off. Raises AxisError when the drive does not say so."""
        self._group.want(Wanted.OFF)
        self._until(self._is_off, CHANGE_S, "axis.not_disabled")

    def _is_off(self) -> bool:
        states = (State.SWITCH_ON_DISABLED, State.READY_TO_SWITCH_ON, State.SWITCHED_ON, State.FAULT)
        return self._drive.state in states

    def move_to(self, target: int, speed: float, acceleration: float, window: int = 2) -> None:
        """Move with a trapezoid of speed (counts/s, counts/s^2) and arrive within ``window`` counts.

        Raises AxisError for a drive that faults, is not enabled, or does not arrive; ValueError for
        a target outside of INTEGER32 or limits that are not positive.
        """
        if not (INT32_MIN <= target <= INT32_MAX and speed > 0.0 and acceleration > 0.0):
            raise ValueError(f"target {target}, speed {speed}, acceleration {acceleration}: no such motion")
        if not self._drive.following:
            raise AxisError(message("axis.is_off", node=self._drive.settings.node))
        start, way = self._setpoint, target - self._setpoint
        for part in trapezoid(abs(way), speed, acceleration, self._period_s):
            self._setpoint = start + round(math.copysign(part, way))
            self._tick()
        arrived = partial(self._is_near, target, window)
        self._until(arrived, SETTLE_S, "axis.not_arrived", target=target)

    def _is_near(self, target: int, window: int) -> bool:
        return abs(self.position - target) <= window

    def hold(self, seconds: float) -> None:
        """Stand for a while, with everything that keeps the drive enabled. Raises AxisError."""
        for _ in range(math.ceil(seconds / self._period_s)):
            self._tick()

    def _until(
        self, done: Callable[[], bool], patience_s: float, failure: str, follow: bool = False, **facts: object
    ) -> None:
        """Tick until ``done``. Raises AxisError with the text ``failure`` when the patience ends."""
        for _ in range(math.ceil(patience_s / self._period_s)):
            self._tick(follow)
            if done():
                return
        node = self._drive.settings.node
        raise AxisError(message(failure, node=node, seconds=patience_s, found=self._found(), **facts))

    def _found(self) -> Message:
        if not self._drive.fresh:
            return message("axis.no_feedback")
        state = self._drive.state.name.lower().replace("_", " ")
        return message("axis.found", state=state, position=self.position)

    def _tick(self, follow: bool = False) -> None:
        """``follow``: the setpoint is where the axis is."""
        now_s = self._clock.wait(self._due_s)
        self._due_s = max(self._due_s, now_s - 0.25 * self._period_s) + self._period_s
        group = self._group
        group.receive(now_s)
        if follow:
            self._setpoint = self._drive.position
        group.sync(now_s)
        group.command((self._setpoint,), now_s)
        fault, _ = group.fault(now_s)
        if fault is not DriveFault.NONE:
            self._give_up(fault)

    def _give_up(self, fault: DriveFault) -> None:
        self._group.want(Wanted.OFF)
        facts = {"node": self._drive.settings.node, "fault": Key(f"drive_fault.{fault.name}")}
        if code := self._drive.emcy_code:
            raise AxisError(message("axis.faulted_by", **facts, code=emergency_codes.text(code)))
        raise AxisError(message("axis.faulted", **facts))


def _unused_method(profile: Profile) -> int:
    """6098h must hold something that the drive takes, though nobody homes here."""
    return next(
        (method for method in (37, 35) if method in profile.homing_methods), profile.homing_methods[0]
    )


def trapezoid(way: float, speed: float, acceleration: float, period_s: float) -> Iterator[float]:
    """Distances after 1, 2, ... periods, the last one ``way``.

              ________            The ramps are equal; a short way has no top:
             /        \\           its highest speed is sqrt(way * acceleration).
            /          \\
    """
    top = min(speed, math.sqrt(way * acceleration))
    if top == 0.0:
        return
    ramp_s = top / acceleration
    whole_s = way / top + ramp_s
    for k in range(1, math.ceil(whole_s / period_s)):
        t = k * period_s
        if t < ramp_s:
            yield 0.5 * acceleration * t * t
        elif t < whole_s - ramp_s:
            yield top * (t - 0.5 * ramp_s)
        else:
            yield way - 0.5 * acceleration * (whole_s - t) ** 2
    yield way
