"""Terminals of a simulated drive, and what they do: limit switches, STO, quick and emergency stop, probes.

Object 2004h of the simulated drive sets them, bit by bit as 60FDh shows them:

    0, 1  limit switches, negative and positive      4  emergency stop (safe stop 1)
    2     home switch                                16, 17  touch probes 1 and 2
    3     safe torque off

A limit switch set here counts like one that the axis has run onto: further that way is
a fault where the drive is told so (``limit_fault``), else a quick stop. The emergency
stop is a quick stop, followed by torque off when its delay is over.
"""

from __future__ import annotations

from drives.bench.simulated.axis import Axis
from drives.bench.simulated.data_sheet import key
from drives.bench.simulated.dictionary import Abort, Code

SIMULATED_AT = key(0x2004)
NEGATIVE_LIMIT, POSITIVE_LIMIT, HOME, STO, EMERGENCY_STOP = 1, 2, 4, 8, 16
PROBES = (1 << 16, 1 << 17)
KNOWN = 0x1F | PROBES[0] | PROBES[1]
SHOWN = (
    NEGATIVE_LIMIT | POSITIVE_LIMIT | HOME | EMERGENCY_STOP
)  # by the inputs; the rest has states of its own


class Inputs:
    """The terminals of one drive."""

    def __init__(self, axis: Axis) -> None:
        self._axis = axis
        self.word = 0
        axis.dictionary.readers[SIMULATED_AT] = lambda: self.word
        axis.dictionary.writers[SIMULATED_AT] = lambda word: self.set(word, axis.station.now_s)

    def set(self, word: int, now_s: float) -> None:
        """All terminals, from now on. Raises Abort for a bit that is none of them."""
        if word & ~KNOWN:
            raise Abort(Code.VALUE)
        axis, changed = self._axis, word ^ self.word
        axis.station.now_s = now_s
        self.word = word
        axis.sensors.inputs = word & SHOWN
        axis.sensors.watch()
        if changed & STO:
            axis.set_sto(bool(word & STO), now_s)
        if changed & EMERGENCY_STOP:
            self._emergency_stop(bool(word & EMERGENCY_STOP), now_s)
        for probe, bit in enumerate(PROBES):
            axis.sensors.probes.set_input(probe, bool(word & bit))

    def _emergency_stop(self, active: bool, now_s: float) -> None:
        axis = self._axis
        if active:
            axis.quick_stop_input(now_s)
            axis.station.alarm("torque off", now_s + axis.parameters.estop_delay_s, self._torque_off)
        else:
            axis.station.cancel("torque off")
            axis.set_sto(bool(self.word & STO), now_s)

    def _torque_off(self, now_s: float) -> None:
        self._axis.set_sto(True, now_s)
