"""G51.1, G50.1, G16 and G15: where lines, arcs, cycles and contours go, by arithmetic of the test's own."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence

import pytest
from support.parts import axis_ways
from support.parts.axis_ways import fanuc_mill
from support.suite import seed

from controller.geometry.vectors import Vector
from controller.machine.model import Machine
from controller.plan.report import explained
from controller.program import blocks
from controller.program.position import homed
from controller.program.program import ProgramError

EXACT = 1e-9


def path(text: str, on: Machine, samples: int = 5) -> list[Vector]:
    """Points on the way of the axes: samples of each line and arc, less the work offset."""
    return [point for way in axis_ways.ways(text, on, samples) for point in way.points[1:]]


def near(a: Sequence[Sequence[float]], b: Sequence[Sequence[float]], within: float = EXACT) -> bool:
    return len(a) == len(b) and all(math.dist(p, q) < within for p, q in zip(a, b, strict=True))


def contour(rng: random.Random) -> str:
    """Lines and arcs behind a first position."""
    rows, x, y = ["G1 X0. Y0. Z1. F500."], 0.0, 0.0
    for _ in range(12):
        if rng.random() < 0.5:
            x, y = (round(rng.uniform(-30.0, 30.0), 3) for _ in range(2))
            rows.append(f"G1 X{x} Y{y} Z{rng.uniform(-5, 5):.3f}")
        else:
            i, j = (rng.choice((-8.0, -5.0, 5.0, 8.0)) for _ in range(2))
            turn, code = rng.choice((90.0, 180.0, 270.0)), rng.choice(("G2", "G3"))
            angle = math.radians(-turn if code == "G2" else turn)
            dx, dy = -i, -j
            ex = x + i + dx * math.cos(angle) - dy * math.sin(angle)
            ey = y + j + dx * math.sin(angle) + dy * math.cos(angle)
            rows.append(f"{code} X{ex:.9f} Y{ey:.9f} I{i} J{j}")
            x, y = ex, ey
    return "\n".join(rows)


@pytest.mark.parametrize("number", range(12))
def test_lines_and_arcs_are_mirrored_at_the_places_of_the_axes(number: int) -> None:
    rng = random.Random(seed.SEED + number)
    on, body = fanuc_mill(), contour(rng)
    at = {letter: round(rng.uniform(-20.0, 20.0), 3) for letter in "XYZ" if rng.random() < 0.6} or {"X": 4.0}
    said = " ".join(f"{letter}{value}" for letter, value in at.items())
    head = "G21 G90 G54\nG0 X0. Y0. Z1.\n"
    plain = path(f"{head}G0 X1. Y1. Z2.\n{body}", on)[10:]
    found = path(f"{head}G51.1 {said}\nG0 X1. Y1. Z2.\n{body}", on)[10:]
    wanted = [
        tuple(2.0 * at[c] - q if c in at else q for c, q in zip("XYZ", point, strict=True)) for point in plain
    ]
    assert near(found, wanted, 1e-6)


def test_each_axis_ends_by_itself_and_all_without_words() -> None:
    text = "G0 X1. Y2. Z3.\nG51.1 X10. Y20.\nX1. Y2.\nG50.1 X0.\nX1. Y2.\nG51.1 Z1.\nX1. Y2. Z3.\n"
    text += "G50.1\nX1. Y2. Z3."
    ends = path(text, fanuc_mill(), samples=1)
    assert near(ends[1:], [(19, 38, 3), (1, 38, 3), (1, 38, -1), (1, 2, 3)])


def test_it_is_inside_of_g68_and_distances_are_mirrored_too() -> None:
    ends = path("G0 X0. Y0. Z0.\nG68 X0. Y0. R90.\nG51.1 X5.\nG0 X1. Y2.\nG91 X1.\n", fanuc_mill(), samples=1)
    assert near(ends[-2:], [(-2, 9, 0), (-2, 8, 0)])


def test_a_cutter_beside_a_contour_is_on_its_other_side() -> None:
    rows = "G1 Z0. F500.\nG41 D1 X10. Y0.\nX40.\nY30.\nX20.\nG40 X0. Y50.\n"
    on = fanuc_mill()
    plain = path(f"G0 X0. Y-20. Z5.\n{rows}", on)[5:]
    found = path(f"G51.1 X0.\nG0 X0. Y-20. Z5.\n{rows}", on)[5:]
    compensated = [(-x, y, z) for x, y, z in plain]
    assert near(found, compensated, 1e-6)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("G51.1", 1),
        ("G51.1 X0.\nG43.4 H1\nG0 X1.", 2),
        ("G51.1 X0.\nG92 X1.", 2),
        ("G51.1 X0.\nG52 X1.", 2),
        ("G51.1 X0.\nG68.2 X0. Y0. Z0. I0. J0. K0.", 2),
        ("G51.1 X0.\nG51 X0. Y15. Z0. I0. J0. K0. H10. R5. D90. F400.", 2),
        ("G51 X0. Y0. Z0. P1000", 1),
    ],
)
def test_what_is_not_mirrored_is_refused(text: str, line: int) -> None:
    with pytest.raises(ProgramError) as refused:
        blocks.read(text.encode(), fanuc_mill(), "p")
    assert refused.value.line == line
    assert "mirror" in refused.value.sentence or "G51" in refused.value.sentence


def at(radius: float, degrees: float) -> tuple[float, float]:
    return radius * math.cos(math.radians(degrees)), radius * math.sin(math.radians(degrees))


def test_g16_takes_a_radius_and_an_angle() -> None:
    text = "G0 X0. Y0. Z0.\nG17 G90 G16\nX50. Y30.\nY150.\nX20.\nG91 Y60.\nG90 Z5.\nG15\nX1. Y2."
    ends = path(text, fanuc_mill(), samples=1)
    wanted = [(*at(50, 30), 0), (*at(50, 150), 0), (*at(20, 150), 0), (*at(20, 210), 0), (*at(20, 210), 5)]
    assert near(ends[1:], [*wanted, (1, 2, 5)])


def test_under_g91_a_radius_is_about_where_the_tool_stands() -> None:
    ends = path("G0 X3. Y4. Z0.\nG16\nX10. Y90.\nG91 X5. Y-90.\nX5. Y90.", fanuc_mill(), samples=1)
    x, y = at(10, 90)
    assert near(ends[1:], [(x, y, 0), (x + 5, y, 0), (x + 5, y + 5, 0)])


def test_other_planes_and_other_codes() -> None:
    ends = path("G0 X0. Y0. Z0.\nG18 G16\nG0 Z10. X30.\nG53 G0 X1.\nG15", fanuc_mill(), samples=1)
    z, x = at(10, 30)
    assert near(ends[1:2], [(x, 0, z)])
    assert ends[2][0] == pytest.approx(1.0 - fanuc_mill().offsets[0].origin[0])


def test_holes_on_a_circle() -> None:
    text = "G0 X0. Y0. Z5.\nG16\nG81 X40. Y10. Z-1. R1. F100.\nY40.\nG91 Y30. K4\nG80 G15 G90\nG0 X0. Y0."
    on = fanuc_mill()
    bottoms = [
        step.axes
        for step in explained.steps(blocks.stream(text.encode(), on, "p"), on, "p", homed(on))
        if step.kind == "drill"
    ]
    found = [(a["X"] - on.offsets[0].origin[0], a["Y"] - on.offsets[0].origin[1]) for a in bottoms]  # type: ignore[operator]
    assert near(found, [at(40, 10 + 30 * k) for k in range(6)])
    assert {round(a["Z"] - on.offsets[0].origin[2], 9) for a in bottoms} == {-1.0}  # type: ignore[operator]


def test_arcs_end_at_a_radius_and_an_angle() -> None:
    ends = path("G0 X0. Y0. Z0.\nG16\nG1 X20. Y0. F500.\nG3 X20. Y90. R20.\nG15", fanuc_mill(), samples=2)
    assert near(ends[-2:], [(*at(20, 45), 0), (*at(20, 90), 0)], 1e-6)
