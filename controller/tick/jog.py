"""Motion by hand: along a straight line of the joints, at once, and never without end.

```
   READY, HOLD  -- order, standing -->  along its line  -- released, expired, arrived -->  at rest, back
                                          |        ^
                            another line  v        |  at rest
                                         slows to rest
```
An order without a length lives for ``DEAD_MAN_S``, counted in ticks; one with a length needs a plan
that lives. At the end of the travel of a homed axis the line ends, at rest: that is no fault. An
axis that is not homed has no end that is known, and is slow.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from copy import copy

from controller.ipc.handoff import DEAD_MAN_S, Jog
from controller.machine.model import Axis, Joints, Machine
from controller.state.modes import Mode, Request
from controller.tick.check import Check
from controller.tick.follow import STEPS_BACK, Follow, Step
from controller.tick.mode import Modes, Phase
from controller.tick.ramp import Ramp

UNHOMED_SHARE = 0.1  # of its largest velocity, for an axis that is not homed
_NOTHING = Jog((), 0.0)
_LATENCY_TICKS = 2  # from the last tick that waits until a drive slows


class Jogging:
    """One order at a time.

    Read ``active`` (something is under way), ``axes`` (that move, bit mask), ``check`` (for their joints),
    ``goes`` (the last step was towards the speed that is asked for), ``away`` (the axes are off the place of
    the hold: no RESUME), ``expired`` (it was ended in this tick, for nobody asks any more).
    """

    def __init__(self, machine: Machine, modes: Modes, follow: Follow, delay: int = 0) -> None:
        """``delay``: ticks for which a setpoint waits before it goes out."""
        self._machine, self._modes, self._follow = machine, modes, follow
        self._most_age = max(1, math.floor(DEAD_MAN_S / machine.period_s) - _LATENCY_TICKS - delay)
        self._age = 0  # ticks since it was asked for
        self._order = _NOTHING
        self._next: Jog | None = None  # another line, once this one is at rest
        self._back = Mode.READY
        self._base = self._held = follow.joints  # where the line begins; where the program is held
        self._ramp = Ramp(1.0, 1.0, 0.0)
        self._undo: deque[Ramp] = deque(maxlen=STEPS_BACK)  # the last steps
        self.goes = False
        self.speed = 0.0  # per tick, that the last step was towards
        self._speed = 0.0  # likewise, that is asked for
        self.axes = 0
        self.active = self.away = self.expired = False
        self.check = Check(machine)

    # -- orders

    def ask(self, order: Jog | None) -> bool:
        """A new order, or the old one again; False for what cannot be."""
        modes, before = self._modes, self._modes.mode
        if order is None or not self._is_possible(order, before):
            return False
        if not modes.request(Request.JOG, 0.0, self._follow.at_rest and not self._follow.stopping):
            return False
        self._age = 0
        if before is not Mode.JOG:
            self._enter(before)
            self._begin(order)
        elif order.direction == self._order.direction and math.isinf(self._order.length):
            self._next = None
            self._speed = self._speed_of(order)
        else:
            self._next = order
        return True

    def _is_possible(self, order: Jog, before: Mode) -> bool:
        """A length is measured from rest; axes without a zero do not go together."""
        if not order.is_sound or (before is Mode.JOG and math.isfinite(order.length)):
            return False
        moving = _moving(order)
        return not moving & ~self._modes.homed or moving & (moving - 1) == 0

    def _enter(self, before: Mode) -> None:
        self.active, self._back = True, before
        if before is Mode.READY:
            self._follow.clear()  # what is queued begins elsewhere
        elif not self.away:
            self._held = self._follow.joints

    def _begin(self, order: Jog) -> None:
        self._order, self._next, self._base = order, None, self._follow.joints
        self.axes = _moving(order)
        self.check = Check(self._machine, self.axes & ~self._modes.homed)
        T = self._machine.period_s
        rows = [(a, abs(d)) for a, d in zip(self._machine.axes, order.direction, strict=True) if d]
        acceleration = min(axis.limits.acceleration / d for axis, d in rows) * T**2
        jerk = min(axis.limits.jerk / d for axis, d in rows) * T**3
        self._ramp = Ramp(acceleration, jerk, min(order.length, self._room(order)))
        self._undo.clear()
        self._speed = self._speed_of(order)

    def _room(self, order: Jog) -> float:
        """How far the line goes within the travel of the axes that have one."""
        homed = self._modes.homed
        rows = zip(self._machine.axes, order.direction, self._base, strict=True)
        ends = (_to_end(axis, d, q) for i, (axis, d, q) in enumerate(rows) if d and homed >> i & 1)
        return max(0.0, min(ends, default=math.inf))

    def _speed_of(self, order: Jog) -> float:
        """What is asked for, as far as the axes can, per tick."""
        speed, homed = order.speed, self._modes.homed
        for i, (axis, d) in enumerate(zip(self._machine.axes, order.direction, strict=True)):
            if d:
                share = 1.0 if homed >> i & 1 else UNHOMED_SHARE
                speed = min(speed, share * axis.limits.velocity / abs(d))
        return speed * self._machine.period_s

    # -- every tick, while active

    def watch(self, ticks: int, silent: bool) -> None:
        """Who asks must live: ``silent`` says that the plan does not."""
        modes = self._modes
        self._age += ticks
        endless = math.isinf(self._order.length) or self._next is not None
        over = self._age > self._most_age if endless else silent
        self.expired = over and modes.mode is Mode.JOG and modes.phase is not Phase.HALTING
        if self.expired:
            modes.end_jog()

    def forget_hold(self) -> None:
        """The program is gone, or goes on from here."""
        self.away = False

    def give_up(self) -> None:
        """The joints are where the drives are from now on."""
        self.active = False

    def step(self, is_open: bool, played: float | None = None) -> Step:
        """The joints of the next SYNC; ``is_open``: no clamp holds an axis.

        ``played``: in a period that has passed, the speed (per tick) that was taken for granted then.
        """
        modes, ramp, follow = self._modes, self._ramp, self._follow
        ends = modes.mode is not Mode.JOG or modes.phase is Phase.HALTING
        goes = not ends and self._next is None and is_open
        if played is None:
            self.speed = self._speed if goes else 0.0
        else:
            goes, self.speed = played > 0.0, played
        self.goes = goes
        self._undo.append(copy(ramp))
        ramp.step(self.speed)
        follow.move_to(self._place(ramp.p))
        if ramp.at_rest:
            if ends:
                self._leave()
            elif self._next is not None:
                self._begin(self._next)
            elif goes and math.isfinite(self._order.length):
                modes.end_jog()  # arrived
        return Step.MOVED

    def revert(self) -> None:
        """Takes the last step back: its joints must not be sent."""
        if self._undo:
            self._ramp = self._undo.pop()
            self._follow.revert()

    def ahead(self, periods: int) -> Iterator[Joints]:
        """The next so many steps, if nothing changes, and then a stop."""
        ramp = copy(self._ramp)
        for _ in range(periods):
            ramp.step(self.speed)
            yield self._place(ramp.p)
        while not ramp.at_rest:
            ramp.step(0.0)
            yield self._place(ramp.p)

    def stand(self, back: int) -> bool:
        """The drives have stood, as ``Follow.stand`` says it: the line goes on from rest."""
        if self._ramp.at_rest:
            return False
        for _ in range(back - 1):
            self.revert()
        self._ramp.stand(back > 0)
        self._follow.put(self._place(self._ramp.p))
        return True

    def _place(self, p: float) -> Joints:
        q, d = self._base, self._order.direction
        return tuple([a + p * b for a, b in zip(q, d, strict=True)])

    def _leave(self) -> None:
        """Back to where it came from, once nothing of the motion is left."""
        follow, modes = self._follow, self._modes
        if not follow.at_rest:
            return
        self.active = False
        if self._back is Mode.READY:
            follow.clear()
        else:
            self.away = not follow.same_place(follow.joints, self._held)
            if not self.away:
                follow.move_to(self._held)  # less than a count
        modes.leave_jog(self._back)


def _moving(order: Jog) -> int:
    """Bit mask of the axes of a line."""
    return sum(1 << i for i, d in enumerate(order.direction) if d)


def _to_end(axis: Axis, d: float, q: float) -> float:
    return ((axis.travel_max if d > 0.0 else axis.travel_min) - q) / d
