"""Requests on their way from the operator to the tick: datagrams, so that nothing waits behind another.

One size for all but a jog, which has one of its own; what has neither is not looked at.
"""

from __future__ import annotations

import socket
import struct

from controller.pieces import Jog
from controller.state import Request

_REQUEST = struct.Struct("<Bd")
_JOG = struct.Struct("<B7d")


def request_pair() -> tuple[socket.socket, socket.socket]:
    """(operator's end, tick's end) of a new request socket, both non-blocking."""
    operator, tick = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    operator.setblocking(False)
    tick.setblocking(False)
    return operator, tick


def send_request(operator_end: socket.socket, request: Request, value: float = 0.0) -> None:
    """Ask the tick for something; raises BlockingIOError when its queue is full."""
    operator_end.send(_REQUEST.pack(request, value))


def send_jog(operator_end: socket.socket, jog: Jog) -> None:
    """Ask the tick to jog, or to go on with it; raises BlockingIOError when its queue is full."""
    operator_end.send(_JOG.pack(Request.JOG, jog.speed, jog.length, *jog.direction))


class RequestInbox:
    """The tick's end of the request socket; ``jog`` is the order of the last ``Request.JOG``."""

    def __init__(self, tick_end: socket.socket) -> None:
        self._socket = tick_end
        self._buffer = bytearray(_JOG.size)
        self.jog: Jog | None = None

    def take(self) -> tuple[Request, float] | None:
        """The next well-formed request, or None."""
        while True:
            try:
                length = self._socket.recv_into(self._buffer)
            except OSError:  # nothing there (BlockingIOError), or nobody any more
                return None
            if length == 0:
                return None
            code, value = _REQUEST.unpack_from(self._buffer)
            if length == _REQUEST.size and code in _REQUESTS:
                return _REQUESTS[code], value
            if length == _JOG.size and code == Request.JOG:
                _, speed, way, a, b, c, d, e = _JOG.unpack(self._buffer)
                self.jog = Jog((a, b, c, d, e), speed, way)
                return Request.JOG, speed


_REQUESTS = {request.value: request for request in Request if request is not Request.JOG}
