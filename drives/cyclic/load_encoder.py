"""A second encoder at the load, against the motor's: what lies between them may slip, stretch or break.

Their zeros differ, so what is compared is how far both have gone since the drive found its zero. What is
told with a SYNC is of the same moment as the motor's position.
"""

from __future__ import annotations

from typing import Final

from drives.cyclic.drive_fault import DriveFault
from drives.settings import NodeSettings

IN_A_ROW: Final = 3  # beyond what is allowed, or not come


class LoadEncoder:
    """That of one drive. Read: ``off`` (counts of the drive, load less motor), ``fault``."""

    def __init__(self, settings: NodeSettings) -> None:
        self._position = 0
        self._is_new = False
        self.off = 0.0
        self.fault = DriveFault.NONE
        self._per_count, self._most = settings.load_per_count, settings.most_load_off_counts
        self._patience = IN_A_ROW * settings.load_every
        self._zero: float | None = None
        self._beyond = self._silent = 0

    def begin_anew(self) -> None:
        """The next comparison is the new beginning."""
        self._zero, self.off, self.fault = None, 0.0, DriveFault.NONE
        self._is_new, self._beyond, self._silent = False, 0, 0

    def receive(self, position: int) -> None:
        """Its position as told with a SYNC, in counts of its own."""
        self._position, self._is_new = position, True

    def compare(self, motor: int) -> None:
        """After the answers to a SYNC; ``motor``: its position, counts."""
        if not self._is_new:
            self._silent += 1
            if self._silent > self._patience:
                self.fault = DriveFault.FEEDBACK_LOST
            return
        self._is_new, self._silent = False, 0
        apart = self._position / self._per_count - motor
        if self._zero is None:
            self._zero = apart
        self.off = apart - self._zero
        self._beyond = self._beyond + 1 if abs(self.off) > self._most else 0
        self.fault = DriveFault.LOAD_OFF if self._beyond >= IN_A_ROW else DriveFault.NONE
