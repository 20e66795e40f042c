"""Length of CAN frames to the bit: with check sum and stuff bits, for one payload or for all of them.

A classic frame with an 11-bit identifier, as it is on the wire (ISO 11898-1, 10.4):

    SOF  identifier  RTR IDE r0  DLC  data  CRC | delimiter  ACK  delimiter  EOF  interframe space
     1       11       1   1  1    4    8n    15 |     1       1       1       7          3
    `------------- 34 + 8n bits, stuffed ------'`------------- 13 bits, never stuffed -----------'

After five equal bits a bit of the other value is inserted, and it counts for the next five. So at
worst a stuff bit follows the first five bits and then every four: (34 + 8n - 1) // 4 of them. No
payload reaches that bound in every frame, because identifier, length and check sum are not free;
``longest_bits`` and ``mean_bits`` are what the payloads of one identifier really can do.

They are computed over all payloads at once. What the rest of a frame costs depends on the past only
through the check sum so far (2^15) and on the last run of equal bits (two values, length 1 to 4). So a
table of 8 x 2^15 entries is carried from the end of the frame to its beginning, a bit at a time, taking
the larger or the mean of both values of each free bit.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

CRC_BITS = 15
CRC_POLYNOMIAL = 0x4599  # x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1
CRC_MASK = (1 << 15) - 1
UNSTUFFED_BITS = 13  # from the CRC delimiter to the end of the interframe space
HEAD_BITS = 19  # from SOF to DLC
EXTENDED_FLAG, EXTENDED_MASK, STANDARD_MASK = 0x8000_0000, 0x1FFF_FFFF, 0x7FF

Table = NDArray[Any]  # (8 runs, 2^15 check sums): stuff bits from here to the end of the frame

# A run of equal bits as one number: 4 * value + length - 1. The fifth equal bit ends it with a stuff
# bit, which begins the next run: (run, bit) -> (next run, stuff bits).
_NEXT = tuple(
    tuple(
        (4 * bit, 0) if run // 4 != bit else (run + 1, 0) if run % 4 < 3 else (4 * (1 - bit), 1)
        for bit in (0, 1)
    )
    for run in range(8)
)
_NO_RUN = 4  # before SOF: as after one recessive bit; SOF is dominant and begins a run


def worst_bits(data_bytes: int) -> int:
    """Bits of a data frame with interframe space, stuffed as badly as the rule allows."""
    return 8 * data_bytes + 47 + (34 + 8 * data_bytes - 1) // 4


def frame_bits(can_id: int, data: bytes = b"", *, remote: bool = False) -> int:
    """Bits of this very frame with interframe space; ``can_id`` with Linux's flag for 29 bits.

    A remote frame has the length code of ``data`` and no data.
    """
    head = list(_head(can_id, len(data), remote))
    body = [] if remote else list(_bits_of(data))
    run, check, stuffed = _walk(head + body)
    for bit in _bits(check, CRC_BITS):
        run, more = _NEXT[run][bit]
        stuffed += more
    return len(head) + len(body) + CRC_BITS + stuffed + UNSTUFFED_BITS


def longest_bits(can_id: int, free: int, fixed: bytes = b"") -> int:
    """The longest data frame of this identifier over all payloads of ``fixed`` and ``free`` bytes more."""
    return round(_over_all(can_id, free, fixed, False))


def mean_bits(can_id: int, free: int, fixed: bytes = b"") -> float:
    """Its mean length where the ``free`` bytes are evenly random: exact, not sampled."""
    return _over_all(can_id, free, fixed, True)


@lru_cache(maxsize=1024)
def _over_all(can_id: int, free: int, fixed: bytes, mean: bool) -> float:
    run, check, stuffed = _walk([*_head(can_id, len(fixed) + free, False), *_bits_of(fixed)])
    rest = float(_tables(free, mean)[run, check])
    return 8 * (len(fixed) + free) + HEAD_BITS + CRC_BITS + UNSTUFFED_BITS + stuffed + rest


def _head(can_id: int, length: int, remote: bool) -> Iterator[int]:
    """SOF to DLC."""
    yield 0
    if can_id & EXTENDED_FLAG:
        identifier = can_id & EXTENDED_MASK
        yield from _bits(identifier >> 18, 11)
        yield from (1, 1)  # SRR, IDE
        yield from _bits(identifier, 18)
        yield from (int(remote), 0, 0)
    else:
        yield from _bits(can_id & STANDARD_MASK, 11)
        yield from (int(remote), 0, 0)
    yield from _bits(length, 4)


def _bits(value: int, count: int) -> Iterator[int]:
    """The ``count`` lowest bits, highest first, as they go over the wire."""
    return ((value >> at) & 1 for at in range(count - 1, -1, -1))


def _bits_of(data: bytes) -> Iterator[int]:
    return (bit for byte in data for bit in _bits(byte, 8))


def _walk(bits: Iterable[int]) -> tuple[int, int, int]:
    """(run, check sum, stuff bits so far) after these bits of a frame."""
    run, check, stuffed = _NO_RUN, 0, 0
    for bit in bits:
        run, more = _NEXT[run][bit]
        stuffed += more
        check = (check << 1 & CRC_MASK) ^ (CRC_POLYNOMIAL if (check >> 14) ^ bit else 0)
    return run, check, stuffed


@lru_cache(maxsize=32)
def _tables(free_bytes: int, mean: bool) -> Table:
    """Stuff bits still to come, with so many free bytes before the check sum."""
    if not free_bytes:
        return _of_check_sum().astype(np.float64 if mean else np.int8)
    table = _tables(free_bytes - 1, mean)
    for _ in range(8):
        zero, one = (_before(table, bit) for bit in (0, 1))
        table = 0.5 * (zero + one) if mean else np.maximum(zero, one)
    return table


def _before(table: Table, bit: int) -> Table:
    """The table one bit earlier, where that bit is known."""
    check = np.arange(CRC_MASK + 1)
    after = (check << 1 & CRC_MASK) ^ np.where((check >> 14) ^ bit, CRC_POLYNOMIAL, 0)
    moved = table[:, after]
    rows, more = zip(*(_NEXT[run][bit] for run in range(8)), strict=True)
    found: Table = moved[list(rows)] + np.array(more, dtype=table.dtype)[:, None]
    return found


def _of_check_sum() -> Table:
    """Stuff bits within the check sum itself, which is known by then."""
    runs = np.repeat(np.arange(8)[:, None], CRC_MASK + 1, axis=1)
    count = np.zeros_like(runs)
    next_run, more = (np.array([[step[k] for step in row] for row in _NEXT]) for k in (0, 1))
    for at in range(CRC_BITS - 1, -1, -1):
        bits = np.arange(CRC_MASK + 1)[None, :] >> at & 1
        count += more[runs, bits]
        runs = next_run[runs, bits]
    return count
