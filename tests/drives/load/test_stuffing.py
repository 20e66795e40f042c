"""Frame lengths to the bit, against frames that are written out (``bit_exact``)."""

from __future__ import annotations

import random

import pytest
from support.oracles import frame_bits

from drives import pdo
from drives.load import stuffing
from drives.pdo import EXTENDED_FLAG, REMOTE_FLAG

IDENTIFIERS = (0x000, 0x080, 0x081, 0x185, 0x201, 0x203, 0x2AA, 0x585, 0x605, 0x701, 0x77F, 0x7FF)
STUBBORN = (0x00, 0x0F, 0x1F, 0x3C, 0x78, 0xC3, 0xE1, 0xF0, 0xFF)  # bytes of long runs


def payload(rng: random.Random, length: int) -> bytes:
    """Half of them random, half of long runs of equal bits."""
    if rng.random() < 0.5:
        return rng.randbytes(length)
    return bytes(rng.choice(STUBBORN) for _ in range(length))


@pytest.mark.parametrize(("data_bytes", "bits"), [(0, 55), (1, 65), (2, 75), (4, 95), (6, 115), (8, 135)])
def test_the_worst_by_the_rule_is_the_published_length(data_bytes: int, bits: int) -> None:
    assert stuffing.worst_bits(data_bytes) == bits


def test_sync_is_51_bits_and_58_with_a_counter_of_one() -> None:
    assert stuffing.frame_bits(0x080) == frame_bits.length(0x080) == 51
    assert stuffing.frame_bits(0x080, b"\x01") == frame_bits.length(0x080, b"\x01")


def test_a_known_check_sum_comes_out() -> None:
    # Identifier 0x000, no data, all zero: the remainder of nothing is nothing.
    assert frame_bits.remainder("0" * 19) == "0" * 15
    # One bit alone leaves x^15 mod the generator: the generator without its highest bit.
    assert frame_bits.remainder("0" * 18 + "1") == frame_bits.GENERATOR[1:]


def test_frames_of_any_kind_are_as_long_as_written_out() -> None:
    rng = random.Random(1)
    for _ in range(2000):
        data, remote = payload(rng, rng.randint(0, 8)), rng.random() < 0.2
        short, long = rng.randrange(0x800), rng.randrange(1 << 29)
        assert stuffing.frame_bits(short, data, remote=remote) == frame_bits.length(short, data, remote)
        extended = stuffing.frame_bits(long | EXTENDED_FLAG, data, remote=remote)
        assert extended == frame_bits.length(long, data, remote, extended=True)


def test_the_counter_of_the_bus_counts_every_bit() -> None:
    rng, bits_of = random.Random(3), stuffing.counter()
    for _ in range(4000):
        data, remote = payload(rng, rng.randint(0, 8)), rng.random() < 0.2
        extended = rng.random() < 0.5
        can_id = rng.randrange(1 << (29 if extended else 11))
        flags = EXTENDED_FLAG * extended | REMOTE_FLAG * remote
        frame = bytes(pdo.FRAME.pack(can_id | flags, len(data), b"" if remote else data))
        assert bits_of(can_id | flags, frame) == frame_bits.length(can_id, data, remote, extended)
        assert bits_of(can_id | flags, frame) <= stuffing.worst_case(can_id | flags, frame)


def test_the_counter_looks_at_no_byte_behind_the_data() -> None:
    frame = bytearray(pdo.frame(0x181, b"\x37\x12\x05"))
    frame[pdo.DATA_AT + 3 :] = b"\x55" * 5
    assert stuffing.counter()(0x181, bytes(frame)) == frame_bits.length(0x181, b"\x37\x12\x05")


def test_an_extended_frame_is_twenty_bits_longer_and_five_of_stuffing_at_worst() -> None:
    for n in range(9):
        assert stuffing.worst_bits(n, extended=True) == stuffing.worst_bits(n) + 25


def test_no_frame_is_longer_than_the_rule_says() -> None:
    rng = random.Random(2)
    for _ in range(2000):
        can_id, data = rng.randrange(0x800), payload(rng, rng.randint(0, 8))
        longest = stuffing.longest_bits(can_id, len(data))
        assert frame_bits.length(can_id, data) <= longest <= stuffing.worst_bits(len(data))


@pytest.mark.parametrize("can_id", IDENTIFIERS)
def test_longest_and_mean_of_one_byte_are_those_of_all_256(can_id: int) -> None:
    lengths = [frame_bits.length(can_id, bytes([value])) for value in range(256)]
    assert stuffing.longest_bits(can_id, 1) == max(lengths)
    assert stuffing.mean_bits(can_id, 1) == sum(lengths) / 256
    behind = [frame_bits.length(can_id, bytes([0x0F, 0x00, value])) for value in range(256)]
    assert stuffing.longest_bits(can_id, 1, b"\x0f\x00") == max(behind)
    assert stuffing.mean_bits(can_id, 1, b"\x0f\x00") == sum(behind) / 256


def test_longest_and_mean_of_two_bytes_are_those_of_all_65536() -> None:
    lengths = [frame_bits.length(0x203, value.to_bytes(2, "little")) for value in range(1 << 16)]
    assert stuffing.longest_bits(0x203, 2) == max(lengths)
    assert stuffing.mean_bits(0x203, 2) == pytest.approx(sum(lengths) / len(lengths), rel=1e-12)


CYCLIC = [(0x200 + node, 6) for node in range(1, 6)] + [(0x180 + node, 6) for node in range(1, 6)]


@pytest.mark.parametrize(("can_id", "data_bytes"), [*CYCLIC[::6], (0x202, 8), (0x583, 8), (0x081, 8)])
def test_a_payload_of_the_longest_length_exists_and_none_is_longer(can_id: int, data_bytes: int) -> None:
    """Over all 2^48 or 2^64 payloads, by a search that knows nothing of the tables."""
    longest = stuffing.longest_bits(can_id, data_bytes)
    payload = next(frame_bits.frames_of(can_id, data_bytes, longest))
    assert frame_bits.length(can_id, payload) == stuffing.frame_bits(can_id, payload) == longest
    assert next(frame_bits.frames_of(can_id, data_bytes, longest + 1), None) is None


@pytest.mark.parametrize(("can_id", "fixed"), [(0x204, b"\x0f\x00"), (0x184, b"\x37\x12"), (0x205, b"")])
def test_the_mean_is_that_of_many_random_payloads(can_id: int, fixed: bytes) -> None:
    rng, free = random.Random(4), 4
    lengths = [frame_bits.length(can_id, fixed + rng.randbytes(free)) for _ in range(8000)]
    mean = sum(lengths) / len(lengths)
    spread = (sum((length - mean) ** 2 for length in lengths) / len(lengths)) ** 0.5
    assert abs(stuffing.mean_bits(can_id, free, fixed) - mean) < 4.0 * spread / len(lengths) ** 0.5
