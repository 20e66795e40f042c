"""All drives of a machine as the tick sees them: four calls per tick.

    receive(now)              drain every bus: feedback, emergencies, heartbeats
    sync(now)                 SYNC: all drives latch the setpoints of the previous tick at once
    command(setpoints, now)   the setpoints for the next SYNC, and our heartbeat when due
    fault(now)                what is wrong, as a value

SYNC goes out first, into an empty queue, so that it waits for one frame at most.
A TPDO is owed for each SYNC sent: a skipped SYNC owes none. With sync = "kernel"
the SYNC is the broadcast manager's; it comes back as an echo (`sync_seen`), and a
TPDO is owed from one echo to the next.

Nothing here locks, logs, raises, or allocates anything that stays.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from drives import pdo
from drives.bus import Port
from drives.cia402 import Wanted
from drives.drive import Drive, DriveFault, Handler
from drives.settings import MasterSettings

__all__ = ["MOST_FRAMES", "DriveFault", "Group"]

# Frames taken from one bus in one tick. At 1 Mbit/s 36 of the shortest fit into 2 ms; a
# babbling node must not hold the tick, and what is left comes with the next.
MOST_FRAMES = 128

_NONE = DriveFault.NONE
_FINE = (_NONE, -1)

# CAN_ERR_CRTL, byte 1 (linux/can/error.h): overflows and error passive; its warnings pass.
_CONTROLLER_PROBLEM = 0x004
_SEVERE = 0x01 | 0x02 | 0x10 | 0x20


class _Line:
    """One bus of the group: its port, who listens on it, and what its drives send, in a row."""

    def __init__(self, port: Port, drives: Sequence[Drive], first: int) -> None:
        self.port = port
        self.send = port.send
        self.receive_into = port.receive_into
        self.drives = tuple(drives)
        self.first = first  # index in the group of its first drive, to name the bus by
        self.handlers: dict[int, Handler] = {}
        for drive in drives:
            self.handlers.update(drive.handlers)
        self.packet = bytearray(pdo.FRAME_BYTES * len(drives))
        # Neighbours in one packet wake the hub once; a real CAN socket takes one frame at a time.
        self.packs = bool(getattr(port, "packs", False))
        if self.packs:
            room = memoryview(self.packet)
            for i, drive in enumerate(drives):
                drive.place(room[i * pdo.FRAME_BYTES : (i + 1) * pdo.FRAME_BYTES])


class Group:
    """The drives in the order of the axes, on one or more buses.

    Read: ``positions`` (counts, per drive), ``sync_seen`` and ``syncs_seen`` (SYNC echoes in
    the last ``receive``), ``drives``, ``foreign_syncs``, ``unsent`` (frames since start).
    """

    def __init__(
        self, drives: Sequence[Drive], sockets_by_bus: Mapping[str, Port], master: MasterSettings
    ) -> None:
        """Raises KeyError if a drive's bus has no socket."""
        self.drives = tuple(drives)
        self.master = master
        self.wanted = Wanted.OFF
        self.positions = [0] * len(self.drives)
        self.sync_seen = False
        self.syncs_seen = 0
        self.foreign_syncs = 0
        self.unsent = 0
        self._lines = _lines(self.drives, sockets_by_bus)
        self._turns = _turns(self.drives, self._lines)
        self._kernel_sync = master.sync == "kernel"
        self._buffer = bytearray(pdo.FRAME_BYTES)
        whole = memoryview(self._buffer)
        # A view per length, so that a handler sees exactly the bytes that were sent.
        self._data = tuple(whole[pdo.DATA_AT : pdo.DATA_AT + n] for n in range(9))
        self._sync_frame = pdo.frame(pdo.SYNC)
        state = bytes([pdo.NMT_OPERATIONAL])
        self._heartbeat_frame = pdo.frame(pdo.HEARTBEAT + master.node_id, state)
        self._heartbeat_due_s = float("-inf")
        self._judged = False  # something is wanted, so something can be wrong
        self._bus_error_at = -1
        self._send_failed_at = -1

    # -- once

    def start(self) -> None:
        """Starts the kernel's SYNC where configured. Raises BusError."""
        if self._kernel_sync:
            for line in self._lines:
                line.port.start_cyclic_sync(self.master.period_s)

    def stop_sync(self) -> None:
        """Ends the kernel's SYNC, so that the drives' own supervision takes over."""
        if self._kernel_sync:
            for line in self._lines:
                line.port.stop_cyclic_sync()

    def close(self) -> None:
        """Leaves every bus; silence makes the drives stop by their own supervision."""
        for line in self._lines:
            line.port.close()

    # -- every tick

    def receive(self, now_s: float) -> None:
        """Takes what came in on every bus, and settles whether the feedback owed has come."""
        self.syncs_seen = 0
        for line in self._lines:
            self._drain(line, now_s)
            if not self._kernel_sync:
                for drive in line.drives:
                    drive.settle()
        self.sync_seen = self.syncs_seen > 0
        positions = self.positions
        for i, drive in enumerate(self.drives):
            positions[i] = drive.position

    def _drain(self, line: _Line, now_s: float) -> None:
        receive_into, handlers = line.receive_into, line.handlers
        buffer, data, unpack = self._buffer, self._data, pdo.HEADER.unpack_from
        for _ in range(MOST_FRAMES):
            if not receive_into(buffer):
                return
            can_id, length = unpack(buffer)
            handler = handlers.get(can_id)
            if handler is not None:
                handler(data[length if length < 8 else 8], now_s)
            elif can_id == pdo.SYNC:
                self._heard_sync(line)
            elif can_id & pdo.ERROR_FLAG:
                self._heard_error(line, can_id)

    def _heard_sync(self, line: _Line) -> None:
        if not self._kernel_sync:
            # A second producer makes drives latch in between: twice the speed, half the step.
            self.foreign_syncs += 1
            self._bus_error_at = line.first
            return
        if line is self._lines[0]:
            self.syncs_seen += 1
        for drive in line.drives:
            drive.settle()
            drive.expect()

    def _heard_error(self, line: _Line, can_id: int) -> None:
        """An error frame of the CAN controller; its warnings alone are not a fault."""
        classes = can_id & ~pdo.ERROR_FLAG
        if classes == _CONTROLLER_PROBLEM and not self._buffer[pdo.DATA_AT + 1] & _SEVERE:
            return
        self._bus_error_at = line.first

    def sync(self, now_s: float) -> bool:
        """Sends SYNC on every bus; True if it went out. With sync = "kernel" it sends nothing."""
        if self._kernel_sync:
            return self.sync_seen
        good = True
        for line in self._lines:
            if line.send(self._sync_frame):
                for drive in line.drives:
                    drive.expect()
            else:
                good = self._failed(line.first)
        return good

    def command(self, setpoints: Sequence[int], now_s: float) -> bool:
        """Sends each drive its setpoint (counts, order of ``drives``); True if all went out."""
        good = True
        for line, turns in self._turns:
            for i, drive in turns:
                refused = drive.refused
                frame = drive.frame(setpoints[i], now_s)
                if drive.refused != refused or not (line.packs or line.send(frame)):
                    good = self._failed(i)
            if line.packs and not line.send(line.packet):
                good = self._failed(line.first)
        if now_s >= self._heartbeat_due_s:
            good = self._beat(now_s) and good
        return good

    def _beat(self, now_s: float) -> bool:
        self._heartbeat_due_s = now_s + self.master.heartbeat_s
        good = True
        for line in self._lines:
            if not line.send(self._heartbeat_frame):
                good = self._failed(line.first)
        return good

    def _failed(self, index: int) -> bool:
        self.unsent += 1
        self._send_failed_at = index
        return False

    # -- state

    def want(self, wanted: Wanted) -> None:
        """Sets the goal of every drive, once per request. RESET and ENABLED forget bus faults."""
        if wanted is Wanted.RESET or (wanted is Wanted.ENABLED and wanted is not self.wanted):
            self._bus_error_at = self._send_failed_at = -1
        self.wanted = wanted
        self._judged = wanted is Wanted.ENABLED or wanted is Wanted.QUICK_STOP
        for drive in self.drives:
            drive.want(wanted)

    def following(self) -> bool:
        """Whether every drive uses the commanded setpoints."""
        return all(drive.following for drive in self.drives)

    def fault(self, now_s: float) -> tuple[DriveFault, int]:
        """The first thing wrong and the index of its drive (of a bus: of its first drive).

        NONE with index -1 if all is well, or while nothing is wanted (OFF, RESET).
        """
        if not self._judged:
            return _FINE
        if self._bus_error_at >= 0:
            return DriveFault.BUS_ERROR, self._bus_error_at
        consumer_s = self.master.consumer_s
        for i, drive in enumerate(self.drives):
            fault = drive.fault(now_s, consumer_s)
            if fault is not _NONE:
                return fault, i
        if self._send_failed_at >= 0:
            return DriveFault.SEND_FAILED, self._send_failed_at
        return _FINE


def _lines(drives: Sequence[Drive], ports: Mapping[str, Port]) -> tuple[_Line, ...]:
    """The buses in the order in which the drives first name them."""
    lines = []
    for bus in dict.fromkeys(drive.settings.bus for drive in drives):
        here = [drive for drive in drives if drive.settings.bus == bus]
        lines.append(_Line(ports[bus], here, drives.index(here[0])))
    return tuple(lines)


Turns = tuple[tuple[_Line, tuple[tuple[int, Drive], ...]], ...]


def _turns(drives: Sequence[Drive], lines: Sequence[_Line]) -> Turns:
    """Per bus: which setpoint goes to which drive."""
    return tuple((line, tuple((drives.index(d), d) for d in line.drives)) for line in lines)
