"""What the pump needs to know of a bus and of a drive on it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol


class Sends(Protocol):
    """What is needed of a port."""

    def send(self, frame: bytes | bytearray | memoryview, /) -> bool: ...


class DriveWire(NamedTuple):
    """What a drive's setpoint goes out by."""

    node: int
    rpdo: int  # its number, 1 to 4
    feed_forward: bool


class BusWire(NamedTuple):
    """One bus: its port, and the drives on it; ``packs``: it takes several frames in one packet."""

    port: Sends
    drives: Sequence[tuple[int, DriveWire]]  # with the place of each in the order of the axes
    packs: bool
    spindle: DriveWire | None = None  # whose speed it leads
