"""What a run leaves on the disk while it is under way: rows and events, each behind the last one.

Nothing that was written is written again, so that a loss of power costs what the disk had not been told
of yet: ``sync`` tells it, some twenty times a second. A reader counts whole rows and whole lines.

Each event gets the number of the SYNC before which it came. What the planner tells comes later than the rows
of the ticks that it is about, so ticks are remembered for a while; what a row tells is written with it.
"""

from __future__ import annotations

import contextlib
import errno
import json
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

from controller import atomic_file, own_files
from controller.ipc.handoff import COLUMN
from controller.runtime import events

PART = "setpoints.part"
MAX_BYTES = 256 << 20  # of setpoints in one run: six hours at 2 ms
LOOKED_AT = 3  # records before, whose files may be the same


class RunFile:
    """One thread writes, another one may ``sync``. A full disk costs the record, not the run."""

    def __init__(self, folder: Path) -> None:
        """Raises OSError."""
        self._folder = folder
        state = folder.parent.parent
        self._rows = own_files.new(folder / PART, state, buffering=0)
        self._events = own_files.new(folder / events.FILE, state, buffering=0)
        self._lock = threading.Lock()  # nobody closes what is just being told to the disk
        self._kept_bytes = 0
        self._is_new = {self._rows: False, self._events: False}
        self.problem = ""  # why no more is written

    def rows(self, data: bytes) -> None:
        """Setpoints, in whole rows."""
        if self._kept_bytes <= MAX_BYTES:
            self._kept_bytes += len(data)
            self._write(self._rows, data)

    def events(self, lines: Iterable[dict[str, Any]]) -> None:
        """Events, a line each."""
        self._write(self._events, "".join(json.dumps(line) + "\n" for line in lines).encode())

    def _write(self, file: Any, data: bytes) -> None:
        if not data or self.problem:
            return
        try:
            if file.write(data) != len(data):  # the disk took a part: what came behind it would be torn
                self.problem = os.strerror(errno.ENOSPC)
        except OSError as error:
            self.problem = error.strerror or str(error)
        except ValueError as error:  # closed
            self.problem = str(error)
        self._is_new[file] = True

    def sync(self) -> None:
        """Returns when the disk has all that was written before."""
        with self._lock:
            for file in (self._rows, self._events):
                if self._is_new[file] and not file.closed:
                    self._is_new[file] = False
                    try:
                        os.fdatasync(file.fileno())
                    except OSError as error:
                        self.problem = error.strerror or str(error)

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
            self._rows.close()
            self._events.close()


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
