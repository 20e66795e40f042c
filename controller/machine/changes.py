"""What a program changes for good: offsets, shift, reference points, tools, kept parameters.

A value as the reader finds it, and as it stands in the file of what is fitted.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from controller.geometry.vectors import Frame, Vector
from controller.machine.model import Joints, Machine, Offset, Pair, Shift, Tool

LEVEL = 1e-9
_OF_A_TOOL = (
    *("name", "radius_mm", "length_mm", "flute_mm", "corner_mm", "wear_radius_mm", "wear_length_mm"),
    "centre_cutting",
)


class Shifted(NamedTuple):
    """The shift of G92, and whether G92.2 has suspended it."""

    shift: Shift
    suspended: bool


Set = Offset | Shifted | Tool | Joints | float


class Change(NamedTuple):
    """One of them."""

    kind: str  # as ``fitting.KINDS``
    key: str  # "G54", "3" of a tool, "G92", "G28", "500" of a parameter
    value: Set


def laid(values: Mapping[str, Any], machine: Machine, changes: Sequence[Change]) -> dict[str, Any]:
    """What is fitted, with what a program has set."""
    made: dict[str, Any] = {kind: dict(rows) for kind, rows in values.items()}
    for kind, key, value in changes:
        made.setdefault(kind, {})[key] = _plain(machine, value)
    return made


def _plain(machine: Machine, value: Set) -> object:
    """What stands in the file."""
    if isinstance(value, Offset):
        return plain_offset(machine, value)
    if isinstance(value, Shifted):
        return {**located(machine, value.shift.xyz, value.shift.turned_rad), "suspended": value.suspended}
    if isinstance(value, Tool):
        return {name: getattr(value, name) for name in _OF_A_TOOL}
    if isinstance(value, float):
        return value
    return {a.name: q * a.shown_per_unit for a, q in zip(machine.axes, value, strict=True)}


def plain_offset(machine: Machine, offset: Offset) -> dict[str, Any]:
    """A work offset as it stands in the file."""
    turns = {"turned_deg": list(turned_deg(offset.frame))}
    return {**located(machine, offset.frame.origin, offset.turned_rad), **turns}


def located(machine: Machine, origin: Vector, turned_rad: Pair) -> dict[str, Any]:
    """Origin and rotaries (degrees as shown) as they stand in the file."""
    axes = (machine.axes[i] for i in machine.rotary())
    rotary = {a.name: q * a.shown_per_unit for a, q in zip(axes, turned_rad, strict=False)}
    return {"origin_mm": list(origin), "rotary_deg": rotary}


def turned_deg(frame: Frame) -> Vector:
    """The turns about X, then Y, then Z of the table that make the frame's axes (deg); as ``config`` reads.

    Where Y is at a quarter turn X and Z turn about the same line: all of it is told as Z's.
    """
    (xx, xy, xz), y, z = frame.x, frame.y, frame.z
    level = math.hypot(xx, xy)
    about_y = math.atan2(-xz, level)
    if level < LEVEL:
        return (0.0, math.degrees(about_y), math.degrees(math.atan2(-y[0], y[1])))
    about_x, about_z = math.atan2(y[2], z[2]), math.atan2(xy, xx)
    return (math.degrees(about_x), math.degrees(about_y), math.degrees(about_z))
