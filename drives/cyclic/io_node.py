"""Inputs and outputs (CiA 401) as the tick sees them: one word each way, and analogue outputs.

Inputs come by TPDO 1 on change and are repeated by its event timer; outputs go out by
RPDO 1 on change, once more with the next tick for a lost frame, and with our heartbeat.
Bit 0 of the first byte is bit 0 of the word. Analogue outputs have a frame of their own, RPDO 2.
"""

from __future__ import annotations

from struct import Struct

from drives import pdo
from drives.cyclic.drive_fault import DriveFault
from drives.cyclic.supervised import NEVER_S, Supervised
from drives.settings import IoSettings

REPEATS = 1
_pack_counts_into = Struct("<h").pack_into


class Analogue:
    """The analogue outputs of a node (6411h): their counts, and the frame that tells them."""

    def __init__(self, settings: IoSettings) -> None:
        self._frame = pdo.frame(pdo.rpdo(2, settings.node), bytes(2 * len(settings.analogue)))
        self._counts = [0] * len(settings.analogue)
        self._due_s = NEVER_S
        self._telling = REPEATS + 1
        for channel, counts in enumerate(settings.analogue, 1):
            self.write(channel, counts)

    def write(self, channel: int, counts: int) -> None:
        """One of them, from 1, goes to so many counts."""
        if self._counts[channel - 1] != counts:
            self._counts[channel - 1] = counts
            _pack_counts_into(self._frame, pdo.DATA_AT + 2 * (channel - 1), counts)
            self._telling = REPEATS + 1

    def event_frame(self, now_s: float, heartbeat_s: float) -> bytearray | None:
        """Its RPDO where there is something to tell, else None."""
        if self._telling:
            self._telling -= 1
        elif now_s < self._due_s:
            return None
        self._due_s = now_s + heartbeat_s
        return self._frame


class IoNode(Supervised):
    """The cyclic side of one node.

    Read: ``inputs`` (word), ``inputs_at_s``, ``outputs`` (as wanted), and what `Supervised` has.
    """

    def __init__(self, settings: IoSettings) -> None:
        super().__init__(settings.node)
        self.settings = settings
        self.inputs = 0
        self.inputs_at_s = NEVER_S
        self.outputs = 0
        self._most = (1 << 8 * settings.outputs) - 1
        self._sent = 0
        self._due_s = NEVER_S
        self._repeats = 0
        self._frame = pdo.frame(pdo.RPDO1 + settings.node, bytes(settings.outputs))
        self.handlers[pdo.TPDO1 + settings.node] = self._read
        self.analogue = Analogue(settings) if settings.analogue else None

    def write(self, outputs: int) -> None:
        """The outputs, all at once; bits that the node does not have are passed over."""
        self.outputs = outputs & self._most

    def write_analogue(self, channel: int, counts: int) -> None:
        """One analogue output, from 1; of those that the node does not have nothing comes."""
        if self.analogue is not None:
            self.analogue.write(channel, counts)

    def fresh(self, now_s: float, consumer_s: float) -> bool:
        """Whether the inputs can be believed now: they have come, are not too old, and the node lives.

        In OFF as well; what was wrong before and is over does not count.
        """
        if self.inputs_at_s == NEVER_S or self.silent(now_s, consumer_s):
            return False
        if self._watched and self.nmt_state != pdo.NMT_OPERATIONAL:
            return False
        every_s = self.settings.inputs_every_s
        return every_s <= 0.0 or now_s - self.inputs_at_s <= every_s + consumer_s

    def judge(self, judged: bool) -> None:
        """Whether the machine is enabled: then a restart stays known until RESET or ENABLED anew."""
        self._judged = judged

    def fault(self, now_s: float, consumer_s: float) -> DriveFault:
        """IO_LOST: silent, restarted, in error, or its inputs are not repeated any more."""
        if not self._judged:
            return DriveFault.NONE
        if self.emcy_code or self._left is not DriveFault.NONE or self.silent(now_s, consumer_s):
            return DriveFault.IO_LOST
        if self.inputs_at_s > NEVER_S and not self.fresh(now_s, consumer_s):
            return DriveFault.IO_LOST
        return DriveFault.NONE

    def forget(self, reset: bool) -> None:
        """A new beginning: ENABLED anew; RESET forgets its emergency too."""
        self._forget()
        if reset:
            self.emcy_code = 0

    def _read(self, data: memoryview, now_s: float) -> None:
        if len(data) != self.settings.inputs:
            self.malformed += 1
            return
        self.inputs = int.from_bytes(data, "little")
        self.inputs_at_s = now_s

    def event_frame(self, now_s: float, heartbeat_s: float) -> bytearray | None:
        """Its RPDO where there is something to tell, else None."""
        outputs = self.outputs
        if outputs != self._sent:
            self._repeats = REPEATS
        elif self._repeats:
            self._repeats -= 1
        elif now_s < self._due_s:
            return None
        self._due_s = now_s + heartbeat_s
        self._sent = outputs
        end = pdo.DATA_AT + self.settings.outputs
        self._frame[pdo.DATA_AT : end] = outputs.to_bytes(self.settings.outputs, "little")
        return self._frame
