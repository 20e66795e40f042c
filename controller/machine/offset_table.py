"""Work offsets and kept parameters in tables: of the machine file, and of what is laid over it."""

from __future__ import annotations

import math
from collections.abc import Sequence

from controller.geometry.vectors import ZERO, Frame, Vector, X, Y, Z, rotate
from controller.machine.model import KEPT_NUMBERS, KEPT_OFFSETS, STILL, Axis, Offset, Pair
from controller.machine.toml_table import Table
from controller.messages import said

# Parameters that outlive a program where the machine file says nothing.
KEPT_BY_DIALECT: dict[str, tuple[tuple[int, int], ...]] = {"rs274": (), "fanuc": ((500, 999),)}


def kept(general: Table, dialect: str) -> tuple[tuple[int, int], ...]:
    """Numbered parameters that outlive a program: ``kept_parameters = [100, [500, 549]]``."""
    key, (low, high) = "kept_parameters", KEPT_NUMBERS
    allowed = said("file.may.kept", low=low, high=high)
    rows = general.get(key, allowed, KEPT_BY_DIALECT[dialect])
    if not general.has(key):
        return KEPT_BY_DIALECT[dialect]
    rows = rows if isinstance(rows, list) else [0]
    pairs = [row if isinstance(row, list) else [row, row] for row in rows]
    for pair in pairs:
        whole = len(pair) == 2 and all(isinstance(n, int) and not isinstance(n, bool) for n in pair)
        if not (whole and low <= pair[0] <= pair[1] <= high):
            general.refuse(key, "not_kept", allowed=allowed)
    return tuple((first, last) for first, last in pairs)


def offsets(table: Table, axes: Sequence[Axis]) -> tuple[Offset, ...]:
    """The work offsets: three numbers (mm), or a table of ``origin_mm``, ``turned_deg``, ``rotary_deg``."""
    found = tuple(offset(table, name, axes) for name in KEPT_OFFSETS)
    table.finish()
    return found


def rotary(table: Table, key: str, axes: Sequence[Axis], before: Pair = STILL) -> Pair:
    """What rotaries are shifted by (rad, carried): ``{ A = 10.0 }`` in degrees as shown."""
    if not table.has(key):
        return before
    entry = table.table(key, key)
    rotaries = (axis for axis in axes if axis.is_rotary)
    found = [entry.number(axis.name, default=0.0) / axis.shown_per_unit for axis in rotaries]
    entry.finish()
    first, second = (*found, 0.0, 0.0)[:2]
    return first, second


def offset(table: Table, name: str, axes: Sequence[Axis], before: Pair = STILL) -> Offset:
    """One work offset of a table: three numbers, or a table of origin and turns. Raises ConfigError.

    ``before``: what rotaries are shifted by where it says nothing.
    """
    if not isinstance(table.get(name, "", ZERO), dict):
        return Offset(Frame(table.vector(name, ZERO)), before)
    entry = table.table(name, f"[offsets.{name}]")
    origin, turned = entry.vector("origin_mm", ZERO), entry.vector("turned_deg", ZERO)
    turned_rad = rotary(entry, "rotary_deg", axes, before)
    entry.finish()

    def turn(v: Vector) -> Vector:
        """About X, then Y, then Z of the table, all standing still."""
        for direction, angle_deg in zip((X, Y, Z), turned, strict=True):
            v = rotate(direction, math.radians(angle_deg), v)
        return v

    return Offset(Frame(origin, turn(X), turn(Y), turn(Z)), turned_rad)
