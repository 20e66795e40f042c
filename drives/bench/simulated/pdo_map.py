"""Process data objects of a simulated drive: from the dictionary's 14xxh .. 1Axxh to packing rules.

Any mapping of up to eight objects works; the two that the controller writes
(6040h + 607Ah in, 6041h + 6064h out) are recognised, because the drive has a
faster way for them. Rules of change are CiA 301's, 7.5.2.35 - 7.5.2.38.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from drives.bench.simulated import identifiers
from drives.bench.simulated.data_sheet import WRITABLE, key
from drives.bench.simulated.dictionary import Abort, Code, Dictionary
from drives.bench.simulated.identifiers import BIT_30, IDENTIFIER, INVALID
from drives.pdo import DATA_AT, FRAME

COUNT = 4  # RPDOs and TPDOs each, at most
RPDO_AT, RPDO_MAP_AT = 0x1400, 0x1600
TPDO_AT, TPDO_MAP_AT = 0x1800, 0x1A00
FAST_IN = (0x6040_0010, 0x607A_0020)
FAST_OUT = (0x6041_0010, 0x6064_0020)
TOLD = frozenset({key(0x6060), key(0x6061)})  # mode of operation
ENTRIES = 8
LONGEST = 8  # bytes
LAST_SYNCHRONOUS = 240  # transmission types 0 .. 240 act on SYNC
SYNCHRONOUS_REMOTE, REMOTE = 252, 253  # sampled at SYNC, or when asked
RESERVED_TO_TPDO, RESERVED_TO_RPDO = range(241, 252), range(241, 254)
SKIPPED = -1  # key of a dummy entry
INHIBIT_S, EVENT_S = 1e-4, 1e-3  # units of sub-indexes 3 and 5
_ONES = tuple((1 << 8 * size) - 1 for size in range(LONGEST + 1))


@dataclass(frozen=True, slots=True)
class Pdo:
    """One active PDO: ``fields`` are (dictionary key, bytes, signed)."""

    can_id: int
    kind: int  # transmission type
    entries: tuple[int, ...]
    fields: tuple[tuple[int, int, bool], ...]
    length: int
    inhibit_s: float = 0.0
    event_s: float = 0.0  # TPDO: sent at the latest after this; RPDO: must come within it
    start: int = 0  # SYNC counter that counts as the first one
    remote: bool = True  # may be asked for

    @property
    def synchronous(self) -> bool:
        return self.kind <= LAST_SYNCHRONOUS

    @property
    def looks_at_sync(self) -> bool:
        """Of a TPDO: SYNC has it sent, or its objects sampled."""
        return self.synchronous or self.kind == SYNCHRONOUS_REMOTE

    @property
    def event_driven(self) -> bool:
        return self.kind >= 254

    @property
    def may_change_by_itself(self) -> bool:
        """With a period, and not only by what a device is told or by an alarm: those look for changes."""
        return any(where not in TOLD for where, _, _ in self.fields)

    def take(self, dictionary: Dictionary, frame: bytes) -> None:
        """Write a received frame's objects; a value that the device refuses changes nothing."""
        at = DATA_AT
        for where, size, signed in self.fields:
            if where != SKIPPED:
                with contextlib.suppress(Abort):
                    dictionary.put(where, int.from_bytes(frame[at : at + size], "little", signed=signed))
            at += size

    def reads(self, dictionary: Dictionary) -> tuple[Callable[[], int], ...]:
        """What gives the objects' present values, in their order."""
        readers, stored = dictionary.readers, dictionary.values.__getitem__
        return tuple(readers.get(where) or partial(stored, where) for where, _, _ in self.fields)

    def packed(self, values: Sequence[int]) -> bytes:
        """Values of the objects as they stand in a frame."""
        data = b""
        for value, (_, size, _) in zip(values, self.fields, strict=True):
            data += (value & _ONES[size]).to_bytes(size, "little")
        return data

    def frame(self, data: bytes) -> bytes:
        return FRAME.pack(self.can_id, self.length, data)


def active(dictionary: Dictionary, parameters_at: int, map_at: int) -> list[Pdo]:
    """The PDOs of one direction that are switched on and have something mapped.

    A data sheet's default mapping may be of objects that are not in it; such a PDO is none.
    """
    found = []
    for n in range(COUNT):
        can_id = dictionary.values.get(key(parameters_at + n, 1), INVALID)
        if not can_id & INVALID and dictionary.values[key(map_at + n)]:
            with contextlib.suppress(Abort):
                found.append(_pdo(dictionary, can_id, parameters_at + n, map_at + n))
    return found


