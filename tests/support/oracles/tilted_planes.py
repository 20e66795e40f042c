"""Tilted work planes by rotations of scipy and plain matrices, and where tools stand on the shipped machines.

Nothing here is of the product: machine files are read as TOML, planes are made of their words as the manuals
have them (Fanuc's feature coordinate system, the README and remap of LinuxCNC's tilted work plane).
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path

import numpy as np
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from controller.geometry.arrays import Array

Words = Mapping[str, float]

GRID_DEG = 5.0
CONFIG = Path(__file__).parents[3] / "config"


def turned_about(direction: Array, point: Array, degrees: float) -> Array:
    """4 x 4: the right-hand turn about a line, by Rodrigues' matrix."""
    x, y, z = direction / np.linalg.norm(direction)
    k, angle = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]), math.radians(degrees)
    made = np.eye(4)
    made[:3, :3] += math.sin(angle) * k + (1.0 - math.cos(angle)) * k @ k
    made[:3, 3] = point - made[:3, :3] @ point
    return made


@dataclass(frozen=True, eq=False)
class Bench:
    """A machine file as chains of matrices: tables listed base to work, heads base to tool."""

    rows: tuple[dict[str, object], ...]  # of [[axis]]
    origin: Array  # of G54, table frame

    @staticmethod
    def of(name: str) -> Bench:
        read = tomllib.loads((CONFIG / f"{name}.toml").read_text(encoding="utf-8"))
        return Bench(tuple(read["axis"]), np.array(read["offsets"]["G54"], dtype=float))

    @property
    def rotaries(self) -> list[dict[str, object]]:
        return [row for row in self.rows if row["kind"] != "linear"]

    def chain(self, kind: str, angles: tuple[float, ...]) -> Array:
        """4 x 4: from the work or from the tool to the base."""
        made = np.eye(4)
        for row, angle in zip(self.rotaries, angles, strict=True):
            if row["kind"] == kind:
                line = np.array(row["direction"], dtype=float), np.array(row["point_mm"], dtype=float)
                made = made @ turned_about(*line, angle)
        return made

    def tool(self, places: Words, length_mm: float) -> tuple[Array, Array]:
        """Tip and axis, table frame with the rotaries at zero, of axis positions in mm and degrees."""
        head, table = _chains(self, tuple(places[str(row["name"])] for row in self.rotaries))
        gauge = np.array([places["X"], places["Y"], places["Z"]])
        tip = gauge + (head @ np.array([0.0, 0.0, -length_mm, 1.0]))[:3]
        return (table @ np.append(tip, 1.0))[:3], table[:3, :3] @ head[:3, 2]

    def turns(self) -> list[tuple[float, float]]:
        """Travel of the two rotaries; one whole turn of each is all it has to say."""
        found = []
        for low, high in (row["travel_deg"] for row in self.rotaries):  # type: ignore[misc]
            found.append((-180.0, 180.0) if high - low >= 360.0 else (low, high))
        return found

    def axis_at(self, first: float, second: float) -> Array:
        names = [str(row["name"]) for row in self.rotaries]
        places = {"X": 0.0, "Y": 0.0, "Z": 0.0, names[0]: first, names[1]: second}
        return self.tool(places, 0.0)[1]

    def is_out_of_reach(self, axis: Array) -> bool:
        """Whether no position of the rotaries in their travel puts the tool along ``axis``."""
        near = _reached(self) @ axis
        if near.max() < math.cos(math.radians(1.5 * GRID_DEG)):
            return True
        start = _corners(self)[int(near.argmax())]

        def off(q: Array) -> float:
            found = self.axis_at(q[0], q[1])
            return math.degrees(math.atan2(float(np.linalg.norm(np.cross(found, axis))), float(found @ axis)))

        close = {"xatol": 1e-9, "fatol": 1e-9, "maxfev": 2000}
        return minimize(off, start, method="Nelder-Mead", bounds=self.turns(), options=close).fun > 1e-6


@lru_cache(maxsize=64)
def _chains(bench: Bench, angles: tuple[float, ...]) -> tuple[Array, Array]:
    """Of the head, and of the table backwards; most moves stand on the same angles."""
    return bench.chain("head", angles), np.linalg.inv(bench.chain("table", angles))


