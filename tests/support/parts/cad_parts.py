"""Shapes made by OpenCASCADE's own modelling, and STEP files of them; import after ``importorskip``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from OCP.BRep import BRep_Builder
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepBuilderAPI import (
    BRepBuilderAPI_MakeEdge,
    BRepBuilderAPI_MakeFace,
    BRepBuilderAPI_MakeWire,
    BRepBuilderAPI_Transform,
)
from OCP.BRepOffsetAPI import BRepOffsetAPI_ThruSections
from OCP.BRepPrimAPI import BRepPrimAPI_MakePrism
from OCP.collections import Array1_double, Array1_gp_Pnt, Array1_int, Array2_double, Array2_gp_Pnt
from OCP.Geom import Geom_BSplineCurve, Geom_BSplineSurface
from OCP.gp import gp_Ax1, gp_Dir, gp_Pnt, gp_Trsf, gp_Vec
from OCP.Interface import Interface_Static
from OCP.Message import Message
from OCP.STEPControl import STEPControl_StepModelType, STEPControl_Writer
from OCP.TopoDS import TopoDS_Compound

from controller.geometry.arrays import Array

Points = Sequence[Sequence[float]] | Array


def save(shape: Any, path: Path, unit: str = "MM") -> Path:
    """A STEP file of a shape that is modelled in mm."""
    messenger = Message.DefaultMessenger_s()
    for printer in list(messenger.Printers()):
        messenger.RemovePrinter(printer)
    writer = STEPControl_Writer()
    Interface_Static.SetCVal_s("write.step.unit", unit)
    writer.Transfer(shape, STEPControl_StepModelType.STEPControl_AsIs)
    writer.Write(str(path))
    Interface_Static.SetCVal_s("write.step.unit", "MM")
    return path


def knots(order: int, count: int) -> Array:
    """Clamped, even inside, from 0 to 1."""
    inner = np.linspace(0.0, 1.0, count - order + 2)[1:-1]
    return np.concatenate([np.zeros(order), inner, np.ones(order)])


def curve(order: int, points: Points) -> Any:
    values, times = np.unique(knots(order, len(points)), return_counts=True)
    return Geom_BSplineCurve(_points(points), _floats(values), _ints(times), order - 1)


def edge(made: Any) -> Any:
    return BRepBuilderAPI_MakeEdge(made).Edge()


def wire(*curves: Any) -> Any:
    made = BRepBuilderAPI_MakeWire()
    for one in curves:
        made.Add(edge(one))
    return made.Wire()


def extruded(made: Any, by: Sequence[float]) -> Any:
    return BRepPrimAPI_MakePrism(edge(made), gp_Vec(*by)).Shape()


def polygon_prism(corners: Points, by: Sequence[float]) -> Any:
    """A solid over a polygon."""
    outline = BRepBuilderAPI_MakeWire()
    for a, b in zip(corners, [*corners[1:], corners[0]], strict=True):
        outline.Add(BRepBuilderAPI_MakeEdge(gp_Pnt(*map(float, a)), gp_Pnt(*map(float, b))).Edge())
    return BRepPrimAPI_MakePrism(BRepBuilderAPI_MakeFace(outline.Wire()).Face(), gp_Vec(*by)).Shape()


def filled(outline: Any) -> Any:
    """The plane face inside a wire."""
    return BRepBuilderAPI_MakeFace(outline).Face()


def lofted(*wires: Any, solid: bool = False) -> Any:
    """Ruled from wire to wire."""
    made = BRepOffsetAPI_ThruSections(solid, True)
    for one in wires:
        made.AddWire(one)
    made.Build()
    return made.Shape()


def patch(order: int, rows: Sequence[Points], weights: Sequence[Sequence[float]] | None = None) -> Any:
    """A face on a B-spline surface: ``rows[j]`` are the points along u of row j across; one Bezier across."""
    grid = np.array(rows, dtype=float)
    across, along = grid.shape[:2]
    poles, heavy = Array2_gp_Pnt(1, along, 1, across), Array2_double(1, along, 1, across)
    for i in range(along):
        for j in range(across):
            poles.SetValue(i + 1, j + 1, gp_Pnt(*map(float, grid[j, i])))
            heavy.SetValue(i + 1, j + 1, float(weights[j][i]) if weights is not None else 1.0)
    values, times = np.unique(knots(order, along), return_counts=True)
    ends = _floats([0.0, 1.0]), _ints([across, across])
    surface = Geom_BSplineSurface(
        poles, heavy, _floats(values), ends[0], _ints(times), ends[1], order - 1, across - 1
    )
    return BRepBuilderAPI_MakeFace(surface, 1e-7).Face()


def together(*shapes: Any) -> Any:
    """One shape of several."""
    made, builder = TopoDS_Compound(), BRep_Builder()
    builder.MakeCompound(made)
    for one in shapes:
        builder.Add(made, one)
    return made


def moved(shape: Any, by: Sequence[float], axis: Sequence[float] = (0, 0, 1), angle_rad: float = 0.0) -> Any:
    """Turned about an axis through the origin, then moved."""
    turn, move = gp_Trsf(), gp_Trsf()
    turn.SetRotation(gp_Ax1(gp_Pnt(0.0, 0.0, 0.0), gp_Dir(*map(float, axis))), angle_rad)
    move.SetTranslation(gp_Vec(*map(float, by)))
    return BRepBuilderAPI_Transform(shape, move.Multiplied(turn), True).Shape()


def middle_of(made: Any) -> Array:
    """The point (3,) half-way along an edge."""
    along = BRepAdaptor_Curve(made)
    at = along.Value(0.5 * (along.FirstParameter() + along.LastParameter()))
    return np.array([at.X(), at.Y(), at.Z()])


def _points(points: Points) -> Any:
    made = Array1_gp_Pnt(1, len(points))
    for i, (x, y, z) in enumerate(points, start=1):
        made.SetValue(i, gp_Pnt(float(x), float(y), float(z)))
    return made


def _floats(values: Sequence[float] | Array) -> Any:
    made = Array1_double(1, len(values))
    for i, value in enumerate(values, start=1):
        made.SetValue(i, float(value))
    return made


def _ints(values: Any) -> Any:
    made = Array1_int(1, len(values))
    for i, value in enumerate(values, start=1):
        made.SetValue(i, int(value))
    return made
