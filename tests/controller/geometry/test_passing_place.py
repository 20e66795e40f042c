"""The nearest place of a sampled path, beside one look at every chord for itself."""

from __future__ import annotations

import numpy as np
import pytest

from controller.geometry.passing_place import passing


def by_each_chord(path: np.ndarray, point: np.ndarray, row: int, back: int, ahead: int) -> float:
    """The distance of a point to the chords that count."""
    best = np.inf
    for k in range(max(0, row - back), min(len(path) - 1, row + ahead) + 1):
        begin, end = path[k], path[min(k + 1, len(path) - 1)]
        chord = end - begin
        length = float(chord @ chord)
        share = min(1.0, max(0.0, float((point - begin) @ chord) / length)) if length > 0.0 else 0.0
        best = min(best, float(np.linalg.norm(point - begin - share * chord)))
    return best


@pytest.mark.parametrize("seed", range(8))
def test_it_is_what_each_chord_for_itself_gives(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n, m, back, ahead = 700, int(rng.integers(1, 600)), int(rng.integers(1, 60)), int(rng.integers(-1, 3))
    path = np.cumsum(rng.normal(size=(n, 3)), axis=0)
    stand = int(rng.integers(0, n - 50))
    path[stand : stand + 40] = path[stand]
    points = path[n - m :] + 0.3 * rng.normal(size=(m, 3))
    found = passing(path, points, back, ahead)
    wanted = [by_each_chord(path, points[k], n - m + k, back, ahead) for k in range(m)]
    np.testing.assert_allclose(found.distance, wanted, atol=1e-9)
    row = found.place.astype(int)
    after = path[np.minimum(row + 1, n - 1)]
    there = path[row] + (found.place - row)[:, None] * (after - path[row])
    np.testing.assert_allclose(np.linalg.norm(points - there, axis=1), found.distance, atol=1e-9)


def test_where_a_path_comes_by_twice_only_what_is_recent_counts() -> None:
    x = np.concatenate([np.arange(50.0), np.arange(49.0, -1.0, -1.0)])
    path = np.stack([x, np.zeros_like(x), np.zeros_like(x)], axis=1)
    found = passing(path, np.array([[10.0, 0.0, 0.0]]), 20, -1)
    assert found.distance[0] == 0.0 and found.place[0] == pytest.approx(89.0)
    assert passing(path, np.array([[40.0, 0.0, 0.0]]), 5, -1).distance[0] == pytest.approx(35.0)


def test_a_path_of_one_place() -> None:
    found = passing(np.zeros((1, 3)), np.array([[3.0, 4.0, 0.0]]), 10, -1)
    assert found.place[0] == 0.0 and found.distance[0] == 5.0
