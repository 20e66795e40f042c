"""The names of what is kept of a run and of a fault: folders in the state folder, and their files."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path
from typing import Any, Final

from controller import sealed_file
from controller.messages import message

RECORDINGS: Final = "recordings"  # a folder for each fault
RUNS: Final = "runs"  # a folder for each run, with ...
RUN: Final = "run.json"  # ... how it ended; ...
BEGUN: Final = "begun.json"  # ... while it goes on, or was lost: how it began ...
EVENTS: Final = "events.jsonl"
COUNT: Final = "events"  # in ``RUN``: how many lines of them there are
PROGRAM: Final = "program.ngc"
MACHINE: Final = "machine.toml"
SETPOINTS: Final = "setpoints.npz"  # its first segment: see ``state.setpoints``
ACTUAL: Final = "actual.npz"  # likewise: where the drives were
PROCESS: Final = "process.npz"  # likewise: feed, and load of the spindle
KEPT: Final = "kept"  # there where an operator wants the record of a run or fault to stay
TRACE: Final = "trace.npz"  # of a fault: the last seconds before it


def facts(folder: Path, name: str = RUN, within: Path | None = None) -> dict[str, Any]:
    """What a file of a run's folder says of it; ``within``: as ``own_files`` has it.

    A folder that was renamed, or copied elsewhere, keeps its number, but a file of another run that is there
    has come to a wrong place. Raises OSError, and ValueError for what is damaged.
    """
    values = sealed_file.read(folder / name, within=within, shared=True, older=sealed_file.INDENTED)
    if not isinstance(values, dict):
        raise sealed_file.Damaged(message("sealed.none"))
    number = str(values.get("id") or folder.name)
    if number != folder.name and "/" not in number and (folder.parent / number).is_dir():
        raise sealed_file.Damaged(message("sealed.other"))
    return values


def known(folder: Path) -> dict[str, Any]:
    """What is known of a run: of one that was killed only how it began; nothing where that is damaged."""
    for name in (RUN, BEGUN):
        with contextlib.suppress(OSError, ValueError):
            return facts(folder, name)
    return {}


def is_needed(folder: Path) -> bool:
    """Whether a record may not go: an operator keeps it, or its run is under way."""
    return os.path.lexists(folder / KEPT) or (
        os.path.lexists(folder / BEGUN) and not os.path.lexists(folder / RUN)
    )
