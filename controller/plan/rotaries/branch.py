"""The rotary positions along a cut: both branches over a whole block, followed without a jump.

A closed form gives each rotary only up to whole turns, and at a pole the branches
exchange their names. So a block is looked at on samples that are halved until no
rotary turns by more than half a radian from one to the next; then a jump that is
left is a passage through the pole itself, where the other branch goes on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from controller.geometry.arrays import Array, columns, distinct
from controller.geometry.surfaces import Cone
from controller.geometry.vectors import Vector, scale
from controller.machine.kinematics import Kinematics
from controller.memory import remembered
from controller.motion.motions import JointMove, Rotaries, SurfaceCut, ToolLine, ToolSpline
from controller.plan.rotaries import tool_paths
from controller.plan.rotaries.turns import JUMP_RAD, NAN, SAME_AXIS_RAD, TURN, wrapped
from controller.plan.segment import Segment, rotaries_of

REMEMBERED = 64  # cuts that are followed once: they are asked for again and again
OFTEN, STILL_RAD = 65, 1e-15  # places at which an axis may not be further than this from where it begins
GATHERING = 0.02 * 0.5 ** np.arange(32.0)  # of u: where samples lie about a place beside the pole


class BranchLost(Exception):
    """The rotaries cannot follow the tool axis at ``u``; ``reason``: the key of the text why."""

    def __init__(self, u: float, reason: str) -> None:
        super().__init__(reason)
        self.u, self.reason = u, reason


@dataclass(frozen=True, slots=True)
class Field:
    """Both branches of a cut over samples ``u`` (N,): ``pairs`` (2, N, 2) principal values, rad.

    A rotary that is free over the whole block (a tool axis that stands on the pole
    all the way) is nan.
    """

    u: Array
    axis: Array  # (3, N), table frame
    pairs: Array

    def steps(self) -> tuple[Array, Array]:
        """Largest change of a rotary (2, N-1) per branch, and of the tool axis (N-1,)."""
        change = np.abs(wrapped(np.diff(self.pairs, axis=1))).max(axis=2)
        turn = np.sqrt((np.diff(self.axis, axis=1) ** 2).sum(axis=0))
        return np.nan_to_num(change), np.asarray(turn)

    def unresolved(self) -> Array:
        """Between which samples (N-1,) there may be more than a change of names at the pole."""
        change, turn = self.steps()
        jumps = change.max(axis=0) > JUMP_RAD
        return np.asarray(jumps & ((turn > SAME_AXIS_RAD) | (self._swapped() > JUMP_RAD)))

    def _swapped(self) -> Array:
        """Largest change of a rotary (N-1,) from each branch to the other one."""
        return np.asarray(np.abs(wrapped(self.pairs[::-1, 1:] - self.pairs[:, :-1])).max(axis=(0, 2)))

    def follow(self, start: Rotaries) -> Array:
        """Rotaries (N, 2) that begin next to ``start`` and never jump; raises BranchLost."""
        index = (self._nearest(start) + np.concatenate(([0], np.cumsum(self._switches())))) % 2
        values = self.pairs[index, np.arange(len(self.u))]
        free = np.isnan(values)
        values = np.where(free, np.array(start), values)
        # Whole turns are added to the exact values: no rounding piles up over many turns.
        rough = np.cumsum(wrapped(np.diff(values, axis=0)), axis=0)
        turns = np.round((values[0] + rough - values[1:]) / TURN)
        nearest = np.round((np.array(start) - values[0]) / TURN)
        values[1:] += TURN * turns
        return np.asarray(values + TURN * nearest)

    def _nearest(self, start: Rotaries) -> int:
        begin = wrapped(self.pairs[:, 0] - np.array(start))
        return int(np.argmin(np.nansum(begin * begin, axis=1)))

    def begun_on(self, start: Rotaries) -> int | None:
        """The branch that begins next to ``start`` and keeps its name; None where it does not."""
        return None if self._switches().any() else self._nearest(start)

    def _switches(self) -> Array:
        """Between which samples the branches exchange their names (N-1,)."""
        stay, _ = self.steps()
        jumps = stay.max(axis=0) > JUMP_RAD
        if jumps.any():
            torn = np.flatnonzero(jumps & (self._swapped() > JUMP_RAD))
            if len(torn):
                raise BranchLost(float(self.u[torn[0]]), "reach.jump")
        return np.asarray(jumps)


def _grid(cut: SurfaceCut) -> Array:
    """Samples dense enough that no rotary turns half a turn unseen between two."""
    base = cut.surface.nominal
    turns = abs(base.sweep_rad) / TURN if isinstance(base, Cone) else 0.0
    even = np.linspace(0.0, 1.0, 129 + 2 * math.ceil(32 * turns))
    return distinct(np.concatenate((even, beside_pole(cut)))) if cut.beside_pole else even


def beside_pole(cut: SurfaceCut) -> Array:
    """Samples (u) that gather where ``cut`` passes by the pole."""
    near = [u + sign * GATHERING for u in cut.beside_pole for sign in (-1.0, 1.0)]
    return np.asarray(np.clip(np.concatenate([cut.beside_pole, *near]), 0.0, 1.0))


def field(cut: SurfaceCut, kinematics: Kinematics, extra: Array | None = None) -> Field:
    """Both branches of ``cut`` over its whole length (with samples at ``extra``); raises BranchLost."""
    u = _grid(cut)
    if extra is not None:
        u = distinct(np.concatenate((u, extra)))
    found = _solve(cut, kinematics, u)
    if (limit := at_limit(cut, u, kinematics)) is not None:
        raise BranchLost(limit, "reach.limit")
    while True:
        wide = np.flatnonzero(found.unresolved())
        middle = 0.5 * (found.u[wide] + found.u[wide + 1])
        middle = middle[(middle > found.u[wide]) & (middle < found.u[wide + 1])]
        if not len(middle):
            return _freed(found)
        found = _merged(found, _solve(cut, kinematics, middle))


def _solve(cut: SurfaceCut, kinematics: Kinematics, u: Array) -> Field:
    x, y, z = cut.part.turn(cut.surface.axis(u, np))
    axis: Vector = (x + 0.0 * u, y + 0.0 * u, z + 0.0 * u)
    # Kept at nan, the work's rotary shows where it is undetermined: at the pole.
    seen = cut.seen_along(u, axis, kinematics, np)
    pairs: Array = np.moveaxis(np.array(kinematics.branches(axis, np, None, NAN, seen)), 2, 1)
    lost = np.isnan(pairs).all(axis=(0, 2))
    if lost.any():
        raise BranchLost(float(u[np.argmax(lost)]), kinematics.unreached)
    free = np.flatnonzero(np.isnan(pairs).any(axis=(0, 2)))
    if len(free) > 1 and _stands_still(cut):  # at one place it is what it is at all
        pairs[:, free] = _from_inside(cut, kinematics, float(u[free[0]]))[:, None]
        return Field(u, np.array(axis), pairs)
    for i in free:
        pairs[:, i] = _from_inside(cut, kinematics, float(u[i]))
    return Field(u, np.array(axis), pairs)


@remembered(REMEMBERED)
def _stands_still(cut: SurfaceCut) -> bool:
    """Whether the tool's axis is the same all along, as on an upright wall: no curve meets it so often."""
    axes = columns(cut.surface.axis(np.linspace(0.0, 1.0, OFTEN), np), OFTEN)
    return float(np.abs(np.cross(axes, axes[0])).max()) <= STILL_RAD


