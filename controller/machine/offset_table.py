"""Work offsets and kept parameters in tables: of the machine file, and of what is laid over it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from controller.geometry.vectors import ZERO, Frame, Vector, X, Y, Z, rotate
from controller.machine.axes import Axis
from controller.machine.declaration import Schema, key
from controller.machine.forms import VECTOR, Own, Sub
from controller.machine.reading import File, Reading
from controller.machine.toml_table import Table
from controller.messages import message

# Work offsets as programs name them, in the order of ``Machine.offsets``.
OFFSETS = (
    *("G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"),
    *(f"G54.1 P{number}" for number in range(1, 49)),
)
FIXTURES = tuple(f"G54.2 P{number}" for number in range(1, 9))  # vectors that turn with the table
KEPT_OFFSETS = OFFSETS + FIXTURES
KEPT_NUMBERS = (31, 5000)  # parameters that a machine may keep from program to program
# Parameters that outlive a program where the machine file says nothing.
KEPT_BY_DIALECT: dict[str, tuple[tuple[int, int], ...]] = {"rs274": (), "fanuc": ((500, 999),)}
Pair = tuple[float, float]
STILL: Pair = (0.0, 0.0)
_KEPT = message("file.may.kept", low=KEPT_NUMBERS[0], high=KEPT_NUMBERS[1])


def _persistent_parameters(here: Reading, name: str) -> tuple[tuple[int, int], ...]:
    """Numbered parameters that outlive a program: ``kept_parameters = [100, [500, 549]]``."""
    rows, (low, high) = here.table.get(name, _KEPT), KEPT_NUMBERS
    pairs = [
        row if isinstance(row, list) else [row, row] for row in (rows if isinstance(rows, list) else [0])
    ]
    for pair in pairs:
        whole = len(pair) == 2 and all(type(n) is int for n in pair)
        if not (whole and low <= pair[0] <= pair[1] <= high):
            here.table.refuse(name, "not_kept", allowed=_KEPT)
    return tuple((first, last) for first, last in pairs)


_NUMBER = {"type": "integer", "minimum": KEPT_NUMBERS[0], "maximum": KEPT_NUMBERS[1]}
_PAIR = {"type": "array", "items": _NUMBER, "minItems": 2, "maxItems": 2}
KEPT = Own(_persistent_parameters, _KEPT, {"type": "array", "items": {"anyOf": [_NUMBER, _PAIR]}})


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


@dataclass(frozen=True, slots=True)
class Offset:
    """A work offset: of X Y Z, seen from the table frame at zero, and of the two rotaries (rad, carried)."""

    frame: Frame
    turned_rad: Pair = STILL


@dataclass(frozen=True, slots=True)
class OffsetTable:
    """A work offset as it is written, where it is a table."""

    origin_mm: Vector = key(
        VECTOR, "of the part, seen from the table with all rotaries at zero", default=ZERO
    )
    turned_deg: Vector = key(VECTOR, "about X, then Y, then Z of the table, all standing still", default=ZERO)
    rotary_deg: Pair | None = key(
        Own(
            lambda here, name: rotary(here.table, name, here.top["axis"]),
            message("file.may.table"),
            {"type": "object", "additionalProperties": {"type": "number"}},
        ),
        "by rotary: what its words are shifted by",
        default=None,
    )

    def offset(self, before: Pair = STILL) -> Offset:
        """``before``: what rotaries are shifted by where the table says nothing."""

        def turn(v: Vector) -> Vector:
            for direction, angle_deg in zip((X, Y, Z), self.turned_deg, strict=True):
                v = rotate(direction, math.radians(angle_deg), v)
            return v

        frame = Frame(self.origin_mm, turn(X), turn(Y), turn(Z))
        return Offset(frame, before if self.rotary_deg is None else self.rotary_deg)


@dataclass(frozen=True, slots=True)
class Offsets(Sub):
    """The work offsets by name, each three numbers (mm) or an ``OffsetTable``."""

    of: type = OffsetTable
    named: bool = True

    def read(self, here: Reading, name: str) -> dict[str, Offset]:
        table, found = here.table.table(name, f"[{name}]", optional=True), dict[str, Offset]()
        for one in KEPT_OFFSETS:
            with here.file.collecting():
                if table.has(one):
                    found[one] = offset(here, table, one)
        here.file.mistakes += table.foreign(KEPT_OFFSETS)
        return found

    def entry_schema(self, table: Schema) -> Schema:
        return {"anyOf": [VECTOR.schema(), table]}


def offset(here: Reading, table: Table, name: str, before: Pair = STILL) -> Offset:
    """One work offset of a table. Raises ConfigError."""
    if not isinstance(table.get(name, ""), dict):
        return Offset(Frame(table.vector(name)), before)
    made: Any = here.under("offsets", OffsetTable, table.table(name, f"[offsets.{name}]"), called=name)
    found: Offset = made.offset(before)
    return found


@dataclass(frozen=True, slots=True)
class OfMachine:
    """What a work offset by itself needs of a machine."""

    axis: Sequence[Axis]


def alone(table: Table, name: str, axes: Sequence[Axis], before: Pair) -> Offset:
    """One work offset of a table by itself. Raises ConfigError with all its mistakes."""
    file = File({})
    top = Reading(file, OfMachine, Table("", "", {}))
    top.values["axis"] = axes
    found = Offset(Frame())
    with file.collecting():
        found = offset(top, table, name, before)
    file.finish()
    return found
