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

A bus needs the length of every frame it carries: ``counter`` counts sixteen bits at a time, by tables
over (run, sixteen bits) and over the sixteen bits that meet the check sum. In a PDO of ours the first sixteen
are a word that seldom changes.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable, Iterator
from functools import cache, lru_cache
from struct import Struct
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from drives.pdo import DATA_AT, ERROR_FLAG, EXTENDED_FLAG, LENGTH_AT, PDO_BYTES, REMOTE_FLAG

CRC_BITS: Final = 15
CRC_POLYNOMIAL = 0x4599  # x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1
CRC_MASK = (1 << 15) - 1
UNSTUFFED_BITS = 13  # from the CRC delimiter to the end of the interframe space
HEAD_BITS = 19  # from SOF to DLC
EXTENDED_HEAD_BITS = 20  # more of them: SRR, IDE moved, 18 of the identifier, r1
EXTENDED_MASK, STANDARD_MASK = 0x1FFF_FFFF, 0x7FF
MAX_HEADS = 4096  # heads kept; a bus in operation has some dozens
BEGIN_AT = DATA_AT + 2  # the end of a head with the first word of the data
_BEGIN_AND_TWO_WORDS: Final = Struct(f">{BEGIN_AT}s2H").unpack_from

Table = NDArray[Any]  # (8 runs, 2^15 check sums): stuff bits from here to the end of the frame
Counter = Callable[[int, bytes], int]

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


def worst_bits(data_bytes: int, extended: bool = False) -> int:
    """Bits of a data frame with interframe space, stuffed as badly as the rule allows."""
    stuffable = HEAD_BITS + EXTENDED_HEAD_BITS * extended + 8 * data_bytes + CRC_BITS
    return stuffable + (stuffable - 1) // 4 + UNSTUFFED_BITS


def worst_case(can_id: int, frame: bytes) -> int:
    """Bits that a packed frame has at most; a remote frame has no data, and no error frame has."""
    data_bytes = 0 if can_id & (REMOTE_FLAG | ERROR_FLAG) else frame[LENGTH_AT]
    return worst_bits(data_bytes, bool(can_id & EXTENDED_FLAG))


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


@cache
def counter() -> Counter:
    """Bits of this very frame, as ``frame_bits`` counts them, of identifier with flags and packed frame.

    An error frame counts as a remote frame of its identifier: it has no data that would be on a wire.
    """
    step, step_check = (_packed(*_steps(bits)) for bits in (16, 8))
    end = _of_check_sum().astype(np.uint8).tobytes()
    check_16, check_8 = (array("H", _remainders(bits).astype(np.uint16).tobytes()) for bits in (16, 8))
    known: dict[int, Head] = {}
    begun: dict[bytes, tuple[int, int, int]] = {}  # what a status- or controlword makes of it, for PDOs

    def bits_of(can_id: int, frame: bytes) -> int:
        word: int
        last_word: int
        head, word, last_word = _BEGIN_AND_TWO_WORDS(frame)
        begin = begun.get(head)
        if begin is not None:
            run, check, bits = begin
            stuffed = step[run | word]
            check = check_16[check ^ word]
            bits += stuffed >> 3
            stuffed = step[(stuffed & 7) << 16 | last_word]
            check = check_16[check << 1 ^ last_word]
            return bits + (stuffed >> 3) + end[(stuffed & 7) << CRC_BITS | check]
        return in_full(can_id, frame)

    def in_full(can_id: int, frame: bytes) -> int:
        head = known.get(can_id << 4 | frame[LENGTH_AT])
        if head is None:
            head = _remembered(known, can_id, frame[LENGTH_AT])
        run, check, bits, words, last = head
        if can_id < ERROR_FLAG and frame[LENGTH_AT] == PDO_BYTES:
            word = words(frame)[0]
            stuffed = step[run << 16 | word]
            if len(begun) >= MAX_HEADS:
                begun.clear()
            begun[frame[:BEGIN_AT]] = (
                (stuffed & 7) << 16,
                check_16[check << 1 ^ word] << 1,
                bits + (stuffed >> 3),
            )
        for word in words(frame):
            stuffed = step[run << 16 | word]
            run = stuffed & 7
            bits += stuffed >> 3
            check = check_16[check << 1 ^ word]
        if last:
            stuffed = step_check[run << 8 | frame[last]]
            run = stuffed & 7
            bits += stuffed >> 3
            check = (check << 8 & CRC_MASK) ^ check_8[check >> 7 ^ frame[last]]
        return bits + end[run << CRC_BITS | check]

    return bits_of


# What all frames of an identifier and a length have in common: run and check sum after the head; all bits
# but the stuff bits to come; what unpacks the data in words of 16 bits; where an odd last byte is, or 0.
Head = tuple[int, int, int, Callable[[bytes], tuple[int, ...]], int]


def _remembered(known: dict[int, Head], can_id: int, length: int) -> Head:
    if len(known) >= MAX_HEADS:
        known.clear()
    bare = bool(can_id & (REMOTE_FLAG | ERROR_FLAG))
    head = list(_head(can_id, length, bare))
    run, check, stuffed = _walk(head)
    data_bytes = 0 if bare else length
    bits = len(head) + stuffed + 8 * data_bytes + CRC_BITS + UNSTUFFED_BITS
    words = Struct(f">{DATA_AT}x{data_bytes // 2}H").unpack_from
    last = DATA_AT + data_bytes - 1 if data_bytes % 2 else 0
    return known.setdefault(can_id << 4 | length, (run, check, bits, words, last))


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
    return _steps(CRC_BITS)[1]


def _steps(bits: int) -> tuple[Table, Table]:
    """(next run, stuff bits) over so many bits, by run and by their value; shape (8, 2^bits) each."""
    if bits > 8:
        runs, count = _steps(bits - 8)
        runs_8, count_8 = _steps(8)
        count = count[:, :, None] + count_8[runs]
        return runs_8[runs].reshape(8, -1), count.reshape(8, -1)
    runs = np.repeat(np.arange(8, dtype=np.uint8)[:, None], 1 << bits, axis=1)
    count = np.zeros_like(runs)
    next_run, more = (np.array([[step[k] for step in row] for row in _NEXT], np.uint8) for k in (0, 1))
    for at in range(bits - 1, -1, -1):
        value = np.arange(1 << bits)[None, :] >> at & 1
        count += more[runs, value]
        runs = next_run[runs, value]
    return runs, count


def _packed(runs: Table, count: Table) -> bytes:
    """``_steps`` as one byte each: 8 * stuff bits + next run."""
    return (count << 3 | runs).astype(np.uint8).tobytes()


def _remainders(bits: int) -> Table:
    """Check sums after so many bits from zero, by the value of the bits."""
    check = np.zeros(1 << bits, dtype=np.int64)
    for at in range(bits - 1, -1, -1):
        bit = np.arange(1 << bits) >> at & 1
        check = (check << 1 & CRC_MASK) ^ np.where((check >> 14) ^ bit, CRC_POLYNOMIAL, 0)
    return check
