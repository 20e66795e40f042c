"""A wall known by its formula, and bodies that trim it; import after ``importorskip``."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from OCP.BRepAlgoAPI import BRepAlgoAPI_Common, BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
from OCP.BRepFilletAPI import BRepFilletAPI_MakeFillet
from OCP.BRepPrimAPI import (
    BRepPrimAPI_MakeBox,
    BRepPrimAPI_MakeCone,
    BRepPrimAPI_MakeCylinder,
    BRepPrimAPI_MakeSphere,
    BRepPrimAPI_MakeTorus,
)
from OCP.TopAbs import TopAbs_ShapeEnum
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS
from scipy.optimize import least_squares
from support.parts import cad_parts as parts

from controller.geometry.arrays import Array

LOW = np.array([(0, 0, 0), (14, 9, 0), (30, -6, 0), (45, 2, 0)], dtype=float)
HIGH = np.array([(1, 3, 22), (13, 9, 20), (29, 4, 24), (46, 7, 23)], dtype=float)
QUARTER = math.pi / 2.0


def bezier(points: Array, u: float) -> Array:
    share = np.array([(1 - u) ** 3, 3 * u * (1 - u) ** 2, 3 * u * u * (1 - u), u**3])
    return np.asarray(share @ points)


def wall(u: float, v: float) -> Array:
    """The surface, v = 0 on the lower curve; beyond 0 and 1 it goes on along its rulings."""
    return (1.0 - v) * bezier(LOW, u) + v * bezier(HIGH, u)


def place_on_wall(point: Array) -> tuple[float, float, float]:
    """(u, v, distance in mm) of the nearest place of the wall to a point (3,)."""
    grid = [(u, v) for u in np.linspace(0.0, 1.0, 41) for v in np.linspace(-0.2, 1.2, 15)]
    start = min(grid, key=lambda at: float(np.linalg.norm(wall(*at) - point)))
    found = least_squares(lambda at: wall(*at) - point, start, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    return float(found.x[0]), float(found.x[1]), float(np.linalg.norm(found.fun))


def upright() -> Any:
    """Its rulings along v."""
    return parts.patch(4, [LOW, HIGH])


def swapped() -> Any:
    """Its rulings along u."""
    return parts.patch(2, [np.array([LOW[k], HIGH[k]]) for k in range(4)])


def reversed_() -> Any:
    """The other side out."""
    return upright().Reversed()


class Trim(NamedTuple):
    """A body that trims the wall, and how far (mm) a point is from its skin."""

    body: Callable[[], Any]
    keeps: bool  # what is inside of it
    off: Callable[[Array], float]


def _box(by: tuple[float, float, float], size: tuple[float, float, float], angle: float) -> Any:
    """Turned about Y, then moved."""
    return parts.moved(BRepPrimAPI_MakeBox(*size).Shape(), by, (0, 1, 0), angle)


def _above_plane(at: Array) -> float:
    """From the lid of the box that is turned by 0.1 about Y and has its lid at Z = 20 of its own."""
    x, _, z = at - np.array((-20.0, -50.0, -40.0))
    return float(abs(x * math.sin(0.1) + z * math.cos(0.1) - 60.0))


TRIMS = {
    "a slanting plane": Trim(lambda: _box((-20, -50, -40), (100, 100, 60), 0.1), True, _above_plane),
    "a cylinder across": Trim(
        lambda: parts.moved(BRepPrimAPI_MakeCylinder(10.0, 80.0).Shape(), (22, 40, 11), (1, 0, 0), QUARTER),
        True,
        lambda at: abs(math.hypot(at[0] - 22.0, at[2] - 11.0) - 10.0),
    ),
    "a sphere": Trim(
        lambda: parts.moved(BRepPrimAPI_MakeSphere(19.0).Shape(), (22, 3, 10)),
        True,
        lambda at: abs(float(np.linalg.norm(at - np.array((22.0, 3.0, 10.0)))) - 19.0),
    ),
    "a torus from below": Trim(
        lambda: parts.moved(BRepPrimAPI_MakeTorus(60.0, 40.0).Shape(), (22, 55, -32)),
        False,
        lambda at: abs(math.hypot(math.hypot(at[0] - 22.0, at[1] - 55.0) - 60.0, at[2] + 32.0) - 40.0),
    ),
    "a cone from below": Trim(
        lambda: parts.moved(BRepPrimAPI_MakeCone(30.0, 2.0, 30.0).Shape(), (22, 0, -5)),
        False,
        lambda at: abs(math.hypot(at[0] - 22.0, at[1]) - 30.0 + (at[2] + 5.0) * 28.0 / 30.0) * 0.7311,
    ),
}


def trimmed(face: Any, trim: Trim) -> Any:
    made = (BRepAlgoAPI_Common if trim.keeps else BRepAlgoAPI_Cut)(face, trim.body())
    return made.Shape()


def blade(low_z: float = -2.0, high_z: float = 20.0) -> Any:
    """A solid with two twisted sides of 40 mm between straight ends, ruled from its foot to its top."""
    return parts.lofted(_section(low_z, 0.0, 0.0), _section(high_z, 3.0, 0.25), solid=True)


def _section(z: float, dy: float, turn: float) -> Any:
    c, s = math.cos(turn), math.sin(turn)
    side = np.array([(-20, -1, 0), (-7, 4, 0), (8, 4, 0), (20, 0, 0)], dtype=float)
    to = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    one, other = side @ to + (0, dy, z), (side + np.array((0, 3, 0))) @ to + (0, dy, z)
    return parts.wire(
        parts.curve(4, one),
        parts.curve(2, [one[3], other[3]]),
        parts.curve(4, other[::-1]),
        parts.curve(2, [other[0], one[0]]),
    )


def hub() -> Any:
    return parts.moved(BRepPrimAPI_MakeCylinder(40.0, 10.0).Shape(), (0, 0, -10))


def blade_on_hub() -> Any:
    """One body: a hub of revolution with a dome, a blade on it, both within a conical shroud."""
    dome = parts.moved(BRepPrimAPI_MakeSphere(80.0).Shape(), (0, 0, -80))
    foot = parts.moved(BRepPrimAPI_MakeCylinder(60.0, 200.0).Shape(), (0, 0, -20))
    whole = BRepAlgoAPI_Fuse(BRepAlgoAPI_Common(dome, foot).Shape(), blade(-8.0, 20.0)).Shape()
    shroud = parts.moved(BRepPrimAPI_MakeCone(60.0, 2.0, 34.0).Shape(), (0, 0, -16))
    return BRepAlgoAPI_Common(whole, shroud).Shape()


def filleted(radius_mm: float = 2.0) -> Any:
    """A blade on a flat hub with a fillet round its foot."""
    whole = BRepAlgoAPI_Fuse(hub(), blade()).Shape()
    made = BRepFilletAPI_MakeFillet(whole)
    for edge in _edges(whole):
        middle = parts.middle_of(edge)
        if abs(middle[2]) < 1e-6 and math.hypot(middle[0], middle[1]) < 39.0:
            made.Add(radius_mm, edge)
    made.Build()
    return made.Shape()


def _edges(shape: Any) -> list[Any]:
    """Each once."""
    found: list[Any] = []
    walk = TopExp_Explorer(shape, TopAbs_ShapeEnum.TopAbs_EDGE)
    while walk.More():
        edge = TopoDS.Edge(walk.Current())
        if not any(edge.IsSame(other) for other in found):
            found.append(edge)
        walk.Next()
    return found
