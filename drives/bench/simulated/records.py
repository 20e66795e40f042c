"""Data records of the interpolated position mode (CiA 402-2): 60C1h into a buffer as 60C4h describes.

60C4h:02 is the size in use; 0 means that there is none and 60C1h itself is the set-point.
Records come out first in, first out, one per period (60C4h:03 = 0); a ring is not there.
"""

from __future__ import annotations

from collections import deque

from drives.bench.simulated.aborts import Abort, Code
from drives.bench.simulated.data_sheet import key
from drives.bench.simulated.dictionary import Dictionary

RECORD_AT = key(0x60C1, 1)
SIZE_AT, WAITING_AT, CLEAR_AT = key(0x60C4, 2), key(0x60C4, 4), key(0x60C4, 6)


class Records:
    """The buffer of one drive."""

    def __init__(self, dictionary: Dictionary) -> None:
        self._values = dictionary.values
        self._waiting: deque[int] = deque()
        self._open = True  # 60C4h:06: 1 lets records in
        dictionary.writers[RECORD_AT] = self._put
        dictionary.writers[SIZE_AT] = lambda _size: self.clear()
        dictionary.writers[CLEAR_AT] = self._let_in
        dictionary.readers[WAITING_AT] = lambda: len(self._waiting)

    @property
    def size(self) -> int:
        return self._values.get(SIZE_AT, 0)

    def clear(self) -> None:
        self._waiting.clear()

    def take(self) -> int | None:
        """The record of the next period; None when the controller has not kept up."""
        return self._waiting.popleft() if self._waiting else None

    def _put(self, record: int) -> None:
        """A full buffer takes no more (060A0023h)."""
        if not self.size:
            return
        if not self._open or len(self._waiting) >= self.size:
            raise Abort(Code.NO_RESOURCE)
        self._waiting.append(record)

    def _let_in(self, access: int) -> None:
        self._open = bool(access)
        if not access:
            self.clear()
