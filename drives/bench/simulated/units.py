"""The units that a simulated drive speaks in; inside of it there are increments of the motor's encoder only.

CiA 402-2, "factor group", and the SI units 60A8h, 60A9h, 60AAh (CiA 303-2):

    position      increments x feed constant (6092h) / (encoder resolution (608Fh) x gear ratio (6091h)),
                  increments where no feed constant is set; with 60A8h in revolutions those of the motor
    velocity      60A9h (lengths and angles by 60A8h, else by what was made known of the axis);
                  without it the family's own unit, else position units per second x velocity factor (6096h)
    acceleration  60AAh; without it velocity units per second where 60A9h is told, else the family's own
                  unit, or position units per s^2 x acceleration factor (6097h)
    polarity      607Eh: bit 7 inverts positions, bit 6 velocities

    motor speed   6080h: as velocity where 60A9h is told in revolutions, else 1/min of the motor

An SI unit: exponent of ten (bits 31 .. 24), numerator, denominator, reserved. A ratio of 1 / 1 is one that
nobody has set. 6090h, the velocity's encoder, is the position's own here, and changes nothing.
"""

from __future__ import annotations

import math

from drives.bench.simulated.data_sheet import key
from drives.bench.simulated.dictionary import Dictionary
from drives.settings import INT32_MAX, INT32_MIN

POLARITY, RESOLUTION, GEAR, FEED = 0x607E, 0x608F, 0x6091, 0x6092
VELOCITY_FACTOR, ACCELERATION_FACTOR = 0x6096, 0x6097
POSITION_SI, VELOCITY_SI, ACCELERATION_SI = 0x60A8, 0x60A9, 0x60AA
OBJECTS = (0x607E, 0x608F, 0x6090, 0x6091, 0x6092, 0x6096, 0x6097, 0x60A8, 0x60A9, 0x60AA)
# Of maxon, in place of 608Fh: main sensor resolution; pulses of the incremental encoder, four counts each
ENCODERS = ((key(0x3000, 5), 1), (key(0x3010, 1), 4))
POSITION_BIT, VELOCITY_BIT = 1 << 7, 1 << 6
METRE, INCREMENT, REVOLUTION, REV_MIN = 0x01, 0xB5, 0xB4, 0xC0
ANGLES = {0x10: 1.0, 0x41: math.pi / 180.0}  # radian, degree
MOTOR_SPEED = 0x6080
SECONDS = {0x03: 1.0, 0x47: 60.0, 0x48: 3600.0}  # second, minute, hour
SQUARES = {0x57: 1.0, 0x58: 3600.0}  # second and minute squared
NO_LIMIT = (0, 0xFFFF_FFFF)


