"""Circles by ISO 230-4 and a tip that should stand, on paths that were made up and on ones that were cut."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from typer.testing import CliRunner

from controller.__main__ import app
from controller.calibration import circular_test
from controller.calibration.refusal import Refusal

N, R = 4000, 50.0


def circle(sense, off=lambda turn: 0.0 * turn, shift=(0.0, 0.0)):
    turn = sense * np.linspace(0.0, 2.0 * math.pi, N)
    nominal = np.column_stack([np.cos(turn), np.sin(turn)])
    return R * nominal, (R + off(turn))[:, None] * nominal + np.array(shift)


def found(*parts):
    command, actual = (np.vstack([part[k] for part in parts]) for k in (0, 1))
    lines = np.repeat(np.arange(10, 10 + len(parts)), N)
    return list(circular_test.circles(command, actual, lines))


def test_a_path_that_is_a_circle_deviates_by_nothing_wherever_its_centre_is():
    told = circular_test.report(
        found(circle(1, shift=(0.02, -0.01)), circle(-1, shift=(0.02, -0.01))), ("X", "Y")
    )
    assert told["clockwise"]["G_um"] < 0.05 and told["G_bidirectional_um"] < 0.05 and told["H_um"] < 0.05
    assert told["clockwise"]["F_max_um"] == pytest.approx(1e3 * math.hypot(0.02, 0.01), abs=0.1)


def test_an_ellipse_deviates_by_the_range_of_its_radius():
    told = circular_test.report(found(circle(1, lambda turn: 0.004 * np.cos(2 * turn))), ("X", "Y"))
    assert told["counter_clockwise"]["G_um"] == pytest.approx(8.0, abs=0.05)
    assert "H_um" not in told


def test_a_three_lobed_path_and_one_off_centre_are_told_apart_by_the_least_zone():
    told = circular_test.report(
        found(circle(1, lambda t: 0.005 * np.cos(t) + 0.001 * np.cos(3 * t))), ("X", "Y")
    )
    assert told["counter_clockwise"]["G_um"] == pytest.approx(2.0, abs=0.05)


def test_hysteresis_is_what_lies_between_the_senses():
    both = found(circle(1, lambda turn: 0.0 * turn + 0.002), circle(-1, lambda turn: 0.0 * turn - 0.001))
    told = circular_test.report(both, ("X", "Y"))
    assert told["H_um"] == pytest.approx(3.0, abs=0.01) and told["G_bidirectional_um"] == pytest.approx(
        3.0, abs=0.05
    )


def test_a_line_and_half_a_circle_are_no_circles():
    half = tuple(part[: N // 2] for part in circle(1))
    lines = np.full(N // 2, 3)
    assert not list(circular_test.circles(*half, lines))
    with pytest.raises(Refusal, match="no full circle"):
        circular_test.report([], ("X", "Y"))


def simulated(tmp_path, text):
    program, trace = tmp_path / "own.ngc", tmp_path / "own.npz"
    program.write_text(text)
    done = CliRunner().invoke(app, ["simulate", str(program), "--trace", str(trace)])
    assert done.exit_code == 0, done.output
    return trace


def run(*words):
    done = CliRunner().invoke(app, ["calibrate", *map(str, words)])
    return done.exit_code, done.stdout


def test_circles_of_a_simulated_machine_are_measured_and_drawn(tmp_path):
    text = "G21 G90 S1000 M3\nG1 X30 Y0 Z100 F3000\nG3 I-30 J0 F2000\nG2 I-30 J0 F2000\nM2\n"
    trace, picture = simulated(tmp_path, text), tmp_path / "circle.png"
    code, out = run("circle", trace, "--plot", picture, "--json")
    told = json.loads(out)
    assert code == 0 and told["radius_mm"] == pytest.approx(30.0, abs=1e-3)
    assert told["clockwise"]["line"] == 4 and 0.0 < told["clockwise"]["G_um"] < 50.0
    assert told["H_um"] < 50.0 and picture.read_bytes()[:4] == b"\x89PNG"
    assert run("circle", trace, "--axes", "XQ")[0] == 1
    assert "Hysterese" in run("circle", trace, "--language", "de")[1]


def test_a_tip_that_should_stand_is_measured_and_drawn(tmp_path):
    text = "G21 G90 S1000 M3\nG43.4 H1\nG1 X0 Y0 Z20 A0 C0 F3000\nG1 X0 Y0 Z20 A30 C90 F1000\nG49\nM2\n"
    trace, picture = simulated(tmp_path, text), tmp_path / "tip.png"
    code, out = run("tip", trace, "--plot", picture, "--json")
    told = json.loads(out)
    assert code == 0, out
    assert [row["line"] for row in told["lines"]] == [4]
    assert 0.0 < told["largest_um"] < 200.0 and picture.read_bytes()[:4] == b"\x89PNG"
