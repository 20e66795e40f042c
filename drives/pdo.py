"""Frames as they lie in memory: Linux's ``struct can_frame`` and our two process data objects.

One layout on every descriptor, real or virtual, 16 bytes:

    0       4     5       8                      16
    | id    | len | 0 0 0 | data, len bytes used  |

One Struct serves every drive, whatever the number of its PDO (1 .. 4, `drives.profile`):

    command     controlword 6040h u16, target 607Ah i32 (60C1h:01 in mode 7, 60FFh of a spindle)
    feedback    statusword 6041h u16, actual position 6064h i32 (606Ch of a spindle)

With velocity feed-forward the controlword has no room beside the target:

    target      target 607Ah i32, velocity offset 60B1h i32
    controlword 6040h u16, in an RPDO of its own, applied at once
"""

from __future__ import annotations

from collections.abc import Sequence
from struct import Struct
from typing import Final

FRAME = Struct("<IB3x8s")
FRAME_BYTES: Final = 16
LENGTH_AT: Final = 4
DATA_AT: Final = 8
HEADER = Struct("<IB")
HEADERS = Struct("<IB11x").iter_unpack  # of the frames of a packet
COMMAND: Final = Struct("<Hi")
FEEDBACK = Struct("<Hi")
PDO_BYTES: Final = 6
TARGET = Struct("<ii")
CONTROLWORD = Struct("<H")
INT32_MIN: Final = -(2**31)  # of a target
INT32_MAX: Final = 2**31 - 1
MODE_BYTES: Final = 1  # mode of operation display 6061h i8
TURNED = Struct("<i")  # a spindle's position i32 ...
TURNED_AND_LOAD = Struct("<ih")  # ... with its torque 6077h i16, in thousandths of the rated one
DEMAND = Struct("<i")  # the setpoint that a drive goes by, 60FCh i32, or how far it is off it, 60F4h i32
LATCH = Struct("<Hi")  # touch probe: status 60B9h u16, position at the rising edge 60BAh i32
EMERGENCY = Struct("<HB5s")  # error code, error register 1001h, five bytes of the vendor

# CiA 301, pre-defined connection set.
NMT = 0x000
SYNC: Final = 0x080
EMCY = 0x080
TPDO1 = 0x180
RPDO1 = 0x200
SDO_ANSWER = 0x580
SDO_QUESTION = 0x600
HEARTBEAT = 0x700
LSS_ANSWER = 0x7E4  # CiA 305
GROUP_MASK, NODE_MASK = 0x780, 0x7F  # the two parts of an identifier: function code, node
NEXT_PDO = 0x100  # from PDO n of a node to its PDO n + 1

EXTENDED_FLAG: Final = 0x8000_0000
REMOTE_FLAG: Final = 0x4000_0000
ERROR_FLAG: Final = 0x2000_0000

NMT_BOOT_UP: Final = 0
NMT_STOPPED: Final = 4
NMT_OPERATIONAL: Final = 5
NMT_PRE_OPERATIONAL: Final = 127

# (identifier, mask) pairs: the tick hears everything, for what is nobody's may be what fills the bus, and
# setpoints that are not its own are a stranger's ...
TICK_FILTERS: Sequence[tuple[int, int]] = ((0, 0),)
# ... and what the slow side's own descriptor wants: SDO answers, boot-up, emergencies. It is not read all
# the time, so without SYNC: an emergency is of a node, which has some bit of its seven.
SERVICE_FILTERS: Sequence[tuple[int, int]] = (
    (SDO_ANSWER, GROUP_MASK),
    *((EMCY | 1 << bit, GROUP_MASK | 1 << bit) for bit in range(7)),
    (HEARTBEAT, GROUP_MASK),
    (LSS_ANSWER, 0x7FF),
)


def frame(can_id: int, data: bytes = b"") -> bytearray:
    """A packed frame; ``data`` has 0 to 8 bytes."""
    return bytearray(FRAME.pack(can_id, len(data), data))


def unpack(packed: bytes | bytearray | memoryview) -> tuple[int, bytes]:
    """Identifier with flags, and the data bytes, of a packed frame. For the slow side: it allocates."""
    can_id, length, data = FRAME.unpack(packed)
    return can_id, data[:length]


def group(can_id: int) -> int:
    """Its function code, without the node; one with a flag has none that CANopen knows.

    A remote frame of 701h asks for a node's state: it is none of its heartbeats.
    """
    return can_id & ~NODE_MASK


def node_of(can_id: int) -> int:
    """The node whose frame one with this identifier is (pre-defined connection set); 0 = nobody's."""
    return can_id & NODE_MASK if SYNC < can_id <= HEARTBEAT | NODE_MASK else 0


def plain_mask(mask: int) -> int:
    """A filter's mask that lets no extended and no remote frame through; 0 lets all of them."""
    return mask | EXTENDED_FLAG | REMOTE_FLAG if mask else 0


def rpdo(number: int, node: int) -> int:
    """Identifier of RPDO ``number`` (1 .. 4) of a node."""
    return RPDO1 + NEXT_PDO * (number - 1) + node


def tpdo(number: int, node: int) -> int:
    """Identifier of TPDO ``number`` (1 .. 4) of a node."""
    return TPDO1 + NEXT_PDO * (number - 1) + node


def command_frame(node: int, number: int = 1) -> bytearray:
    """The RPDO of a node with nothing in it yet: controlword 0 (disable voltage), target 0."""
    return frame(rpdo(number, node), COMMAND.pack(0, 0))


def guard_frame(node: int) -> bytearray:
    """The remote frame of node guarding (CiA 301, 7.2.8.2.1); the answer has one byte."""
    return frame(REMOTE_FLAG | HEARTBEAT + node, b"\0")
