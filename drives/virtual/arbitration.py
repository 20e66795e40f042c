"""Who goes first on a CAN bus: the bits on the wire, of which the dominant one (0) wins (ISO 11898-1, 10.4).

    standard   identifier 11 | RTR | IDE 0 |
    extended   base       11 | SRR 1 | IDE 1 | identifier's other 18 | RTR

As one number of 32 bits, highest first, the lowest of which wins: of one base identifier the standard
data frame, then the standard remote frame, then the extended frames. Linux's flags in front of an
identifier would put every extended and every remote frame behind all others.
"""

from __future__ import annotations

from drives.pdo import ERROR_FLAG, EXTENDED_FLAG, REMOTE_FLAG

BASE_AT = 21  # the shift of an 11-bit identifier, which is all that a standard data frame needs
SUBSTITUTE, EXTENSION = 1 << 20, 1 << 19  # RTR or SRR, IDE
STANDARD_MASK, EXTENSION_MASK = 0x7FF, 0x3FFFF
LAST = 1 << 32  # behind everything: an error frame is a word to ports, and no frame on a wire


def rank(can_id: int) -> int:
    """The number of an identifier with Linux's flags; the lower one wins the arbitration."""
    last = LAST if can_id & ERROR_FLAG else 0
    asks = bool(can_id & REMOTE_FLAG)
    if can_id & EXTENDED_FLAG:
        base = (can_id >> 18 & STANDARD_MASK) << BASE_AT
        return last | base | SUBSTITUTE | EXTENSION | (can_id & EXTENSION_MASK) << 1 | asks
    return last | (can_id & STANDARD_MASK) << BASE_AT | asks * SUBSTITUTE