@cache
def _corners(bench: Bench) -> Array:
    """A grid over both travels, degrees."""
    steps = [np.linspace(low, high, 1 + math.ceil((high - low) / GRID_DEG)) for low, high in bench.turns()]
    return np.stack(np.meshgrid(*steps), axis=-1).reshape(-1, 2)


@cache
def _reached(bench: Bench) -> Array:
    """The tool axes at its corners."""
    return np.array([bench.axis_at(a, b) for a, b in _corners(bench)])


# ---- planes: 4 x 4 from the plane to the work offset, of the words of their lines by Q -------------------


def _placed(origin: Array, turn: Array) -> Array:
    made = np.eye(4)
    made[:3, :3], made[:3, 3] = turn, origin
    return made


def _get(row: Words, letters: str) -> Array:
    return np.array([row.get(letter, 0.0) for letter in letters])


def _about_z(degrees: float) -> Array:
    return Rotation.from_euler("z", degrees, degrees=True).as_matrix()


def _named(order: str) -> str:
    return order.translate(str.maketrans("123", "XYZ"))


def _columns(x: Array, z: Array) -> Array:
    """Z kept, X as near as may be."""
    z = z / np.linalg.norm(z)
    y = np.cross(z, x)
    y = y / np.linalg.norm(y)
    return np.column_stack([np.cross(y, z), y, z])


def _three(rows: Mapping[int, Words]) -> Array:
    a, b, c = (_get(rows[q], "XYZ") for q in (1, 2, 3))
    return _columns(b - a, np.cross(b - a, c - a))


def fanuc(p: int, rows: Mapping[int, Words]) -> Array:
    """A plane of G68.2 by Fanuc's manual."""
    row = rows.get(0, {})
    i, j, k = _get(row, "IJK")
    if p == 0:
        return _placed(_get(row, "XYZ"), Rotation.from_euler("ZXZ", [i, j, k], degrees=True).as_matrix())
    if p == 1:
        order = _named(f"{row.get('Q', 123):.0f}")
        angles = [dict(zip("XYZ", (i, j, k), strict=True))[letter] for letter in order]
        turn = Rotation.from_euler(order.lower(), angles, degrees=True)
        return _placed(_get(row, "XYZ"), turn.as_matrix())
    if p == 2:
        inner = _placed(_get(row, "XYZ"), _about_z(row.get("R", 0.0)))
        return _placed(_get(rows[1], "XYZ"), _three(rows)) @ inner
    if p == 3:
        return _placed(_get(rows[1], "XYZ"), _columns(_get(rows[1], "IJK"), _get(rows[2], "IJK")))
    a = Rotation.from_euler("y", i, degrees=True).apply([1.0, 0.0, 0.0])
    b = Rotation.from_euler("x", j, degrees=True).apply([0.0, 1.0, 0.0])
    return _placed(_get(row, "XYZ"), _columns(a, np.cross(a, b)) @ _about_z(k))


def linuxcnc(p: int, rows: Mapping[int, Words]) -> Array:
    """A plane of G68.2 by LinuxCNC's remap."""
    row = rows[0]
    origin, about = _get(row, "XYZ"), _about_z(row.get("R", 0.0))
    if p < 2:
        order = _named(f"{row.get('Q', 313 if p == 0 else 123):.0f}")
        return _placed(origin, about @ Rotation.from_euler(order, _get(row, "IJK"), degrees=True).as_matrix())
    if p == 2:
        return _placed(origin, about @ _three(rows))
    return _placed(origin, about @ _columns(_get(row, "IJK") - origin, _get(rows[1], "IJK")))


def of_tool(axis: Array, origin: Array, r: float) -> Array:
    """G68.3: Z along the tool, X level, turned by R about Z; ``axis`` and ``origin`` in the work offset."""
    level = np.cross([0.0, 0.0, 1.0], axis)
    x = level if np.linalg.norm(level) > 1e-6 else np.array([1.0, 0.0, 0.0])
    return _placed(origin, _columns(x, axis) @ _about_z(r))
