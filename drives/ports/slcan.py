"""Frames as the lines of a serial CAN adapter (slcan, "Lawicel" protocol): ASCII, ended by CR.

t183 6 370610270000    data frame, 11 bits (without the blanks)
T1ABCDEF0 2 0102       data frame, 29 bits
r703 1, R...           remote frames
sb256256               the adapter's CAN state: a, w, p, b (bus-off), its counters
BEL (07h)              the adapter refuses a command; CR alone, z, Z: it has taken one
"""

from __future__ import annotations

from drives.pdo import ERROR_FLAG, EXTENDED_FLAG, FRAME, REMOTE_FLAG
from drives.ports.error_frames import (
    ACTIVE_AGAIN,
    BUS_OFF,
    CONTROLLER,
    RX_PASSIVE,
    RX_WARNING,
    TX_PASSIVE,
    TX_WARNING,
)

END, REFUSED = 0x0D, 0x07  # CR, BEL
LONGEST = 40  # bytes of a line, with room for a time stamp nobody asked for

BIT_RATES = {
    10_000: "S0",
    20_000: "S1",
    50_000: "S2",
    100_000: "S3",
    125_000: "S4",
    250_000: "S5",
    500_000: "S6",
    800_000: "S7",
    1_000_000: "S8",
}

STATES = {
    "a": (CONTROLLER, ACTIVE_AGAIN),
    "w": (CONTROLLER, RX_WARNING | TX_WARNING),
    "p": (CONTROLLER, RX_PASSIVE | TX_PASSIVE),
    "b": (BUS_OFF, 0),
}


def line(frame: bytes | bytearray | memoryview) -> bytes:
    """A frame (16 bytes) as a line with its CR; empty for an error frame, which has none."""
    can_id, length, data = FRAME.unpack(frame)
    if can_id & ERROR_FLAG:
        return b""
    letter = "r" if can_id & REMOTE_FLAG else "t"
    name = f"{letter}{can_id & 0x7FF:03X}"
    if can_id & EXTENDED_FLAG:
        name = f"{letter.upper()}{can_id & 0x1FFF_FFFF:08X}"
    payload = "" if can_id & REMOTE_FLAG else data[:length].hex().upper()
    return f"{name}{length}{payload}\r".encode()


def frame(text: bytes | bytearray) -> bytes | None:
    """The frame of a line (without its CR), 16 bytes; None if it is no frame. Never raises."""
    try:
        return _state(text) if text[:1] == b"s" else _frame(text)
    except (ValueError, IndexError, KeyError):
        return None


def _frame(text: bytes | bytearray) -> bytes | None:
    letter = chr(text[0])
    if letter not in "tTrR":
        return None
    digits = 3 if letter in "tr" else 8
    can_id = int(text[1 : 1 + digits], 16)
    length = int(text[1 + digits : 2 + digits])
    if length > 8 or not 0 <= can_id <= (0x7FF if digits == 3 else 0x1FFF_FFFF):
        return None
    if digits == 8:
        can_id |= EXTENDED_FLAG
    if letter in "rR":
        return FRAME.pack(can_id | REMOTE_FLAG, length, b"")
    payload = text[2 + digits : 2 + digits + 2 * length].decode("ascii")
    data = bytes.fromhex(payload)
    return FRAME.pack(can_id, length, data) if len(data) == length else None


def _state(text: bytes | bytearray) -> bytes:
    """The adapter's state as SocketCAN's error frame; the counters are three digits each."""
    error_class, status = STATES[chr(text[1])]
    receive, transmit = int(text[2:5]), int(text[5:8])
    counters = (min(255, transmit), min(255, receive))
    return FRAME.pack(ERROR_FLAG | error_class, 8, bytes((0, status, 0, 0, 0, 0, *counters)))
