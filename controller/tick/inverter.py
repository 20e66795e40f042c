"""Spindles that an inverter turns, as ``Peripherals`` needs them: by outputs of the I/O node, or by Modbus.

Of one on the node the node may measure the speed, by a voltage or by pulses. Else, where an input says that
it is at its speed, that counts; or it is expected to be there after its ramp and ``settle_s``, and to stand
after its ramp. One by Modbus reports its frequency. Either turns back only from a standstill, but where the
sign of an output says which way (-10 to 10 V).
"""

from __future__ import annotations

from collections import deque
from typing import Protocol

from controller.ipc.inverter_slot import Commanded, InverterSlot
from controller.machine.equipment import Io
from controller.machine.spindle import ANALOGUE_OUTPUT, Inverter, Modbus, SpeedFeedback, Spindle

ANSWER_S = 0.2  # what the inverter says within this is of the speed before
RESET_S = 0.5  # a pulse that resets its own fault
STANDING_REV_MIN = 1.0
MEASURED_TICKS, MEASURED_S = 100, 0.4  # for which pulses are counted: a tick is 1 % of that; and at most
SILENT_S = 0.3  # nothing measured for so long: lost
NOISE_SHARE = 0.005  # of the largest speed, that a voltage at a standstill may seem to be


class AnalogueOutput(Protocol):
    """What is needed of the I/O node."""

    @property
    def measured(self) -> int: ...
    @property
    def measurements(self) -> int: ...
    def write_analogue(self, channel: int, counts: int, /) -> None: ...
    def write_speed(self, counts: int, /) -> None: ...


class SpeedMeasured:
    """Of one that the node measures. Read: ``rev_min`` (unsigned but of a voltage), ``lost``."""

    def __init__(self, inverter: Inverter, feedback: SpeedFeedback, node: AnalogueOutput, T: float) -> None:
        self._node, self._feedback, self._period_s = node, feedback, T
        self._per_count = inverter.full_rev_min / ((feedback.full_counts - feedback.zero_counts) or 1)
        self._wraps = 1 << feedback.bits
        self._most_silent, self._window = round(SILENT_S / T), min(MEASURED_TICKS, round(MEASURED_S / T))
        self._count, self._now = node.measurements, 0
        self._silent = self._most_silent  # ticks in which nothing came
        self._pulses: deque[tuple[int, int]] = deque()  # when (ticks), and how many
        self.rev_min = 0.0

    @property
    def lost(self) -> bool:
        return self._silent >= self._most_silent

    def look(self, ticks: int) -> None:
        """What has come in this tick."""
        node = self._node
        self._now += ticks
        if node.measurements == self._count:
            self._silent += ticks
            return
        self._count, self._silent = node.measurements, 0
        if not self._feedback.pulses_per_rev:
            self.rev_min = (node.measured - self._feedback.zero_counts) * self._per_count
            return
        pulses = self._pulses
        pulses.append((self._now, node.measured))
        while len(pulses) > 2 and self._now - pulses[1][0] >= self._window:
            pulses.popleft()
        began, first = pulses[0]
        if self._now > began:
            turns = (node.measured - first) % self._wraps / self._feedback.pulses_per_rev
            self.rev_min = 60.0 * turns / ((self._now - began) * self._period_s)


class InverterSpindle:
    """What all have in common. After a fault of its own it turns only when that is wanted anew.

    Read: ``outputs`` (bits of the node, 1 = on) and ``own_outputs`` (all of its), ``at_speed``, ``rev_min``
    (signed), ``failed`` (its own fault, while it is to turn).
    """

    own_outputs = 0

    def __init__(self) -> None:
        self._wanted = self._told = 0.0  # rev/min: what is wanted, and what the inverter is told
        self._signed = False  # it may be told the other way while it turns
        self._standing = STANDING_REV_MIN
        self.rev_min = 0.0
        self.failed = False
        self.outputs = 0

    def want_speed(self, rev_min: float) -> None:
        """Turn so fast, rev/min; positive as M3, negative as M4."""
        self._wanted = rev_min

    def step(self, inputs: int, ticks: int) -> None:
        """What it reports in this tick, and what it is told."""
        well = self._hear(inputs, ticks)
        self.failed = (self.failed or not well) and self._wanted != 0.0
        told = 0.0 if self.failed or self._turns_back() else self._wanted
        anew, self._told = told != self._told, told
        self._lead(told, anew, ticks)

    def _turns_back(self) -> bool:
        """It turns the other way than is wanted, and is to stand first."""
        other = self._wanted * self.rev_min < 0.0 and abs(self.rev_min) > self._standing
        return other and not self._signed

    @property
    def at_speed(self) -> bool:
        """Whether it turns as wanted, as far as anybody says so; at 0: it stands."""
        return self._told == self._wanted and not self.failed and self._has_come(self._told)

    def reset(self) -> None:
        """Resets its own fault."""
        raise NotImplementedError

    def stop(self) -> None:
        """The tick is about to end by an error of its own."""

    def put_out(self, node: AnalogueOutput) -> None:
        """What goes out beside ``outputs``."""

    def _hear(self, inputs: int, ticks: int) -> bool:
        """Whether it is well."""
        raise NotImplementedError

    def _lead(self, told: float, anew: bool, ticks: int) -> None:
        raise NotImplementedError

    def _has_come(self, told: float) -> bool:
        raise NotImplementedError


