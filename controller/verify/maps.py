"""The cut surfaces as the page shows them: a small map of each, and how far off they are.

Less than ``judge`` gives, and soon: one grid, everything that the program does, and passes as
close as finding gouges needs them. The figures are those of the deepest places of that grid.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from controller.machine.kinematics import Kinematics
from controller.machine.model import Machine
from controller.plan.segment import Segment
from controller.program.program import Block
from controller.verify import passes
from controller.verify.judge import Cutting, Field, Map, Worst, Zone
from controller.verify.nominal import Nominal

GRID = (33, 9)  # along, across
TICKS = 4  # of a map's axis along
FINE = 50  # parts between two of them
MAX_MAPS = 40  # surfaces that get a map: those of a program's beginning


def maps(
    segments: Mapping[int, Segment],
    read: Callable[[], Iterable[Block]],
    machine: Machine,
    kinematics: Kinematics,
) -> dict[str, Any]:
    """``overcut_mm``, ``undercut_mm`` and ``surfaces`` with their maps (um; None: uncut); {} without any.

    ``read`` gives the program's blocks, for the tools.
    """
    fitted = passes.Fitted.of(read(), machine)
    surfaces = passes.nominals(segments, fitted)
    if not surfaces:
        return {}
    near = passes.planned(segments, surfaces[:MAX_MAPS], fitted, kinematics, rough=True)
    cutting = Cutting(near, surfaces)
    rows = [_row(one, *Field(one, cutting).once(*GRID)) for one in surfaces[:MAX_MAPS]]
    deepest = {name: max(row[name] for row in rows) for name in ("overcut_mm", "undercut_mm")}
    return {**deepest, "surfaces": rows, "left_out": max(0, len(surfaces) - MAX_MAPS)}


def _row(nominal: Nominal, zone: Zone, seen: Map) -> dict[str, Any]:
    um = np.round(1e3 * seen.t.T, 1)  # across, along: v downwards
    return {
        "line": nominal.line,
        "overcut_mm": _amount(zone.overcut),
        "undercut_mm": _amount(zone.undercut),
        **_size(nominal),
        "overcut_at": [zone.overcut.u, zone.overcut.v] if zone.overcut else None,
        "rulings_mm": _rulings(nominal),
        "map_um": [[None if np.isnan(t) else float(t) for t in row] for row in um],
    }


def _rulings(nominal: Nominal) -> list[list[float]]:
    """Upper and lower end (mm, table frame) at each u of a map, for who draws it on the surface."""
    u = np.linspace(0.0, 1.0, GRID[0])
    ends = [nominal.points(u, np.full_like(u, v)) for v in (0.0, 1.0)]
    found: list[list[float]] = np.hstack(ends).round(3).tolist()
    return found


def _size(nominal: Nominal) -> dict[str, Any]:
    """``along_mm``: lengths of the lower edge at even steps of u; ``height_mm`` of the longest ruling."""
    u = np.linspace(0.0, 1.0, TICKS * FINE + 1)
    low, high = (nominal.points(u, np.full_like(u, v)) for v in (1.0, 0.0))
    steps = np.linalg.norm(np.diff(low, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])[::FINE]
    height = np.linalg.norm(high - low, axis=1).max()
    return {"along_mm": [round(float(mm), 3) for mm in along], "height_mm": round(float(height), 3)}


def _amount(worst: Worst | None) -> float:
    return abs(worst.mm) if worst else 0.0
