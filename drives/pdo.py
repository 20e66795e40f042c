"""Frames as they lie in memory: Linux's ``struct can_frame`` and our two process data objects.

One layout on every descriptor, real or virtual, 16 bytes:

    0       4     5       8                      16
    | id    | len | 0 0 0 | data, len bytes used  |

Our mapping is the same for every drive, so that one Struct serves all of them:
RPDO1 = controlword 6040h u16, target position 607Ah i32; TPDO1 = statusword 6041h
u16, actual position 6064h i32. Both synchronous (transmission type 1).
"""

from __future__ import annotations

from collections.abc import Sequence
from struct import Struct

FRAME = Struct("<IB3x8s")
FRAME_BYTES = 16
DATA_AT = 8
HEADER = Struct("<IB")
COMMAND = Struct("<Hi")
FEEDBACK = Struct("<Hi")
PDO_BYTES = 6
EMERGENCY = Struct("<HB5s")  # error code, error register 1001h, five bytes of the vendor

# CiA 301, pre-defined connection set.
NMT = 0x000
SYNC = 0x080
EMCY = 0x080
TPDO1 = 0x180
RPDO1 = 0x200
SDO_ANSWER = 0x580
HEARTBEAT = 0x700
GROUP_MASK = 0x780  # the function code: identifier without the node

EXTENDED_FLAG = 0x8000_0000
REMOTE_FLAG = 0x4000_0000
ERROR_FLAG = 0x2000_0000

NMT_BOOT_UP = 0
NMT_STOPPED = 4
NMT_OPERATIONAL = 5
NMT_PRE_OPERATIONAL = 127

# (identifier, mask) pairs: what the tick wants to hear, and nothing else.
TICK_FILTERS: Sequence[tuple[int, int]] = (
    (TPDO1, GROUP_MASK),
    (EMCY, GROUP_MASK),  # holds SYNC too, which shares the function code with node 0
    (HEARTBEAT, GROUP_MASK),
)
# ... and what the slow side's own descriptor wants: SDO answers, boot-up, emergencies.
SERVICE_FILTERS: Sequence[tuple[int, int]] = (
    (SDO_ANSWER, GROUP_MASK),
    (EMCY, GROUP_MASK),
    (HEARTBEAT, GROUP_MASK),
)


def frame(can_id: int, data: bytes = b"") -> bytearray:
    """A packed frame; ``data`` has 0 to 8 bytes."""
    return bytearray(FRAME.pack(can_id, len(data), data))


def unpack(packed: bytes | bytearray | memoryview) -> tuple[int, bytes]:
    """Identifier with flags, and the data bytes, of a packed frame. For the slow side: it allocates."""
    can_id, length, data = FRAME.unpack(packed)
    return can_id, data[:length]


def command_frame(node: int) -> bytearray:
    """RPDO1 of a node with nothing in it yet: controlword 0 (disable voltage), target 0."""
    return frame(RPDO1 + node, COMMAND.pack(0, 0))
