"""The one door between the slow side and the tick.

Four things pass through it, and nothing else:

* pieces, plan -> tick: a SEQPACKET socket; a message is taken whole or not at all;
* requests, operator -> tick: datagrams of one fixed size, and of another for a jog;
* the snapshot, tick -> all: shared memory, two buffers and a counter;
* the flight recorder, tick -> slow side: a ring of rows in shared memory.

Plan time is the path clock: seconds of planned motion since the queue began. It
advances by one period at every SYNC sent, or stands. A message of pieces says from
which plan time on it replaces the queue:

```
   plan time   |-- past --|now|-- at least 20 ms --|commit|-- may be replaced --|queue end, at rest
                                                    ^ replace_from_s >= commit
```
Every message ends in a standstill, so whatever is lost afterwards, the queue does too.
To stop earlier, the tick leaves the plan by a stop that the message brought along
(``StopTable``); once at rest it empties the queue, counts ``epoch`` up, and the plan begins
anew from the motion and s at which it stands.
"""

from __future__ import annotations

import mmap
import os
import struct
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from controller.ipc.piece_socket import PieceInbox, PieceOutbox, piece_pair
from controller.motion.pieces import (
    DEAD_MAN_S,
    STANDSTILL,
    STILL,
    Awaited,
    Jog,
    Law,
    Piece,
    PieceMessage,
    Quintic,
    StopTable,
    dwell,
)
from controller.state.live_state import (
    ANALOGUE,
    BRAKED,
    COLUMN,
    EXPIRED,
    LAYOUT,
    OFF_PATH,
    PLAYED,
    ROW,
    SETTLED,
    STOOD,
    TAKEN_BACK,
    TAKEN_BACK_BRAKED,
    WAITED,
    Flat,
    Snapshot,
    blank,
    flat,
    of_axes,
    snapshot_of,
)
from controller.state.modes import MAX_AXES
from controller.state.requests import (
    PLAN_IDS,
    Answers,
    Arrangement,
    Outcome,
    RequestInbox,
    plan_ids,
    request_pair,
    send_arrangement,
    send_jog,
    send_request,
)

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = [
    "ANALOGUE",
    "BRAKED",
    "COLUMN",
    "DEAD_MAN_S",
    "EXPIRED",
    "OFF_PATH",
    "PLANNER_SILENCE_S",
    "PLAN_IDS",
    "PLAYED",
    "ROW",
    "SETTLED",
    "STANDSTILL",
    "STILL",
    "STOOD",
    "TAKEN_BACK",
    "TAKEN_BACK_BRAKED",
    "WAITED",
    "Answers",
    "Arrangement",
    "Awaited",
    "Board",
    "Jog",
    "Law",
    "Outcome",
    "OwnBoard",
    "Piece",
    "PieceInbox",
    "PieceMessage",
    "PieceOutbox",
    "Quintic",
    "Recorder",
    "RequestInbox",
    "SharedBlock",
    "Snapshot",
    "SnapshotBoard",
    "StopTable",
    "blank",
    "dwell",
    "flat",
    "of_axes",
    "piece_pair",
    "plan_ids",
    "request_pair",
    "rows_of",
    "send_arrangement",
    "send_jog",
    "send_request",
]

PLANNER_SILENCE_S = 2.0  # a plan that hangs; the queue ends at rest by itself, so a pause is no danger


# ---- shared memory
class SharedBlock:
    """Bytes that processes share, behind a counter: anonymous (inherited by fork) or a file in memory.

    The counter is one machine word, read and written at once. With ``struct`` a reader now and then finds
    0 in it, for that clears the bytes before it writes them.
    """

    def __init__(self, size: int, path: str | None = None, create: bool = True) -> None:
        self.path = path
        self.memory = _mapped(_COUNTER_BYTES + size, path, create)
        self.counter = memoryview(self.memory)[:_COUNTER_BYTES].cast("Q")


def _mapped(size: int, path: str | None, create: bool) -> mmap.mmap:
    if path is None:
        return mmap.mmap(-1, size)
    descriptor = os.open(path, os.O_RDWR | (os.O_CREAT if create else 0), 0o660)
    try:
        if create:
            os.ftruncate(descriptor, size)
        return mmap.mmap(descriptor, size)
    finally:
        os.close(descriptor)


_COUNTER_BYTES = 8


