"""Commissioning over SDO: every drive is what the machine file says, or a sentence tells why not.

Nothing is assumed to have been stored in a drive: each start writes all that the
cyclic side relies on and reads it back. Once a drive is NMT operational the tick's
group takes over; this network stays for the slow path (homing mode, parameters).

canopen is used for data sheets, SDO and NMT only. Its network is replaced: frames go
over a port of ours, and whoever sends a request lives through the time until the
answer by ``pump`` (waiting on the descriptor, or advancing the stepped bus). So
there is no receiving thread and no other clock than the pump's.
"""

from __future__ import annotations

import contextlib
import logging
import select
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Protocol

import canopen
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

from drives import pdo
from drives.settings import MasterSettings, NodeSettings

CSP = 8
QUICK_STOP_BY_ITSELF = 3  # 6007h
QUICK_STOP_THEN_OFF = 2  # 605Ah
OFF = 0x8000_0000  # COB-ID bit 31
COB_ID_MASK = 0x8000_07FF
CONTROLWORD, TARGET = 0x6040_0010, 0x607A_0020
STATUSWORD, POSITION = 0x6041_0010, 0x6064_0020
SDO_REQUEST, SDO_ANSWER_BEFORE = 0x600, 0x80
CLIENT_ABORT = 0x80

NMT_START, NMT_PRE_OPERATIONAL = 0x01, 0x80
BOOT_TRIES, BOOT_TRY_S = 20, 0.1  # a drive may be starting up when we look for it

# Everything it would log here is raised as well, with a better sentence.
logging.getLogger("canopen.sdo.client").setLevel(logging.CRITICAL)

Pump = Callable[[], float]  # lets a little time pass, gives the present one (s)


class CommissionError(Exception):
    """A drive is not there, is another one, or does not take a setting: drive, object, what to do."""


class Port(Protocol):
    """What is needed of a bus; see drives.bus."""

    def send(self, frame: bytes | bytearray, /) -> bool: ...

    def receive_into(self, buffer: bytearray, /) -> bool: ...


class Stepped(Protocol):
    """A stepped bus or rig."""

    @property
    def now_s(self) -> float: ...

    def advance(self, now_s: float, /) -> None: ...


def wall_pump(fileno: int, slice_s: float = 0.01) -> Pump:
    """Wait for a frame on a descriptor (-1: just wait a little); CLOCK_MONOTONIC."""

    def pump() -> float:
        if fileno >= 0:
            select.select([fileno], [], [], slice_s)
        else:
            time.sleep(0.001)
        return time.monotonic()

    return pump


def stepped_pump(stepped: Stepped, step_s: float = 0.0002) -> Pump:
    """Advance the stepped bus; nobody else may advance it meanwhile (no tick runs yet)."""

    def pump() -> float:
        stepped.advance(stepped.now_s + step_s)
        return stepped.now_s

    return pump


