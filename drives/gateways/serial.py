"""A serial adapter shared by several processes: its CAN bus joined to the hub's.

A serial port has one owner. The controller's processes each want a descriptor of
their own, so the hub (without bit timing and without drives) owns the adapter, and
they join the hub. What one of them sends goes to the adapter and to the others, as
SocketCAN does it on one interface.
"""

from __future__ import annotations

from drives import bus, pdo
from drives.settings import BusSettings
from drives.virtual.error_counters import CONTROLLER, overflow_frame
from drives.virtual.intake import Host


class SerialAdapter:
    """The adapter at ``channel``, see ``drives.ports.slcan_port``. Raises BusError."""

    def __init__(self, host: Host, channel: str, bit_rate: int) -> None:
        self._host = host
        self._port = bus.open(BusSettings(channel, "slcan", channel, bit_rate))
        self._buffer = bytearray(pdo.FRAME_BYTES)
        self._source = host.bus.connect(self._put)
        host.listen(self._port.fileno(), self._read)

    def _put(self, frame: bytes, at_s: float) -> None:
        """To the adapter; who sent it is told as SocketCAN tells it: some time later, by an error frame."""
        if not self._port.send(frame):
            self._host.bus.submit(self._source, at_s, pdo.ERROR_FLAG | CONTROLLER, overflow_frame())

    def _read(self) -> None:
        stepped, buffer = self._host.bus, self._buffer
        while self._port.receive_into(buffer):
            can_id = int.from_bytes(buffer[:4], "little")
            stepped.submit(self._source, stepped.now_s, can_id, bytes(buffer))

    def restart(self) -> None:
        """A client wants the adapter to leave bus-off."""
        self._port.restart()

    def close(self) -> None:
        self._host.bus.disconnect(self._source)
        self._host.forget(self._port.fileno())
        self._port.close()
