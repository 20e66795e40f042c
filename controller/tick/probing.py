"""Probing: armed at rest, a touch stops the path, and where it was is told to the plan.

```
   IDLE -- the program comes to a probing --> ARMING -- the input is free --> ARMED -- touch --> TOUCHED
    ^                                            |                              |                  |
    |                       not free: a fault, nothing moves      end of the way, and no touch    at rest
    +------------------------------------------------------------- MISSED <-----+   <--------------+
```
Motion stands in ARMING and TOUCHED. What came of it is told by ``count``, which rises, ``came`` and
``touch``; by then the queue is void or at its end, and the plan reads on.

Where the axes were is stored by the drives at the edge itself, where the machine file says so (60BAh). Else
the input is seen by the tick that follows, and the positions of the ticks around it are interpolated: the
edge came half a period before that tick, on average, less what the input itself is late by.

A probe in the spindle that touches in any other motion is a fault; the way off the part behind a touch is
none, as long as it is short.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import IntEnum
from typing import Final, Protocol

from controller.machine.model import Joints, Machine
from controller.motion.pieces import Sensing
from controller.state.modes import Fault, Mode
from controller.tick.drives import Drives
from controller.tick.follow import Follow
from controller.tick.joints import Encoder
from controller.tick.mode import Modes
from controller.tick.peripherals import Peripherals

KEPT_TICKS = 64  # of positions behind a touch
SEEN_TICKS = 0.5  # a position is of the SYNC before its tick, an edge of half a period before it
LATE_TICKS = 4  # for frames that are on their way when the path is at its end
MOVES_COUNTS = 3.0  # an axis that moved less has stood


class Phase(IntEnum):
    """How far a probing is."""

    IDLE = 0
    ARMING = 1
    ARMED = 2
    TOUCHED = 3
    ENDING = 4


HOLDING: Final = (Phase.ARMING, Phase.TOUCHED)  # motion stands


class Latch(Protocol):
    """What is needed of ``drives.cyclic.touch_probe``."""

    touched: bool
    position: int

    def forget(self) -> None: ...


class Probing:
    """Read: ``phase``, ``holds``; of the last one ``count``, ``came`` (1 touched, 2 missed), ``touch``."""

    def __init__(
        self,
        machine: Machine,
        group: Drives,
        modes: Modes,
        follow: Follow,
        encoder: Encoder,
        peripherals: Peripherals,
        delay: int = 0,
    ) -> None:
        """``delay``: ticks for which a setpoint waits before it goes out."""
        self._late_ticks = LATE_TICKS + delay
        self._modes, self._follow, self._encoder = modes, follow, encoder
        self._group, self._peripherals = group, peripherals
        self._linear = machine.linear()
        self._probe = machine.sensor_mask(machine.probe)
        self._release_mm = machine.probe.release_mm if machine.probe is not None else 0.0
        self._period_s = machine.period_s
        self.present = bool(self._probe) or machine.setter is not None
        latches: Sequence[Latch | None] = (
            [drive.probe for drive in group.drives] if machine.latch_tpdo else ()
        )
        self._latches = latches
        still: Joints = (0.0,) * len(machine.axes)
        self._rows: list[Sequence[float]] = [still] * KEPT_TICKS  # counts
        self._tick = 0  # of its own count
        self._seen = 0  # the tick that saw the edge
        self._sensing: Sensing | None = None
        self._late = 0
        self._left: Joints | None = None  # where it has come to rest behind a touch, until it is free again
        self._longest_mm = 0.0  # way from there
        self.phase = Phase.IDLE
        self.count = 0
        self.came = 0
        self.touch: Joints = still

    @property
    def holds(self) -> bool:
        """Whether motion must stand."""
        return self.phase in HOLDING

    # -- what the program says

    def tell(self, sensing: Sensing) -> None:
        """It has come to the beginning, or the end, of a probing."""
        if not sensing.ends:
            self._sensing, self.phase = sensing, Phase.ARMING
        elif self.phase is Phase.ARMED:
            self.phase, self._late = Phase.ENDING, 0

    # -- every tick

    def watch(self) -> None:
        """After this tick's inputs have come."""
        self._tick += 1
        self._rows[self._tick % KEPT_TICKS] = tuple(self._group.positions)
        if self._modes.mode is Mode.JOG:
            return
        if self._modes.mode not in (Mode.RUNNING, Mode.HOLD):
            self.phase, self._left = Phase.IDLE, None
            return
        sensing = self._sensing
        if self.phase is Phase.IDLE or sensing is None:
            self._guard()
            return
        on = bool(self._peripherals.inputs & sensing.mask) is sensing.on
        if self.phase is Phase.ARMING:
            if self._modes.running and not self._peripherals.waiting:
                self._arm(sensing, on)
        elif self.phase is Phase.TOUCHED:
            self._tell_touch(sensing)
        elif on:
            self.phase, self._seen = Phase.TOUCHED, self._tick
        elif self.phase is Phase.ENDING:
            self._late += 1
            if self._late > self._late_ticks + sensing.late_ticks:
                self._end(2, self._follow.joints)

    def _arm(self, sensing: Sensing, on: bool) -> None:
        """Nothing moves with a probe that touches already, or towards its release with one that is free."""
        if on:
            self._modes.fail(Fault.PROBE_OPEN if sensing.on else Fault.PROBE_FREE, -1)
            return
        for latch in self._latches:
            if latch is not None:
                latch.forget()
        self.phase, self._left = Phase.ARMED, None

    def _tell_touch(self, sensing: Sensing) -> None:
        """At rest, and not before the positions of the edge have come."""
        follow = self._follow
        if not follow.at_rest or follow.stopping or self._tick - self._seen < self._late_ticks:
            return
        found = self._where(sensing)
        if found is None:
            self.phase = Phase.IDLE
            self._modes.fail(Fault.PROBE_LATCH, self._unlatched(sensing))
            return
        follow.give_up()
        if sensing.on and sensing.mask == self._probe:
            self._left, self._longest_mm = follow.joints, self._far(found) + self._release_mm
        self._end(1, found)

    def _end(self, came: int, touch: Sequence[float]) -> None:
        self.came, self.touch = came, tuple(touch)
        self.count += 1
        self.phase, self._sensing = Phase.IDLE, None

    # -- where it was

    def _where(self, sensing: Sensing) -> Joints | None:
        """The joints at the edge; None where a drive that moved has stored nothing."""
        seen = self._by_ticks(sensing)
        if sensing.latched:
            if self._unlatched(sensing) >= 0:
                return None
            for i in self._linear:
                latch = self._latches[i]
                if latch is not None and self._stored(i, latch, sensing):
                    seen[i] = latch.position
        return tuple(self._encoder.real(seen))

    def _unlatched(self, sensing: Sensing) -> int:
        """An axis that has moved around the edge and whose drive has stored no position, or -1."""
        before, after = self._around(sensing)
        for i in self._linear:
            latch = self._latches[i]
            if abs(after[i] - before[i]) > MOVES_COUNTS and not (latch and self._stored(i, latch, sensing)):
                return i
        return -1

    def _stored(self, i: int, latch: Latch, sensing: Sensing) -> bool:
        """Whether a drive has stored this edge; one just where the last one was is not told again."""
        before, after = self._around(sensing)
        low, high = (before[i], after[i]) if before[i] < after[i] else (after[i], before[i])
        return latch.touched or low - MOVES_COUNTS <= latch.position <= high + MOVES_COUNTS

    def _around(self, sensing: Sensing) -> tuple[Sequence[float], Sequence[float]]:
        """The positions between which the edge came."""
        return self._row(self._seen - 2 - sensing.late_ticks), self._row(self._seen)

    def _by_ticks(self, sensing: Sensing) -> list[float]:
        """Between the positions of two ticks."""
        at = self._seen + SEEN_TICKS - sensing.latency_s / self._period_s
        first = int(at // 1.0)
        share = at - first
        a, b = self._row(first), self._row(first + 1)
        return [p + share * (q - p) for p, q in zip(a, b, strict=True)]

    def _row(self, tick: int) -> Sequence[float]:
        """The positions that a tick had, the last where it has not come yet."""
        return self._rows[min(tick, self._tick) % KEPT_TICKS]

    # -- other motion

    def _guard(self) -> None:
        ahead = self._follow.ahead
        if ahead is None or not ahead.guarded:
            return
        if not self._peripherals.inputs & self._probe:
            self._left = None
            return
        if self._left is None:
            self._modes.fail(Fault.PROBE_HIT, -1)
        elif self._far(self._left) > self._longest_mm:
            self._modes.fail(Fault.PROBE_STUCK, -1)

    def _far(self, left: Joints) -> float:
        here = self._follow.joints
        return math.dist([here[i] for i in self._linear], [left[i] for i in self._linear])
