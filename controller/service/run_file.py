"""What a run leaves on the disk while it is under way: rows and events, each after the last one.

Nothing that was written is written again before its segment is full (``state.setpoints``), so that a loss
of power costs what the disk had not been told of yet: ``sync`` tells it, some twenty times a second. A reader
counts whole frames and whole lines.

Each event gets the number of the SYNC before which it came. What the planner tells comes later than the rows
of the ticks that it is about, so ticks are remembered for a while; what a row tells is written with it.
"""

from __future__ import annotations

import contextlib
import errno
import os
import threading
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from controller import atomic_file, own_files, sealed_file
from controller.commands.table import SWITCHES
from controller.ipc.handoff import (
    BRAKED,
    COLUMN,
    EXPIRED,
    OFF_PATH,
    PLAN_IDS,
    PLAYED,
    SETTLED,
    STOOD,
    TAKEN_BACK,
    TAKEN_BACK_BRAKED,
    WAITED,
    Outcome,
    Snapshot,
)
from controller.messages import Message, reason
from controller.runtime import events
from controller.service.engine import SentRequest
from controller.state import setpoints
from controller.state.modes import Fault, Request
from controller.state.setpoints import PART, TABLES, WHOLE, Counts, Table

LOOKED_AT = 3  # records before, whose files may be the same


class _Growing:
    """The segment of a table that is written."""

    def __init__(self, table: Table, folder: Path, first: int) -> None:
        """Raises OSError."""
        self.table, self.first, self.bytes = table, first, 0
        self.path = folder / table.name(first, PART)
        self.file = own_files.new(self.path, folder.parent.parent, buffering=0)

    @property
    def room(self) -> int:
        """For how many rows more; one at least is in each."""
        return max(0 if self.bytes else 1, (setpoints.SEGMENT_BYTES - self.bytes) // self.table.row_bytes)

    def count(self, rows: Counts) -> None:
        """These were added."""
        self.bytes += rows.nbytes


class RunFile:
    """One thread writes, another one may ``sync``, and one ``pack``. A full disk costs the record, not the
    run.
    """

    def __init__(self, folder: Path) -> None:
        """Raises OSError."""
        self._folder, self._state = folder, folder.parent.parent
        self._growing = {table: _Growing(table, folder, 0) for table in TABLES}
        self._events = own_files.new(folder / events.FILE, self._state, buffering=0)
        self._full: list[_Growing] = []  # segments that nothing is added to any more, and are not packed yet
        self._lock = threading.Lock()  # nobody closes what is just being told to the disk
        self._lines = 0
        self._new = set[Any]()  # files of which the disk has not all yet
        self.problem: Message | str = ""  # why no more is written
        self.to_pack = False  # a segment is full since it was packed last

    def rows(self, table: Table, first: int, rows: Counts) -> None:
        """Rows (N, columns) of the ticks from ``first`` on."""
        while len(rows) and not self.problem and table in self._growing:
            growing = self._growing[table]
            added, rows = rows[: growing.room], rows[growing.room :]
            self._write(growing.file, table.frame(first, added, self._folder.name))
            growing.count(added)
            first += len(added)
            if not growing.room:
                self._begin_segment(table, first)

    def _begin_segment(self, table: Table, first: int) -> None:
        try:
            new = _Growing(table, self._folder, first)
        except OSError as error:
            self.problem = reason(error)
            return
        with self._lock:
            self._full.append(self._growing[table])
            self._growing[table] = new
            self.to_pack = True

    def pack(self) -> None:
        """Segments that are full take less room from now on. Raises OSError; then those left stay as they
        are.
        """
        self.to_pack = False
        while self._full:
            full = self._full[0]
            rows, spoilt = full.table.of_part(
                own_files.read_bytes(full.path, self._state), full.first, self._folder.name
            )
            if spoilt is None and (len(rows) or not full.first):
                self._pack(full, rows)
            with self._lock:
                del self._full[0]
                full.file.close()
            if spoilt is None:
                own_files.remove(full.path, self._state)

    def _pack(self, full: _Growing, rows: Counts) -> None:
        """The disk has it before it gets its name. Raises OSError."""
        whole = full.path.with_suffix(WHOLE)
        new = whole.with_name(f"{whole.name}.new")
        try:
            with own_files.new(new, self._state) as file:
                full.table.pack(file, full.first, rows, self._folder.name)
                file.flush()
                os.fsync(file.fileno())
            own_files.rename(new, whole, self._state)
            atomic_file.sync(self._folder, self._state)
        except OSError:
            own_files.remove(new, self._state)
            raise

    def events(self, lines: Iterable[dict[str, Any]]) -> None:
        """Events, a line each, with sums and in order."""
        texts = [sealed_file.line(one, number) for number, one in enumerate(lines, self._lines + 1)]
        self._lines += len(texts)
        self._write(self._events, "".join(texts).encode())

    def _write(self, file: Any, data: bytes) -> None:
        if not data or self.problem:
            return
        try:
            if file.write(data) != len(data):  # the disk took a part: what came after it would be torn
                self.problem = reason(OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)))
        except OSError as error:
            self.problem = reason(error)
        except ValueError as error:  # closed
            self.problem = str(error)
        self._new.add(file)

    def give_up(self, why: Message) -> None:
        """No more is written."""
        self.problem = self.problem or why

    @property
    def lines(self) -> int:
        """Of events, so far."""
        return self._lines

    def sync(self) -> None:
        """Returns when the disk has all that was written before."""
        with self._lock:
            for file in self._open:
                if file in self._new and not file.closed:
                    self._new.discard(file)
                    try:
                        os.fdatasync(file.fileno())
                    except OSError as error:
                        self.problem = reason(error)

    def begin(self, sources: Mapping[str, bytes]) -> None:
        """The disk has the beginning, that there is such a run, and what is run. Raises OSError.

        ``sources``: what files beside have. One that a record before has, too, takes no room again.
        """
        for name, data in sources.items():
            _keep(self._folder / name, data)
        self.sync()
        atomic_file.sync(self._folder, self._folder.parent.parent)
        atomic_file.sync(self._folder.parent, self._folder.parent.parent)

    def close(self) -> None:
        """Nothing more comes."""
        self.sync()
        with self._lock:
            self._full += self._growing.values()
            self._growing = {}
            for file in self._open:
                file.close()

    @property
    def _open(self) -> tuple[Any, ...]:
        return *(one.file for one in (*self._full, *self._growing.values())), self._events


