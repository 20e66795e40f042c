"""The hub's options on a command line, for every program that serves one: faults, log, an adapter."""

from __future__ import annotations

import argparse
import contextlib
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Protocol, TypeVar

from drives import bus, pdo
from drives.bench.virtual.fault_script import FaultScript, ScriptError
from drives.bench.virtual.hub import Gateway
from drives.bench.virtual.intake import Host
from drives.bus import AdapterSocket, BusError, FrameSocket, SlcanPort
from drives.log import candump
from drives.ports.error_frames import CONTROLLER, lost_frame, overflow_frame
from drives.settings import BusSettings
from drives.texts import english, message

# An adapter shared by several processes: its CAN bus joined to the hub's.
#
# A serial port has one owner, and so has an adapter of python-can. The controller's processes
# each want a descriptor of their own, so the hub (without bit timing and without drives) owns
# the adapter, and they join the hub. What one of them sends goes to the adapter and to the
# others, as SocketCAN does it on one interface.

EVERYTHING = ((0, 0),)  # the filter of a port
LOOK_S = 5e-4  # from one look to the next at an adapter that has nothing to wait on


class SharedAdapter:
    """An adapter's ``port``, as a gateway of the hub; it takes whatever comes."""

    def __init__(self, host: Host, port: FrameSocket | SlcanPort | AdapterSocket) -> None:
        self._host, self._port = host, port
        self._buffer = bytearray(pdo.FRAME_BYTES)
        self._source = host.bus.connect(self._put)
        self._descriptor = port.fileno()
        self._closed = False
        if self._descriptor >= 0:
            host.listen(self._descriptor, self._read)
        else:
            self._look(host.bus.now_s)

    def _put(self, frame: bytes, at_s: float) -> None:
        """To the adapter; who sent it is told as SocketCAN tells it: some time later, by an error frame."""
        if not self._port.send(frame):
            self._host.bus.submit(self._source, at_s, pdo.ERROR_FLAG | CONTROLLER, overflow_frame())

    def _read(self) -> None:
        """What has come, to everybody; and that frames were lost before they got here."""
        stepped, buffer, lost = self._host.bus, self._buffer, self._port.overflows
        while self._port.receive_into(buffer):
            can_id = int.from_bytes(buffer[:4], "little")
            stepped.submit(self._source, stepped.now_s, can_id, bytes(buffer))
        if self._port.overflows != lost:
            stepped.submit(self._source, stepped.now_s, pdo.ERROR_FLAG | CONTROLLER, lost_frame())

    def _look(self, now_s: float) -> None:
        if not self._closed:
            self._read()
            self._host.bus.agenda.add(now_s + LOOK_S, self._look)

    def restart(self) -> None:
        """A client wants the adapter to leave bus-off."""
        self._port.restart()

    def close(self) -> None:
        self._closed = True
        self._host.bus.disconnect(self._source)
        self._host.forget(self._descriptor)
        self._port.close()


class Served(Host, Protocol):
    """A hub, or a bridge to a CAN interface."""

    path: str

    def plan_faults(self, faults: FaultScript) -> None: ...

    def open_gateway(self, gateway: Gateway) -> None: ...


S = TypeVar("S", bound=Served)


def helped(option: str) -> str:
    """What an option does, in English: nothing around it has another language."""
    return english(message(f"help_bench.{option}"))


def add_options(parser: argparse.ArgumentParser) -> None:
    """--faults, --log, --serial."""
    parser.add_argument("--faults", metavar="FILE", type=Path, help=helped("faults"))
    parser.add_argument("--log", metavar="FILE", help=helped("log"))
    parser.add_argument(
        "--serial",
        metavar="PORT=BIT_RATE",
        help=helped("serial"),
    )


@contextlib.contextmanager
def equipped(
    hub: S,
    faults: Path | None = None,
    log: str | None = None,
    serial: str | None = None,
) -> Iterator[S]:
    """The hub with these options, until the end of the block.

    Raises OSError for a file that cannot be had, BusError for a serial adapter,
    ScriptError with the file's name.
    """
    with contextlib.ExitStack() as stack:
        if faults is not None:
            hub.plan_faults(read_script(faults))
        if log is not None:
            writer = candump.Writer(log, Path(hub.path).name, time.time() - time.monotonic())
            stack.callback(writer.close)
            hub.bus.watch_all(writer)
        if serial is not None:
            hub.open_gateway(_adapter(hub, serial))
        yield hub


def _adapter(host: Host, serial: str) -> SharedAdapter:
    channel, _, rate = serial.rpartition("=")
    if not channel or not rate.isdecimal():
        raise BusError(message("bus.no_serial", serial=serial))
    settings = BusSettings(channel, "slcan", channel, int(rate))
    return SharedAdapter(host, bus.open(settings, EVERYTHING))


def read_script(path: Path) -> FaultScript:
    """Raises OSError, and ScriptError with the name of the file and the line."""
    try:
        return FaultScript.read(path.read_text())
    except ScriptError as error:
        raise ScriptError(message("script.file", file=path, why=error)) from None
