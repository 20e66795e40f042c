"""What a fit of the rotaries says, as plain values in the units of the machine file, and what is refused."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from controller.calibration import MAX_DEG, MAX_MM
from controller.calibration.positions import Advice
from controller.calibration.refusal import Refusal
from controller.calibration.rotary_fit import BOUND, Fit
from controller.geometry.vectors import angle_between, cross, norm, subtract, unit
from controller.machine.model import Machine


def report(fit: Fit, before: Machine, advice: Advice | None = None) -> dict[str, Any]:
    """All that is told; micrometres and degrees."""
    spots = [spot for spot in fit.spots if spot.touches]
    rotaries = fit.machine.rotary()
    return {
        "touches": len(fit.residuals),
        "positions": len(spots),
        "scatter_um": 1e3 * fit.scatter_mm,
        "sphere_mm": list(fit.sphere_mm),
        "sphere_radius_mm": fit.radius_mm,
        "rotaries": [_rotary(fit, before, k) for k in range(len(rotaries))],
        "bound_deviations": BOUND,
        "dispersion_um": {
            name: {"rms": 1e3 * _rms(values), "max": 1e3 * max(values)}
            for name, values in (("before", [s.before for s in spots]), ("after", [s.after for s in spots]))
        },
        "valuation": _valuation(fit),
        "correlated": [[one, other, value] for one, other, value in fit.correlated()],
        "unseen": fit.unseen(),
        "doubtful_touches": [k + 1 for k in fit.doubtful()],
        "add_positions_deg": [] if advice is None else _shown(advice, before),
        "spots": [
            {
                "rotaries_deg": _degrees(before, spot.rotaries),
                "touches": spot.touches,
                "before_um": 1e3 * spot.before,
                "after_um": 1e3 * spot.after,
            }
            for spot in spots
        ],
    }


def _rotary(fit: Fit, before: Machine, k: int) -> dict[str, Any]:
    index = fit.machine.rotary()[k]
    old, new = before.axes[index], fit.machine.axes[index]
    mm, rad = fit.bounds()[k]
    return {
        "axis": new.name,
        "point_mm": list(new.point_mm),
        "direction": list(new.direction),
        "point_before_mm": list(old.point_mm),
        "direction_before": list(old.direction),
        "moved_um": 1e3 * norm(cross(unit(old.direction), subtract(new.point_mm, old.point_mm))),
        "turned_deg": math.degrees(angle_between(old.direction, new.direction)),
        "bound_um": 1e3 * mm,
        "bound_deg": math.degrees(rad),
    }


def _valuation(fit: Fit) -> float:
    """0 to 100: how much of what was not known of the rotaries the positions have told (100: all of it)."""
    rows = [k for k, one in enumerate(fit.unknowns) if one.sought]
    left = [fit.deviations[k] / fit.unknowns[k].prior for k in rows]
    return float(100.0 * (1.0 - max(min(one, 1.0) for one in left)))


def _rms(values: list[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _shown(advice: Advice, machine: Machine) -> list[dict[str, float]]:
    return [_degrees(machine, place) for place in advice.positions]


def _degrees(machine: Machine, place: tuple[float, ...]) -> dict[str, float]:
    axes = [machine.axes[i] for i in machine.rotary()]
    return {axis.name: q * axis.shown_per_unit for axis, q in zip(axes, place, strict=True)}


def refuse_large(told: dict[str, Any], max_mm: float = MAX_MM, max_deg: float = MAX_DEG) -> None:
    """Raises Refusal where a rotary would move by more: then something else is wrong."""
    for row in told["rotaries"]:
        if row["moved_um"] > 1e3 * max_mm or row["turned_deg"] > max_deg:
            raise Refusal(
                "too_large",
                axis=row["axis"],
                moved_mm=row["moved_um"] / 1e3,
                turned_deg=row["turned_deg"],
                most_mm=max_mm,
                most_deg=max_deg,
            )
