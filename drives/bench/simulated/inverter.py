"""An inverter with its motor at the outputs of a simulated I/O node: it ramps to what it is told.

    run, reverse (outputs), counts (6411h)  -->  speed  -->  at speed (input)

While ``run`` is off it ramps to a standstill. ``ready`` is an input of the node that a test sets.
"""

from __future__ import annotations

from typing import NamedTuple

from drives.bench.simulated.data_sheet import key
from drives.bench.simulated.io_node import ANALOGUE, IoNode

AT_SPEED_SHARE = 0.03


class Line(NamedTuple):
    """A bit of the node; ``inverted``: its wire is 0 when it is on."""

    bit: int
    inverted: bool = False

    def is_on(self, word: int) -> bool:
        """Whether it is on in the word of a node."""
        return bool(word >> self.bit & 1) is not self.inverted


class Measured(NamedTuple):
    """What an object of the node shows of the speed: counts of it, or pulses."""

    place: tuple[int, int]  # index, sub-index
    bits: int
    zero_counts: int
    counts_per_rev_min: float
    pulses_per_rev: float = 0.0


class Wiring(NamedTuple):
    """How an inverter is wired and set; ``rev_min_per_count`` from ``zero_counts`` on."""

    channel: int
    run: Line
    rev_min_per_count: float
    zero_counts: int = 0
    signed: bool = False  # counts below ``zero_counts`` turn it counter-clockwise
    ramp_rev_min_s: float = 3000.0
    reverse: Line | None = None
    at_speed: Line | None = None
    object_index: int = ANALOGUE  # of the object that says how fast
    measured: Measured | None = None


class Ramp:
    """A speed on its way to another; rev/min, rev/min per s. Read: ``target``."""

    def __init__(self, per_s: float, now_s: float) -> None:
        self._per_s, self._begun_s, self._from, self.target = per_s, now_s, 0.0, 0.0

    def speed(self, now_s: float) -> float:
        most = self._per_s * max(0.0, now_s - self._begun_s)
        return self._from + max(-most, min(most, self.target - self._from))

    def go_to(self, target: float, now_s: float) -> None:
        self._from, self._begun_s, self.target = self.speed(now_s), now_s, target


class Inverter:
    """Read: ``speed`` at a time, rev/min, signed."""

    def __init__(self, node: IoNode, wiring: Wiring) -> None:
        self._node, self._wiring = node, wiring
        self._ramp = Ramp(wiring.ramp_rev_min_s, node.now_s)
        self.speed = self._ramp.speed
        self._counts = wiring.zero_counts
        node.watchers.append(lambda _, now_s: self._turn(now_s))
        node.dictionary.writers[key(wiring.object_index, wiring.channel)] = self._take
        self._turned, self._turned_s = 0.0, node.now_s  # revolutions, until then
        if wiring.measured is not None:
            node.dictionary.readers[key(*wiring.measured.place)] = lambda: self._measure(wiring.measured)
        self._show(False, node.now_s)

    def _measure(self, shown: Measured | None) -> int:
        """As the node shows it now."""
        assert shown is not None
        now_s = self._node.now_s
        speed = abs(self.speed(now_s)) if not self._wiring.signed else self.speed(now_s)
        self._turned += abs(speed) / 60.0 * (now_s - self._turned_s)
        self._turned_s = now_s
        if shown.pulses_per_rev:
            return int(self._turned * shown.pulses_per_rev) % (1 << shown.bits)
        return round(shown.zero_counts + speed * shown.counts_per_rev_min)

    def _take(self, counts: int) -> None:
        self._counts = counts
        self._turn(self._node.now_s)

    def _turn(self, now_s: float) -> None:
        """It ramps to what it is told from now on."""
        wiring, word = self._wiring, self._node.outputs
        told = (self._counts - wiring.zero_counts) * wiring.rev_min_per_count
        if not wiring.signed:
            told = max(0.0, told)
        if wiring.reverse is not None and wiring.reverse.is_on(word):
            told = -told
        target = told if wiring.run.is_on(word) else 0.0
        if target == self._ramp.target:
            return
        before = self.speed(now_s)
        self._ramp.go_to(target, now_s)
        self._show(False, now_s)
        near = AT_SPEED_SHARE * abs(target)
        ramp_s = max(0.0, abs(target - before) - near) / wiring.ramp_rev_min_s
        if target:
            self._node.alarm("inverter", now_s + ramp_s, lambda at_s: self._arrive(target, at_s))

    def _arrive(self, target: float, now_s: float) -> None:
        if self._ramp.target == target:
            self._show(True, now_s)

    def _show(self, at_speed: bool, now_s: float) -> None:
        if (line := self._wiring.at_speed) is not None:
            self._node.set_input(line.bit, at_speed is not line.inverted, now_s)
