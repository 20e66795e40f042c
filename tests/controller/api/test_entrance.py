"""Who comes in a crowd: a stop first, the newest of those who say nothing, and nobody who is not closed."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import socket
from collections.abc import AsyncIterator, Callable, Iterator
from typing import Any

import pytest

from controller.api import entrance
from controller.api.entrance import Entrance

HALF = b"POST /api/v1/cycle/start HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Some: h"
HEAD = b"GET /api/v1/status HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
STOP = b"POST /api/v1/cycle/stop HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 0\r\n\r\n"
OF_ONE = 40


class Heard(asyncio.Protocol):
    """Keeps what came, in the order in which they came in."""

    def __init__(self, site: Site, at_s: float) -> None:
        self.site, self.at_s, self.said = site, at_s, b""

    def connection_made(self, transport: Any) -> None:
        self.transport = transport
        self.site.inside.append(self)

    def data_received(self, data: bytes) -> None:
        self.said += data


class Site:
    """A listening socket with a crowd before it, which nobody has looked at yet."""

    def __init__(self) -> None:
        self.inside, self.outside = list[Heard](), list[socket.socket]()
        self.listening = socket.socket()
        self.listening.bind(("127.0.0.1", 0))
        self.listening.listen(1000)

    def come(self, said: bytes, address: str = "127.0.0.1") -> None:
        one = socket.create_connection(self.listening.getsockname(), source_address=(address, 0))
        one.sendall(said)
        self.outside.append(one)

    def closed(self) -> list[bool]:
        """Of those who came, whether they were turned away."""
        return [_closed(one) for one in self.outside]

    @contextlib.asynccontextmanager
    async def open(self, at_once: int = 1000) -> AsyncIterator[Entrance]:
        made = Entrance(self.listening, lambda at_s: Heard(self, at_s), at_once=at_once, of_one=OF_ONE)
        yield made
        made.close()
        for one in self.inside:
            one.transport.abort()
        await asyncio.sleep(0)


def _closed(one: socket.socket) -> bool:
    one.setblocking(False)
    with contextlib.suppress(BlockingIOError):
        try:
            return one.recv(1) == b""
        except ConnectionError:
            return True
    return False


async def until(done: Callable[[], bool]) -> None:
    async with asyncio.timeout(60.0):
        while not done():
            await asyncio.sleep(0.001)


@pytest.fixture
def site() -> Iterator[Site]:
    made = Site()
    yield made
    for one in (*made.outside, made.listening):
        one.close()


def test_a_stop_behind_a_crowd_comes_in_before_it(site: Site) -> None:
    for k in range(300):
        site.come(HEAD if k % 3 else HALF)
    site.come(STOP)
    for _ in range(20):
        site.come(HEAD)

    async def all_in() -> None:
        async with site.open():
            await until(lambda: len(site.inside) == 1 + OF_ONE + OF_ONE // 4)
            await until(lambda: all(one.said for one in site.inside))

    asyncio.run(all_in())
    said = [one.said for one in site.inside]
    assert said == [STOP] + OF_ONE * [HEAD] + OF_ONE // 4 * [HALF]
    ages = [one.at_s for one in site.inside[1 : 1 + OF_ONE]]
    assert ages == sorted(ages, reverse=True), "the newest first"


def test_half_of_a_stop_is_none(site: Site) -> None:
    site.come(STOP)
    for _ in range(300):
        site.come(STOP[:-4] + b"\r\nX-Some: h")

    async def first_in() -> None:
        async with site.open():
            await until(lambda: len(site.inside) == 1 + OF_ONE // 4)
            await until(lambda: site.inside[0].said != b"")

    asyncio.run(first_in())
    assert site.inside[0].said == STOP


def test_who_has_spoken_since_he_came_is_not_closed_for_his_silence(
    site: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    looked, rank = set[socket.socket](), entrance._rank

    def later(one: socket.socket) -> int:
        silent = one not in looked
        looked.add(one)
        return 0 if silent else rank(one)

    monkeypatch.setattr(entrance, "_rank", later)
    site.come(STOP)
    for _ in range(300):
        site.come(HALF)

    async def first_in() -> None:
        async with site.open():
            await until(lambda: bool(site.inside) and site.inside[0].said != b"")

    asyncio.run(first_in())
    assert site.inside[0].said == STOP


def test_those_who_came_in_one_moment_of_a_coarse_clock_come_in(site: Site) -> None:
    for _ in range(20):
        site.come(HEAD)

    async def all_in() -> None:
        loop = asyncio.get_running_loop()
        loop.time = lambda: 7.0  # type: ignore[method-assign]
        try:
            async with site.open():
                for _ in range(100):
                    await asyncio.sleep(0)
        finally:
            del loop.time

    asyncio.run(all_in())
    assert len(site.inside) == 20


def test_who_is_not_let_in_is_closed_and_the_few_of_another_address_are_not(site: Site) -> None:
    for _ in range(5):
        site.come(HALF, "127.0.0.9")
    for _ in range(200):
        site.come(HALF)

    async def all_in() -> None:
        async with site.open():
            await until(lambda: len(site.inside) == 5 + OF_ONE // 4)
            await until(lambda: sum(site.closed()) >= 200 - OF_ONE // 4)
            assert site.closed() == 5 * [False] + (200 - OF_ONE // 4) * [True] + OF_ONE // 4 * [False]

    asyncio.run(all_in())


def test_of_a_crowd_that_is_larger_than_may_stand_there_some_are_looked_at_at_a_time(site: Site) -> None:
    for k in range(400):
        site.come(HALF, f"127.0.1.{k % 200 + 1}")
    site.come(STOP)
    waited = []

    async def stop_in() -> None:
        async with site.open(at_once=64) as made:
            while all(one.said != STOP for one in site.inside):
                waited.append(len(made._waiting))
                await asyncio.sleep(0.0)

    asyncio.run(stop_in())
    assert 0 < max(waited) <= 64


def test_without_files_it_rests_and_goes_on(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    failed = []

    class NoFiles(socket.socket):
        def accept(self) -> Any:
            if not failed:
                failed.append(True)
                raise OSError(errno.EMFILE, "Too many open files")
            return super().accept()

    monkeypatch.setattr(entrance, "REST_S", 0.01)
    site.listening = NoFiles(fileno=site.listening.detach())
    site.come(STOP)

    async def all_in() -> None:
        async with site.open():
            await until(lambda: len(site.inside) == 1)

    asyncio.run(all_in())
    assert failed


def test_after_its_end_nobody_comes_in_and_who_waited_is_closed(site: Site) -> None:
    for _ in range(50):
        site.come(HEAD)

    async def ended() -> None:
        async with site.open() as made:
            made._look()
        await asyncio.sleep(0.05)
        assert all(site.closed())

    asyncio.run(ended())
    assert len(site.inside) <= entrance.AT_A_TIME


@pytest.mark.parametrize(
    ("said", "first"),
    [
        (STOP, True),
        (STOP.replace(b"cycle/stop", b"cycle/hold"), True),
        (STOP.replace(b"cycle/stop", b"machine/estop"), True),
        (STOP.replace(b"POST", b"GET"), False),
        (STOP.replace(b"cycle/stop", b"cycle/start?x=/cycle/stop"), False),
        (STOP.replace(b"cycle/stop", b"cycle/stopped"), False),
        (b"\x16\x03\x01" + STOP, False),
    ],
)
def test_what_asks_for_a_stop(said: bytes, first: bool) -> None:
    assert bool(entrance.ASKS_FOR_STOP.match(said)) is first
