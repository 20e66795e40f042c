"""Motion laws: how far along each stretch at which time, as fast as every limit allows.

    plan(chain)            a law per stretch, from rest to rest
    runs(chain)            the chain cut where it must stop anyway; plan_run(run) its laws
    faster(run, laws, t)   the rest of a run at a higher feed, from the state that it is in

A straight move with constant limits has the classic closed form, and so has a curve on
which the feed costs little of any limit. Everything else is searched for (``search``).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from controller.handoff import Law
from controller.kinematics import Kinematics
from controller.machine import Machine
from controller.motions import JointMove
from controller.plan.law import sampled, split, straight, through
from controller.plan.limits import derivatives
from controller.plan.path import Chain, Stretch
from controller.plan.search import TINY, Begin, Search, feed_of, junction_speed, limits_of

__all__ = ["Run", "faster", "plan", "plan_run", "runs", "straight", "through"]

Array = npt.NDArray[np.float64]
Run = tuple[Stretch, ...]

STOP_SHARE = 0.03  # a junction that must be passed slower than this share of the feed is a stop
EVEN_SHARE = 0.8  # of each limit left for the ramps of a curved stretch at even feed
EVEN_SAMPLES = 400
LEAST_SPEED_SHARE = 0.05  # of the feed; slower than that there is nothing to go on from


def plan(chain: Chain, machine: Machine, kinematics: Kinematics, override: float = 1.0) -> list[Law]:
    """One law for each stretch of a chain, from rest to rest.

    ``override`` scales the feeds (1.0 = as programmed), not the limits.
    """
    parts = runs(chain, machine, kinematics, override)
    return [law for run in parts for law in plan_run(run, machine, kinematics, override)]


def runs(chain: Chain, machine: Machine, kinematics: Kinematics, override: float = 1.0) -> list[Run]:
    """The chain cut at junctions so sharp that passing them is no faster than stopping."""
    found: list[list[Stretch]] = [[chain.stretches[0]]]
    for before, after in itertools.pairwise(chain.stretches):
        speed = junction_speed(before, after, machine, kinematics)
        if speed < STOP_SHARE * min(feed_of(before, override), feed_of(after, override), 1e6):
            found.append([after])
        else:
            found[-1].append(after)
    return [tuple(run) for run in found]


def plan_run(run: Run, machine: Machine, kinematics: Kinematics, override: float = 1.0) -> list[Law]:
    """The laws of stretches that run through, from rest to rest."""
    if len(run) == 1 and (law := _straight_run(run[0], machine, override)):
        return [law]
    even = _even_run(run, machine, kinematics, override)
    return even or Search(run, machine, kinematics, override).laws()


def faster(
    run: Run, laws: Sequence[Law], t: float, machine: Machine, kinematics: Kinematics, override: float
) -> tuple[int, list[Law]] | None:
    """The rest of a run from its time ``t`` on at a higher feed: index of the first stretch, laws from there.

    s of the first law begins where the run is at ``t``. None where the run is about to
    rest, or nothing faster was found that goes on smoothly.
    """
    times, s, v = _history(run, laws)
    k, start = 0, 0.0
    while k < len(laws) - 1 and t >= start + laws[k].duration_s:
        start, k = start + laws[k].duration_s, k + 1
    here, speed, acceleration = laws[k].at(t - start)
    if speed < LEAST_SPEED_SHARE * feed_of(run[k], 1.0):
        return None
    ahead = times >= t
    begin = Begin(
        sum(stretch.motion.end for stretch in run[:k]) + here,
        speed,
        acceleration,
        lambda places: np.interp(places, s[ahead], v[ahead]),
    )
    found = Search(run, machine, kinematics, override, begin).laws_from_motion()
    return (k, found) if found else None


def _history(run: Run, laws: Sequence[Law]) -> tuple[Array, Array, Array]:
    """Times, places along the run, and speeds of a planned run, sampled densely."""
    times, places, speeds = [], [], []
    start = base = 0.0
    for stretch, law in zip(run, laws, strict=True):
        t, s, v = sampled(law)
        times.append(t + start)
        places.append(s + base)
        speeds.append(v)
        start, base = start + law.duration_s, base + stretch.motion.end
    return np.concatenate(times), np.concatenate(places), np.concatenate(speeds)


# --- closed forms ---------------------------------------------------------


def _straight_run(stretch: Stretch, machine: Machine, override: float) -> Law | None:
    """The closed form, where q' is constant over the whole stretch."""
    move = stretch.motion
    if not isinstance(move, JointMove):
        return None
    ends = np.array([0.0, 1.0])
    if any(np.any(np.asarray(c) != 0.0) for c in move.curve.derivative(ends, 2, np)):
        return None
    rate = np.abs(np.subtract(stretch.end, stretch.start)) / move.end + TINY
    limits = limits_of(stretch, machine)
    return straight(
        move.end,
        min(feed_of(stretch, override), float((limits.velocity / rate).min())),
        float((limits.acceleration / rate).min()),
        float((limits.jerk / rate).min()),
    )


def _even_run(run: Run, machine: Machine, kinematics: Kinematics, override: float) -> list[Law] | None:
    """The closed form for curved stretches on which the feed alone costs little of any limit.

    With v = F throughout and the largest derivatives of each stretch, what is left of A and
    J is a constant path acceleration and jerk for both ramps. None where less than
    ``EVEN_SHARE`` of a limit is left, a junction wants less than F, or the feed changes:
    there the search gains time.
    """
    feed = feed_of(run[0], override)
    junctions = (junction_speed(a, b, machine, kinematics) for a, b in itertools.pairwise(run))
    if not math.isfinite(feed) or any(low < feed for low in junctions):
        return None
    ramps = [_even_ramp(stretch, feed, machine, kinematics) for stretch in run]
    if any(ramp is None or feed_of(s, override) != feed for ramp, s in zip(ramps, run, strict=True)):
        return None
    starts = np.concatenate([[0.0], np.cumsum([stretch.motion.end for stretch in run])])
    found = [ramp for ramp in ramps if ramp is not None]
    law = straight(float(starts[-1]), feed, min(a for a, _ in found), min(j for _, j in found))
    return split(np.array(law.knots_s), np.array(law.coefficients), starts)


def _even_ramp(
    stretch: Stretch, feed: float, machine: Machine, kinematics: Kinematics
) -> tuple[float, float] | None:
    """Path acceleration and jerk that are left anywhere on the stretch at ``feed``; None if too little is."""
    limits = limits_of(stretch, machine)
    d = derivatives(stretch, np.linspace(0.0, stretch.motion.end, EVEN_SAMPLES), kinematics)
    m1, m2, m3 = (np.abs(q).max(axis=0) + TINY for q in (d.first, d.second, d.third))
    room_a = limits.acceleration - m2 * feed**2
    acceleration = float((room_a / m1).min())
    room_j = limits.jerk - m3 * feed**3 - 3.0 * m2 * feed * acceleration
    tight = (m1 * feed > limits.velocity).any() or (room_a < EVEN_SHARE * limits.acceleration).any()
    if tight or (room_j < EVEN_SHARE * limits.jerk).any():
        return None
    return acceleration, float((room_j / m1).min())