def _from_inside(cut: SurfaceCut, kinematics: Kinematics, u: float) -> Array:
    """Both branches at a pole, as ``SurfaceCut.joints`` takes them there: the limit from inside."""
    rate = cut.part.turn(cut.surface.axis_rate(u))
    inside = rate if u < 0.5 else scale(rate, -1.0)
    return np.array(kinematics.branches(cut.part.turn(cut.surface.axis(u)), inside=inside, keep=NAN))


def _merged(a: Field, b: Field) -> Field:
    u = np.concatenate((a.u, b.u))
    order = np.argsort(u, kind="stable")
    axis = np.concatenate((a.axis, b.axis), axis=1)[:, order]
    return Field(u[order], axis, np.concatenate((a.pairs, b.pairs), axis=1)[:, order])


def _freed(found: Field) -> Field:
    """Undetermined places inside a block take what stands before them (as the tick does)."""
    unknown = np.isnan(found.pairs).any(axis=(0, 2))
    known = np.flatnonzero(~unknown)
    if not unknown.any() or not len(known):
        return found
    source = known[np.clip(np.searchsorted(known, np.arange(len(found.u)), side="right") - 1, 0, None)]
    pairs = np.where(np.isnan(found.pairs), found.pairs[:, source], found.pairs)
    return Field(found.u, found.axis, pairs)


def joints_on(cut: SurfaceCut, u: Array, rotaries: Array, kinematics: Kinematics) -> Array:
    """All joints (N, axes) at parameters ``u`` (N,) with the rotaries (N, 2) found there."""
    tip = cut.part.to_parent(cut.surface.pose(u, cut.offset_mm, np).tip)
    return _stacked(tip, rotaries[:, 0], rotaries[:, 1], cut, kinematics)


def _stacked(tip: Vector, first: Array, second: Array, cut: SurfaceCut, kinematics: Kinematics) -> Array:
    x, y, z = kinematics.linear(tip, (first, second), cut.length_mm, np)
    values = (x, y, z, first, second)
    return columns(kinematics.arrange(values), len(first))