def _keep(file: Path, data: bytes) -> None:
    """Raises OSError."""
    runs, state = file.parent.parent, file.parent.parent.parent
    with own_files.new(file, state) as out:
        out.write(data)
        out.flush()
        os.fsync(out.fileno())
    others = [one for one in own_files.names(runs, state)[::-1] if one != file.parent.name]
    there = (runs / one / file.name for one in others)
    for other in islice((one for one in there if os.path.lexists(one)), LOOKED_AT):
        with contextlib.suppress(OSError):
            if own_files.read_bytes(other, state) == data:
                own_files.share(other, file, state)
                return


REMEMBERED_TICKS = 1 << 16  # longer than any turn of the planner takes

Rows = npt.NDArray[np.float64]


@dataclass(slots=True)
class _Ticks:
    """Some rows: their ticks, which of them sent a SYNC, and how many had before."""

    ticks: npt.NDArray[np.int64]
    sent: npt.NDArray[np.bool_]
    before: int


class RunEvents:
    """``add`` what happened at a tick, ``pass_rows`` as they come, and ``timed`` gives the lines."""

    def __init__(self) -> None:
        self._waiting: list[tuple[int, dict[str, Any]]] = []
        self._known: deque[_Ticks] = deque()
        self._remembered = 0
        self.sent = 0  # SYNCs since the start
        self.first_tick = -1  # of the run
        self._newest = -1

    def begin(self, tick: int) -> None:
        """The run has begun with that one."""
        self.first_tick = tick

    def add(self, at: int, line: dict[str, Any]) -> None:
        """``at``: the tick of the machine in which it came, or before which."""
        self._waiting.append((at, line))

    def pass_rows(self, rows: Rows) -> None:
        """Of the run, from its first tick on."""
        ticks, sent = rows[:, COLUMN["tick"]].astype(np.int64), rows[:, COLUMN["sync_sent"]] != 0.0
        self._known.append(_Ticks(ticks, sent, self.sent))
        self.sent += int(np.count_nonzero(sent))
        self._remembered += len(ticks)
        self._newest = int(ticks[-1])
        while self._remembered - len(self._known[0].ticks) > REMEMBERED_TICKS:
            self._remembered -= len(self._known.popleft().ticks)

    def timed(self, is_last: bool = False) -> Iterator[dict[str, Any]]:
        """Lines of all whose tick is known by now; ``is_last``: no other tick comes."""
        due = [one for one in self._waiting if is_last or one[0] <= self._newest]
        if self.first_tick < 0 or not due:
            return
        self._waiting = [one for one in self._waiting if not is_last and one[0] > self._newest]
        for at, line in due:
            yield {**self._when(at), **line}

    def _when(self, at: int) -> dict[str, Any]:
        if at < self.first_tick:
            return {"tick": -1, "at": at}
        known = next((one for one in self._known if one.ticks[-1] >= at), None)
        if known is None:
            return {"tick": self.sent, "at": at}
        i = int(np.searchsorted(known.ticks, at))
        n = known.before + int(np.count_nonzero(known.sent[:i]))
        return {"tick": n, "at": int(known.ticks[i]), **({} if known.sent[i] else {"late": True})}


