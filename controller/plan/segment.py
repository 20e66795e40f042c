"""What ``path.trace`` returns: chains of segments, pauses between them, and notes.

A segment is one motion with its feed. A chain runs through without a planned stop
and begins and ends at rest; everything else that a program asks for happens at
rest, in a pause.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple

import numpy as np

from controller.geometry.arrays import Array
from controller.geometry.curves import Arc, Line
from controller.geometry.vectors import ROUNDING, Number, Vector, norm, subtract
from controller.machine.kinematics import Kinematics
from controller.machine.model import Joints
from controller.messages import DEFAULT, LANGUAGES, Key, Message, text
from controller.motion.motions import JointMove, Motion, Rotaries, SurfaceCut, ToolLine, ToolSpline
from controller.program.program import (
    ENABLED,
    UNSAID,
    Act,
    Await,
    Changing,
    Lifts,
    Modal,
    Outputs,
    Overrides,
    Place,
    Probing,
)

STANDS_MM = 1e-6  # X Y Z, or a tip, that moves less stands: s is then the turn in degrees, ...
MAX_DEG_PER_MM = 1e5  # ... and where X Y Z move so little beside it that its places are one

MIN_TIP_RATE = 1e-3  # where the tip all but stands the rotaries alone set the speed


def tip_rate(motion: Motion, s: Array) -> Array:
    """Millimetres that the tip moves per unit of s at the places ``s`` (N,); 1 for all but tool lines."""
    if isinstance(motion, ToolLine):
        return np.full(np.shape(s), max(motion.tip_rate, MIN_TIP_RATE))
    if not isinstance(motion, ToolSpline):
        return np.ones(np.shape(s))
    knots = np.frombuffer(motion.knots)
    i = np.clip(np.searchsorted(knots, s, side="right") - 1, 0, len(knots) - 2)
    c = np.frombuffer(motion.spans).reshape(-1, 5, 4)[i, :3]
    h = (s - knots[i])[:, None]
    rate = c[..., 1] + h * (2.0 * c[..., 2] + h * (3.0 * c[..., 3]))
    return np.asarray(np.maximum(np.sqrt((rate * rate).sum(axis=1)), MIN_TIP_RATE))


@dataclass(frozen=True, slots=True)
class Segment:
    """One motion of a block, with its feed and the joints at both ends."""

    motion: Motion
    place: Place
    feed_mm_s: float | None  # in the unit of the motion's s per second; None = rapid
    cutting: bool  # the cutter follows a surface
    start: Joints
    end: Joints
    exact: bool  # G61
    name: str  # 'retract', 'position', 'down', 'plunge', 'lead in', 'cut', 'pivot', 'swivel', ...
    # (s from which it holds, feed mm/s) in rising order, where the feed changes inside the
    # motion; ``feed_mm_s`` is then the first of them. Empty: one feed.
    feed_steps: tuple[tuple[float, float], ...] = ()
    # From s to s inside a spline where the feed is that of s, not of the tip: only rotaries are programmed
    # to move, or s runs on as that of a cut.
    turning: tuple[tuple[float, float], ...] = ()
    # ``Place.order`` of the lines of a spline, in a program with subs or loops; empty: the lines themselves.
    orders: tuple[int, ...] = ()
    outputs: Outputs = UNSAID  # that are switched where it begins
    overrides: Overrides = ENABLED
    guarded: bool = False  # a probe in the spindle must not touch
    # A spline of many lines with all their corners (``lines.exact_rows``): its law and its stops know them.
    is_exact_row: bool = False
    hole: str = ""  # as ``JointLine.hole``
    share: tuple[float, float] = (0.0, 1.0)  # of its block, in the block's u, that a surface cut is

    @property
    def spline(self) -> ToolSpline | None:
        """Its motion where that may be many lines of the program; None: it is of one."""
        return self.motion if isinstance(self.motion, ToolSpline) else None

    @property
    def is_straight(self) -> bool:
        """Whether X Y Z go straight on, or stand, while the rotaries turn evenly."""
        return isinstance(self.motion, JointMove) and isinstance(self.motion.curve, Line)

    @property
    def cut(self) -> SurfaceCut | None:
        """Its motion where the cutter follows a surface."""
        return self.motion if self.cutting and isinstance(self.motion, SurfaceCut) else None

    @property
    def lines(self) -> Sequence[int]:
        """The lines of the program that it is of, in order of their s."""
        return (self.place.line,) if self.spline is None else self.spline.lines

    @property
    def lines_s(self) -> Sequence[float]:
        """Where each of them begins."""
        return (0.0,) if self.spline is None else self.spline.lines_s

    @property
    def line_orders(self) -> Sequence[int]:
        """``Place.order`` of each."""
        return (self.place.order,) if self.spline is None else self.orders or self.spline.lines

    def line_at(self, s: float) -> int:
        """The line of the program at a place of it."""
        return self.place.line if self.spline is None else self.spline.line_at(s)

    def order_at(self, s: float) -> int:
        """``Place.order`` of that line."""
        return self.place.order if self.spline is None else self.line_orders[self.spline.index_at(s)]

    def block_u(self, u: Number) -> Number:
        """The parameter of the block's whole surface at that of the motion's own."""
        return self.share[0] + (self.share[1] - self.share[0]) * u

    def scale(
        self, override: float, rapid_override: float, adaptive: float = 1.0, everywhere: float = 1.0
    ) -> float:
        """The share of its speed that the operator has set, of the two that he sets.

        ``adaptive``: what the load of the spindle leaves of it under M52 P1, ``everywhere``: without.
        """
        if self.feed_mm_s is None:
            return rapid_override
        if not self.overrides.feed:
            return 1.0
        return override * (adaptive if self.overrides.adaptive else everywhere)

    @property
    def even_feed(self) -> float | None:
        """The same speed anywhere on it; None: it changes."""
        if self.spline is not None or self.feed_steps or self.turning:
            return None
        if self.feed_mm_s is None or not isinstance(self.motion, ToolLine):
            return math.inf if self.feed_mm_s is None else self.feed_mm_s
        return self.feed_mm_s / max(self.motion.tip_rate, MIN_TIP_RATE)

    def feed_at(self, s: Array) -> Array:
        """Programmed speed in the unit of s per second at the places ``s`` (N,); inf on rapids.

        F is the feed of the tip: where the tip moves by other than 1 mm per unit of s
        (corners that a spline cuts), s runs that much faster or slower; not where it is to stand.
        """
        if self.feed_mm_s is None:
            return np.full(np.shape(s), math.inf)
        if self.feed_steps:
            starts, feeds = np.array(self.feed_steps).T
            feed = feeds[np.clip(np.searchsorted(starts, s, side="right") - 1, 0, None)]
        else:
            feed = np.full(np.shape(s), self.feed_mm_s)
        return np.asarray(feed / self.tip_rate(s))

    def tip_rate(self, s: Array) -> Array:
        """Millimetres of the tip that count as one of s at the places ``s`` (N,); 1 where it is to stand."""
        rate = tip_rate(self.motion, s)
        for begin, end in self.turning:
            rate[(s >= begin) & (s < end)] = 1.0
        return rate


@dataclass(frozen=True, slots=True)
class ContinuousPath:
    """Segments run through without a planned stop; at rest before and after.

    ``runs_on``: the next chain goes on without a rest; so an endless row of program
    lines comes in parts. ``from_s`` and ``first_id``: a restart begins inside of its first
    segment, which keeps the number it has in the whole program.
    """

    segments: tuple[Segment, ...]
    runs_on: bool = False
    from_s: float = 0.0  # in the unit of the first segment's s; what lies before it is cut already
    first_id: int | None = None  # motion id of the first segment; None: counted on
    optional_stops: frozenset[int] = frozenset()  # orders of the blocks with whose ends it stops if M1 does

    @property
    def place(self) -> Place:
        """Where it begins."""
        return self.segments[0].place


class Wait(NamedTuple):
    """How long the path clock is expected to stand in a pause; see ``plan/waits``."""

    name: str = ""  # of what is waited for; "": nothing
    seconds: float = 0.0
    stops: str = ""  # for whom: a tool changer, the operator; "": for nobody


@dataclass(frozen=True, slots=True)
class Pause:
    """Standstill: a dwell of ``seconds``, or a machine function with the modal state after it."""

    place: Place
    modal: Modal
    seconds: float = 0.0
    act: Act | None = None
    open_clamps: int = 0  # bit i: the clamp of the i-th axis is open from here on
    awaits: Await | None = None  # an input
    probe: Probing | None = None  # begins with it ...
    changing: Changing | None = None  # a stop between two steps of a tool changer
    ends: bool = False  # ... or ends: what comes behind it is read when its outcome is there
    lifts: Lifts | None = None  # guards that do not count in a step of a tool changer, and after it
    turns: bool = False  # a stop at which the operator switches the spindle as the modal state has it
    wait: Wait = field(default=Wait(), repr=False, compare=False)
    segments: ClassVar[tuple[Segment, ...]] = ()  # as a chain has them


PathItem = ContinuousPath | Pause  # what a path is made of


@dataclass(frozen=True, slots=True)
class Note:
    """A decision or a warning that ``check`` shows."""

    place: Place
    said: Message

    @property
    def sentence(self) -> str:
        """In English."""
        return text(self.said)

    def to_json(self, language: str) -> dict[str, object]:
        """For JSON that is read by people."""
        return {"line": self.place.line, "note": text(self.said, language), **self.said}

    @property
    def facts(self) -> dict[str, object]:
        """The same in no language, for whoever tells it."""
        return {"line": self.place.line, **self.said}


def motion_named(name: str) -> Key:
    """The text for the name of a motion; of one that a record has and this version does not, a word."""
    key = f"form.motion.{name}"
    return Key(key if key in LANGUAGES[DEFAULT].texts else "form.motion.other")


@dataclass(frozen=True, slots=True)
class Path:
    """A whole program as motion; ``end`` are the joints where it leaves the machine."""

    items: tuple[PathItem, ...]
    notes: tuple[Note, ...]
    end: Joints


def rotaries_of(joints: Joints, kinematics: Kinematics) -> Rotaries:
    """The pair of rotaries out of joints."""
    return kinematics.rotaries(joints)


def xyz_of(joints: Joints, kinematics: Kinematics) -> Vector:
    """X, Y and Z out of joints."""
    x, y, z, _, _ = kinematics.spread(joints)
    return x, y, z


def joints_of(xyz: Vector, rotaries: Rotaries, kinematics: Kinematics) -> Joints:
    """Joints in the machine's order."""
    return tuple(map(float, kinematics.arrange((*xyz, *rotaries))))