class Board:
    """One writer, any number of readers; a reader never sees half of what was written.

    The writer fills the buffer that is not shown and then moves the counter; a reader
    whose counter has moved on meanwhile reads again. ``count``: of what was written, as it was read last.
    """

    def __init__(self, layout: struct.Struct, path: str | None = None, create: bool = True) -> None:
        self._layout, self._slot = layout, (layout.size + 7) // 8 * 8
        self.block = SharedBlock(2 * self._slot, path, create)
        self._memory, self._counter = self.block.memory, self.block.counter
        self._count = int(self._counter[0])
        self.count = 0

    def write(self, values: Sequence[Any]) -> None:
        """Publish the values of the layout."""
        self.fill(values)
        self._count += 1
        self._counter[0] = self._count

    def fill(self, values: Sequence[Any]) -> None:
        """The buffer that is not shown, and not yet to be."""
        self._layout.pack_into(self._memory, _COUNTER_BYTES + (~self._count & 1) * self._slot, *values)

    def newest(self) -> tuple[Any, ...] | None:
        """The values written last; None before the first."""
        while True:
            self.count = count = self._counter[0]
            if count == 0:
                return None
            values = self._layout.unpack_from(self._memory, _COUNTER_BYTES + (count & 1) * self._slot)
            if self._counter[0] == count:
                return values


class SnapshotBoard(Board):
    """That of the live state: the tick writes."""

    def __init__(self, path: str | None = None, create: bool = True, axes: int = MAX_AXES) -> None:
        """``axes``: how many the machine has, for those who read."""
        super().__init__(LAYOUT, path, create)
        self._snapshot_of = snapshot_of(axes)

    def read(self) -> Snapshot | None:
        """The newest snapshot; None before the first."""
        values = self.newest()
        return None if values is None else self._snapshot_of(values)


class OwnBoard(SnapshotBoard):
    """That of a process that reads its own snapshots (stepped clock): the values stay as they are."""

    def __init__(self, axes: int = MAX_AXES) -> None:
        super().__init__(axes=axes)
        self._newest: Flat | None = None

    def write(self, values: Sequence[Any]) -> None:
        self._newest = tuple(values)

    def read(self) -> Snapshot | None:
        return None if self._newest is None else self._snapshot_of(self._newest)


# ---- flight recorder: one row of float64 per tick
_ROW = struct.Struct(f"<{len(ROW)}d")
RECORDER_ROWS = 1 << 15  # 65 s at 2 ms; of three quarters of it 12 s are left at 0.5 ms


def rows_of(columns: Sequence[str], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rows (N, len(ROW)) of what was kept under these columns, in whatever order; NaN where there is none.

    So what an older version kept can be read, and what a newer one did.
    """
    import numpy as np

    rows = np.full((len(values), len(ROW)), np.nan)
    for i, name in enumerate(columns):
        if name in COLUMN:
            rows[:, COLUMN[name]] = values[:, i]
    return rows


class Recorder:
    """Ring of rows in shared memory: the tick writes, the slow side drains."""

    def __init__(self, path: str | None = None, create: bool = True, rows: int = RECORDER_ROWS) -> None:
        self.rows = rows
        self.block = SharedBlock(rows * _ROW.size, path, create)
        self._memory, self._counter = self.block.memory, self.block.counter
        self._written = 0
        self._read = 0
        self.lost = 0  # rows overwritten before this reader saw them

    def write(self, row: Sequence[float]) -> None:
        """Append one row: the values in the order of ``ROW``, with which a tick's values begin."""
        self.fill(row)
        self._written += 1
        self._counter[0] = self._written

    def fill(self, row: Sequence[float]) -> None:
        """The next row, without appending it yet."""
        _ROW.pack_into(self._memory, _COUNTER_BYTES + self._written % self.rows * _ROW.size, *row)

    def drain(self) -> NDArray[np.float64]:
        """Rows written since the last call, shape (N, len(ROW)); counts in ``lost`` what was too old.

        The oldest quarter of a full ring may be overwritten while it is copied and is given up.
        """
        written = self._counter[0]
        first = max(self._read, written - self.rows * 3 // 4)
        self.lost += first - self._read
        self._read = written
        return self._copy(first, written)

    def last(self, rows: int) -> NDArray[np.float64]:
        """The newest rows, at most so many, drained already or not; shape (N, len(ROW))."""
        written = self._counter[0]
        return self._copy(max(0, written - min(rows, self.rows * 3 // 4)), written)

    def _copy(self, first: int, written: int) -> NDArray[np.float64]:
        import numpy as np

        ring = np.frombuffer(self._memory, dtype="<f8", offset=_COUNTER_BYTES).reshape(self.rows, len(ROW))
        return np.asarray(ring[np.arange(first, written) % self.rows], dtype=np.float64)
