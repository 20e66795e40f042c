"""python-can's plugin for the virtual bus: ``can.Bus(interface="directrix", channel=PATH)``.

With it any python-can or canopen tool joins the hub. Not used by the controller,
which talks to the hub directly.
"""

from __future__ import annotations

import select
import time
from typing import Any

import can

from drives.pdo import ERROR_FLAG, EXTENDED_FLAG, FRAME, FRAME_BYTES, REMOTE_FLAG
from drives.virtual.hub_protocol import LOST_FRAMES, connect

ID_MASK = 0x1FFF_FFFF


class HubBus(can.BusABC):
    """One client of the hub at the path ``channel``. Filters are python-can's, in software."""

    def __init__(
        self, channel: str, can_filters: can.typechecking.CanFilters | None = None, **options: Any
    ) -> None:
        self._socket = connect(channel)
        self.channel_info = f"directrix virtual bus at {channel}"
        super().__init__(channel=channel, can_filters=can_filters, **options)

    def fileno(self) -> int:
        return self._socket.fileno()

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Raises can.CanOperationError when the hub is gone or does not take the frame in time."""
        self._socket.settimeout(timeout)
        try:
            self._socket.send(_packed(msg))
        except OSError as error:
            raise can.CanOperationError(f"the virtual bus did not take the frame: {error}") from error

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        readable, _, _ = select.select([self._socket], [], [], timeout)
        if not readable:
            return None, False
        packet = self._socket.recv(FRAME_BYTES)
        if not packet:
            raise can.CanOperationError("the virtual bus has closed")
        if int.from_bytes(packet[:4], "little") == LOST_FRAMES:
            return None, False  # the hub's own word for a full queue; python-can has none
        return _message(packet), False

    def shutdown(self) -> None:
        super().shutdown()
        self._socket.close()


def _packed(msg: can.Message) -> bytes:
    flags = (
        (EXTENDED_FLAG if msg.is_extended_id else 0)
        | (REMOTE_FLAG if msg.is_remote_frame else 0)
        | (ERROR_FLAG if msg.is_error_frame else 0)
    )
    return FRAME.pack(msg.arbitration_id | flags, msg.dlc, bytes(msg.data))


def _message(packet: bytes) -> can.Message:
    can_id, length, data = FRAME.unpack(packet)
    return can.Message(
        timestamp=time.time(),
        arbitration_id=can_id & ID_MASK,
        is_extended_id=bool(can_id & EXTENDED_FLAG),
        is_remote_frame=bool(can_id & REMOTE_FLAG),
        is_error_frame=bool(can_id & ERROR_FLAG),
        dlc=length,
        data=None if can_id & REMOTE_FLAG else data[:length],
    )
