"""G254, G54.2 and G255: where the axes go, against matrices that know nothing of the product."""

from __future__ import annotations

import math
import random
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from support.oracles.tilted_planes import turned_about
from support.suite import seed

from controller.geometry.arrays import Array
from controller.machine import machine_file
from controller.machine.model import Kind, Machine
from controller.plan.report import explained
from controller.plan.report.explained import Step
from controller.program import blocks, carried
from controller.program.carried import InForce, after_line
from controller.program.position import homed
from controller.program.program import ProgramError

TABLES = ("trunnion", "xyzac_linuxcnc", "table_head", "oblique45", "machining_centre")
NO_TABLE = ("head_head", "three_axes")
EXACT = 1e-9


@cache
def shipped(name: str) -> Machine:
    return replace(machine_file.load(name), dialect="fanuc", without_point="unit", unset=())


def drawn(rng: random.Random) -> Machine:
    """A shipped machine whose rotary axes lie anywhere, and whose parts lie anywhere."""
    machine = shipped(rng.choice(TABLES[:3]))
    axes = []
    for axis in machine.axes:
        if axis.is_rotary:
            lean = [q + rng.uniform(-0.2, 0.2) for q in axis.direction]
            far = math.hypot(*lean)
            x, y, z = (rng.uniform(-80.0, 80.0) for _ in range(3))
            axis = replace(
                axis,
                direction=(lean[0] / far, lean[1] / far, lean[2] / far),
                point_mm=(x, y, z),
                travel_min=-7.0,
                travel_max=7.0,
            )
        axes.append(axis)
    offsets = [replace_origin(frame, rng) for frame in machine.offsets]
    return replace(machine, axes=tuple(axes), offsets=tuple(offsets))


def replace_origin(frame: Any, rng: random.Random) -> Any:
    return frame._replace(origin=tuple(rng.uniform(-90.0, 90.0) for _ in range(3)))


def table(machine: Machine, degrees: dict[str, float]) -> Array:
    """4 x 4: where a point of the part is, with its rotaries there, of where it was with them at zero."""
    made = np.eye(4)
    for axis in machine.axes:
        if axis.kind is Kind.TABLE:
            carried_deg = math.degrees(degrees.get(axis.name, 0.0) / axis.shown_per_unit)
            made = made @ turned_about(np.array(axis.direction), np.array(axis.point_mm), carried_deg)
    return made


def point(matrix: Array, of: Array) -> Array:
    found: Array = (matrix @ np.append(of, 1.0))[:3]
    return found


def vec(words: dict[str, float]) -> Array:
    return np.array([*words.values()])


def steps(text: str, machine: Machine) -> list[Step]:
    made = blocks.stream(text.encode(), machine, "p")
    return list(explained.steps(made, machine, "p", homed(machine)))


def xyz(step: Step) -> Array:
    return np.array([step.axes[letter] for letter in "XYZ"], dtype=float)


def angles(machine: Machine, rng: random.Random) -> dict[str, float]:
    return {axis.name: round(rng.uniform(-90.0, 90.0), 3) for axis in machine.axes if axis.is_rotary}


def written(words: dict[str, float]) -> str:
    return " ".join(f"{letter}{value:.6f}" for letter, value in words.items())


def place(rng: random.Random) -> dict[str, float]:
    return {letter: round(rng.uniform(-40.0, 40.0), 3) for letter in "XYZ"}


@pytest.mark.parametrize("number", range(30))
def test_g254_carries_the_origin_with_the_table_and_leaves_the_axes_parallel(number: int) -> None:
    rng = random.Random(seed.SEED + number)
    machine = drawn(rng)
    k = rng.randrange(6)
    origin, where, at = np.array(machine.offsets[k].origin), angles(machine, rng), place(rng)
    tool = machine.tools[0]
    shift = place(rng) if number % 3 == 0 else dict.fromkeys("XYZ", 0.0)
    text = [f"G90 G21 G{54 + k} T{tool.number} M6 G43 H{tool.number}", f"G0 {written(where)}", "G254"]
    if number % 3 == 0:
        text.append(f"G52 {written(shift)}")
    if number % 2:
        text.append(f"G0 {written(angles(machine, rng))}")
        text.append(f"G0 {written(where)}" if number % 4 == 1 else f"G0 {written(where | at)}")
    text.append(f"G1 {written(at)} F500.")
    text += ["G255", f"G0 {written(at)}"]
    made = [step for step in steps("\n".join(text), machine) if step.kind in ("rapid", *explained.LINES)]
    expected = point(table(machine, where), origin) + vec(shift) + vec(at)
    expected[2] += tool.length_mm
    assert np.abs(xyz(made[-2]) - expected).max() < EXACT
    off = origin + vec(shift) + vec(at) + np.array([0.0, 0.0, tool.length_mm])
    assert np.abs(xyz(made[-1]) - off).max() < EXACT
    for letter, value in at.items():
        assert made[-2].program[letter] == pytest.approx(value, abs=EXACT)


@pytest.mark.parametrize("number", range(20))
def test_g54_2_adds_a_vector_that_turns_with_the_table(number: int) -> None:
    rng = random.Random(seed.SEED + number)
    machine = drawn(rng)
    centre, vector, at = np.array(machine.offsets[0].origin), place(rng), place(rng)
    measured, where = angles(machine, rng), angles(machine, rng)
    text = f"G90 G21 G54\nG10 L21 P3 {written(vector | measured)}\nG54.2 P3\n"
    text += f"G0 {written(where)}\nG0 {written(at)}\nG54.2 P0\nG0 {written(at)}"
    made = [step for step in steps(text, machine) if step.kind in ("rapid", *explained.LINES)]
    turned = table(machine, where)[:3, :3] @ table(machine, measured)[:3, :3].T @ vec(vector)
    assert np.abs(xyz(made[-2]) - (centre + turned + vec(at))).max() < EXACT
    assert np.abs(xyz(made[-1]) - (centre + vec(at))).max() < EXACT


