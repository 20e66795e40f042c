"""The names of what is kept of a run and of a fault: folders in the state folder, and their files."""

from __future__ import annotations

from typing import Final

RECORDINGS: Final = "recordings"  # a folder for each fault
RUNS: Final = "runs"  # a folder for each run, with ...
RUN: Final = "run.json"  # ... how it ended; ...
BEGUN: Final = "begun.json"  # ... while it goes on, or was lost: how it began ...
EVENTS: Final = "events.jsonl"
PROGRAM: Final = "program.ngc"
MACHINE: Final = "machine.toml"
SETPOINTS: Final = "setpoints.npz"  # while it goes on, or where it was lost, .part
ACTUAL: Final = "actual.npz"  # likewise: where the drives were
TRACE: Final = "trace.npz"  # of a fault: the last seconds before it
