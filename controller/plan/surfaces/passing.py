"""How fast the limits of the joints let two cuts go over into each other: about, at an even speed."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from controller.geometry.arrays import Array
from controller.machine.kinematics import Kinematics
from controller.machine.model import Axis, Machine
from controller.motion.motions import SurfaceCut
from controller.plan.context import Context
from controller.plan.rotaries.branch import BranchLost, field, joints_on
from controller.plan.segment import Segment
from controller.plan.surfaces import rates
from controller.plan.surfaces.cuts import Cut
from controller.plan.surfaces.rates import Derivatives

Pair = tuple[Cut, Cut]

PASSED = 0.8  # of the feed: what is passed faster is left as it is
TOLD = 0.98  # of what the surfaces themselves allow, or of the feed
SEEN_S = 0.02  # lost at a kink: a longer stay of the contact leaves a mark
CLEAR = 0.05  # sine of the angle to the pole, at places that are looked at
LOOKED = np.linspace(0.0, 1.0, 17)
KINDS = ("velocity", "acceleration", "jerk")


class Slowest(NamedTuple):
    """What the contact slows down to (mm/s), and which limit of which axis binds there."""

    share: float  # that this is of the feed, or of what the surfaces as they are allow there
    mm_s: float
    axis: str
    limit: str  # one of ``KINDS``


def slowest(pair: Pair, bare: Pair, reach_mm: float, context: Context) -> Slowest | None:
    """Within ``reach_mm`` of the joint of two cuts that are blended, ``bare`` without that.

    None where the blend costs nothing: at the feed, or as fast as the surfaces themselves allow.
    """
    found = _beside(pair, reach_mm, context.kinematics)
    if not found:
        return None
    feed, rows = pair[1].block.feed_mm_s, _allowed(found, context.machine)
    at_kink = _over_kink(found, context.machine)
    if at_kink.mm_s < min(TOLD * feed, float(rows.min())):
        return at_kink._replace(share=at_kink.mm_s / feed)
    if rows.min() >= TOLD * feed:
        return None
    speeds, most = rows.min(axis=(1, 3)), np.array(feed)
    own = _beside(bare, reach_mm, context.kinematics)
    if own:
        most = np.minimum(feed, _allowed(own, context.machine).min(axis=(1, 3)))
    share = speeds / most
    side, place = np.unravel_index(int(share.argmin()), share.shape)
    if share[side, place] >= TOLD:
        return None
    here = rows[side, :, place]
    kind, axis = np.unravel_index(int(here.argmin()), here.shape)
    return Slowest(float(share.min()), float(here.min()), context.machine.axes[axis].name, KINDS[kind])


def _allowed(found: list[Derivatives], machine: Machine) -> Array:
    """As ``_speeds`` before and behind the joint, (2, 3, N, axes).

    On the pole itself, where there are no derivatives, nothing is said.
    """
    rows = [_speeds(d, machine.axes) for d in found]
    return np.nan_to_num(np.array(rows), nan=math.inf, posinf=math.inf)


def _over_kink(found: list[Derivatives], machine: Machine) -> Slowest:
    """Where the joints' rates jump, as they may on the pole: the step of each has to fit into one tick."""
    most = _steps(machine)
    jump = np.nan_to_num(np.abs(found[1].first[0] - found[0].first[0])) + 1e-30
    kind, axis = np.unravel_index(int((most / jump).argmin()), most.shape)
    return Slowest(1.0, float((most / jump).min()), machine.axes[axis].name, KINDS[1 + kind])


def _steps(machine: Machine) -> Array:
    """By how much the rate of each joint may change within a tick, by acceleration and jerk: (2, axes)."""
    period, limits = machine.period_s, [axis.limits for axis in machine.axes]
    return np.array([[one.acceleration * period for one in limits], [one.jerk * period**2 for one in limits]])


def at_kink(pair: Pair, context: Context) -> Slowest | None:
    """What the contact slows down to where the rates jump; None where that is too short to be seen.

    The step of the joints' rates has to fit into one tick, so it is hardly passed at all. To slow down
    to nearly nothing and to speed up again each take 2 sqrt(F / j), of which half is lost.
    """
    found = _beside(pair, 0.0, context.kinematics)
    if not found:
        return None
    a, b = (d.first[0] for d in found)
    limits, feed = [axis.limits for axis in context.machine.axes], pair[1].block.feed_mm_s
    jerk = min(one.jerk / max(abs(p), abs(q), 1e-9) for one, p, q in zip(limits, a, b, strict=True))
    slowed = bool((np.abs(b - a) * feed * PASSED > _steps(context.machine)).any())
    return _over_kink(found, context.machine) if slowed and 2.0 * math.sqrt(feed / jerk) > SEEN_S else None


def _beside(pair: Pair, reach_mm: float, kinematics: Kinematics) -> list[Derivatives]:
    """The joints' derivatives before and behind the joint; nothing where the rotaries cannot follow."""
    ends = [cut.motion.end for cut in pair]
    places = [np.maximum(ends[0] - reach_mm * LOOKED, 0.0), np.minimum(reach_mm * LOOKED, ends[1])]
    clear = (_is_clear(cut.motion, s, kinematics) for cut, s in zip(pair, places, strict=True))
    if not kinematics.is_bounded and all(clear):
        return [rates.on_branch(cut.motion, s, 0, kinematics) for cut, s in zip(pair, places, strict=True)]
    try:
        followed = list(_followed(pair, kinematics))
    except BranchLost:
        return []
    return [rates.derivatives(one, s, kinematics) for one, s in zip(followed, places, strict=True)]


def _is_clear(motion: SurfaceCut, s: Array, kinematics: Kinematics) -> bool:
    """Whether no branch changes its name there: either one will do then."""
    axis = motion.surface.axis(motion.arc.u_along(s), np)
    return bool(np.min(kinematics.off_pole(motion.part.turn(axis), np)) > CLEAR)


def _followed(pair: Pair, kinematics: Kinematics) -> Iterator[Segment]:
    """Both cuts on the first branch; which one makes no difference to how fast they may be."""
    near = None
    for cut in pair:
        found = field(cut.motion, kinematics)
        begin = found.pairs[0, 0] if near is None else near
        rotaries = found.follow((float(begin[0]), float(begin[1])))
        near = rotaries[-1]
        start, end = joints_on(cut.motion, found.u, rotaries, kinematics)[[0, -1]].tolist()
        block = cut.block
        yield Segment(cut.motion, block.place, block.feed_mm_s, True, tuple(start), tuple(end), True, "cut")


def _speeds(d: Derivatives, axes: tuple[Axis, ...]) -> Array:
    """Speed that each joint's velocity, acceleration and jerk allow at N places, (3, N, axes), mm/s."""
    limits = np.array([[a.limits.velocity, a.limits.acceleration, a.limits.jerk] for a in axes]).T
    rows = np.abs(np.stack([d.first, d.second, d.third])) + 1e-30
    allowed = limits[:, None, :] / rows
    return np.asarray(np.stack([allowed[0], np.sqrt(allowed[1]), np.cbrt(allowed[2])]))
