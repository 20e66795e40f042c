"""A motion of many program lines: its spans as a ``ToolSpline``, its feeds, and the travel of its joints."""

from __future__ import annotations

import itertools
import math
from array import array
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from controller.geometry.arrays import Array
from controller.geometry.vectors import ROUNDING
from controller.machine.model import Joints
from controller.motion.motions import ToolSpline
from controller.plan.context import Context
from controller.plan.lines.corners import Feed
from controller.plan.rotaries import tool_paths
from controller.plan.segment import MIN_TIP_RATE, STANDS_MM, Segment
from controller.plan.surfaces import audit
from controller.program.program import JointArc, JointLine, Place

TRAVEL_SAMPLES = 4  # of each span


class Begun(NamedTuple):
    """The lines of a motion: their blocks, the s of the row at which each begins, and their feeds."""

    blocks: list[Feed]
    starts: list[float]
    feeds: list[tuple[float, bool]]  # and whether it is that of s (the tip stands) or of the tip


class RowMotions:
    """Makes motions of rows on one machine."""

    def __init__(self, context: Context) -> None:
        self._context = context

    def segment(
        self,
        knots: Array,
        c: Array,
        begun: Begun,
        tips: bool,
        length_mm: float,
        exact: bool = False,
        samples: int = TRAVEL_SAMPLES,
    ) -> Segment:
        """The motion of spans between ``knots`` (n + 1,) of the row with cubics ``c`` (n, 5, 4).

        ``tips`` and ``length_mm``: as of a ``ToolSpline``. Its travel is audited at ``samples`` of each span.
        """
        here, begin = begun.blocks, float(knots[0])
        starts = [s - begin for s in begun.starts]
        motion = ToolSpline(
            array("d", (knots - knots[0]).tobytes()),
            array("d", np.ascontiguousarray(c).tobytes()),
            tips,
            length_mm,
            array("l", [block.place.line for block in here]),
            array("d", starts),
        )
        steps = _feed_steps(starts, [feed for feed, _ in begun.feeds])
        share = np.arange(samples) / samples
        inside = knots[:-1, None] - begin + np.diff(knots)[:, None] * share
        places = np.append(inside.ravel(), motion.end)
        joints = tool_paths.joints_along_spline(motion, places, self._context.kinematics)
        start, end = _joints(joints[0]), _joints(joints[-1])
        found = Segment(
            motion,
            here[0].place,
            steps[0][1],
            False,
            start,
            end,
            exact,
            "line",
            steps if len(steps) > 1 else (),
            _turning(starts, [stands for _, stands in begun.feeds]),
            tuple(block.place.order for block in here) if here[0].place.step else (),
            is_exact_row=exact,
            hole=_hole(here),
        )
        self.audit(lambda s: here[motion.index_at(s)].place, places, joints)
        return found

    def audit(self, place_at: Callable[[float], Place], s: Array, joints: Array) -> None:
        """Travel of all joints."""
        low = np.array([axis.travel_min for axis in self._context.machine.axes]) - ROUNDING
        high = np.array([axis.travel_max for axis in self._context.machine.axes]) + ROUNDING
        out = ((joints < low) | (joints > high)).any(axis=1)
        if out.any():  # the first line that leaves it, not the worst
            s, joints = s[: out.argmax() + 1], joints[: out.argmax() + 1]
        excess = audit.outside(self._context.machine, s, joints)
        if excess is not None:
            place = place_at(float(s[excess.sample]))
            self._context.refuse(place, audit.describe(self._context.machine.axes[excess.axis], excess))


def feed_of(block: Feed, size: float, tip_mm: float, turned_deg: float) -> tuple[float, bool]:
    """The feed of a line of ``size`` in s, and whether it is that of s (the tip stands) or of the tip."""
    stands = tip_mm < STANDS_MM and turned_deg > 0.0
    if block.time_s is not None:
        return (size if stands else max(tip_mm, MIN_TIP_RATE * size)) / block.time_s, stands
    if stands:
        return (turning_feed(block) or 0.0) * size / turned_deg, True
    return block.feed_mm_s or 0.0, False


def turning_feed(block: Feed) -> float | None:
    """Degrees per second where only the axis turns: of an arc whose radius is none, its F."""
    return block.feed_mm_s if isinstance(block, JointArc) else block.feed_deg_s


def _turning(starts: list[float], stands: list[bool]) -> tuple[tuple[float, float], ...]:
    """From s to s where the tip stands."""
    changes = [0, *(k for k in range(1, len(stands)) if stands[k] != stands[k - 1]), len(stands)]
    bounds = [-math.inf, *starts[1:], math.inf]
    return tuple((bounds[i], bounds[k]) for i, k in itertools.pairwise(changes) if stands[i])


def _hole(blocks: list[Feed]) -> str:
    """What all of them do in holes, as ``JointLine.hole``; "" where it is not one thing."""
    found = {block.hole if isinstance(block, JointLine) else "" for block in blocks}
    return found.pop() if len(found) == 1 else ""


def _feed_steps(starts: list[float], feeds: list[float]) -> tuple[tuple[float, float], ...]:
    """(s, feed) where it changes."""
    steps = [(max(starts[0], 0.0), feeds[0])]
    for s, feed in zip(starts[1:], feeds[1:], strict=True):
        if feed != steps[-1][1]:
            steps.append((s, feed))
    return tuple(steps)


def _joints(row: Array) -> Joints:
    return tuple(map(float, row))
