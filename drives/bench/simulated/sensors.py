"""What a simulated drive senses of its axis: switches, index pulses, touch probes, digital inputs 60FDh.

Positions of switches and pulses are given in power-on counting (parameters.py); homing
moves the counting, not the switches. What nobody asked for is not looked at: ``watches``
is empty unless a probe is armed, a limit switch trips the drive, or a brake may hold
against the motor.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from drives.bench.simulated.brake import MASK_AT, SET, Brake
from drives.bench.simulated.data_sheet import key
from drives.bench.simulated.homing import HOME, NEGATIVE, POSITIVE, Ground
from drives.bench.simulated.probe import Probes
from drives.bench.simulated.servo import Servo
from drives.bench.simulated.station import Alarm, Station

LIMITS = 3  # 60FDh: bit NEGATIVE and bit POSITIVE
INTERLOCK, PROBE_1, PROBE_2 = 1 << 3, 1 << 16, 1 << 17  # 60FDh; bits 0 .. 2 are the switches


class Sensors:
    """``overrun(now_s)`` is called when the axis moves further onto a limit switch."""

    def __init__(self, station: Station, servo: Servo, brake: Brake, overrun: Alarm) -> None:
        self._dictionary = station.dictionary
        self._nature = station.parameters
        self._servo = servo
        self._brake = brake
        self._overrun = overrun
        self._braked_at: float | None = None
        self.period_s = 0.0
        self.moved = 0.0  # present counting minus power-on counting
        self._switches = station.parameters.switches
        self._injected = False  # a limit switch is where none was
        self.inputs = 0  # bits of 60FDh set from outside
        self.interlock: Callable[[], bool] = lambda: False
        self.probes = Probes(self._dictionary, servo)
        self.probes.changed = self.watch
        self.watches: tuple[Alarm, ...] = ()  # called every period
        self._dictionary.readers[key(0x60FD)] = self.digital_inputs

    def watch(self) -> None:
        """Take over what is to be looked at every period."""
        watches: list[Alarm] = []
        if self.probes.on:
            watches.append(lambda _now_s: self.probes.look(self.ground()))
        if self._nature.limit_fault or self._injected or self.inputs & LIMITS:
            watches.append(self._look_at_switches)
        if self._brake.stuck or self._dictionary.values[MASK_AT] & SET:
            watches.append(self._look_at_brake)
        self.watches = tuple(watches)

    def ground(self) -> Ground:
        """Switches and index pulses in the present counting."""
        nature, moved = self._nature, self.moved
        low, high = self._switches
        first, last = nature.home_switch
        windows = ((-math.inf, low + moved), (high + moved, math.inf), (first + moved, last + moved))
        return Ground(windows, nature.index_counts, nature.index_offset + moved)

    def place(
        self, switches: tuple[float, float], home_switch: tuple[float, float], index_offset: float
    ) -> None:
        """Where they are from now on (power-on counting), in place of the parameters' own."""
        self._nature = replace(
            self._nature, switches=switches, home_switch=home_switch, index_offset=index_offset
        )
        self._switches = switches

    def place_switch(self, counts: float | None) -> None:
        """A limit switch at a position (present counting), at the end beyond it; None: as they were."""
        low, high = self._switches = self._nature.switches
        self._injected = counts is not None
        if counts is not None:
            at, upper = counts - self.moved, counts >= self._servo.position
            self._switches = (low, at) if upper else (at, high)
        self.watch()

    def digital_inputs(self) -> int:
        """60FDh: bit 0 negative, 1 positive limit, 2 home switch, 3 interlock (STO), 16, 17 probes."""
        ground, position = self.ground(), self._servo.position
        bits = self.inputs | (INTERLOCK if self.interlock() else 0)
        for bit, switch in enumerate((NEGATIVE, POSITIVE, HOME)):
            bits |= ground.pressed(switch, position) << bit
        closed = self.probes.closed
        return bits | (PROBE_1 if closed[0] else 0) | (PROBE_2 if closed[1] else 0)

    def _look_at_switches(self, now_s: float) -> None:
        servo = self._servo
        onto = POSITIVE if servo.velocity > 0.0 else NEGATIVE
        moving = abs(servo.velocity) * self.period_s >= 1.0
        if moving and (self.inputs >> onto & 1 or self.ground().pressed(onto, servo.position)):
            self._overrun(now_s)

    def _look_at_brake(self, _now_s: float) -> None:
        """A brake that holds against the motor holds."""
        if not self._brake.holds or self._braked_at is None:
            self._braked_at = self._servo.position
        else:
            self._servo.position, self._servo.velocity = self._braked_at, 0.0
