"""SDO dialogues byte by byte: request, expected answer (CiA 301, 7.2.4)."""

from __future__ import annotations

import pytest

from drives.bench.simulated.dictionary import Dictionary
from drives.bench.simulated.sdo_server import SdoServer

NAME = b"Directrix simulated drive, one axis, CiA 402"

ROWS = [
    ("an expedited upload says how many bytes count", "4066600000000000", "4b6660000a000000"),
    ("four bytes", "4000100000000000", "4300100092010200"),
    ("a negative value", "40c2600200000000", "4fc26002fd000000"),
    ("an expedited download", "2fc2600102000000", "60c2600100000000"),
    ("a download without a size fills the object", "22c2600102000000", "60c2600100000000"),
    ("no such object", "4000500000000000", "8000500000000206"),
    ("no such sub-index", "40c2600900000000", "80c2600911000906"),
    ("read only", "2b41600000000000", "8041600002000106"),
    ("too long", "23c2600102000000", "80c2600112000706"),
    ("too short", "2f65600002000000", "8065600013000706"),
    ("too high", "2b5a600009000000", "805a600031000906"),
    ("too low", "2fc2600100000000", "80c2600132000906"),
    ("an unknown command", "e000100000000000", "8000100001000405"),
    ("a block upload needs a block size", "a000100000000000", "8000100002000405"),
    ("a block upload says how long the object is", "a400100014000000", "c600100004000000"),
    ("a block download gets a block size", "c617100002000000", "a41710007f000000"),
    ("a segment without a beginning", "6000000000000000", "8000000001000405"),
]


def server() -> SdoServer:
    return SdoServer(Dictionary(5))


@pytest.mark.parametrize(("reason", "request_hex", "answer_hex"), ROWS)
def test_a_request_has_exactly_this_answer(reason: str, request_hex: str, answer_hex: str) -> None:
    assert [answer.hex() for answer in server().answer(bytes.fromhex(request_hex))] == [answer_hex], reason


def test_a_long_string_comes_in_segments_with_a_toggle() -> None:
    sdo, got, toggle = server(), b"", 0
    (first,) = sdo.answer(bytes.fromhex("4008100000000000"))
    assert first == bytes.fromhex("41081000") + len(NAME).to_bytes(4, "little")
    while True:
        (part,) = sdo.answer(bytes([0x60 | toggle]).ljust(8, b"\0"))
        assert part[0] & 0xF0 == toggle
        got += part[1 : 8 - (part[0] >> 1 & 7)]
        if part[0] & 1:
            break
        toggle ^= 0x10
    assert got == NAME


def test_a_segmented_download_writes_at_its_last_segment() -> None:
    dictionary = Dictionary(5)
    sdo = SdoServer(dictionary)
    assert sdo.answer(bytes.fromhex("2165600004000000")) == [bytes.fromhex("6065600000000000")]
    assert sdo.answer(bytes.fromhex("0778563412000000")) == [bytes.fromhex("2000000000000000")]
    assert dictionary.get(0x6065) == 0x12345678


def test_a_wrong_toggle_ends_the_transfer() -> None:
    sdo = server()
    sdo.answer(bytes.fromhex("4008100000000000"))
    assert sdo.answer(bytes.fromhex("7000000000000000")) == [bytes.fromhex("8008100000000305")]
    assert sdo.answer(bytes.fromhex("6000000000000000")) == [bytes.fromhex("8008100001000405")]


def test_an_abort_by_the_client_has_no_answer() -> None:
    assert server().answer(bytes.fromhex("8008100000000405")) == []
