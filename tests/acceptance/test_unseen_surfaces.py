"""Compound surfaces that nobody has looked at, on any shipped machine, at any feed."""

from __future__ import annotations

import random

import numpy as np
import pytest
from support.machines.stepped_runs import SHIPPED, cut, largest, shipped
from support.oracles import ruled_surfaces
from support.parts.random_surfaces import compound, text

from controller.program.program import ProgramError


def run_one(seed: int) -> bool:
    """False where the program was refused (a concave side tighter than the cutter, say)."""
    rng = random.Random(1000 + seed)
    feed, name = 10.0 ** rng.uniform(1.7, 4.2), rng.choice(SHIPPED)
    surfaces = compound(seed, rng.choice((1, 2, 2, 3)))
    try:
        done = cut(text(surfaces, feed), shipped(name))
    except ProgramError:
        return False
    assert done.run.result == "completed", (seed, name, feed, done.run.fault_text)
    first, second, third = largest(done.joints, done.machine)
    print(f"\nseed {seed}, {name}, {feed:.0f} mm/min: {first:.4f} {second:.4f} {third:.4f}")
    assert first <= 1.0005 and second <= 1.002 and third <= 1.02, (seed, name, feed, first, second, third)
    ids = done.column("motion_id").astype(int)
    cutting = done.trace.cutting
    for k, (upper, lower) in zip(dict.fromkeys(ids[cutting]), surfaces, strict=True):
        here, surface = np.flatnonzero((ids == k) & cutting), ruled_surfaces.Ruled(upper, lower)
        u = surface.nearest(done.trace.contact[here], done.trace.u[here])
        assert np.abs(u - done.trace.u[here]).max() < 1e-6, seed
        assert np.linalg.norm(surface.tip(u, 1.5) - done.trace.tool_tip[here], axis=1).max() < 1e-6, seed
        off = np.linalg.norm(np.cross(surface.axis(u), done.trace.tool_axis[here]), axis=1)
        assert np.degrees(off).max() < 1e-6, seed
        arc = np.diff(surface.s_at(u))
        assert arc.max() <= feed / 60.0 * 0.002 * (1.0 + 1e-3), seed
    return True


def test_an_unseen_surface_keeps_all_limits_and_stays_exact() -> None:
    assert run_one(139)


@pytest.mark.slow
@pytest.mark.parametrize("number", range(20))
def test_many_unseen_surfaces_keep_all_limits_and_stay_exact(number: int) -> None:
    """The first of these seeds that is not refused."""
    assert any(run_one(seed) for seed in range(200 + 50 * number, 250 + 50 * number))
