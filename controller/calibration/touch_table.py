"""Touches of a probe as a table: where the axes stood, which way the ball went, its length and radius.

The CSV has a header. One column per axis of the machine by its name (mm; degrees in the configured sense),
``i j k`` the way of the ball in the machine frame, ``length_mm`` from the gauge line to the centre of the
ball, ``radius_mm`` of the ball as it touches (pre-travel taken off). ``from_X`` ... is the sense (+1, -1) of
the last motion of an axis before the touch, ``feature`` what was touched. Other columns are left alone.

In the table of a machine's own touches, ``touched`` 0 is no touch, and of two that follow each other at one
place (``feed_mm_min``: first fast, then slowly, as the cycles do) the slower one counts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest

import numpy as np
from numpy.typing import NDArray

from controller.calibration import csv_table
from controller.calibration.csv_table import Line, number
from controller.calibration.refusal import Refusal
from controller.geometry.arrays import Array
from controller.machine.model import Machine

MAX_TOUCHES = 100_000
SAME_PLACE = 0.5  # mm or degrees between a fast touch and the slow one after it
MOVES = 0.02  # a component of the way below it is no motion of that axis


@dataclass(frozen=True, eq=False)
class Touches:
    """N touches."""

    joints: Array  # (N, axes): mm, rad (carried), in the order of the machine file
    ways: Array  # (N, 3): unit vectors, machine frame
    length_mm: Array  # (N,)
    radius_mm: Array  # (N,)
    senses: Array  # (N, axes): +1, -1 of the last motion, 0 where it is not known
    features: tuple[str, ...]  # (N,)

    def __len__(self) -> int:
        return len(self.joints)

    def chosen(self, rows: NDArray[np.int64] | NDArray[np.bool_]) -> Touches:
        """Some of them."""
        names = np.asarray(self.features)[rows]
        joints, ways, senses = self.joints[rows], self.ways[rows], self.senses[rows]
        found = tuple(str(name) for name in names)
        return Touches(joints, ways, self.length_mm[rows], self.radius_mm[rows], senses, found)


def read(text: str, machine: Machine, file: str) -> Touches:
    """Touches of a CSV. Raises Refusal."""
    needed = [axis.name for axis in machine.axes] + ["i", "j", "k", "length_mm", "radius_mm"]
    rows = _counting(csv_table.read(text, needed, file), needed, file)
    if not 0 < len(rows) <= MAX_TOUCHES:
        raise Refusal("how_many", file=file, count=len(rows), most=MAX_TOUCHES)
    values = np.array([[number(row, name, file, line) for name in needed] for line, row in rows])
    axes, ways = len(machine.axes), values[:, -5:-2]
    sizes = np.linalg.norm(ways, axis=1)
    wrong = np.flatnonzero(np.abs(sizes - 1.0) > 1e-2)
    if len(wrong):
        raise Refusal("no_unit", file=file, line=rows[wrong[0]][0], length=float(sizes[wrong[0]]))
    ways = ways / sizes[:, None]
    shown = np.array([axis.shown_per_unit for axis in machine.axes])
    senses = np.array(
        [_senses(row, machine, way, file, line) for (line, row), way in zip(rows, ways, strict=True)]
    )
    names = tuple((row.get("feature") or "").strip() for _, row in rows)
    return Touches(values[:, :axes] / shown, ways, values[:, -2], values[:, -1], senses, names)


def _counting(rows: list[Line], needed: Sequence[str], file: str) -> list[Line]:
    """Without those that touched nothing, and the fast ones of pairs. Raises Refusal."""
    touched = [one for one in rows if (one[1].get("touched") or "1").strip() != "0"]
    pairs = zip_longest(touched, touched[1:])
    return [one for one, behind in pairs if behind is None or not _is_fast_one(one, behind, needed, file)]


def _is_fast_one(one: Line, behind: Line, needed: Sequence[str], file: str) -> bool:
    """Whether the touch after it is of the same place, and slower."""
    if not (one[1].get("feed_mm_min") and behind[1].get("feed_mm_min")):
        return False
    fast, slow = (number(row, "feed_mm_min", file, line) for line, row in (one, behind))
    near = (
        abs(number(one[1], name, file, one[0]) - number(behind[1], name, file, behind[0])) for name in needed
    )
    return slow < fast and max(near) < SAME_PLACE


def _senses(row: Mapping[str, str], machine: Machine, way: Array, file: str, line: int) -> list[float]:
    found = [0.0] * len(machine.axes)
    for index, component in zip(machine.linear(), way, strict=True):
        found[index] = float(np.sign(component)) if abs(component) > MOVES else 0.0
    for index, axis in enumerate(machine.axes):
        if row.get(f"from_{axis.name}"):
            found[index] = float(np.sign(number(row, f"from_{axis.name}", file, line)))
    return found


def positions(touches: Touches, rotaries: Sequence[int]) -> list[NDArray[np.int64]]:
    """Rows of the touches by position of the rotaries (to 1e-4 rad), in the order in which they were made."""
    keys = np.round(touches.joints[:, list(rotaries)] / 1e-4).astype(np.int64)
    found: dict[tuple[int, ...], list[int]] = {}
    for row, key in enumerate(keys):
        found.setdefault(tuple(int(k) for k in key), []).append(row)
    return [np.array(rows) for rows in found.values()]
