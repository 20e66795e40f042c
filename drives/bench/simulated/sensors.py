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
from functools import partial

from drives.bench.simulated.brake import MASK_AT, SET, Brake
from drives.bench.simulated.data_sheet import key
from drives.bench.simulated.dictionary import Abort, Code, Dictionary
from drives.bench.simulated.homing import HOME, NEGATIVE, POSITIVE, Ground
from drives.bench.simulated.servo import Servo
from drives.bench.simulated.station import Alarm, Station

LIMITS = 3  # 60FDh: bit NEGATIVE and bit POSITIVE
INTERLOCK, PROBE_1, PROBE_2 = 1 << 3, 1 << 16, 1 << 17  # 60FDh; bits 0 .. 2 are the switches


FUNCTION_AT, STATUS_AT = key(0x60B8), key(0x60B9)
LATCHES = ((key(0x60BA), key(0x60BB)), (key(0x60BC), key(0x60BD)))  # probe: rising, falling
ON, CONTINUOUS, INDEX, CHOSEN, RISING, FALLING = 0x01, 0x02, 0x04, 0x08, 0x10, 0x20
SOURCE_AT = key(0x60D0)
INPUT_1, INPUT_2, INDEX_PULSE = 1, 2, 5  # 60D0h; the rest of the standard's list is not wired here
STORED = (0x02, 0x04)
SHIFT = 8  # probe 2's bits
UNKNOWN = 0xFF ^ (ON | CONTINUOUS | INDEX | CHOSEN | RISING | FALLING)


class Probes:
    """Both touch probes of one drive.

    The probe input closes at a position (a wall that the axis runs into), is set by hand, or is the encoder's
    index pulse. The latched position is where the motor was at that very moment, between two periods as well.

        60B8h   bit 0 on, 1 continuous, 2 source is the index pulse, 3 source is what 60D0h says,
                4 rising, 5 falling edge
        60B9h   bit 0 on, 1 rising edge stored, 2 falling edge stored; probe 2: both from bit 8
    """

    def __init__(self, dictionary: Dictionary, servo: Servo) -> None:
        self._values = dictionary.values
        self._servo = servo
        self.walls: list[float | None] = [None, None]  # closed at and above this position
        self.closed = [False, False]
        self._before = servo.position
        self.function = 0
        self.told: Callable[[float], int] = round  # a position as the drive reports it
        self.changed: Callable[[], None] = lambda: None
        dictionary.writers[FUNCTION_AT] = self._write
        for probe in (0, 1):
            dictionary.writers[SOURCE_AT + probe + 1] = partial(self._check_source, probe)

    @property
    def on(self) -> bool:
        return bool(self.function & (ON | ON << SHIFT))

    def forget(self) -> None:
        self.function = 0

    def _write(self, function: int) -> None:
        """An edge, new or switched off, forgets what its probe has stored."""
        for probe in (0, 1):
            part = function >> SHIFT * probe
            if part & UNKNOWN or part & (INDEX | CHOSEN) == INDEX | CHOSEN:
                raise Abort(Code.VALUE)
        before, status = self.function, self._values[STATUS_AT]
        for probe in (0, 1):
            if (function ^ before) >> SHIFT * probe & 0xFF:
                status &= ~(0xFF << SHIFT * probe)
                status |= (function >> SHIFT * probe & ON) << SHIFT * probe
        self._values[STATUS_AT] = status
        self._before = self._servo.position
        self.function = function
        self.changed()

    def _check_source(self, probe: int, source: int) -> None:
        """Each probe has its own input, and the index pulse."""
        if source not in (INPUT_1 if probe == 0 else INPUT_2, INDEX_PULSE):
            raise Abort(Code.VALUE)

    def _by_index(self, probe: int) -> bool:
        """Whether the probe's source is the index pulse."""
        function = self.function >> SHIFT * probe
        chosen = function & CHOSEN and self._values.get(SOURCE_AT + probe + 1) == INDEX_PULSE
        return bool(function & INDEX or chosen)

    def set_input(self, probe: int, closed: bool) -> None:
        """The input of probe 0 or 1 changes now."""
        if closed != self.closed[probe]:
            self.closed[probe] = closed
            self._latch(probe, closed, self._servo.position)

    def strike(self, probe: int, closed: bool, position: float) -> None:
        """The input of probe 0 or 1 has changed within the period, where the motor was at ``position``."""
        self.closed[probe] = closed
        self._latch(probe, closed, position)

    def look(self, ground: Ground) -> None:
        """What happened in the period that ended."""
        before, now = self._before, self._servo.position
        self._before = now
        if now == before:
            return
        for probe in (0, 1):
            if self._by_index(probe):
                self._pass_index(probe, ground, before, now)
            else:
                self._pass_wall(probe, before, now)

    def _pass_wall(self, probe: int, before: float, now: float) -> None:
        wall = self.walls[probe]
        if wall is not None and (before >= wall) != (now >= wall):
            self.closed[probe] = now >= wall
            self._latch(probe, now >= wall, wall)

    def _pass_index(self, probe: int, ground: Ground, before: float, now: float) -> None:
        direction = 1 if now > before else -1
        pulse = ground.next_index(before, direction)
        if (now - pulse) * direction >= 0.0:
            self._latch(probe, True, pulse)

    def _latch(self, probe: int, rising: bool, position: float) -> None:
        function = self.function >> SHIFT * probe
        stored = STORED[0 if rising else 1] << SHIFT * probe
        wanted = function & ON and function & (RISING if rising else FALLING)
        if not wanted or (self._values[STATUS_AT] & stored and not function & CONTINUOUS):
            return
        self._values[LATCHES[probe][0 if rising else 1]] = self.told(position)
        self._values[STATUS_AT] |= stored


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
