"""``directrix explain``: what each line asks for, against values written by hand."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest
from support.machines.traced_programs import HOME, mill
from typer.testing import CliRunner

from controller.__main__ import app
from controller.geometry.vectors import Frame, X, Y, Z, rotate
from controller.machine.model import Machine
from controller.plan.report import explained
from controller.plan.report.explained import Step
from controller.program import blocks


def steps(text: str, on: Machine | None = None) -> list[Step]:
    on = on or mill()
    read = blocks.stream(text.encode(), on, "p.ngc", start=HOME)
    return list(explained.steps(read, on, "p.ngc", HOME))


def only(text: str, on: Machine | None = None) -> Step:
    return steps(text, on)[-1]


def shifted() -> Machine:
    """G54 at (10, 20, 30), G55 turned by 90 degrees about Z at (1, 2, 3)."""
    turned = Frame((1.0, 2.0, 3.0), *(rotate(Z, math.pi / 2.0, v) for v in (X, Y, Z)))
    offsets = list(mill().offsets)
    offsets[:2] = [Frame((10.0, 20.0, 30.0)), turned]
    return replace(mill(), offsets=tuple(offsets), unset=())


@pytest.mark.parametrize(
    ("text", "program", "axes"),
    [
        ("G0 X1. Y2.", (1.0, 2.0, 170.0, 0.0, 0.0), (11.0, 22.0, 200.0, 0.0, 0.0)),
        ("G0 X1. Y2.\nG91 X1. C30.", (2.0, 2.0, 170.0, 0.0, 30.0), (12.0, 22.0, 200.0, 0.0, 30.0)),
        ("G20 G0 X1. A30.", (25.4, -20.0, 170.0, 30.0, 0.0), (35.4, 0.0, 200.0, 30.0, 0.0)),
        ("G53 G0 X1. Z5.", (-9.0, -20.0, -25.0, 0.0, 0.0), (1.0, 0.0, 5.0, 0.0, 0.0)),
        ("G55 G0 X1. Y2. Z4.", (1.0, 2.0, 4.0, 0.0, 0.0), (-1.0, 3.0, 7.0, 0.0, 0.0)),
        ("G0 X0. Y0. Z0.\nG55", (0.0, 0.0, 0.0, 0.0, 0.0), (10.0, 20.0, 30.0, 0.0, 0.0)),
        ("G0 X0. Y0. Z0.\nG55 G91 X1.", (19.0, -9.0, 27.0, 0.0, 0.0), (10.0, 21.0, 30.0, 0.0, 0.0)),
    ],
)
def test_positions_in_program_coordinates_and_of_the_axes(
    text: str, program: tuple[float, ...], axes: tuple[float, ...]
) -> None:
    step = only(text, shifted())
    assert tuple(step.program[name] or 0.0 for name in "XYZAC") == pytest.approx(program)
    assert tuple(step.axes[name] or 0.0 for name in "XYZAC") == pytest.approx(axes)


@pytest.mark.parametrize(
    ("text", "feed", "unit"),
    [
        ("G1 X1. F100", 100.0, "mm/min"),
        ("G20 G1 X1. F10", 254.0, "mm/min"),
        ("G20 G1 C90. F10", 10.0, "deg/min"),
        ("G20 G1 X0 C90. F10", 10.0, "deg/min"),  # X does not move: what counts is what moves
        ("G20 G1 X1. C90. F10", 254.0, "mm/min"),
        ("G93 G1 X1. F2", 30.0, "s"),
    ],
)
def test_the_feed_and_its_unit(text: str, feed: float, unit: str) -> None:
    step = only("G0 X0 Y0\n" + text)
    assert (step.facts["feed"], step.facts["unit"]) == (pytest.approx(feed), unit)


def test_an_arc_tells_plane_centre_sense_and_turns() -> None:
    arc = only("G0 X10. Z0\nG18 G2 X0. Z10. R10. P3 F50", shifted())
    assert (arc.kind, arc.plane, arc.facts["clockwise"], arc.facts["turns"]) == ("arc", "G18", True, 3)
    # The axes of G18 are Z, then X: from X to Z is clockwise, and the short way is about the origin.
    assert arc.facts["centre"] == {"X": pytest.approx(0.0), "Z": pytest.approx(0.0)}


def test_what_the_path_chooses_is_not_known_until_the_program_says_it() -> None:
    cone = "G51 X0. Y15. Z0. I0. J0. K0. H10. R10. D90. F100.\n"
    surface, partly, whole = steps(cone + "G0 X1. Z50.\nG0 Y2. A0 C0\n")
    assert surface.program == {"X": pytest.approx(-15.0), "Y": pytest.approx(0.0), "Z": 0.0}
    assert set(surface.axes.values()) == {None}
    assert (partly.axes["X"], partly.axes["Y"], partly.axes["A"]) == (9.0, None, None)
    assert None not in whole.axes.values()


def test_functions_of_the_machine_stand_in_their_order() -> None:
    found = steps("T2 M6\nM3 S500\nM8\nG4 P2\nG52 X0 Y0\nM1\nM30\n")
    assert [step.kind for step in found] == [
        *("tool", "spindle", "coolant", "dwell", "message", "optional stop", "end"),
    ]
    assert (
        found[0].facts["tool"] == 2
        and found[1].facts["rev_min"] == 500.0
        and found[3].facts["seconds"] == 2.0
    )


def test_the_command_prints_a_line_for_each_and_with_json_an_object(tmp_path: Path) -> None:
    file = tmp_path / "p.ngc"
    file.write_text("G0 X1.\nG1 Y2. F100\n")
    told = CliRunner().invoke(app, ["explain", str(file)])
    assert told.exit_code == 0 and len(told.output.splitlines()) == 2
    told = CliRunner().invoke(app, ["explain", "--json", str(file)])
    rows = [json.loads(line) for line in told.output.splitlines()]
    assert [(row["kind"], row["program"]["X"]) for row in rows] == [("rapid", 1.0), ("line", 1.0)]
    file.write_text("G0 X1.\nG1234\n")
    told = CliRunner().invoke(app, ["explain", "--json", str(file)])
    assert told.exit_code == 1 and json.loads(told.output.splitlines()[-1])["line"] == 2


@pytest.mark.parametrize(
    ("cycle", "kind"),
    [("G81 X5 Z-3 R1", "drill"), ("G83 X5 Z-3 Q1 R1", "drill"), ("G1 X5 Z-3", "line")],
)
def test_a_stroke_into_a_hole_is_named_as_what_it_does(cycle: str, kind: str) -> None:
    found = steps(f"G21 G90 S500 M3\nG0 Z5\n{cycle} F100\nG80\nG1 X9 F100\n")
    fed = [step.kind for step in found if step.facts.get("feed")]
    assert fed[-1] == "line" and set(fed[:-1]) == {kind}
