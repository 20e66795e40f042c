"""What must hold whatever is done to a machine, judged by its motors and not by what it says.

* an axis that is off by more than its window and what it moves in ten ticks has raised a fault;
* after a fault everything stands within the promise, and stays;
* no motor is faster than its limit, but for a servo's overshoot;
* a drive that counts from another zero is not trusted, nor is a place where no motor is.

The window is the one that the machine's file gives the axis, whatever the tick makes of it: a part at
rest and a part by the speed of late. A loop whose lag is the whole part by speed is a first-order one
with the time constant at_speed / velocity; after five of these less than a hundredth of a lag is left.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from controller.geometry.arrays import Array
from controller.machine.model import Axis
from controller.runtime.bench.observer import STANDS, Sight, latency
from controller.state import stop_times
from controller.state.modes import Fault, Mode, Times, stands_within_s

OVERSHOOT = 1.05  # of a servo
ROUNDING = 1e-6
WAY_TICKS, LIVED_LATE = 25, 4  # periods
LATEST_TICKS = 10  # "its window plus what it moves in so many ticks"
COMES_BACK = 2.0  # times as long as at its velocity limit
OF_LATE = 5.0  # time constants of the slowest loop that stays inside of the window


class Window(NamedTuple):
    """How far an axis may be off: at rest (mm or rad), and the seconds of its speed that come on top."""

    at_rest: float
    by_speed_s: float

    def allowed(self, command: Array, period_s: float, late: int) -> Array:
        """For the motors as they are seen with each tick, ``late`` ticks after their command.

        ``command``: the joint, shape (N,), mm or rad.
        """
        speed = np.abs(np.diff(command, prepend=command[:1])) / period_s
        then = np.concatenate([np.zeros(late), speed[: len(speed) - late]])
        ticks = max(1, math.ceil(OF_LATE * self.by_speed_s / period_s))
        past = np.concatenate([np.zeros(ticks - 1), then])
        of_late = np.lib.stride_tricks.sliding_window_view(past, ticks).max(axis=1)
        return np.asarray(self.at_rest + self.by_speed_s * of_late)


def window_of(axis: Axis) -> Window:
    """Of the machine's own file."""
    return Window(axis.following.rest, axis.following.at_speed / axis.limits.velocity)


def wrongs(sight: Sight, taken: Times | None = None) -> list[str]:
    """What should not have been, in the order of its ticks; empty if all is well.

    ``taken``: the machine's times with its drives as they were read; without them as its file has them.
    """
    taken = taken or stop_times.of(sight.machine)
    found = sorted((*_unnoticed(sight), *_too_fast(sight), *_restless(sight, taken), *_dishonest(sight)))
    return [f"tick {tick}: {text}" for tick, text in found]


Wrong = tuple[int, str]


def _first_fault(sight: Sight) -> int:
    """The row in which a fault was first shown that stops the machine; behind the last if none was."""
    rows = (row for row, seen in enumerate(sight.ticks) if seen.mode is Mode.FAULT)
    return next(rows, len(sight.ticks))


def _unnoticed(sight: Sight) -> Iterator[Wrong]:
    """Off, and nobody has said so."""
    until = _first_fault(sight)
    moved = np.maximum(_moved(sight.command), _moved(sight.motors))
    off = sight.distance > allowed(sight) + moved
    for i, axis in enumerate(sight.machine.axes):
        rows = np.flatnonzero(off[:until, i])
        if len(rows):
            worst = float(sight.distance[rows, i].max()) * abs(axis.shown_per_unit)
            told = f"{axis.name} was off for {len(rows)} ticks, by up to {worst:.3f}, and no fault said so"
            yield sight.ticks[rows[0]].tick, told


def allowed(sight: Sight) -> Array:
    """The windows of all axes, tick by tick, shape (N, 5), mm and rad."""
    windows, late = [window_of(axis) for axis in sight.machine.axes], latency(sight.machine)
    columns = [w.allowed(sight.command[:, i], sight.machine.period_s, late) for i, w in enumerate(windows)]
    return np.stack(columns, axis=1)


