"""The emergency producer of a simulated drive (CiA 301, 7.2.7): EMCY, 1001h, 1003h, 1014h, 1015h, 603Fh.

An error is there (``report``, taken back by ``gone``) or only happens (``tell``). EMCY
0000h is sent when one that was there is gone; the error register shows what is left.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable

from drives.bench.simulated.data_sheet import key
from drives.bench.simulated.dictionary import Abort, Code
from drives.bench.simulated.identifiers import IDENTIFIER, INVALID
from drives.bench.simulated.station import OPERATIONAL, PRE_OPERATIONAL, Station

GENERIC, CURRENT, VOLTAGE, TEMPERATURE, COMMUNICATION, PROFILE, MANUFACTURER = 1, 2, 4, 8, 16, 32, 128
# First byte of the error code -> bit of the error register besides the generic one (CiA 301, table 26).
BITS = (
    (0x20, 0x2F, CURRENT),
    (0x30, 0x3F, VOLTAGE),
    (0x40, 0x4F, TEMPERATURE),
    (0x80, 0x82, COMMUNICATION),
    (0x83, 0x8F, PROFILE),
    (0xFF, 0xFF, MANUFACTURER),
)
HISTORY_AT, HISTORY = 0x1003, 8
INHIBIT_S = 1e-4  # unit of 1015h


def register_of(code: int) -> int:
    """Bits of 1001h that an error code sets."""
    high = code >> 8
    return GENERIC | sum(bit for first, last, bit in BITS if first <= high <= last)


class Emergencies:
    """Errors that are there, and the messages about them."""

    def __init__(self, station: Station) -> None:
        self._station = station
        self._values = station.dictionary.values
        self.active: dict[int, int] = {}  # code -> register bits, oldest first
        self._queue: deque[bytes] = deque()
        self._free_s = 0.0  # when the inhibit time has passed
        station.dictionary.writers[key(HISTORY_AT)] = self._clear_history
        for sub in range(1, HISTORY + 1):
            station.dictionary.guards[key(HISTORY_AT, sub)] = self._reads(sub)

    def report(self, code: int, now_s: float) -> None:
        """An error is there."""
        known = code in self.active
        self.active[code] = register_of(code)
        if not known:
            self._happened(code, now_s)

    def tell(self, code: int, now_s: float) -> None:
        """Something happened that does not last."""
        self._happened(code, now_s)

    def gone(self, code: int, now_s: float) -> None:
        """An error is no longer there."""
        if self.active.pop(code, None) is not None:
            self._publish()
            self._message(0, now_s)

    def reset(self, codes: Iterable[int], now_s: float) -> None:
        """Fault reset: these are taken back, with one message."""
        for code in codes:
            self.active.pop(code, None)
        self._publish()
        self._message(0, now_s)

    def forget(self) -> None:
        """As after power-on (NMT reset)."""
        self.active.clear()
        self._queue.clear()
        self._publish()

    def _happened(self, code: int, now_s: float) -> None:
        values = self._values
        for sub in range(HISTORY, 1, -1):
            values[key(HISTORY_AT, sub)] = values[key(HISTORY_AT, sub - 1)]
        values[key(HISTORY_AT, 1)] = code
        values[key(HISTORY_AT)] = min(HISTORY, values[key(HISTORY_AT)] + 1)
        self._publish()
        values[key(0x603F)] = code
        self._message(code, now_s)

    def _publish(self) -> None:
        register = 0
        for bits in self.active.values():
            register |= bits
        self._values[key(0x1001)] = register
        self._values[key(0x603F)] = next(reversed(self.active), 0)

    def _message(self, code: int, now_s: float) -> None:
        register = self._values[key(0x1001)] | (register_of(code) if code else 0)
        self._queue.append(code.to_bytes(2, "little") + bytes([register]) + bytes(5))
        self._transmit(now_s)

    def _transmit(self, now_s: float) -> None:
        """Send what the inhibit time allows; the rest waits for an alarm."""
        can_id = self._values[key(0x1014)]
        inhibit_s = self._values[key(0x1015)] * INHIBIT_S
        while self._queue:
            if now_s < self._free_s and inhibit_s > 0.0:
                self._station.alarm("emergency", self._free_s, self._transmit)
                return
            data = self._queue.popleft()
            if self._station.nmt in (PRE_OPERATIONAL, OPERATIONAL) and not can_id & INVALID:
                self._station.send(now_s, can_id & IDENTIFIER, data)
                self._free_s = now_s + inhibit_s

    def _clear_history(self, count: int) -> None:
        """Writing 0 to 1003h:00 empties the history; nothing else may be written."""
        if count:
            raise Abort(Code.VALUE)
        for sub in range(1, HISTORY + 1):
            self._values[key(HISTORY_AT, sub)] = 0

    def _reads(self, sub: int) -> Callable[[], None]:
        """An entry beyond the count holds no data (08000024h)."""

        def check() -> None:
            if sub > self._values[key(HISTORY_AT)]:
                raise Abort(Code.NO_DATA)

        return check
