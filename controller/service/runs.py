"""Records of runs: what was run, how it went, and every setpoint, so that it can be run again.

A folder per run in the state folder:

    runs/2026-11-21T083120.042-part.ngc/
        begun.json       what and when, while it is under way
        run.json         the same with result, duration, cut time, largest following errors
        events.jsonl     what came to the tick, as ``simulate --events`` reads it (``session.events``)
        program.ngc      what was run, with the subs of other files
        machine.toml     the machine file, with its tool table
        setpoints.npz    the setpoints of every tick (counts), in segments: see ``state.setpoints``
        actual.npz       likewise, where the drives said that they were
        process.npz      likewise, feed and load of the spindle

Ticks count from cycle start, and those alone that sent a SYNC: the path clock counts no others.
Which tick took a request is read from the recorder's rows, where its number stands, and not from
a clock. What the planner made of it depends on when it looked, so its turns are events, too.
"""

from __future__ import annotations

import contextlib
import os
import re
import time
from collections import deque
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from controller import atomic_file, own_files, sealed_file
from controller.ipc.handoff import COLUMN, ROW, Snapshot, of_axes
from controller.machine.model import Machine
from controller.messages import Message, message, reason
from controller.runtime import events
from controller.runtime.plan_messages import Program, Turn
from controller.runtime.recording import new_folder
from controller.runtime.starts import Start
from controller.service.engine import SentRequest
from controller.service.journal import sha256
from controller.service.run_file import RowEvents, RunEvents, RunFile
from controller.state import record_files
from controller.state.modes import MAX_AXES, Mode
from controller.state.setpoints import (
    ACTUAL,
    PROCESS,
    PROCESS_PER_UNIT,
    SETPOINTS,
    TABLES,
    counts_per_unit,
    in_counts,
)
from controller.store import history
from controller.store.service_store import ServiceStore

FOLDER, RUN, BEGUN = record_files.RUNS, record_files.RUN, record_files.BEGUN
ALARM = "RECORD_DAMAGED"
_STEM, _TIME = "%Y-%m-%dT%H%M%S", "2026-11-21T083120"
LAG_TICKS = 2  # from a setpoint to the feedback that can have followed it

Rows = npt.NDArray[np.float64]

_TAKEN = {table: [COLUMN[name] for name in table.columns] for table in TABLES}


