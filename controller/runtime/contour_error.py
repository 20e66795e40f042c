"""How far the real tool is off the path it was to cut, row by row, from what the drives report.

Being late is no contour error: the tip, and the top of the flute, are compared with the nearest place of
the way that each of them was told within ``LOOK_BACK_S`` before.
"""

from __future__ import annotations

import contextlib
import itertools
import math
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.geometry.arrays import Array, Flags
from controller.geometry.passing_place import LOOK_BACK_S, passing
from controller.ipc.handoff import COLUMN, of_axes
from controller.machine.kinematics import Kinematics, kinematics_of
from controller.machine.model import Machine
from controller.plan.segment import Segment
from controller.plan.surfaces.cuts import tolerance_mm
from controller.program.program import Block, Modal, ProgramError
from controller.state.live_state import OFF_PATH
from controller.verify.trace import forward

Whole = NDArray[np.int64]

MAX_REPEATS = 2  # rows in which the position of a drive that moves was not heard: they show no error
ON_PATH_SHARE = 0.25  # of the tolerance: within it the tool is where it should be, but late
MOVES_COUNTS = 4.0  # in a tick: of what stands, or creeps, nobody sees how late it is
LAG_ROWS = 2000  # over which it is averaged how late: one drive that is later is not taken for all


class Demand(NamedTuple):
    """What is asked of a motion at feed."""

    length_mm: float  # of its tool, from the gauge line to the tip
    flute_mm: float
    tolerance_mm: float  # infinite: none is held


# Of a motion by its id, at a place of it: its lines may differ; None: it is none at feed.
DemandOf = Callable[[int, float], Demand | None]


def demand(modal: Modal, machine: Machine) -> Demand:
    """What is asked of a motion at feed in a modal state; without a tool the spindle's nose is looked at."""
    tool = modal.tool_in(machine)
    if tool is None:
        return Demand(0.0, 0.0, machine.tolerance_mm or math.inf)
    return Demand(tool.length_mm, tool.flute_mm, tolerance_mm(modal, tool, machine) or math.inf)


class Demands:
    """Finds what is asked of a motion of a planned path: its program is read beside it, as far as needed."""

    def __init__(self, blocks: Iterator[Block], segments: Mapping[int, Segment], machine: Machine) -> None:
        """``segments``: by motion id, which may come later."""
        self._blocks, self._segments, self._machine = blocks, segments, machine
        self._orders: list[int] = []
        self._demands: list[Demand] = []
        self._read_to = -1  # ``Place.order``

    def __call__(self, motion_id: int, s: float) -> Demand | None:
        segment = self._segments.get(motion_id)
        if segment is None or segment.feed_mm_s is None:
            return None
        order = segment.order_at(s)
        self._read(order)
        found = bisect_right(self._orders, order)
        return self._demands[max(0, found - 1)] if self._demands else None

    def _read(self, order: int) -> None:
        with contextlib.suppress(ProgramError):  # the run itself comes to what is refused, or does not
            while self._read_to < order and (block := next(self._blocks, None)) is not None:
                self._read_to = block.place.order
                found = demand(block.modal, self._machine)
                if not self._demands or found != self._demands[-1]:
                    self._orders.append(self._read_to)
                    self._demands.append(found)


