"""What the service's process and its plan's process say to each other.

One order at a time is carried out, and answered once; meanwhile and afterwards the plan reports
by itself how far it is.
"""

from __future__ import annotations

import time
from bisect import bisect_right
from dataclasses import dataclass, field
from typing import Any

from controller.geometry.curves import ArcLength
from controller.ipc.handoff import Snapshot
from controller.machine.changes import Change
from controller.machine.model import Joints, Machine
from controller.messages import Message, message
from controller.plan.planner import Touch
from controller.plan.report.passing import place_of
from controller.plan.restart.program_position import LinePart, Spot, part_at
from controller.plan.timetable import Passed, Timetable
from controller.program.modal import State, power_on
from controller.program.program import Changing
from controller.state.modes import Fault, Mode, fault_message

POWER_ON = power_on()


@dataclass(frozen=True, slots=True)
class Program:
    """What is to be run, and how much of it."""

    text: bytes
    name: str
    machine: Machine  # with what is fitted
    spot: Spot | None = None  # to begin with; None = from the top
    start: Joints | None = None  # where the whole run started that ``spot`` is of; None = homed position
    dry_run_mm: float = 0.0  # off along the tool axis, spindle off
    in_spindle: int = 0  # number of the tool; 0 = not known
    typed: bool = False  # a line by hand
    unchecked: bool = False  # it is read as it is run, and what is refused of it is refused on the way
    begin: State | None = None  # the modal state before its first line; None: that of power-on
    cut_with: Machine | None = None  # with the tools that have cut what is before ``spot``; None: not known


@dataclass(frozen=True, slots=True)
class Order:
    """``verb``: "commission", "home" (axes), "terminals" (of one), "check" or "arm" (program), "drop",
    "retract" (mm), "return", "beside" (program: how far the machine stands off it).

    A "return" with a program: other tools were fitted meanwhile, and this is it with them.
    """

    number: int
    verb: str
    axes: tuple[int, ...] = ()
    program: Program | None = None
    distance_mm: float = 0.0
    tool: int = 0  # number of the one in the spindle; 0 = not known


@dataclass(frozen=True, slots=True)
class Answer:
    """Of one order: what came of it, or why not."""

    number: int
    facts: dict[str, Any] = field(default_factory=dict)
    error: tuple[Any, ...] | None = None  # what a CommandRefused is made of: code, what is said ...


@dataclass(frozen=True, slots=True)
class Turn:
    """The planner acted on the snapshot of this tick."""

    tick: int
    value: float  # how much time (s) it had for itself; of a retract its way (mm), of a return the tool
    verb: str = "plan"  # or "retract", "return": a way beside the path was asked for
    refitted: bool = False  # returned with what is fitted by now


@dataclass(frozen=True, slots=True)
class MotionFacts:
    """What a motion is, for those who look on."""

    end: Joints
    feed_mm_s: float | None  # programmed; None = rapid. Degrees a second where only rotaries turn
    name: str  # 'cut', 'lead in', 'retract' ...
    tool: int | None = None  # number of the one that the program has changed to; None: the one it began with
    state: State = POWER_ON  # the modal state in which it begins
    end_s: float = 0.0  # of the motion, in the unit of the snapshot's s
    arc: ArcLength | None = None  # of a surface: which u an s is
    feed_steps: tuple[tuple[float, float], ...] = ()  # (s, feed) where lines of a row have others
    lines: tuple[LinePart, ...] = ()  # of which program lines it is; a way aside is of none
    states: tuple[tuple[float, State], ...] = ()  # (s from which it is in force, state) where lines differ
    share: tuple[float, float] = (0.0, 1.0)  # of the block's u, that a surface cut is

    def place(self, s: float) -> Passed | None:
        """Of the program, as a check marks it."""
        if not self.lines:
            return None
        part, fraction = part_at(self.lines, s)
        return place_of(self.name, part.order, fraction, s)

    def state_at(self, s: float) -> State:
        """The modal state of the line that is under way there."""
        found = bisect_right(self.states, s, key=lambda one: one[0])
        return self.states[found - 1][1] if found else self.state

    def fraction(self, s: float) -> float:
        """Of the program line that is done at ``s``."""
        if not self.lines:
            return 0.0
        return part_at(self.lines, s)[1]

    def in_block(self, s: float) -> dict[str, Any]:
        """What the motion is, the share of it that is done at ``s``, and on a surface the u of its block."""
        done = min(1.0, max(0.0, s / self.end_s)) if self.end_s > 0.0 else 0.0
        begins, ends = self.share
        u = None if self.arc is None else begins + (ends - begins) * self.arc.u_at(s)
        return {"what": self.name, "fraction": done, "u": u}


