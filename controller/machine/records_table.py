"""``[records]``: how much of the disk the records of runs and faults may take."""

from __future__ import annotations

from dataclasses import dataclass

from controller.machine.declaration import key
from controller.machine.forms import Number


@dataclass(frozen=True, slots=True)
class Records:
    """``[records]``."""

    most_gb: float = key(
        Number(0.01, 100_000.0),
        "10^9 bytes that runs and faults leave on the disk at most; beyond them the oldest go, but for those "
        "that an operator keeps (`directrix runs --keep`)",
        default=16.0,
    )
    share: float = key(Number(0.01, 0.95), "of the disk, and no more than that", default=0.5)
