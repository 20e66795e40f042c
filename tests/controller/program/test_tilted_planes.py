"""G68.2 to G68.4 and G53.1: tool axis and tip against matrices that know nothing of the product."""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from functools import cache

import numpy as np
import pytest
from support.machines.stepped_runs import SHIPPED, shipped
from support.oracles import tilted_planes
from support.oracles.tilted_planes import Bench

from controller.geometry.arrays import Array
from controller.machine.model import Machine
from controller.plan.report import explained
from controller.plan.report.explained import Step
from controller.program import blocks
from controller.program.position import homed
from controller.program.program import ProgramError

DIALECTS = ("fanuc", "rs274")
EXACT = 1e-9  # mm, and of a unit vector
ANGLES = range(-180, 181, 5)
ORDERS = (123, 132, 213, 231, 312, 321)
EULER = (121, 131, 212, 232, 313, 323)
CYCLES = (
    *("G81 Z{b} R{r}", "G82 Z{b} R{r} P0.1", "G83 Z{b} R{r} Q2.5", "G73 Z{b} R{r} Q1.5", "G85 Z{b} R{r}"),
    *("G86 Z{b} R{r} P0.1", "G89 Z{b} R{r} P0.1", "G84 Z{b} R{r}"),
)


@cache
def machine(name: str, dialect: str) -> Machine:
    return shipped(name, dialect=dialect, without_point="unit")


@cache
def bench(name: str) -> Bench:
    return Bench.of(name)


def told(text: str, on: Machine) -> list[Step]:
    return list(explained.steps(blocks.stream(text.encode(), on, "p"), on, "p", homed(on)))


@dataclass
class Case:
    """A program with a plane in it, and what the manuals say of its plane (4 x 4, to the work offset)."""

    name: str
    dialect: str
    rng: random.Random
    lines: list[str] = field(default_factory=list)
    length: float = 0.0
    plane: Array = field(default_factory=lambda: np.eye(4))
    reached: str = "G53.1"
    start: dict[str, float] = field(default_factory=dict)

    def numbers(self, letters: str, values: object) -> str:
        return " ".join(f"{a}{b:.6f}" for a, b in zip(letters, values, strict=True))  # type: ignore[call-overload]

    def angle(self) -> float:
        return float(self.rng.choice(ANGLES))

    def place(self) -> list[float]:
        return [round(self.rng.uniform(-30.0, 30.0), 3) for _ in range(3)]

    def row(self, code: str, p: int, q: int | None, words: dict[str, float]) -> dict[str, float]:
        said = " ".join(f"{k}{v:.0f}" if k == "Q" else f"{k}{v:.9f}" for k, v in words.items())
        self.lines.append(f"{code} P{p} {'' if q is None else f'Q{q} '}{said}")
        return {k: v if k == "Q" else float(f"{v:.9f}") for k, v in words.items()}

    def of_words(self, code: str) -> Array:
        """One definition by P; of G68.2, or of G68.4 as seen from the plane before it."""
        p = self.rng.choice(range(5 if self.dialect == "fanuc" else 4))
        make = tilted_planes.fanuc if self.dialect == "fanuc" else tilted_planes.linuxcnc
        return make(p, self.rows(code, p))

    def rows(self, code: str, p: int) -> dict[int, dict[str, float]]:
        origin = dict(zip("XYZ", self.place(), strict=True))
        fanuc = self.dialect == "fanuc"
        if p in (0, 1, 4):
            words = origin | {letter: self.angle() for letter in "IJK"}
            if p == 4:
                words |= {"I": self.rng.choice(range(-85, 86, 5)), "J": self.rng.choice(range(-85, 86, 5))}
            if p == 1 or not fanuc:
                words["Q"] = float(self.rng.choice(ORDERS if p == 1 else EULER))
            if not fanuc:
                words["R"] = self.angle()
            return {0: self.row(code, p, None, words)}
        turned = tilted_planes.fanuc(0, {0: {letter: self.angle() for letter in "IJK"}})[:3, :3]
        if p == 2:
            made = {}
            if not fanuc or self.rng.random() < 0.5:
                made[0] = self.row(code, p, 0, {**origin, "R": self.angle()})
            first = np.array(self.place())
            for q, way in ((1, (0, 0)), (2, (12.0, 0.0)), (3, (5.0, 9.0))):
                point = first + turned @ np.array([*way, 0.0])
                made[q] = self.row(code, p, q, dict(zip("XYZ", point, strict=True)))
            return made
        x, z = turned[:, 0], turned[:, 2]
        if fanuc:
            x = x + self.rng.choice((0.0, 0.0, 0.05)) * z  # Fanuc lets X and Z miss the right angle
            first = self.row(code, p, 1, origin | dict(zip("IJK", 3.0 * x, strict=True)))
            return {1: first, 2: self.row(code, p, 2, dict(zip("IJK", z, strict=True)))}
        point = np.array([*origin.values()]) + 40.0 * x
        words = {**origin, **dict(zip("IJK", point, strict=True)), "R": self.angle()}
        return {0: self.row(code, p, 0, words), 1: self.row(code, p, 1, dict(zip("IJK", z, strict=True)))}

    def of_tool(self) -> Array:
        """G68.3 with the rotaries turned to some multiple of five degrees."""
        where = bench(self.name)
        axis = where.tool({"X": 0.0, "Y": 0.0, "Z": 0.0, **self.start}, 0.0)[1]
        origin, r = self.place(), self.angle()
        self.lines.append(f"G68.3 {self.numbers('XYZ', origin)} R{r:.1f}")
        return tilted_planes.of_tool(axis, np.array(origin), r)


