"""Reports the contour error of a run: the largest of each line, and what stays beyond its tolerance.

A watch takes every newest rows of the recorder in their order, ``see_all`` ends it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from controller.geometry.arrays import Array, distinct
from controller.ipc.handoff import ROW
from controller.machine.model import Machine
from controller.messages import Message, message
from controller.runtime.contour_error import ContourErrors, DemandOf, Measured, ends
from controller.state.modes import Request

PORTION_S = 0.5  # of rows that are looked at together: a few cost as much as many
ACT_S = 0.05  # likewise, where the machine file wants more than a warning
MIN_OVERRIDE = 0.1  # that a contour error leaves
REPORTED_TICKS = 10  # beyond the tolerance, with no row between them that is within it
MAX_EXCESSES = 1000  # of a run, that are kept
MAX_LINES = 1000  # of a run, whose errors are kept: those with the largest ...
SHOWN_LINES = 100  # ... and shown


class ContourError(NamedTuple):
    """A contour error at one tick; place and axis are those on the path that it is off."""

    tick: int  # of the machine
    line: int
    s: float  # along the motion
    axis: int  # that moves the tool furthest off
    mm: float
    tolerance_mm: float  # infinite: none is held

    def to_dict(self, machine: Machine) -> dict[str, Any]:
        return {
            "line": self.line,
            "s": self.s,
            "axis": machine.axes[self.axis].name,
            "largest_mm": self.mm,
            "tolerance_mm": self.tolerance_mm if math.isfinite(self.tolerance_mm) else None,
            "at_tick": self.tick,
        }


@dataclass(slots=True)
class Excess:
    """A contour error that stays beyond its tolerance."""

    tick: int  # of the machine, the first
    ticks: int
    largest: ContourError
    over: bool = False  # the tool is back within the tolerance

    def go_on(self, tick: int, worst: ContourError | None) -> bool:
        """It is there at that tick, too, ``worst`` where it was never larger; whether that makes it one to be
        reported.
        """
        was, self.ticks = self.ticks, tick - self.tick + 1
        self.largest = worst or self.largest
        return was < REPORTED_TICKS <= self.ticks

    def end(self) -> None:
        """The tool is back."""
        self.over = True

    def to_dict(self, machine: Machine) -> dict[str, Any]:
        return {"tick": self.tick, "ticks": self.ticks, **self.largest.to_dict(machine)}

    def sentence(self, machine: Machine) -> Message:
        """For the operator."""
        worst, seconds = self.largest, self.ticks * machine.period_s
        axis, figures = machine.axes[worst.axis].name, {"largest": worst.mm, "tolerance": worst.tolerance_mm}
        return message("contour_error", line=worst.line, axis=axis, seconds=seconds, **figures)


def reaction(machine: Machine, override: float) -> tuple[Request, float] | None:
    """What is asked of the tick for a contour error beyond its tolerance, as the machine file says."""
    if machine.contour_error == "hold":
        return Request.HOLD, 0.0
    if machine.contour_error == "slow" and override > MIN_OVERRIDE:
        return Request.OVERRIDE, max(MIN_OVERRIDE, 0.5 * override)
    return None


class ContourWatch:
    """Watches over one run."""

    def __init__(self, machine: Machine, demand_of: DemandOf) -> None:
        self.excesses: list[Excess] = []  # that lasted long enough, the first of them
        self.by_line: dict[int, float] = {}  # the largest error, mm
        self.largest: ContourError | None = None  # of all ticks at feed
        self._machine = machine
        acts = reaction(machine, 1.0) is not None
        self.portion = max(1, round((ACT_S if acts else PORTION_S) / machine.period_s))  # rows
        self._errors = ContourErrors(machine, demand_of)
        self._waiting: list[Array] = []
        self._open: Excess | None = None

    def take(self, rows: Array) -> list[Excess]:
        """The next rows of the recorder, (N, len(ROW)); the excesses that are new, or over, since."""
        self._waiting.append(rows)
        return self.see_all() if sum(map(len, self._waiting)) >= self.portion else []

    @property
    def waits(self) -> bool:
        """Whether rows were taken that were not looked at."""
        return bool(self._waiting)

    def see_all(self) -> list[Excess]:
        """Looks at the rows that were taken and not looked at; what is new."""
        waiting, reported = self._waiting, list[Excess]()
        rows = np.concatenate([np.empty((0, len(ROW))), *waiting])
        waiting.clear()
        for portion in self._errors.measure(rows):
            self._note_lines(portion)
            reported += self._follow(portion)
        return reported

    def to_dict(self) -> dict[str, Any]:
        """For ``--json`` and the record of a run."""
        worst = sorted(self.by_line.items(), key=lambda line: -line[1])[:SHOWN_LINES]
        return {
            "largest": None if self.largest is None else self.largest.to_dict(self._machine),
            "excesses": [one.to_dict(self._machine) for one in self.excesses],
            "lines": {str(line): mm for line, mm in worst},
        }

    def _note_lines(self, rows: Measured) -> None:
        counted = rows.cutting & rows.heard
        for line in map(int, distinct(rows.lines[counted])):
            mine = np.flatnonzero(counted & (rows.lines == line))
            row = int(mine[rows.mm[mine].argmax()])
            mm = float(rows.mm[row])
            self.by_line[line] = max(mm, self.by_line.get(line, 0.0))
            if self.largest is None or mm > self.largest.mm:
                self.largest = self._error(rows, row)
        if len(self.by_line) > 2 * MAX_LINES:
            worst = sorted(self.by_line, key=self.by_line.__getitem__, reverse=True)
            self.by_line = {line: self.by_line[line] for line in worst[:MAX_LINES]}

    def _follow(self, rows: Measured) -> list[Excess]:
        """What begins, grows and ends, row by row; a row that was not heard does none of it."""
        beyond = rows.cutting & (rows.mm > rows.tolerance_mm)
        if self._open is None and not beyond.any():
            return []
        reported: list[Excess] = []
        for row in map(int, np.flatnonzero(rows.heard)):
            now = self._open
            if not beyond[row]:
                if now is not None and now.ticks >= REPORTED_TICKS:
                    now.end()
                    reported.append(now)
                self._open = None
            elif now is None:
                self._open = Excess(int(rows.ticks[row]), 1, self._error(rows, row))
            else:
                self._grow(now, rows, row, reported)
        return reported

    def _grow(self, now: Excess, rows: Measured, row: int, reported: list[Excess]) -> None:
        worst = self._error(rows, row) if rows.mm[row] > now.largest.mm else None
        if now.go_on(int(rows.ticks[row]), worst):
            reported.append(now)
            if len(self.excesses) < MAX_EXCESSES:
                self.excesses.append(now)

    def _error(self, rows: Measured, row: int) -> ContourError:
        tick, line = int(rows.ticks[row]), int(rows.lines[row])
        s, mm, most = (float(column[row]) for column in (rows.s, rows.mm, rows.tolerance_mm))
        return ContourError(tick, line, s, self._axis(rows, row), mm, most)

    def _axis(self, rows: Measured, row: int) -> int:
        """The one that, alone off its command, moves tip or top of the flute furthest."""
        at = rows.at[row]
        joints = np.concatenate([at[None], at + np.diag(rows.off[row])])
        both = ends(self._errors.kinematics, joints, rows.tool_mm)
        moved = [np.linalg.norm(end[1:] - end[0], axis=1) for end in both]
        return int(np.maximum(*moved).argmax())
