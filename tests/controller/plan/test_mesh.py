"""Meshes: even counting, ends exact, and derivatives that agree with differences of s(x)."""

from __future__ import annotations

import random

import numpy as np
import pytest

from controller.plan import mesh
from controller.plan.mesh import Bell


def random_mesh(seed: int) -> tuple[mesh.Places, float]:
    rng = random.Random(seed)
    length = 10.0 ** rng.uniform(0.0, 2.0)
    ramps = [rng.choice((None, length * 10.0 ** rng.uniform(-4.0, 0.3))) for _ in range(2)]
    bells = [
        Bell(rng.uniform(0.1, 0.9) * length, length * rng.uniform(0.003, 0.2))
        for _ in range(rng.randrange(3))
    ]
    return mesh.make(length, length / rng.uniform(60, 400), ramps[0], ramps[1], bells).nodes, length


@pytest.mark.parametrize("seed", range(20))
def test_nodes_rise_strictly_from_nought_to_the_whole_length(seed: int) -> None:
    made, length = random_mesh(seed)
    assert made.s[0] == 0.0 and made.s[-1] == length, seed
    assert (np.diff(made.s) > 0.0).all(), seed


@pytest.mark.parametrize("seed", range(20))
def test_derivatives_are_those_of_the_map(seed: int) -> None:
    """On a mesh with far more nodes differences are accurate: compare there, away from the rests."""
    made, _ = random_mesh(seed)
    n = len(made.s)
    inner = slice(n // 4, 3 * n // 4)
    x = np.arange(n, dtype=float)

    def difference(f: np.ndarray) -> np.ndarray:
        fourth = (f[:-4] - 8.0 * f[1:-3] + 8.0 * f[3:-1] - f[4:]) / 12.0
        return np.interp(x, x[2:-2], fourth)

    for lower, upper in ((made.s, made.s_x), (made.s_x, made.s_xx), (made.s_xx, made.s_xxx)):
        wanted, found = difference(lower)[inner], upper[inner]
        scale = np.abs(upper[inner]).max() + 1e-6 * np.abs(lower[inner]).max()
        assert np.abs(found - wanted).max() <= 0.05 * scale, seed


@pytest.mark.parametrize("ramp", [1e-3, 0.1, 5.0])
def test_a_rest_is_left_as_the_cube_of_x(ramp: float) -> None:
    made = mesh.make(100.0, 1.0, ramp, None, ()).nodes
    assert made.s_x[0] == made.s_xx[0] == 0.0
    assert made.s[1] == pytest.approx(made.s_xxx[0] / 6.0, rel=0.02)
    assert made.s[2] == pytest.approx(8.0 * made.s_xxx[0] / 6.0, rel=0.05)


@pytest.mark.parametrize("ramp", [1e-4, 1e-2, 1.0, 30.0])
def test_a_ramp_has_tens_of_nodes_however_long_the_block(ramp: float) -> None:
    for length in (100.0, 10000.0):
        made = mesh.make(length, length / 60, ramp, ramp, ()).nodes
        assert np.count_nonzero(made.s <= ramp) >= 15
        assert np.count_nonzero(made.s >= length - ramp) >= 15
        assert len(made.s) < 1000


def test_a_bell_gathers_nodes_about_its_place() -> None:
    made = mesh.make(100.0, 1.0, None, None, [Bell(40.0, 0.1)]).nodes
    near = np.abs(made.s - 40.0)
    assert np.count_nonzero(near < 0.1) >= mesh.BELL_NODES / 3
    assert np.count_nonzero((made.s > 60.0) & (made.s < 70.0)) <= 12


def test_both_ends_are_treated_alike() -> None:
    made = mesh.make(50.0, 0.5, 1.0, 1.0, ()).nodes
    np.testing.assert_allclose(made.s, 50.0 - made.s[::-1], atol=1e-9)
    np.testing.assert_allclose(made.s_xx, -made.s_xx[::-1], atol=1e-6)


@pytest.mark.parametrize("ramp", [None, 0.5])
def test_the_joints_of_a_mesh_lie_between_its_nodes_and_on_its_ends(ramp: float | None) -> None:
    made = mesh.make(30.0, 0.5, ramp, ramp, [Bell(10.0, 1.0)])
    nodes, joints = made.nodes.s, made.joints.s
    assert len(joints) == len(nodes) + 1
    assert joints[0] == 0.0 and joints[-1] == 30.0
    assert (nodes[:-1] < joints[1:-1]).all() and (joints[1:-1] < nodes[1:]).all()


def test_a_mesh_moved_along_keeps_its_shape() -> None:
    made = mesh.make(30.0, 0.5, 1.0, None, ())
    moved = made.moved(12.0)
    np.testing.assert_allclose(moved.nodes.s, made.nodes.s + 12.0)
    assert moved.nodes.s_x is made.nodes.s_x
