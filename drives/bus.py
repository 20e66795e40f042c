"""Opens a bus, one small class per way onto it: 16-byte frames out and in, never blocking, never raising.

    virtual     the hub's UNIX SEQPACKET socket (port.py)
    socketcan   a raw CAN socket of Linux (can_socket.py)
    slcan       a serial adapter that speaks slcan (slcan_port.py); it has one owner, so that
                several processes use one by a hub that shares it (gateways/options.py)
    shared      such a hub, or one in front of any other bus
    otherwise   any python-can adapter, by its interface name: slower, for long periods; its
                channel may carry options, as "can0?host=127.0.0.1&port=29536"

Opening raises BusError with a sentence. What comes after that is in port.py.
"""

from __future__ import annotations

import socket
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qsl

from drives import pdo
from drives.ports.can_socket import CanSocket, cyclic_sync_request, kernel_filters, open_socket
from drives.ports.port import Buffer, BusError, FrameSocket, HubSocket, Port
from drives.ports.slcan_port import SlcanPort, open_serial
from drives.settings import BusSettings
from drives.texts import said
from drives.virtual import hub_protocol

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
    "cyclic_sync_request",
    "joined",
    "kernel_filters",
    "open",
]

HUBS = ("virtual", "shared")  # interfaces


class AdapterSocket:
    """A python-can adapter behind the same methods; costs some 150 us a tick for five drives."""

    packs = False
    overflows = 0  # python-can does not tell

    def __init__(self, bus: can.BusABC, name: str) -> None:
        import can

        self.name = name
        self._bus = bus
        self._message = can.Message
        self._refusals = (can.CanError, OSError)

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
        try:
            message = self._bus.recv(timeout=0.0)
        except self._refusals:
            return False
        if message is None:
            return False
        pdo.FRAME.pack_into(buffer, 0, _flagged_id(message), message.dlc, bytes(message.data))
        return True

    def start_cyclic_sync(self, period_s: float) -> None:
        raise BusError(said("bus.no_timer", name=self.name))

    def stop_cyclic_sync(self) -> None:
        """Nothing runs."""

    def restart(self) -> None:
        """Nothing: python-can has no word for it."""

    def close(self) -> None:
        self._bus.shutdown()


def _flagged_id(message: can.Message) -> int:
    flags = pdo.EXTENDED_FLAG * message.is_extended_id | pdo.REMOTE_FLAG * message.is_remote_frame
    return int(message.arbitration_id | flags | pdo.ERROR_FLAG * message.is_error_frame)


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
            said("bus.no_hub", name=settings.name, channel=settings.channel, why=error.strerror)
        ) from error


def _open_adapter(settings: BusSettings, filters: Sequence[tuple[int, int]]) -> AdapterSocket:
    import can

    channel, _, options = settings.channel.partition("?")
    wanted = [_adapters_filter(can_id, mask) for can_id, mask in filters]
    try:
        bus = can.Bus(
            interface=settings.interface,
            channel=channel,
            bitrate=settings.bit_rate,
            can_filters=wanted,
            **_options(options),
        )
    except (can.CanError, OSError, ValueError, TypeError, ImportError) as error:
        raise BusError(
            said(
                "bus.no_adapter",
                name=settings.name,
                interface=settings.interface,
                channel=settings.channel,
                why=error,
            )
        ) from error
    return AdapterSocket(bus, settings.name)


def _adapters_filter(can_id: int, mask: int) -> can.typechecking.CanFilter:
    everything: can.typechecking.CanFilter = {"can_id": 0, "can_mask": 0}
    return {"can_id": can_id, "can_mask": mask, "extended": False} if mask else everything


def _options(text: str) -> dict[str, Any]:
    """Options ``host=127.0.0.1&port=29536`` as keyword arguments; whole numbers are numbers."""
    return {name: int(value) if value.isdecimal() else value for name, value in parse_qsl(text)}
