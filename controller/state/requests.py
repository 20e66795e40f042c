"""Requests on their way from the operator to the tick: datagrams, so that nothing waits behind another.

One size for all but a jog and what commissioning has found, which have one of their own; what has neither
is not looked at. Each carries a number by which the tick says what came of it (``Outcome``); 0: nobody asks.
"""

from __future__ import annotations

import itertools
import os
import select
import socket
import struct
from collections.abc import Iterator
from enum import IntEnum
from typing import NamedTuple

from controller.motion.pieces import Jog
from controller.state.modes import MAX_AXES, Request

_REQUEST = struct.Struct("<BId")


def _of_axes(axes: int) -> struct.Struct:
    """A jog, or what commissioning has found: the code tells which."""
    return struct.Struct(f"<BI{2 + axes}d")


PLAN_IDS = 1 << 31  # from here on the numbers are of the plan, which asks on the same socket
_PID_BITS = 22  # of Linux


class Outcome(IntEnum):
    """What came of a request in the tick."""

    NONE = 0  # it has not been taken yet, or so long ago that nobody remembers
    DONE = 1  # the table took it; what takes time has begun
    REFUSED = 2
    SUPERSEDED = 3  # another request came before it could begin


ANSWERS = 16  # of the last requests are in every snapshot


def answer(number: int, came: Outcome, why: int = 0) -> int:
    """What came of a request as one number; ``why``: the interlock that forbade it."""
    return number << 16 | why << 8 | came


def outcome(packed: int) -> tuple[int, Outcome, int]:
    """Number, what came of it, why; of an ``answer``."""
    return packed >> 16, Outcome(packed & 0xFF), packed >> 8 & 0xFF


def plan_ids() -> Iterator[int]:
    """Numbers for the requests of one process of the plan, other ones than those of the plan before it."""
    return itertools.count(PLAN_IDS | (os.getpid() & (1 << _PID_BITS) - 1) << 8 | 1)


class Arrangement(NamedTuple):
    """What the tick must know of commissioned drives; 1.0 = their units are counts per second."""

    quick_stop_s: float  # the longest of their own stops
    spindle_units: float  # of the spindle's velocity, in one count per second
    axis_units: tuple[float, ...]  # likewise of the axes


def request_pair() -> tuple[socket.socket, socket.socket]:
    """(operator's end, tick's end) of a new request socket, both non-blocking."""
    operator, tick = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    operator.setblocking(False)
    tick.setblocking(False)
    return operator, tick


def send_request(operator_end: socket.socket, request: Request, value: float = 0.0, number: int = 0) -> None:
    """Ask the tick for something; raises BlockingIOError when its queue is full."""
    operator_end.send(_REQUEST.pack(request, number, value))


def send_jog(operator_end: socket.socket, jog: Jog, number: int = 0) -> None:
    """Ask the tick to jog, or to go on with it; raises BlockingIOError when its queue is full."""
    line = _of_axes(len(jog.direction))
    operator_end.send(line.pack(Request.JOG, number, jog.speed, jog.length, *jog.direction))


def send_arrangement(operator_end: socket.socket, found: Arrangement) -> None:
    """Tell the tick what commissioning has found; raises BlockingIOError when its queue is full."""
    values = found.quick_stop_s, found.spindle_units, *found.axis_units
    operator_end.send(_of_axes(len(found.axis_units)).pack(Request.ARRANGED, 0, *values))


class RequestInbox:
    """The tick's end of the request socket.

    ``number`` is that of the last request, ``jog`` the order of the last ``Request.JOG``, ``arranged`` what
    the last ``Request.ARRANGED`` told.
    """

    def __init__(self, tick_end: socket.socket, axes: int = MAX_AXES) -> None:
        """``axes``: how many the machine has; what is of other ones is not looked at."""
        self._socket = tick_end
        self._of_axes = _of_axes(axes)
        self._poll = select.poll()  # a third of what it costs to receive nothing
        self._poll.register(tick_end, select.POLLIN)
        self._buffer = bytearray(self._of_axes.size)
        self.number = 0
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
            code, self.number, value = _REQUEST.unpack_from(self._buffer)
            if length == _REQUEST.size and code in _REQUESTS:
                return _REQUESTS[code], value
            if length == self._of_axes.size and code in (Request.JOG, Request.ARRANGED):
                return self._taken(*self._of_axes.unpack(self._buffer))
        return None

    def _taken(self, code: int, number: int, one: float, other: float, *axes: float) -> tuple[Request, float]:
        """What has a value for each axis."""
        if code == Request.JOG:
            self.jog = Jog(axes, one, other)
            return Request.JOG, one
        self.arranged = Arrangement(one, other, axes)
        return Request.ARRANGED, one


_REQUESTS = {request.value: request for request in Request if request not in (Request.JOG, Request.ARRANGED)}


class Answers:
    """The tick's answers to the last requests, as a ring in every snapshot."""

    def __init__(self) -> None:
        self.ring = [0] * ANSWERS
        self._next = 0

    def give(self, number: int, came: Outcome, why: int = 0) -> None:
        """Of the request of that number; of one without a number nobody asks."""
        if number:
            self.ring[self._next] = answer(number, came, why)
            self._next = (self._next + 1) % ANSWERS
