"""ISO 230-2 on figures that were worked out by hand, and a table that takes off what was put in."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from controller.calibration import axis_accuracy, pictures
from controller.calibration.axis_accuracy import Runs
from controller.calibration.refusal import Refusal
from controller.machine import compensation, machine_file
from controller.machine.model import Pitch

TRUNNION = machine_file.load("trunnion")
# Two targets, two runs, um: means up 1, 4; down 3, 2; deviations of two runs d apart are d / sqrt(2).
UP, DOWN = np.array([[0.0, 2.0], [3.0, 5.0]]), np.array([[3.0, 3.0], [0.0, 4.0]])


def test_the_standards_figures_on_a_case_by_hand():
    found = axis_accuracy.accuracy(Runs(np.array([0.0, 100.0]), UP, DOWN))
    s = math.sqrt(2.0)  # of both targets going up; going down 0 and 2 sqrt 2
    assert found.reversal == pytest.approx(2.0) and found.mean_reversal == pytest.approx(0.0)
    assert found.repeatability_up == pytest.approx(4 * s) and found.repeatability_down == pytest.approx(8 * s)
    assert found.repeatability == pytest.approx(8 * s)  # 4 s down of the second; 2 s + 4 s + 2 is less
    assert (found.systematic_up, found.systematic_down) == pytest.approx((3.0, 1.0))
    assert found.systematic == pytest.approx(3.0) and found.mean_deviation == pytest.approx(1.0)
    assert found.accuracy_up == pytest.approx(3.0 + 4 * s)
    assert found.accuracy == pytest.approx((4 + 2 * s if 4 + 2 * s > 2 + 4 * s else 2 + 4 * s) - (2 - 4 * s))


def test_a_reversal_counts_in_the_repeatability_where_it_is_the_largest():
    quiet = Runs(np.array([0.0, 1.0]), np.array([[0.0, 0.2], [0.0, 0.2]]), np.array([[9.0, 9.2], [9.0, 9.2]]))
    s = 0.2 / math.sqrt(2.0)
    assert axis_accuracy.accuracy(quiet).repeatability == pytest.approx(4 * s + 9.0)


def test_one_sense_and_one_run_leave_out_what_needs_more():
    found = axis_accuracy.accuracy(Runs(np.array([0.0, 1.0]), UP[:, :1], None))
    assert found.systematic == 3.0
    assert found.reversal is found.repeatability is found.accuracy is found.mean_deviation is None


def table_of(rows) -> str:
    return "target,sense,measured\n" + "\n".join(f"{a},{b},{c:.9f}" for a, b, c in rows)


def measured(axis, real, runs=5, scatter=2e-4, seed=1):
    """As a laser would: the axis stands where ``real`` says, less what its own table takes off."""
    rng, found = np.random.default_rng(seed), compensation.deviation(axis)
    per = axis.shown_per_unit
    for target in np.linspace(-100.0, 100.0, 21):
        for sense in (1.0, -1.0):
            off = 0.0 if found is None else found.at(target / per, sense * np.sign(per)) * per
            for _ in range(runs):
                yield target, sense, target - off + real(target, sense) + rng.normal() * scatter


@pytest.mark.parametrize("name", ["X", "A"])
def test_what_was_put_in_comes_out_and_a_second_measurement_finds_next_to_nothing(name):
    index = [axis.name for axis in TRUNNION.axes].index(name)
    axis = TRUNNION.axes[index]

    def real(q, sense):
        return 0.008 * (math.sin(q / 40.0)) + (0.003 if sense < 0 else -0.003)

    for scatter in (2e-4, 1e-4):
        runs = axis_accuracy.read(table_of(measured(axis, real, scatter=scatter)), "laser.csv")
        told = axis_accuracy.report(runs, axis)
        table = axis_accuracy.table(runs, axis)
        at, up, down = (np.array(values) / axis.shown_per_unit for values in table.values())
        axis = replace(axis, pitch=Pitch(tuple(at), tuple(up), tuple(down)))
        if scatter == 2e-4:
            assert told["reversal"] == pytest.approx(6.0, abs=0.5)
            assert told["systematic"] == pytest.approx(22.0, abs=1.0)
    assert told["systematic"] < 1.0 and told["reversal"] < 0.5
    assert told["unit"] == ("um" if name == "X" else "mdeg")


WRONG = [
    ("target,measured\n1,1", "column sense"),
    ("target,sense,measured\n1,1,1", "one target only"),
    ("target,sense,measured\n1,1,1\n2,1,2\n2,1,2", "target 1 was approached 1 times"),
    ("target,sense,measured\n1,1,1\n2,1,x", "line 3, column measured"),
    ("target,sense,measured\r1,1,1\r2,1,x", "line 3, column measured"),
]


@pytest.mark.parametrize(("text", "what"), WRONG)
def test_a_table_that_is_none_is_refused(text, what):
    with pytest.raises(Refusal, match=what):
        axis_accuracy.read(text, "laser.csv")


def test_a_picture_is_drawn(tmp_path):
    pictures.axis(Runs(np.array([0.0, 100.0]), UP, DOWN), "X", "mm", tmp_path / "x.png")
    assert (tmp_path / "x.png").read_bytes()[:4] == b"\x89PNG"