def joints_along(segment: Segment, s: Array, kinematics: Kinematics) -> Array:
    """Joints (N, axes) at the places ``s`` (N,) of a segment, in the turns in which it begins.

    ``s`` is in the unit of the motion and in any order. Raises BranchLost where the
    rotaries cannot follow, which ``path.trace`` has ruled out for its own segments.
    """
    s = np.atleast_1d(np.asarray(s, dtype=float))
    motion = segment.motion
    if isinstance(motion, JointMove):
        return _along_move(motion, s, kinematics)
    if isinstance(motion, ToolLine):
        return tool_paths.joints_along_line(motion, s, kinematics)
    if isinstance(motion, ToolSpline):
        return tool_paths.joints_along_spline(motion, s, kinematics)
    u = motion.arc.u_along(s)
    return joints_on(motion, u, _rotaries_along(segment, motion, u, kinematics), kinematics)


def one_branch(segment: Segment, cut: SurfaceCut, kinematics: Kinematics) -> int | None:
    """Which of ``kinematics.branches`` a cut is on from end to end; None where they change names.

    Raises BranchLost.
    """
    return _followed(cut, rotaries_of(segment.start, kinematics), kinematics).branch


def _rotaries_along(segment: Segment, cut: SurfaceCut, u: Array, kinematics: Kinematics) -> Array:
    """Rotaries (N, 2) at parameters ``u`` (N,), in the turns in which the segment begins."""
    start = rotaries_of(segment.start, kinematics)
    kept = _followed(cut, start, kinematics)
    if kept.branch is not None:
        values = _solve(cut, kinematics, u).pairs[kept.branch]
        if not np.isnan(values).any():
            near = np.stack([np.interp(u, kept.u, rotary) for rotary in kept.rotaries.T], axis=1)
            return np.asarray(values + TURN * np.round((near - values) / TURN))
    found = field(cut, kinematics, u)
    return found.follow(start)[np.searchsorted(found.u, u)]


class _FollowedCut(NamedTuple):
    """A cut followed once: its one branch, and rotaries (N, 2) at ``u`` (N,), half a radian apart at most."""

    branch: int | None
    u: Array
    rotaries: Array


@remembered(REMEMBERED)
def _followed(cut: SurfaceCut, start: Rotaries, kinematics: Kinematics) -> _FollowedCut:
    found = field(cut, kinematics)
    even = not (cut.touches or cut.beside_pole or np.isnan(found.pairs).any())
    return _FollowedCut(found.begun_on(start) if even else None, found.u, found.follow(start))


def _along_move(move: JointMove, s: Array, kinematics: Kinematics) -> Array:
    share = s / move.end if move.end > 0.0 else 0.0 * s
    (a0, b0), (a1, b1) = move.start_rotaries, move.end_rotaries
    values = (*move.curve.at(share, np), a0 + (a1 - a0) * share, b0 + (b1 - b0) * share)
    return columns(kinematics.arrange(values), len(s))


# The limit of what the rotaries reach: where a tool axis comes to it, they would have to turn at once.
#
# Rotaries that are not square to each other, as of a nutating head, tilt the tool so far and no further.
# At that limit both branches are one and the rates of both rotaries are without end; beside it the one
# branch leads back from it and the other one over it, so that a cut which touches it would have to jump.

LIMIT = 5e-3  # sine that goes like the root of the tilt that is left: 1e-3 degrees and a bit
ZOOMS, ZOOM_POINTS, CLOSER = 6, 41, 0.1


def at_limit(cut: SurfaceCut, u: Array, kinematics: Kinematics) -> float | None:
    """The u where the axis of a cut comes nearest to the limit, if it is that near; ``u`` (N,): samples."""
    if not kinematics.is_bounded:
        return None
    off = _off(cut, u, kinematics)
    padded = np.concatenate(([np.inf], off, [np.inf]))
    dips = np.flatnonzero((off <= padded[:-2]) & (off <= padded[2:]))
    found = [_lowest(cut, float(u[i]), kinematics) for i in dips[np.argsort(off[dips])][:4]]
    least, where = min(found, default=(np.inf, 0.0))
    return where if least < LIMIT else None


def _lowest(cut: SurfaceCut, u: float, kinematics: Kinematics) -> tuple[float, float]:
    """(value, u) of the dip about ``u``."""
    half, best = 1.0 / 64.0, np.inf
    for _ in range(ZOOMS):
        near = np.clip(np.linspace(u - half, u + half, ZOOM_POINTS), 0.0, 1.0)
        off = _off(cut, near, kinematics)
        i = int(np.argmin(off))
        best, u, half = float(off[i]), float(near[i]), CLOSER * half
    return best, u


def _off(cut: SurfaceCut, u: Array, kinematics: Kinematics) -> Array:
    x, y, z = cut.part.turn(cut.surface.axis(u, np))
    return np.asarray(np.broadcast_to(kinematics.off_limit((x, y, z)), u.shape))
