"""The client's side of SDO against the simulated drives' server, and against answers that are none."""

from __future__ import annotations

import pytest

from drives.commissioning.sdo import AbortedError, Client, SilentError
from drives.simulated.aborts import Code
from drives.simulated.dictionary import Dictionary
from drives.simulated.sdo_server import SdoServer

MEMORY = (0x2002, 0)  # a domain of the simulated drive
HEARTBEAT = (0x1017, 0)


class Wire:
    """Hands requests to a server and keeps them."""

    def __init__(self) -> None:
        self.server = SdoServer(Dictionary(1))
        self.asked: list[bytes] = []

    def __call__(self, request: bytes) -> bytes:
        self.asked.append(request)
        return b"".join(self.server.answer(request))


@pytest.mark.parametrize("size", [0, 1, 4, 5, 6, 7, 8, 14, 15, 1000])
@pytest.mark.parametrize("segmented", [False, True])
def test_bytes_that_are_written_are_read_back(size: int, segmented: bool) -> None:
    wire, data = Wire(), bytes(n % 251 for n in range(size))
    client = Client(wire)
    client.download(*MEMORY, data, segmented)
    expedited = 0 < size <= 4 and not segmented
    assert len(wire.asked) == (1 if expedited else 1 + max(1, -(-size // 7)))
    assert client.upload(*MEMORY) == data


def test_a_known_size_is_all_that_is_taken() -> None:
    assert len(Client(lambda _: b"\x42\x17\x10\0\1\2\3\4").upload(*HEARTBEAT, 2)) == 2


def test_an_abort_has_code_and_words() -> None:
    with pytest.raises(AbortedError, match=r"code 0x06020000, there is no such object") as refused:
        Client(Wire()).upload(0x5FFF, 0)
    assert refused.value.code == Code.NO_OBJECT


@pytest.mark.parametrize(
    ("answer", "why", "code"),
    [
        (b"", "no answer", Code.TIMEOUT),
        (b"\x60\x17\x10\0\0\0\0\0", "command 0x60", Code.COMMAND),
    ],
)
def test_who_gives_up_tells_the_server(answer: bytes, why: str, code: Code) -> None:
    asked: list[bytes] = []

    def ask(request: bytes) -> bytes:
        asked.append(request)
        return answer

    with pytest.raises(SilentError, match=why):
        Client(ask).upload(*HEARTBEAT)
    assert asked[-1] == b"\x80\0\0\0" + code.to_bytes(4, "little")


def test_a_toggle_bit_that_stands_still_ends_the_transfer() -> None:
    answers = iter([b"\x41\x02\x20\0\x20\0\0\0", b"\0abcdefg", b"\0hijklmn", b""])
    with pytest.raises(SilentError, match="toggle"):
        Client(lambda _: next(answers)).upload(*MEMORY)


def test_an_answer_of_another_object_is_none() -> None:
    with pytest.raises(SilentError, match="1018h:01"):
        Client(lambda _: b"\x43\x18\x10\1\0\0\0\0").upload(*HEARTBEAT)
