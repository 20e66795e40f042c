"""What axes miss, as tables of a machine file: pitch and backlash, straightness, thermal shift."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

from controller.geometry.vectors import ZERO, Vector
from controller.machine.declaration import key
from controller.machine.forms import VECTOR, Choice, Number, Row
from controller.machine.reading import Reading, Rules
from controller.messages import message

MAX_OFF = 1.0  # mm or degrees of a deviation: what is more is no table's work
MAX_SHIFT_MM = 0.5
AS_MANY = message("file.may.as_many", of="at")


@dataclass(frozen=True, slots=True)
class Pitch:
    """What an axis misses of its targets (ISO 230-2): where it is, less where it was told to be (mm, rad)."""

    at: tuple[float, ...]  # rising
    up: tuple[float, ...]  # where it came in the positive sense
    down: tuple[float, ...]  # in the negative one


def _flat(here: Reading) -> list[float]:
    return [-0.5 * here["backlash"]] * len(here["at"])


@dataclass(frozen=True, slots=True)
class PitchTable:
    """``[axis.pitch]`` as it is written, in the units and the sense of the file."""

    at: tuple[float, ...] = key(
        Row(),
        "positions that were measured, rising",
        name="at_{unit}",
        silent=lambda here: list(here.above["travel"]),
        left_out="the ends of the travel",
    )
    up: tuple[float, ...] = key(
        Row(lambda here: len(here["at"]), MAX_OFF),
        "there, come to in the positive sense: where it is, less where it was told to be",
        name="up_{unit}",
        silent=_flat,
        may_be=AS_MANY,
        left_out="half of `backlash` on either side",
    )
    down: tuple[float, ...] = key(
        Row(lambda here: len(here["up"]), MAX_OFF),
        "the same in the negative sense; left out: as `up`, and `backlash` more",
        name="down_{unit}",
        silent=lambda here: [up + here["backlash"] for up in here["up"]],
        may_be=AS_MANY,
        left_out="`up` and `backlash`",
    )
    backlash: float = key(
        Number(-MAX_OFF, MAX_OFF),
        "what is lost on reversal, where the senses differ by the same everywhere",
        name="backlash_{unit}",
        default=0.0,
    )


@dataclass(frozen=True, slots=True)
class Straightness:
    """By how much a linear axis is off (mm) while another one stands at each of some positions."""

    along: str = key(
        Choice(lambda here: [axis.name for axis in here.top["axis"]]),
        "the axis whose position counts",
        may_be=message("file.may.axis"),
    )
    moves: str = key(
        Choice(
            lambda here: [a.name for a in here.top["axis"] if not a.is_rotary and a.name != here["along"]]
        ),
        "the axis that is off by it",
        may_be=message("file.may.slide", but="along"),
    )
    at: tuple[float, ...] = key(Row(), "positions of the first, rising", name="at_{unit}")
    off: tuple[float, ...] = key(
        Row(lambda here: len(here["at"]), MAX_OFF),
        "there: where the other axis is, less where it was told to be",
        name="off_mm",
        may_be=AS_MANY,
    )


@dataclass(frozen=True, slots=True)
class Thermal:
    """``[thermal]``."""

    shift_mm: Vector = key(
        VECTOR,
        "where X Y Z are, less where they were told to be, since the machine has become warm",
        default=ZERO,
    )
    reference_mm: Vector = key(
        VECTOR, "where the reference sphere was when the machine was calibrated", default=ZERO
    )


def _check_shift(here: Reading) -> None:
    if max(abs(c) for c in here["shift_mm"]) > MAX_SHIFT_MM:
        here.table.refuse("shift_mm", "shift_large", most=MAX_SHIFT_MM)


def _check_rising(here: Reading) -> None:
    if any(b <= a for a, b in pairwise(here.as_written("at"))):
        here.table.refuse(f"at_{here.unit}", "not_rising")


def _check_backlash(here: Reading) -> None:
    if here["backlash"] and here.table.holds(f"down_{here.unit}"):
        here.table.refuse(f"backlash_{here.unit}", "backlash_twice")


def _pitch(table: PitchTable, here: Reading) -> Pitch:
    rows = [tuple(value * here.inner for value in row) for row in (table.at, table.up, table.down)]
    if here.inner > 0.0:
        return Pitch(*rows)
    at_back, up_back, down_back = (row[::-1] for row in rows)
    return Pitch(at_back, down_back, up_back)  # up as shown is down as carried


def _along(here: Reading) -> Any:
    """The axis whose position counts."""
    return next(axis for axis in here.top["axis"] if axis.name == here["along"])


def _straightness(table: Straightness, here: Reading) -> Straightness:
    at, off = [q / here.inner for q in table.at], table.off
    order = 1 if at[0] < at[-1] else -1
    return replace(table, at=tuple(at[::order]), off=tuple(off[::order]))


RULES: Mapping[type, Rules] = {
    PitchTable: Rules(checks=(_check_rising, _check_backlash), made=_pitch),
    Straightness: Rules(
        unit=lambda here: "deg" if _along(here).is_rotary else "mm",
        inner=lambda here: _along(here).shown_per_unit,
        checks=(_check_rising,),
        made=_straightness,
    ),
    Thermal: Rules(checks=(_check_shift,)),
}
