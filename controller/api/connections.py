"""Bounds of the panel's connections: how many there may be, and how long one may keep others waiting.

    connections = Connections(Limits.within(raise_file_limit()))
    connections.serve(app, host=host, port=port)

Half a request holds a file of this process for as long as its sender likes, and without files nobody
is heard any more: not the one, either, who wants the machine to stop. So a request has to come within
a time, and there are fewer connections than files. Where there are too many, the busiest address
loses its oldest one of those that keep us waiting, in the same way as most of them do. A few too many are
looked at a moment after somebody came, many at once. Who comes in a crowd is sorted before: ``entrance``.
"""

from __future__ import annotations

import asyncio
import gc
import resource
import socket
from collections import Counter, defaultdict
from typing import Any, NamedTuple

import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from controller.api.answers import Refusal
from controller.api.entrance import Entrance

MAX_FILES = 8192  # that the panel asks for where the system's limit is lower
MAX_CONNECTIONS = (
    1024  # connections; what comes beside them (store, uploads, service) needs about a hundred files
)
HEADER_S = 10.0
BODY_S = 40.0  # more patient than uploads, which answer their sender
SLOWEST_BYTES_S = 250.0  # of a body
GRACE_S = 0.25
SLACK = 1.125  # of the bounds: nobody is let in above it, not for a moment
QUEUE = 4096  # connections that the system keeps until they are looked at; Linux' own bound
LEAVE_S = 5.0  # for the last answer of a connection to go out


def _silent() -> bytes:
    """The answer to a request whose rest did not come (RFC 9110, 15.5.9), as all others look."""
    body = Refusal.of(408, "slow", "request_silent").response().body
    head = "HTTP/1.1 408 Request Timeout\r\nConnection: close\r\nContent-Type: application/json\r\n"
    return f"{head}Content-Length: {len(body)}\r\n\r\n".encode() + bytes(body)


SILENT = _silent()


