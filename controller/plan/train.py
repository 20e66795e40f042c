"""Cuts that run through: which blocks join, and on which branch and turns all of them are cut.

A train is a row of blocks between one approach and one departure. Inside it the
rotaries have no choice: they follow the tool axis. The choice is made once, at its
start, for all of it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import NoReturn

import numpy as np
import numpy.typing as npt

from controller.kinematics import Kinematics
from controller.machine import Kind, Machine
from controller.motions import Rotaries
from controller.plan import audit
from controller.plan.branch import TURN, BranchLost, Field, field, joints_on, wrapped
from controller.plan.cuts import Cut, apart, turned
from controller.plan.program import ProgramError
from controller.plan.stretch import Voice

Array = npt.NDArray[np.float64]

SAME_MM = 1e-6
SAME_RAD = math.radians(1e-6)
SAME_ROTARY_RAD = 1e-6  # rotaries nearer than this at a joint run through, as the poses do
FLAT_MM = 1e-6  # a concave corner that costs less overcut than this is rounding of the program
TURNED_BACK_RAD = math.pi - 1e-6


class Meeting(Enum):
    """How one cut follows another."""

    JOIN = "joins"
    PIVOT = "pivots"
    APART = "apart"


def meet(before: Cut, after: Cut, voice: Voice) -> Meeting:
    """Whether two blocks run through, pivot or need a departure; refuses a concave corner."""
    meeting, sentence = _meeting(before, after, voice)
    line = before.block.place.line
    voice.tell(after.block.place, sentence.format(f"the block of line {line}"))
    return meeting


def _meeting(before: Cut, after: Cut, voice: Voice) -> tuple[Meeting, str]:
    a, b = before.block.modal, after.block.modal
    differ = [
        name
        for name, same in (
            ("tool", a.tool == b.tool),
            ("work offset", a.offset == b.offset),
            ("side", a.side == b.side),
        )
        if not same
    ]
    if differ:
        return Meeting.APART, f"Departs from {{}} and approaches again: another {' and '.join(differ)}."
    end, start = before.end, after.start
    if apart(end.axis, start.axis) > SAME_RAD or apart(end.contact, start.contact) > SAME_MM:
        return Meeting.APART, "Departs from {} and approaches again: it ends elsewhere or on another ruling."
    if apart(end.tip, start.tip) <= SAME_MM:
        return Meeting.JOIN, "Joins {}: the poses agree and the cut runs through."
    return _corner(before, after, voice)


def _corner(before: Cut, after: Cut, voice: Voice) -> tuple[Meeting, str]:
    """Ends meet on one ruling, the normals differ.

    With the cutter on the right a turn to the left leads it round the outside of the
    edge (convex), a turn to the right into a corner; on the left, the other way about.
    """
    angle = turned(before.end, after.start)
    radius, degrees = after.tool.radius_mm, math.degrees(abs(angle))
    if abs(angle) > TURNED_BACK_RAD:
        return Meeting.APART, "Departs from {} and approaches again: it turns straight back."
    if after.side * angle < 0.0 and radius * (1.0 - math.cos(angle)) > FLAT_MM:
        voice.refuse(
            after.block.place,
            f"this block meets the one of line {before.block.place.line} in a concave corner of "
            f"{degrees:.4f} degrees; a cutter of radius {radius:.3f} mm would cut into one of the two; "
            "blend the corner with a surface of a larger radius, or cut on the other side",
        )
    return Meeting.PIVOT, f"Pivots by {degrees:.4f} degrees about the ruling it shares with {{}}."


@dataclass(frozen=True, slots=True)
class Leg:
    """One cut with its rotaries followed: samples ``u`` (N,), ``rotaries`` (N, 2), ``joints`` (N, 5)."""

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

    def shifted(self, machine: Machine, turns: Sequence[int]) -> Leg:
        """The same leg in other whole turns of the two rotaries."""
        by = TURN * np.array(turns, dtype=float)
        joints = self.joints.copy()
        joints[:, machine.rotary()] += by
        return Leg(self.cut, self.u, self.rotaries + by, joints)


def choose(
    cuts: Sequence[Cut], machine: Machine, kinematics: Kinematics, now: Rotaries, voice: Voice
) -> list[Leg]:
    """The legs of a train on the branch and turns DESIGN section 1 asks for, all joints inside travel.

    Least rotary travel of the train with its approach from ``now``, then positive
    tilt, then smaller abs(rotary), then positive rotary; of these the first that
    keeps all five joints inside their travel over the whole train.
    """
    options = _options(cuts, kinematics, now, voice)
    shifted = [legs for option in options for legs in _in_turns(option, machine, now)]
    shifted.sort(key=lambda legs: _rank(legs, machine, now))
    for legs in shifted:
        if all(audit.outside(machine, leg.u, leg.joints) is None for leg in legs):
            return legs
    _refuse_travel(shifted[0], machine, voice)


def _refuse_travel(legs: Sequence[Leg], machine: Machine, voice: Voice) -> NoReturn:
    for leg in legs:
        excess = audit.outside(machine, leg.u, leg.joints)
        if excess is not None:
            where = audit.at_place(leg.cut, float(leg.u[excess.sample]))
            voice.refuse(leg.cut.block.place, audit.describe(machine.axes[excess.axis], excess, where))
    raise AssertionError("a train was refused for its travel but is inside")


def _options(cuts: Sequence[Cut], kinematics: Kinematics, now: Rotaries, voice: Voice) -> list[list[Leg]]:
    """The train followed from each branch of its start; refuses where neither can be followed."""
    options: list[list[Leg]] = []
    refusal: ProgramError | None = None
    fields: dict[int, Field] = {}
    for branch in (0, 1):
        try:
            options.append(_followed(cuts, branch, fields, kinematics, now, voice))
        except ProgramError as error:
            refusal = refusal or error
    if not options and refusal is not None:
        raise refusal
    return options


def _followed(
    cuts: Sequence[Cut],
    branch: int,
    fields: dict[int, Field],
    kinematics: Kinematics,
    now: Rotaries,
    voice: Voice,
) -> list[Leg]:
    legs: list[Leg] = []
    near = now
    for i, cut in enumerate(cuts):
        try:
            found = fields.get(i) or field(cut.motion, kinematics)
            fields[i] = found
            start = _start(found.pairs[branch if i == 0 else slice(None), 0], near)
            rotaries = found.follow(start)
        except BranchLost as lost:
            sentence = f"{lost.reason}{audit.at_place(cut, lost.u)}; tilt the part or split the block there"
            voice.refuse(cut.block.place, sentence)
        legs.append(Leg(cut, found.u, rotaries, joints_on(cut.motion, found.u, rotaries, kinematics)))
        near = legs[-1].end
    return legs


def _start(pairs: Array, near: Rotaries) -> Rotaries:
    """Of the given branches the one nearest ``near``, in the nearest turn; a free rotary stays."""
    away = np.nan_to_num(wrapped(np.atleast_2d(pairs) - np.array(near)))
    first, second = away[int(np.argmin((away * away).sum(axis=1)))]
    return near[0] + float(first), near[1] + float(second)


def _in_turns(legs: Sequence[Leg], machine: Machine, now: Rotaries) -> Iterator[list[Leg]]:
    """The same train in the whole turns that matter: nearest to ``now`` and inside travel."""
    choices = []
    for k, index in enumerate(machine.rotary()):
        axis = machine.axes[index]
        ends = [audit.extremes(leg.u, leg.rotaries[:, k : k + 1]) for leg in legs]
        low, high = min(float(e[0][0]) for e in ends), max(float(e[2][0]) for e in ends)
        first = math.ceil((axis.travel_min - low - audit.ROUNDING) / TURN)
        last = math.floor((axis.travel_max - high + audit.ROUNDING) / TURN)
        if first > last:  # too long for the travel in any turn: shown where it is least too long
            choices.append({round((axis.travel_min + axis.travel_max - low - high) / (2.0 * TURN))})
            continue
        nearest = (now[k] - legs[0].start[k]) / TURN
        choices.append({min(max(n, first), last) for n in (math.floor(nearest), math.ceil(nearest))})
    for turns in itertools.product(*choices):
        yield [leg.shifted(machine, turns) for leg in legs]


def _rank(legs: Sequence[Leg], machine: Machine, now: Rotaries) -> tuple[float, bool, float, bool]:
    tilt = tilt_of(machine)
    travel, place = 0.0, np.array(now)
    for leg in legs:
        travel += float(np.abs(leg.rotaries[0] - place).sum() + np.abs(np.diff(leg.rotaries, axis=0)).sum())
        place = leg.rotaries[-1]
    tilts = legs[0].rotaries[:, tilt]
    rotary = legs[0].start[1 - tilt]
    negative = bool(tilts[np.argmax(np.abs(tilts))] < -1e-9)
    return round(travel, 9), negative, round(abs(rotary), 9), rotary < 0.0


def tilt_of(machine: Machine) -> int:
    """Which rotary of the pair (0 or 1) stands next to the tool: it tilts, the other one turns."""
    _, second = machine.rotary()
    return 1 if machine.axes[second].kind is Kind.HEAD else 0
