"""Whether the disk takes what a run leaves behind: asked before it starts, while nothing is lost yet.

A run that cannot be recorded cannot be made again, nor gone on with after a loss of power; and a fault in it
leaves no recording. That is for an operator to know before, and to decide.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path
from typing import Any

from controller.messages import Key
from controller.service.jobs import Job
from controller.service.refusals import refused

ROW_BYTES = 24  # of a tick's setpoints
MAX_ROWS_BYTES = 256 << 20  # a longer run is not kept to its end
SPARE_BYTES = 64 << 20  # for events, a fault's recording, alarms and the journal
PROBE_BYTES = 1 << 16
FOLDERS = ("runs", "recordings", "")  # of the state folder, which itself has alarms and journal


def check(state: Path, job: Job) -> None:
    """Raises CommandRefused "unrecorded" where a run of ``job`` could not be kept."""
    period_s = job.program.machine.period_s
    ticks = (job.duration_s or 0.0) / period_s
    rows = min(MAX_ROWS_BYTES, round(ticks * ROW_BYTES))
    if reason := lacking(state, rows + len(job.program.text) + SPARE_BYTES):
        raise refused("unrecorded", "READY", "START", "unrecorded", program=job.program.name, **reason)


def lacking(state: Path, needed: int) -> dict[str, Any]:
    """Why so many bytes cannot be kept, as values of the refusal; nothing where they can."""
    for name in FOLDERS:
        folder = state / name
        try:
            folder.mkdir(parents=True, exist_ok=True)
            _probe(folder)
            free = shutil.disk_usage(folder).free
        except OSError as error:
            return {"why": f"{folder}: {error.strerror or error}"}
        if free < needed:
            return {
                "why": Key("little_room"),
                "free": free >> 20,
                "needed": -(-needed >> 20),
                "folder": folder,
            }
    return {}


def _probe(folder: Path) -> None:
    """Write something, for neither a permission nor a mount tells of itself what will be. Raises OSError."""
    with tempfile.TemporaryFile(dir=folder) as file:
        file.write(bytes(PROBE_BYTES))
        file.flush()
        os.fsync(file.fileno())