class Limits(NamedTuple):
    """``at_once``: connections that may stand before the door; times in s."""

    most: int
    most_per_address: int
    at_once: int
    header_s: float = HEADER_S
    body_s: float = BODY_S
    slowest_bytes_s: float = SLOWEST_BYTES_S
    grace_s: float = GRACE_S

    @classmethod
    def within(cls, files: int) -> Limits:
        """For a process that may have so many files open."""
        most = min(MAX_CONNECTIONS, files // 4)
        return cls(most, most // 4, min(2 * MAX_CONNECTIONS, files // 4))


def raise_file_limit() -> int:
    """As many files as are wanted, or as the system allows; how many that is."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = MAX_FILES if hard == resource.RLIM_INFINITY else min(MAX_FILES, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
        return wanted
    return MAX_FILES if soft == resource.RLIM_INFINITY else soft


class Connections:
    """All connections of one server; ``protocol`` is what uvicorn makes for each."""

    def __init__(self, limits: Limits) -> None:
        self.limits = limits
        self._shedding = False
        self._counted = set[_Bounded]()  # those that are neither closed nor WebSockets ...
        self._from = Counter[str]()  # ... and how many an address has of them

    def protocol(self, **wiring: Any) -> asyncio.Protocol:
        """``wiring``: as uvicorn gives it to its own."""
        return _Bounded(self, **wiring)

    def serve(self, app: Any, **options: Any) -> None:
        """Until the process is asked to end; ``options`` of uvicorn."""
        self.server(app, **options).run()

    def server(self, app: Any, **options: Any) -> Server:
        """With its port bound."""
        bounds: dict[str, Any] = {"http": self.protocol, "ws": WebSocket}
        return Server(uvicorn.Config(app, **options, **bounds), self.limits)

    def came(self, one: _Bounded) -> None:
        """A connection was made."""
        self._counted.add(one)
        self._from[one.address] += 1
        many = len(self._counted) > SLACK * self.limits.most
        if many or self._from[one.address] > SLACK * self.limits.most_per_address:
            self._shed(one.connections)
        elif not self._shedding:
            self._shedding = True
            one.loop.call_later(self.limits.grace_s, self._shed, one.connections)

    def went(self, one: _Bounded) -> None:
        """It is no more, or another protocol's."""
        if one not in self._counted:
            return
        self._counted.remove(one)
        self._from[one.address] -= 1
        if not self._from[one.address]:
            del self._from[one.address]

    def _shed(self, connections: set[Any]) -> None:
        """Close what is too much: of the busiest address first, and of that what deserves it most."""
        self._shedding = False
        open_ones = [one for one in connections if not one.transport.is_closing()]
        by_address: dict[str, _Kinds] = defaultdict(_Kinds)
        for one in sorted(open_ones, key=lambda one: -getattr(one, "since_s", 0.0)):
            by_address[_address(one)].take(one)
        sizes = {address: kinds.size for address, kinds in by_address.items()}
        left = len(open_ones)
        while left:
            busiest = max(reversed(sizes), key=sizes.__getitem__)  # of as busy ones who came last is spared
            if left <= self.limits.most and sizes[busiest] <= self.limits.most_per_address:
                break
            closed = by_address[busiest].pop()
            closed.transport.abort()
            self.went(closed)
            sizes[busiest] -= 1
            left -= 1


class _Kinds:
    """The connections of an address, as they come from the newest to the oldest."""

    def __init__(self) -> None:
        self._served, self._waiting, self._half_open = list[Any](), list[Any](), list[Any]()

    @property
    def size(self) -> int:
        return len(self._served) + len(self._waiting) + len(self._half_open)

    def take(self, one: Any) -> None:
        """A WebSocket, which has no time here, is among those that are answered."""
        if not isinstance(one, _Bounded) or not one.waits:
            self._served.insert(0, one)
        else:
            (self._half_open if one.half_open else self._waiting).append(one)

    def pop(self) -> Any:
        """The oldest that keeps us waiting, of the kind of most of them; else the newest."""
        return (max(self._half_open, self._waiting, key=len) or self._served).pop()


class Server(uvicorn.Server):
    """uvicorn's, with an entrance of its own."""

    def __init__(self, config: uvicorn.Config, limits: Limits) -> None:
        super().__init__(config)
        self.listening, self._limits = config.bind_socket(), limits
        self.listening.listen(QUEUE)  # who comes before all is made waits
        self._entrance: Entrance | None = None

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup([])
        gc.collect()
        gc.freeze()  # what stands from now on is never looked through: that takes a tenth of a second
        made: dict[str, Any] = {"config": self.config, "server_state": self.server_state}
        made["app_state"] = self.lifespan.state
        protocol: Any = self.config.http_protocol_class
        self._entrance = Entrance(
            self.listening,
            lambda at_s: protocol(came_s=at_s, **made),
            at_once=self._limits.at_once,
            of_one=self._limits.most_per_address,
            tls=self.config.ssl,
            handshake_s=self._limits.header_s,
        )

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        if self._entrance is not None:
            self._entrance.close()
        await super().shutdown(sockets)


class _Bounded(H11Protocol):
    """A connection that is closed when its sender, or its reader, keeps it waiting too long."""

    def __init__(self, bounds: Connections, came_s: float, **wiring: Any) -> None:
        super().__init__(**wiring)
        self._bounds, self._limits = bounds, bounds.limits
        self.since_s = came_s  # by the loop's clock
        self._due_s = 0.0  # likewise the end of its sender's time
        self.address = ""
        self._timer: asyncio.TimerHandle | None = None
        self._heard = False  # something of a request that has no answer yet

    @property
    def half_open(self) -> bool:
        """No request is under way, or only a part of its header has come."""
        return self.cycle is None or self.cycle.response_complete

    @property
    def waits(self) -> bool:
        """For the other end: the rest of a request, or that it takes the answer."""
        wants_body = not self.half_open and self.cycle.more_body and not self.flow.read_paused
        return self.half_open or wants_body or self.flow.write_paused

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self.address = _address(self)
        self._wait(self._limits.header_s)
        self._timer = self.loop.call_later(self._limits.header_s, self._look)
        self._bounds.came(self)

    def connection_lost(self, exc: Exception | None) -> None:
        self._end_timer()
        self._bounds.went(self)
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        was_half_open, self._heard = self.half_open, True
        super().data_received(data)
        if was_half_open and not self.half_open:
            self._wait(self._limits.body_s)
        elif not was_half_open:  # a body earns time by coming, but no hoard of it
            latest_s = self.loop.time() + self._limits.body_s
            self._due_s = min(latest_s, self._due_s + len(data) / self._limits.slowest_bytes_s)

    def handle_websocket_upgrade(self, event: Any) -> None:
        self._end_timer()  # its own pings end it
        self._bounds.went(self)
        super().handle_websocket_upgrade(event)

    def on_response_complete(self) -> None:
        self.since_s, self._heard = self.loop.time(), False
        self._wait(self._limits.header_s)
        super().on_response_complete()

    def pause_writing(self) -> None:
        super().pause_writing()
        self._wait(self._limits.body_s)

    def _wait(self, seconds: float) -> None:
        self._due_s = self.loop.time() + seconds

    def _look(self) -> None:
        left_s = self._due_s - self.loop.time()
        if self.waits and left_s <= 0.0:
            self._give_up()
            return
        if not self.waits:  # we let it wait: it has all of its time afterwards
            self._wait(self._limits.body_s)
        self._timer = self.loop.call_later(max(left_s, self._limits.header_s / 10.0), self._look)

    def _give_up(self) -> None:
        """Who has begun a request is answered that its rest did not come; who takes no answer is not."""
        answering = not self.half_open and self.cycle.response_started
        if self._heard and not answering and not self.flow.write_paused:
            self.transport.write(SILENT)
            self.transport.close()
            self.loop.call_later(LEAVE_S, self.transport.abort)
        else:
            self.transport.abort()

    def _end_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None


class WebSocket(WebSocketsSansIOProtocol):
    """One that is refused by an answer (401, 422 ...) is no mistake of ours that belongs into a log."""

    async def send(self, message: Any) -> None:
        await super().send(message)
        if message["type"] == "websocket.http.response.body" and not message.get("more_body", False):
            self.handshake_complete = True


def _address(one: Any) -> str:
    peer = one.transport.get_extra_info("peername")
    return str(peer[0]) if peer else ""
