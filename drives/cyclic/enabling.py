"""The order in which drives are enabled and disabled: group by group up, in reverse down.

A group has its turn when the one before it is done: enabled when it follows (or, in homing,
is in operation), disabled when its current is off. A gravity axis' drive keeps the current
until its brake holds, which its statusword says by leaving operation; so whoever must wait
for the brake gets a lower number than the axis that has it. Quick stop and reset go to all
at once.
"""

from __future__ import annotations

from collections.abc import Sequence

from drives.cia402 import State, Wanted
from drives.cyclic.drive import Drive
from drives.cyclic.power_stage import POWERED

MAX_WAIT_S = 3.0  # for a group that does not switch off: the others are not kept on for ever


class Enabling:
    """Read: ``waits`` (a group has not had its turn yet)."""

    def __init__(self, drives: Sequence[Drive]) -> None:
        self._drives = tuple(drives)
        numbers = sorted({drive.settings.enable_group for drive in drives})
        self._groups = tuple(tuple(d for d in drives if d.settings.enable_group == n) for n in numbers)
        self._queue = self._groups
        self._turn = 0  # in the queue, of the group that is under way
        self._wanted = Wanted.OFF
        self._since_s: float | None = None
        self.waits = False

    def want(self, wanted: Wanted) -> None:
        """The goal of all drives; the first group is told now, the others in ``progress``."""
        self._wanted = wanted
        self._turn, self._since_s, self.waits = 0, None, False
        if wanted is Wanted.QUICK_STOP or wanted is Wanted.RESET or len(self._groups) < 2:
            for drive in self._drives:
                drive.want(wanted)
            return
        self._queue = self._groups if wanted is Wanted.ENABLED else self._groups[::-1]
        for drive in self._queue[0]:
            drive.want(wanted)
        self.waits = True

    def progress(self, now_s: float) -> None:
        """The next group's turn, when the one under way is done."""
        if self._since_s is None:
            self._since_s = now_s
        late = self._wanted is Wanted.OFF and now_s - self._since_s > MAX_WAIT_S
        if not (late or all(self._done(drive) for drive in self._queue[self._turn])):
            return
        self._turn += 1
        self._since_s = now_s
        for drive in self._queue[self._turn]:
            drive.want(self._wanted)
        self.waits = self._turn + 1 < len(self._queue)

    def _done(self, drive: Drive) -> bool:
        if self._wanted is Wanted.OFF:
            return drive.state not in POWERED
        return drive.following or (not drive.cyclic and drive.state is State.OPERATION_ENABLED)
