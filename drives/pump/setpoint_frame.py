"""A drive's synchronous RPDO: its target, with the controlword, or with the velocity towards it."""

from __future__ import annotations

from drives import pdo
from drives.pdo import INT32_MAX, INT32_MIN

_pack_command_into = pdo.COMMAND.pack_into
_pack_target_into = pdo.TARGET.pack_into


class SetpointFrame:
    """The same ``buffer`` every time: send it before the next call."""

    __slots__ = ("buffer", "bytes", "feed_forward")

    def __init__(self, node: int, rpdo: int, feed_forward: bool) -> None:
        """``rpdo``: its number, 1 to 4."""
        self.buffer: bytearray | memoryview = pdo.command_frame(node, rpdo)
        self.feed_forward = feed_forward
        self.bytes = pdo.TARGET.size if feed_forward else pdo.PDO_BYTES
        self.buffer[pdo.LENGTH_AT] = self.bytes

    def place(self, room: memoryview) -> None:
        """Packs into ``room`` (16 bytes) from now on: neighbours can go out in one packet."""
        room[:] = self.buffer
        self.buffer = room

    def pack_word(self, word: int, setpoint: int) -> None:
        """Controlword 6040h and target (counts)."""
        _pack_command_into(self.buffer, pdo.DATA_AT, word, setpoint)

    def pack_velocity(self, setpoint: int, velocity: int) -> None:
        """Target (counts) and velocity offset 60B1h (the drive's units)."""
        velocity = max(INT32_MIN, min(INT32_MAX, velocity))
        _pack_target_into(self.buffer, pdo.DATA_AT, setpoint, velocity)
