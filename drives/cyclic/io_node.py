"""Inputs and outputs (CiA 401) as the tick sees them: one word each way, and analogue outputs.

Inputs come by TPDO 1 on change and are repeated by its event timer; outputs go out by
RPDO 1 on change, once more with the next tick for a lost frame, and with our heartbeat.
Bit 0 of the first byte is bit 0 of the word. Analogue outputs have a frame of their own, RPDO 2.
"""

from __future__ import annotations

from drives import pdo
from drives.cyclic.drive_fault import DriveFault
from drives.cyclic.supervised import NEVER_S, EventTimer, Supervised
from drives.settings import IoSettings


class Analogue:
    """Analogue outputs of a node (6411h), and behind them its object of a speed: counts in one frame."""

    def __init__(self, settings: IoSettings) -> None:
        sizes = [2] * len(settings.analogue) + [(settings.speed_entry & 0xFF) // 8] * bool(
            settings.speed_entry
        )
        self._places = [(pdo.DATA_AT + sum(sizes[:n]), size) for n, size in enumerate(sizes)]
        self._frame = pdo.frame(pdo.rpdo(2, settings.node), bytes(sum(sizes)))
        self._counts = [0] * len(sizes)
        self._timer, self._is_new = EventTimer(), True
        for place, counts in enumerate((*settings.analogue, settings.speed_idle)[: len(sizes)]):
            self.write(place, counts)

    def write(self, place: int, counts: int) -> None:
        """One of them, from 0, goes to so many counts."""
        if self._counts[place] != counts:
            self._counts[place] = counts
            at, size = self._places[place]
            self._frame[at : at + size] = (counts & (1 << 8 * size) - 1).to_bytes(size, "little")
            self._is_new = True

    def event_frame(self, now_s: float, heartbeat_s: float) -> bytearray | None:
        """Its RPDO where there is something to tell, else None."""
        is_new, self._is_new = self._is_new, False
        return self._frame if self._timer.is_due(is_new, now_s, heartbeat_s) else None


class IoNode(Supervised):
    """The cyclic side of one node.

    Read: ``inputs`` (word), ``inputs_at_s``, ``outputs`` (as wanted), ``measured`` and ``measurements``, and
    what `Supervised` has.
    """

    def __init__(self, settings: IoSettings) -> None:
        super().__init__(settings.node)
        self.settings = settings
        self.inputs = 0
        self.inputs_at_s = NEVER_S
        self.outputs = 0
        self._most = (1 << 8 * settings.outputs) - 1
        self._sent = 0
        self._timer = EventTimer()
        self._frame = pdo.frame(pdo.RPDO1 + settings.node, bytes(settings.outputs))
        self.handlers[pdo.TPDO1 + settings.node] = self._read
        self.analogue = Analogue(settings) if settings.analogue or settings.speed_entry else None
        self.measured = self.measurements = 0  # of a spindle's speed: counts, and how many have come
        if settings.feedback_entry:
            self.handlers[pdo.tpdo(settings.feedback_tpdo, settings.node)] = self._measure

    def write(self, outputs: int) -> None:
        """The outputs, all at once; bits that the node does not have are passed over."""
        self.outputs = outputs & self._most

    def write_analogue(self, channel: int, counts: int) -> None:
        """One analogue output, from 1; of those that the node does not have nothing comes."""
        if self.analogue is not None:
            self.analogue.write(channel - 1, counts)

    def write_speed(self, counts: int) -> None:
        """Its object of a speed."""
        if self.analogue is not None:
            self.analogue.write(len(self.settings.analogue), counts)

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

    def _measure(self, data: memoryview, now_s: float) -> None:
        if len(data) != (self.settings.feedback_entry & 0xFF) // 8:
            self.malformed += 1
            return
        self.measured = int.from_bytes(data, "little", signed=True)
        self.measurements += 1

    def event_frame(self, now_s: float, heartbeat_s: float) -> bytearray | None:
        """Its RPDO where there is something to tell, else None."""
        outputs = self.outputs
        if not self._timer.is_due(outputs != self._sent, now_s, heartbeat_s):
            return None
        self._sent = outputs
        end = pdo.DATA_AT + self.settings.outputs
        self._frame[pdo.DATA_AT : end] = outputs.to_bytes(self.settings.outputs, "little")
        return self._frame