_NAMES = {request: name for name, request in {**events.REQUESTS, **events.RECORDED}.items()}
# They come again by themselves, for it is the tick that finds them in what it has been given.
_OWN_FAULTS = (Fault.NONE, Fault.BRANCH_LOST, Fault.TRAVEL, Fault.VELOCITY, Fault.ACCELERATION)


class RowEvents:
    """Finds them row by row, and adds them to the events of the run."""

    def __init__(self, found: RunEvents) -> None:
        self._events = found
        self._begun = False
        self._flags, self._fault = 0, Fault.NONE  # as the last row had them
        self._led = np.zeros((1, 2))  # likewise: how far the spindle led the axes, and that it had settled
        self._share = 1.0  # likewise: what the load of the spindle left of the feed

    def find_requests(self, rows: Rows, asked: deque[SentRequest], now: Snapshot | None) -> None:
        """Add requests, as of ``RunRecord.take``, and pieces of the plan.

        Numbers rise in the order in which the tick takes them, and a row has the last that it took.
        """
        if not self._begun:
            self._first_settings(rows[0])
        for row in rows[rows[:, COLUMN["request"]] != 0.0]:
            number, at = int(row[COLUMN["request"]]), int(row[COLUMN["tick"]])
            while number < PLAN_IDS and asked and asked[0].number <= number:
                one = asked.popleft()
                refused = now is not None and now.came_of(one.number)[0] is Outcome.REFUSED
                if one.request in _NAMES and not refused:
                    self._events.add(at, _request_line(one))
        for tick in rows[rows[:, COLUMN["accepted"]] != 0.0, COLUMN["tick"]]:
            self._events.add(int(tick), events.line_of(events.PIECES))

    def _first_settings(self, row: Rows) -> None:
        """Overrides and switches that were set before hold for what is planned first."""
        self._begun = True
        at = int(row[COLUMN["tick"]]) - 1
        for name in events.OVERRIDES:
            if row[COLUMN[name]] != 1.0:
                self._events.add(at, events.line_of(name, float(row[COLUMN[name]])))
        for switch in SWITCHES:
            if int(row[COLUMN["switches"]]) & switch.bit:
                self._events.add(at, events.line_of(switch.name, 1))

    def find(self, rows: Rows) -> None:
        """What came from drives and devices, and what the tick made of long gaps."""
        switches, faults = rows[:, COLUMN["switches"]].astype(np.int64), rows[:, COLUMN["fault"]]
        for row in rows[switches & STOOD != 0]:
            self._events.add(int(row[COLUMN["tick"]]), events.line_of(events.STAND))
        for row in rows[switches & EXPIRED != 0]:  # by ticks that were missed, too: those are in no record
            self._events.add(int(row[COLUMN["tick"]]), events.line_of(_NAMES[Request.JOG_STOP]))
        for i in _changes(faults, float(self._fault)):
            self._fault = Fault(int(faults[i]))
            if self._fault not in _OWN_FAULTS:
                self._events.add(int(rows[i, COLUMN["tick"]]), events.line_of(events.FAULT, self._fault.name))
        for row in rows[switches & (TAKEN_BACK | TAKEN_BACK_BRAKED) != 0]:
            braked = int(row[COLUMN["switches"]]) & TAKEN_BACK_BRAKED != 0
            self._events.add(int(row[COLUMN["tick"]]), events.line_of(events.TAKEN_BACK, 1 + braked))
        sent = rows[rows[:, COLUMN["sync_sent"]] != 0.0]
        self._find_flags(sent)
        self._find_threads(sent)
        shares = rows[:, COLUMN["adaptive_share"]]
        for i in _changes(shares, self._share):
            self._share = float(shares[i])
            line = events.line_of(events.ADAPTIVE, self._share)
            self._events.add(int(rows[i, COLUMN["tick"]]), line)

    def _find_flags(self, sent: Rows) -> None:
        """Where motion begins to wait, or waits no more, and where the axes are off their path."""
        flags = sent[:, COLUMN["switches"]].astype(np.int64) & (WAITED | OFF_PATH | PLAYED | BRAKED)
        for i in _changes(flags, self._flags):
            changed, self._flags = int(flags[i]) ^ self._flags, int(flags[i])
            at = int(sent[i, COLUMN["tick"]])
            if changed & WAITED:
                self._events.add(at, events.line_of(events.WAIT, int(bool(self._flags & WAITED))))
            if changed & (PLAYED | BRAKED):
                played = bool(self._flags & PLAYED) + bool(self._flags & BRAKED)
                self._events.add(at, events.line_of(events.STOCK, played))
            if changed & self._flags & OFF_PATH:
                self._events.add(at, events.line_of(events.OFF_PATH))

    def _find_threads(self, sent: Rows) -> None:
        """How far the spindle's angle led the axes, wherever that changes."""
        settled = sent[:, COLUMN["switches"]].astype(np.int64) & SETTLED != 0
        led = np.stack([sent[:, COLUMN["thread_mm"]], settled], axis=1)
        before = np.vstack([self._led, led])
        for i in np.flatnonzero((before[1:] != before[:-1]).any(axis=1)).tolist():
            value = [float(led[i, 0]), bool(led[i, 1])]
            self._events.add(int(sent[i, COLUMN["tick"]]), events.line_of(events.THREAD, value))
        self._led = before[-1]


def _changes(values: npt.NDArray[Any], before: float) -> Iterable[int]:
    """Where a column has another value than one row earlier; nearly always nowhere, which costs little."""
    return np.flatnonzero(np.diff(values, prepend=before)).tolist() if np.any(values != before) else ()


def _request_line(one: SentRequest) -> dict[str, Any]:
    """As ``session.events`` reads it."""
    name = _NAMES[one.request]
    if one.jog is not None:
        length = one.jog.length if np.isfinite(one.jog.length) else None
        return events.line_of(name, [one.jog.speed, length, *one.jog.direction])
    takes_value = name in (*events.OVERRIDES, *events.SWITCHES, *events.BY_HAND)
    return events.line_of(name, one.value if takes_value else None)
