"""canopen's network over one of our ports, without a thread and without a clock of its own.

canopen is used for data sheets, SDO and NMT only. Whoever sends a request lives
through the time until the answer by ``pump`` (waiting on the descriptor, or advancing
the stepped bus). So there is no receiving thread and no other clock than the pump's.
"""

from __future__ import annotations

import select
import time
from collections.abc import Callable
from typing import Protocol

import canopen

from drives import pdo
from drives.commissioning import sheet
from drives.text_file import Source
from drives.texts import Message, TextError, message, plain

SDO_REQUEST, SDO_ANSWER_BEFORE = 0x600, 0x80
ABORT = 0x80
# CiA 301, 7.2.4.3: what begins a download or an upload, by the command of its answer, which names the object
# again. Segments name none.
COMMAND_MASK, ANSWERED_BY = 0xE0, {0x20: 0x60, 0x40: 0x40}
NO_OBJECT = bytes(3)  # in some drives' aborts
SEND_TRIES = 20
BOOT_UP = b"\0"  # on the heartbeat's identifier (CiA 301, 7.2.8.3.3)

Pump = Callable[[], float]  # lets a little time pass, gives the present one (s)
Hearer = Callable[[int, bytes], None]  # called with identifier and data of everything that arrives


class CommissionError(TextError):
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


class Named(Protocol):
    """What has a name and a node id."""

    @property
    def name(self) -> str: ...

    @property
    def node(self) -> int: ...


class Node(Named, Protocol):
    """What any kind of node's settings tell of it."""

    @property
    def eds(self) -> Source: ...


def title(drive: Named) -> Message:
    """What a drive is called in sentences."""
    return message("drive.title", name=drive.name, node=drive.node)


def of_drive(drive: Named, what: Message | BaseException) -> Message:
    """What is said of one drive."""
    return message("drive.of", title=title(drive), why=what)


def without_title(error: CommissionError) -> Message:
    """What an error says, without the drive that it is of."""
    return plain(error.said["values"]["why"] if error.said["key"] == "drive.of" else error.said)


def wall_pump(fileno: int, slice_s: float = 0.01) -> Pump:
    """Wait for a frame on a descriptor (-1: just wait a little); CLOCK_MONOTONIC."""

    def pump() -> float:
        if fileno >= 0:
            select.select([fileno], [], [], slice_s)
        else:
            time.sleep(0.001)
        return time.monotonic()

    return pump


def stepped_pump(stepped: Stepped, step_s: float = 0.001) -> Pump:
    """Advance the stepped bus by about what an answer takes; nobody else may meanwhile: no tick runs yet."""

    def pump() -> float:
        now_s = stepped.now_s + step_s
        stepped.advance(now_s)
        return now_s

    return pump


class Network(canopen.Network):
    """One bus as commissioning sees it."""

    def __init__(self, port: Port, pump: Pump, patience_s: float = 1.0) -> None:
        super().__init__()
        self._port = port
        self._pump = pump
        self._buffer = bytearray(pdo.FRAME_BYTES)
        self._awaited = -1  # identifier of the answer that is waited for
        self._asked = b""  # the request, if its answer shows that it is one to it
        self._joined: dict[sheet.Sheet, canopen.RemoteNode] = {}
        self.patience_s = patience_s
        self.nmt_states: dict[int, int] = {}  # by node, as its newest heartbeat says
        self.booted: set[int] = set()  # nodes whose boot-up message has been heard
        self.hearer: Hearer | None = None  # hears along

    def join(self, settings: Node) -> canopen.RemoteNode:
        """The node as canopen sees it with the data sheet of its settings. Raises CommissionError."""
        try:
            about = sheet.of(settings)
        except sheet.SheetError as error:
            raise CommissionError(of_drive(settings, error)) from error
        node = self._joined.get(about)
        if node is None:
            node = self._joined[about] = canopen.RemoteNode(settings.node, about.dictionary)
            node.sdo.RESPONSE_TIMEOUT = 0  # the answer is there before canopen looks for it
        if self.nodes.get(settings.node) is not node:
            self[settings.node] = node
        return node

    def post(self, can_id: int, data: bytes = b"") -> None:
        """Send and do not wait. Raises CommissionError."""
        frame = pdo.frame(can_id, bytes(data))
        for _ in range(SEND_TRIES):
            if self._port.send(frame):
                return
            self._pump()  # its queue may be short, and full
        raise CommissionError(message("drive.bus_takes_none"))

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Send; an SDO request returns when its answer has come or the patience has ended."""
        asks = SDO_REQUEST < can_id < SDO_REQUEST + 0x80 and data[0] != ABORT
        if asks:  # from here on: what was asked before may be answered just now
            self._awaited = can_id - SDO_ANSWER_BEFORE
            self._asked = bytes(data) if data[0] & COMMAND_MASK in ANSWERED_BY else b""
        # Heartbeats fill an unread queue in seconds, and a full one would lose the answer.
        self.receive()
        self.post(can_id | pdo.REMOTE_FLAG if remote else can_id, data)
        if asks:
            self.wait(lambda: self._awaited < 0)

    def wait(self, done: Callable[[], bool], patience_s: float | None = None) -> bool:
        """Let time pass until ``done()``; False when the patience ends first."""
        self.receive()
        deadline_s = self._pump() + (self.patience_s if patience_s is None else patience_s)
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
                if not self._fits(data):
                    continue  # an answer to what was asked before, and too late for that
                self._awaited = -1
            elif pdo.group(can_id) == pdo.HEARTBEAT and data:
                self.nmt_states[can_id & pdo.NODE_MASK] = data[0] & 0x7F
                if data == BOOT_UP:
                    self.booted.add(can_id & pdo.NODE_MASK)
            if self.hearer is not None:
                self.hearer(can_id, data)
            self.notify(can_id, bytearray(data), 0.0)

    def _fits(self, answer: bytes) -> bool:
        """Whether it can be the answer to the last request."""
        asked = self._asked
        if not asked:
            return True
        if answer[:1] == bytes([ABORT]):
            return answer[1:4] in (asked[1:4], NO_OBJECT)
        return answer[1:4] == asked[1:4] and answer[0] & COMMAND_MASK == ANSWERED_BY[asked[0] & COMMAND_MASK]