def _pdo(dictionary: Dictionary, can_id: int, parameters: int, mapping: int) -> Pdo:
    values = dictionary.values
    inward = mapping < TPDO_MAP_AT
    count = values[key(mapping)]
    entries = tuple(values[key(mapping, n + 1)] for n in range(count))
    fields = tuple(field(dictionary, entry, inward) for entry in entries)
    return Pdo(
        can_id=can_id & IDENTIFIER,
        kind=values[key(parameters, 2)],
        entries=entries,
        fields=fields,
        length=sum(size for _, size, _ in fields),
        inhibit_s=values.get(key(parameters, 3), 0) * INHIBIT_S,
        event_s=values.get(key(parameters, 5), 0) * EVENT_S,
        start=values.get(key(parameters, 6), 0),
        remote=not can_id & BIT_30,
    )


def field(dictionary: Dictionary, entry: int, inward: bool) -> tuple[int, int, bool]:
    """Key, bytes and sign of a mapping entry (index << 16 | sub << 8 | bits). Raises Abort."""
    where, bits = entry >> 8, entry & 0xFF
    if bits // 8 > LONGEST:
        raise Abort(Code.PDO_LENGTH)
    variable = dictionary.variables.get(where)
    if variable is None:
        return _dummy(dictionary, where >> 8, bits, inward)
    fits = variable.to_rpdo if inward else variable.to_tpdo
    if not fits or variable.size * 8 != bits:
        raise Abort(Code.NOT_MAPPABLE)
    return where, variable.size, variable.signed


def _dummy(dictionary: Dictionary, data_type: int, bits: int, inward: bool) -> tuple[int, int, bool]:
    """A data type in place of an object: received and thrown away."""
    if not 0 < data_type < 0x20:
        raise Abort(Code.NO_OBJECT)
    if not inward or data_type not in dictionary.dummies or bits % 8 or not bits:
        raise Abort(Code.NOT_MAPPABLE)
    return SKIPPED, bits // 8, False


class Rules:
    """What may be written to one PDO: off, type and times, count 0, entries, count, on."""

    def __init__(self, dictionary: Dictionary, parameters: int, mapping: int) -> None:
        self._dictionary = dictionary
        self._parameters = parameters
        self._mapping = mapping
        self._inward = mapping < TPDO_MAP_AT
        writers = dictionary.writers
        writers[key(parameters, 1)] = self._can_id
        writers[key(parameters, 2)] = self._kind
        writers[key(parameters, 3)] = partial(self._while_off, 3)
        writers[key(parameters, 6)] = partial(self._while_off, 6)
        writers[key(mapping)] = self._count
        for n in range(1, ENTRIES + 1):
            writers[key(mapping, n)] = self._entry

    @property
    def _off(self) -> bool:
        """Also where the identifier is fixed: such drives are remapped with the count at 0 alone."""
        can_id = key(self._parameters, 1)
        fixed = self._dictionary.variables[can_id].access not in WRITABLE
        return fixed or bool(self._dictionary.values[can_id] & INVALID)

    def _can_id(self, value: int) -> None:
        before = self._dictionary.values[key(self._parameters, 1)]
        identifiers.check_change(before, value, not self._off)
        if not value & INVALID and not self._dictionary.values[key(self._mapping)]:
            raise Abort(Code.VALUE)  # with nothing mapped there is no PDO to switch on

    def _kind(self, kind: int) -> None:
        if kind in (RESERVED_TO_RPDO if self._inward else RESERVED_TO_TPDO):
            raise Abort(Code.VALUE)

    def _while_off(self, sub: int, value: int) -> None:
        """Inhibit time and SYNC start value: not while the PDO exists."""
        if not self._off and value != self._dictionary.values[key(self._parameters, sub)]:
            raise Abort(Code.VALUE)

    def _count(self, count: int) -> None:
        if not self._off:
            raise Abort(Code.ACCESS)
        if count > ENTRIES:
            raise Abort(Code.PDO_LENGTH)
        entries = [self._dictionary.values[key(self._mapping, n + 1)] for n in range(count)]
        if sum(field(self._dictionary, entry, self._inward)[1] for entry in entries) > LONGEST:
            raise Abort(Code.PDO_LENGTH)

    def _entry(self, entry: int) -> None:
        if not self._off or self._dictionary.values[key(self._mapping)]:
            raise Abort(Code.ACCESS)
        if entry:
            field(self._dictionary, entry, self._inward)


def guard(dictionary: Dictionary) -> None:
    """Put the rules on every PDO of the dictionary."""
    for parameters_at, map_at in ((RPDO_AT, RPDO_MAP_AT), (TPDO_AT, TPDO_MAP_AT)):
        for n in range(COUNT):
            if dictionary.has(parameters_at + n, 1):
                Rules(dictionary, parameters_at + n, map_at + n)


def is_fast_in(mapped: Pdo) -> bool:
    """The controller's own RPDO, with nothing that needs a second look."""
    return mapped.entries == FAST_IN and mapped.synchronous


def is_fast_out(mapped: Pdo) -> bool:
    return mapped.entries == FAST_OUT and mapped.kind == 1 and not mapped.start
