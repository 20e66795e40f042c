"""A raw CAN socket of Linux, opened with the standard library alone."""

from __future__ import annotations

import fcntl
import socket
import struct
import time
from collections.abc import Sequence

from drives import pdo
from drives.ports.port import BusError, FrameSocket
from drives.settings import BusSettings
from drives.texts import message

# Error classes that end a motion (linux/can/error.h): controller problems, bus-off, restarted.
ERROR_CLASSES = 0x004 | 0x040 | 0x100

CAN_RAW_ERR_FILTER = 2  # linux/can/raw.h; the standard library's names are not everywhere
SO_TIMESTAMPNS = 35
SO_MEMINFO = 55
_DROPS = struct.Struct("32xI")  # SK_MEMINFO_DROPS, the ninth of its numbers
_TIME_STAMP = struct.Struct("qq")

SIOCGIFTXQLEN, SIOCSIFTXQLEN = 0x8942, 0x8943
_INTERFACE_INT = struct.Struct("16si20x")  # struct ifreq
MIN_QUEUE = 128  # frames


class CanSocket(FrameSocket):
    """A raw CAN socket, which tells what the kernel knows: when a frame came, and how many it has refused."""

    def __init__(self, sock: socket.socket, name: str) -> None:
        super().__init__(sock, name)
        sock.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)

    @property
    def overflows(self) -> int:
        """Frames that the full receive queue has refused since the opening, as the kernel counts them.

        The same count as SO_RXQ_OVFL's, which only comes with the next frame that is read.
        """
        try:
            return int(_DROPS.unpack(self._socket.getsockopt(socket.SOL_SOCKET, SO_MEMINFO, _DROPS.size))[0])
        except (OSError, struct.error):
            return 0

    def receive_stamped(self, buffer: bytearray) -> float | None:
        """As ``receive_into``, with the time (CLOCK_REALTIME, s) at which the kernel got the frame."""
        try:
            count, notes, _, _ = self._socket.recvmsg_into([buffer], 64)
        except OSError:
            return None
        if count != pdo.FRAME_BYTES:
            return None
        for level, kind, data in notes:
            if level == socket.SOL_SOCKET and kind == SO_TIMESTAMPNS:
                seconds, nanoseconds = _TIME_STAMP.unpack(data)
                return float(seconds + nanoseconds * 1e-9)
        return time.time()


def open_socket(settings: BusSettings, filters: Sequence[tuple[int, int]]) -> CanSocket:
    """A socket on the interface ``settings.channel``, with a transmit queue that is long enough.

    Raises BusError.
    """
    try:
        sock = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    except OSError as error:
        raise BusError(message("bus.no_can", name=settings.name, why=error)) from error
    try:
        sock.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, kernel_filters(filters))
        sock.setsockopt(socket.SOL_CAN_RAW, CAN_RAW_ERR_FILTER, ERROR_CLASSES)
        sock.bind((settings.channel,))
    except OSError as error:
        sock.close()
        raise BusError(
            message(
                "bus.no_interface",
                name=settings.name,
                channel=settings.channel,
                why=error,
                bit_rate=settings.bit_rate,
            )
        ) from error
    try:
        _lengthen_queue(sock, settings)
    except BusError:
        sock.close()
        raise
    return CanSocket(sock, settings.name)


def kernel_filters(filters: Sequence[tuple[int, int]]) -> bytes:
    """CAN_RAW_FILTER's array."""
    return b"".join(struct.pack("=II", can_id, pdo.plain_mask(mask)) for can_id, mask in filters)


def _lengthen_queue(sock: socket.socket, settings: BusSettings) -> None:
    """Linux gives a CAN interface a transmit queue of ten frames: less than two ticks of five drives."""
    length = _queue_length(sock, settings.channel)
    if length >= MIN_QUEUE:
        return
    request = _INTERFACE_INT.pack(settings.channel.encode(), MIN_QUEUE)
    try:
        fcntl.ioctl(sock, SIOCSIFTXQLEN, request)
    except OSError as error:
        raise BusError(
            message(
                "bus.short_queue",
                name=settings.name,
                channel=settings.channel,
                length=length,
                min_queue=MIN_QUEUE,
                why=error,
            )
        ) from error


def _queue_length(sock: socket.socket, channel: str) -> int:
    """Frames; where the kernel does not tell, as many as are needed."""
    try:
        answer = fcntl.ioctl(sock, SIOCGIFTXQLEN, _INTERFACE_INT.pack(channel.encode(), 0))
    except OSError:
        return MIN_QUEUE
    return int(_INTERFACE_INT.unpack(answer)[1])
