"""STEP files written by hand, so that a face is what the standard says and not what a kernel exports."""

from __future__ import annotations

import math
from collections.abc import Sequence

HEAD = """ISO-10303-21;
HEADER;
FILE_DESCRIPTION((''),'2;1');
FILE_NAME('by hand','2000-01-01T00:00:00',(''),(''),'','','');
FILE_SCHEMA(('AUTOMOTIVE_DESIGN { 1 0 10303 214 1 1 1 1 }'));
ENDSEC;
DATA;
#1=APPLICATION_CONTEXT('automotive design');
#2=APPLICATION_PROTOCOL_DEFINITION('international standard','automotive_design',2000,#1);
#3=PRODUCT_CONTEXT('',#1,'mechanical');
#4=PRODUCT('part','part','',(#3));
#5=PRODUCT_DEFINITION_FORMATION('','',#4);
#6=PRODUCT_DEFINITION_CONTEXT('part definition',#1,'design');
#7=PRODUCT_DEFINITION('design','',#5,#6);
#8=PRODUCT_DEFINITION_SHAPE('','',#7);
#9=SHAPE_DEFINITION_REPRESENTATION(#8,#10);
#11=(GEOMETRIC_REPRESENTATION_CONTEXT(3) GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT((#15))
GLOBAL_UNIT_ASSIGNED_CONTEXT((#12,#13,#14)) REPRESENTATION_CONTEXT('',''));
#12=(LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.MILLI.,.METRE.));
#13=(NAMED_UNIT(*) PLANE_ANGLE_UNIT() SI_UNIT($,.RADIAN.));
#14=(NAMED_UNIT(*) SI_UNIT($,.STERADIAN.) SOLID_ANGLE_UNIT());
#15=UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE(1.E-6),#12,'distance_accuracy_value','');
#10=SHAPE_REPRESENTATION('',(#20),#11);
#20=SHELL_BASED_SURFACE_MODEL('',(#21));
#21=OPEN_SHELL('',(#22));
"""
TAIL = "ENDSEC;\nEND-ISO-10303-21;\n"


def _real(value: float) -> str:
    text = repr(float(value)).upper()
    return text if "." in text else text.replace("E", ".E")


def _triple(values: Sequence[float]) -> str:
    return f"({','.join(map(_real, values))})"


class _Data:
    """Entities with their numbers."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self._next = 100

    def add(self, entity: str) -> str:
        self._next += 1
        self.lines.append(f"#{self._next}={entity};")
        return f"#{self._next}"

    def point(self, at: Sequence[float]) -> str:
        return self.add(f"CARTESIAN_POINT('',{_triple(at)})")

    def direction(self, at: Sequence[float]) -> str:
        return self.add(f"DIRECTION('',{_triple(at)})")

    def vertex(self, at: Sequence[float]) -> str:
        return self.add(f"VERTEX_POINT('',{self.point(at)})")

    def frame(self, at: Sequence[float]) -> str:
        z, x = self.direction((0, 0, 1)), self.direction((1, 0, 0))
        return self.add(f"AXIS2_PLACEMENT_3D('',{self.point(at)},{z},{x})")

    def edge(self, start: str, end: str, curve: str) -> str:
        return self.add(f"EDGE_CURVE('',{start},{end},{curve},.T.)")

    def oriented(self, edge: str, forward: bool) -> str:
        return self.add(f"ORIENTED_EDGE('',*,*,{edge},{'.T.' if forward else '.F.'})")

    def line(self, a: Sequence[float], b: Sequence[float]) -> str:
        way = [q - p for p, q in zip(a, b, strict=True)]
        vector = self.add(f"VECTOR('',{self.direction(way)},{_real(math.hypot(*way))})")
        return self.add(f"LINE('',{self.point(a)},{vector})")

    def text(self, edges: Sequence[str], surface: str) -> str:
        """The file of one face; its edges lead round it, the second two of four against themselves."""
        loop = ",".join(self.oriented(edge, k < 2) for k, edge in enumerate(edges))
        ring = self.add(f"EDGE_LOOP('',({loop}))")
        bound = self.add(f"FACE_OUTER_BOUND('',{ring},.T.)")
        return (
            HEAD + "\n".join([*self.lines, f"#22=ADVANCED_FACE('',({bound}),{surface},.T.);"]) + "\n" + TAIL
        )


def ruled_face(low: Sequence[Sequence[float]], high: Sequence[Sequence[float]], beyond: float = 0.0) -> str:
    """A face between two Bezier curves of the same degree, as a B-spline surface linear across.

    Its edges are so far ``beyond`` the surface, as a share of the rulings.
    """
    data, degree = _Data(), len(low) - 1
    points = [[data.point(at) for at in pair] for pair in zip(low, high, strict=True)]
    grid = ",".join(f"({','.join(pair)})" for pair in points)
    ends = f"({degree + 1},{degree + 1})"
    surface = data.add(
        f"B_SPLINE_SURFACE_WITH_KNOTS('',{degree},1,({grid}),.UNSPECIFIED.,.F.,.F.,.F.,{ends},(2,2),(0.,1.),"
        "(0.,1.),.UNSPECIFIED.)"
    )
    edges = [
        [
            [(1.0 + beyond) * a - beyond * b for a, b in zip(one, other, strict=True)]
            for one, other in zip(*rows, strict=True)
        ]
        for rows in ((low, high), (high, low))
    ]
    low, high = edges
    points = [[data.point(at) for at in pair] for pair in zip(low, high, strict=True)]
    corners = [data.vertex(at) for at in (low[0], low[-1], high[-1], high[0])]
    curves = []
    for column in (0, 1):
        row = ",".join(pair[column] for pair in points)
        curves.append(
            data.add(
                f"B_SPLINE_CURVE_WITH_KNOTS('',{degree},({row}),.UNSPECIFIED.,.F.,.F.,{ends},(0.,1.),.UNSPECIFIED.)"
            )
        )
    a, b, c, d = corners
    round_it = [
        data.edge(a, b, curves[0]),
        data.edge(b, c, data.line(low[-1], high[-1])),
        data.edge(d, c, curves[1]),
        data.edge(a, d, data.line(low[0], high[0])),
    ]
    return data.text(round_it, surface)


def cone_face(centre: Sequence[float], radius: float, upper: float, height: float, sweep: float) -> str:
    """A sector of a cone about Z that widens upwards, from the direction of X, counter-clockwise (rad)."""
    data, (x, y, z) = _Data(), centre
    half = math.atan2(upper - radius, height)
    surface = data.add(f"CONICAL_SURFACE('',{data.frame(centre)},{_real(radius)},{_real(half)})")
    c, s = math.cos(sweep), math.sin(sweep)
    places = [
        (x + r * a, y + r * b, h)
        for r, h, a, b in (
            (radius, z, 1.0, 0.0),
            (radius, z, c, s),
            (upper, z + height, c, s),
            (upper, z + height, 1.0, 0.0),
        )
    ]
    a, b, top, d = (data.vertex(at) for at in places)
    low, high = (
        data.add(f"CIRCLE('',{data.frame((x, y, h))},{_real(r)})")
        for h, r in ((z, radius), (z + height, upper))
    )
    edges = [
        data.edge(a, b, low),
        data.edge(b, top, data.line(places[1], places[2])),
        data.edge(d, top, high),
        data.edge(a, d, data.line(places[0], places[3])),
    ]
    return data.text(edges, surface)