class Columns(NamedTuple):
    """The columns of the recorder that a contour error is made of."""

    ticks: Array  # (N,)
    motion_ids: Whole  # (N,)
    lines: Whole  # (N,)
    s: Array  # (N,)
    commands: Array  # (N, axes) mm and rad
    actual: Array  # (N, axes)
    followed: Flags  # (N,) the drives are to follow the commands; else the commands follow them

    def then(self, more: Columns) -> Columns:
        return Columns._make(map(np.concatenate, zip(self, more, strict=True)))

    def places(self) -> dict[tuple[int, int], Whole]:
        """The rows of each motion and line, by both."""
        keys = np.stack([self.motion_ids, self.lines])
        starts = np.flatnonzero(np.any(np.diff(keys, prepend=keys[:, :1] - 1), axis=0))
        found: dict[tuple[int, int], list[Whole]] = {}
        for first, end in itertools.pairwise([*starts.tolist(), len(self.ticks)]):
            key = int(self.motion_ids[first]), int(self.lines[first])
            found.setdefault(key, []).append(np.arange(first, end))
        return {key: np.concatenate(parts) for key, parts in found.items()}

    def last(self, rows: int) -> Columns:
        return Columns._make(column[-rows:] for column in self)


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """The M newest rows, all with one tool; line and s are those where the path is nearest to it."""

    ticks: Array  # (M,)
    lines: Whole  # (M,) at that place
    s: Array  # (M,)
    mm: Array  # (M,) contour error
    tolerance_mm: Array  # (M,) infinite where none is held
    cutting: Flags  # (M,) a motion at feed
    heard: Flags  # (M,) the positions of all axes are new
    off: Array  # (M, axes) mm and rad, from where the command was when the drives should have followed it
    at: Array  # (M, axes) mm and rad, that command
    tool_mm: tuple[float, float]  # length and flute