@pytest.mark.parametrize("number", range(10))
def test_a_work_offset_is_set_so_that_the_position_reads_as_written(number: int) -> None:
    rng = random.Random(seed.SEED + number)
    machine = drawn(rng)
    where, at, reads = angles(machine, rng), place(rng), place(rng)
    text = f"G90 G21 G54\nG0 {written(where)}\nG254\nG0 {written(at)}\nG10 L120 P2 {written(reads)}\n"
    text += f"G55\nG0 {written(reads)}"
    made = [step for step in steps(text, machine) if step.kind == "rapid"]
    assert np.abs(xyz(made[-1]) - xyz(made[-2])).max() < EXACT


def test_rotaries_alone_move_nothing_else_and_distances_are_those_of_the_machine() -> None:
    machine, rng = drawn(random.Random(seed.SEED + 1)), random.Random(seed.SEED + 2)
    text = f"G90 G21 G54\nG254\nG0 X1. Y2. Z3.\nG0 {written(angles(machine, rng))}\nG91 X5. Z-1.\n"
    made = [step for step in steps(text, machine) if step.kind == "rapid"]
    assert np.abs(xyz(made[1]) - xyz(made[0])).max() < EXACT
    assert np.abs(xyz(made[2]) - xyz(made[1]) - np.array([5.0, 0.0, -1.0])).max() < EXACT


def test_the_origin_is_as_the_rotaries_stand_after_g28_and_for_lines_by_hand() -> None:
    rng = random.Random(seed.SEED + 3)
    machine = drawn(rng)
    origin, where, at = np.array(machine.offsets[0].origin), angles(machine, rng), place(rng)
    names = "".join(f" {name}0." for name in where)
    text = f"G90 G21 G54\nG0 {written(where)}\nG254\nG91 G28{names}\nG90 G0 {written(at)}"
    made = [step for step in steps(text, machine) if step.kind == "rapid"]
    home = {a.name: q * a.shown_per_unit for a, q in zip(machine.axes, machine.reference("G28"), strict=True)}
    expected = point(table(machine, home), origin) + vec(at)
    assert np.abs(xyz(made[-1]) - expected).max() < EXACT

    note = InForce()
    list(blocks.stream(f"G0 {written(where)}\nG254".encode(), machine, "m", in_force=note))
    assert note.last is not None
    left = carried.from_json(carried.to_json(after_line(note.last, machine)))
    after = angles(machine, rng)  # by a jog
    start = tuple(
        after[a.name] / a.shown_per_unit if a.is_rotary else q
        for a, q in zip(machine.axes, homed(machine), strict=True)
    )
    made = list(
        explained.steps(
            blocks.stream(f"G0 {written(at)}".encode(), machine, "m", start=start, begin=left),
            *(machine, "m", start),
        )
    )
    expected = point(table(machine, after), origin) + vec(at)
    assert np.abs(xyz(made[-1]) - expected).max() < EXACT


@pytest.mark.parametrize("name", NO_TABLE)
@pytest.mark.parametrize("code", ["G254", "G10 L21 P1 X1. Y0. Z0.\nG54.2 P1"])
def test_where_no_rotary_turns_the_part_it_is_refused(name: str, code: str) -> None:
    with pytest.raises(ProgramError, match="no rotary of this machine turns the part"):
        blocks.read(f"{code}\nG0 X1.\n".encode(), shipped(name), "p")


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("G254\nG43.4 H1", 2),
        ("G43.4 H1\nG254", 2),
        ("G254\nG68.2 X0. Y0. Z0. I0. J0. K0.", 2),
        ("G68.2 X0. Y0. Z0. I0. J0. K0.\nG254", 2),
        ("S100 M3\nG254\nG51 X0. Y15. Z0. I0. J0. K0. H10. R5. D90. F400.", 3),
    ],
)
def test_what_follows_the_part_in_its_own_way_is_refused_beside_it(text: str, line: int) -> None:
    with pytest.raises(ProgramError, match="only the origin follows the part") as refused:
        blocks.read(text.encode(), shipped("trunnion"), "p")
    assert refused.value.line == line


def test_a_rotary_that_carries_the_origin_off_does_not_turn_beside_a_contour() -> None:
    text = "G254\nG41 D1\nG1 X30. F500.\nY30.\nA10.\nG40 X0.\n"
    with pytest.raises(ProgramError) as refused:
        blocks.read(text.encode(), shipped("trunnion"), "p")
    assert refused.value.line == 5


@pytest.mark.parametrize("text", ["G54.2", "G54.2 P9", "G54.2 P-1", "G54.2 P2", "G254 P1"])
def test_a_vector_that_is_not_there_is_refused(text: str) -> None:
    machine = replace(shipped("trunnion"), unset=("G54.2 P2",))
    with pytest.raises(ProgramError):
        blocks.read(f"{text}\nG0 X1.\n".encode(), machine, "p")


def test_it_ends_with_the_program() -> None:
    machine = shipped("trunnion")
    note = InForce()
    list(blocks.stream(b"G0 A30.\nG254\nG0 X1.\nM30\n", machine, "p", in_force=note))
    assert note.last is not None and note.last.origins.following is None
