"""What the answer of an axis leads to: keys of the machine file with other values, and what is to be told.

Rules of the trade, with their reasons:

- the windows are twice what was measured, so that wear and a cold machine still fit, and no more than that:
  a wide window notices late that an axis is in the work; one setpoint that is late must fit, too;
- a lag by speed is taken out by a velocity that goes with the target (60B1h), where the drive takes it;
- a resonance peak of more than 2 dB is a loop that rings (damping below 0.46 of a second-order loop);
- jerk: an acceleration should rise for no less than a period of what the loop can follow, J <= A f(-3 dB);
- acceleration: four fifths of what the motor gives, where it does not give what is asked.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from controller.bringup.excitation import Shown
from controller.bringup.response import Figures
from controller.machine.model import Axis
from controller.messages import Message, message

MARGIN = 2.0  # of a window beside what was measured
LOST_TICKS = 2.0  # of the largest speed: a setpoint that comes one SYNC late must fit into a window, too
LEAST_COUNTS = 10.0  # of a window: an encoder's own noise must fit
PEAK_DB = 2.0
SLOWEST_HZ = 15.0  # of a position loop that cuts contours
SATURATED = 0.8  # of the acceleration asked, that the motor must give
REDUCED = 0.8
LATE_TICKS = 0.5  # of a lag that is worth a velocity beside the target
UNEQUAL = 0.15  # of the lag, by which axes may differ
CHANGES = 0.1  # of a value, below which it is not proposed anew


@dataclass(frozen=True, slots=True)
class Proposal:
    """A key of the axis with another value than the machine file's; as it is written there."""

    axis: str
    key: str
    old: float | bool
    new: float | bool
    why: Message

    def to_dict(self) -> dict[str, Any]:
        return asdict(self)


def proposals(axis: Axis, found: Figures, takes_velocity: bool, period_s: float) -> list[Proposal]:
    """Of what was measured at the highest share of the speed."""
    shown = Shown.of(axis)
    made = [
        *_windows(axis, shown, found, period_s),
        *_feed_forward(axis, found, takes_velocity, period_s),
        *_limits(axis, shown, found),
    ]
    return [one for one in made if _differs(one)]


def _differs(one: Proposal) -> bool:
    if isinstance(one.new, bool):
        return one.new != one.old
    return abs(one.new - one.old) > CHANGES * abs(one.old)


def _windows(axis: Axis, shown: Shown, found: Figures, period_s: float) -> Iterator[Proposal]:
    """Largest lags, doubled; extrapolated to the largest speed where that was not reached."""
    per, unit = abs(axis.shown_per_unit), shown.unit
    least = LEAST_COUNTS * per / abs(axis.counts_per_unit)
    moving = max(LOST_TICKS * period_s * shown.velocity, 2.0 * least)
    to_full = max(1.0, shown.velocity / found.speed) if found.speed > 0.0 else 1.0
    most = rounded(max(MARGIN * found.error * to_full, moving))
    rest = rounded(max(MARGIN * found.rest_error, least, axis.following.in_position * per))
    why = message("bringup.why.window", error=found.error, unit=shown.words, speed=found.speed)
    yield Proposal(axis.name, f"following_error_{unit}", axis.following_error * per, most, why)
    at_speed = rounded(max(MARGIN * found.lag_s * shown.velocity, moving))
    yield Proposal(
        axis.name,
        f"following.at_speed_{unit}",
        axis.following.at_speed * per,
        at_speed,
        message("bringup.why.at_speed", lag_ms=1e3 * found.lag_s),
    )
    yield Proposal(
        axis.name,
        f"following.rest_{unit}",
        axis.following.rest * per,
        rest,
        message("bringup.why.rest", error=found.rest_error, unit=shown.words),
    )


def _feed_forward(axis: Axis, found: Figures, takes_velocity: bool, period_s: float) -> Iterator[Proposal]:
    if takes_velocity and not axis.feed_forward and found.lag_s > LATE_TICKS * period_s:
        why = message("bringup.why.feed_forward", lag_ms=1e3 * found.lag_s)
        yield Proposal(axis.name, "feed_forward", False, True, why)


def _limits(axis: Axis, shown: Shown, found: Figures) -> Iterator[Proposal]:
    acceleration = shown.acceleration
    if _is_saturated(found):
        acceleration = rounded(REDUCED * found.reached)
        why = message("bringup.why.acceleration", reached=found.reached, unit=shown.words)
        yield Proposal(axis.name, f"acceleration_{shown.unit}_s2", shown.acceleration, acceleration, why)
    most = acceleration * found.bandwidth_hz
    if 0.0 < most < shown.jerk:
        why = message("bringup.why.jerk", bandwidth_hz=found.bandwidth_hz)
        yield Proposal(axis.name, f"jerk_{shown.unit}_s3", shown.jerk, rounded(most), why)


def _is_saturated(found: Figures) -> bool:
    return found.acceleration > 0.0 and found.reached < SATURATED * found.acceleration


def rounded(value: float) -> float:
    """Up, to two digits."""
    if value <= 0.0:
        return 0.0
    step = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{math.ceil(value / step - 1e-9) * step:.3g}")


# ---- what is told


def findings(axis: Axis, found: Figures) -> list[Message]:
    """What is wrong with how an axis answers; none: it is tuned."""
    shown = Shown.of(axis)
    per = abs(axis.shown_per_unit)
    told = []
    if found.peak_db > PEAK_DB:
        told.append(message("bringup.rings", axis=axis.name, peak_db=found.peak_db, peak_hz=found.peak_hz))
    if 0.0 < found.bandwidth_hz < SLOWEST_HZ:
        told.append(message("bringup.slow", axis=axis.name, hz=found.bandwidth_hz, least_hz=SLOWEST_HZ))
    if _is_saturated(found):
        figures = {"asked": found.acceleration, "reached": found.reached, "unit": shown.words}
        told.append(message("bringup.saturated", axis=axis.name, **figures))
    if found.rest_error > axis.following.rest * per:
        rest = {"error": found.rest_error, "window": axis.following.rest * per, "unit": shown.words}
        told.append(message("bringup.restless", axis=axis.name, **rest))
    if found.error > 0.5 * axis.following_error * per:
        near = {"error": found.error, "window": axis.following_error * per, "unit": shown.words}
        told.append(message("bringup.near_window", axis=axis.name, **near))
    return told


def unequal(lags_s: Mapping[str, float]) -> list[Message]:
    """Axes that lag differently from most of the others: they bend a path that they move together."""
    if len(lags_s) < 2:
        return []
    usual = statistics.median(lags_s.values())
    return [
        message("bringup.unequal", axis=name, lag_ms=1e3 * lag, usual_ms=1e3 * usual)
        for name, lag in lags_s.items()
        if abs(lag - usual) > UNEQUAL * max(usual, 1e-3)
    ]
