"""Error frames in SocketCAN's format (linux/can/error.h): what the ports of a CAN controller hear of it."""

from __future__ import annotations

from drives.pdo import ERROR_FLAG, FRAME

# Classes, and byte 1 of a controller problem.
CONTROLLER, BUS_OFF, RESTARTED = 0x004, 0x040, 0x100
RX_WARNING, TX_WARNING, RX_PASSIVE, TX_PASSIVE, ACTIVE_AGAIN = 0x04, 0x08, 0x10, 0x20, 0x40
RX_OVERFLOW, TX_OVERFLOW = 0x01, 0x02


def restarted_frame() -> bytes:
    """SocketCAN's word for a controller that takes part again."""
    return FRAME.pack(ERROR_FLAG | RESTARTED, 8, bytes(8))


def overflow_frame() -> bytes:
    """SocketCAN's word for a transmit queue that did not take a frame, where ``send`` could not tell."""
    return FRAME.pack(ERROR_FLAG | CONTROLLER, 8, bytes((0, TX_OVERFLOW, 0, 0, 0, 0, 0, 0)))


def lost_frame() -> bytes:
    """SocketCAN's word for received frames that were lost because nobody took them in time."""
    return FRAME.pack(ERROR_FLAG | CONTROLLER, 8, bytes((0, RX_OVERFLOW, 0, 0, 0, 0, 0, 0)))
