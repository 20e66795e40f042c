""",R and ,C: what is left of both moves, and what joins them, by sampling and by plain geometry."""

from __future__ import annotations

import math
import random
from itertools import pairwise

import pytest
from support.parts import axis_ways
from support.parts.axis_ways import fanuc_mill
from support.suite import seed

from controller.machine.model import Machine
from controller.program import blocks
from controller.program.program import ProgramError

Point = tuple[float, float]


def ways(text: str, on: Machine, plane: tuple[int, int] = (0, 1)) -> list[tuple[str, list[Point]]]:
    """Kind and 65 points, in the plane, of each line and arc at feed, less the work offset."""
    first, second = plane
    return [
        ("arc" if way.kind == "arc" else "line", [(point[first], point[second]) for point in way.points])
        for way in axis_ways.ways(text, on, 64)
        if way.kind != "rapid"
    ]


def off(point: Point, a: Point, b: Point) -> float:
    """Distance from the line through two places."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    return abs((point[0] - a[0]) * dy - (point[1] - a[1]) * dx) / math.hypot(dx, dy)


def smooth(before: list[Point], after: list[Point], within: float) -> bool:
    a, b = (math.atan2(q[1] - p[1], q[0] - p[0]) for p, q in ((before[-2], before[-1]), (after[0], after[1])))
    return abs((b - a + math.pi) % (2 * math.pi) - math.pi) < within


@pytest.mark.parametrize("number", range(12))
def test_corners_of_lines(number: int) -> None:
    rng = random.Random(seed.SEED + number)
    places, kinds, angle = [(0.0, 0.0)], [], 0.0
    for _ in range(6):
        angle += rng.choice((-1, 1)) * rng.uniform(20.0, 140.0)
        far = rng.uniform(30.0, 60.0)
        x, y = places[-1]
        turn = math.radians(angle)
        places.append((round(x + far * math.cos(turn), 4), round(y + far * math.sin(turn), 4)))
        kinds.append((rng.choice("RC"), round(rng.uniform(0.5, 4.0), 3)))
    relative = rng.random() < 0.5
    rows = ["G21 G90 G0 X0. Y0. Z5.", "G91" if relative else "G90", "F500."]
    for k, ((x, y), (u, v)) in enumerate(pairwise(places)):
        words = f"X{u - x:.4f} Y{v - y:.4f}" if relative else f"X{u} Y{v}"
        corner = f" ,{kinds[k][0]}{kinds[k][1]}" if k < 5 else ""
        rows.append(f"G1 {words}{corner}")
    found = ways("\n".join(rows), fanuc_mill())
    assert len(found) == 6 + 5
    for k in range(5):
        kind, size = kinds[k]
        (_, before), (joint, between), (_, after) = found[2 * k : 2 * k + 3]
        corner = places[k + 1]
        assert before[-1] == pytest.approx(between[0], abs=1e-9)
        assert between[-1] == pytest.approx(after[0], abs=1e-9)
        for point, a in ((between[0], places[k]), (between[-1], places[k + 2])):
            assert off(point, a, corner) < 1e-3
        if kind == "C":
            assert joint == "line"
            far = [math.dist(p, corner) for p in (between[0], between[-1])]
            assert far == pytest.approx([size] * 2, abs=1e-6)
        else:
            assert joint == "arc" and smooth(before, between, 0.05) and smooth(between, after, 0.05)
            turned = math.dist(between[0], between[-1])
            alpha = math.pi - abs(_bend(places[k], corner, places[k + 2]))
            assert turned == pytest.approx(2.0 * size * math.cos(alpha / 2.0), abs=1e-5)
    assert found[-1][1][-1] == pytest.approx(places[-1], abs=1e-3)


def _bend(a: Point, b: Point, c: Point) -> float:
    first, second = math.atan2(b[1] - a[1], b[0] - a[0]), math.atan2(c[1] - b[1], c[0] - b[0])
    return (second - first + math.pi) % (2 * math.pi) - math.pi


@pytest.mark.parametrize("number", range(10))
def test_corners_of_lines_and_arcs_touch_both(number: int) -> None:
    """A line up to a circle and along it, either way round, and off it again."""
    rng = random.Random(seed.SEED + number)
    radius, size = rng.uniform(15.0, 25.0), round(rng.uniform(0.5, 3.0), 3)
    code = rng.choice(("G2", "G3"))
    start = (round(rng.uniform(30.0, 45.0), 3), round(rng.uniform(-9.0, 9.0), 3))
    end = math.radians(rng.uniform(60.0, 300.0))
    u, v = radius * math.cos(end), radius * math.sin(end)
    out = (round(rng.uniform(35.0, 50.0) * math.cos(end + 0.3), 3), round(45.0 * math.sin(end + 0.3), 3))
    text = (
        f"G90 G0 X{start[0]} Y{start[1]} Z5.\nG1 X{radius:.9f} Y0. ,R{size} F500.\n"
        f"{code} X{u:.9f} Y{v:.9f} I{-radius:.9f} J0. ,R{size}\nG1 X{out[0]} Y{out[1]}\n"
    )
    found = ways(text, fanuc_mill())
    assert [kind for kind, _ in found] == ["line", "arc", "arc", "arc", "line"]
    for one, two in pairwise(found):
        assert one[1][-1] == pytest.approx(two[1][0], abs=1e-6)
        assert smooth(one[1], two[1], 0.3)
    for k, points in ((1, found[1][1]), (3, found[3][1])):
        assert _radius(points) == pytest.approx(size, abs=1e-5), k
    assert all(math.hypot(*p) == pytest.approx(radius, abs=1e-5) for p in found[2][1])


def _radius(points: list[Point]) -> float:
    """Of the circle through three of them."""
    (ax, ay), (bx, by), (cx, cy) = points[0], points[32], points[64]
    a, b, c = math.dist((bx, by), (cx, cy)), math.dist((ax, ay), (cx, cy)), math.dist((ax, ay), (bx, by))
    return a * b * c / (2.0 * abs((bx - ax) * (cy - ay) - (cx - ax) * (by - ay)))


def test_other_planes_units_and_parameters() -> None:
    found = ways("G18 G0 X0. Y0. Z0.\nG1 Z10. ,R2. F500.\nX10.\n", fanuc_mill(), (2, 0))
    assert found[1][1][0] == pytest.approx((8, 0)) and found[1][1][-1] == pytest.approx((10, 2))
    found = ways("#1=0.1\nG20 G0 X0. Y0.\nG1 X1. ,C#1 F20.\nY1.\n", fanuc_mill())
    assert found[1][1][0] == pytest.approx((22.86, 0)) and found[1][1][-1] == pytest.approx((25.4, 2.54))
    found = ways("G0 X0. Y0.\nG1 X10. ,R0 F500.\nY10.\n", fanuc_mill())
    assert len(found) == 2


def test_a_cutter_goes_beside_the_rounded_contour() -> None:
    on, r = fanuc_mill(), fanuc_mill().tools[0].radius_mm
    text = "G0 X-20. Y0.\nG41 D1 G1 X0. Y0. F500.\nX30. ,R5.\nY30.\nG40 X0."
    found = ways(text, on)
    arcs = [points for kind, points in found if kind == "arc"]
    assert any(_radius(points) == pytest.approx(5.0 - r, abs=1e-6) for points in arcs)


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("G1 X10. ,R2. F500.", "corner.nothing_follows"),
        ("G1 X10. ,R2. F500.\nM8", "corner.no_way"),
        ("G1 X10. ,R2. F500.\nG0 Y10.", "corner.no_way"),
        ("G1 X10. ,R2. F500.\nG1 X20.", "corner.straight"),
        ("G1 X10. ,R20. F500.\nG1 Y10.", "corner.no_room"),
        ("G1 X10. ,C20. F500.\nG1 Y10.", "corner.no_room"),
        ("G1 X10. ,R6. F500.\nG1 Y10. ,R6.\nX0.", "corner.no_room"),
        ("G1 X10. Z1. ,R2. F500.\nG1 Y10.", "corner.leaves"),
        ("G1 X10. ,R2. F500.\nG1 Y10. A5.", "corner.leaves"),
        ("G1 X10. ,R-2. F500.\nG1 Y10.", "corner.size"),
        ("G1 X10. ,R2. ,C3. F500.\nG1 Y10.", "corner.two"),
        ("G0 X10. ,R2.\nG1 Y10. F500.", "corner.no_line"),
        ("G1 X10. ,R2. F500.\nG18 G1 Z10.", "corner.changes"),
        ("G93 G1 X10. ,R2. F5.\nG1 Y10. F5.", "corner.no_way"),
    ],
)
def test_what_has_no_such_corner_is_refused(text: str, key: str) -> None:
    with pytest.raises(ProgramError) as refused:
        blocks.read(f"G0 X0. Y0. Z0.\n{text}\n".encode(), fanuc_mill(), "p")
    assert refused.value.said["key"] == key


def test_under_the_other_dialect_it_is_refused() -> None:
    with pytest.raises(ProgramError, match="fanuc"):
        blocks.read(b"G1 X10. ,R2. F500.\nY10.\n", fanuc_mill(dialect="rs274"), "p")
