"""Blades whose normal turns by 90 degrees and more: placed off the ruling, held against brute force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.machines.stepped_runs import shipped
from support.machines.traced_programs import segments, trace
from support.parts.twisted_blades import blade, normal_turns_deg, off_by_brute_force, program

from controller.geometry.placement import Placed, Strategy
from controller.machine.model import Machine, Tool
from controller.plan.surfaces.placing import Cutter, place
from controller.program.program import ProgramError

# Largest deviation (um, ends included) of blade ``seed``. A search over short windows of rulings that
# shares nothing with the planner's (cubics of two crossings of the axis with planes, linear programs,
# many starts) reaches 53, 92 to 115, 80 to 97, 98, 26 to 30, 140 to 158 there.
MAX_UM = {0: 62.0, 1: 108.0, 2: 93.0, 3: 103.0, 4: 31.0, 5: 160.0}


def machine(radius: float, gouge: str = "warn") -> Machine:
    """The shipped trunnion with a cutter of that radius as T50."""
    tool = Tool(50, "end mill", abs(radius), 60.0, 70.0)
    made = shipped(gouge=gouge)
    return replace(made, tools=(*made.tools, tool))


@pytest.mark.parametrize(
    "seed", [4, *(pytest.param(seed, marks=pytest.mark.slow) for seed in MAX_UM if seed != 4)]
)
def test_a_blade_is_cut_as_well_as_an_independent_search_can_with_its_ends(seed: int) -> None:
    surface, radius = blade(seed)
    assert normal_turns_deg(surface).max() > 90.0
    placed = place(surface, Cutter(radius, 0.0, 0.0), Strategy.OPTIMAL)
    assert isinstance(placed, Placed)
    off = off_by_brute_force(surface, placed, radius)
    print(f"seed {seed}, r {radius}: {1e3 * off.min():.1f} to {1e3 * off.max():.1f} um")
    assert 1e3 * np.abs(off).max() < MAX_UM[seed]


def test_the_tool_goes_steadily_over_a_blade() -> None:
    """The lower point runs over both ends, but never back; the axis turns without a jerk of its own."""
    surface, radius = blade(4)
    placed = place(surface, Cutter(radius, 0.0, 0.0), Strategy.OPTIMAL)
    u = np.linspace(0.0, 1.0, 401)
    pose = placed.pose(u, radius, np)
    tips, axes = np.array(pose.tip), np.array(pose.axis)
    step, way = np.diff(tips, axis=1), np.array(surface.lower.derivative(u[:-1], 1, np))
    assert ((step * way).sum(axis=0) > 0.0).all()
    turn = np.linalg.norm(np.diff(axes, axis=1), axis=0)
    assert turn.max() < 4.0 * np.median(turn) + 1e-4


@pytest.mark.parametrize(("placement", "own"), [(1, "single"), (2, "double")])
def test_a_placement_that_stays_with_the_ruling_is_refused_with_its_figure_and_the_best(
    placement: int, own: str
) -> None:
    surface, radius = blade(4)
    with pytest.raises(ProgramError) as refused:
        trace(program(surface, 50, radius, placement), machine(radius))
    told = str(refused.value)
    turn = normal_turns_deg(surface, 2001).max()
    assert f"turns by {turn:.1f} degrees" in told and "write P3 (optimal) or P4 (auto)" in told
    best = np.abs(
        off_by_brute_force(surface, place(surface, Cutter(radius, 0.0, 0.0), Strategy.OPTIMAL), radius)
    )
    assert f"({own} would be " in told
    stated = float(told.split("optimal ")[-1].split(" mm")[0])
    assert stated == pytest.approx(best[2:-2].max(), abs=2e-3)


def test_a_placement_that_would_be_refused_as_well_is_not_advised() -> None:
    surface, radius = blade(4)
    text = program(surface, 50, radius, 1).replace("P1", "P1 R0.002")
    with pytest.raises(ProgramError, match=r"none was found that is less than 0\.0\d\d mm off") as refused:
        trace(text, machine(radius))
    told = str(refused.value)
    assert "the form tolerance is 0.002 mm" in told and "a thinner cutter" in told and "P3" not in told


@pytest.mark.parametrize("placement", [3, 4])
def test_a_blade_is_planned_with_a_lead_that_stays_off_its_surface(placement: int) -> None:
    surface, radius = blade(4)
    text = program(surface, 50, radius, placement).replace(f"P{placement}", f"P{placement} R0.05")
    found = [one for one in segments(trace(text, machine(radius, "refuse"))) if one.cutting]
    (cut,) = found
    assert isinstance(cut.motion.surface, Placed) and cut.motion.surface.through is not None
