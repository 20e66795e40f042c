"""What any node tells of its health: heartbeat or node guarding, boot-up, emergencies.

Watching a heartbeat starts with the first one heard, watching by guarding with our
first request (CiA 301, 7.2.8.2). Nothing here raises or keeps a clock.
"""

from __future__ import annotations

from collections.abc import Callable

from drives import pdo
from drives.cyclic import drive_fault
from drives.cyclic.drive_fault import DriveFault

Handler = Callable[[memoryview, float], None]

NEVER_S = float("-inf")
REPEATS = 1  # of what is new, with the next tick
TOGGLE = 0x80  # of a guarding answer: other than in the last one


class EventTimer:
    """When an event-driven RPDO goes out: what is new twice, for a frame can be lost; then as we beat."""

    __slots__ = ("_again", "_due_s")

    def __init__(self) -> None:
        self._again, self._due_s = 0, NEVER_S

    def is_due(self, is_new: bool, now_s: float, heartbeat_s: float) -> bool:
        if is_new:
            self._again = REPEATS
        elif self._again:
            self._again -= 1
        elif now_s < self._due_s:
            return False
        self._due_s = now_s + heartbeat_s
        return True

    def put_off(self, now_s: float, heartbeat_s: float) -> None:
        """Another one has said it."""
        self._again, self._due_s = 0, now_s + heartbeat_s


class Supervised:
    """One node's signs of life.

    Read: ``emcy_code`` (the first error since the last that was taken back; 0 = none),
    ``heartbeat_at_s`` (of a guarding answer too), ``nmt_state`` (-1 = not heard of yet),
    ``malformed`` (frames of wrong length), ``with_sync`` (identifiers of what it sends with SYNC).
    """

    def __init__(self, node: int, guarded: bool = False) -> None:
        """``guarded``: the node answers our remote frames (`guard_frame`) instead of beating by itself."""
        self.node = node
        self.guarded = guarded
        self.guard_frame = pdo.guard_frame(node)
        self.emcy_code = 0
        self.heartbeat_at_s = NEVER_S
        self.nmt_state = -1
        self.malformed = 0
        self._emcy_fault = DriveFault.NONE
        self._judged = False  # something is wanted of it, so something can be wrong
        self._watched = False
        self._toggle = -1  # that the next guarding answer must have; -1 = any
        self._left = DriveFault.NONE  # NODE_RESET by a boot-up message, NODE_STOPPED, while judged
        self.with_sync: tuple[int, ...] = ()
        self.handlers: dict[int, Handler] = {
            pdo.EMCY + node: self._emergency,
            pdo.HEARTBEAT + node: self._heartbeat,
        }

    def receive(self, can_id: int, data: memoryview, now_s: float) -> bool:
        """Takes one frame; False if it is not of this node."""
        handler = self.handlers.get(can_id)
        if handler is None:
            return False
        handler(data, now_s)
        return True

    def request_sent(self, now_s: float) -> None:
        """A guarding request has gone out: from the first one on answers are missed."""
        if not self._watched:
            self._watched = True
            self.heartbeat_at_s = now_s

    def _emergency(self, data: memoryview, now_s: float) -> None:
        """The first error is the cause of those that follow; 0000h with an empty register ends it."""
        if len(data) < 2:
            self.malformed += 1
            return
        code = data[0] | data[1] << 8
        register = data[2] if len(data) > 2 else 0
        if code == 0:
            if register == 0:
                self.emcy_code = 0
        elif not self.emcy_code:
            self.emcy_code = code
            self._emcy_fault = drive_fault.of_emergency(code)

    def _heartbeat(self, data: memoryview, now_s: float) -> None:
        if len(data) != 1:
            self.malformed += 1
            return
        state = data[0] & 0x7F
        if self.guarded and state != pdo.NMT_BOOT_UP and not self._toggles(data[0] & TOGGLE):
            return
        if state == pdo.NMT_BOOT_UP:
            self._toggle = -1
        if state != pdo.NMT_OPERATIONAL and self._judged:
            self._leave(state)
        self.nmt_state = state
        self.heartbeat_at_s = now_s
        self._watched = True

    def _leave(self, state: int) -> None:
        """It is not NMT operational: started anew, or stopped by a stranger."""
        if state == pdo.NMT_BOOT_UP:
            self._left = DriveFault.NODE_RESET
        elif self._left is DriveFault.NONE:
            self._left = DriveFault.NODE_STOPPED

    def _toggles(self, bit: int) -> bool:
        """An answer whose toggle bit has not changed counts as none."""
        if self._toggle >= 0 and bit != self._toggle:
            return False
        self._toggle = bit ^ TOGGLE
        return True

    def _forget(self) -> None:
        """A new beginning. The newest heartbeat may be older than an NMT command: the next one counts."""
        self._left = DriveFault.NONE

    def silent(self, now_s: float, consumer_s: float) -> bool:
        """Whether it is watched and has not been heard for so long."""
        return self._watched and now_s - self.heartbeat_at_s > consumer_s