class Network(canopen.Network):
    """canopen's network over one of our ports, without a thread."""

    def __init__(self, port: Port, pump: Pump, patience_s: float = 1.0) -> None:
        super().__init__()
        self._port = port
        self._pump = pump
        self._buffer = bytearray(pdo.FRAME_BYTES)
        self._awaited = -1
        self._joined: dict[int, canopen.RemoteNode] = {}
        self.patience_s = patience_s
        self.nmt_states: dict[int, int] = {}  # by node, as its newest heartbeat says

    def join(self, settings: NodeSettings) -> canopen.RemoteNode:
        """The node as canopen sees it, added once."""
        node = self._joined.get(settings.node)
        if node is None:
            node = canopen.RemoteNode(settings.node, _data_sheet(settings.eds))
            node.sdo.RESPONSE_TIMEOUT = 0  # the answer is there before canopen looks for it
            self.add_node(node)
            self._joined[settings.node] = node
        return node

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Send; an SDO request returns when its answer has come or the patience has ended."""
        flags = pdo.REMOTE_FLAG if remote else 0
        if not self._port.send(pdo.frame(can_id | flags, bytes(data))):
            raise CommissionError("the bus does not take frames: is it up, and is anybody on it?")
        if SDO_REQUEST < can_id < SDO_REQUEST + 0x80 and data[0] != CLIENT_ABORT:
            self._awaited = can_id - SDO_ANSWER_BEFORE
            self.wait(lambda: self._awaited < 0)

    def wait(self, done: Callable[[], bool]) -> bool:
        """Let time pass until ``done()``; False when the patience ends first."""
        self.receive()
        deadline_s = self._pump() + self.patience_s
        self.receive()
        while not done():
            if self._pump() > deadline_s:
                self.receive()
                return done()
            self.receive()
        return True

    def receive(self) -> None:
        """Hand over everything that has arrived."""
        while self._port.receive_into(self._buffer):
            can_id, data = pdo.unpack(self._buffer)
            if can_id == self._awaited:
                self._awaited = -1
            elif can_id & pdo.GROUP_MASK == pdo.HEARTBEAT and data:
                self.nmt_states[can_id & 0x7F] = data[0] & 0x7F
            self.notify(can_id, bytearray(data), 0.0)


@lru_cache(maxsize=32)
def _data_sheet(path: str) -> canopen.ObjectDictionary:
    return canopen.import_od(path)


@dataclass(frozen=True, slots=True)
class Setting:
    """One object to write and read back."""

    index: int
    sub: int
    value: int
    why: str  # completes "... is needed"
    optional: bool = False  # only where the data sheet has it
    mask: int = -1  # what must agree when read back

    @property
    def where(self) -> str:
        return f"object {self.index:04X}h:{self.sub:02X}"


class Drive:
    """One drive during commissioning: reads and writes with sentences for errors."""

    def __init__(self, network: Network, settings: NodeSettings) -> None:
        self._network = network
        self.settings = settings
        self._node = network.join(settings)

    @property
    def title(self) -> str:
        return f"drive {self.settings.name} (node {self.settings.node})"

    def meet(self) -> None:
        """Wait until the drive answers at all. Raises CommissionError."""
        patience_s, self._network.patience_s = self._network.patience_s, BOOT_TRY_S
        try:
            for _ in range(BOOT_TRIES):
                with contextlib.suppress(CommissionError):
                    self.read(0x1000)
                    return
        finally:
            self._network.patience_s = patience_s
        self.read(0x1000)

    def has(self, index: int, sub: int) -> bool:
        """Whether the data sheet knows the object."""
        return self._node.object_dictionary.get_variable(index, sub) is not None

    def command(self, nmt: int) -> None:
        """An NMT command to this node."""
        self._network.send_message(pdo.NMT, bytes([nmt, self.settings.node]))

    def read(self, index: int, sub: int = 0) -> int:
        """Upload. Raises CommissionError."""
        try:
            return int(self._variable(index, sub).raw)
        except SdoAbortedError as error:
            raise CommissionError(
                f"{self.title}: reading object {index:04X}h:{sub:02X} was refused: {error}"
            ) from error
        except SdoCommunicationError as error:
            raise CommissionError(self._silent(index, sub)) from error

    def write(self, setting: Setting) -> None:
        """Download and read back. Raises CommissionError."""
        if not self.has(setting.index, setting.sub):
            if setting.optional:
                return
            raise CommissionError(
                f"{self.title}: its data sheet {self.settings.eds} has no {setting.where}, but {setting.why};"
                " a drive without it cannot be used here"
            )
        self._download(setting)
        found = self.read(setting.index, setting.sub)
        if (found ^ setting.value) & setting.mask:
            raise CommissionError(
                f"{self.title}: {setting.where} was set to {_shown(setting.value)} but reads"
                f" {_shown(found)}; {setting.why}; check that the drive supports this value"
            )

    def _download(self, setting: Setting) -> None:
        try:
            self._variable(setting.index, setting.sub).raw = setting.value
        except SdoAbortedError as error:
            raise CommissionError(
                f"{self.title}: {setting.where} refuses {_shown(setting.value)}: {error};"
                f" {setting.why}; choose a value the drive supports"
            ) from error
        except SdoCommunicationError as error:
            raise CommissionError(self._silent(setting.index, setting.sub)) from error

    def _silent(self, index: int, sub: int) -> str:
        return (
            f"{self.title}: no answer to SDO (object {index:04X}h:{sub:02X}) within"
            f" {self._network.patience_s:g} s; check power, wiring, bit rate and node id"
        )

    def _variable(self, index: int, sub: int) -> Any:
        entry = self._node.sdo[index]
        return entry[sub] if hasattr(entry, "__getitem__") else entry

    def set_mode(self, mode: int) -> None:
        """Mode of operation, 6060h, and wait until 6061h shows it. Raises CommissionError."""
        self._download(Setting(0x6060, 0, mode, f"mode {mode} is needed"))
        if not self._network.wait(lambda: self.read(0x6061) == mode):
            raise CommissionError(
                f"{self.title}: mode of operation {mode} was asked for, object 6061h still shows"
                f" {self.read(0x6061)}; check that the drive supports it"
            )


def commission(network: Network, nodes: Sequence[NodeSettings], master: MasterSettings) -> None:
    """Make every drive on this network ready for the tick and start it (NMT operational).

    Raises CommissionError at the first thing that is not as it must be; the drives
    are then left pre-operational.
    """
    drives = [Drive(network, settings) for settings in nodes]
    for drive in drives:
        drive.command(NMT_PRE_OPERATIONAL)
        drive.meet()
        _identify(drive)
        for setting in settings_of(drive.settings, master):
            drive.write(setting)
        drive.set_mode(CSP)
    network.nmt_states.clear()
    for drive in drives:
        drive.command(NMT_START)
    for drive in drives:
        _see_operational(network, drive)


def _see_operational(network: Network, drive: Drive) -> None:
    node = drive.settings.node
    if not network.wait(lambda: network.nmt_states.get(node) == pdo.NMT_OPERATIONAL):
        raise CommissionError(
            f"{drive.title}: its heartbeat does not show NMT state operational after the start command;"
            " look for its error message, and for another master on the bus"
        )


def set_mode(network: Network, node: NodeSettings, mode: int) -> None:
    """Change a standing drive's mode of operation (6 homing, 8 cyclic synchronous position)."""
    Drive(network, node).set_mode(mode)


