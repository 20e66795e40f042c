"""A live run made again on the stepped clock, out of its record: every setpoint comes again, or it is told.

What reaches the tick comes again in the tick in which it came: requests, the planner's messages, long
gaps, faults of drives, the ends of waits. What the planner makes depends on when it looked and how long
it took, so its turns come again, too. The live planner's own messages are in no record: they are planned
again, and each waits here for the tick that took it. A planner or a service that was killed may have left
messages whose making is in no record: before the first of these the repetition ends.
"""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Any

import numpy as np
import numpy.typing as npt

from controller.ipc.handoff import BRAKED, COLUMN, PLAYED, ROW, PieceMessage, Snapshot, of_axes
from controller.machine.model import Machine
from controller.messages import message
from controller.plan.off_path import Back
from controller.plan.planner import Planner
from controller.plan.restart.program_position import Spot
from controller.plan.restart.reentry import NotPossible
from controller.plan.segment import PathItem, Pause
from controller.program.program import ProgramError
from controller.runtime import checked, events, starts
from controller.runtime.checked import Task, Walk
from controller.runtime.comparison import MAX_TICKS, Comparison, off_path
from controller.runtime.events import Line, Recorded
from controller.runtime.stepped import PLAN_EVERY_S, Items, Run, SteppedMachine
from controller.state.modes import MAX_AXES, Fault, Mode, Request
from controller.state.setpoints import MISSING, Counts
from controller.tick.coupling import Recorded as ThreadRecord
from controller.tick.cycle import Again

ENDING = 5  # ticks after the last one that is recorded: the mode follows the standstill
_STOCK = 0, PLAYED, PLAYED | BRAKED  # by the value of a line

Rows = npt.NDArray[np.float64]


def as_driven(rows: Rows, actual: Counts, per_unit: npt.NDArray[np.float64]) -> Rows:
    """The rows of a repetition with the recorded positions of the drives, as far as both go.

    ``actual``: (N, MAX_AXES) counts of the ticks that sent a SYNC, where they are ``MISSING`` what the drives
    were told counts; ``per_unit``: (MAX_AXES,) of mm and rad.
    """
    sent = np.cumsum(rows[:, COLUMN["sync_sent"]] != 0.0)
    found = rows[(sent > 0) & (sent <= len(actual))].copy()
    nth = np.cumsum(found[:, COLUMN["sync_sent"]] != 0.0) - 1
    told = found[:, of_axes("joint_command", MAX_AXES)]
    found[:, of_axes("actual", MAX_AXES)] = np.where(actual[nth] == MISSING, told, actual[nth] / per_unit)
    return found


@dataclass(frozen=True, slots=True)
class Part:
    """The program of a record, and how a machine is fitted with other tools."""

    task: Task
    fit: Callable[[Mapping[str, Any]], Machine]


def again(
    bench: SteppedMachine,
    path: Walk,
    part: Part,
    record: Recorded,
    wanted: Comparison | None,
    progress: Callable[[float], None] = lambda _: None,
    keep: bool = True,
) -> Run:
    """The run once more, as far as its setpoints go, which are compared with those that are ``wanted``. The
    machine stands where it began. ``keep``: all its rows and motions, and not the last row alone.

    Raises SessionError where the machine forbids the start.
    """
    last = max((line.tick for line in record.lines), default=0) + 1
    ticks = min(last if wanted is None else wanted.ticks, off_path(record) + 1)
    passed = _Passed(wanted, MAX_TICKS if wanted is None else ticks, keep)
    return _Repetition(bench, part, record, passed).run(path, ticks, wanted is None, progress)


class _Passed:
    """The rows of a repetition up to the last SYNC that was recorded, as they come."""

    def __init__(self, wanted: Comparison | None, ticks: int, keep: bool) -> None:
        """``ticks``: so many SYNCs, at most."""
        self.ticks, self.keep = ticks, keep
        self.stopped = False  # by an operator
        self._wanted, self._sent = wanted, 0
        self._rows = [np.zeros((0, len(ROW)))]

    def take(self, rows: Rows) -> None:
        """The next ones."""
        sent = self._sent + np.cumsum(rows[:, COLUMN["sync_sent"]] != 0.0)
        rows = rows[sent <= self.ticks]
        if not len(rows):
            return
        self._sent = int(sent[len(rows) - 1])
        self.stopped |= bool(np.any(rows[:, COLUMN["mode"]] == Mode.STOPPING))
        if self._wanted is not None:
            self._wanted.take(rows)
        if self.keep:
            self._rows.append(rows)
        else:
            self._rows = [rows[-1:]]

    @property
    def rows(self) -> Rows:
        """All that were kept."""
        return np.concatenate(self._rows)


