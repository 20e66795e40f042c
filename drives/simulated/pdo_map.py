"""Process data objects of a simulated drive: from the dictionary's 14xxh .. 1Axxh to packing rules.

Any mapping of up to four objects works; the two that the controller writes
(6040h + 607Ah in, 6041h + 6064h out) are recognised, because the drive has a
faster way for them.
"""

from __future__ import annotations

from dataclasses import dataclass

from drives.pdo import DATA_AT, FRAME
from drives.simulated.dictionary import Abort, Code, Dictionary, key

COUNT = 2  # RPDOs and TPDOs each
INVALID = 0x8000_0000  # COB-ID bit 31: the PDO does not exist
RPDO_AT, RPDO_MAP_AT = 0x1400, 0x1600
TPDO_AT, TPDO_MAP_AT = 0x1800, 0x1A00
FAST_IN = (0x6040_0010, 0x607A_0020)
FAST_OUT = (0x6041_0010, 0x6064_0020)
LAST_SYNCHRONOUS = 240  # transmission types 0 .. 240 act on SYNC


@dataclass(frozen=True, slots=True)
class Pdo:
    """One active PDO: ``fields`` are (dictionary key, bytes, signed)."""

    can_id: int
    kind: int  # transmission type
    entries: tuple[int, ...]
    fields: tuple[tuple[int, int, bool], ...]
    length: int

    @property
    def synchronous(self) -> bool:
        return self.kind <= LAST_SYNCHRONOUS

    def take(self, dictionary: Dictionary, frame: bytes) -> None:
        """Write a received frame's objects."""
        at = DATA_AT
        for where, size, signed in self.fields:
            dictionary.put(where, int.from_bytes(frame[at : at + size], "little", signed=signed))
            at += size

    def give(self, dictionary: Dictionary) -> bytes:
        """A frame with the objects' present values."""
        data = b""
        for where, size, _ in self.fields:
            value = dictionary.get(where >> 8, where & 0xFF) & (1 << 8 * size) - 1
            data += value.to_bytes(size, "little")
        return FRAME.pack(self.can_id, self.length, data)


def active(dictionary: Dictionary, parameters_at: int, map_at: int) -> list[Pdo]:
    """The PDOs of one direction that are switched on."""
    found = []
    for n in range(COUNT):
        can_id = dictionary.values[key(parameters_at + n, 1)]
        if not can_id & INVALID:
            entries = _entries(dictionary, map_at + n)
            fields = tuple(_field(dictionary, entry) for entry in entries)
            kind = dictionary.values[key(parameters_at + n, 2)]
            found.append(Pdo(can_id & 0x7FF, kind, entries, fields, sum(size for _, size, _ in fields)))
    return found


def guard(dictionary: Dictionary) -> None:
    """Put CiA 301's rules of remapping on the dictionary: off, count 0, entries, count, on."""
    for parameters_at, map_at in ((RPDO_AT, RPDO_MAP_AT), (TPDO_AT, TPDO_MAP_AT)):
        for n in range(COUNT):
            _guard_one(dictionary, key(parameters_at + n, 1), map_at + n)


def _guard_one(dictionary: Dictionary, can_id_key: int, index: int) -> None:
    def switched_off() -> bool:
        return bool(dictionary.values[can_id_key] & INVALID)

    def write_count(count: int) -> None:
        if not switched_off():
            raise Abort(Code.DEVICE_STATE)
        entries = [dictionary.values[key(index, n + 1)] for n in range(count)]
        if sum(_field(dictionary, entry)[1] for entry in entries) > 8:
            raise Abort(Code.PDO_LENGTH)

    def write_entry(entry: int) -> None:
        if not switched_off() or dictionary.values[key(index)]:
            raise Abort(Code.DEVICE_STATE)
        if entry:
            _field(dictionary, entry)

    def write_can_id(can_id: int) -> None:
        # An identifier may change only on the way through "off".
        if not (can_id & INVALID or switched_off() or can_id == dictionary.values[can_id_key]):
            raise Abort(Code.VALUE)

    dictionary.writers[can_id_key] = write_can_id
    dictionary.writers[key(index)] = write_count
    for n in range(1, 5):
        dictionary.writers[key(index, n)] = write_entry


def _entries(dictionary: Dictionary, index: int) -> tuple[int, ...]:
    return tuple(dictionary.values[key(index, n + 1)] for n in range(dictionary.values[key(index)]))


def _field(dictionary: Dictionary, entry: int) -> tuple[int, int, bool]:
    """Key, bytes and sign of a mapping entry (index << 16 | sub << 8 | bits)."""
    where = entry >> 8
    variable = dictionary.variables.get(where)
    if variable is None:
        raise Abort(Code.NO_OBJECT)
    if not variable.mappable or variable.size * 8 != entry & 0xFF:
        raise Abort(Code.NOT_MAPPABLE)
    return where, variable.size, variable.signed
