"""What a machine's figures are in a modal state, by matrices of numpy and machine files read as TOML.

Nothing here is of the product but the numbers that are drawn: a work offset, the shifts in it, a turn or a
tilted plane, a tool's length, and how X Y Z are read.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from support.oracles.tilted_planes import Array, Bench, turned_about

Words = dict[str, float]


def moved(origin: Array) -> Array:
    made = np.eye(4)
    made[:3, 3] = origin
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

    @property
    def frame(self) -> Array:
        """4 x 4: from program coordinates to the table."""
        return moved(self.origin) @ fixed_turns(self.turned_deg) @ self.inner

    def inside(self, point: Array) -> Array:
        return (np.linalg.inv(self.frame) @ np.append(point, 1.0))[:3]

    def work(self, bench: Bench, places: Words) -> Words:
        """By axis; ``places``: of the axes as shown, mm and degrees."""
        point = np.array([places["X"], places["Y"], places["Z"] - self.length])
        if self.of_tip:
            point = tip_of(bench, places, self.length)[0]
        turned = {name: value - self.rotary.get(name, 0.0) for name, value in places.items() if name in "ABC"}
        return {**dict(zip("XYZ", map(float, self.inside(point)), strict=True)), **turned}

    def tip(self, bench: Bench, places: Words, length: float) -> Words:
        return dict(zip("XYZ", map(float, self.inside(tip_of(bench, places, length)[0])), strict=True))


def tip_of(bench: Bench, places: Words, length: float) -> tuple[Array, Array]:
    """Tip and axis in the frame of the table; tables of ISO's sense turn against the sense that is shown."""
    senses = {str(row["name"]): -1.0 if _against(row) else 1.0 for row in bench.rows}
    return bench.tool({name: value * senses[name] for name, value in places.items()}, length)


def _against(row: dict[str, object]) -> bool:
    return row["kind"] == "table" and row.get("sense") == "iso"
