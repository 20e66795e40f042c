"""G12 and G13: the way of a circular pocket, sampled, against circles of the test's own."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from itertools import pairwise

import pytest
from support.parts import axis_ways
from support.parts.axis_ways import fanuc_mill
from support.suite import seed

from controller.machine.model import Machine
from controller.program import blocks
from controller.program.program import ProgramError

Point = tuple[float, float, float]


def ways(text: str, on: Machine) -> list[tuple[str, list[Point]]]:
    """Kind and 33 points of each line and arc, less the work offset."""
    return [(way.kind, way.points) for way in axis_ways.ways(text, on, 32)]


def turned(points: Sequence[Point], x: float, y: float) -> float:
    """Degrees that a way turns about a place, counter-clockwise positive."""
    angles = [math.atan2(p[1] - y, p[0] - x) for p in points]
    return math.degrees(sum((b - a + math.pi) % (2 * math.pi) - math.pi for a, b in pairwise(angles)))


@pytest.mark.parametrize("number", range(8))
def test_each_circle_is_cut_whole_and_the_way_is_smooth(number: int) -> None:
    rng = random.Random(seed.SEED + number)
    on = fanuc_mill()
    code, sense = rng.choice((("G12", -1), ("G13", 1)))
    off = on.tools[0].radius_mm if rng.random() < 0.7 else 0.0
    first, step = round(rng.uniform(5.0, 8.0), 3), round(rng.uniform(1.0, 4.0), 3)
    last = round(first + rng.uniform(0.5, 15.0), 3)
    x, y, z = (round(rng.uniform(-10, 10), 3) for _ in range(3))
    words = f"I{first:.6f} K{last:.6f} Q{step:.6f} Z{z} D{1 if off else 0} F500."
    found = ways(f"G0 X{x} Y{y} Z20.\n{code} {words}", on)[1:]
    assert found[0][0] == "feed" and found[0][1][-1] == pytest.approx((x, y, z))
    arcs = [points for kind, points in found if kind == "arc"]
    assert len(arcs) == len(found) - 1
    wanted, radius = [], first
    while radius < last - 1e-9:
        wanted.append(radius)
        radius += step
    wanted.append(last)
    circles = [points for points in arcs if math.dist(points[0], points[-1]) < 1e-6]
    assert len(circles) == len(wanted)
    for points, radius in zip(circles, wanted, strict=True):
        assert all(math.hypot(p[0] - x, p[1] - y) == pytest.approx(radius - off, abs=1e-6) for p in points)
        assert turned(points, x, y) == pytest.approx(360.0 * sense, abs=1e-6)
    assert arcs[0][0] == pytest.approx((x, y, z)) and arcs[-1][-1] == pytest.approx((x, y, z))
    for before, after in pairwise(arcs):  # smooth: the directions at a joint are the same
        assert before[-1] == pytest.approx(after[0], abs=1e-6)
        a = math.atan2(before[-1][1] - before[-2][1], before[-1][0] - before[-2][0])
        b = math.atan2(after[1][1] - after[0][1], after[1][0] - after[0][0])
        assert abs((b - a + math.pi) % (2 * math.pi) - math.pi) < 0.3  # two half steps of samples
    assert all(math.hypot(p[0] - x, p[1] - y) < last - off + 1e-6 for points in arcs for p in points)


def test_one_circle_a_middle_of_its_own_and_steps_down() -> None:
    found = ways("G0 X0. Y0. Z0.\nG91\nG13 X5. Y6. I10. Z-2. L3 D0 F500.\nG90 X1.", fanuc_mill())
    assert [kind for kind, _ in found[1:]] == ["rapid", *["feed", "arc", "arc", "arc"] * 3, "rapid"]
    assert [points[-1][2] for kind, points in found if kind == "feed"] == pytest.approx([-2, -4, -6])
    assert found[1][1][-1] == pytest.approx((5, 6, 0))
    assert found[-1][1][-1] == pytest.approx((1, 6, -6))  # the motion before is modal still


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("G12 Z-1. D1 F100.", "pocket.radii"),
        ("G12 I10. K20. D1 F100.", "pocket.radii"),
        ("G12 I10. K5. Q1. D1 F100.", "pocket.steps"),
        ("G12 I10. K20. Q0. D1 F100.", "pocket.steps"),
        ("G12 I10. K20. Q0.0001 D1 F100.", "pocket.too_many"),
        ("G12 I1. D1 F100.", "pocket.too_small"),
        ("G12 I10. Z-1. L2 D1 F100.", "pocket.times"),
        ("G18 G12 I10. D1 F100.", "pocket.plane"),
        ("G12 I10. D1", "feed.none"),
        ("G43.4 H1\nG12 I10. D1 F100.", "cycle.tip_control"),
        ("G12 I10. D77 F100.", "beside.no_tool"),
    ],
)
def test_what_makes_no_pocket_is_refused(text: str, key: str) -> None:
    with pytest.raises(ProgramError) as refused:
        blocks.read(text.encode(), fanuc_mill(), "p")
    assert refused.value.said["key"] == key
