"""Lines and arcs run on into surfaces and out of them under G64 P, within its tolerance."""

from __future__ import annotations

import numpy as np
import pytest
from support.machines.stepped_runs import shipped
from support.machines.traced_programs import (
    HOME,
    assert_goes_on,
    assert_whole,
    mill,
    named,
    names,
    sentences,
    trace,
)

from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine
from controller.plan.path import path
from controller.plan.segment import ContinuousPath, Path, PathItem
from controller.program import blocks
from controller.program.program import ProgramError

HEAD = "G21 G90 G54 {path}\nT2 M6\nS12000 M3\nG0 X-10. Y-10.\nG1 Z0. F3000.\n"


def wall(x_mm: float = 0.0, length_mm: float = 20.0) -> str:
    """An upright wall along X, cut on its right side."""
    lower = np.array([[x_mm + length_mm * k / 3.0, 0.0, 0.0] for k in range(4)])
    rows = [
        " ".join(f"{a}{v:.9f}" for a, v in zip("XYZ", p, strict=True))
        for p in (*(lower + np.array([0.0, 0.0, 10.0])), *lower)
    ]
    return "\n".join(["G42 R1.", f"G52 {rows[0]} F1200.", *rows[1:], "G40", ""])


def traced(before: str, after: str, control: str = "G64 P0.01") -> tuple[Path, Machine]:
    machine = shipped()
    home = tuple(axis.homing.position for axis in machine.axes)
    text = HEAD.format(path=control) + before + wall() + after + "G0 Z60.\nM5\nM30\n"
    found = trace(text, machine, home)  # type: ignore[arg-type]
    assert_whole(found, machine, home)  # type: ignore[arg-type]
    return found, machine


STRAIGHT = "G1 X-8. Y-1.5 F1500.\nG1 X0.\n"
ANGLED = "G1 X-8. Y-8. F1500.\nG1 X0. Y-1.5\n"
ROUND = "G1 X-6. Y-7.5 F1500.\nG2 X0. Y-1.5 I6. J0.\n"
NEARLY = "G1 X-8. Y-1.5 F1500.\nG1 X0.003 Y-1.503\n"


@pytest.mark.parametrize("before", [STRAIGHT, ANGLED, ROUND, NEARLY])
@pytest.mark.parametrize(
    "after", ["G1 X30. F1500.\n", "G1 X30. Y-9. F1500.\n", "G2 X26. Y-7.5 I0. J-6. F1500.\n"]
)
def test_a_row_runs_on_into_a_surface_and_out_of_it(before: str, after: str) -> None:
    found, machine = traced(before, after)
    (chain,) = [row for row in names(found) if "cut" in row]
    assert chain[-3:] == ["line", "cut", "line"] and not named(found, "lead in") + named(found, "plunge")
    (cut,) = named(found, "cut")
    lines = named(found, "line")
    assert_goes_on(next(one for one in lines if one.end == cut.start), cut, machine)
    assert_goes_on(cut, next(one for one in lines if one.start == cut.end), machine)
    assert sentences(found).count("within the joint tolerance") == 2


def test_lines_between_two_surfaces_are_one_path_with_both() -> None:
    found, machine = traced(STRAIGHT, "G1 X26. Y-1.5 F1500.\n" + wall(26.0) + "G1 X60. F1500.\n")
    (chain,) = [row for row in names(found) if "cut" in row]
    assert chain[-5:] == ["line", "cut", "line", "cut", "line"]
    first, second = named(found, "cut")
    (between,) = [one for one in named(found, "line") if one.start == first.end]
    assert_goes_on(first, between, machine)
    assert_goes_on(between, second, machine)


@pytest.mark.parametrize(
    ("before", "control"),
    [
        (STRAIGHT, "G61"),
        (STRAIGHT, "G64"),
        ("G1 X-8. Y-1.5 F1500.\nG1 X0. Y-1.52\n", "G64 P0.01"),  # elsewhere
        ("G1 X8. Y-1.5 F1500.\nG1 X0.\n", "G64 P0.01"),  # it would turn straight back
    ],
)
def test_elsewhere_a_surface_has_its_own_approach(before: str, control: str) -> None:
    found, _ = traced(before, "", control)
    assert named(found, "plunge") and named(found, "lead in") and named(found, "lift")


@pytest.mark.parametrize(
    ("after", "why"),
    [
        ("G1 X30. Y9. F1500.\n", "the flank would get 0.4"),  # into the surface
        ("G1 X0. F1500.\n", "turns there by 180.00 degrees"),
        ("G1 X20.01 F1500.\nG1 Y-9.\n", "too short"),
    ],
)
def test_a_line_that_no_cut_can_run_on_into_comes_behind_a_departure_that_is_told(
    after: str, why: str
) -> None:
    found, _ = traced(STRAIGHT, after)
    assert named(found, "lead out") and named(found, "lift")
    (told,) = [one.sentence for one in found.notes if "Does not run on" in one.sentence]
    assert why in told and "of line 9" in told


def test_where_no_blend_is_asked_for_none_is_missed() -> None:
    found, _ = traced(STRAIGHT, "G61\nG1 X30. F1500.\n")
    assert named(found, "lead out") and "Does not run on" not in sentences(found)


def test_a_refused_surface_comes_behind_the_row_before_it() -> None:
    machine = mill()
    broken = wall().replace("Z10.000000000", "Z0.000000000")
    text = "G21 G90 G54 G64 P0.01\nT2 M6\nG1 X-8. Y-1.5 Z90. F1500.\nG1 X0.\n" + broken
    made = blocks.read(text.encode(), machine, "part.ngc").blocks
    found = list[PathItem]()
    with pytest.raises(ProgramError, match="coincide"):
        for item in path.stream(made, "part.ngc", machine, kinematics_of(machine), HOME):
            found.append(item)
    assert [s.name for item in found if isinstance(item, ContinuousPath) for s in item.segments][-1] == "line"
