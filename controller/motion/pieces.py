"""What the plan hands to the tick: pieces of motion with their laws, and stops prepared for every moment.

Values only; how they travel is ``handoff``'s, which also offers these names.

Plan time is on the tick's grid: every run from rest to rest is padded to a whole number
of periods, so a SYNC falls on a multiple of the period wherever the machine stood before.
"""

from __future__ import annotations

import math
from array import array
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from controller.motion.motions import Motion

DEAD_MAN_S = 0.200  # a jog without length that is not asked for again stops after this
STANDSTILL = -1  # motion id of a dwell: no motion, the joints stay
FIRST_MARK = -2  # of the stops between the steps of a tool changer, counted down from here

Quintic = tuple[float, float, float, float, float, float]


@dataclass(frozen=True, slots=True)
class Law:
    """Distance along a motion over time: s(t) = sum c_k (t - knot_i)^k between knots.

    ``knots_s`` has n + 1 rising times from 0.0; ``coefficients`` n rows c0 .. c5 in
    units of ``s`` and seconds.
    """

    knots_s: tuple[float, ...]
    coefficients: tuple[Quintic, ...]

    @property
    def duration_s(self) -> float:
        return self.knots_s[-1]

    def at(self, t: float) -> tuple[float, float, float]:
        """(s, ds/dt, d2s/dt2) at ``t``, clamped to the law's own time."""
        index = 0
        while index < len(self.coefficients) - 1 and t >= self.knots_s[index + 1]:
            index += 1
        c0, c1, c2, c3, c4, c5 = self.coefficients[index]
        x = min(max(t, 0.0), self.knots_s[-1]) - self.knots_s[index]
        return (
            c0 + x * (c1 + x * (c2 + x * (c3 + x * (c4 + x * c5)))),
            c1 + x * (2 * c2 + x * (3 * c3 + x * (4 * c4 + x * 5 * c5))),
            2 * c2 + x * (6 * c3 + x * (12 * c4 + x * 20 * c5)),
        )


STILL = Law((0.0, 0.0), ((0.0, 0.0, 0.0, 0.0, 0.0, 0.0),))


class Jog(NamedTuple):
    """Motion by hand along a straight line of the joints: q = q0 + p ``direction``.

    Without a ``length`` it goes on as long as it is asked for again and again (``DEAD_MAN_S``), else
    until p = ``length``. Joints in mm and rad; ``speed`` is dp/dt.
    """

    direction: tuple[float, ...]  # of each axis
    speed: float
    length: float = math.inf

    @property
    def is_sound(self) -> bool:
        """Whether a machine may be asked for it: finite, forward, and along something."""
        finite = all(map(math.isfinite, self.direction)) and math.isfinite(self.speed)
        return finite and any(self.direction) and self.speed > 0.0 and self.length >= 0.0


class Awaited(NamedTuple):
    """An input that motion waits for."""

    mask: int  # of the node's inputs
    on: bool
    edge: bool  # it must change to that while it is waited for
    ticks: int  # at most


COMMIT_LEAD_S = 0.020  # the commit point is at least this far ahead of the path clock ...
COMMIT_LEAD_TICKS = 3  # ... and at least this many ticks


def commit_lead_s(period_s: float) -> float:
    """How far ahead of the path clock the queue can no longer be changed (s)."""
    return max(COMMIT_LEAD_S, COMMIT_LEAD_TICKS * period_s)


class Sensing(NamedTuple):
    """Where a probing begins, or ends: at a piece that ``sets``."""

    mask: int  # of the node's inputs: the probe's, or the tool setter's
    on: bool  # what the input is to come to: on = touched
    ends: bool
    latched: bool  # the drives store where they are at the edge
    latency_s: float  # of the input, from the touch to its frame
    late_ticks: int  # the same in whole ticks


