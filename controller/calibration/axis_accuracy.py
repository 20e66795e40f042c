"""Accuracy and repeatability of one axis by ISO 230-2, and its pitch table.

Targets are approached n times in both senses (or in one). At every target i

    mean        x_i  = sum of the deviations / n         for each sense: up, down
    reversal    B_i  = x_i up - x_i down
    deviation   s_i  = sqrt(sum (x_ij - x_i)^2 / (n - 1))
    R_i         = max(4 s_i up, 4 s_i down, 2 s_i up + 2 s_i down + |B_i|)

and of the axis: B = max |B_i|, R = max R_i, E = range of all means, M = range of the means of both senses,
A = max (x_i + 2 s_i) - min (x_i - 2 s_i) over both senses. A deviation is where it is, less where it was told
to be.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from typing import Any

import numpy as np

from controller.calibration import csv_table
from controller.calibration.csv_table import number
from controller.calibration.refusal import Refusal
from controller.geometry.arrays import Array
from controller.machine import compensation
from controller.machine.model import Axis

COLUMNS = ("target", "sense", "measured")
MAX_ROWS = 100_000
SAME = 1e-4  # targets nearer to each other are one, mm or degrees


@dataclass(frozen=True, eq=False)
class Runs:
    """Deviations (k targets x n runs) in both senses, shown units; a sense that was not measured is None."""

    at: Array
    up: Array | None
    down: Array | None


def read(text: str, file: str) -> Runs:
    """A CSV of ``target, sense (1 or -1), measured`` in mm or degrees as shown. Raises Refusal."""
    rows = csv_table.read(text, COLUMNS, file)
    if not 0 < len(rows) <= MAX_ROWS:
        raise Refusal("how_many", file=file, count=len(rows), most=MAX_ROWS)
    found: dict[tuple[float, float], list[float]] = defaultdict(list)
    for line, row in rows:
        target, sense, measured = (number(row, name, file, line) for name in COLUMNS)
        found[round(target / SAME) * SAME, float(np.sign(sense))].append(measured - target)
    at = np.array(sorted({target for target, _ in found}))
    if len(at) < 2:
        raise Refusal("one_target", file=file)
    return Runs(at, _of_sense(found, at, 1.0, file), _of_sense(found, at, -1.0, file))


def _of_sense(
    found: dict[tuple[float, float], list[float]], at: Array, sense: float, file: str
) -> Array | None:
    rows = [found.get((float(target), sense), []) for target in at]
    counts = {len(row) for row in rows}
    if counts == {0}:
        return None
    if len(counts) > 1:
        short = min(range(len(rows)), key=lambda k: len(rows[k]))
        told = {"file": file, "target": float(at[short]), "found": len(rows[short]), "most": max(counts)}
        raise Refusal("uneven_runs", **told)
    return np.array(rows)


@dataclass(frozen=True, slots=True)
class Accuracy:
    """ISO 230-2, clause 3, in the unit of the deviations; None where senses or runs are missing for it."""

    reversal: float | None  # B
    mean_reversal: float | None
    repeatability_up: float | None  # R up
    repeatability_down: float | None
    repeatability: float | None  # R
    systematic_up: float | None  # E up
    systematic_down: float | None
    systematic: float  # E
    mean_deviation: float | None  # M
    accuracy_up: float | None  # A up
    accuracy_down: float | None
    accuracy: float | None  # A


def accuracy(runs: Runs) -> Accuracy:
    """What the standard makes of the runs."""
    up, down = _sense(runs.up), _sense(runs.down)
    both = [one for one in (up, down) if one is not None]
    means = np.array([mean for mean, _ in both])
    spread = [s for _, s in both]
    repeated = all(s is not None for s in spread)
    reversal = None if len(both) < 2 else means[0] - means[1]
    wide = np.array([s for s in spread if s is not None]) if repeated else None
    return Accuracy(
        reversal=None if reversal is None else float(np.abs(reversal).max()),
        mean_reversal=None if reversal is None else float(reversal.mean()),
        repeatability_up=_repeatability(up),
        repeatability_down=_repeatability(down),
        repeatability=None if wide is None else _both(wide, reversal),
        systematic_up=None if up is None else float(np.ptp(up[0])),
        systematic_down=None if down is None else float(np.ptp(down[0])),
        systematic=float(np.ptp(means)),
        mean_deviation=None if reversal is None else float(np.ptp(means.mean(axis=0))),
        accuracy_up=_accuracy(up),
        accuracy_down=_accuracy(down),
        accuracy=None if wide is None else float((means + 2.0 * wide).max() - (means - 2.0 * wide).min()),
    )


Sense = tuple[Array, Array | None]  # of every target: mean, and standard deviation where it was repeated


def _sense(values: Array | None) -> Sense | None:
    if values is None:
        return None
    return values.mean(axis=1), values.std(axis=1, ddof=1) if values.shape[1] > 1 else None


def _repeatability(one: Sense | None) -> float | None:
    return None if one is None or one[1] is None else float(4.0 * one[1].max())


def _accuracy(one: Sense | None) -> float | None:
    if one is None or one[1] is None:
        return None
    spread = 2.0 * one[1]
    return float((one[0] + spread).max() - (one[0] - spread).min())


def _both(spread: Array, reversal: Array | None) -> float:
    largest: Array = 4.0 * spread.max(axis=0)
    if reversal is not None:
        largest = np.maximum(largest, 2.0 * spread.sum(axis=0) + np.abs(reversal))
    return float(largest.max())


def table(runs: Runs, axis: Axis) -> dict[str, list[float]]:
    """The pitch table for the machine file (shown units), over the one that was on while it was measured."""
    digits = 9
    up = runs.up if runs.up is not None else runs.down
    down = runs.down if runs.down is not None else runs.up
    assert up is not None and down is not None
    means = {1.0: up.mean(axis=1), -1.0: down.mean(axis=1)}
    before = compensation.deviation(axis)
    if before is not None:
        per, flip = axis.shown_per_unit, 1.0 if axis.shown_per_unit > 0.0 else -1.0
        for sense in means:
            had = np.array([before.at(q / per, sense * flip) * per for q in runs.at])
            means[sense] = means[sense] + had
    unit = "deg" if axis.is_rotary else "mm"
    columns = ((f"at_{unit}", runs.at), (f"up_{unit}", means[1.0]), (f"down_{unit}", means[-1.0]))
    return {key: [round(float(v), digits) for v in values] for key, values in columns}


def report(runs: Runs, axis: Axis) -> dict[str, Any]:
    """Micrometres, or thousandths of a degree."""
    found = accuracy(runs)
    scaled = {name: None if (v := getattr(found, name)) is None else 1e3 * v for name in Accuracy.__slots__}
    counts = {
        name: 0 if row is None else row.shape[1] for name, row in (("up", runs.up), ("down", runs.down))
    }
    unit = "mdeg" if axis.is_rotary else "um"
    return {"axis": axis.name, "unit": unit, "targets": len(runs.at), "runs": counts, **scaled}
