"""Lines that lead into surfaces and out of them (G64 P) are one motion with them, seen from the ticks."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree
from support.machines.stepped_runs import SHIPPED, cut, shipped
from support.oracles import tool_paths
from support.oracles.trace_limits import assert_in_limits
from support.parts.lines_beside_surfaces import part

from controller.program.program import ProgramError


def off(points: np.ndarray, way: np.ndarray) -> np.ndarray:
    """Distance (N,) of points (N, 3) from a polyline (M, 3) whose points may be any way apart."""
    way = way[np.concatenate([[True], np.linalg.norm(np.diff(way, axis=0), axis=1) > 1e-9])]
    _, near = cKDTree(way).query(points, k=12)
    found = np.full(len(points), np.inf)
    for column in (*near.T, *(near.T - 1)):
        k = np.clip(column, 0, len(way) - 2)
        chord, gap = way[k + 1] - way[k], points - way[k]
        share = np.clip((gap * chord).sum(axis=1) / (chord * chord).sum(axis=1), 0.0, 1.0)
        found = np.minimum(found, np.linalg.norm(gap - share[:, None] * chord, axis=1))
    return found


def run_one(seed: int) -> int:
    """How many of both ends of the surfaces are run through; 0 where the program was refused."""
    made, name = part(seed), SHIPPED[seed % len(SHIPPED)]
    try:
        done = cut(made.source, shipped(name, period_s=0.008))
    except ProgramError as refusal:
        assert "internal" not in refusal.sentence and len(refusal.sentence) > 40
        return 0
    assert done.run.result == "completed", (seed, name, done.run.fault_text)
    assert_in_limits(done, (seed, name))
    ids, numbers = done.column("motion_id").astype(int), list(done.segments)
    cuts = [i for i, segment in done.segments.items() if segment.cutting]
    beside = [
        numbers[numbers.index(cuts[0]) - 1],
        numbers[min(numbers.index(cuts[-1]) + 1, len(numbers) - 1)],
    ]
    through = [i for i in beside if done.segments[i].name == "line"]
    tips, _ = tool_paths.tool(done.joints, done.machine, 0.0)
    rows = np.isin(ids, [*through, *cuts])
    assert off(tips[rows], made.way).max() <= made.tolerance_mm, (seed, name)
    speed = done.column("feed_mm_s")
    for i in through:
        met = np.flatnonzero(ids == i)[-1] if i < cuts[0] else np.flatnonzero(ids == i)[0]
        assert speed[met - 1 : met + 2].min() > 0.05 * done.segments[cuts[0]].feed_mm_s, (seed, name, i)
    return len(through)


def test_lines_run_on_into_unseen_surfaces_and_out_of_them() -> None:
    assert run_one(4) + run_one(8) >= 3


@pytest.mark.slow
@pytest.mark.parametrize("batch", range(4))
def test_lines_run_on_into_many_unseen_surfaces(batch: int) -> None:
    assert sum(run_one(seed) for seed in range(20 * (batch + 1), 20 * (batch + 1) + 8)) >= 6
