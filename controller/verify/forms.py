"""Whether a surface that has been looked at keeps its form tolerance.

The grid of the look has the signed distance of every point to all that cuts. Its worst points are
zoomed into and measured along the normal, as ``judge`` does; where that is far within the
tolerance, the worst of them alone.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from controller.geometry.arrays import Array
from controller.geometry.placement import Strategy
from controller.machine.model import JOINT_TOLERANCE_DEG
from controller.plan.report.verdict import Verdict
from controller.verify.looks import SurfaceGrid
from controller.verify.nominal import Nominal, peaks

SURE_SHARE = 0.5  # of the tolerance: what is off by less on the grid is not zoomed into
LIKELY_SHARE = 0.1  # the same, beside a pivot
ZOOMED, FEW = 16, 3  # places of each sign, at first and at last
STEPS, POINTS = 8, 5  # of a zoom
FEWEST, SETTLED_MM = 2, 1e-6  # it ends where a step after these gains less
BESIDE_UP = ("lead in", "lead out", "link", "plunge", "lift")
MIN_RADIUS_MM = 0.05  # a smaller cutter is no advice


def verdict(look: SurfaceGrid) -> Verdict | None:
    """Of one surface, once its ``hurts`` have been asked for; None where it has no tolerance."""
    nominal = look.nominal
    if nominal.tolerance_mm is None:
        return None
    over, under = (_worst(look, sign, nominal.tolerance_mm) for sign in (-1.0, 1.0))
    over = max(over, _in_corners(look, nominal.tolerance_mm))
    _, u, v = max(over, under)
    by, by_line = look.cut_by(u, v)
    made = Verdict(
        line=nominal.line,
        tool=nominal.tool.number,
        tolerance_mm=nominal.tolerance_mm,
        overcut_mm=max(0.0, over[0]),
        undercut_mm=max(0.0, under[0]),
        u=u,
        v=v,
        height_mm=_height_mm(nominal, u, v),
        place=nominal.place(u, v),
        by=by,
        by_line=by_line,
    )
    made = made if made.within else _advised(made, look)
    return replace(made, u=nominal.block_u(made.u))


def _worst(look: SurfaceGrid, sign: float, tolerance_mm: float) -> tuple[float, float, float]:
    """The largest amount (mm, without the allowance) of one sign, and its u and v."""
    left = np.where(np.isfinite(look.left), look.left, look.nominal.tool.radius_mm)
    size = _net(look, left, sign)
    if float(size.max()) < SURE_SHARE * tolerance_mm:
        starts = np.array([int(np.argmax(size))])
        return _measured(look, look.u[starts], look.v[starts], size[starts], sign)
    starts = peaks(size, look.shape[1], ZOOMED)
    best = _measured(look, look.u[starts], look.v[starts], size[starts], sign)
    return _climbed(look, look.u[starts], look.v[starts], sign, best)


def _climbed(
    look: SurfaceGrid, u: Array, v: Array, sign: float, best: tuple[float, float, float]
) -> tuple[float, float, float]:
    """The largest amount about some places (K,), from the best of them: amount, u, v."""
    half = 1.0 / (np.array(look.shape) - 1.0)
    for k in range(STEPS):
        amount, u, v = _zoomed(look, u, v, half, sign)
        before, best = best, max(best, *zip(amount.tolist(), u.tolist(), v.tolist(), strict=True))
        likely = np.argsort(-amount, kind="stable")[: max(FEW, len(amount) // 2)]
        u, v, half = u[likely], v[likely], half / (0.5 * (POINTS - 1))
        if k >= FEWEST and best[0] - before[0] < SETTLED_MM:
            break
    return best


def _in_corners(look: SurfaceGrid, tolerance_mm: float) -> tuple[float, float, float]:
    """The deepest overcut (mm) beside a pivot, its u and v: too narrow for the points of the grid.

    In a concave corner the cutter stands deepest in either surface as far from the joint as its tip turns.
    A turn that rounding of the program makes costs nothing.
    """
    sweep = look.sweep
    turns = [np.linalg.norm(one.tips[-1] - one.tips[0]) for one in sweep.passes if one.name == "pivot"]
    rounding = math.radians(JOINT_TOLERANCE_DEG) * look.nominal.tool.radius_mm
    away = np.array([turn for turn in turns if turn > rounding]) / look.nominal.size[0]
    away = away[away < 1.0]
    if not len(away):
        return 0.0, 0.0, 0.0
    u, v = (m.ravel() for m in np.meshgrid(np.append(away, 1.0 - away), np.linspace(0.0, 1.0, POINTS)))
    best = _measured(look, u, v, np.zeros(len(u)), -1.0)
    return _climbed(look, u, v, -1.0, best) if best[0] > LIKELY_SHARE * tolerance_mm else best


def _zoomed(look: SurfaceGrid, u: Array, v: Array, half: Array, sign: float) -> tuple[Array, Array, Array]:
    """The largest amounts on small grids about places (K,), and where they are."""
    x, y = (m.ravel() for m in np.meshgrid(*2 * [np.linspace(-1.0, 1.0, POINTS)], indexing="ij"))
    a = np.clip(u[:, None] + half[0] * x, 0.0, 1.0)
    b = np.clip(v[:, None] + half[1] * y, 0.0, 1.0)
    t = np.nan_to_num(look.deviation(a.ravel(), b.ravel()), nan=-np.inf * sign)
    amount = _net(look, t, sign).reshape(a.shape)
    most, rows = np.argmax(amount, axis=1), np.arange(len(a))
    return amount[rows, most], a[rows, most], b[rows, most]


def _net(look: SurfaceGrid, t: Array, sign: float) -> Array:
    """Amounts of one sign: overcut counts from the surface, what is left from its allowance."""
    return -t if sign < 0.0 else t - look.nominal.allowance_mm


def _measured(look: SurfaceGrid, u: Array, v: Array, near: Array, sign: float) -> tuple[float, float, float]:
    """The largest of some places along their normals; where no normal meets a cut, by its distance."""
    t = look.deviation(u, v)
    amount = np.where(np.isnan(t), near, _net(look, t, sign))
    k = int(np.argmax(amount))
    return float(amount[k]), float(u[k]), float(v[k])


def _height_mm(nominal: Nominal, u: float, v: float) -> float:
    """Of a place above the lower edge, along its ruling."""
    points = nominal.points(np.array([u, u]), np.array([v, 1.0]))
    return float(np.linalg.norm(points[0] - points[1]))


# ---- what helps --------------------------------------------------------------------


def _advised(made: Verdict, look: SurfaceGrid) -> Verdict:
    """With what helps: by the motion that is too deep there, or stays off."""
    keys, radius = list[str](), 0.0
    bend = float(look.nominal.hollow(np.array([made.u]), np.array([made.v]))[0])
    own = made.by == "cut" and made.by_line == made.line
    shallow = made.largest_mm < 0.5 * look.nominal.tool.radius_mm  # a neighbour that reaches over the joint
    if made.undercut_mm > made.overcut_mm and look.left_without_flute(made.u, made.v) <= made.tolerance_mm:
        return replace(made, by="cut", by_line=made.line, remedies=("flute", "bands"))
    if bend * look.nominal.tool.radius_mm > 1.0:
        keys, radius = ["side"], 1.0 / bend
    elif own or made.by in BESIDE_UP or (made.by == "cut" and shallow):
        keys = _better_placements(look)
        # What twist costs is in proportion to the radius.
        radius = look.nominal.tool.radius_mm * made.tolerance_mm / made.largest_mm
        keys += ["lead"] if made.by in BESIDE_UP else []
    elif made.by == "pivot":
        keys = ["joint"]
    else:
        keys = ["apart"]
    size = "radius" if radius > MIN_RADIUS_MM else "smaller"
    return replace(made, remedies=(*keys, size), radius_mm=radius if size == "radius" else 0.0)


def _better_placements(look: SurfaceGrid) -> list[str]:
    """Those that may deviate less than the one that the program asks for."""
    better = {Strategy.SINGLE: ["double", "optimal"], Strategy.DOUBLE: ["optimal"]}
    return better.get(look.nominal.placement, [])
