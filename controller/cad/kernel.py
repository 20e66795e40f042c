"""OpenCASCADE behind a few plain questions: the only file that imports it.

A face answers in millimetres of the part frame: points and normals over its own parameters,
the outline it is trimmed to, its surface as a B-spline, the distance from a point to it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from OCP.Bnd import Bnd_Box
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Curve2d, BRepAdaptor_Surface
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
from OCP.BRepClass import BRepClass_FaceClassifier
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.BRepGProp import BRepGProp
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.BRepTools import BRepTools_WireExplorer
from OCP.collections import (
    IndexedDataMap_TopoDS_Shape_List_TopoDS_Shape_TopTools_ShapeMapHasher as EdgesOfFaces,
)
from OCP.collections import IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher as ShapeMap
from OCP.collections import List_TopoDS_Shape as Shapes
from OCP.collections import Sequence_TCollection_AsciiString as Names
from OCP.Geom import Geom_RectangularTrimmedSurface
from OCP.GeomAbs import GeomAbs_SurfaceType as SurfaceType
from OCP.GeomConvert import GeomConvert
from OCP.gp import gp_Dir, gp_Lin, gp_Pnt, gp_Pnt2d, gp_Trsf, gp_Vec
from OCP.GProp import GProp_GProps
from OCP.IFSelect import IFSelect_ReturnStatus
from OCP.IntCurvesFace import IntCurvesFace_ShapeIntersector
from OCP.Message import Message
from OCP.ShapeAnalysis import ShapeAnalysis_Surface
from OCP.STEPControl import STEPControl_Reader
from OCP.TopAbs import TopAbs_Orientation, TopAbs_ShapeEnum, TopAbs_State
from OCP.TopExp import TopExp, TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS

from controller.cad.curve import Nurbs
from controller.geometry.arrays import Array
from controller.geometry.vectors import Frame
from controller.messages import TextError, message

Box = tuple[float, float, float, float]  # u from, to, v from, to

KINDS = {
    SurfaceType.GeomAbs_Plane: "plane",
    SurfaceType.GeomAbs_Cylinder: "cylinder",
    SurfaceType.GeomAbs_Cone: "cone",
    SurfaceType.GeomAbs_Sphere: "sphere",
    SurfaceType.GeomAbs_Torus: "torus",
    SurfaceType.GeomAbs_BezierSurface: "Bezier",
    SurfaceType.GeomAbs_BSplineSurface: "B-spline",
    SurfaceType.GeomAbs_SurfaceOfRevolution: "revolution",
    SurfaceType.GeomAbs_SurfaceOfExtrusion: "extrusion",
    SurfaceType.GeomAbs_OffsetSurface: "offset",
}
SLACK = 1e-9  # rounding of parameters in a file
NEAR_MM = 1e-3  # a foot that is nearer needs no second look
OUTLINE = 65  # samples of an edge of the outline
INSIDE_MM = 1e-5  # a point that is nearer to the skin of a solid is on it
RAYS = ((0.123, 0.37, 0.92), (-0.71, 0.29, -0.64), (0.52, -0.83, 0.21))  # along nothing that parts have
SAME_AREA = 1e-9  # share: a face that keeps so much of its area is whole


class CadError(TextError):
    """Why a file is not imported."""


class Failure(Exception):
    """The kernel cannot compute something."""


@contextmanager
def failures() -> Iterator[None]:
    """What the kernel raises inside becomes ``Failure``: its own exceptions have no common class."""
    try:
        yield
    except Exception as error:
        if not type(error).__module__.startswith("OCP"):
            raise
        raise Failure(str(error) or type(error).__name__) from error


class Solid:
    """A body of the file."""

    def __init__(self, shape: Any) -> None:
        self.shape, self._faces, self._box = shape, ShapeMap(), Bnd_Box()
        TopExp.MapShapes_s(shape, TopAbs_ShapeEnum.TopAbs_FACE, self._faces)
        BRepBndLib.Add_s(shape, self._box)

    @cached_property
    def _crossings(self) -> Any:
        made = IntCurvesFace_ShapeIntersector()
        made.Load(self.shape, INSIDE_MM)
        return made

    def has(self, face: Any) -> bool:
        """Whether a face of the file bounds it."""
        return bool(self._faces.Contains(face))

    def is_near(self, face: Any) -> bool:
        """Whether the boxes about a face and itself meet."""
        box = Bnd_Box()
        BRepBndLib.Add_s(face, box)
        return not self._box.IsOut(box)

    def holds(self, point: Array) -> bool:
        """Whether a point (3,) is inside, deeper than ``INSIDE_MM``.

        Rays from it cross the skin an odd number of times; one that meets an edge may count wrong, so of
        three that differ two decide (the kernel's own classifier takes a hundred times as long).
        """
        at = gp_Pnt(*map(float, point))
        if self._box.IsOut(at):
            return False
        first, second = (self._leaves(at, ray) for ray in RAYS[:2])
        return first if first is second else self._leaves(at, RAYS[2])

    def _leaves(self, at: Any, ray: tuple[float, float, float]) -> bool:
        """Whether a ray from a point begins inside; from one on the skin it does not."""
        self._crossings.Perform(gp_Lin(at, gp_Dir(*ray)), -INSIDE_MM, math.inf)
        count = int(self._crossings.NbPnt())
        on_skin = any(abs(float(self._crossings.WParameter(i + 1))) <= INSIDE_MM for i in range(count))
        return count % 2 == 1 and not on_skin


class Face:
    """A trimmed face of the part, numbered from 1 in the file's order.

    ``solids`` are the bodies of the file; ``covered`` is the share of its area that other bodies hide.
    """

    def __init__(self, number: int, shape: Any, solids: Sequence[Solid] = (), covered: float = 0.0) -> None:
        self.number, self.solids, self.covered = number, solids, covered
        self.in_solid = covered > 0.0 or any(one.has(shape) for one in solids)
        self._face, self.kind = shape, "other"
        with suppress(Failure), failures():
            self.kind = KINDS.get(self._adaptor.GetType(), "other")
        self.sign = -1.0 if shape.Orientation() == TopAbs_Orientation.TopAbs_REVERSED else 1.0

    @cached_property
    def _surface(self) -> Any:
        return BRep_Tool.Surface_s(self._face)

    @cached_property
    def _adaptor(self) -> Any:
        return BRepAdaptor_Surface(self._face)

    @cached_property
    def _projector(self) -> Any:
        return ShapeAnalysis_Surface(self._surface)

    @cached_property
    def bounds(self) -> Box:
        """Of the parameters of its surface; without end where they go round."""
        u0, u1, v0, v1 = map(float, self._surface.Bounds())
        u = (-math.inf, math.inf) if self._surface.IsUPeriodic() else (u0, u1)
        v = (-math.inf, math.inf) if self._surface.IsVPeriodic() else (v0, v1)
        return (*u, *v)

    def point(self, u: float, v: float) -> Array:
        """(3,) mm."""
        return _three(self._surface.Value(u, v))

    def outward(self, u: float, v: float) -> Array:
        """The normal out of the material, (3,), not of unit length; 0 at a tip."""
        along, across, at = gp_Vec(), gp_Vec(), gp_Pnt()
        self._surface.D1(u, v, at, along, across)
        return self.sign * np.cross(_three(along), _three(across))

    def normal_at(self, point: Array) -> Array:
        """The normal out of the material at the place of its surface that is nearest to a point (3,)."""
        foot = self._projector.ValueOfUV(gp_Pnt(*map(float, point)), 1e-6)
        return self.outward(foot.X(), foot.Y())

    def outlines(self) -> list[list[Edge]]:
        """Its wires, each as its edges in turn."""
        wires = TopExp_Explorer(self._face, TopAbs_ShapeEnum.TopAbs_WIRE)
        return [list(self._edges(TopoDS.Wire(wire))) for wire in _all(wires)]

    def _edges(self, wire: Any) -> Iterator[Edge]:
        walk = BRepTools_WireExplorer(wire, self._face)
        while walk.More():
            yield Edge(walk.Current(), self._face, self.bounds)
            walk.Next()

    def edge_points(self, per_edge: int) -> Array:
        """Points of its edges, (N, 3) mm."""
        rows: list[Array] = []
        edges = TopExp_Explorer(self._face, TopAbs_ShapeEnum.TopAbs_EDGE)
        for shape in _all(edges):
            edge = TopoDS.Edge(shape)
            if BRep_Tool.Degenerated_s(edge):
                continue
            curve = BRepAdaptor_Curve(edge)
            ends = curve.FirstParameter(), curve.LastParameter()
            rows += [_three(curve.Value(t)) for t in np.linspace(*ends, per_edge)]
        return np.array(rows).reshape(-1, 3)

    def samples(self) -> tuple[Array, Array]:
        """Places inside of its outline, (N, 3) mm, and the unit normals there."""
        shares = (np.arange(5) + 0.5) / 5
        rows = np.concatenate([edge.rows for wire in self.outlines() for edge in wire])
        low, size = rows.min(axis=0), np.ptp(rows, axis=0)
        places = [low + size * (u, v) for u in shares for v in shares]
        inside = [place for place in places if self.holds(*place)]
        points = np.array([self.point(*place) for place in inside]).reshape(-1, 3)
        return points, _unit_rows(np.array([self.outward(*place) for place in inside]).reshape(-1, 3))

    def triangles(self, within_mm: float) -> Array:
        """The face as triangles, (N, 3, 3) mm, their corners counter-clockwise as seen from outside."""
        BRepMesh_IncrementalMesh(self._face, within_mm)
        placed = TopLoc_Location()  # is set to where the face stands; the mesh knows nothing of it
        mesh = BRep_Tool.Triangulation_s(self._face, placed)
        if mesh is None:
            return np.zeros((0, 3, 3))
        to = placed.Transformation()
        nodes = np.array([_three(mesh.Node(i + 1).Transformed(to)) for i in range(mesh.NbNodes())])
        corners = [mesh.Triangle(i + 1).Get() for i in range(mesh.NbTriangles())]
        found: Array = nodes[np.array(corners, dtype=int) - 1]
        return found if self.sign > 0.0 else found[:, ::-1]

    def holds(self, u: float, v: float) -> bool:
        """Whether a place of its surface is inside its outline."""
        found = BRepClass_FaceClassifier(self._face, gp_Pnt2d(u, v), 1e-9)
        return bool(found.State() != TopAbs_State.TopAbs_OUT)

    def distance(self, point: Sequence[float]) -> float:
        """From a point (3,) to the face as trimmed, mm.

        The foot on the surface first: a search over a strongly bent face may miss the nearest place.
        """
        at = gp_Pnt(*map(float, point))
        foot = self._projector.ValueOfUV(at, 1e-9)
        straight = float(at.Distance(self._surface.Value(foot.X(), foot.Y())))
        if straight <= NEAR_MM and self.holds(foot.X(), foot.Y()):
            return straight
        vertex = BRepBuilderAPI_MakeVertex(at).Vertex()
        found = float(BRepExtrema_DistShapeShape(vertex, self._face).Value())
        return min(found, straight) if self.holds(foot.X(), foot.Y()) else found

    def snapped(self, box: Box) -> Box:
        """A box of its parameters, freed of the rounding of a file: at bounds, and at whole turns."""
        surface = self._surface
        u0, u1, v0, v1 = map(float, surface.Bounds())
        u = _snapped((box[0], box[1]), (u0, u1), bool(surface.IsUPeriodic()))
        return (*u, *_snapped((box[2], box[3]), (v0, v1), bool(surface.IsVPeriodic())))

    def spline(self, box: Box) -> Spline:
        """Its surface over a box of its parameters as a rational B-spline (exact but for offsets)."""
        return Spline(self._surface, box)

    @cached_property
    def area_mm2(self) -> float:
        """Of what its outline holds."""
        found = GProp_GProps()
        BRepGProp.SurfaceProperties_s(self._face, found)
        return abs(float(found.Mass()))

    def exposed(self) -> list[Face]:
        """What other bodies of the file leave of it: itself, or parts of it, or nothing."""
        others = [one for one in self.solids if not one.has(self._face) and one.is_near(self._face)]
        if not others or not any(one.has(self._face) for one in self.solids):
            return [self]
        arguments, tools = Shapes(), Shapes()
        arguments.Append(self._face)
        for one in others:
            tools.Append(one.shape)
        cut = BRepAlgoAPI_Cut()
        cut.SetArguments(arguments)
        cut.SetTools(tools)
        cut.Build()
        left = [TopoDS.Face(shape) for shape in _mapped(cut.Shape(), TopAbs_ShapeEnum.TopAbs_FACE)]
        parts = [Face(self.number, shape, self.solids, 1.0) for shape in left]
        covered = 1.0 - sum(part.area_mm2 for part in parts) / self.area_mm2
        if covered <= SAME_AREA:
            return [self]
        return [Face(self.number, part._face, self.solids, covered) for part in parts]

    def is_buried(self, point: Array) -> bool:
        """Whether a point (3,) is inside of a body of the file."""
        return any(one.holds(point) for one in self.solids)

    def turned(self) -> tuple[Array, Array] | None:
        """A point of the axis and its unit direction, of a cylinder or a cone."""
        if self.kind not in ("cylinder", "cone"):
            return None
        made = self._adaptor.Cylinder() if self.kind == "cylinder" else self._adaptor.Cone()
        axis = made.Axis()
        return _three(axis.Location()), _three(axis.Direction())


class Edge:
    """A curve of an outline in the two parameters of its face's surface.

    Files keep its points in space, a micron beside the surface: their places may lie beyond its ``bounds``,
    where there is no surface, and are taken at them.
    """

    def __init__(self, edge: Any, face: Any, bounds: Box) -> None:
        self._curve, self._bounds = BRepAdaptor_Curve2d(edge, face), bounds
        self.t = np.linspace(self._curve.FirstParameter(), self._curve.LastParameter(), OUTLINE)
        self.rows = np.array([self.at(t) for t in self.t])  # (OUTLINE, 2)

    def at(self, t: float) -> tuple[float, float]:
        """u and v at the curve's own parameter."""
        found, (u0, u1, v0, v1) = self._curve.Value(float(t)), self._bounds
        return min(max(float(found.X()), u0), u1), min(max(float(found.Y()), v0), v1)


class Spline:
    """A surface over a box as a tensor product B-spline."""

    def __init__(self, surface: Any, box: Box) -> None:
        trimmed = Geom_RectangularTrimmedSurface(surface, *box, True, True)
        made = GeomConvert.SurfaceToBSplineSurface_s(trimmed)
        if made.IsUPeriodic():
            made.SetUNotPeriodic()
        if made.IsVPeriodic():
            made.SetVNotPeriodic()
        self._made = made
        self.box: Box = tuple(map(float, made.Bounds()))  # type: ignore[assignment]

    def edge(self, along_u: bool, at: float) -> Nurbs:
        """Its curve at constant v (``along_u``) or at constant u."""
        return _nurbs(self._made.VIso(at) if along_u else self._made.UIso(at))

    def knots(self, along_u: bool, kinks: bool = False) -> Array:
        """The distinct knots in one direction; with ``kinks`` only those with a kink, and its ends."""
        made = self._made
        count, knot, times, degree = (
            (made.NbUKnots(), made.UKnot, made.UMultiplicity, made.UDegree())
            if along_u
            else (made.NbVKnots(), made.VKnot, made.VMultiplicity, made.VDegree())
        )
        kept = [i for i in range(1, count + 1) if not kinks or i in (1, count) or times(i) >= degree]
        return np.array([knot(i) for i in kept])


class Meeting:
    """An edge at which two faces meet: places on it (3, 3) mm, its directions there, and both normals."""

    def __init__(self, faces: tuple[Face, Face], edge: Any) -> None:
        self.faces = faces
        curve = BRepAdaptor_Curve(edge)
        start, end = curve.FirstParameter(), curve.LastParameter()
        self.points, ways, at, way = np.zeros((3, 3)), np.zeros((3, 3)), gp_Pnt(), gp_Vec()
        for i, share in enumerate((0.2, 0.5, 0.8)):
            curve.D1(start + share * (end - start), at, way)
            self.points[i], ways[i] = _three(at), _three(way)
        self.ways = _unit_rows(ways)
        self.normals = tuple(_unit_rows(np.array([face.normal_at(x) for x in self.points])) for face in faces)


class Part:
    """What a STEP file holds."""

    def __init__(self, faces: list[Face], unit: str, shape: Any) -> None:
        self.faces, self.unit, self._shape = faces, unit, shape

    def meetings(self) -> list[Meeting]:
        """The edges that two faces of a body share; without those that the kernel cannot evaluate."""
        numbers = ShapeMap()
        for face in self.faces:
            numbers.Add(face._face)
        shared = EdgesOfFaces()
        kinds = TopAbs_ShapeEnum.TopAbs_EDGE, TopAbs_ShapeEnum.TopAbs_FACE
        TopExp.MapShapesAndAncestors_s(self._shape, *kinds, shared)
        found = []
        for i in range(1, shared.Extent() + 1):
            edge = TopoDS.Edge(shared.FindKey(i))
            beside = sorted({numbers.FindIndex(face) for face in shared.FindFromIndex(i)} - {0})
            if len(beside) == 2 and not BRep_Tool.Degenerated_s(edge):
                with suppress(Failure), failures():
                    one, other = (self.faces[k - 1] for k in beside)
                    found.append(Meeting((one, other), edge))
        return found


def read(path: Path, placed: Frame = Frame()) -> Part:  # noqa: B008  (frozen)
    """The faces of a STEP file, in mm, its origin put at ``placed`` of the part frame. Raises CadError."""
    _be_quiet()
    reader = STEPControl_Reader()
    if reader.ReadFile(str(path)) != IFSelect_ReturnStatus.IFSelect_RetDone:
        raise CadError(message("cad.no_step", path=path))
    unit = _unit(reader)
    reader.TransferRoots()
    shape = reader.OneShape()
    if shape is None or shape.IsNull():
        raise CadError(message("cad.no_shape", path=path))
    shape = shape.Moved(TopLoc_Location(_moved(placed)))
    solids = [Solid(solid) for solid in _mapped(shape, TopAbs_ShapeEnum.TopAbs_SOLID)]
    faces = _mapped(shape, TopAbs_ShapeEnum.TopAbs_FACE)
    if not faces:
        raise CadError(message("cad.no_face", path=path))
    made = [Face(i, TopoDS.Face(face), solids) for i, face in enumerate(faces, start=1)]
    return Part(made, unit, shape)


def _be_quiet() -> None:
    """The kernel speaks on standard output, where results stand."""
    messenger = Message.DefaultMessenger_s()
    for printer in list(messenger.Printers()):
        messenger.RemovePrinter(printer)


def _unit(reader: Any) -> str:
    lengths, angles, solid_angles = Names(), Names(), Names()
    reader.FileUnits(lengths, angles, solid_angles)
    return str(lengths.Value(1).ToCString()).lower() if lengths.Length() else "millimetre"


def _moved(placed: Frame) -> Any:
    moved = gp_Trsf()
    columns = (placed.x, placed.y, placed.z, placed.origin)
    moved.SetValues(*(float(column[i]) for i in range(3) for column in columns))
    return moved


def _mapped(shape: Any, kind: Any) -> list[Any]:
    found = ShapeMap()
    TopExp.MapShapes_s(shape, kind, found)
    return [found.FindKey(i) for i in range(1, found.Extent() + 1)]


def _all(explorer: Any) -> Iterator[Any]:
    while explorer.More():
        yield explorer.Current()
        explorer.Next()


def _snapped(range_: tuple[float, float], whole: tuple[float, float], turns: bool) -> tuple[float, float]:
    low, high = (
        next((bound for bound in whole if abs(at - bound) <= SLACK * (1.0 + abs(bound))), at) for at in range_
    )
    period = whole[1] - whole[0]
    return (low, low + period) if turns and abs(high - low - period) <= SLACK * period else (low, high)


def _nurbs(curve: Any) -> Nurbs:
    """A B-spline curve in plain numbers."""
    curve.Segment(curve.FirstParameter(), curve.LastParameter())  # what was closed then starts on a point
    knots: list[float] = []
    for i in range(1, curve.NbKnots() + 1):
        knots += [float(curve.Knot(i))] * curve.Multiplicity(i)
    count = range(1, curve.NbPoles() + 1)
    points = np.array([_three(curve.Pole(i)) for i in count])
    weights = np.array([float(curve.Weight(i)) for i in count])
    return Nurbs(curve.Degree() + 1, np.array(knots), points, weights)


def _unit_rows(rows: Array) -> Array:
    return np.asarray(rows / np.maximum(np.linalg.norm(rows, axis=1), 1e-300)[:, None])


def _three(at: Any) -> Array:
    return np.array([at.X(), at.Y(), at.Z()])
