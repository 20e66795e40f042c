"""Reading what a guest sends, no faster than the bus takes it.

What is not read stays in the guest's socket or terminal, and when that is full its next write waits.
So a guest that sends in a loop is slowed down to the speed of the wire, and none of its frames is lost.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from drives.bench.virtual.virtual_bus import SteppedBus

RETRY_S = 1e-3  # a queue of 256 frames lasts for 12 ms at least at 1 Mbit/s: the wire does not run dry


class Host(Protocol):
    """What a way onto the bus needs of the process that serves it; ``virtual.hub.Hub`` is one."""

    bus: SteppedBus

    def listen(self, descriptor: int, reader: Callable[[], None]) -> None:
        """Call ``reader`` when ``descriptor`` has something to read."""

    def forget(self, descriptor: int) -> None:
        """End ``listen``."""


class Intake:
    """Calls ``take`` when ``descriptor`` has something to read, and again later where it had to stop.

    ``take()`` reads and hands on; False: a frame did not fit into its sender's queue and is still to be
    handed on. Until it has been, the descriptor is left alone.
    """

    def __init__(self, host: Host, descriptor: int, take: Callable[[], bool]) -> None:
        self._host = host
        self._descriptor = descriptor
        self._take = take
        self._closed = False
        host.listen(descriptor, self._go_on)

    def _go_on(self, _now_s: float = 0.0) -> None:
        if self._closed:
            return
        host, done = self._host, self._take()
        if self._closed:  # the guest has left with what it said
            return
        if done:
            host.listen(self._descriptor, self._go_on)
        else:
            host.forget(self._descriptor)
            host.bus.agenda.add(host.bus.now_s + RETRY_S, self._go_on)

    def close(self) -> None:
        """Read no more."""
        self._closed = True
        self._host.forget(self._descriptor)
