"""Band systems against numpy's dense solver, and what their import costs."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from controller.plan import banded


@pytest.mark.parametrize("above", [1, 2, 3])
@pytest.mark.parametrize("shape", [(9,), (9, 5)])
def test_a_band_system_has_the_dense_solution(above: int, shape: tuple[int, ...]) -> None:
    random = np.random.default_rng(above)
    matrix = 4.0 * np.eye(9)
    band = np.zeros((above + 1, 9))
    band[above] = 4.0
    for off in range(1, above + 1):
        values = random.uniform(-0.5, 0.5, 9 - off)
        matrix += np.diag(values, off) + np.diag(values, -off)
        band[above - off, off:] = values
    right = random.normal(size=shape)
    given = band.copy(), right.copy()
    assert banded.solve(band, right) == pytest.approx(np.linalg.solve(matrix, right), rel=1e-13, abs=1e-13)
    assert (band == given[0]).all() and (right == given[1]).all()


def test_a_matrix_that_is_not_positive_definite_is_refused() -> None:
    with pytest.raises(np.linalg.LinAlgError, match="positive definite"):
        banded.solve(np.array([[0.0, 3.0], [1.0, 1.0]]), np.ones(2))


def test_a_command_that_plans_starts_without_the_rest_of_scipy() -> None:
    script = "import sys, controller.plan.planner; print(set(sys.modules) & {'scipy', 'scipy.linalg'})"
    found = subprocess.run((sys.executable, "-c", script), capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "set()"
