"""Tables of what axes miss, read from a machine file: pitch and backlash, straightness, thermal shift."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from controller.geometry.vectors import ZERO, Vector
from controller.machine import compensation
from controller.machine.model import Axis, Pitch, Straightness
from controller.machine.toml_table import Table, is_number
from controller.messages import said

MAX_POINTS = 1000
MAX_OFF = {"mm": 1.0, "deg": 1.0}  # of a deviation: what is more is no table's work
MAX_SHIFT_MM = 0.5


def pitch(table: Table, unit: str, travel: tuple[float, float], inner: float) -> Pitch | None:
    """``[axis.pitch]`` in inner units (mm, rad), or None. ``inner``: that of one shown unit.

    Raises ConfigError.
    """
    if not table.has("pitch"):
        return None
    own = table.table("pitch", f"{table.name} pitch")
    lost = own.number(f"backlash_{unit}", -MAX_OFF[unit], MAX_OFF[unit], 0.0)
    at = _rising(own, f"at_{unit}", travel)
    flat = [-0.5 * lost] * len(at)
    up = _row(own, f"up_{unit}", len(at), MAX_OFF[unit], flat)
    down = _row(own, f"down_{unit}", len(at), MAX_OFF[unit], [u + lost for u in up])
    if lost and own.has(f"down_{unit}"):
        own.refuse(f"backlash_{unit}", "backlash_twice")
    own.finish()
    rows = [tuple(value * inner for value in row) for row in (at, up, down)]
    if inner > 0.0:
        return Pitch(*rows)
    at_back, up_back, down_back = (row[::-1] for row in rows)
    return Pitch(at_back, down_back, up_back)  # up as shown is down as carried


def within_limits(table: Table, axis: Axis) -> None:
    """Refuses a table that would need too much of its axis' limits."""
    if axis.pitch is None:
        return
    share = compensation.share(axis.pitch, axis.limits)
    if share > compensation.MAX_SHARE:
        own = table.table("pitch", f"{table.name} pitch")
        unit = "deg" if axis.is_rotary else "mm"
        own.refuse(f"up_{unit}", "pitch_steep", share=share, axis=axis.name, most=compensation.MAX_SHARE)


def straightness(tables: Sequence[Table], axes: Sequence[Axis]) -> tuple[Straightness, ...]:
    """``[[straightness]]``. Raises ConfigError."""
    found = []
    for table in tables:
        along = table.text("along", [axis.name for axis in axes])
        moves = table.text("moves", [a.name for a in axes if not a.is_rotary and a.name != along])
        axis = next(a for a in axes if a.name == along)
        unit = "deg" if axis.is_rotary else "mm"
        at = [q / axis.shown_per_unit for q in _rising(table, f"at_{unit}", None)]
        off = _row(table, "off_mm", len(at), MAX_OFF["mm"], None)
        table.finish()
        order = 1 if at[0] < at[-1] else -1
        found.append(Straightness(along, moves, tuple(at[::order]), tuple(off[::order])))
    return tuple(found)


def thermal_shift(top: Table) -> Vector:
    """``[thermal] shift_mm``; 0 where the file has none."""
    if not top.has("thermal"):
        return ZERO
    table = top.table("thermal", "[thermal]")
    shift = table.vector("shift_mm", ZERO)
    if max(abs(c) for c in shift) > MAX_SHIFT_MM:
        table.refuse("shift_mm", "shift_large", most=MAX_SHIFT_MM)
    table.vector("reference_mm", ZERO)
    table.finish()
    return shift


def _rising(table: Table, key: str, default: Sequence[float] | None) -> list[float]:
    at = _row(table, key, 0, math.inf, default)
    if any(b <= a for a, b in pairwise(at)):
        table.refuse(key, "not_rising")
    return at


def _row(table: Table, key: str, count: int, most: float, default: Sequence[float] | None) -> list[float]:
    """Numbers in brackets: as many as ``count``, or 2 and more where that is 0."""
    each = "" if math.isinf(most) else said("file.may.each", low=-most, high=most)
    allowed = said("file.may.row" if count else "file.may.rows", count=count, most=MAX_POINTS, each=each)
    value = table.get(key, allowed, None if default is None else list(default))
    sound = isinstance(value, list) and all(map(is_number, value)) and max(map(abs, value), default=0) <= most
    if not sound or not (len(value) == count if count else 2 <= len(value) <= MAX_POINTS):
        table.refuse(key, "no_row", allowed=allowed)
    return [float(v) for v in value]
