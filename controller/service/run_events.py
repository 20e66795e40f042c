"""The events of a run as they are found: each gets the number of the SYNC before which it came.

What the planner tells comes later than the rows of the ticks that it is about, so ticks are remembered
for a while; what a row tells is written with it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from controller.ipc.handoff import COLUMN

REMEMBERED_TICKS = 1 << 16  # longer than any turn of the planner takes

Rows = npt.NDArray[np.float64]


@dataclass(slots=True)
class _Ticks:
    """Some rows: their ticks, which of them sent a SYNC, and how many had before."""

    ticks: npt.NDArray[np.int64]
    sent: npt.NDArray[np.bool_]
    before: int


class RunEvents:
    """``add`` what happened at a tick, ``pass_rows`` as they come, and ``timed`` gives the lines."""

    def __init__(self) -> None:
        self._waiting: list[tuple[int, dict[str, Any]]] = []
        self._known: deque[_Ticks] = deque()
        self._remembered = 0
        self.sent = 0  # SYNCs since the start
        self.first_tick = -1  # of the run
        self._newest = -1

    def add(self, at: int, line: dict[str, Any]) -> None:
        """``at``: the tick of the machine in which it came, or before which."""
        self._waiting.append((at, line))

    def pass_rows(self, rows: Rows) -> None:
        """Of the run, from its first tick on."""
        ticks, sent = rows[:, COLUMN["tick"]].astype(np.int64), rows[:, COLUMN["sync_sent"]] != 0.0
        self._known.append(_Ticks(ticks, sent, self.sent))
        self.sent += int(np.count_nonzero(sent))
        self._remembered += len(ticks)
        self._newest = int(ticks[-1])
        while self._remembered - len(self._known[0].ticks) > REMEMBERED_TICKS:
            self._remembered -= len(self._known.popleft().ticks)

    def timed(self, is_last: bool = False) -> Iterator[dict[str, Any]]:
        """Lines of all whose tick is known by now; ``is_last``: no other tick comes."""
        due = [one for one in self._waiting if is_last or one[0] <= self._newest]
        if self.first_tick < 0 or not due:
            return
        self._waiting = [one for one in self._waiting if not is_last and one[0] > self._newest]
        for at, line in due:
            yield {**self._when(at), **line}

    def _when(self, at: int) -> dict[str, Any]:
        if at < self.first_tick:
            return {"tick": -1, "at": at}
        known = next((one for one in self._known if one.ticks[-1] >= at), None)
        if known is None:
            return {"tick": self.sent, "at": at}
        i = int(np.searchsorted(known.ticks, at))
        n = known.before + int(np.count_nonzero(known.sent[:i]))
        return {"tick": n, "at": int(known.ticks[i]), **({} if known.sent[i] else {"late": True})}
