"""G5, G5.1, G5.2: the curve against de Casteljau and scipy, its words against LinuxCNC's interpreter."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import BSpline as Reference
from support.machines.traced_programs import mill, segments, trace
from support.oracles import reference_interpreter
from typer.testing import CliRunner

from controller.__main__ import app
from controller.geometry.arrays import Array
from controller.geometry.vectors import Frame
from controller.machine.kinematics import kinematics_of
from controller.plan.report import explained
from controller.plan.rotaries.branch import joints_along
from controller.plan.segment import ContinuousPath, Segment
from controller.plan.surfaces.rates import derivatives
from controller.program import blocks
from controller.program.position import homed
from controller.program.program import ProgramError

MILL = mill()
KINEMATICS = kinematics_of(MILL)
HEAD = "G21 G90 G17 G55 F600\nG0 X3 Y-2 Z5\n"
SAME_MM = 1e-6


def curve(text: str, on: object = MILL) -> list[Segment]:
    return [s for s in segments(trace(HEAD + text, on)) if s.name == "curve"]  # type: ignore[arg-type]


def places(found: list[Segment], each: int = 200) -> Array:
    rows = [joints_along(s, np.linspace(0.0, s.motion.end, each), KINEMATICS) for s in found]
    return np.concatenate(rows)


def casteljau(points: Array, t: float) -> Array:
    while len(points) > 1:
        points = points[:-1] * (1.0 - t) + points[1:] * t
    return np.asarray(points[0])


def off(points: Array, at: Callable[[float], Array]) -> float:
    """How far the farthest of the points is from the curve ``at``: search from the nearest sample."""
    t = np.linspace(0.0, 1.0, 4001)
    samples = np.array([at(x) for x in t])
    worst = 0.0
    for p in points:
        k = int(np.argmin(((samples - p) ** 2).sum(axis=1)))
        low, high = t[max(0, k - 1)], t[min(4000, k + 1)]
        for _ in range(60):  # thirds: the distance falls and rises there
            a, b = low + (high - low) / 3, high - (high - low) / 3
            low, high = (low, b) if np.sum((at(a) - p) ** 2) < np.sum((at(b) - p) ** 2) else (a, high)
        worst = max(worst, math.dist(at((low + high) / 2), p))
    return worst


def cubic(rng: random.Random) -> tuple[str, Array]:
    i, j, p, q, x, y = (round(rng.uniform(-20.0, 20.0), 3) for _ in range(6))
    points = np.array([(3.0, -2.0), (3.0 + i, -2.0 + j), (x + p, y + q), (x, y)])
    return f"G5 X{x} Y{y} I{i} J{j} P{p} Q{q}\n", points


def quadratic(rng: random.Random) -> tuple[str, Array]:
    i, j, x, y = (round(rng.uniform(-20.0, 20.0), 3) for _ in range(4))
    return f"G5.1 X{x} Y{y} I{i} J{j}\n", np.array([(3.0, -2.0), (3.0 + i, -2.0 + j), (x, y)])


@pytest.mark.parametrize("make", [cubic, quadratic])
@pytest.mark.parametrize("seed", range(1))
def test_the_path_is_the_bezier_of_the_words(
    make: Callable[[random.Random], tuple[str, Array]], seed: int
) -> None:
    text, points = make(random.Random(seed))
    found = places(curve(text))
    assert off(found[:, :2], lambda t: casteljau(points, t)) < SAME_MM
    assert np.allclose(found[[0, -1], :2], points[[0, -1]], atol=1e-9)
    assert np.ptp(found[:, 2:], axis=0).max() < 1e-12


GENTLE = ["G5 X20 Y5 I8 J10 P-9 Q4", "G5.1 X20 Y5 I8 J10", "G5.2 X10 Y8 P3 L4\nX15 Y-6 P1\nX20 Y5 P2\nG5.3"]


@pytest.mark.parametrize("text", GENTLE)
def test_the_path_is_run_through_evenly_with_derivatives_of_its_own(text: str) -> None:
    (found,) = curve(text + "\n")
    s = np.linspace(0.0, found.motion.end, 20_001)
    q = joints_along(found, s, KINEMATICS)[:, :2]
    steps = np.hypot(*np.diff(q, axis=0).T)
    assert steps.max() / np.diff(s)[0] < 1.0 + 1e-8 and steps.sum() == pytest.approx(s[-1], rel=1e-6)
    at, h = s[2000:-2000:500], 1e-3 * found.motion.end
    rows = [joints_along(found, at + k * h, KINEMATICS)[:, :2] for k in (-2, -1, 0, 1, 2)]
    told = derivatives(found, at, KINEMATICS)
    first = (rows[0] - 8 * rows[1] + 8 * rows[3] - rows[4]) / (12 * h)
    second = (-rows[0] + 16 * rows[1] - 30 * rows[2] + 16 * rows[3] - rows[4]) / (12 * h * h)
    third = (rows[4] - 2 * rows[3] + 2 * rows[1] - rows[0]) / (2 * h**3)
    for ours, other in zip((told.first, told.second, told.third), (first, second, third), strict=True):
        size = np.abs(other).max()
        assert np.abs(ours[:, :2] - other).max() < 1e-3 * size
    assert np.abs(np.hypot(*told.first[:, :2].T) - 1.0).max() < 1e-9


def nurbs(rng: random.Random, order: int, count: int) -> tuple[str, Array, list[float]]:
    """Text, points with the start, and weights."""
    points = [
        (3.0, -2.0),
        *((round(6.0 * k + rng.uniform(-4, 4), 3), round(rng.uniform(-9, 9), 3)) for k in range(count)),
    ]
    weights = [round(rng.uniform(0.3, 3.0), 2) for _ in points]
    lines = [f"X{x} Y{y} P{w}" for (x, y), w in zip(points[1:], weights[1:], strict=True)]
    text = f"G5.2 P{weights[0]} L{order}\n" + "\n".join(lines) + "\nG5.3\n"
    return text, np.array(points), weights


@pytest.mark.parametrize(("order", "count"), [(3, 2), (4, 9), (8, 12)])
def test_the_path_is_the_rational_b_spline_of_the_words(order: int, count: int) -> None:
    text, points, weights = nurbs(random.Random(10 * order + count), order, count)
    spans = len(points) - order + 1
    knots = np.array([0.0] * order + [*range(1, spans)] + [float(spans)] * order) / spans
    weighted = np.column_stack([points * np.array(weights)[:, None], weights])
    both = Reference(knots, weighted, order - 1)

    def at(t: float) -> Array:
        x, y, w = both(min(t, 1.0 - 1e-15))
        return np.array([x / w, y / w])

    found = curve(text)
    assert len(found) == spans
    assert off(places(found, 60)[:, :2], at) < SAME_MM
    assert np.allclose(found[-1].end[:2], points[-1], atol=1e-9)


def test_a_circle_as_nurbs_is_one() -> None:
    w = math.sqrt(0.5)
    text = f"G5.2 X13 Y-2 P{w:.15f} L3\nX13 Y8 P1\nG5.3\n"
    found = places(curve("G0 X3 Y-2\n" + text))[:, :2]
    assert np.abs(np.hypot(found[:, 0] - 3.0, found[:, 1] - 8.0) - 10.0).max() < 1e-9


def test_a_second_g5_goes_on_in_the_direction_of_the_first() -> None:
    first = "G5 X10 Y0 I2 J5 P-3 Q1\n"
    went_on = places(curve(first + "M8\nG5 X20 Y5 P1 Q-4\n"))
    written = places(curve(first + "G5 X20 Y5 I3 J-1 P1 Q-4\n"))
    assert np.abs(went_on - written).max() < 1e-12
    chains = [
        i for i in trace(HEAD + first + "G5 X20 Y5 P1 Q-4\n", MILL).items if isinstance(i, ContinuousPath)
    ]
    assert [len(chain.segments) for chain in chains][-1] == 2  # no stop where they meet


@pytest.mark.parametrize("between", ["G1 X11", "G80", "G0 X12\nG80", "G5.1 X11 I1 J1", "G2 X12 I1", "X12"])
def test_behind_another_motion_i_and_j_are_needed(between: str) -> None:
    with pytest.raises(ProgramError, match=r"I J missing|no motion"):
        curve(f"G5 X10 Y0 I2 J5 P-3 Q1\n{between}\nG5 X20 Y5 P1 Q-4\n")


@pytest.mark.parametrize(
    "text",
    [
        "G5 X10 Y4 I2 J5 P-3 Q1\n",
        "G5.1 X10 I2 J5\n",
        "G5.2 X9 Y1 P1 L3\nX12 Y5 P2\nX20 Y2 P1\nG5.3\n",
    ],
)
def test_distances_inches_and_turned_offsets_move_the_same_curve(text: str) -> None:
    plain = places(curve("G0 X0 Y0\n" + text))
    moved = places(curve("G0 X1 Y1\nG91\n" + text))
    assert np.abs(moved[:, :2] - (1.0, 1.0) - plain[:, :2]).max() < 1e-9
    inches = places(curve("G0 X0 Y0\nG20 F20\n" + text))
    assert np.abs(inches[:, :2] - 25.4 * plain[:, :2]).max() < 1e-9
    turned = replace(
        MILL,
        offsets=(
            MILL.offsets[0],
            Frame((4.0, 7.0, 0.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0)),
            *MILL.offsets[2:],
        ),
    )
    found = places(curve("G0 X0 Y0\n" + text, turned))
    assert np.abs(found[:, 0] - (4.0 - plain[:, 1])).max() < 1e-9
    assert np.abs(found[:, 1] - (7.0 + plain[:, 0])).max() < 1e-9


def test_inverse_time_is_of_the_whole_curve() -> None:
    found = curve("G93\nG5.2 X9 Y1 P1 L3 F6\nX12 Y5 P2\nX20 Y2 P1\nG5.3\n")
    seconds = sum(s.motion.end / s.feed_mm_s for s in found if s.feed_mm_s)
    assert seconds == pytest.approx(10.0)


def test_explain_tells_the_curve() -> None:
    text = HEAD + "G5.2 P2 L3\nX9 Y1 P1\nX12 Y5 P2\nG5.3\n"
    read = blocks.stream(text.encode(), MILL, "p.ngc")
    (step,) = (s for s in explained.steps(read, MILL, "p.ngc", homed(MILL)) if s.kind == "curve")
    assert (step.program["X"], step.program["Y"], step.program["Z"]) == (12.0, 5.0, 5.0)
    assert step.facts["points"] == [{"X": 3.0, "Y": -2.0}, {"X": 9.0, "Y": 1.0}, {"X": 12.0, "Y": 5.0}]
    assert (step.facts["order"], step.facts["weights"], step.facts["feed"]) == (3, [2.0, 1.0, 2.0], 600.0)


REFUSED = {
    "I and J": ["G5 X1 Y1 P0 Q-3", "G5 X1 Y1 I1 P0 Q-3", "G5.1 X1 Y1", "G5.1 X1 Y1 J2"],
    "P and Q": ["G5 X1 Y1 I1 J1 P0", "G5 X1 Y1 I1 J1"],
    "says no end": ["G5 I1 J1 P0 Q-3", "G5.1 I1 J1"],
    "only X and Y move": ["G5 X1 I1 J1 P0 Q-3 Z1", "G5.1 X1 I1 J1 C1", "G5.2 X1 Y1 Z1 P1"],
    "it takes": ["G5 X1 I1 J1 K1 P0 Q-3", "G5.1 X1 I1 J1 P1", "G5.2 X1 Y1 P1 I2"],
    "write G17": ["G18\nG5 X1 Y1 I1 J1 P1 Q1", "G19\nG5.1 X1 I1 J1", "G18\nG5.2 X1 Y1 P1"],
    "write G40": ["G41.1 D1\nG5 X1 Y1 I1 J1 P1 Q1", "G42 P1\nG5.1 X1 I1 J1"],
    "write G49": ["G43.4\nG5 X1 Y1 I1 J1 P1 Q1"],
    "none has begun": ["G5.3"],
    "has 2": ["G5.2 X1 Y1 P1\nG5.3"],
    "has 3": ["G5.2 X1 Y1 P1 L4\nX2 Y2 P1\nG5.3"],
    "is no order": ["G5.2 X1 Y1 P1 L1", "G5.2 X1 Y1 P1 L9", "G5.2 X1 Y1 P1\nX2 Y2 P1 L3.5"],
    "is no weight": ["G5.2 X1 Y1 P0", "G5.2 X1 Y1 P1\nX2 Y2 P-1"],
    "missing: each control point": ["G5.2 X1 Y1", "G5.2 X1 Y1 P1\nX5 P1", "G5.2 X1 Y1 P1\nP1"],
    "the program ends": ["G5.2 X1 Y1 P1\nX2 Y2 P1"],
    "between G5.2 and G5.3": [
        "G5.2 X1 Y1 P1\nM8",
        "G5.2 X1 Y1 P1\nG1 X5 Y2 P1",
        "G5.2 X1 Y1 P1\nX2 Y2 Z2 P1",
    ],
    "inverse time": ["G93\nG5 X1 Y1 I1 J1 P1 Q1"],
    "no feed": ["G95\nG94\nG5 X1 Y1 I1 J1 P1 Q1"],
}


@pytest.mark.parametrize(("why", "text"), [(w, t) for w, texts in REFUSED.items() for t in texts])
def test_what_makes_no_curve_is_refused_with_what_to_do(why: str, text: str) -> None:
    with pytest.raises(ProgramError, match=why) as error:
        trace(HEAD + text + "\n", MILL)
    assert error.value.line >= 3


def test_what_a_refused_nurbs_leaves_behind_is_not_refused_again() -> None:
    refused: list[ProgramError] = []
    text = HEAD + "G5.2 X1 Y1 P0\nX2 Y2 P1\nX3 Y3 P1\nG5.3\nG0 X5\n"
    read = list(blocks.stream(text.encode(), MILL, "p.ngc", refused=refused))
    assert len(refused) == 1 and read[-1].place.line == 7


# What LinuxCNC's interpreter takes and leads to the same ends, or refuses as well.
LIKE = [
    *("G5 X1 Y1 I1 J1 P0 Q-3", "G5 X1 I1 J1 P0 Q-3", "G5 X1 Y1 I1 J1 P1 Q2\nG5 X3 P1 Q1", "G5.1 X2 I1 J1"),
    *(
        "G91\nG5.1 X1 Y1 I1 J2",
        "G5.1 X1 Y1 I0 J0",
        "G93\nG5 X1 Y1 I1 J1 P0 Q-3 F10\nG94",
        "G5 X1 I0 J0 P0 Q1",
    ),
    *(
        "G5.2 X0 Y1 P1 L3\nX2 Y2 P1\nG5.3",
        "G5.2 P2\nG5.2 X0 Y1 P1\nG5.2 X2 Y2 P1 L3\nG5.3",
        "G5.2\nX1 Y1 P1\nX2 Y1 P1\nG5.3",
    ),
    *(
        "G0 X1 Y1\nG91\nG5.2 X0 Y1 P1 L3\nX2 Y2 P2\nX5 Y1 P1\nG5.3",
        "G5.2 X0 Y1 P1\n(a)\nX2 Y2 P2 L4\nX5 Y1 P1\nG5.3",
    ),
    "G5.2 X0 Y1 P1 L3\n#1=3\no1 repeat [3]\nX#1 Y1 P1\n#1=[#1+1]\no1 endrepeat\nG5.3",
    *(t for w in ("P and Q", "says no end", "none has begun", "has 2", "has 3") for t in REFUSED[w]),
    *("G5 X1 Y1 I1 P0 Q-3", "G5.1 X1 Y1", "G5.1 X1 Y1 J2", "G5 X1 I1 J1 P0 Q-3 Z1", "G5.1 X1 I1 J1 A1"),
    *("G5 X1 I1 J1 K1 P0 Q-3", "G5.1 X1 I1 J1 P1", "G5.2 X1 Y1 P1 I2", "G41.1 D1\nG5 X1 Y1 I1 J1 P1 Q1"),
    *("G93\nG5 X1 Y1 I1 J1 P1 Q1", "G95\nG94\nG5 X1 Y1 I1 J1 P1 Q1", "G5.2 X1 Y1 P1\nX5 P1\nX6 Y2 P1\nG5.3"),
    *("G18\nG5 X1 Y1 I1 J1 P1 Q1", "G19\nG5.1 X1 I1 J1", "G5 X1 Y1 I1 J1 P0 Q-3\nX2 P1 Q1"),
]
LIKE += ["G5.2 X1 Y1 P1 L2\nX2 Y2 P1\nX3 Y0 P1\nG5.3"]
# What it takes and we do not, each for the reason in the README.
STRICTER = [
    "G5 X1 Y1 P0 Q-3",  # I J missing in a first G5: it goes on from the last one, or from nothing
    *("G5.2 X1 Y1", "G5.2 X1 Y1 P0\nX2 Y2 P1\nG5.3"),  # the first weight: it takes what lies in its memory
    *("G5.2 X1 Y1 Z1 P1\nX2 Y2 P1\nG5.3", "G5.2 X1 Y1 P1\nX2 Y2 Z2 P1\nG5.3"),  # Z: left out
    *("G5.2 X1 Y1 P1\nX2 Y2 P1", "G5.2 X1 Y1 P1\nX2 Y2 P1\nG1 X5"),  # no G5.3: no curve at all
    *("G5.2 X1 Y1 P1\nM8\nX2 Y2 P1\nG5.3", "G18\nG5.2 X1 Y1 P1\nX2 Y2 P1\nG5.3"),
    *("G5.2 X1 Y1 P1 L1\nX2 Y2 P1\nG5.3", "G5.2 X1 Y1 P1\nX2 Y2 P1\nG5.3 X3 Y3"),
]


@pytest.mark.skipif(reference_interpreter.program() is None, reason="rs274 is not installed")
@pytest.mark.parametrize("text", LIKE)
def test_the_reference_reads_the_words_alike(text: str, tmp_path: Path) -> None:
    on = reference_interpreter.machine()
    whole = f"G21 G90 G17 F600\nG0 X0 Y0\n{text}\nG91 G1 X100 F50\nM2\n"
    ours, other = reference_interpreter.ours(whole, on), reference_interpreter.reference(whole, tmp_path, on)
    assert bool(ours.refused) == bool(other.refused), (ours.refused, other.refused)
    assert len(ours.moves) == len(other.moves) or ours.refused
    assert all(a.near(b) for a, b in zip(ours.moves, other.moves, strict=False))


@pytest.mark.skipif(reference_interpreter.program() is None, reason="rs274 is not installed")
@pytest.mark.parametrize("text", STRICTER)
def test_what_the_reference_takes_by_chance_is_refused(text: str, tmp_path: Path) -> None:
    on = reference_interpreter.machine()
    whole = f"G21 G90 G17 F600\nG0 X0 Y0\n{text}\nM2\n"
    assert reference_interpreter.ours(whole, on).refused
    assert not reference_interpreter.reference(whole, tmp_path, on).refused


def test_explain_prints_the_points_in_words(tmp_path: Path) -> None:
    program = tmp_path / "p.ngc"
    program.write_text("G21 G90 F600 G0 X0 Y0\nG5.1 X10 Y4 I2 J5\nM2\n")
    said = CliRunner().invoke(app, ["explain", str(program)])
    assert "order 3 weights 1, 1, 1 points X0.0000 Y0.0000, X2.0000 Y5.0000, X10.0000 Y4.0000" in said.stdout