class RunRecord:
    """One run while it is under way. ``rows`` are those of the recorder since the start was asked for."""

    def __init__(self, state: Path, machine: Machine, what: dict[str, Any]) -> None:
        """``what`` is kept as it is. A full disk costs the record, not the run: ``problem`` says why."""
        self.machine, self.what = machine, what
        self.began = False  # the tick has taken the start
        self.stopped = False  # by an operator
        self.found: list[dict[str, Any]] = []  # by probing cycles
        self.last_tick = -1
        self._cut_ticks = 0
        axes = len(machine.axes)
        self._command, self._actual = of_axes("joint_command", axes), of_axes("actual", axes)
        self._per_unit = {
            SETPOINTS: np.ones(MAX_AXES),
            ACTUAL: counts_per_unit(machine),
            PROCESS: PROCESS_PER_UNIT,
        }
        self._errors = np.zeros(axes)
        self._commands = np.zeros((0, axes))
        self._events = RunEvents()
        self._found = RowEvents(self._events)
        self._started_s, self._began_s = time.time(), time.monotonic()
        self._ticks = 0  # that sent a SYNC
        self._last_tick = -1  # of the machine, of them
        self._behind = np.zeros((0, len(ROW)))  # rows that stand: of the run if it goes on after them
        self._owes_one = False  # of these the first is of the run
        self._problem: Message | str = ""
        self._state = state
        self.folder = state / FOLDER / _stem(str(what.get("name", "")))
        self._file: RunFile | None = None
        try:
            self.folder = new_folder(self.folder.parent, self.folder.name)
            self._file = RunFile(self.folder)
        except OSError as error:
            self._problem = reason(error)

    @property
    def problem(self) -> Message | str:
        """Why nothing is kept, or no more of it; empty where all is well."""
        return self._problem or (self._file.problem if self._file is not None else "")

    @property
    def first_tick(self) -> int:
        """Of the machine; -1 before the run has begun."""
        return self._events.first_tick

    # -- while it runs

    def take(self, rows: Rows, asked: deque[SentRequest] | None = None, now: Snapshot | None = None) -> None:
        """The next rows of the recorder, and what was ``asked`` of the tick; what came is taken from it.

        ``now`` is a snapshot from after these rows: it tells what came of the requests.
        """
        if not len(rows):
            return
        self._found.find_requests(rows, asked if asked is not None else deque(), now)
        if not self.began:
            going = np.flatnonzero(
                (rows[:, COLUMN["mode"]] == Mode.RUNNING) | (rows[:, COLUMN["rate"]] > 0.0)
            )
            if not len(going):
                return
            self.began = True
            self._events.begin(int(rows[going[0], COLUMN["tick"]]))
            rows = rows[going[0] :]
        self._measure(rows)
        self.stopped |= bool(np.any(rows[:, COLUMN["mode"]] == Mode.STOPPING))
        self._found.find(rows)
        self._keep(rows)
        self.last_tick = int(rows[-1, COLUMN["tick"]])

    def begins(self, start: Start, program: Program, fitted: dict[str, Any]) -> None:
        """From where, and on what: without it nothing could be run again but a start after homing.

        From here on the disk knows of the run, so that it is told even if nobody lives to end it.
        """
        machine_text = program.machine.text.encode()
        sums = {"program_sha256": sha256(program.text), "machine_sha256": sha256(machine_text)}
        value = {**start.to_dict(), "fitted": fitted, **sums, "period_s": program.machine.period_s}
        try:
            _write_facts(self.folder / BEGUN, self._facts())
            if self._file is not None:
                self._file.events([{"tick": -1, "request": events.BEGIN, "value": value}])
                self._file.begin({events.PROGRAM: program.text, events.MACHINE: machine_text})
            atomic_file.sync(self.folder.parent, self.folder.parent.parent)
        except OSError as error:
            self._problem = self._problem or reason(error)

    def planned(self, turns: tuple[Turn, ...], fitted: dict[str, Any]) -> None:
        """When the planner acted, and on which tick's snapshot; ``fitted``: now."""
        for turn in turns:
            value = fitted if turn.refitted else turn.value
            self._events.add(turn.tick + 1, events.line_of(turn.verb, value))
        self._write_events()

    def find(self, results: Iterable[dict[str, Any]]) -> None:
        """What probing cycles have found."""
        self.found += results

    def sync(self) -> None:
        """Returns when the disk has all that was taken before; for another thread."""
        if self._file is not None:
            self._file.sync()

    def _measure(self, rows: Rows) -> None:
        cutting = (rows[:, COLUMN["cutting"]] != 0.0) & (rows[:, COLUMN["rate"]] > 0.0)
        self._cut_ticks += int(np.count_nonzero(cutting & (rows[:, COLUMN["sync_sent"]] != 0.0)))
        commands = np.concatenate([self._commands, rows[:, self._command]])
        actual = rows[max(0, LAG_TICKS - len(self._commands)) :, self._actual]
        if len(actual):
            lag = np.abs(commands[: len(commands) - LAG_TICKS][-len(actual) :] - actual)
            self._errors = np.maximum(self._errors, lag.max(axis=0))
        self._commands = commands[-LAG_TICKS:]

    def _keep(self, rows: Rows) -> None:
        """A full disk costs the record, not the run."""
        self._events.pass_rows(rows)
        self._write_events()  # first: what is recorded of setpoints can be made again
        sent = self._of_run(rows[rows[:, COLUMN["sync_sent"]] != 0.0])
        if not len(sent):
            return
        if self._file is not None:
            for table, columns in _TAKEN.items():
                counts = in_counts(sent[:, columns] * self._per_unit[table])
                self._file.rows(table, self._ticks, counts)
        self._ticks, self._last_tick = self._ticks + len(sent), int(sent[-1, COLUMN["tick"]])

    def _of_run(self, sent: Rows) -> Rows:
        """The rows up to the one that found the end: what follows it is only the looking whether it
        stands. Those are kept for the moment that the run goes on.
        """
        behind = np.concatenate([self._behind, sent])
        busy = np.flatnonzero(behind[:, COLUMN["mode"]] != Mode.READY)
        count = int(busy[-1]) + 2 if len(busy) else int(self._owes_one)
        self._owes_one = count > len(behind)
        self._behind = behind[count:]
        return behind[:count]

    def _write_events(self, is_last: bool = False) -> None:
        if self._file is not None:
            self._file.events(self._events.timed(is_last))

    # -- at its end

    def end(self, result: str, **more: Any) -> dict[str, Any]:
        """Write the record; its facts."""
        ticks = self._ticks
        passed = self._last_tick - self.first_tick + 1 if ticks else 0
        shown = [
            float(e * abs(a.shown_per_unit)) for e, a in zip(self._errors, self.machine.axes, strict=True)
        ]
        facts = {
            **self._facts(),
            "ended_s": self._started_s + time.monotonic() - self._began_s,  # whatever the clock was set to
            "result": result,
            "duration_s": passed * self.machine.period_s,
            "ticks": ticks,
            "skips": max(0, passed - ticks),
            "first_tick": self.first_tick,
            "cut_time_s": self._cut_ticks * self.machine.period_s,
            "following_error": {a.name: e for a, e in zip(self.machine.axes, shown, strict=True)},
            **({"found": self.found} if self.found else {}),
            **more,
        }
        try:
            self._write(facts)
        except OSError:
            if not ticks:
                own_files.remove_tree(self.folder, self._state)
        return facts

    def _facts(self) -> dict[str, Any]:
        """What is known from the beginning."""
        return {"id": self.folder.name, **self.what, "started_s": self._started_s}

    def throw_away(self) -> None:
        """Nothing was run."""
        if self._file is not None:
            self._file.close()
        own_files.remove_tree(self.folder, self._state)

    @property
    def to_pack(self) -> bool:
        """Whether there is something to ``pack``."""
        return self._file is not None and self._file.to_pack

    def give_up(self, why: Message) -> None:
        """No more is kept of it."""
        if self._file is not None:
            self._file.give_up(why)

    def pack(self) -> None:
        """Segments that are full take less room; a disk that has none for that keeps them as they are."""
        if self._file is not None:
            with contextlib.suppress(OSError):
                self._file.pack()

    def _write(self, facts: dict[str, Any]) -> None:
        """Raises OSError."""
        own_files.make_folder(self.folder, self._state)  # there may be room by now
        if self._file is not None:
            self._write_events(is_last=True)
            self._file.close()
            facts[record_files.COUNT] = self._file.lines
            try:
                self._file.pack()
            except OSError:  # what is there stays as it is
                if not self._ticks:
                    raise
        _write_facts(self.folder / RUN, facts)
        own_files.remove(self.folder / BEGUN, self._state)


