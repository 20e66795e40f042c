"""SYNC of a simulated drive (CiA 301, 7.2.5): 1005h, 1006h, 1007h, 1019h.

Consuming is the drive's own hot path; here is what surrounds it. A drive may produce
SYNC itself (1005h bit 30). It misses SYNC when 1006h is set and none comes for one and
a half of it (EMCY 8100h, taken back with the next one); watching starts with the first.
"""

from __future__ import annotations

from struct import Struct

from drives.bench.simulated import identifiers
from drives.bench.simulated.data_sheet import key
from drives.bench.simulated.dictionary import Abort, Code
from drives.bench.simulated.emergency import Emergencies
from drives.bench.simulated.identifiers import BIT_30, IDENTIFIER
from drives.bench.simulated.station import INITIALISING, OPERATIONAL, PRE_OPERATIONAL, Station
from drives.bench.virtual.virtual_bus import Handler
from drives.pdo import DATA_AT, FRAME

MISSED, WRONG_LENGTH = 0x8100, 0x8240
LATEST_PERIODS = 1.5
HIGHEST_COUNTER = 240
US = 1e-6


class Sync:
    """Producer and supervision; ``handler`` is what the drive does at a SYNC."""

    def __init__(self, station: Station, emergencies: Emergencies, handler: Handler) -> None:
        self._station = station
        self._emergencies = emergencies
        self._handler = handler
        self._at_s = 0.0  # the newest SYNC
        self._next = 1  # of the counter, when producing
        self.can_id = 0x80
        self.counts = 0  # 1019h: 0, or the counter's highest value
        self.period_s = self.window_s = 0.0
        station.dictionary.writers[key(0x1019)] = self._check_counter

    def _check_counter(self, highest: int) -> None:
        """2 .. 240, and only while no period is set (CiA 301, 7.5.2.22)."""
        if highest == 1 or highest > HIGHEST_COUNTER:
            raise Abort(Code.VALUE)
        if self._station.dictionary.values[key(0x1006)]:
            raise Abort(Code.DEVICE_STATE)

    def configure(self) -> None:
        values = self._station.dictionary.values
        self.can_id = values[key(0x1005)] & IDENTIFIER
        self.counts = values[key(0x1019)]
        self.period_s = values[key(0x1006)] * US
        self.window_s = values[key(0x1007)] * US
        produces = bool(values[key(0x1005)] & BIT_30) and self.period_s > 0.0
        if not produces or self._station.nmt == INITIALISING:
            self._station.cancel("sync producer")
        elif not self._station.waiting("sync producer"):
            self._next = 1
            self._station.alarm("sync producer", self._station.now_s + self.period_s, self._produce)
        if self.period_s == 0.0:
            self._station.cancel("sync time-out")
            self._emergencies.gone(MISSED, self._station.now_s)

    @property
    def plain(self) -> bool:
        """Nothing but the drive's own handler looks at SYNC."""
        return self.counts == 0 and self.period_s == 0.0

    @property
    def shape(self) -> tuple[int, bool, float]:
        """What the drive's way of SYNC depends on."""
        return self.can_id, self.plain, self.window_s

    def listens(self) -> dict[int, Handler]:
        return {self.can_id: self._handler if self.plain else self._came}

    def _came(self, frame: bytes, now_s: float) -> None:
        """A SYNC that is watched or counted."""
        self._at_s = now_s
        if self._station.nmt in (PRE_OPERATIONAL, OPERATIONAL):
            self._watch(now_s)
        if frame[4] != (1 if self.counts else 0):
            self._emergencies.tell(WRONG_LENGTH, now_s)
        self._handler(frame, now_s)

    def _watch(self, now_s: float) -> None:
        self._emergencies.gone(MISSED, now_s)
        if self.period_s > 0.0 and not self._station.waiting("sync time-out"):
            self._station.alarm("sync time-out", now_s + LATEST_PERIODS * self.period_s, self._look)

    def _look(self, now_s: float) -> None:
        expires_s = self._at_s + LATEST_PERIODS * self.period_s
        if now_s < expires_s:
            self._station.alarm("sync time-out", expires_s, self._look)
        elif self._station.nmt in (PRE_OPERATIONAL, OPERATIONAL):
            self._emergencies.report(MISSED, now_s)

    def _produce(self, now_s: float) -> None:
        """SYNC of our own, in every state but STOPPED; it counts for us as well."""
        station = self._station
        if station.nmt in (PRE_OPERATIONAL, OPERATIONAL):
            data = bytes([self._next]) if self.counts else b""
            self._next = self._next % self.counts + 1 if self.counts else 1
            station.send(now_s, self.can_id, data)
            self._came(FRAME.pack(self.can_id, len(data), data), now_s)
        station.alarm("sync producer", now_s + self.period_s, self._produce)


# ---- the time stamp object (CiA 301, 7.2.6) ------------------------------------------------


AT = key(0x1012)
CONSUMES, PRODUCES = 0x8000_0000, BIT_30
STAMP = Struct("<IH")
MILLISECONDS = 0x0FFF_FFFF
DAY_S = 86400.0


class TimeOfDay:
    """The consumer. No device here produces TIME, so bit 30 is refused.

    A frame of six bytes: milliseconds after midnight (28 bits) and days since 1 January 1984. A device that
    consumes it (1012h bit 31) knows what time it is from then on.
    """

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
