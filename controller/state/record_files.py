"""The names of what is kept of a run and of a fault: folders in the state folder, and their files."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from controller import own_files, sealed_file
from controller.messages import message

RECORDINGS: Final = "recordings"  # a folder for each fault
RUNS: Final = "runs"  # a folder for each run, with ...
RUN: Final = "run.json"  # ... how it ended; ...
BEGUN: Final = "begun.json"  # ... while it goes on, or was lost: how it began ...
EVENTS: Final = "events.jsonl"
COUNT: Final = "events"  # in ``RUN``: how many lines of them there are
PROGRAM: Final = "program.ngc"
MACHINE: Final = "machine.toml"
SETPOINTS: Final = "setpoints.npz"  # while it goes on, or where it was lost, .part
ACTUAL: Final = "actual.npz"  # likewise: where the drives were
TRACE: Final = "trace.npz"  # of a fault: the last seconds before it
TOUCHES: Final = "touches.json"  # the last of the probe, as lines of a table, its head first ...
OLDER_TOUCHES: Final = "touches.csv"  # ... and as versions before wrote them


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


def touches(state: Path) -> list[str]:
    """Lines of the table of the probe's last touches, its head first.

    Raises FileNotFoundError where there are none, OSError, and ValueError or TypeError for what is damaged.
    """
    try:
        return table_lines(sealed_file.read(state / TOUCHES))
    except FileNotFoundError:
        return own_files.read_text(state / OLDER_TOUCHES).splitlines()


def table_lines(values: Any) -> list[str]:
    """Raises TypeError for what are no lines of a table."""
    if not isinstance(values, list) or not values or not all(isinstance(line, str) for line in values):
        raise TypeError("no lines of a table")
    return values