class Piece(NamedTuple):
    """A segment of one motion with its law; starts where the piece before it ends.

    The marks count at its end, where the law is at rest: ``stop`` always (M0),
    ``optional_stop`` if the operator wants optional stops (M1), ``block_end`` if he wants
    single blocks. Each of these means HOLD until RESUME. At ``sets`` the clock stands
    until spindle, coolant and clamps are as the piece says.
    """

    motion_id: int  # STANDSTILL for a dwell, and below it the marks of a tool changer
    line: int  # 1-based line of the text, 0 = none
    law: Law
    duration_s: float
    cutting: bool = False
    rapid: bool = False
    override: float = 1.0  # share of F (of the rapid speed, for rapids) at which it was planned
    stop: bool = False
    optional_stop: bool = False
    block_end: bool = False
    end: bool = False  # the program ends with it: READY
    sets: bool = False  # spindle, coolant and clamps are told at its end, and waited for
    spindle_rev_min: float = 0.0  # signed
    max_rev_min: float = math.inf  # with its tool, whatever the override
    coolant: int = 0  # 0 off, 1 mist, 2 flood, 3 both
    open_clamps: int = 0  # bit i: the clamp of the i-th axis is to be open
    # Outputs of programs, on and off, and analogue ones, from its beginning on (sets: its end).
    outputs: tuple[int, int, tuple[tuple[int, float], ...]] = (0, 0, ())
    awaits: Awaited | None = None  # where it sets: motion goes on when it is so
    lifts: tuple[int, int] | None = None  # where it sets: inputs that forbid nothing till then, and after
    binds: tuple[tuple[float, int], ...] = ()  # (time within the piece, code from then on): see state.Binding
    own_feed: bool = False  # the override of feeds does not count in it (M49, M50 P0)
    heeds_stop: bool = True  # the input feed_stop does (M53)
    adaptive: bool = False  # as that override counts, the load of the spindle does, too (M52 P1)
    senses: Sensing | None = None  # where it sets
    guarded: bool = False  # a probe in the spindle must not touch


def dwell(
    seconds: float, line: int = 0, stop: bool = False, end: bool = False, optional_stop: bool = False
) -> Piece:
    """A piece that stands still for ``seconds`` (0.0 only carries a mark)."""
    return Piece(STANDSTILL, line, STILL, seconds, stop=stop, optional_stop=optional_stop, end=end)


@dataclass(frozen=True, slots=True)
class StopTable:
    """Stops that leave the plan at plan times start_s, start_s + step_s, start_s + 2 step_s ...

    Stop i begins with the plan's own s, v and a of its time and follows the path with the
    constant jerks ``jerks[first[i] : first[i + 1]]``, each for ``jerk_step_s``; with the last it is at
    rest. No jerks: no stop can begin there (the plan itself is as quick), take the next.
    All three times are whole numbers of periods. Jerks are in the unit of the motion's s per s^3, and s
    runs on from one motion into the next.
    """

    start_s: float
    step_s: float
    jerk_step_s: float
    first: array[int]  # typecode "i", one more than there are stops; rising from 0
    jerks: array[float]  # typecode "d"

    @classmethod
    def of(
        cls, start_s: float, step_s: float, jerk_step_s: float, rows: Iterable[Sequence[float]]
    ) -> StopTable:
        """A table of the jerks of each stop."""
        first, jerks = array("i", [0]), array("d")
        for row in rows:
            jerks.extend(row)
            first.append(len(jerks))
        return cls(start_s, step_s, jerk_step_s, first, jerks)

    def __len__(self) -> int:
        return len(self.first) - 1

    @property
    def end_s(self) -> float:
        """The first time without an entry."""
        return self.start_s + len(self) * self.step_s

    def shifted(self, by_s: float) -> StopTable:
        """The same stops at other plan times."""
        return StopTable(self.start_s + by_s, self.step_s, self.jerk_step_s, self.first, self.jerks)

    def parts(self, values: int) -> Iterator[StopTable]:
        """The same stops in tables one behind the other: of so many stops and jerks, or of one stop."""
        first, i = self.first, 0
        while i < len(self):
            j = bisect_right(range(len(first)), first[i] + i + values, lo=i, key=lambda k: first[k] + k) - 1
            j = max(j, i + 1)
            rows = array("i", [k - first[i] for k in first[i : j + 1]])
            start_s = self.start_s + i * self.step_s
            yield StopTable(start_s, self.step_s, self.jerk_step_s, rows, self.jerks[first[i] : first[j]])
            i = j


@dataclass(frozen=True, slots=True)
class PieceMessage:
    """Everything from ``replace_from_s`` on, to a standstill. No pieces and no motions: a keepalive.

    ``epoch`` is the tick's count of queues given up, as the planner last saw it: a message made for
    another queue is refused. ``alone``: nothing of the queue stays, not even the marks that are still to come
    where the clock stands. So a way off the path, or back to it, begins: those marks are of the program.
    """

    sequence: int  # counts up from 1
    replace_from_s: float  # plan time
    motions: dict[int, Motion] = field(default_factory=dict)  # those the tick has not had yet
    pieces: tuple[Piece, ...] = ()
    stops: tuple[StopTable, ...] = ()
    epoch: int = 0
    alone: bool = False

    @property
    def is_keepalive(self) -> bool:
        return not self.pieces