@dataclass(frozen=True, slots=True)
class Announcement:
    """What a program says, sets for good, names as the tool that comes next, or asks of the operator.

    Due when a motion begins, or when the pause of ``line`` before it holds.
    """

    text: str
    motion_id: int
    line: int | None = None
    changes: tuple[Change, ...] = ()
    tool: int | None = None
    rev_min: float | None = None  # signed: the operator is to turn the spindle so


@dataclass(frozen=True, slots=True)
class News:
    """The plan reports it as it comes about."""

    finished: bool = True  # all of the path has been sent
    left: State | None = None  # the modal state after all of the program, once that has been read
    whole: bool = False  # ... and nothing of it was dropped or refused
    refusal: Message | None = None  # why it ends before its end; the machine stands before that block
    tool: int | None = None  # to which the program has changed, as far as it is read
    aside: bool = False  # the tool stands off the path, and must return before the program goes on
    returning: bool = False  # it is on its way back, or held there
    checking: float | None = None  # share of the program's lines that are checked
    ways: dict[int, MotionFacts] = field(default_factory=dict)  # motions that were sent since, by their id
    changes: dict[int, tuple[int, ...]] = field(default_factory=dict)  # tools asked for since, by their line
    marks: tuple[Changing, ...] = ()  # stops of a tool changer, read since
    turns: tuple[Turn, ...] = ()  # since the last news
    messages: tuple[Announcement, ...] = ()  # of the program, read since
    touches: tuple[Touch, ...] = ()  # of probing moves that have ended since
    timetable: Timetable | None = None  # of the rest, where it has become another one, or a longer one


# What the plan has sent for an order, and the tick has yet to take: it may never, and that must be reported.
#
# A plan is made for the machine as it stands. A stop, a jog or a fault between the order and the
# tick's next look makes it void; whoever waits for it would wait for nothing.

TAKEN_TIMEOUT_S = 120.0  # for the first window to be planned and taken


@dataclass(frozen=True, slots=True)
class Awaited:
    """The first message that is planned for an order."""

    order: int
    before: int  # the message that was accepted last
    mode: Mode  # the only one in which it is taken
    queue: tuple[int, Joints]  # what it is planned for: the epoch, and where the axes stand
    give_up_s: float

    @classmethod
    def of(cls, order: Order, now: Snapshot) -> Awaited:
        """``now``: what was planned from."""
        mode = Mode.READY if order.verb == "arm" else Mode.HOLD
        return cls(order.number, now.accepted, mode, _queue(now), time.monotonic() + TAKEN_TIMEOUT_S)

    def taken(self, now: Snapshot) -> bool:
        return now.accepted > self.before

    def in_vain(self, now: Snapshot) -> tuple[Any, ...] | None:
        """Why the tick will not take it any more, as the error of an answer; None while it may."""
        if now.mode is not self.mode:
            return _by_now(now)
        if _queue(now) != self.queue:  # a stop that had been on its way, or a jog
            return _refused("stopped")
        return _refused("not_taken") if time.monotonic() > self.give_up_s else None


def _queue(now: Snapshot) -> tuple[int, Joints]:
    return now.epoch, now.joints


def _refused(key: str, mode: str = "") -> tuple[Any, ...]:
    """As the error of an answer."""
    return "refused", message(key, mode=mode, request=""), mode, ""


def _by_now(now: Snapshot) -> tuple[Any, ...]:
    """The mode that the machine has come to; of a fault with which, and what to do."""
    mode = now.mode.name
    return (
        _refused("by_now", mode)
        if now.fault is Fault.NONE
        else ("refused", fault_message(now.fault), mode, "")
    )
