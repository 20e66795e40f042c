"""A work offset from where the tool stands: what its origin must be for the tip to read as wanted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from controller.geometry.vectors import Frame, Vector

NAMES = "XYZ"


def frame(offset: Mapping[str, object]) -> Frame:
    """The frame of an offset as the service tells it: ``origin_mm`` and, where turned, ``axes``."""
    origin, axes = _three(offset["origin_mm"]), offset.get("axes")
    if not isinstance(axes, Sequence):
        return Frame(origin)
    x, y, z = (_three(one) for one in axes)
    return Frame(origin, x, y, z)


def origin_for(offset: Frame, tip_on_table: Vector, wanted: Mapping[str, float]) -> Vector:
    """The origin (mm) with which the tip reads ``wanted`` ({"Z": 0.0}); other axes read as before."""
    reads = dict(zip(NAMES, offset.from_parent(tip_on_table), strict=True))
    x, y, z = (wanted.get(name, reads[name]) for name in NAMES)
    turned = offset.turn((x, y, z))
    a, b, c = (float(p - q) for p, q in zip(tip_on_table, turned, strict=True))
    return (a, b, c)


def under(shift: Mapping[str, Any] | None, wanted: Mapping[str, float]) -> dict[str, float]:
    """What the tip must read in the offset for it to read ``wanted`` under the shift of G92."""
    if not shift or shift["suspended"]:
        return dict(wanted)
    return {name: value + float(shift["origin_mm"][NAMES.index(name)]) for name, value in wanted.items()}


def tip_with(on_table: Mapping[str, Any], length_mm: float) -> Vector:
    """The tip of a tool of another length, where the status tells that of ``length_mm`` in it."""
    longer_mm = length_mm - float(on_table["length_mm"])
    pairs = zip(on_table["tip"], on_table["axis"], strict=True)
    x, y, z = (float(p) - float(o) * longer_mm for p, o in pairs)  # the axis leads from tip to spindle
    return (x, y, z)


def _three(values: object) -> Vector:
    if not isinstance(values, Sequence):
        raise ValueError(f"{values!r} are no three numbers")
    x, y, z = (float(value) for value in values)
    return (x, y, z)
