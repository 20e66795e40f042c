"""Block transfers, segment by segment: order, repetition, checksum, the way back to segments."""

from __future__ import annotations

import random

import pytest

from drives.bench.simulated.data_sheet import key
from drives.bench.simulated.dictionary import Dictionary
from drives.bench.simulated.sdo_server import BlockDownload, BlockUpload, SdoServer, checksum

SCRATCH = bytes.fromhex("022000")


def server(content: bytes = b"") -> tuple[SdoServer, Dictionary]:
    dictionary = Dictionary(5)
    dictionary.strings[key(0x2002)] = content
    return SdoServer(dictionary), dictionary


def upload(sdo: SdoServer, size: int, lose: set[int]) -> bytes:
    """A client that loses the segments whose running numbers are in ``lose``, once each."""
    (first,) = sdo.answer((b"\xa4" + SCRATCH + bytes([size])).ljust(8, b"\0"))
    assert first[0] == 0xC6
    length, got, seen = int.from_bytes(first[4:], "little"), b"", 0
    segments = sdo.answer(b"\xa3".ljust(8, b"\0"))
    while True:
        in_order = 0
        for segment in segments:
            seen += 1
            if seen not in lose and segment[0] & 0x7F == in_order + 1:
                got, in_order = got + segment[1:], in_order + 1
        complete = len(got) >= length and in_order == len(segments)
        segments = sdo.answer(bytes([0xA2, in_order, size]).ljust(8, b"\0"))
        if complete:
            break
    (end,) = segments
    data = got[: len(got) - (end[0] >> 2 & 7)]
    assert end[0] & 0xE3 == 0xC1 and checksum(data) == end[1] | end[2] << 8
    assert sdo.answer(b"\xa1".ljust(8, b"\0")) == []
    return data


@pytest.mark.parametrize("length", [0, 1, 6, 7, 8, 889, 890, 10_000])
@pytest.mark.parametrize("size", [1, 20, 127])
def test_an_upload_gives_every_byte(length: int, size: int) -> None:
    content = random.Random(length).randbytes(length)
    assert upload(server(content)[0], size, set()) == content


@pytest.mark.parametrize("lose", [{1}, {5}, {20}, {21, 22}, {3, 60, 61, 199}])
def test_a_lost_segment_is_sent_again(lose: set[int]) -> None:
    content = random.Random(1).randbytes(3000)
    assert upload(server(content)[0], 20, lose) == content


def download(sdo: SdoServer, content: bytes, lose: set[int]) -> bytes:
    (first,) = sdo.answer(b"\xc6" + SCRATCH + len(content).to_bytes(4, "little"))
    size, at, seen = first[4], 0, 0
    parts = [content[k : k + 7] for k in range(0, len(content), 7)] or [b""]
    while at < len(parts):
        block = parts[at : at + size]
        answers: list[bytes] = []
        for sequence, part in enumerate(block, 1):
            seen += 1
            last = at + sequence == len(parts)
            if seen not in lose or last or sequence == size:
                answers = sdo.answer(bytes([sequence | (0x80 if last else 0)]) + part.ljust(7, b"\0"))
        (answer,) = answers
        assert answer[0] == 0xA2
        at, size = at + answer[1], answer[2]
    unused = len(parts) * 7 - len(content)
    (end,) = sdo.answer(bytes([0xC1 | unused << 2]) + checksum(content).to_bytes(2, "little") + bytes(5))
    return end


@pytest.mark.parametrize("length", [1, 7, 8, 889, 890, 10_000])
def test_a_download_takes_every_byte(length: int) -> None:
    content = random.Random(length).randbytes(length)
    sdo, dictionary = server()
    assert download(sdo, content, set())[0] == 0xA1
    assert dictionary.strings[key(0x2002)] == content


@pytest.mark.parametrize("lose", [{1}, {5}, {126}, {128}, {3, 60, 130, 300}])
def test_a_download_asks_again_for_what_was_lost(lose: set[int]) -> None:
    content = random.Random(2).randbytes(3000)
    sdo, dictionary = server()
    assert download(sdo, content, lose)[0] == 0xA1
    assert dictionary.strings[key(0x2002)] == content


def test_a_number_is_written_by_block_as_well() -> None:
    sdo, dictionary = server()
    sdo.answer(bytes.fromhex("c665600004000000"))
    assert sdo.answer(bytes.fromhex("8178563412000000")) == [bytes.fromhex("a2017f0000000000")]
    sdo.answer(bytes([0xCD]) + checksum(bytes.fromhex("78563412")).to_bytes(2, "little") + bytes(5))
    assert dictionary.get(0x6065) == 0x1234_5678


def test_an_object_below_the_threshold_comes_expedited() -> None:
    assert server()[0].answer(bytes.fromhex("a400100014070000")) == [bytes.fromhex("4300100092010200")]


def test_the_checksum_is_the_standards() -> None:
    assert checksum(b"123456789") == 0x31C3


def test_an_abort_inside_a_block_ends_it() -> None:
    sdo, _ = server()
    sdo.answer(b"\xc6" + SCRATCH + b"\x40\0\0\0")
    sdo.answer(b"\x01abcdefg")
    assert sdo.answer(bytes.fromhex("8002200000000405")) == []
    assert not sdo.busy


def test_nothing_is_written_before_the_end() -> None:
    sdo, dictionary = server(b"old")
    sdo.answer(b"\xc6" + SCRATCH + b"\x07\0\0\0")
    sdo.answer(b"\x81abcdefg")
    assert dictionary.strings[key(0x2002)] == b"old"


def test_the_two_sides_fit_together() -> None:
    """The upload's segments are what the download's side takes."""
    content = random.Random(3).randbytes(1000)
    give, take = BlockUpload(content, 127, True), BlockDownload(True)
    answer = None
    for segment in give.start():
        answer = take.take(segment)
    assert answer is not None and answer[0][1] == 127
    for segment in give.acknowledged(127, 127):
        answer = take.take(segment)
    (end,) = give.acknowledged(answer[0][1], 127)
    assert take.end(end[0] >> 2 & 7, end[1] | end[2] << 8) == content
