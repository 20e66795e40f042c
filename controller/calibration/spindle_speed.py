"""Scale and offset of the analogue output that tells an inverter its speed, from readings of a tachometer.

    s,rev_min          what a program said by S, and what turned, a row each
    1000,962
    6000,5921

Through the counts that the output was told and the speeds that were read a straight line is laid by least
squares: where it is 0 are ``zero_counts``, at ``full_counts`` is ``full_rev_min``.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from controller.calibration import csv_table
from controller.calibration.refusal import Refusal
from controller.machine.model import Machine
from controller.machine.spindle import Inverter

COLUMNS = ("s", "rev_min")
MIN_READINGS = 3
MIN_SPAN = 0.2  # of the largest speed, between the least and the largest that was read


class Fitted(NamedTuple):
    """What the machine file is to say, and how far the readings are off that, rev/min."""

    zero_counts: int
    full_rev_min: float
    worst_rev_min: float
    readings: int

    @property
    def figures(self) -> dict[str, Any]:
        """They are those of the answer as JSON, and of its sentence."""
        return self._asdict()


def inverter_of(machine: Machine) -> Inverter:
    """Raises Refusal where no inverter turns the spindle."""
    if machine.spindle is None or machine.spindle.inverter is None:
        raise Refusal("no_inverter", machine=machine.name)
    return machine.spindle.inverter


def fit(text: str, file: str, machine: Machine) -> Fitted:
    """Of a table of readings. Raises Refusal."""
    inverter = inverter_of(machine)
    rows = [
        tuple(csv_table.number(row, name, file, line) for name in COLUMNS)
        for line, row in csv_table.read(text, COLUMNS, file)
    ]
    counts = np.array([inverter.counts(s) for s, _ in rows], dtype=np.float64)
    read = np.array([rev_min for _, rev_min in rows], dtype=np.float64)
    if len(rows) < MIN_READINGS or np.ptp(read) < MIN_SPAN * float(np.abs(read).max(initial=0.0)):
        raise Refusal("few_speeds", file=file, count=len(rows), least=MIN_READINGS, share=MIN_SPAN)
    design = np.stack([counts, np.ones_like(counts)], axis=1)
    (per_count, offset), *_ = np.linalg.lstsq(design, read, rcond=None)
    if per_count * (inverter.full_counts - inverter.zero_counts) <= 0.0:
        raise Refusal("speed_falls", file=file)
    zero = round(-offset / per_count)
    full = float(per_count * (inverter.full_counts - zero))
    worst = float(np.abs(read - per_count * (counts - zero)).max())
    return Fitted(zero, round(full, 1), round(worst, 1), len(rows))
