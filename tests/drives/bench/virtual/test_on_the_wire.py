"""Frame times and arbitration of the stepped bus, against frames written out as bits (``bit_exact``).

Nothing of the model is from ``drives``: arbitration is done bit by bit, as the wire does it. All who
send put their next bit on it, one dominant bit (0) makes the wire dominant, and who sent a recessive bit
(1) there has lost.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import pytest
from support.oracles import frame_bits

from drives import pdo
from drives.bench.virtual.virtual_bus import SteppedBus

BIT_RATE = 500_000
# Many frames of few identifiers: what differs is RTR and IDE. 5A5h is the base of the extended two.
BASES = (0x000, 0x001, 0x123, 0x5A5, 0x7FE, 0x7FF)
EXTENSIONS = (0x00000, 0x00001, 0x15555, 0x3FFFF)
STUBBORN = bytes.fromhex("000f1f3c78c3e1f0ff")  # long runs


@dataclass
class Frame:
    name: int
    extended: bool
    remote: bool
    length: int
    data: bytes

    @property
    def can_id(self) -> int:
        return self.name | pdo.EXTENDED_FLAG * self.extended | pdo.REMOTE_FLAG * self.remote

    @property
    def packed(self) -> bytes:
        return pdo.FRAME.pack(self.can_id, self.length, self.data)

    @property
    def bits(self) -> int:
        return frame_bits.length(self.name, self.data or bytes(self.length), self.remote, self.extended)

    @cached_property
    def field(self) -> str:
        """Identifier to IDE, or to the second RTR, as sent."""
        rtr = "1" if self.remote else "0"
        if not self.extended:
            return f"{self.name:011b}" + rtr + "0"
        return f"{self.name >> 18:011b}" + "11" + f"{self.name & 0x3FFFF:018b}" + rtr


def random_frame(rng: random.Random) -> Frame:
    extended, remote, length = rng.random() < 0.5, rng.random() < 0.3, rng.randint(0, 8)
    name = rng.randrange(1 << (29 if extended else 11))
    if rng.random() < 0.5:
        name = rng.choice(BASES) << (18 if extended else 0) | (rng.choice(EXTENSIONS) if extended else 0)
    data = bytes(rng.choice(STUBBORN) for _ in range(length)) if rng.random() < 0.3 else rng.randbytes(length)
    return Frame(name, extended, remote, length, b"" if remote else data)


def winner(waiting: Sequence[Frame]) -> Frame:
    """Who is left when all have sent their field at once; of equal ones, who came first."""
    left, at = list(waiting), 0
    while len({frame.field for frame in left}) > 1:
        wire = min(frame.field[at] for frame in left)  # wired AND
        left = [frame for frame in left if frame.field[at] == wire]
        at += 1
    return left[0]


def carried(frames: Sequence[Frame], senders: int, rng: random.Random) -> list[tuple[bytes, float]]:
    """What a bus makes of frames that all wait at its beginning, with the times of their ends in s."""
    bus = SteppedBus(BIT_RATE)
    sources = [bus.connect(lambda _frame, _at_s: None) for _ in range(senders)]
    heard: list[tuple[bytes, float]] = []
    bus.watch_all(lambda frame, at_s: heard.append((frame, at_s)))
    for frame in frames:
        assert bus.submit(rng.choice(sources), 0.0, frame.can_id, frame.packed)
    bus.advance(1.0)
    assert bus.busy_s == pytest.approx(heard[-1][1], abs=1e-12)
    return heard


def compare(count: int, seed: int, at_once: int = 20) -> None:
    rng = random.Random(seed)
    for _ in range(count // at_once):
        frames = [random_frame(rng) for _ in range(at_once)]
        heard = carried(frames, 7, rng)
        ends = [0.0, *(at_s for _, at_s in heard)]
        lasted = [(end - begin) * BIT_RATE for begin, end in pairwise(ends)]
        for (packed, _), bits in zip(heard, lasted, strict=True):
            expected = winner(frames)
            assert packed == expected.packed, (seed, expected)
            assert bits == pytest.approx(expected.bits, abs=1e-6), (seed, expected)
            frames.remove(expected)


def test_frames_take_their_own_length_and_win_by_their_bits() -> None:
    compare(4000, seed=1)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2, 7))
def test_100_000_frames_take_their_own_length_and_win_by_their_bits(seed: int) -> None:
    compare(20_000, seed)


def test_of_one_base_identifier_data_goes_before_remote_and_both_before_extended() -> None:
    base, ext = 0x123, pdo.EXTENDED_FLAG | 0x123 << 18
    order = [base, base | pdo.REMOTE_FLAG, ext, ext | pdo.REMOTE_FLAG, ext | 1, 0x124]
    bus = SteppedBus()
    source = bus.connect(lambda _frame, _at_s: None)
    heard: list[int] = []
    bus.watch_all(lambda frame, _at_s: heard.append(pdo.unpack(frame)[0]))
    for can_id in reversed(order):
        bus.submit(source, 0.0, can_id, bytes(pdo.frame(can_id)))
    bus.advance(1.0)
    assert heard == order


def test_of_two_senders_of_one_identifier_the_first_goes_first() -> None:
    bus = SteppedBus()
    one, two = (bus.connect(lambda _frame, _at_s: None) for _ in range(2))
    heard: list[bytes] = []
    bus.watch_all(lambda frame, _at_s: heard.append(frame))
    frames = [bytes(pdo.frame(0x181, bytes([n]))) for n in (9, 5, 7, 1)]
    for n, frame in enumerate(frames):
        bus.submit((one, two)[n % 2], 0.0, 0x181, frame)
    bus.advance(1.0)
    assert heard == frames


def test_a_frame_on_the_wire_is_not_interrupted_by_a_better_one() -> None:
    bus = SteppedBus()
    source = bus.connect(lambda _frame, _at_s: None)
    heard: list[int] = []
    bus.watch_all(lambda frame, _at_s: heard.append(pdo.unpack(frame)[0]))
    bus.submit(
        source, 0.0, pdo.EXTENDED_FLAG | 0x1FFF_FFFF, bytes(pdo.frame(pdo.EXTENDED_FLAG | 0x1FFF_FFFF))
    )
    bus.submit(source, 1e-6, 0x000, bytes(pdo.frame(0x000)))
    bus.advance(1.0)
    assert heard == [pdo.EXTENDED_FLAG | 0x1FFF_FFFF, 0x000]


def test_an_error_frame_is_a_word_to_ports_and_goes_last() -> None:
    bus = SteppedBus()
    sender, listener = bus.port(), bus.port()
    for can_id in (pdo.ERROR_FLAG | 0x40, pdo.EXTENDED_FLAG | 0x1FFF_FFFF):
        sender.send(pdo.frame(can_id, bytes(8)))
    bus.advance(1.0)
    buffer, heard = bytearray(16), []
    while listener.receive_into(buffer):
        heard.append(pdo.unpack(buffer)[0])
    assert heard == [pdo.EXTENDED_FLAG | 0x1FFF_FFFF, pdo.ERROR_FLAG | 0x40]