def straight(
    name: str,
    place: Place,
    start: Joints,
    end: Joints,
    feed_mm_s: float | None,
    kinematics: Kinematics,
    feed_deg_s: float | None = None,
) -> Segment | None:
    """A line of joint space; None where nothing moves.

    s is in millimetres of X Y Z; where hardly more than rotaries move, in degrees, at ``feed_deg_s``
    (if left out, the number of ``feed_mm_s``).
    """
    a, b = xyz_of(start, kinematics), xyz_of(end, kinematics)
    first, last = rotaries_of(start, kinematics), rotaries_of(end, kinematics)
    length, feed = norm(subtract(b, a)), feed_mm_s
    turned = math.degrees(math.hypot(last[0] - first[0], last[1] - first[1]))
    if length < max(STANDS_MM, turned / MAX_DEG_PER_MM):
        length = max(length, turned)
        feed = feed_mm_s if feed_deg_s is None else feed_deg_s
    if length < ROUNDING:
        return None
    move = JointMove(Line(a, b), length, first, last)
    return Segment(move, place, feed, False, start, end, True, name)


def round_arc(
    name: str,
    place: Place,
    start: Joints,
    end: Joints,
    arc: Arc,
    feed_mm_s: float | None,
    kinematics: Kinematics,
) -> Segment:
    """An arc or helix of X Y Z between two joint positions, rotaries turning evenly."""
    length = math.hypot(norm(arc.first) * arc.sweep_rad, norm(arc.rise))
    first, last = rotaries_of(start, kinematics), rotaries_of(end, kinematics)
    move = JointMove(arc, length, first, last)
    return Segment(move, place, feed_mm_s, False, start, end, True, name)
