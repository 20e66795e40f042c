"""The setpoints of a run as its record keeps them: a row of int32 for each tick that sent a SYNC."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from controller.state.modes import MAX_AXES

SETPOINTS = ("tick", *(f"setpoint_{i}" for i in range(MAX_AXES)))  # columns
WHOLE, PART = "setpoints.npz", "setpoints.part"  # files, once the run has ended and while it goes on
ROW_BYTES = 4 * len(SETPOINTS)

Counts = npt.NDArray[np.int32]


def read(folder: Path) -> Counts | None:
    """The setpoints of a record, (N, MAX_AXES) counts, as far as written; None where there are none.

    Those of axes that the machine has not are 0.

    Raises OSError, and ValueError where the file is none.
    """
    if (folder / WHOLE).exists():
        with np.load(folder / WHOLE) as file:
            return np.asarray(file["rows"][:, 1:], dtype=np.int32)
    if not (folder / PART).exists():
        return None
    data = (folder / PART).read_bytes()
    data = data[: len(data) // ROW_BYTES * ROW_BYTES]  # the last row may be torn
    return np.frombuffer(data, dtype="<i4").reshape(-1, len(SETPOINTS))[:, 1:]
