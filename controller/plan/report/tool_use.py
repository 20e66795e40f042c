"""What each tool does in a program, and the holes that its cycles make, in the program's own coordinates.

A program's coordinates are those that its words have: of the work offset, of a tilted plane where one is
active, positions of the axes without tip control. Tools come in the order of their first motion.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from controller.geometry.arrays import Array
from controller.machine.kinematics import Kinematics
from controller.machine.model import OFFSETS, Machine
from controller.plan.report.works import CUTS, HOLES
from controller.plan.segment import Segment
from controller.program.carried import InForce
from controller.program.codes import CYCLES
from controller.program.modal import State, power_on
from controller.program.motion_words import PLANES
from controller.program.program import Modal, Tip

POWER_ON = power_on()
SAME_MM = 1e-6  # between two strokes into one hole
MAX_HOLES = 5000  # that are listed; all are counted


@dataclass(frozen=True, slots=True)
class ToolUse:
    """One tool over the whole program; ranges are (lowest, highest) while it cuts, None where it does not."""

    tool: int
    cut_s: float
    rapid_s: float
    cut_mm: float
    spindle_rev_min: tuple[float, float] | None
    feed_mm_min: tuple[float, float] | None  # as programmed
    deepest_mm: float | None  # the lowest Z

    def to_dict(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in self.__slots__}


@dataclass(frozen=True, slots=True)
class Hole:
    """What one cycle does at one place, along the axis of its plane (Z under G17)."""

    line: int
    tool: int
    cycle: str  # G81, G84, ... or G33.1
    offset: str
    plane: str
    place: tuple[float, float, float]  # X Y Z where the feed begins
    end: float  # along that axis, the furthest from there

    @property
    def axes(self) -> tuple[int, int, int]:
        """Of X Y Z the first and second of its plane, and the one that it goes along."""
        return PLANES[self.plane]

    @property
    def begin(self) -> float:
        return self.place[self.axes[2]]

    def to_dict(self) -> dict[str, Any]:
        plain = {name: getattr(self, name) for name in ("line", "tool", "cycle", "offset", "plane")}
        return {**plain, **dict(zip("xyz", self.place, strict=True)), "from": self.begin, "to": self.end}


@dataclass(slots=True)
class _Range:
    """The lowest and the highest of what came."""

    low: float = math.inf
    high: float = -math.inf

    def take(self, low: float, high: float) -> None:
        self.low, self.high = min(self.low, low), max(self.high, high)

    @property
    def ends(self) -> tuple[float, float] | None:
        return (self.low, self.high) if self.low <= self.high else None


@dataclass(slots=True)
class _Sums:
    """Of one tool, so far."""

    cut_s: float = 0.0
    rapid_s: float = 0.0
    cut_mm: float = 0.0
    spindle: _Range = field(default_factory=_Range)
    feed: _Range = field(default_factory=_Range)
    z: _Range = field(default_factory=_Range)

    def use(self, tool: int) -> ToolUse:
        deepest = self.z.ends[0] if self.z.ends else None
        times = self.cut_s, self.rapid_s, self.cut_mm
        return ToolUse(tool, *times, self.spindle.ends, self.feed.ends, deepest)


class Places(NamedTuple):
    """Where a part of a motion leads: joints (N, axes); start and end of the motion are the last two."""

    segment: Segment
    work: str
    joints: Array


class ToolUses:
    """Takes the motions of a path in their order, and sums them up by the tool in the spindle."""

    def __init__(self, machine: Machine, kinematics: Kinematics, in_force: InForce) -> None:
        """``in_force``: the modal state of the lines, as far as they are read."""
        self._machine, self._kinematics, self._in_force = machine, kinematics, in_force
        self._linear = [*machine.linear()]
        self._tools: dict[int, _Sums] = {}
        self._last_hole: Hole | None = None  # which may get one more stroke, of the block ...
        self._order = 0  # ... of this order
        self._holes: list[Hole] = []
        self._hole_count = 0

    @property
    def tools(self) -> tuple[ToolUse, ...]:
        return tuple(sums.use(tool) for tool, sums in self._tools.items())

    def holes(self) -> tuple[tuple[Hole, ...], int]:
        """The holes that are listed, and how many there are; closes the last one."""
        self._list_hole()
        return tuple(self._holes), self._hole_count

    def take(
        self, segment: Segment, work: str, took_s: float, length_mm: float, feeds: tuple[float, float]
    ) -> None:
        """A part of a motion: seconds, millimetres of the tip, lowest and highest programmed feed in mm/s."""
        modal = self._state(segment).modal
        sums = self._sums(modal.tool)
        if work == "rapid":
            sums.rapid_s += took_s
        elif work in CUTS:
            sums.cut_s += took_s
            sums.cut_mm += length_mm
            sums.feed.take(*(60.0 * feed for feed in feeds))
            sums.spindle.take(*[abs(modal.spindle_rev_min)] * 2)

    def places(self, parts: Sequence[Places]) -> None:
        """Where those parts lead."""
        known = [(k, part, self._state(part.segment)) for k, part in enumerate(parts) if part.work in CUTS]

        def alike(one: tuple[int, Places, State]) -> tuple[int, bool, int]:
            """What is looked at together; holes are not."""
            k, part, state = one
            return id(state.modal), part.segment.cutting, k if part.work in HOLES else -1

        for _, run in itertools.groupby(known, alike):
            (_, part, state), *others = run
            joints = np.concatenate([part.joints, *(other.joints for _, other, _ in others)])
            places = self._in_program(joints, part.segment, state.modal)
            self._sums(state.modal.tool).z.take(float(places[:, 2].min()), float(places[:, 2].max()))
            if part.work in HOLES:
                self._hole(part.segment, state, places)

    def _sums(self, tool: int) -> _Sums:
        if tool not in self._tools:
            self._tools[tool] = _Sums()
        return self._tools[tool]

    def _state(self, segment: Segment) -> State:
        return self._in_force.at(segment.place.order) or POWER_ON

    def _in_program(self, joints: Array, segment: Segment, modal: Modal) -> Array:
        """Places (N, 3) in the program's coordinates."""
        frame = modal.frame(self._machine)
        if modal.tip is Tip.OFF and not modal.tilted and not segment.cutting:
            places = joints[:, self._linear] - (0.0, 0.0, modal.length_mm)
        else:
            tool = modal.tool_in(self._machine) if segment.cutting else None
            length_mm = modal.length_mm if tool is None else tool.length_mm
            tip = self._kinematics.forward([*joints.T], length_mm, np).tip
            places = np.stack([np.broadcast_to(c, (len(joints),)) for c in tip], axis=1)
        return np.asarray((places - frame.origin) @ np.array([frame.x, frame.y, frame.z]).T)

    def _hole(self, segment: Segment, state: State, places: Array) -> None:
        """One more hole, or one more stroke of the last one."""
        first, second, normal = PLANES[state.modal.plane]
        x, y, z = map(float, places[-2])
        place, heights = (x, y, z), places[:, normal]
        last = self._last_hole if self._order == segment.place.order else None
        if last is not None and all(abs(last.place[i] - place[i]) < SAME_MM for i in (first, second)):
            heights, place = np.append(heights, last.end), last.place
        else:
            self._list_hole()
        end = float(heights[np.argmax(np.abs(heights - place[normal]))])
        cycle = state.motion if state.motion in CYCLES else "G33.1"
        shown = cycle, OFFSETS[state.modal.offset], state.modal.plane
        self._last_hole = Hole(segment.place.line, state.modal.tool, *shown, place, end)
        self._order = segment.place.order

    def _list_hole(self) -> None:
        """The last hole is done."""
        if self._last_hole is not None:
            self._hole_count += 1
            if self._hole_count <= MAX_HOLES:
                self._holes.append(self._last_hole)
            self._last_hole = None
