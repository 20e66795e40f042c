"""A spindle that an inverter turns: an analogue output says how fast, outputs of the I/O node say which way.

It reports no speed. Where an input says that it is at its speed, that counts; else it is expected to be there
after its ramp and ``settle_s``, and to stand after its ramp. It turns back only from a standstill, but where
the sign of the output says which way (-10 to 10 V).
"""

from __future__ import annotations

from controller.machine.equipment import Io
from controller.machine.spindle import Inverter, Spindle

ANSWER_S = 0.2  # what the inverter says within this is of the speed before
RESET_S = 0.5  # a pulse that resets its own fault
STANDING_REV_MIN = 1.0


class InverterSpindle:
    """What ``Peripherals`` needs of a spindle, by the outputs of its inverter.

    Read: ``outputs`` (bits of the node, 1 = on), ``counts`` of the channel, ``at_speed``, ``rev_min`` (as its
    ramp has it; signed), ``failed`` (its own fault, while it is to turn or a program runs).
    """

    def __init__(self, spindle: Spindle, inverter: Inverter, io: Io, period_s: float) -> None:
        self._inverter = inverter
        self.channel = inverter.channel
        self._run, self._reverse, self._reset = (
            1 << bit if (bit := io.output(f"spindle_{name}")) is not None else 0
            for name in ("run", "reverse", "reset")
        )
        self.own_outputs = self._run | self._reverse | self._reset
        self._ready, self._reached = (
            1 << bit if (bit := io.input(f"spindle_{name}")) is not None else 0
            for name in ("ready", "at_speed")
        )
        self._step = 60.0 * spindle.acceleration_rev_s2 * period_s  # rev/min in one tick
        self._answer_ticks = round(ANSWER_S / period_s)
        self._settle_ticks = round(inverter.settle_s / period_s)
        self._reset_ticks = round(RESET_S / period_s)
        self._wanted = self._told = 0.0  # rev/min: what is wanted, and what the inverter is told
        self._since = self._there = 0  # ticks since it was told, and since its ramp was over
        self._resets = 0  # ticks that are left of the pulse
        self._says_at_speed = False
        self._backwards = False  # the output that turns it counter-clockwise
        self.rev_min = 0.0
        self.failed = False
        self.outputs = 0
        self.counts = inverter.zero_counts

    def want_speed(self, rev_min: float) -> None:
        """Turn so fast, rev/min; positive as M3, negative as M4."""
        self._wanted = rev_min

    def reset(self) -> None:
        """Begins a pulse that resets its own fault."""
        self._resets = self._reset_ticks

    def step(self, inputs: int, ticks: int) -> None:
        """The outputs of this tick; after a fault of its own it turns only when that is wanted anew."""
        ready = not self._ready or bool(inputs & self._ready)
        self.failed = (self.failed or not ready) and self._wanted != 0.0
        self._says_at_speed = bool(inputs & self._reached)
        told = 0.0 if self.failed or self._turns_back() else self._wanted
        if told != self._told:
            self._told, self._since, self._there = told, 0, 0
        if told and not self._inverter.signed:
            self._backwards = told < 0.0
        self._since += ticks
        most = self._step * ticks
        self.rev_min += max(-most, min(most, told - self.rev_min))
        self._there = self._there + ticks if self.rev_min == told else 0
        self.counts = self._inverter.counts(told)
        self._resets = max(0, self._resets - ticks)
        self.outputs = (
            self._run * (told != 0.0) | self._reverse * self._backwards | self._reset * (self._resets > 0)
        )

    def _turns_back(self) -> bool:
        """It turns the other way than is wanted, and is to stand first."""
        other = self._wanted * self.rev_min < 0.0 and abs(self.rev_min) > STANDING_REV_MIN
        return other and not self._inverter.signed

    @property
    def at_speed(self) -> bool:
        """Whether it turns as wanted, as far as anybody says so; at 0: it has had the time to stand."""
        if self._told != self._wanted or self.failed:
            return False
        if self._told == 0.0:
            return self.rev_min == 0.0
        if self._reached:
            return self._says_at_speed and self._since >= self._answer_ticks
        return self._there >= self._settle_ticks
