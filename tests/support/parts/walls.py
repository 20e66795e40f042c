"""Walls as programs and as points: straight, twisted and conical ones, whole or in bands; tools for them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from controller.machine import machine_file
from controller.machine.model import Machine, Tool

TOLERANCE_MM = 0.05
CLEAR = "G40\nG0 Z120.\n"


@dataclass(frozen=True)
class Wall:
    """Between an upper and a lower rail, cubic Beziers (4, 3); or a cone about Z by a point of each."""

    upper: np.ndarray
    lower: np.ndarray
    form: str = "G52"  # or G6.2, G51: then the rails are arcs that begin at their first points
    swept_rad: float = 0.0

    def band(self, high: float, low: float) -> Wall:
        """The part of it between two shares of its rulings, 0 above and 1 below."""
        rails = (((1.0 - v) * self.upper + v * self.lower).round(4) for v in (high, low))
        return Wall(*rails, self.form, self.swept_rad)

    @property
    def longest_mm(self) -> float:
        return float(np.linalg.norm(self._rail(self.upper)[0] - self._rail(self.lower)[0], axis=1).max())

    def _rail(self, points: np.ndarray, count: int = 33) -> tuple[np.ndarray, np.ndarray]:
        """Places and derivatives along a rail."""
        u = np.linspace(0.03, 0.97, count)[:, None]
        if self.form == "G51":
            x, y, z = points[0]
            angle = self.swept_rad * u[:, 0] + math.atan2(y, x)
            radius, level = math.hypot(x, y), np.full(count, z)
            cos, sin = np.cos(angle), np.sin(angle)
            ahead = np.sign(self.swept_rad) * np.stack([-sin, cos, 0.0 * cos], axis=1)
            return np.stack([radius * cos, radius * sin, level], axis=1), ahead
        a, b, c, d = points
        w = 1.0 - u
        place = w**3 * a + 3.0 * u * w**2 * b + 3.0 * u**2 * w * c + u**3 * d
        return place, 3.0 * (w**2 * (b - a) + 2.0 * u * w * (c - b) + u**2 * (d - c))

    def points(self, right: bool, along: int, across: int) -> np.ndarray:
        """Points and normals (N, 2, 3) towards the cutter."""
        (high, fast), (low, slow) = self._rail(self.upper, along), self._rail(self.lower, along)
        v = np.linspace(0.0, 1.0, across)[:, None, None]
        place, ahead = (1.0 - v) * high + v * low, (1.0 - v) * fast + v * slow
        normal = np.cross(ahead, (high - low)[None])
        normal *= (1.0 if right else -1.0) / np.linalg.norm(normal, axis=2, keepdims=True)
        return np.stack([place.reshape(-1, 3), normal.reshape(-1, 3)], axis=1)

    def block(self) -> str:
        if self.form == "G51":
            (x, y, z), (a, b, top) = self.lower[0], self.upper[0]
            size = f"H{top - z:.4f} R{math.hypot(a, b):.4f} D{math.degrees(self.swept_rad):.4f}"
            return f"G51 X{x:.4f} Y{y:.4f} Z{z:.4f} I0. J0. K{z:.4f} {size} F600.\n"
        rows = ["X{:.4f} Y{:.4f} Z{:.4f}".format(*point) for point in (*self.upper, *self.lower)]
        if self.form == "G52":
            return f"G52 {rows[0]} F600.\n" + "\n".join(rows[1:]) + "\n"
        rails = [[*(f"K0 {row}" for row in four), *["K1"] * 4] for four in (rows[:4], rows[4:])]
        return "G6.2 P4 Q4 F600.\n" + "\n".join(rails[0] + rails[1]) + "\n"


def straight(height_mm: float, length_mm: float = 20.0, lean_mm: float = 0.0) -> Wall:
    x = np.linspace(0.0, length_mm, 4)
    lower = np.stack([x, 0.0 * x, 0.0 * x], axis=1)
    return Wall(lower + np.array([0.0, lean_mm, height_mm]), lower)


def program(bands: list[Wall], side: str = "G42", placement: int = 1) -> str:
    """The walls one after the other, each left and come to from above."""
    cuts = (f"{side} P{placement}\n{one.block()}{CLEAR}" for one in bands)
    return "G21 G90 G54 G61\nT1 M6\nS6000 M3\n" + "".join(cuts) + "M30\n"


def bands(wall: Wall, count: int, downwards: bool = True) -> list[Wall]:
    """The wall in so many bands of one height, in the order in which they are cut."""
    found = [wall.band(k / count, (k + 1) / count) for k in range(count)]
    return found if downwards else found[::-1]


def machine(tool: Tool, **changes: object) -> Machine:
    """The trunnion with this T1."""
    made = machine_file.load("trunnion")
    return replace(made, tools=(tool, *made.tools[1:]), tolerance_mm=TOLERANCE_MM, **changes)  # type: ignore[arg-type]


def drawn(seed: int) -> tuple[str, Machine, list[np.ndarray]]:
    """A program, its machine and the points of its walls: tools that can cut them, and tools that cannot."""
    rng = np.random.default_rng(seed)
    wall = _wall(rng)
    side, count = str(rng.choice(["G41", "G42"])), int(rng.choice([1, 1, 2, 3]))
    cuts = bands(wall, count, bool(rng.random() < 0.7))
    tool = _tool(rng, max(one.longest_mm for one in cuts), wall.longest_mm)
    text = program(cuts, side, int(rng.choice([1, 1, 2, 3])))
    return text, machine(tool), [one.points(side == "G42", 13, 25) for one in cuts]


def _wall(rng: np.random.Generator) -> Wall:
    height, lean = float(rng.uniform(6.0, 30.0)), float(rng.uniform(-0.2, 0.2))
    form = str(rng.choice(["G52", "G52", "G6.2", "G51"]))
    if form == "G51":
        radius, swept = float(rng.uniform(14.0, 25.0)), float(rng.choice([-1.0, 1.0]) * rng.uniform(0.6, 1.4))
        low = np.array([[radius, 0.0, 0.0]])
        return Wall(low + np.array([[lean * height, 0.0, height]]), low, form, swept)
    x = np.linspace(0.0, 20.0, 4)
    lower = np.stack([x, np.array([0.0, *rng.uniform(-2.0, 2.0, 2), 0.0]), 0.0 * x], axis=1)
    twist = float(rng.choice([0.0, 0.0, 1.0]) * rng.uniform(-1.0, 1.0))
    upper = lower + np.stack([0.0 * x, lean * height + twist * (x / 20.0 - 0.5), 0.0 * x + height], axis=1)
    return Wall(upper.round(4), lower.round(4), form)


def _tool(rng: np.random.Generator, ruling_mm: float, height_mm: float) -> Tool:
    radius = float(rng.choice([0.8, 1.5, 3.0, 4.0]))
    corner, taper = float(rng.choice([0.0, 0.0, radius, radius / 3.0])), float(rng.choice([0.0, 0.0, 0.05]))
    lengths = (0.4 * ruling_mm, ruling_mm - 0.5, ruling_mm - 0.1, ruling_mm + 0.02, ruling_mm + 3.0)
    flute = float(rng.choice([*lengths, 2.0 * ruling_mm])) + corner
    wide, above = radius + (flute - corner) * math.tan(taper), flute + float(rng.uniform(0.0, 10.0))
    holders = {
        "none": (),
        "neck": ((flute, flute + 60.0, 0.8 * radius),),
        "shank": ((flute, flute + 60.0, wide),),
        "thick shank": ((above, flute + 70.0, 1.5 * wide),),
        "neck and holder": ((flute, flute + height_mm, 0.8 * radius), (flute + height_mm, 130.0, 12.0)),
    }
    held = holders[str(rng.choice(list(holders)))]
    return Tool(1, "drawn", radius, 0.0, flute, corner_mm=corner, taper_rad=taper, holder=held)
