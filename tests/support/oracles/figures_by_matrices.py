"""What a machine's figures are in a modal state, by matrices of numpy and machine files read as TOML.

Nothing here is of the product but the numbers that are drawn: a work offset, the shifts in it, a turn or a
tilted plane, a tool's length, and how X Y Z are read.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from support.oracles.tilted_planes import Bench, turned_about

from controller.geometry.arrays import Array

Words = dict[str, float]


def moved(origin: Array) -> Array:
    made = np.eye(4)
    made[:3, 3] = origin
    return made


def mirrored(places: Words) -> Array:
    """At these places of X Y Z."""
    made = np.eye(4)
    for i, at in (("XYZ".index(name), at) for name, at in places.items()):
        made[i, i], made[i, 3] = -1.0, 2.0 * at
    return made


def fixed_turns(degrees: Array) -> Array:
    """About X, then Y, then Z of the parent, all standing still."""
    made = np.eye(4)
    for direction, angle in zip(np.eye(3), degrees, strict=True):
        made = turned_about(direction, np.zeros(3), angle) @ made
    return made


@dataclass
class Drawn:
    """A modal state as it is drawn."""

    origin: Array
    turned_deg: Array
    inner: Array = field(default_factory=lambda: np.eye(4))  # all that shifts, turns and tilts in the offset
    rotary: Words = field(default_factory=dict)  # by which words of rotaries are shifted, degrees as shown
    length: float = 0.0  # in force
    of_tip: bool = False
    follows: str = ""  # G254 or G54.2: the origin goes with the table
    vector: Array = field(default_factory=lambda: np.zeros(3))  # of G54.2, measured with the table at ...
    measured: Words = field(default_factory=dict)  # ... these angles as shown

    def frame(self, bench: Bench, places: Words) -> Array:
        """4 x 4: from program coordinates to the table."""
        origin = self.origin
        if self.follows == "G254":
            origin = (table_at(bench, places) @ np.append(origin, 1.0))[:3]
        elif self.follows:
            before = np.linalg.inv(table_at(bench, self.measured)[:3, :3]) @ self.vector
            origin = origin + table_at(bench, places)[:3, :3] @ before
        return moved(origin) @ fixed_turns(self.turned_deg) @ self.inner

    def inside(self, bench: Bench, places: Words, point: Array) -> Array:
        return (np.linalg.inv(self.frame(bench, places)) @ np.append(point, 1.0))[:3]

    def work(self, bench: Bench, places: Words) -> Words:
        """By axis; ``places``: of the axes as shown, mm and degrees."""
        point = np.array([places["X"], places["Y"], places["Z"] - self.length])
        if self.of_tip:
            point = tip_of(bench, places, self.length)[0]
        turned = {name: value - self.rotary.get(name, 0.0) for name, value in places.items() if name in "ABC"}
        return {**dict(zip("XYZ", map(float, self.inside(bench, places, point)), strict=True)), **turned}

    def tip(self, bench: Bench, places: Words, length: float) -> Words:
        tip = self.inside(bench, places, tip_of(bench, places, length)[0])
        return dict(zip("XYZ", map(float, tip), strict=True))


def tip_of(bench: Bench, places: Words, length: float) -> tuple[Array, Array]:
    """Tip and axis in the frame of the table; tables of ISO's sense turn against the sense that is shown."""
    return bench.tool(_carried(bench, places), length)


def table_at(bench: Bench, places: Words) -> Array:
    """4 x 4: from the work to the base, with the rotaries there."""
    turned = _carried(bench, places)
    return bench.chain("table", tuple(turned[str(row["name"])] for row in bench.rotaries))


def _carried(bench: Bench, places: Words) -> Words:
    """Right-hand angles of what the rotaries carry."""
    senses = {str(row["name"]): -1.0 if _against(row) else 1.0 for row in bench.rows}
    return {name: value * senses[name] for name, value in places.items()}


def _against(row: dict[str, object]) -> bool:
    return row["kind"] == "table" and row.get("sense") == "iso"
