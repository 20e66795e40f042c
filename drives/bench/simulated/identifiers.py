"""Rules for CAN identifiers in the dictionary (CiA 301, 7.3.5 and the objects 1005h, 1014h, 14xxh, 18xxh)."""

from __future__ import annotations

from drives.bench.simulated.data_sheet import key
from drives.bench.simulated.dictionary import Abort, Code, Dictionary

INVALID = 0x8000_0000  # bit 31: the object does not exist
BIT_30 = 0x4000_0000  # SYNC: the device produces it; TPDO: no remote request
EXTENDED = 0x2000_0000  # bit 29: 29-bit identifier, which this drive does not use
IDENTIFIER = 0x7FF
SYNC_AT, EMCY_AT = key(0x1005), key(0x1014)

# Identifiers that no configurable object may use (CiA 301, table "restricted CAN-IDs").
RESTRICTED = (
    (0x000, 0x000),
    (0x001, 0x07F),
    (0x101, 0x180),
    (0x581, 0x5FF),
    (0x601, 0x67F),
    (0x6E0, 0x6FF),
    (0x701, 0x77F),
    (0x780, 0x7FF),
)


def restricted(can_id: int) -> bool:
    return any(first <= can_id <= last for first, last in RESTRICTED)


def check(value: int) -> None:
    """A COB-ID that this drive can use. Raises Abort."""
    if value & EXTENDED or value & 0x1FFF_FFFF > IDENTIFIER or restricted(value & IDENTIFIER):
        raise Abort(Code.VALUE)


def check_change(before: int, value: int, exists: bool) -> None:
    """Bits 0 .. 29 may change only while the object is off, or on the way there. Raises Abort."""
    check(value)
    if exists and (before ^ value) & 0x3FFF_FFFF and not value & INVALID:
        raise Abort(Code.VALUE)


def guard(dictionary: Dictionary) -> None:
    """Put the rules on the identifiers of SYNC and EMCY."""

    def write_sync(value: int) -> None:
        before = dictionary.values[SYNC_AT]
        check(value & ~INVALID)
        if before & BIT_30 and value & BIT_30 and (before ^ value) & 0x3FFF_FFFF:
            raise Abort(Code.VALUE)  # not while the device produces SYNC

    def write_emcy(value: int) -> None:
        before = dictionary.values[EMCY_AT]
        check_change(before, value, not before & INVALID)

    dictionary.writers[SYNC_AT] = write_sync
    dictionary.writers[EMCY_AT] = write_emcy
