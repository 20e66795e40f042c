"""Opens a bus, one small class per way onto it: 16-byte frames out and in, never blocking, never raising.

    virtual     the hub's UNIX SEQPACKET socket (port.py)
    socketcan   a raw CAN socket of Linux (can_socket.py)
    slcan       a serial adapter that speaks slcan (slcan_port.py); it has one owner, so that
                several processes use one by a hub that shares it (drives/bench/options.py)
    shared      such a hub, or one in front of any other bus
    otherwise   any python-can adapter, by its interface name: slower, for long periods; its
                channel may carry options, as "can0?host=127.0.0.1&port=29536"

Opening raises BusError with a sentence. What comes after that is in port.py.
"""

from __future__ import annotations

import socket
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final
from urllib.parse import parse_qsl

from drives import pdo
from drives.ports import hub_protocol
from drives.ports.can_socket import CanSocket, kernel_filters, open_socket
from drives.ports.port import Buffer, BusError, FrameSocket, HubSocket, Port
from drives.ports.slcan_port import SlcanPort, open_serial
from drives.settings import BusSettings
from drives.texts import message

if TYPE_CHECKING:
    import can

__all__ = [
    "HUBS",
    "AdapterSocket",
    "Buffer",
    "BusError",
    "CanSocket",
    "FrameSocket",
    "HubSocket",
    "Port",
    "SlcanPort",
    "joined",
    "kernel_filters",
    "open",
]

HUBS = ("virtual", "shared")  # interfaces


MAX_UNWANTED = 128  # frames passed over in one call: who babbles must not hold the tick
_ALL_STANDARD: Final = bytes([1]) * 0x800
# Linux' word for frames that a controller or its driver had no room for (linux/can/error.h), in which some of
# python-can's interfaces speak, too: gs_usb, and the virtual bus' own.
_LOST_CLASSES: Final = pdo.ERROR_FLAG | 0x004
_RX_OVERFLOW: Final = 0x01  # of byte 1


class AdapterSocket:
    """A python-can adapter behind the same methods; costs some 150 us a tick for five drives.

    It filters here: python-can ends a reading with the first frame that it filters out, and filters error
    frames out, too. ``overflows`` counts the adapter's words about lost frames, which are no frames for
    whoever reads; one that has no such word (socketcand, pcan, kvaser ...) loses them silently, and
    FEEDBACK_LOST is what is seen of it.
    """

    packs = False

    def __init__(self, bus: can.BusABC, name: str, filters: Sequence[tuple[int, int]] = ((0, 0),)) -> None:
        import can

        self.name = name
        self.overflows = 0  # times that frames were lost since the opening because they were not read in time
        self._bus = bus
        self._message = can.Message
        self._refusals = (can.CanError, OSError)
        self._everything = any(not mask for _, mask in filters)
        self._wanted = _ALL_STANDARD if self._everything else _accepted_identifiers(filters)

    def fileno(self) -> int:
        """The adapter's descriptor, or -1 where it has none to wait on."""
        try:
            return self._bus.fileno()
        except NotImplementedError:
            return -1

    def send(self, frame: Buffer) -> bool:
        can_id, data = pdo.unpack(frame)
        asks = bool(can_id & pdo.REMOTE_FLAG)
        message = self._message(
            arbitration_id=can_id & ~pdo.REMOTE_FLAG,
            data=None if asks else data,
            dlc=len(data),
            is_remote_frame=asks,
            is_extended_id=False,
            check=False,
        )
        try:
            self._bus.send(message, timeout=0.0)
        except self._refusals:
            return False
        return True

    def receive_into(self, buffer: bytearray) -> bool:
        for _ in range(MAX_UNWANTED):
            try:
                message = self._bus.recv(timeout=0.0)
            except self._refusals:
                return False
            if message is None:
                return False
            can_id = _flagged_id(message)
            if can_id < len(self._wanted):
                wanted = self._wanted[can_id] == 1
            else:
                wanted = self._everything or message.is_error_frame
            if wanted:
                data = bytes(message.data)
                if _is_receive_overflow(can_id, data):
                    self.overflows += 1
                    continue
                pdo.FRAME.pack_into(buffer, 0, can_id, message.dlc, data)
                return True
        return False

    def restart(self) -> None:
        """Nothing: python-can has no word for it."""

    def close(self) -> None:
        self._bus.shutdown()


def _flagged_id(message: can.Message) -> int:
    flags = pdo.EXTENDED_FLAG * message.is_extended_id | pdo.REMOTE_FLAG * message.is_remote_frame
    return int(message.arbitration_id | flags | pdo.ERROR_FLAG * message.is_error_frame)


def _accepted_identifiers(filters: Sequence[tuple[int, int]]) -> bytes:
    """For each identifier of 11 bits 1 where a pair lets its data frames through, else 0."""
    return bytes(any(not (one ^ can_id) & mask for can_id, mask in filters) for one in range(0x800))


def _is_receive_overflow(can_id: int, data: bytes) -> bool:
    """Whether it is an error frame about received frames that nobody had room for."""
    return not ~can_id & _LOST_CLASSES and len(data) > 1 and bool(data[1] & _RX_OVERFLOW)


def open(
    settings: BusSettings, filters: Sequence[tuple[int, int]] = pdo.TICK_FILTERS
) -> FrameSocket | SlcanPort | AdapterSocket:
    """A port on the bus that ``settings`` name; ``filters`` are (identifier, mask) pairs.

    The kernel, the hub or the adapter applies the filters; slcan does not filter, and the
    tick looks identifiers up anyway. A pair (0, 0) lets everything through. Raises BusError.
    """
    if settings.interface in HUBS:
        wishes = hub_protocol.wishes(filters)
        return HubSocket(joined(settings, wishes), settings.name, settings.channel, wishes)
    if settings.interface == "socketcan":
        return open_socket(settings, filters)
    if settings.interface == "slcan":
        return open_serial(settings)
    return _open_adapter(settings, filters)


def joined(settings: BusSettings, first: bytes) -> socket.socket:
    """A bus of a hub, with what its client says first (``hub_protocol``). Raises BusError."""
    try:
        return hub_protocol.connect(settings.channel, first)
    except OSError as error:
        raise BusError(
            message("bus.no_hub", name=settings.name, channel=settings.channel, why=error)
        ) from error


def _open_adapter(settings: BusSettings, filters: Sequence[tuple[int, int]]) -> AdapterSocket:
    import can

    channel, _, options = settings.channel.partition("?")
    try:
        bus = can.Bus(
            interface=settings.interface,
            channel=channel,
            bitrate=settings.bit_rate,
            **_options(options),
        )
    except (can.CanError, OSError, ValueError, TypeError, ImportError) as error:
        raise BusError(
            message(
                "bus.no_adapter",
                name=settings.name,
                interface=settings.interface,
                channel=settings.channel,
                why=error,
            )
        ) from error
    return AdapterSocket(bus, settings.name, filters)


def _options(text: str) -> dict[str, Any]:
    """Options ``host=127.0.0.1&port=29536`` as keyword arguments; whole numbers are numbers."""
    return {name: int(value) if value.isdecimal() else value for name, value in parse_qsl(text)}
