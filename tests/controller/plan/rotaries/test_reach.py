"""The limit of what the rotaries reach: told with its place, and nowhere else."""

from __future__ import annotations

import math

import numpy as np
import pytest
from support.machines.shipped_kinds import machine
from support.machines.traced_programs import assert_whole, mill, trace

from controller.machine.kinematics import kinematics_of
from controller.program.program import ProgramError

AT_LIMIT = "comes to the limit of what the rotary axes reach"


def wall(rise: list[float]) -> str:
    """A wall whose upper control points stand so much over the lower ones, 10 mm beside them."""
    upper = [f"X{5 * k + k}.0 Y10.0 Z{z:.9f}" for k, z in enumerate(rise)]
    lower = [f"X{5 * k}.0 Y0.0 Z0.0" for k in range(4)]
    return "\n".join(["T1 M6", "G42", f"G52 {upper[0]} F600.", *upper[1:], *lower, "G40", ""])


def touching(at: float, above: float = 0.0) -> list[float]:
    """Control values of 4 (u - at)^2 + above."""
    a, b, c = 4.0 * at * at + above, -8.0 * at, 4.0
    return [a, a + b / 3.0, a + 2.0 * b / 3.0 + c / 3.0, a + b + c]


@pytest.mark.parametrize("at", [0.0, 0.3, 0.5, 0.5017, 0.987, 1.0])
def test_a_ruling_that_lies_down_where_the_head_tilts_no_further_is_refused_there(at: float) -> None:
    with pytest.raises(ProgramError, match=f"{AT_LIMIT}.* at u = {at:.4f}"):
        trace(wall(touching(at)), mill("oblique"))


def test_a_wall_that_lies_all_along_is_refused() -> None:
    with pytest.raises(ProgramError, match=AT_LIMIT):
        trace(wall([0.0] * 4), mill("oblique"))


def test_beyond_the_limit_there_is_no_position() -> None:
    with pytest.raises(ProgramError, match="no position of the rotary axes gives this tool axis"):
        trace(wall([1.0, -0.5, -0.5, 1.0]), mill("oblique"))


def test_a_wall_that_keeps_off_the_limit_is_followed() -> None:
    built = mill("oblique")
    assert_whole(trace(wall(touching(0.5, 12.0)), built), built)
    with pytest.raises(ProgramError, match="beyond its travel"):  # of this machine
        trace(wall(touching(0.5, 0.2)), built)


@pytest.mark.parametrize("kind", ["oblique", "fig4a", "table_head", "head_head"])
def test_how_far_the_limit_is_is_how_far_both_branches_are_from_where_they_meet(kind: str) -> None:
    kinematics = kinematics_of(machine(kind))
    axes = np.random.default_rng(5).normal(size=(3, 400))
    axes[2] = np.abs(axes[2])
    x, y, z = axes / np.sqrt((axes * axes).sum(axis=0))
    one, other = kinematics.branches((x, y, z), np)
    half = 0.5 * (one[kinematics.work] - other[kinematics.work])
    known = ~np.isnan(half)
    off = kinematics.off_limit((x, y, z))
    np.testing.assert_allclose(off[known], np.abs(np.sin(half))[known], atol=1e-7)
    assert np.all(off[~known] == 0.0)
    assert kinematics.is_bounded == (kind == "oblique")
    assert kinematics.is_bounded or math.isclose(off.min(), 1.0)
