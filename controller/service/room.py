"""Room on the disk for what runs and faults leave.

They may take so many bytes, ``[records]`` of the machine file; beyond them the oldest go, of runs and faults
alike, but for what an operator keeps and for the last run, which no budget ends while it is under way.
Likewise where less of the disk is free than events, alarms and the journal need.

Before a start it is asked whether the disk takes anything, while nothing is lost yet: a run that cannot be
recorded cannot be made again, nor gone on with after a loss of power, and a fault in it leaves no recording.
That is for an operator to know, and to decide.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from controller import own_files
from controller.machine.model import Machine
from controller.messages import Key, message
from controller.service.folders import Folders
from controller.state import record_files, setpoints
from controller.state.record_files import RECORDINGS, RUNS

ROW_BYTES = sum(table.row_bytes for table in setpoints.TABLES)  # of a tick at most, ...
PACKED_BYTES = 20  # ... and, once its segment is packed, about half of this: see ``Table.pack``
SPARE_BYTES = 64 << 20  # for events, a fault's recording, alarms and the journal
MOST = 2000  # runs, however small: each is read at the start
PROBE_BYTES = 1 << 16
FOLDERS = (RUNS, RECORDINGS, "")  # of the state folder, which itself has alarms and journal


class Room:
    """What the records of a machine may take; any thread may use it."""

    def __init__(self, folders: Folders, machine: Machine) -> None:
        self._state, self._keys, self._period_s = folders.state, machine.records, machine.period_s
        self._folders = folders.state / RUNS, folders.recordings
        self._lock = threading.Lock()

    @property
    def budget_bytes(self) -> int:
        """Of all records together. Raises OSError."""
        disk = shutil.disk_usage(self._state)
        return min(round(self._keys.most_gb * 1e9), round(self._keys.share * disk.total))

    def facts(self) -> dict[str, float | None]:
        """The budget, and for how many hours of motion it is enough at least."""
        try:
            budget = self.budget_bytes
        except OSError:
            return {"budget_bytes": None, "hours": None}
        return {"budget_bytes": budget, "hours": budget / ROW_BYTES * self._period_s / 3600.0}

    def make(self) -> bool:
        """Has the oldest go; False where even so the disk has less than ``SPARE_BYTES``. Raises OSError."""
        with self._lock:
            records = sorted(self._records(), key=lambda one: one.name)
            sizes = {one: _size(one, self._state) for one in records}
            last = max((one for one in records if one.parent.name == RUNS), default=None)
            used, runs = sum(sizes.values()), sum(one.parent.name == RUNS for one in records)
            budget = self.budget_bytes
            for one in records:
                if used <= budget and self._has_spare() and runs <= MOST:
                    break
                if one != last and not record_files.is_needed(one):
                    own_files.remove_tree(one, one.parent.parent)
                    used, runs = used - sizes[one], runs - (one.parent.name == RUNS)
            return self._has_spare()

    def _has_spare(self) -> bool:
        return shutil.disk_usage(self._state).free >= SPARE_BYTES

    def _records(self) -> Iterator[Path]:
        for folder in self._folders:
            for name in own_files.names(folder, folder.parent):
                yield folder / name


def _size(record: Path, state: Path) -> int:
    """Bytes that go with it: a file that it shares with another record is the other's, too."""
    with contextlib.suppress(OSError), own_files.folder(record, record.parent.parent) as at:
        facts = [os.stat(name, dir_fd=at, follow_symlinks=False) for name in os.listdir(at)]
        return sum(512 * one.st_blocks // max(1, one.st_nlink) for one in facts)
    return 0


# -- before a start


def needed(ticks: float) -> int:
    """Bytes that a run of so many ticks takes, about, and what is to stay free after it."""
    growing = len(setpoints.TABLES) * 2 * setpoints.SEGMENT_BYTES  # and one that is being packed
    return round(min(ticks * ROW_BYTES, growing + ticks * PACKED_BYTES)) + SPARE_BYTES


def lacking(state: Path, needed: int) -> dict[str, Any]:
    """Why so many bytes cannot be kept, as values of the refusal; nothing where they can."""
    for name in FOLDERS:
        folder = state / name
        try:
            own_files.make_folder(folder, state)
            _probe(folder, state)
            free = shutil.disk_usage(folder).free
        except OSError as error:
            return {"why": message("of_place", place=folder, why=error)}
        if free < needed:
            return {
                "why": Key("little_room"),
                "free": free >> 20,
                "needed": -(-needed >> 20),
                "folder": folder,
            }
    return {}


def _probe(folder: Path, state: Path) -> None:
    """Write something, for neither a permission nor a mount tells of itself what will be. Raises OSError."""
    file = folder / ".probe"
    try:
        with own_files.new(file, state) as probe:
            probe.write(bytes(PROBE_BYTES))
            probe.flush()
            os.fsync(probe.fileno())
    finally:
        own_files.remove(file, state)