class Units:
    """Conversions of one drive; ``position`` and the others are units per increment (per s, per s^2).

    With nothing set they are 1, and values are handed on as they are, to the last bit.
    """

    def __init__(self, dictionary: Dictionary, per_metre: float = 0.0, per_radian: float = 0.0) -> None:
        """Position units in a metre or a radian of the axis, where that was made known to the drive."""
        self._dictionary = dictionary
        self._per_metre, self._per_radian = per_metre, per_radian
        self.of_shaft = False  # 60A9h and 60AAh speak of revolutions behind the gear
        self._own_s = self._own_s2 = 0.0
        self.position = self.velocity = self.acceleration = 1.0
        self.scale = 1.0  # increments per position unit
        self.plain = True

    def set_own(self, counts_s: float, counts_s2: float = 0.0) -> None:
        """One unit of velocity, and of acceleration, in position units where no object says it; 0: by the
        factors, and of acceleration that of velocity per second.
        """
        self._own_s, self._own_s2 = counts_s, counts_s2 or counts_s

    def configure(self) -> None:
        """Take over what may have been written."""
        get = self._dictionary.get
        polarity, si = get(POLARITY), get(VELOCITY_SI)
        size = self._position_size()
        velocity = 1.0 / self._size(si) if si else self._per_unit(self._own_s, VELOCITY_FACTOR) / size
        told = get(ACCELERATION_SI)
        if told:
            self.acceleration = 1.0 / self._size(told)
        else:
            other = self._per_unit(self._own_s2, ACCELERATION_FACTOR) / size
            self.acceleration = velocity if si else other
        self.position = (-1.0 if polarity & POSITION_BIT else 1.0) / size
        self.velocity = (-1.0 if polarity & VELOCITY_BIT else 1.0) * velocity
        self.scale = abs(1.0 / self.position)
        self.plain = self.position == self.velocity == self.acceleration == 1.0

    def _per_unit(self, own: float, factor: int) -> float:
        return 1.0 / own if own else self._ratio(factor)

    def _ratio(self, index: int) -> float:
        above, below = self._dictionary.get(index, 1), self._dictionary.get(index, 2)
        return above / below if above and below else 1.0

    def _increments_per_revolution(self) -> float:
        resolution = self._ratio(RESOLUTION)
        if resolution != 1.0:
            return resolution
        values = self._dictionary.values
        told = next((float(times * values[at]) for at, times in ENCODERS if values.get(at)), 0.0)
        return told or self._told_revolution()

    def _told_revolution(self) -> float:
        """By the unit of velocity that was made known, which is one of revolutions."""
        word = self._dictionary.get(VELOCITY_SI)
        numerator, time = word >> 16 & 0xFF, SECONDS.get(word >> 8 & 0xFF, 1.0)
        if self._own_s == 0.0 or numerator not in (REVOLUTION, REV_MIN):
            return 1.0
        return self._own_s * time * (SECONDS[0x47] if numerator == REV_MIN else 1.0) / _prefix(word)

    def _turn(self) -> float:
        """Increments in a revolution as SI units mean it."""
        return self._increments_per_revolution() * (self._ratio(GEAR) if self.of_shaft else 1.0)

    def _position_size(self) -> float:
        """Increments in one position unit."""
        word = self._dictionary.get(POSITION_SI)
        if word >> 16 & 0xFF == REVOLUTION:
            return _prefix(word) * self._turn()
        feed = self._ratio(FEED)
        if word >> 16 & 0xFF == INCREMENT:
            return _prefix(word)
        if feed == 1.0:
            return 1.0
        return self._increments_per_revolution() * self._ratio(GEAR) / feed

    def _size(self, word: int) -> float:
        """Increments per s, or s^2, in one unit of velocity or acceleration."""
        numerator, denominator = word >> 16 & 0xFF, word >> 8 & 0xFF
        time = SECONDS.get(denominator) or SQUARES.get(denominator) or 1.0
        if numerator == REV_MIN:
            return _prefix(word) * self._turn() / SECONDS[0x47] / time
        if numerator == REVOLUTION:
            return _prefix(word) * self._turn() / time
        if numerator == INCREMENT:
            return _prefix(word) / time
        return _prefix(word) * self._units_in(numerator) * self._position_size() / time

    def _units_in(self, numerator: int) -> float:
        """Position units in a metre, radian or degree: by 60A8h, else as it was made known."""
        position = self._dictionary.get(POSITION_SI)
        said, angle = position >> 16 & 0xFF, ANGLES.get(numerator, 1.0)
        if said == numerator or (said in ANGLES and numerator in ANGLES):
            return angle / ANGLES.get(said, 1.0) / _prefix(position)
        return (self._per_radian if numerator in ANGLES else self._per_metre) * angle or 1.0

    # -- from the dictionary

    def position_at(self, index: int, sub: int = 0) -> float:
        """A position, in increments."""
        return self.increments(self._dictionary.get(index, sub))

    def increments(self, told: float) -> float:
        return told if self.plain else told / self.position

    def distance_at(self, index: int) -> float:
        """A window, in increments."""
        return abs(self.position_at(index))

    def limits(self) -> tuple[float, float]:
        """607Dh in increments; the ends of INTEGER32 are no limits."""
        low, high = self._dictionary.get(0x607D, 1), self._dictionary.get(0x607D, 2)
        if self.plain or (low == INT32_MIN and high == INT32_MAX):
            return low, high
        ends = sorted((self.increments(low), self.increments(high)))
        return ends[0], ends[1]

    def velocity_at(self, index: int, sub: int = 0) -> float:
        """A velocity with its sign, increments/s."""
        value = self._dictionary.get(index, sub)
        return value if self.plain else value / self.velocity

    def speed_at(self, index: int, sub: int = 0) -> float:
        """A speed limit, increments/s; what means "no limit" stays what it is."""
        value = self._dictionary.get(index, sub)
        if value in NO_LIMIT:
            return value
        if index == MOTOR_SPEED and self._dictionary.get(VELOCITY_SI) >> 16 & 0xFF != REVOLUTION:
            turn = self._increments_per_revolution()
            return value * turn / SECONDS[0x47] if turn != 1.0 else NO_LIMIT[-1]
        return value if self.plain else abs(value / self.velocity)

    def acceleration_at(self, index: int) -> float:
        """An acceleration, increments/s^2."""
        value = self._dictionary.get(index)
        return value if self.plain else value / self.acceleration

    def most_acceleration_at(self, index: int) -> float:
        """A limit of accelerations, increments/s^2; what means "no limit" is infinite."""
        return math.inf if self._dictionary.get(index) in NO_LIMIT else self.acceleration_at(index)

    # -- to the dictionary

    def reported_position(self, increments: float) -> int:
        """The position as 6064h reports it."""
        return max(INT32_MIN, min(INT32_MAX, round(increments if self.plain else increments * self.position)))

    def reported_velocity(self, increments_s: float) -> int:
        """The velocity as 606Ch reports it."""
        return max(INT32_MIN, min(INT32_MAX, round(increments_s * self.velocity)))


def _prefix(word: int) -> float:
    exponent = word >> 24 & 0xFF
    return float(10.0 ** (exponent - 256 if exponent > 127 else exponent))
