"""Adaptive feed: the load that the spindle tells leads the feed, so that it stays at a target.

The law, of one share x of the programmed feed, with the machine file's ``[spindle] adaptive``:

    wanted     w = u target / load      u: the share of F at which the motion runs now, over the override
               within min_share and max_share; above 1 only while the load is half of the target or more
    response   x' = (w - x) / fall_s where w < x, (w - x) / rise_s where it is not

A load that grows with the feed is at its target where u = w, whatever u is now: a plan that answers late
neither overshoots nor swings, as long as the load follows the feed within ``fall_s``. The planner takes
the share as it takes the operator's override, and multiplies it into that: F x override x share, within
every axis' limits. It is told a new one where x has gone off by ``STEP`` of it, so the load settles within
``BAND`` of the target, or below it where the greatest share is reached.

It counts where the override of feeds does, and the program (M52 P1) or the operator's switch says so: in
no rapid, thread or probing move, not under M49 and M50 P0. x stays where it is

    in all of these, in a pause, a hold, and while the spindle stands or is not at speed
    on the ramps from one speed to another
    where an axis' limit holds the speed down and not the feed; there it may fall, but not rise

and it is 1 at the start of a program. A load that is not told any more is one that may be too high: x falls
to ``min_share``, and a warning says why. A load of ``overload`` or more for ``overload_s`` holds the motion.

Nothing here allocates what stays, or raises.
"""

from __future__ import annotations

from typing import Protocol

from controller.machine.model import AdaptiveFeed, Machine
from controller.motion.pieces import Piece
from controller.state.modes import Binding, Fault, Mode
from controller.tick.mode import Modes

STEP = 0.03  # of the share: so far off what the planner knows, it is told
BAND = 0.05  # of the target: so near to it the load settles
NEAR_END = 0.005  # of the share: it has come to its least or its greatest
CUTS = 0.5  # of the target: a load below it may be that of the air
MIN_LOAD = 1e-3
DEAF_SYNCS = 5  # without a load: what was told last is old
IN_PROGRAM = (Mode.RUNNING, Mode.HOLD, Mode.STOPPING, Mode.JOG)


class Loaded(Protocol):
    """What is needed of ``drives.cyclic.spindle``."""

    load: float
    unheard: int


class Followed(Protocol):
    """What is needed of ``follow``."""

    piece: Piece | None
    feed: float
    limited_by: int


def target_share(law: AdaptiveFeed, acting: float, load: float) -> float:
    """The share of F at which the load would be at its target; it is ``load`` at the share ``acting``."""
    most = law.max_share if load >= CUTS * law.target else min(1.0, law.max_share)
    return max(law.min_share, min(most, acting * law.target / max(load, MIN_LOAD)))


def response(law: AdaptiveFeed, share: float, towards: float, seconds: float) -> float:
    """The share so much later: first order, down fast and up slowly."""
    slow_s = law.fall_s if towards < share else law.rise_s
    return share + (towards - share) * min(1.0, seconds / slow_s)


class Adaptive:
    """The law at work, tick by tick.

    Read: ``present`` (the machine has it), ``on`` (it counts on the motion under the clock), ``share`` (of
    the feed, as the planner is to take it).
    """

    def __init__(self, machine: Machine, spindle: Loaded | None) -> None:
        law = machine.spindle.adaptive if machine.spindle is not None else None
        self._law, self._spindle = law or AdaptiveFeed(), spindle
        self.present = law is not None and spindle is not None
        self._period_s = machine.period_s
        self._overload_ticks = round(self._law.overload_s / machine.period_s)
        self._exact = self.share = 1.0
        self.on = self._deaf = False
        self._over = 0  # ticks

    def watch(self, modes: Modes, follow: Followed, turns: bool, ticks: int) -> None:
        """Every tick, before it moves. ``turns``: the spindle does, at its speed."""
        piece = follow.piece
        self.on = piece is not None and _counts(piece, modes.adaptive_feed)
        if modes.mode not in IN_PROGRAM:
            self._exact = self.share = 1.0
            return
        if not (self.on and modes.running and follow.feed > 0.0 and turns):
            self._over = 0
            self._exact = min(self._exact, 1.0)  # what is cut next may be another cut
        elif self._is_deaf(modes):
            self._move(self._law.min_share, ticks)
        elif piece is not None and self._spindle is not None and modes.override > 0.0:
            load = abs(self._spindle.load)
            self._watch_overload(load, modes, ticks)
            self._answer(
                target_share(self._law, piece.override / modes.override, load), follow.limited_by, ticks
            )
        self._tell()

    def take(self, modes: Modes, follow: Followed, share: float) -> None:
        """In place of ``watch``, in a run that is made again: as it was then."""
        self.on = follow.piece is not None and _counts(follow.piece, modes.adaptive_feed)
        self._exact = self.share = share

    def _is_deaf(self, modes: Modes) -> bool:
        was = self._deaf
        self._deaf = self._spindle is None or self._spindle.unheard > DEAF_SYNCS
        if self._deaf and not was:
            modes.fail(Fault.LOAD_UNKNOWN, -1)
        return self._deaf

    def _watch_overload(self, load: float, modes: Modes, ticks: int) -> None:
        self._over = self._over + ticks if load >= self._law.overload else 0
        if self._over > self._overload_ticks:
            self._over = 0
            modes.fail(Fault.SPINDLE_OVERLOADED, -1)

    def _answer(self, towards: float, limited_by: int, ticks: int) -> None:
        by_feed = limited_by == Binding.FEED
        if by_feed or (limited_by != Binding.NOTHING and towards < self._exact):
            self._move(towards, ticks)

    def _move(self, towards: float, ticks: int) -> None:
        law = self._law
        exact = response(law, self._exact, towards, ticks * self._period_s)
        if towards in (law.min_share, 1.0, law.max_share) and abs(exact - towards) < NEAR_END:
            exact = towards
        self._exact = exact

    def _tell(self) -> None:
        """Small steps are not worth a new plan; at its ends it is exact."""
        exact, law = self._exact, self._law
        if abs(exact - self.share) >= STEP * self.share or exact in (law.min_share, 1.0, law.max_share):
            self.share = exact


def _counts(piece: Piece, switch: bool) -> bool:
    feed = piece.motion_id >= 0 and not piece.rapid and not piece.own_feed
    return feed and (piece.adaptive or switch)
