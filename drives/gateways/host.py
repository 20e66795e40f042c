"""What a gateway needs of the process that serves the bus."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from drives.virtual.virtual_bus import SteppedBus


class Host(Protocol):
    """``drives.virtual.hub.Hub`` is one."""

    bus: SteppedBus

    def listen(self, descriptor: int, reader: Callable[[], None]) -> None:
        """Call ``reader`` when ``descriptor`` has something to read."""

    def forget(self, descriptor: int) -> None:
        """End ``listen``."""
