"""A train of cuts with its rotaries followed: on each branch, leg by leg, and what that asks of them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from controller.geometry.arrays import Array
from controller.machine.kinematics import Kinematics
from controller.machine.model import Kind, Machine
from controller.messages import Key, message
from controller.motion.motions import Rotaries
from controller.plan.context import Context
from controller.plan.rotaries.branch import BranchLost, Field, field, joints_on
from controller.plan.rotaries.turns import wrapped
from controller.plan.rotaries.winding import Way
from controller.plan.segment import Segment
from controller.plan.surfaces import audit, rates
from controller.plan.surfaces.cuts import Cut, turn
from controller.program.program import ProgramError

PLACES = 33  # of a cut, at which its speed is looked at
TINY = 1e-30
SAME_TIME = 1.03  # times the least: for less travel a cut may be slower by less than that


@dataclass(frozen=True, slots=True)
class CutSegment:
    """One cut with its rotaries followed: samples ``u`` (N,), ``rotaries`` (N, 2), ``joints`` (N, axes)."""

    cut: Cut
    u: Array
    rotaries: Array
    joints: Array

    @property
    def start(self) -> Rotaries:
        return float(self.rotaries[0, 0]), float(self.rotaries[0, 1])

    @property
    def end(self) -> Rotaries:
        return float(self.rotaries[-1, 0]), float(self.rotaries[-1, 1])

    @property
    def segment(self) -> Segment:
        """The cut itself."""
        block = self.cut.block
        start, end = tuple(self.joints[0].tolist()), tuple(self.joints[-1].tolist())
        named = (block.place, block.feed_mm_s, True, start, end, True, "cut")
        return Segment(self.cut.motion, *named, share=self.cut.part)

    @property
    def ends(self) -> CutSegment:
        """Its first and its last sample alone, which are all that a path asks for: the others take 20 kB."""
        both = [0, -1]
        return CutSegment(self.cut, self.u[both], self.rotaries[both], self.joints[both])

    def shifted(self, machine: Machine, by: Rotaries) -> CutSegment:
        """The same leg in other whole turns (rad) of the two rotaries."""
        joints = self.joints.copy()
        for i, turn_rad in zip(machine.rotary(), by, strict=False):
            joints[:, i] += turn_rad
        return CutSegment(self.cut, self.u, self.rotaries + np.array(by), joints)


class Fields:
    """Both branches of each cut of a train, solved one after the other: of a thousand one is kept."""

    def __init__(self, cuts: Sequence[Cut], kinematics: Kinematics) -> None:
        self.cuts, self.kinematics = cuts, kinematics
        self._known: tuple[int, Field] | None = None

    def of(self, i: int) -> Field:
        """Of the i-th cut; raises BranchLost."""
        if self._known is None or self._known[0] != i:
            self._known = i, field(self.cuts[i].motion, self.kinematics)
        return self._known[1]

    @cached_property
    def free(self) -> bool:
        """Whether a rotary may begin the train wherever it stands (a tool axis on the pole)."""
        return bool(np.isnan(self.of(0).pairs[:, 0]).any())


@dataclass(frozen=True, slots=True)
class Option:
    """A train followed on one branch, in some whole turn; the legs are ``ends`` alone, or whole."""

    legs: tuple[CutSegment, ...]
    way: Way

    def shifted(self, machine: Machine, by: Rotaries) -> list[CutSegment]:
        return [leg.shifted(machine, by) for leg in self.legs]


def options(fields: Fields, context: Context, near: Rotaries, whole: bool = False) -> list[Option]:
    """The train followed from each branch of its start; refuses where neither can be followed."""
    found = [_Followed(context.machine), _Followed(context.machine)]
    ways = [_followed(fields, branch, near, context) for branch in (0, 1)]
    for _ in fields.cuts:  # both side by side, so that a field is solved once
        for one, way in zip(found, ways, strict=True):
            one.take(way, whole)
    if found[0].refusal and found[1].refusal:
        raise found[0].refusal
    return [Option(tuple(one.legs), one.way()) for one in found if one.refusal is None]


def timed(found: Sequence[Option], context: Context) -> list[Option]:
    """The options with by how much each is slower than the other, where there are two to choose from."""
    if sum(option.way.inside for option in found) < 2:
        return list(found)
    seconds = [_cut_s(option.legs, context) for option in found]
    least = min(seconds)
    slower = [each - least if each > SAME_TIME * least else 0.0 for each in seconds]
    return [
        replace(option, way=replace(option.way, slower_s=each))
        for option, each in zip(found, slower, strict=True)
    ]


def _cut_s(legs: Sequence[CutSegment], context: Context) -> float:
    """About the time (s) of a train's cuts, which begin and end as fast as they may.

    At the feed, or at what the joints' limits leave of it; from place to place no faster than one of them
    can gain or lose speed.
    """
    velocity, acceleration, jerk = rates.limits(context.machine).T
    speeds, gains, ways = list[float](), list[float](), list[float]()
    for leg in legs:
        segment = leg.segment
        s = np.linspace(0.0, segment.motion.end, PLACES)
        d = rates.derivatives(segment, s, context.kinematics)
        most = np.minimum(segment.feed_at(s), d.even_speed(velocity, acceleration, jerk))
        speeds += most.tolist()
        gains += (acceleration / (np.abs(d.first) + TINY)).min(axis=1).tolist()
        ways += [0.0, *np.diff(s).tolist()]
    speeds = _reachable(speeds, gains, ways[1:])
    speeds = _reachable(speeds[::-1], gains[::-1], ways[:0:-1])[::-1]
    pairs = zip(ways[1:], itertools.pairwise(speeds), strict=True)
    return sum(2.0 * way / max(v + w, TINY) for way, (v, w) in pairs)


def _reachable(speeds: Sequence[float], gains: Sequence[float], ways: Sequence[float]) -> list[float]:
    """Of speeds (N,) what is reached from the one before, over each of N - 1 ways, by its acceleration."""
    found = [speeds[0]]
    for most, gain, way in zip(speeds[1:], gains[:-1], ways, strict=True):
        found.append(min(most, math.sqrt(found[-1] ** 2 + 2.0 * gain * way)))
    return found


def _followed(fields: Fields, branch: int, near: Rotaries, context: Context) -> Iterator[CutSegment]:
    for i, cut in enumerate(fields.cuts):
        try:
            if i:
                near = _turned(fields, i, near)
            found = fields.of(i)
            start = _start(found.pairs[branch if i == 0 else slice(None), 0], near)
            rotaries = found.follow(start)
        except BranchLost as lost:
            where = audit.at_place(cut, lost.u)
            context.refuse(cut.block.place, message("reach.lost", reason=Key(lost.reason), where=where))
        leg = CutSegment(cut, found.u, rotaries, joints_on(cut.motion, found.u, rotaries, fields.kinematics))
        near = leg.end
        yield leg


def _turned(fields: Fields, i: int, near: Rotaries) -> Rotaries:
    """The rotaries after the turn that leads to the i-th cut, if there is one."""
    way = turn(fields.cuts[i - 1], fields.cuts[i])
    if way is None:
        return near
    first, second = field(way, fields.kinematics).follow(near)[-1]
    return float(first), float(second)


class _Followed:
    """A train as it is followed on one branch: its legs, and what they ask of the rotaries."""

    def __init__(self, machine: Machine) -> None:
        self.legs: list[CutSegment] = []
        self.refusal: ProgramError | None = None
        self._machine = machine
        self._travel, self._negative, self._inside = 0.0, False, True
        self._low, self._high = np.full(2, np.inf), np.full(2, -np.inf)

    def take(self, way: Iterator[CutSegment], whole: bool) -> None:
        """The next leg, if there is one."""
        if self.refusal is not None:
            return
        try:
            leg = next(way)
        except ProgramError as error:
            self.refusal = error
            return
        if not self.legs:
            tilts = leg.rotaries[:, tilt_of(self._machine)]
            self._negative = bool(tilts[np.argmax(np.abs(tilts))] < -1e-9)
        place = self.legs[-1].rotaries[-1] if self.legs else leg.rotaries[0]
        turned = np.abs(np.diff(leg.rotaries, axis=0)).sum()
        self._travel += float(np.abs(leg.rotaries[0] - place).sum() + turned)
        low, _, high, _ = audit.extremes(leg.u, leg.rotaries)
        self._low, self._high = np.minimum(self._low, low), np.maximum(self._high, high)
        self._inside &= audit.outside(self._machine, leg.u, leg.joints, rotary=False) is None
        self.legs.append(leg if whole else leg.ends)

    def way(self) -> Way:
        """All of it."""
        return Way(
            start=self.legs[0].start,
            end=self.legs[-1].end,
            low=(float(self._low[0]), float(self._low[1])),
            high=(float(self._high[0]), float(self._high[1])),
            travel=self._travel,
            negative=self._negative,
            inside=self._inside,
            tilt=tilt_of(self._machine),
        )


def _start(pairs: Array, near: Rotaries) -> Rotaries:
    """Of the given branches the one nearest ``near``, in the nearest turn; a free rotary stays."""
    away = np.nan_to_num(wrapped(np.atleast_2d(pairs) - np.array(near)))
    first, second = away[int(np.argmin((away * away).sum(axis=1)))]
    return near[0] + float(first), near[1] + float(second)


def tilt_of(machine: Machine) -> int:
    """Which rotary of the pair (0 or 1) stands next to the tool: it tilts, the other one turns."""
    _, second = machine.pair([axis.kind for axis in machine.axes], Kind.LINEAR)
    return 1 if second is Kind.HEAD else 0
