"""A simulated inverter at the slot of one on a serial line, with its motor."""

from __future__ import annotations

from collections.abc import Callable

from controller.ipc.inverter_slot import Commanded, InverterSlot, Reported
from controller.machine.spindle import Spindle
from drives.bench.simulated.inverter import Ramp

ANSWER_S = 0.1  # from one answer to the next, as at 9600 baud


class SimulatedInverter:
    """It ramps to what it is told. ``fault``: set by a test, until a reset; it stops then."""

    def __init__(self, spindle: Spindle, now: Callable[[], float]) -> None:
        self._now = now
        self.ramp = Ramp(60.0 * spindle.acceleration_rev_s2, now())
        self.fault = False
        self._resets: int | None = None

    def exchange(self, wanted: Commanded) -> Reported:
        if self._resets not in (None, wanted.resets):
            self.fault = False
        self._resets = wanted.resets
        now_s = self._now()
        target = 0.0 if self.fault else wanted.rev_min
        if target != self.ramp.target:
            self.ramp.go_to(target, now_s)
        speed = abs(self.ramp.speed(now_s))
        return Reported(speed, wanted.order, target != 0.0, self.fault)


class SteppedInverter:
    """One on the stepped clock, in the process of the tick. ``mute``: set by a test; it does not answer."""

    def __init__(self, spindle: Spindle, now: Callable[[], float]) -> None:
        self.slot, self.inverter = InverterSlot(), SimulatedInverter(spindle, now)
        self._now, self._next_s, self.mute = now, now(), False

    def advance(self) -> None:
        """Answer where an answer is due."""
        if self._now() < self._next_s or self.mute:
            return
        self._next_s = self._now() + ANSWER_S
        self.slot.report(self.inverter.exchange(self.slot.commanded()[0]))