def some_case(name: str, dialect: str, number: int) -> Case:
    rng = random.Random(f"{name} {dialect} {number}")
    made = Case(name, dialect, rng)
    made.length = round(rng.uniform(0.0, 80.0), 3)
    for row in bench(name).rotaries:
        low, high = (max(-180.0, row["travel_deg"][0]), min(180.0, row["travel_deg"][1]))  # type: ignore[index]
        made.start[str(row["name"])] = float(rng.choice([a for a in ANGLES if low <= a <= high]))
    begin = " ".join(f"{k}{v:.1f}" for k, v in made.start.items())
    made.lines += ["G21 G90 G54 F300 S500 M3", f"G43.1 Z{made.length:.3f}", f"G0 {begin}"]
    made.plane = made.of_tool() if rng.random() < 0.2 else made.of_words("G68.2")
    if rng.random() < 0.2:
        if dialect == "rs274":
            made.lines.append("G53.1")
        made.plane = made.plane @ made.of_words("G68.4")
    made.reached = rng.choice(("G53.1", "G53.6"))
    made.lines.append(made.reached)
    return made


def on_table(case: Case, point: object) -> Array:
    """A place of the plane as one of the table frame."""
    where = bench(case.name)
    return where.origin + (case.plane @ np.append(np.asarray(point, dtype=float), 1.0))[:3]


def assert_tool(case: Case, step: Step, point: object) -> None:
    tip, axis = bench(case.name).tool(step.axes, case.length)  # type: ignore[arg-type]
    assert np.abs(axis - case.plane[:3, 2]).max() < EXACT, case.lines
    if point is not None:
        assert np.abs(tip - on_table(case, point)).max() < EXACT, (case.lines, tip, on_table(case, point))


def judged(name: str, dialect: str, number: int, drills: bool) -> bool:
    """Read one case and hold every end against the matrices; False: it is out of reach, and rightly so."""
    case, on = some_case(name, dialect, number), machine(name, dialect)
    head = len(case.lines)
    points = [case.place() for _ in range(3)]
    moves = [f"G0 {case.numbers('XYZ', points[0])}", f"G1 {case.numbers('XYZ', points[1])}"]
    moves += [f"G0 {case.numbers('XYZ', points[2])}"]
    if drills:
        r, b = 2.0, -6.5
        cycle = case.rng.choice(CYCLES).format(r=r, b=b)
        ends = case.rng.choice(("G98", "G99"))
        holes = [case.place()[:2] for _ in range(2)]
        moves[-1] = f"G0 {case.numbers('XYZ', [*points[2][:2], 20.0])}"
        moves += [f"{ends} {cycle} {case.numbers('XY', holes[0])}", case.numbers("XY", holes[1]), "G80"]
    try:
        steps = told("\n".join([*case.lines, *moves, "G69", "M30", ""]), on)
    except ProgramError as error:
        if "cannot turn the tool" not in error.sentence:
            raise
        turns = [i for i, text in enumerate(case.lines, start=1) if text.startswith("G53")]
        if error.line == turns[-1]:
            assert bench(name).is_out_of_reach(case.plane[:3, 2]), (case.lines, error)
        return False
    _assert_reached(case, steps, head)
    for number_of_line, point in zip((head + 1, head + 2), points, strict=False):
        (step,) = (step for step in steps if step.line == number_of_line)
        assert_tool(case, step, point)
    if drills:
        for k, hole in enumerate(holes):
            kinds = ("rapid", *explained.LINES)
            rows = [step for step in steps if step.line == head + 4 + k and step.kind in kinds]
            deepest = min(rows, key=lambda step: step.program["Z"] or 0.0)
            assert_tool(case, deepest, (*hole, b))
            assert_tool(case, rows[-1], (*hole, r if ends == "G99" else 20.0))
            for step in rows:  # straight along the tool: nothing but Z changes once over the hole
                assert_tool(case, step, (*hole, step.program["Z"]))
    return True


def _assert_reached(case: Case, steps: list[Step], head: int) -> None:
    """G53.1 leaves X Y Z where they are, G53.6 the tip on the part."""
    (turned,) = (step for step in steps if step.line == head)
    before = [step for step in steps if step.line < head][-1]
    assert_tool(case, turned, None)
    where = bench(case.name)
    if case.reached == "G53.1":
        assert [turned.axes[x] for x in "XYZ"] == pytest.approx([before.axes[x] for x in "XYZ"], abs=EXACT)
    else:
        tips = [where.tool(step.axes, case.length)[0] for step in (before, turned)]  # type: ignore[arg-type]
        assert np.abs(tips[0] - tips[1]).max() < EXACT, case.lines


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("name", SHIPPED)
def test_tool_and_tip_are_where_matrices_put_them(name: str, dialect: str) -> None:
    reached = [judged(name, dialect, number, number % 4 == 0) for number in range(12)]
    assert sum(reached) > 3


@pytest.mark.slow
@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("name", SHIPPED)
@pytest.mark.parametrize("first", range(0, 5000, 1000))
def test_five_thousand_planes(first: int, name: str, dialect: str) -> None:
    """Every tenth with a drilling cycle."""
    reached = [judged(name, dialect, number, number % 10 == 0) for number in range(first, first + 1000)]
    assert sum(reached) > 250
