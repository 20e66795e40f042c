"""The time stamp object of a simulated device (CiA 301, 7.2.6): 1012h, TIME_OF_DAY by broadcast.

A frame of six bytes: milliseconds after midnight (28 bits) and days since 1 January
1984. A device that consumes it (1012h bit 31) knows what time it is from then on.
"""

from __future__ import annotations

from struct import Struct

from drives.bench.simulated import identifiers
from drives.bench.simulated.aborts import Abort, Code
from drives.bench.simulated.data_sheet import key
from drives.bench.simulated.identifiers import BIT_30, IDENTIFIER
from drives.bench.simulated.station import OPERATIONAL, PRE_OPERATIONAL, Station
from drives.bench.virtual.virtual_bus import Handler
from drives.pdo import DATA_AT

AT = key(0x1012)
CONSUMES, PRODUCES = 0x8000_0000, BIT_30
STAMP = Struct("<IH")
MILLISECONDS = 0x0FFF_FFFF
DAY_S = 86400.0


class TimeOfDay:
    """The consumer. No device here produces TIME, so bit 30 is refused."""

    def __init__(self, station: Station) -> None:
        self._station = station
        self._told: tuple[float, float] | None = None  # seconds since 1984, and when that was said
        station.dictionary.writers[AT] = self._check

    def _check(self, value: int) -> None:
        before = self._station.dictionary.values[AT]
        changes = (before ^ value) & ~CONSUMES and before & value & CONSUMES  # while it is listened to
        if value & PRODUCES or changes:
            raise Abort(Code.VALUE)
        identifiers.check(value & ~CONSUMES)

    def listens(self) -> dict[int, Handler]:
        value = self._station.dictionary.values.get(AT, 0)
        return {value & IDENTIFIER: self._heard} if value & CONSUMES else {}

    def _heard(self, frame: bytes, now_s: float) -> None:
        if frame[4] != STAMP.size or self._station.nmt not in (PRE_OPERATIONAL, OPERATIONAL):
            return
        milliseconds, days = STAMP.unpack_from(frame, DATA_AT)
        self._told = (days * DAY_S + (milliseconds & MILLISECONDS) * 1e-3, now_s)

    def since_1984_s(self, now_s: float) -> float | None:
        """What the device takes the time to be; None before it was told."""
        return None if self._told is None else self._told[0] + now_s - self._told[1]
