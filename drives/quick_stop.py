"""Stops the drives of a bus without anything that could have died: a handful of frames, no session.

Quick stop goes by SDO, which works in any NMT state but "stopped" and waits for no SYNC; an
RPDO would lie in the drive until the next one, and nobody sends it any more. NMT "stop" comes
after it: it ends what is left of the process data, and where a drive did not take the
quick stop its abort connection option (6007h) acts. A node that hears neither has stopped by its
heartbeat consumer long before.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from drives import pdo
from drives.cia402 import QUICK_STOP
from drives.ports.port import Port
from drives.settings import IoSettings, NodeSettings, SpindleSettings

Settings = NodeSettings | SpindleSettings | IoSettings

SDO_REQUEST = 0x600
NMT_STOP = 2
ANSWER_TIMEOUT_S = 0.25  # a drive answers within some milliseconds, or not at all
# CiA 301, 7.2.4.3.3: expedited download of two bytes; 7.2.4.3.4: its answer.
_WRITE_CONTROLWORD = bytes((0x2B, 0x40, 0x60, 0x00, QUICK_STOP, 0, 0, 0))
_WRITTEN = bytes((0x60, 0x40, 0x60, 0x00))


def quick_stop_frame(node: int) -> bytearray:
    """SDO: controlword 6040h = quick stop."""
    return pdo.frame(SDO_REQUEST + node, _WRITE_CONTROLWORD)


def nmt_stop_frame(node: int) -> bytearray:
    """NMT: stop remote node."""
    return pdo.frame(pdo.NMT, bytes((NMT_STOP, node)))


def stop(port: Port, nodes: Sequence[Settings], pump: Callable[[], float]) -> list[str]:
    """Tell every node of one bus to stop; the names of the drives that did not confirm the quick stop.

    ``pump`` lets a little time pass and gives the present one (s). Never raises.
    """
    drives = {node.node: node.name for node in nodes if not isinstance(node, IoSettings)}
    _send(port, [quick_stop_frame(node) for node in drives], pump)
    deadline_s = pump() + ANSWER_TIMEOUT_S
    buffer = bytearray(pdo.FRAME_BYTES)
    while drives and pump() < deadline_s:
        while port.receive_into(buffer):
            can_id, data = pdo.unpack(buffer)
            if pdo.group(can_id) == pdo.SDO_ANSWER and data[:4] == _WRITTEN:
                drives.pop(can_id & pdo.NODE_MASK, None)
    _send(port, [nmt_stop_frame(node.node) for node in nodes], pump)
    return list(drives.values())


def _send(port: Port, frames: Sequence[bytearray], pump: Callable[[], float]) -> None:
    """What does not fit into the queue is tried again for as long as a drive has to answer."""
    deadline_s = pump() + ANSWER_TIMEOUT_S
    for frame in frames:
        while not port.send(frame) and pump() < deadline_s:
            pass
