"""What the tables of a machine file that say what its axes miss must keep to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from controller.geometry.vectors import ZERO, Vector
from controller.machine import compensation
from controller.machine.declaration import key
from controller.machine.forms import VECTOR
from controller.machine.reading import Reading, Rules

MAX_SHIFT_MM = 0.5


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


RULES: Mapping[type, Rules] = {Thermal: Rules(checks=(_check_shift,))}


def check_slopes(axis: Reading) -> None:
    """Refuses a table that would need too much of its axis' limits."""
    if axis["pitch"] is None:
        return
    share = compensation.share(axis["pitch"], axis["limits"])
    if share > compensation.MAX_SHARE:
        table, most = axis.one_below("pitch").table, compensation.MAX_SHARE
        table.refuse(f"up_{axis.unit}", "pitch_steep", share=share, axis=axis["name"], most=most)