def _write_facts(file: Path, facts: dict[str, Any]) -> None:
    atomic_file.write(file, sealed_file.text(facts, file.name), file.parent.parent.parent)


def plain(name: str) -> str:
    """What the record of a program is called by."""
    return re.sub(r"[^A-Za-z0-9._-]+", "_", name)[:60].strip(".") or "program"


def _stem(name: str) -> str:
    now_s = time.time()  # to the millisecond, so that the names' order is that of the runs
    return time.strftime(_STEM, time.localtime(now_s)) + f".{int(now_s * 1e3) % 1000:03d}-{plain(name)}"


def index(store: ServiceStore, state: Path) -> None:
    """Gives runs a row whose service had no time or no room for it: those of records that have an end."""
    with_row = history.records(store)
    without = [name for name in own_files.names(state / FOLDER, state) if name not in with_row]
    with contextlib.suppress(OSError), store.write() as sql:  # a full disk forbids no start
        for name in without:
            with contextlib.suppress(KeyError, TypeError, ValueError):  # it has no end, or none that is sound
                history.add_run(sql, {**_read(state, name, RUN), "id": name})


def _read(state: Path, name: str, file: str) -> dict[str, Any]:
    """The facts of a run's file; nothing where they are not there, damaged, or of another run."""
    with contextlib.suppress(OSError, ValueError):
        return record_files.facts(state / FOLDER / name, file, state)
    return {}


def settle(store: ServiceStore, state: Path) -> list[Message]:
    """Runs that a service before this one began and did not end are lost: such a run ended when the last of
    its setpoints was written. What cannot be read of beginnings and ends is put aside, and said by alarms; an
    end that has a row is written anew. Raises OSError.
    """
    found = []
    for name in own_files.names(state / FOLDER, state):
        folder = state / FOLDER / name
        there = [file for file in (folder / RUN, folder / BEGUN) if os.path.lexists(file)]
        for file in (file for file in there if not _read(state, name, file.name)):
            aside = own_files.put_aside(file, state)
            found.append(message("record_damaged", file=file, aside=aside.name if aside else "-"))
        with contextlib.suppress(OSError):
            if there and not os.path.lexists(folder / RUN):
                begun = _read(state, name, BEGUN) or _of_name(name)
                known = history.end_of(store, name) or {**begun, **_ended(folder, state)}
                _write_facts(folder / RUN, known)
            own_files.remove(folder / BEGUN, state)
    return found


def keep(state: Path, name: str, on: bool) -> bool:
    """Has the record of a run stay, or go with the oldest again; False: there is none. Raises OSError."""
    if name not in own_files.names(state / FOLDER, state):
        return False
    file = state / FOLDER / name / record_files.KEPT
    if on:
        own_files.new(file, state).close()
        atomic_file.sync(file.parent, state)
    else:
        own_files.remove(file, state)
    return True


def _ended(folder: Path, state: Path) -> dict[str, Any]:
    """Of a run whose end nobody knows: when a file of its folder was last written. Raises OSError."""
    with own_files.folder(folder, state) as at:
        last_s = max(os.stat(one, dir_fd=at, follow_symlinks=False).st_mtime for one in os.listdir(at))
    return {"ended_s": last_s, "result": "lost"}


def _of_name(name: str) -> dict[str, Any]:
    """What the name of a record tells of a run whose beginning cannot be read any more."""
    began, program = name[: len(_TIME)], name[len(_TIME) + 5 :]
    with contextlib.suppress(ValueError, OverflowError):
        return {"id": name, "name": program, "started_s": time.mktime(time.strptime(began, _STEM))}
    return {"id": name, "name": program, "started_s": 0.0}
