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
from drives.ports.error_frames import lost_frame
from drives.ports.hub_protocol import LOST_FRAMES, NO_FD, PATIENT_FRAME, connect
from drives.texts import english, message

STANDARD_MASK, ID_MASK = 0x7FF, 0x1FFF_FFFF
MAX_BYTES = 8


class HubBus(can.BusABC):
    """One client of the hub at the path ``channel``. Filters are python-can's, in software."""

    def __init__(
        self,
        channel: str,
        can_filters: can.typechecking.CanFilters | None = None,
        fd: bool = False,
        **options: Any,
    ) -> None:
        """Raises can.CanInitializationError where there is no hub, or CAN FD is asked for."""
        if fd or isinstance(options.get("timing"), can.BitTimingFd):
            raise can.CanInitializationError(words(NO_FD))
        try:
            self._socket = connect(channel, PATIENT_FRAME)
        except OSError as error:
            what = words("bus.no_hub_there", channel=channel, why=error)
            raise can.CanInitializationError(what) from error
        self.channel_info = words("bus.virtual", channel=channel)
        super().__init__(channel=channel, can_filters=can_filters, **options)

    def fileno(self) -> int:
        return self._socket.fileno()

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Put a frame up for sending; without room for it, wait for ``timeout`` s, None = until there is.

        Frames that were taken go out in the order of the arbitration, also after ``shutdown``. Raises
        can.CanOperationError for a frame that was not taken in time, that is no frame of classic CAN,
        and when the hub has gone.
        """
        packet = _packed(msg)
        self._socket.settimeout(timeout)
        try:
            self._socket.send(packet)
        except (TimeoutError, BlockingIOError) as error:
            raise can.CanOperationError(words("bus.hub_full", seconds=timeout)) from error
        except OSError as error:
            raise can.CanOperationError(words("bus.hub_takes_none", why=error)) from error

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        readable, _, _ = select.select([self._socket], [], [], timeout)
        if not readable:
            return None, False
        packet = self._socket.recv(FRAME_BYTES)
        if not packet:
            raise can.CanOperationError(words("bus.hub_closed"))
        return _message(packet), False

    def shutdown(self) -> None:
        super().shutdown()
        self._socket.close()


def words(key: str, **values: object) -> str:
    """A text in English, as python-can's own errors are."""
    return english(message(key, **values))


def _packed(msg: can.Message) -> bytes:
    """The frame of a message. Raises can.CanOperationError where there is none."""
    if msg.is_fd:
        raise can.CanOperationError(words(NO_FD))
    highest = ID_MASK if msg.is_extended_id or msg.is_error_frame else STANDARD_MASK
    if not 0 <= msg.arbitration_id <= highest:
        facts = {"identifier": msg.arbitration_id, "highest": highest}
        raise can.CanOperationError(words("bus.no_identifier", **facts))
    if not 0 <= msg.dlc <= MAX_BYTES or len(msg.data) > MAX_BYTES:
        raise can.CanOperationError(words("bus.no_length", length=msg.dlc, most=MAX_BYTES))
    flags = (
        (EXTENDED_FLAG if msg.is_extended_id else 0)
        | (REMOTE_FLAG if msg.is_remote_frame else 0)
        | (ERROR_FLAG if msg.is_error_frame else 0)
    )
    return FRAME.pack(msg.arbitration_id | flags, msg.dlc, bytes(msg.data))


def _message(packet: bytes) -> can.Message:
    """A frame as python-can has it; the hub's word for frames lost here as SocketCAN's for an overflow."""
    can_id, length, data = FRAME.unpack(packet)
    if can_id == LOST_FRAMES:
        can_id, length, data = FRAME.unpack(lost_frame())
    return can.Message(
        timestamp=time.time(),
        arbitration_id=can_id & ID_MASK,
        is_extended_id=bool(can_id & EXTENDED_FLAG),
        is_remote_frame=bool(can_id & REMOTE_FLAG),
        is_error_frame=bool(can_id & ERROR_FLAG),
        dlc=length,
        data=None if can_id & REMOTE_FLAG else data[:length],
    )
