"""How connections come in: all that wait are looked at first, and who asks for a stop is not behind a crowd.

asyncio takes one connection after another as they came, and makes a transport, a protocol and a parser for
each: two thousand half-open ones before a stop cost it most of a second. Here they are only taken from the
system, and what they have sent is looked at where it lies; then they come in a few at a time, in this order:

    who asks for a stop, who has sent the head of a request, all others; the newest of each first

and of the others of one address only the newest are kept. Nobody waits long: who is not let in is closed.
"""

from __future__ import annotations

import asyncio
import contextlib
import functools
import re
import socket
import ssl
from collections import Counter
from collections.abc import Callable
from typing import NamedTuple

AT_A_TIME = 4  # come in before what is already in has its turn again
FEWEST = 8  # of an address that may wait without having said a word
REST_S = 0.1  # where no more files can be opened
PEEKED = 2048  # bytes
ASKS_FOR_STOP = re.compile(rb"POST [^?\s]*/(?:cycle/(?:stop|hold)|machine/estop|jog/stop)[ ?]")

Factory = Callable[[float], asyncio.Protocol]


class Came(NamedTuple):
    """Somebody at the door; see ``_turn``."""

    rank: int  # 2: has asked for a stop; 1: has sent the head of another request
    at_s: float
    address: str
    socket: socket.socket


class Entrance:
    """Of one listening socket, on the running loop."""

    def __init__(
        self,
        listening: socket.socket,
        factory: Factory,
        *,
        at_once: int,
        of_one: int,
        tls: ssl.SSLContext | None = None,
        handshake_s: float = 10.0,
    ) -> None:
        """``factory`` is told when its connection came, by the loop's clock.

        ``at_once``: files that all who wait may take; ``of_one``: connections of an address.
        """
        self._listening, self._factory = listening, factory
        self._most, self._of_one = at_once, (max(FEWEST, of_one // 4), of_one, of_one)  # by rank
        self._tls, self._handshake_s = tls, handshake_s if tls is not None else None
        self._loop = asyncio.get_running_loop()
        self._waiting = list[Came]()  # who is next is last
        self._coming = dict[asyncio.Task[None], None]()
        listening.setblocking(False)
        self._open()

    def close(self) -> None:
        """Nobody comes in any more."""
        self._loop.remove_reader(self._listening)
        self._listening.close()
        for one in self._waiting:
            one.socket.close()
        self._waiting.clear()
        for task in self._coming:
            task.cancel()

    def _open(self) -> None:
        if self._listening.fileno() >= 0:
            self._loop.add_reader(self._listening, self._look)

    def _look(self) -> None:
        """Take all who stand outside, and let the first of them in."""
        was_empty = not self._waiting
        try:
            while len(self._waiting) < self._most:
                self._waiting.append(self._came(*self._listening.accept()))
        except (BlockingIOError, InterruptedError, ConnectionAbortedError):
            pass
        except OSError:  # no file is left: those that are open go on, and some of them end
            self._loop.remove_reader(self._listening)
            self._loop.call_later(REST_S, self._open)
        self._sort()
        if was_empty:
            self._let_in()

    def _came(self, one: socket.socket, address: tuple[str, int]) -> Came:
        one.setblocking(False)
        return Came(_rank(one), self._loop.time(), address[0], one)

    def _sort(self) -> None:
        """Who goes first is last; close who is too much."""
        kept, counted = list[Came](), Counter[tuple[str, int]]()
        for one in sorted(self._waiting, key=_turn, reverse=True):
            counted[one.address, one.rank] += 1
            fits = len(kept) < self._most // 2 and counted[one.address, one.rank] <= self._of_one[one.rank]
            if fits:
                kept.append(one)
            elif (rank := _rank(one.socket)) > one.rank:  # it has spoken since it came: it is sorted anew
                kept.append(one._replace(rank=rank))
            else:
                one.socket.close()
        self._waiting = sorted(kept, key=_turn)

    def _let_in(self) -> None:
        for one in [self._waiting.pop() for _ in range(min(AT_A_TIME, len(self._waiting)))]:
            task = self._loop.create_task(self._meet(one))
            self._coming[task] = None
            task.add_done_callback(self._coming.pop)
        if len(self._coming) > self._most:  # handshakes that do not go on
            next(iter(self._coming)).cancel()
        if self._waiting:
            self._loop.call_soon(self._let_in)

    async def _meet(self, one: Came) -> None:
        """A handshake that fails is its sender's affair."""
        with contextlib.suppress(OSError):  # TLS' errors and time-outs are such, too
            await self._loop.connect_accepted_socket(
                functools.partial(self._factory, one.at_s),
                one.socket,
                ssl=self._tls,
                ssl_handshake_timeout=self._handshake_s,
            )
            return
        one.socket.close()


def _rank(one: socket.socket) -> int:
    """By what has come, which stays where it is: half of a head is none, whatever it begins with."""
    said = b""
    with contextlib.suppress(OSError):
        said = one.recv(PEEKED, socket.MSG_PEEK)
    return int(b"\r\n\r\n" in said) and (2 if ASKS_FOR_STOP.match(said) else 1)


def _turn(one: Came) -> tuple[int, float]:
    """The larger of two goes first; sockets that came at one moment are not compared."""
    return one.rank, one.at_s
