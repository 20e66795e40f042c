"""Where a scope's ticks come from: the machine's last half minute, a fault's recording, a run's record.

"now"              asked of the service bit by bit, while somebody looks
"recording:NAME"   trace.npz of what was kept of a fault
"run:NUMBER"       the setpoints of a run
"""

from __future__ import annotations

import asyncio
import time
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from controller import npz
from controller.api import signals
from controller.api.answers import Refusal
from controller.api.service_client import ServiceClient
from controller.api.signals import Signals
from controller.geometry.arrays import Array
from controller.ipc import packed_rows
from controller.ipc.handoff import COLUMN, ROW, rows_of
from controller.machine import machine_file
from controller.machine.model import Machine
from controller.machine.toml_table import ConfigError
from controller.state import record_files
from controller.state.setpoints import SETPOINTS
from controller.store import set_up_store

KEPT_S = 30.0
AT_ONCE = 500  # rows of one answer of the service: 190 kB at worst
FRESH_S = 0.02  # two who look at the same time ask once
MAX_ROWS = 4_000_000  # of a run's record
MAX_TURNS = 200  # questions in one look: the service writes rows faster than nobody can read


@dataclass(slots=True)
class Latest:
    """The machine's last ticks; asks only while it is asked itself."""

    _door: ServiceClient
    rows: Array = field(default_factory=lambda: np.empty((0, len(ROW))))
    _asking: asyncio.Lock = field(default_factory=asyncio.Lock)
    _at_s: float = -1e9

    async def look(self, period_s: float) -> Array:
        """The rows of the last ``KEPT_S``, oldest first. Raises Refusal."""
        async with self._asking:
            if time.monotonic() - self._at_s > FRESH_S:
                await self._fetch(max(1, round(KEPT_S / period_s)))
                self._at_s = time.monotonic()
            return self.rows

    async def _fetch(self, kept: int) -> None:
        for _ in range(MAX_TURNS):
            after = int(self.rows[-1, COLUMN["tick"]]) if len(self.rows) else None
            told = await self._door.ask("rows", after=after, most=AT_ONCE, kept=kept)
            came = unpacked(told)
            if told.get("anew"):  # another tick process, which counts from zero
                self.rows = self.rows[:0]
            self.rows = np.concatenate([self.rows, came])[-kept:]
            if len(came) < AT_ONCE:
                return


def unpacked(told: dict[str, Any]) -> Array:
    """The rows of an answer. Raises Refusal where it is not what a service of this version says."""
    try:
        return packed_rows.unpacked(told)
    except ValueError as error:
        raise Refusal.of(503, "version", "other_version") from error


def machine_of(state: Path) -> Machine:
    """The machine of the service that runs, or ran last. Raises Refusal."""
    try:
        return _noted(state, set_up_store.sum_of(state))
    except (ConfigError, OSError, ValueError, KeyError) as error:
        raise Refusal.of(404, "missing", "no_machine") from error


@lru_cache(maxsize=4)
def _noted(state: Path, _: str) -> Machine:
    return set_up_store.machine(state)


def of_recording(folder: Path) -> Signals:
    """What was kept of a fault, on the machine as it was then. Raises Refusal."""
    file = folder / record_files.TRACE
    try:
        return _recording(file, *_stamp(file))
    except (OSError, ValueError, KeyError, ConfigError) as error:
        raise _unreadable(file) from error


@lru_cache(maxsize=3)
def _recording(file: Path, *_: int) -> Signals:
    kept = npz.read(file)
    columns, found = [str(name) for name in kept["columns"]], np.asarray(kept["rows"], dtype=float)
    machine = machine_file.read(str(kept["machine"]), record_files.MACHINE)
    return Signals(rows_of(columns, found), machine)


def of_run(folder: Path, machine: Machine) -> Signals:
    """The setpoints of a run, on the machine as it is now. Raises Refusal."""
    file = folder / SETPOINTS.whole
    try:
        return _run(folder, machine, *_stamp(file))
    except (OSError, ValueError, KeyError) as error:
        raise _unreadable(file) from error


@lru_cache(maxsize=2)
def _run(folder: Path, machine: Machine, *_: int) -> Signals:
    """Its first rows, of as many segments as these are in. Raises OSError and ValueError."""
    found = SETPOINTS.read(folder, MAX_ROWS)
    if found is None:
        raise FileNotFoundError(folder)
    return Signals(signals.rows_of_setpoints(found, machine), machine)


def _unreadable(file: Path) -> Refusal:
    return Refusal.of(404, "missing", "no_ticks", file=f"{file.parent.name}/{file.name}")


def _stamp(file: Path) -> tuple[int, int]:
    """Of a file that may not be there."""
    try:
        found = file.stat()
    except OSError:
        return 0, 0
    return found.st_size, found.st_mtime_ns