def _identify(drive: Drive) -> None:
    """The drive answers, is a CiA 402 drive with CSP, and is the one of the data sheet."""
    kind = drive.read(0x1000) & 0xFFFF
    if kind != 402:
        raise CommissionError(
            f"{drive.title}: object 1000h says device profile {kind}, needed is 402; check the node id"
        )
    sheet = _data_sheet(drive.settings.eds).device_information
    for sub, wanted, what in ((1, sheet.vendor_number, "vendor"), (2, sheet.product_number, "product code")):
        found = drive.read(0x1018, sub)
        if wanted and found != wanted:
            raise CommissionError(
                f"{drive.title}: {what} (object 1018h:{sub:02X}) is {found:#x}, its data sheet"
                f" {drive.settings.eds} says {wanted:#x}; check node id and data sheet"
            )
    if drive.has(0x6502, 0) and not drive.read(0x6502) & 1 << (CSP - 1):
        raise CommissionError(
            f"{drive.title}: object 6502h shows no cyclic synchronous position mode; it cannot be used here"
        )


def settings_of(node: NodeSettings, master: MasterSettings) -> Iterator[Setting]:
    """Everything a drive is told, in order; process data off before it is changed."""
    yield from _process_data(node)
    yield from _interpolation(node.period_s)
    yield from _supervision(node, master)
    yield from _limits_and_homing(node)


def _process_data(node: NodeSettings) -> Iterator[Setting]:
    """CiA 301's order of remapping: off, type, count 0, entries, count, on. All further PDOs off."""
    for parameters, mapping, can_id, entries, what in (
        (0x1400, 0x1600, pdo.RPDO1 + node.node, (CONTROLWORD, TARGET), "setpoints come by RPDO 1"),
        (0x1800, 0x1A00, pdo.TPDO1 + node.node, (STATUSWORD, POSITION), "feedback goes by TPDO 1"),
    ):
        for more in range(1, 4):
            why = "process data that nobody reads would take bus time"
            yield Setting(parameters + more, 1, OFF | can_id + 0x100 * more, why, optional=True, mask=OFF)
        yield Setting(parameters, 1, OFF | can_id, what, mask=COB_ID_MASK)
        yield Setting(parameters, 2, 1, f"{what} with every SYNC")
        yield Setting(mapping, 0, 0, what)
        for sub, entry in enumerate(entries, 1):
            yield Setting(mapping, sub, entry, what)
        yield Setting(mapping, 0, len(entries), what)
        yield Setting(parameters, 1, can_id, what, mask=COB_ID_MASK)


def interpolation_time(period_s: float) -> tuple[int, int]:
    """A period as 60C2h wants it: (value 1 .. 255, power of ten), in the coarsest unit that is exact.

    Many drives take milliseconds only. Raises CommissionError for what has no such form.
    """
    for exponent in (-3, -4, -5, -6):
        value = period_s * 10.0**-exponent
        if abs(value - round(value)) < 1e-6 and 1 <= round(value) <= 255:
            return round(value), exponent
    raise CommissionError(
        f"a period of {period_s * 1e3:g} ms cannot be told to a drive (object 60C2h); allowed are"
        " 1 .. 255 ms, or that many tenths, hundredths or thousandths of it; change period_s"
    )


def _interpolation(period_s: float) -> Iterator[Setting]:
    value, exponent = interpolation_time(period_s)
    why = f"the drive interpolates over the tick of {period_s * 1e3:g} ms"
    yield Setting(0x60C2, 1, value, why)
    yield Setting(0x60C2, 2, exponent, why)


def _supervision(node: NodeSettings, master: MasterSettings) -> Iterator[Setting]:
    """The drive must stop by itself when the controller goes silent."""
    silence = master.node_id << 16 | round(master.consumer_s * 1e3)
    why = "the drive must notice a dead controller"
    yield Setting(0x1016, 1, silence, why)
    yield Setting(0x1017, 0, round(master.heartbeat_s * 1e3), "the controller must notice a dead drive")
    yield Setting(0x6007, 0, QUICK_STOP_BY_ITSELF, f"{why} and stop")
    yield Setting(0x605A, 0, QUICK_STOP_THEN_OFF, "a quick stop must ramp down and switch off")


def _limits_and_homing(node: NodeSettings) -> Iterator[Setting]:
    yield Setting(0x6065, 0, node.following_error_counts, "the drive must notice that it does not follow")
    why = "the drive must know the axis's travel"
    yield Setting(0x607D, 1, node.counts_min, why, optional=True)
    yield Setting(0x607D, 2, node.counts_max, why, optional=True)
    yield Setting(0x6098, 0, node.homing_method, "the machine file chooses how to home", optional=True)
    yield Setting(0x607C, 0, node.homing_position_counts, "homing sets this position", optional=True)


def _shown(value: int) -> str:
    return f"{value} ({value:#x})" if value > 9 else str(value)
