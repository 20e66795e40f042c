"""One bus of a group: its port, who listens on it, and what is wrong with the bus itself.

Nothing here locks, logs, raises, or allocates anything that stays.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from typing import Final

from drives import pdo
from drives.cyclic import chatter
from drives.cyclic.chatter import Bucket, Chatter, Strangers
from drives.cyclic.drive import Drive
from drives.cyclic.drive_fault import DriveFault
from drives.cyclic.io_node import IoNode
from drives.cyclic.spindle import SpindleDrive
from drives.cyclic.supervised import Handler, Supervised
from drives.cyclic.sync_answers import SyncAnswers
from drives.ports.port import Port

# Frames taken from one bus in one tick. At 1 Mbit/s 36 of the shortest fit into 2 ms; a
# babbling node must not hold the tick, and what is left comes with the next.
MAX_FRAMES: Final = 128
MAX_PERIODS: Final = 300  # of a late tick, for which so many more are taken

# Error frames (linux/can/error.h): classes, and byte 1 of a controller problem. Its warnings
# pass, and so do single errors on the wire, which the controllers repair by sending again.
_CLASSES: Final = pdo.ERROR_FLAG - 1
_CONTROLLER, _BUS_OFF, _RESTARTED = 0x004, 0x040, 0x100
_RX_OVERFLOW, _SEVERE = 0x01, 0x02 | 0x10 | 0x20  # TX overflow, error passive

# SYNCs that were heard twice, or too close to one another, so many more than one in ``DOUBLED_IN``. A gateway
# that joins the bus again may repeat a few.
DOUBLED, DOUBLED_IN = 8.0, 16.0
SYNC_PERIOD_S = 0.002  # where nobody says it
THREE_TIMES = 3.0  # so many answers to SYNC as are owed are chatter

# By data bytes, with the stuffing of the worst payload: as ``drives.load.stuffing.worst_bits`` counts.
BITS: Final = tuple(55 + 10 * n for n in range(9))

_NONE: Final = DriveFault.NONE
_HEADER: Final = pdo.HEADER.unpack_from
_HEADERS: Final = pdo.HEADERS


class Line:
    """Read: ``fault`` (the first thing wrong with this bus, kept until ``forget``; bus-off
    outranks), ``off`` (our controller has left the bus: nothing may be sent), ``foreign_syncs``
    (heard here: another's), ``drives``, ``first`` (index in the group of its first drive, -1
    without one), ``errors`` (error frames since start), ``bus`` (its name), ``bits`` (of all frames
    heard and sent here, until somebody sets it back to 0), ``chatter`` (who sends too much, on any
    bus of the group), ``lost`` (received frames that nobody had room for, since start; of a controller
    that does not count them, times that it has said so).
    """

    def __init__(
        self,
        port: Port,
        drives: Sequence[Drive],
        first: int,
        others: Sequence[SpindleDrive | IoNode] = (),
        bus: str = "",
        own: frozenset[int] = frozenset(),
        period_s: float = SYNC_PERIOD_S,
        told: Chatter | None = None,
    ) -> None:
        """``own``: identifiers that only the controller sends; heard, they are a stranger's, as a SYNC is.

        ``told``: the group's ``chatter``.
        """
        self.port = port
        self.bus = bus
        self.bits = 0
        self.send = port.send
        self.drives = tuple(drives)
        self.others = tuple(others)
        self.owing = (*self.drives, *(other for other in others if isinstance(other, SpindleDrive)))
        self.first = first
        self.fault = _NONE
        self.off = False
        self._restarting = False  # we have asked for it: the controller's word of it is no fault
        self.foreign_syncs = 0
        self.errors = self.lost = 0
        self._overflows = port.overflows
        self._receive_into = port.receive_into
        # Of a port that has several frames in one packet: they need not be fetched one by one.
        self._receive_packet: Callable[[int], memoryview | None] | None
        self._receive_packet = getattr(port, "receive_packet", None)
        self.chatter = told or Chatter()
        self._drained_s = self._since_s = math.inf  # the last drain, and the one before it
        self._answers = SyncAnswers()
        self._each_sync = tuple(drive for drive in self.drives if drive.settings.feedback_every == 1)
        self._doubled = Bucket(pdo.SYNC, 1.0 / (DOUBLED_IN * period_s), DOUBLED)
        self._strangers = Strangers()
        self._buckets: list[Bucket] = [self._strangers]
        self._too_often = tuple(
            (node, self._bucket(node.with_sync[0], THREE_TIMES / period_s, chatter.FEEDBACKS))
            for node in self.owing
        )
        self._handlers: dict[int, Handler] = {}
        for node in (*self.drives, *others):
            self._handlers.update(self._counted(node))
        for drive in self.owing:
            drive.answers = self._answers
        self._own = own
        self._waiting = deque[tuple[int, bytes]]()  # frames that a late tick has fetched and not taken yet
        self._with_sync = frozenset(can_id for node in self.owing for can_id in node.with_sync)
        self._buffer = bytearray(pdo.FRAME_BYTES)
        whole = memoryview(self._buffer)
        # A view per length, so that a handler sees exactly the bytes that were sent.
        self._data = tuple(whole[pdo.DATA_AT : pdo.DATA_AT + n] for n in range(9))
        self.setpoint_bits = sum(BITS[drive.setpoint_bytes] for drive in self.drives)
        self.packet = bytearray(pdo.FRAME_BYTES * len(self.drives))
        # Neighbours in one packet wake the hub once; a real CAN socket takes one frame at a time.
        self.packs = bool(self.drives) and bool(getattr(port, "packs", False))
        if self.packs:
            room = memoryview(self.packet)
            for i, drive in enumerate(self.drives):
                drive.place(room[i * pdo.FRAME_BYTES : (i + 1) * pdo.FRAME_BYTES])

    def drain(self, now_s: float, most: int = MAX_FRAMES) -> None:
        """Takes what came in, ``most`` frames of it, and settles whether the feedback owed has come."""
        self._begin_drain(now_s)
        while self._waiting:
            self._take(*self._waiting.popleft(), now_s)
        if self._receive_packet is None:
            self._drain_frames(now_s, most)
        else:
            self._drain_packets(self._receive_packet, now_s, most)
        self._settle(now_s)

    def _begin_drain(self, now_s: float) -> None:
        self._since_s = now_s if now_s < self._drained_s else self._drained_s
        self._drained_s = now_s

    def has_answers(self, most: int) -> bool:
        """Whether an answer to SYNC has come in; fetches ``most`` frames of what is there."""
        waiting, buffer, receive_into = self._waiting, self._buffer, self._receive_into
        for _ in range(most - len(waiting)):
            if not receive_into(buffer):
                break
            can_id, length = _HEADER(buffer)
            waiting.append((can_id, bytes(self._data[min(length, 8)])))
        return any(can_id in self._with_sync for can_id, _ in waiting)

    def drain_answers(self, now_s: float) -> None:
        """Of what was fetched, up to where somebody answers once more: that is of the next SYNC."""
        self._begin_drain(now_s)
        waiting, answered = self._waiting, set[int]()
        while waiting and waiting[0][0] not in answered:
            can_id, data = waiting.popleft()
            if can_id in self._with_sync:
                answered.add(can_id)
            self._take(can_id, data, now_s)
        self._settle(now_s)

    def _take(self, can_id: int, data: bytes, now_s: float) -> None:
        self.bits += BITS[len(data)]
        handler = self._handlers.get(can_id)
        if handler is None:
            self._heard(can_id, memoryview(data), now_s)
            return
        handler(memoryview(data), now_s)
        self.off = False  # whoever hears is on the bus again

    def _settle(self, now_s: float) -> None:
        overflows = self.port.overflows
        if overflows != self._overflows:
            self.lost += overflows - self._overflows
            self._overflows = overflows
            self._fail(DriveFault.RX_OVERFLOW)
        again = self._answers.again
        if again:
            self._judge_answers(now_s)
        for drive in self.owing:
            drive.settle()
        if again:
            for drive in self.owing:
                drive.again = 0

    def _bucket(self, can_id: int, drains_per_s: float, most: float) -> Bucket:
        bucket = Bucket(can_id, drains_per_s, most)
        self._buckets.append(bucket)
        return bucket

    def _counted(self, node: Supervised) -> dict[int, Handler]:
        """Its handlers; of all but what it sends with SYNC the frames are counted."""
        seldom = (pdo.EMCY + node.node, pdo.HEARTBEAT + node.node)
        found = {}
        for can_id, handler in node.handlers.items():
            if can_id in node.with_sync:
                found[can_id] = handler
                continue
            often = (chatter.OFTEN_PER_S, chatter.OFTEN)
            limits = (chatter.SELDOM_PER_S, chatter.SELDOM) if can_id in seldom else often
            found[can_id] = self._counting(self._bucket(can_id, *limits), handler)
        return found

    def _counting(self, bucket: Bucket, handler: Handler) -> Handler:
        def count(data: memoryview, now_s: float) -> None:
            if bucket.count(now_s, self._since_s):
                self.chatter.report(bucket, now_s)
            handler(data, now_s)

        return count

    def _judge_answers(self, now_s: float) -> None:
        """Somebody has answered a SYNC more than once."""
        if self._answers.judge(self._each_sync) and self._doubled.count(now_s, now_s):
            self._fail(DriveFault.SYNC_DOUBLED)
        for node, bucket in self._too_often:
            for _ in range(node.too_many()):
                if bucket.count(now_s, self._since_s):
                    self.chatter.report(bucket, now_s)

    def floods(self, now_s: float, missed: DriveFault, node: int = 0) -> bool:
        """Whether somebody else than ``node`` sends so much that it may be missed for that reason.

        From then on this is the fault of the bus.
        """
        loudest, most = None, chatter.FLOODS
        for bucket in self._buckets:
            slow = chatter.is_slow(bucket.can_id) and missed is DriveFault.FEEDBACK_LOST
            own = 0 < node == pdo.node_of(bucket.can_id)
            level = bucket.level_at(now_s)
            if level >= most and not (slow or own):
                loudest, most = bucket, level
        if loudest is None:
            return False
        self.chatter.report(loudest, now_s)
        self._fail(DriveFault.BUS_FLOODED)
        return True

    def _drain_frames(self, now_s: float, most: int) -> None:
        receive_into, handlers = self._receive_into, self._handlers
        buffer, data, bits = self._buffer, self._data, 0
        for _ in range(most):
            if not receive_into(buffer):
                break
            can_id, length = _HEADER(buffer)
            if length > 8:
                length = 8
            bits += BITS[length]
            handler = handlers.get(can_id)
            if handler is None:
                self._heard(can_id, data[length], now_s)
                continue
            handler(data[length], now_s)
            self.off = False  # whoever hears is on the bus again
        self.bits += bits

    def _drain_packets(self, receive: Callable[[int], memoryview | None], now_s: float, left: int) -> None:
        handlers, bits = self._handlers, 0
        while left:
            packet = receive(left)
            if packet is None:
                break
            at = pdo.DATA_AT
            for can_id, length in _HEADERS(packet):
                if length > 8:
                    length = 8
                bits += BITS[length]
                data = packet[at : at + length]
                at += pdo.FRAME_BYTES
                left -= 1
                handler = handlers.get(can_id)
                if handler is None:
                    self._heard(can_id, data, now_s)
                    continue
                handler(data, now_s)
                self.off = False  # whoever hears is on the bus again
        self.bits += bits

    def _heard(self, can_id: int, data: memoryview, now_s: float) -> None:
        """A frame of no node of ours."""
        if can_id == pdo.SYNC:
            # A second producer makes drives latch in between: twice the speed, half the step.
            self.foreign_syncs += 1
            self._fail(DriveFault.SYNC_FOREIGN)
        elif can_id & pdo.ERROR_FLAG:
            self._heard_error(can_id & _CLASSES, data)
        elif can_id in self._own:
            self._fail(DriveFault.FOREIGN_FRAMES)
        elif self._strangers.vote(can_id, now_s, self._since_s):
            self.chatter.report(self._strangers, now_s)

    def _heard_error(self, classes: int, data: memoryview) -> None:
        """An error frame of our CAN controller."""
        self.errors += 1
        detail = data[1] if len(data) > 1 else 0
        if classes & _BUS_OFF:
            # Frames queued now would all come out at once at the restart, SYNCs among them.
            self.off = True
            self._fail(DriveFault.BUS_OFF)
        elif classes & _RESTARTED:
            self.off = False
            if not self._restarting:
                self._fail(DriveFault.BUS_OFF)
            self._restarting = False
        elif classes & _CONTROLLER and detail & _RX_OVERFLOW:
            self.lost += 1
            self._fail(DriveFault.RX_OVERFLOW)
        elif classes & _CONTROLLER and detail & _SEVERE:
            self._fail(DriveFault.BUS_ERROR)

    def _fail(self, fault: DriveFault) -> None:
        if self.fault is _NONE or fault is DriveFault.BUS_OFF:
            self.fault = fault

    def put(self, frame: bytes | bytearray | memoryview, data_bytes: int) -> bool:
        """Sends a frame of so many data bytes, and counts it; False: the bus has not taken it."""
        sent = self.send(frame)
        if sent:
            self.count(data_bytes)
        return sent

    def count(self, data_bytes: int) -> None:
        """A frame that has gone out here."""
        self.bits += BITS[data_bytes]

    def expect(self) -> None:
        """A SYNC has gone out on this bus."""
        for drive in self.owing:
            drive.expect()

    def was_played(self, beat: bool) -> None:
        """The pump has sent SYNC, the setpoints, and our heartbeat if ``beat``."""
        if not self.off:
            self.expect()
            self.bits += BITS[0] + self.setpoint_bits + BITS[1] * beat

    def forget(self) -> None:
        """RESET, or ENABLED anew."""
        self.fault = _NONE

    def restart(self) -> None:
        """Asks a controller that is off to join again, and takes it for done; so for a hub that has ended."""
        if getattr(self.port, "gone", False):
            self.port.restart()
        elif self.off:
            self.off = False
            self._restarting = True
            self.port.restart()