class ContourErrors:
    """Measures the contour error of every row once, in whatever portions rows come."""

    def __init__(self, machine: Machine, demand_of: DemandOf) -> None:
        self.kinematics = kinematics_of(machine)
        self._demand_of = demand_of
        self._look_back = math.ceil(LOOK_BACK_S / machine.period_s)
        self._count = np.array([1.0 / abs(axis.counts_per_unit) for axis in machine.axes])
        axes = len(machine.axes)
        self._command, self._actual = of_axes("joint_command", axes), of_axes("actual", axes)
        self._before: Columns | None = None
        self._tool_mm = (0.0, 0.0)
        self._demands: dict[tuple[int, int], Demand | None] = {}  # of the rows before, by motion and line
        self._lag = 0.0  # rows from a command to the drives, the mean ...
        self._lags = 0  # ... of so many
        self._repeats = 0  # rows in a row in which an axis that moves was not heard

    def measure(self, rows: Array) -> Iterator[Measured]:
        """The next rows of the recorder, (N, len(ROW)); portions in which nothing is cut are left out."""
        new = self._columns(rows)
        asked = {key: float(new.s[places[0]]) for key, places in new.places().items()}
        self._demands |= {key: self._demand_of(key[0], s) for key, s in asked.items()}
        for first, end in self._with_one_tool(new.motion_ids, new.lines):
            found = self._measured(Columns._make(column[first:end] for column in new))
            if found is not None:
                yield found
        left = () if self._before is None else self._before.places()
        self._demands = {key: found for key, found in self._demands.items() if key in left}

    def _with_one_tool(self, motion_ids: Whole, lines: Whole) -> Iterator[tuple[int, int]]:
        """From row to row; a motion that is not at feed goes with the tool of the one before."""
        first = 0
        changes = np.flatnonzero(np.diff(motion_ids, prepend=motion_ids[:1] - 1))
        for row in map(int, changes):
            found = self._demands[int(motion_ids[row]), int(lines[row])]
            if found is None or found[:2] == self._tool_mm:
                continue
            if row > first:
                yield first, row
            first, self._tool_mm, self._before = row, found[:2], None
        if len(motion_ids) > first:
            yield first, len(motion_ids)

    def _columns(self, rows: Array) -> Columns:
        ids, lines, switches = (
            rows[:, COLUMN[name]].astype(np.int64) for name in ("motion_id", "line", "switches")
        )
        ticks, s = rows[:, COLUMN["tick"]], rows[:, COLUMN["s"]]
        commands, actual = rows[:, self._command], rows[:, self._actual]
        return Columns(ticks, ids, lines, s, commands, actual, switches & OFF_PATH == 0)

    def _measured(self, new: Columns) -> Measured | None:
        count = len(new.ticks)
        all_of = new if self._before is None else self._before.then(new)
        self._before = all_of.last(self._look_back + 1)
        fed = [one for (one, _), found in self._demands.items() if found is not None]
        if not np.isin(all_of.motion_ids, fed).any():
            return None
        mm, place = self._errors(all_of, count)
        nearest = place.astype(np.int64)
        motion_ids = all_of.motion_ids[nearest]
        cutting = np.isin(motion_ids, fed) & new.followed
        heard, tolerance = self._heard(all_of, nearest), self._tolerances(all_of, nearest)
        lag = np.arange(len(all_of.ticks) - count, len(all_of.ticks)) - place
        step = np.abs(all_of.commands[nearest] - all_of.commands[np.maximum(nearest - 1, 0)])
        moves = (step > MOVES_COUNTS * self._count).any(axis=1)
        on_path = cutting & heard & moves & (mm <= ON_PATH_SHARE * tolerance)
        at = self._commanded(all_of.commands, lag, on_path)
        return Measured(
            new.ticks, all_of.lines[nearest], all_of.s[nearest],
            mm, tolerance, cutting, heard, new.actual - at, at, self._tool_mm,
        )  # fmt: skip

    def _errors(self, rows: Columns, count: int) -> tuple[Array, Array]:
        """(contour error in mm, nearest place) of the last ``count`` rows, each (M,)."""
        paths = ends(self.kinematics, rows.commands, self._tool_mm)
        points = ends(self.kinematics, rows.actual[-count:], self._tool_mm)
        tip, top = (passing(*pair, self._look_back, -1) for pair in zip(paths, points, strict=True))
        return np.maximum(tip.distance, top.distance), tip.place

    def _tolerances(self, rows: Columns, nearest: Whole) -> Array:
        most = np.full(len(rows.ticks), math.inf)
        for key, places in rows.places().items():
            if (found := self._demands.get(key)) is not None:
                most[places] = found.tolerance_mm
        return np.asarray(most[nearest])

    def _heard(self, rows: Columns, nearest: Whole) -> Flags:
        """Whether the drives' positions are new: a lost frame leaves the one before."""
        count, last = len(nearest), len(rows.ticks) - 1
        before = np.maximum(np.arange(last + 1 - count, last + 1) - 1, 0)
        moves = np.abs(rows.commands[np.minimum(nearest + 1, last)] - rows.commands[nearest]) > self._count
        repeats = ((rows.actual[-count:] == rows.actual[before]) & moves).any(axis=1)
        heard = np.ones(count, dtype=np.bool_)
        for k, repeated in enumerate(repeats):
            self._repeats = self._repeats + 1 if repeated else 0
            heard[k] = not 0 < self._repeats <= MAX_REPEATS
        return heard

    def _commanded(self, commands: Array, lag: Array, on_path: Flags) -> Array:
        """(M, axes) where the drives should be by now: as late as they mostly are on their path."""
        if found := int(np.count_nonzero(on_path)):
            self._lags = min(self._lags + found, LAG_ROWS)
            self._lag += (float(lag[on_path].mean()) - self._lag) * min(1.0, found / self._lags)
        at = np.maximum(np.arange(len(commands) - len(lag), len(commands)) - self._lag, 0.0)
        row = np.minimum(at.astype(np.int64), max(len(commands) - 2, 0))
        after = np.minimum(row + 1, len(commands) - 1)
        return np.asarray(commands[row] + (at - row)[:, None] * (commands[after] - commands[row]))


def ends(kinematics: Kinematics, joints: Array, tool_mm: tuple[float, float]) -> tuple[Array, Array]:
    """Tip and top of the flute in the table frame, each (N, 3) in mm, of joints (N, axes)."""
    length_mm, flute_mm = tool_mm
    tip, axis = forward(joints, length_mm, kinematics)
    return tip, tip + flute_mm * axis