class _Repetition:
    def __init__(self, bench: SteppedMachine, part: Part, record: Recorded, passed: _Passed) -> None:
        self._bench, self._part, self._record, self._passed = bench, part, record, passed
        self._waiting: deque[PieceMessage] = deque()
        self._planner = bench.planner = Planner(
            bench.machine, bench.kinematics, self._send, remember=passed.keep
        )
        now = self._now()
        self._planner.go_on_from(max(now.accepted, now.rejected))
        self._fitted = bench.machine
        self._waits, self._fault, self._played, self._taken_back = False, Fault.NONE, 0, 0
        self._thread, self._share = ThreadRecord(), 1.0
        self._lacks = False  # a message was taken that nobody has made here

    def _send(self, message: PieceMessage) -> bool:
        if message.is_keepalive:
            return self._bench.outbox.send(message)
        self._waiting.append(message)
        return True

    def _now(self) -> Snapshot:
        found = self._bench.board.read()
        assert found is not None
        return found

    # -- the run

    def run(self, path: Items, ticks: int, to_its_end: bool, progress: Callable[[float], None]) -> Run:
        bench, follow = self._bench, self._bench.cycle.follow
        self._planner.load(_unprobed(path.items), follow.queue_end_s, follow.epoch)
        lines = deque(self._record.lines)
        for line in _taken(lines, -1):
            self._make(line)
            if line.kind == events.PIECES or line.event is not None:
                bench.tick()
        bench.begin_rows(self._passed.take)
        started = bench.request(Request.START, float(self._record.begin.start.stays_on))
        first, skips = bench.cycle.tick + 1, bench.cycle.sync.skips
        every = max(1, round(PLAN_EVERY_S / bench.machine.period_s))
        lacks_from: int | None = None
        for n in range(ticks):
            if n % every == 0:
                self._planner.keepalive()
            self._tick(list(_taken(lines, n)))
            if self._lacks:
                lacks_from = self._passed.ticks = n
                break
            if n == 0:
                bench.see_started(started)
            bench.keep_rows(n + 1, progress)
        self._end(to_its_end)
        ended = replace(self._ended(first, skips), lacks_from=lacks_from)
        bench.cycle.again = None  # from here on the simulated drives' own faults count
        return ended

    def _tick(self, lines: list[Line]) -> None:
        """One that sends a SYNC, and before it those that came too late for theirs."""
        late = [line for line in lines if line.late]
        for _, group in groupby(late, key=lambda line: line.at):
            self._make_all(group)
            self._bench.cycle.pass_by()
        self._make_all(line for line in lines if not line.late)
        self._bench.tick()

    def _make_all(self, lines: Iterable[Line]) -> None:
        """What came from drives and devices is told to the tick; old records do not have it."""
        self._fault, self._taken_back = Fault.NONE, 0
        recorded = self._bench.cycle.again is not None
        for line in lines:
            self._make(line)
            recorded |= line.at is not None
        if recorded:
            said = self._waits, self._fault, self._thread, self._share, self._played, self._taken_back
            self._bench.cycle.again = Again(*said)

    def _make(self, line: Line) -> None:
        bench = self._bench
        if line.event is not None:
            bench.send(line.event)
        elif line.kind == events.STAND:
            bench.cycle.stand()
        elif line.kind == events.PIECES:
            if self._waiting:
                bench.outbox.send(self._waiting.popleft())
            else:
                self._lacks = True
        elif line.kind == events.WAIT:
            self._waits = bool(line.value)
        elif line.kind == events.THREAD:
            led_mm, settled = line.value
            self._thread = ThreadRecord(float(led_mm), bool(settled))
        elif line.kind == events.STOCK:
            self._played = _STOCK[int(line.value)]
        elif line.kind == events.TAKEN_BACK:
            self._taken_back = _STOCK[int(line.value)]
        elif line.kind == events.ADAPTIVE:
            self._share = float(line.value)
        elif line.kind == events.FAULT:
            self._fault = Fault[line.value]
        elif line.kind in events.TURNS:
            with contextlib.suppress(NotPossible):  # the operator was told then
                self._turn(line)

    def _turn(self, line: Line) -> None:
        now, planner = self._now(), self._planner
        if line.kind == events.PLAN:
            planner.lead_s = line.value
            planner.work(now)
        elif line.kind == events.RETRACT:
            planner.retract(now, line.value)
        elif isinstance(line.value, dict) and (spot := planner.spot(now)) is not None:
            made = self._part.fit(line.value)
            planner.go_back(now, self._with_other_tools(made, spot))
            self._fitted = made
        else:
            planner.go_back(now, starts.back(replace(self._part.task, machine=self._fitted), int(line.value)))

    def _with_other_tools(self, made: Machine, spot: Spot) -> Back:
        asked = checked.task(self._part.task.text, self._part.task.name, made)
        start = self._record.begin.start
        whole_from = start.joints if start.spot is None else start.whole_from
        start = replace(start, spot=Spot(spot.line, spot.fraction), whole_from=whole_from)
        return starts.back_with(starts.rest(asked, checked.chosen_for(asked), start), self._fitted)

    # -- its end

    def _end(self, to_its_end: bool) -> None:
        """Some ticks more, in which the mode follows; where no setpoints were kept, to a standstill."""
        bench = self._bench
        for _ in range(MAX_TICKS if to_its_end else ENDING):
            if bench.stands(()):
                return
            self._planner.keepalive()
            bench.tick()

    def _ended(self, first: int, skips_before: int) -> Run:
        """What came of it; of the rows those that were recorded."""
        bench, modes = self._bench, self._bench.cycle.modes
        bench.end_rows()
        result = {
            Mode.FAULT: "fault",
            Mode.READY: "stopped" if self._passed.stopped else "completed",
            Mode.HOLD: "held",
            Mode.JOG: "held",
        }.get(modes.mode, "lost")
        skips = bench.cycle.sync.skips - skips_before
        return Run(
            self._passed.rows, result, modes.fault, modes.fault_axis, first, skips, 0, 0, bench.fault_text
        )


def _unprobed(items: Iterable[PathItem]) -> Iterator[PathItem]:
    """The path up to where it would probe: no record has what was touched then."""
    for item in items:
        if isinstance(item, Pause) and item.probe is not None:
            line, column = item.place.line, item.place.column
            raise ProgramError("replay", line, column, message("probing.no_replay", code=item.probe.code))
        yield item


def _taken(lines: deque[Line], tick: int) -> Iterator[Line]:
    """Those up to a tick, which are then gone."""
    while lines and lines[0].tick <= tick:
        yield lines.popleft()
