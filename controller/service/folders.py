"""Where a service keeps what outlives it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from controller import own_files
from controller.machine import arrangement
from controller.state.record_files import RECORDINGS


@dataclass(frozen=True, slots=True)
class Folders:
    """``state`` has what is of one machine; the others are in it, or shared with the command line."""

    state: Path
    checks: Path  # of programs
    recordings: Path  # of faults

    @classmethod
    def within(cls, state: Path) -> Folders:
        """All of it in one folder."""
        return cls(state, state / "checks", state / RECORDINGS)

    @property
    def arranged(self) -> Path:
        """How the drives were found."""
        return self.state / arrangement.FOLDER

    def make(self) -> None:
        """Raises OSError."""
        for folder in (self.checks, self.recordings):
            own_files.make_folder(folder, folder.parent)
