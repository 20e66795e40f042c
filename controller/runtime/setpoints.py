"""What the record of a run keeps of every tick that sent a SYNC: setpoints and positions, in counts."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from controller import npz
from controller.machine.model import Machine
from controller.state import record_files
from controller.state.modes import MAX_AXES

Counts = npt.NDArray[np.int32]
Values = npt.NDArray[np.float64]


class Table(NamedTuple):
    """Rows of int32 in a file; those of axes that the machine has not are 0."""

    columns: tuple[str, ...]  # of the recorder
    whole: str  # file, once the run has ended
    part: str  # file, while it goes on or where it was lost

    @property
    def row_bytes(self) -> int:
        return 4 * len(self.columns)

    def of_part(self, data: bytes) -> Counts:
        """(N, columns) of what was written while the run went on; the last row may be torn."""
        whole = data[: len(data) // self.row_bytes * self.row_bytes]
        return np.frombuffer(whole, dtype="<i4").reshape(-1, len(self.columns))

    def read(self, folder: Path) -> Counts | None:
        """Of a record, (N, MAX_AXES) counts, as far as written; None where there are none.

        Raises OSError, and ValueError where the file is none.
        """
        if (folder / self.whole).exists():
            rows = npz.read(folder / self.whole, ["rows"])["rows"]
            return np.asarray(rows[:, 1:], dtype=np.int32)
        if not (folder / self.part).exists():
            return None
        return self.of_part((folder / self.part).read_bytes())[:, 1:]


def _table(file: str, column: str) -> Table:
    columns = ("tick", *(f"{column}_{i}" for i in range(MAX_AXES)))
    return Table(columns, file, str(Path(file).with_suffix(".part")))


SETPOINTS, ACTUAL = _table(record_files.SETPOINTS, "setpoint"), _table(record_files.ACTUAL, "actual")
TABLES = (SETPOINTS, ACTUAL)


def counts_per_unit(machine: Machine) -> Values:
    """(MAX_AXES,) counts of mm and rad; 1 where the machine has no axis."""
    found = np.ones(MAX_AXES)
    found[: len(machine.axes)] = [axis.counts_per_unit for axis in machine.axes]
    return found