def _moved(joints: Array, ticks: int = LATEST_TICKS) -> Array:
    """The way of the last ticks, (N, 5)."""
    way = np.cumsum(np.abs(np.diff(joints, axis=0, prepend=joints[:1])), axis=0)
    before = np.zeros_like(way)
    before[ticks:] = way[:-ticks]
    return np.asarray(way - before)


def _too_fast(sight: Sight) -> Iterator[Wrong]:
    """By the motor's own speed, and by its way; a drive that misses SYNCs lives some periods late."""
    times_s = np.array([seen.time_s for seen in sight.ticks])
    took_s = times_s - np.concatenate([np.full(WAY_TICKS, times_s[0]), times_s])[: len(times_s)]
    way = _moved(sight.travel, WAY_TICKS)
    fastest = np.maximum(sight.turned, way / (took_s + LIVED_LATE * sight.machine.period_s)[:, None])
    for i, axis in enumerate(sight.machine.axes):
        share = fastest[:, i] / axis.limits.velocity
        if share.max() > OVERSHOOT + ROUNDING:
            row = int(np.flatnonzero(share > OVERSHOOT + ROUNDING)[0])
            yield sight.ticks[row].tick, f"{axis.name} ran {share.max():.2f} times its velocity limit"


def _restless(sight: Sight, taken: Times) -> Iterator[Wrong]:
    """Something moves for longer than is promised, or again. A motor without torque coasts."""
    first = _first_fault(sight)
    if first == len(sight.ticks):
        return
    after = sight.ticks[first:]
    promised_s = max(
        stands_within_s(fault, taken)
        for seen in after
        for fault in (seen.fault, seen.warning)
        if fault is not Fault.NONE
    )
    for i, axis in enumerate(sight.machine.axes):
        late = first + _stands_after(sight, first, i, promised_s)
        moving = sight.speed[late:, i] * abs(axis.shown_per_unit) > STANDS
        torque = np.array([seen.torque >> i & 1 for seen in sight.ticks[late:]], bool)
        rows = np.flatnonzero(moving & torque)
        if len(rows):
            last = sight.ticks[late + int(rows[-1])].tick - sight.ticks[first].tick
            ms = 1e3 * last * sight.machine.period_s
            yield sight.ticks[late].tick, f"{axis.name} moved {ms:.0f} ms after {after[-1].fault.name}"
        if len(moving) and moving[-1]:
            yield sight.ticks[-1].tick, f"{axis.name} moves to the end"


def _stands_after(sight: Sight, first: int, i: int, promised_s: float) -> int:
    """In ticks. One that was carried off for want of torque, and gets it again, must come back first."""
    size, ticks = abs(sight.machine.axes[i].shown_per_unit), promised_s / sight.machine.period_s
    moving = sight.speed[first:, i] * size > STANDS
    weak = np.array([not seen.torque >> i & 1 for seen in sight.ticks[first:]])
    carried = np.flatnonzero(moving & weak)
    if len(carried):
        way = float(np.ptp(sight.motors[first : first + carried[-1] + 1, i]))
        back_s = COMES_BACK * way / sight.machine.axes[i].limits.velocity
        ticks += float(carried[-1]) + back_s / sight.machine.period_s
    return math.ceil(ticks)


def _dishonest(sight: Sight) -> Iterator[Wrong]:
    last = sight.ticks[-1]
    for i, axis in enumerate(sight.machine.axes):
        if last.untrusted >> i & 1:
            continue
        if last.recounted >> i & 1:
            yield last.tick, f"{axis.name} counts from another zero and is trusted"
            continue
        off = abs(last.told[i] - float(sight.motors[-1, i]))
        stands = sight.speed[-1, i] * abs(axis.shown_per_unit) <= STANDS
        if stands and off > axis.following.rest:
            shown = off * abs(axis.shown_per_unit)
            yield last.tick, f"{axis.name} is told to be {shown:.3f} from where it is, and trusted"
