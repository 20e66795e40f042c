"""Touch probes of a simulated drive (CiA 402-2, 60B8h - 60BDh).

The probe input closes at a position (a wall that the axis runs into), is set by hand,
or is the encoder's index pulse. The latched position is where the motor was at that
very moment, between two periods as well, as a real latch in hardware gives it.

    60B8h   bit 0 on, 1 continuous, 2 source is the index pulse, 3 source is what 60D0h says,
            4 rising, 5 falling edge
    60B9h   bit 0 on, 1 rising edge stored, 2 falling edge stored; probe 2: both from bit 8
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from drives.bench.simulated.aborts import Abort, Code
from drives.bench.simulated.data_sheet import key
from drives.bench.simulated.dictionary import Dictionary
from drives.bench.simulated.homing import Ground
from drives.bench.simulated.servo import Servo

FUNCTION_AT, STATUS_AT = key(0x60B8), key(0x60B9)
LATCHES = ((key(0x60BA), key(0x60BB)), (key(0x60BC), key(0x60BD)))  # probe: rising, falling
ON, CONTINUOUS, INDEX, CHOSEN, RISING, FALLING = 0x01, 0x02, 0x04, 0x08, 0x10, 0x20
SOURCE_AT = key(0x60D0)
INPUT_1, INPUT_2, INDEX_PULSE = 1, 2, 5  # 60D0h; the rest of the standard's list is not wired here
STORED = (0x02, 0x04)
SHIFT = 8  # probe 2's bits
UNKNOWN = 0xFF ^ (ON | CONTINUOUS | INDEX | CHOSEN | RISING | FALLING)


class Probes:
    """Both touch probes of one drive."""

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
