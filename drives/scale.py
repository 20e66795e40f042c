"""Drive counts and joint values: one factor, rounding, and the range of an INTEGER32.

Target position (607Ah) and actual position (6064h) are INTEGER32. A joint value
that does not fit is never wrapped or clamped: a wrapped setpoint is a full-speed
move the other way, a clamped one leaves the path without saying so.
"""

from __future__ import annotations

from drives.settings import INT32_MAX, INT32_MIN


def to_counts(value: float, counts_per_unit: float) -> int | None:
    """The nearest count of a joint value (mm or rad); None if it is no number or outside of int32."""
    counts = value * counts_per_unit
    # Written so that a NaN fails the comparison; the bounds are exact in a float.
    if INT32_MIN <= counts <= INT32_MAX:
        return round(counts)
    return None


def to_value(counts: int, counts_per_unit: float) -> float:
    """The joint value (mm or rad) of a count."""
    return counts / counts_per_unit


def reach(counts_per_unit: float) -> float:
    """The largest joint value (mm or rad) that fits on both sides of zero."""
    return INT32_MAX / abs(counts_per_unit)


def rounding_jerk(counts_per_unit: float, period_s: float) -> float:
    """Largest jerk (unit/s^3) that rounding to counts alone puts into a drive.

    Each setpoint is off by half a count at most; the third difference weighs four of
    them 1, 3, 3, 1, hence 4 counts / T^3. The drive sees it as torque noise.
    """
    return 4.0 / abs(counts_per_unit) / period_s**3
