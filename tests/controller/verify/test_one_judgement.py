"""``check``, ``verify`` and ``fit`` judge one program alike: whatever surface, and whatever tool."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from support.parts import random_cutters, random_nurbs, random_surfaces

from controller.cli import verify
from controller.geometry.placement import Strategy
from controller.machine import machine_file
from controller.machine.model import Tool
from controller.plan.surfaces import cuts
from controller.program.program import CutBlock, ProgramError
from controller.runtime import checked
from controller.verify import fits

QUICK = (1, 12)


@pytest.mark.parametrize(
    "seed", [pytest.param(k, marks=() if k in QUICK else pytest.mark.slow) for k in range(60)]
)
def test_check_verify_and_fit_say_the_same(seed: int, tmp_path) -> None:  # type: ignore[no-untyped-def]
    text, machine = random_cutters.drawn(seed)
    task = checked.task(text.encode(), "drawn.ngc", machine)
    try:
        _, stored, _ = checked.check(task, tmp_path)
    except ProgramError:
        with pytest.raises(ProgramError):
            verify.judged(task, as_json=True)
        return
    found = verify.judged(task, as_json=True)
    assert tuple(found.verdicts) == stored.verdicts
    for one, judged in zip(found.verdicts, found.judged, strict=True):
        zone = judged.whole
        worst = max(-zone.overcut.mm if zone.overcut else 0.0, zone.undercut.mm if zone.undercut else 0.0)
        # A surface far within its tolerance is not looked at between the points of the grid.
        close = max(1e-3, 0.01 * one.largest_mm, 0.1 * one.tolerance_mm)
        assert worst == pytest.approx(one.largest_mm, abs=close)
    blocks = [block for block in task.read() if isinstance(block, CutBlock)]
    if len(blocks) == 1:
        tool, (block,) = machine.tools[0], blocks
        placed = Strategy(cuts.strategy(block.modal, tool, machine))
        tried = fits.trial(fits.SurfaceToFit(block, machine), tool, placed, machine.tolerance_mm)
        most = max(one.largest_mm for one in found.verdicts)
        assert tried.off_mm == (math.inf if found.gouges else most)


def test_places_of_a_surface_in_parts_are_at_the_u_of_the_whole_block() -> None:
    machine = replace(machine_file.load("trunnion"), gouge="warn", tolerance_mm=1e-4)
    text = random_nurbs.text(*random_nurbs.blade(6), 600.0)
    task = checked.task(text.encode(), "blade.ngc", machine)
    found = verify.judged(task, as_json=True)
    (block,) = (block for block in task.read() if isinstance(block, CutBlock))
    surface = cuts.surface_of(block)
    assert len(found.judged) > 2
    seen = [(one.u, one.v, one.place) for one in found.verdicts]
    worst = [one.whole.overcut for one in found.judged]
    seen += [(one.u, one.v, one.place) for one in worst if one is not None]
    assert len(seen) > 4 and len({u for u, _, _ in seen}) > 2
    for u, v, place in seen:
        assert surface.point(u, v) == pytest.approx(place, abs=1e-9)


RADII_MM = (0.8, 1.5, 3.0, 6.0)


@pytest.mark.parametrize("corner", [0.0, 1.0])
@pytest.mark.parametrize("seed", [pytest.param(k, marks=pytest.mark.slow) for k in range(8)])
def test_fit_names_the_largest_tool_of_the_table_that_a_check_lets_begin(seed: int, corner: float) -> None:
    """In any placement: nothing larger that would do is passed over, and nothing is named that would not."""
    members = random_surfaces.compound(seed, 1)
    tools = [Tool(k + 1, f"T{k + 1}", r, 0.0, 25.0, corner_mm=corner * r) for k, r in enumerate(RADII_MM)]
    machine = replace(machine_file.load("trunnion"), tools=tuple(tools), tolerance_mm=0.02)

    def begins(tool: Tool, placement: int) -> bool:
        text = random_surfaces.text(members, 600.0, f"G42 P{placement}").replace("T2", f"T{tool.number}")
        try:
            checked.walk_of(checked.task(text.encode(), "drawn.ngc", machine), None, False)
        except ProgramError:
            return False
        return True

    keep = [tool.number for tool in tools for placement in (1, 2, 3) if begins(tool, placement)]
    text = random_surfaces.text(members, 600.0, "G42").replace("T2", "T1")
    read = checked.task(text.encode(), "drawn.ngc", machine).read()
    (block,) = (one for one in read if isinstance(one, CutBlock))
    best = fits.fit(fits.SurfaceToFit(block, machine), tools, 0.02)[-1]
    assert best.tool == max(keep, default=None)
