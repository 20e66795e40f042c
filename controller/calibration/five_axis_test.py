"""Five-axis test with a sphere (ISO 10791-6, BK and CK): the tip stands on the part while the rotaries turn.

ISO 10791-7 cuts a part; the kinematic tests with a sphere, K by their names, are those of ISO 10791-6. Seen
from the part the tip should not move at all; what it does, from the positions that drives have reported and
by the machine's own chain, is told along X, Y and Z of the table. Encoders do not see a wrong centre (a
probed sphere does, see ``rotary_fit``): they see how well the five axes keep together.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.calibration.refusal import Refusal
from controller.geometry.arrays import Array
from controller.machine.kinematics import Kinematics
from controller.machine.model import Machine

STANDS_MM = 0.02  # the commanded tip on such a line moves by no more
MIN_TURN_DEG = 5.0


@dataclass(frozen=True, eq=False)
class Stand:
    """A line of the program on which the tip stands while rotaries turn."""

    line: int
    rotaries: Array  # (N, 2) degrees, as shown
    off: Array  # (N, 3) mm: the tip less where it should stand, table frame


def stands(
    machine: Machine,
    kinematics: Kinematics,
    length_mm: float,
    command: Array,
    actual: Array,
    lines: NDArray[np.int64],
) -> list[Stand]:
    """Of joints (N, axes) as shown, commanded and reported, and the program line (N,) of each."""
    per = np.array([axis.shown_per_unit for axis in machine.axes])
    wanted, real = (_tips(kinematics, joints / per, length_mm) for joints in (command, actual))
    turning, found = list(machine.rotary()), []
    for rows in np.split(np.arange(len(lines)), np.flatnonzero(np.diff(lines)) + 1):
        turned = np.ptp(command[rows][:, turning], axis=0).max() if turning else 0.0
        stood = np.ptp(wanted[rows], axis=0).max()
        if lines[rows[0]] > 0 and turned > MIN_TURN_DEG and stood < STANDS_MM:
            off = real[rows] - wanted[rows].mean(axis=0)
            found.append(Stand(int(lines[rows[0]]), command[rows][:, turning], off))
    return found


def _tips(kinematics: Kinematics, joints: Array, length_mm: float) -> Array:
    tip = kinematics.forward(list(joints.T), length_mm, np).tip
    return np.column_stack([np.broadcast_to(c, len(joints)) for c in tip])


def report(found: list[Stand]) -> dict[str, Any]:
    """Micrometres. Raises Refusal where the tip stands on no line."""
    if not found:
        raise Refusal("no_stand", degrees=MIN_TURN_DEG)
    rows: list[dict[str, Any]] = [
        {
            "line": one.line,
            "range_um": [1e3 * float(v) for v in np.ptp(one.off, axis=0)],
            "largest_um": 1e3 * float(np.linalg.norm(one.off, axis=1).max()),
        }
        for one in found
    ]
    return {"lines": rows, "largest_um": max(float(row["largest_um"]) for row in rows)}
