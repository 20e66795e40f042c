"""Probing with the drives' own latch (CiA 402-2, 60B8h - 60BAh): the position of the touch itself.

A touch is seen by the tick a period or two late, and an axis at 10 mm/s has by then moved on
by some hundredths. The drive's latch stores where the motor was at the edge of its probe input.

    slow side   writes 60B8h by SDO, at rest: ``function(...)``; 0 disarms
    drive       sends 60B9h (status) and 60BAh (position) by an event-driven TPDO, at the edge
    tick        stops the path, tells the planner, reads ``position`` of every axis

An event-driven TPDO costs the bus nothing until the touch. Commissioning maps it where
`NodeSettings.probe_tpdo` names one.
"""

from __future__ import annotations

from drives import pdo
from drives.cyclic.supervised import NEVER_S, Handler

FUNCTION = 0x60B8
ON, CONTINUOUS, INDEX_PULSE, RISING = 0x01, 0x02, 0x04, 0x10  # of 60B8h, probe 1
ENABLED, RISING_STORED = 0x01, 0x02  # of 60B9h, probe 1


def function(index_pulse: bool = False, continuous: bool = False) -> int:
    """What 60B8h must be to arm probe 1 for the rising edge of its input, or of the encoder's index.

    ``continuous``: every edge is stored, not the first alone. A falling edge would be
    stored elsewhere (60BBh): a probe that opens at the touch is inverted in the drive.
    """
    return ON | RISING | (INDEX_PULSE if index_pulse else 0) | (CONTINUOUS if continuous else 0)


class TouchProbe:
    """Probe 1 of one drive as the tick sees it.

    Read: ``armed`` (the drive says so), ``touched`` (an edge has been stored since the probe
    was armed), ``position`` (counts, where that was), ``at_s`` (when the frame came).
    """

    def __init__(self, node: int, number: int) -> None:
        """``number``: of the TPDO that carries 60B9h and 60BAh."""
        self.armed = False
        self.touched = False
        self.position = 0
        self.at_s = NEVER_S
        self.malformed = 0
        self.handlers: dict[int, Handler] = {pdo.tpdo(number, node): self._latched}

    def forget(self) -> None:
        """Before it is armed: what was stored before does not count."""
        self.armed = self.touched = False

    def _latched(self, data: memoryview, now_s: float) -> None:
        if len(data) != pdo.LATCH.size:
            self.malformed += 1
            return
        status, position = pdo.LATCH.unpack(data)
        self.armed = bool(status & ENABLED)
        self.touched = self.armed and bool(status & RISING_STORED)
        if self.touched:
            self.position, self.at_s = position, now_s
