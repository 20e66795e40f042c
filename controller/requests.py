"""Requests on their way from the operator to the tick: datagrams, so that nothing waits behind another.

One size for all but a jog and what commissioning has found, which have one of their own; what has neither
is not looked at.
"""

from __future__ import annotations

import select
import socket
import struct
from typing import NamedTuple

from controller.pieces import Jog
from controller.state import Request

_REQUEST = struct.Struct("<Bd")
_JOG = struct.Struct("<B7d")
_ARRANGED = _JOG  # of the same size, told apart by the code


class Arrangement(NamedTuple):
    """What the tick must know of commissioned drives; 1.0 = their units are counts per second."""

    quick_stop_s: float  # the longest of their own stops
    spindle_units: float  # of the spindle's velocity, in one count per second
    axis_units: tuple[float, ...]  # likewise of the five axes


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


def send_arrangement(operator_end: socket.socket, found: Arrangement) -> None:
    """Tell the tick what commissioning has found; raises BlockingIOError when its queue is full."""
    values = found.quick_stop_s, found.spindle_units, *found.axis_units
    operator_end.send(_ARRANGED.pack(Request.ARRANGED, *values))


class RequestInbox:
    """The tick's end of the request socket.

    ``jog`` is the order of the last ``Request.JOG``, ``arranged`` what the last ``Request.ARRANGED`` told.
    """

    def __init__(self, tick_end: socket.socket) -> None:
        self._socket = tick_end
        self._poll = select.poll()  # a third of what it costs to receive nothing
        self._poll.register(tick_end, select.POLLIN)
        self._buffer = bytearray(_JOG.size)
        self.jog: Jog | None = None
        self.arranged: Arrangement | None = None

    def take(self) -> tuple[Request, float] | None:
        """The next well-formed request, or None."""
        while self._poll.poll(0):
            try:
                length = self._socket.recv_into(self._buffer)
            except OSError:  # nobody any more
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
            if length == _ARRANGED.size and code == Request.ARRANGED:
                _, stop_s, spindle, *axes = _ARRANGED.unpack(self._buffer)
                self.arranged = Arrangement(stop_s, spindle, tuple(axes))
                return Request.ARRANGED, stop_s
        return None


_REQUESTS = {request.value: request for request in Request if request not in (Request.JOG, Request.ARRANGED)}
