"""Non-volatile parameters of a simulated drive: 1010h "save" and 1011h "load" (CiA 301, 7.5.2.13 - 14).

Sub-index 1 holds all, 2 communication, 3 application, 4 manufacturer defined parameters.
Saved values come back with the next reset; after "load" the next reset brings defaults.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from drives.bench.simulated.aborts import Abort, Code
from drives.bench.simulated.data_sheet import WRITABLE, key
from drives.bench.simulated.dictionary import Dictionary

SAVE, LOAD = int.from_bytes(b"save", "little"), int.from_bytes(b"load", "little")
STORE_AT, RESTORE_AT = 0x1010, 0x1011
GROUPS = {1: (0x1000, 0xFFFF), 2: (0x1000, 0x1FFF), 3: (0x6000, 0x9FFF), 4: (0x2000, 0x5FFF)}
# What a command or a moment says is not a parameter.
TRANSIENT = {0x1003, STORE_AT, RESTORE_AT, 0x6040, 0x6060, 0x607A, 0x60FF, 0x60C1, 0x60B8, 0x60FE}


class Storage:
    """Values that survive a reset. ``broken``: the memory chip fails (06060000h)."""

    def __init__(self, dictionary: Dictionary, may_store: Callable[[], bool]) -> None:
        self._dictionary = dictionary
        self._may_store = may_store
        self._saved: dict[int, int] = {}
        self.broken = False
        for sub in GROUPS:
            dictionary.writers[key(STORE_AT, sub)] = partial(self._save, sub)
            dictionary.writers[key(RESTORE_AT, sub)] = partial(self._load, sub)
            for index in (STORE_AT, RESTORE_AT):
                dictionary.readers[key(index, sub)] = lambda: 1  # on command

    def restore(self, first: int, last: int) -> None:
        """Put the saved values of a range over the defaults."""
        for where, value in self._saved.items():
            if first <= where >> 8 <= last:
                self._dictionary.values[where] = value

    def _save(self, sub: int, signature: int) -> None:
        self._check(signature, SAVE)
        first, last = GROUPS[sub]
        for where, variable in self._dictionary.variables.items():
            kept = variable.access in WRITABLE and variable.size and where >> 8 not in TRANSIENT
            if kept and first <= where >> 8 <= last:
                self._saved[where] = self._dictionary.values[where]

    def _load(self, sub: int, signature: int) -> None:
        self._check(signature, LOAD)
        first, last = GROUPS[sub]
        self._saved = {k: v for k, v in self._saved.items() if not first <= k >> 8 <= last}

    def _check(self, signature: int, wanted: int) -> None:
        if signature != wanted:
            raise Abort(Code.NOT_STORED)
        if self.broken:
            raise Abort(Code.HARDWARE)
        if not self._may_store():
            raise Abort(Code.DEVICE_STATE)