class NodeInverter(InverterSpindle):
    """By outputs of the node. Read: ``counts`` of its channel; ``rev_min`` is as its ramp has it."""

    def __init__(
        self, spindle: Spindle, inverter: Inverter, io: Io, period_s: float, node: AnalogueOutput
    ) -> None:
        super().__init__()
        told = inverter.feedback
        self._measured = SpeedMeasured(inverter, told, node, period_s) if told is not None else None
        self._share = spindle.at_speed_share
        if told is not None:
            self._standing = NOISE_SHARE * spindle.max_rev_min
        self._sign = 1.0
        self._inverter, self._signed = inverter, inverter.signed
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
        self._since = self._there = 0  # ticks since it was told, and since its ramp was over
        self._resets = 0  # ticks that are left of the pulse
        self._says_at_speed = False
        self._backwards = False  # the output that turns it counter-clockwise
        self.counts = inverter.zero_counts

    def reset(self) -> None:
        """Begins a pulse that resets its own fault."""
        self._resets = self._reset_ticks

    def put_out(self, node: AnalogueOutput) -> None:
        if self._inverter.index == ANALOGUE_OUTPUT:
            node.write_analogue(self._inverter.channel, self.counts)
        else:
            node.write_speed(self.counts)

    def _hear(self, inputs: int, ticks: int) -> bool:
        if (measured := self._measured) is not None:
            measured.look(ticks)
            self.rev_min = measured.rev_min if self._signed else self._sign * abs(measured.rev_min)
            if measured.lost:
                return False
        self._says_at_speed = bool(inputs & self._reached)
        return not self._ready or bool(inputs & self._ready)

    def _lead(self, told: float, anew: bool, ticks: int) -> None:
        if anew:
            self._since = self._there = 0
        if told and not self._signed:
            self._backwards = told < 0.0
        self._since += ticks
        if self._measured is None:
            most = self._step * ticks
            self.rev_min += max(-most, min(most, told - self.rev_min))
        elif told:
            self._sign = 1.0 if told > 0.0 else -1.0
        self._there = self._there + ticks if self.rev_min == told else 0
        self.counts = self._inverter.counts(told)
        self._resets = max(0, self._resets - ticks)
        self.outputs = (
            self._run * (told != 0.0) | self._reverse * self._backwards | self._reset * (self._resets > 0)
        )

    def _has_come(self, told: float) -> bool:
        if (measured := self._measured) is not None:
            near = max(self._share * abs(told), self._standing)
            off = abs(self.rev_min) - abs(told) if not self._signed else self.rev_min - told
            return not measured.lost and abs(off) <= near and self._since >= self._answer_ticks
        if told == 0.0:
            return self.rev_min == 0.0
        if self._reached:
            return self._says_at_speed and self._since >= self._answer_ticks
        return self._there >= self._settle_ticks


class ModbusInverter(InverterSpindle):
    """By the process that talks to it. ``rev_min`` is as it reports, with the sign of what it was told."""

    def __init__(self, spindle: Spindle, modbus: Modbus, slot: InverterSlot, period_s: float) -> None:
        super().__init__()
        self._slot, self._share = slot, spindle.at_speed_share
        self._most_silent = round(modbus.silent_s / period_s)
        self._silent, self._heard = self._most_silent, 0  # ticks since its last report, and its number
        self._order = self._resets = 0
        self._reported, _ = slot.reported()
        self._sign = 1.0

    def reset(self) -> None:
        self._resets += 1

    def stop(self) -> None:
        self._order += 1
        self._slot.want(Commanded(0.0, self._order, self._resets))

    def _hear(self, inputs: int, ticks: int) -> bool:
        self._reported, count = self._slot.reported()
        self._silent = 0 if count != self._heard else self._silent + ticks
        self._heard = count
        self.rev_min = self._sign * self._reported.rev_min
        return self._silent < self._most_silent and not self._reported.fault

    def _lead(self, told: float, anew: bool, ticks: int) -> None:
        if told:
            self._sign = 1.0 if told > 0.0 else -1.0
        self._order += anew
        self._slot.want(Commanded(told, self._order, self._resets))

    def _turns_back(self) -> bool:
        """Likewise; that it stands counts where it has said so of the order to stop."""
        if self._wanted * self._sign >= 0.0:
            return False
        return self._told != 0.0 or not self._has_come(0.0)

    def _has_come(self, told: float) -> bool:
        if self._reported.order != self._order or self._silent >= self._most_silent:
            return False
        near = max(self._share * abs(told), self._standing)
        return abs(self.rev_min - told) <= near and (self._reported.running or told == 0.0)
