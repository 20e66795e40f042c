"""The setpoints of a repetition held against those of a record, segment by segment, as they come.

A repetition is made of machine, program and events, and of no setpoint: where a segment is spoilt, its ticks
come again without being compared, and those after it are compared as all others. Where a line of the events
is lost, the first other setpoint after it says nothing but that the run cannot be made again from there on.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from controller.ipc.handoff import COLUMN, of_axes
from controller.runtime import events
from controller.runtime.events import Recorded
from controller.state.modes import MAX_AXES
from controller.state.setpoints import SETPOINTS, Counts, Piece, Spoilt

MAX_TICKS = 1 << 40

Rows = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Difference:
    """The first setpoint that came out otherwise, in counts."""

    tick: int  # that sent a SYNC, from the start
    axis: int
    recorded: int
    again: int
    line: int  # of the program


def off_path(record: Recorded) -> int:
    """The tick from which on nothing can be made again: the setpoints are where the drives were."""
    return next((line.tick for line in record.lines if line.kind == events.OFF_PATH), MAX_TICKS)


class Comparison:
    """``take`` the rows of a repetition in their order, then ``finish``."""

    def __init__(self, folder: Path, record: Recorded) -> None:
        """``folder``: of the record."""
        self.ticks = SETPOINTS.ticks(folder)  # that were recorded
        self.made = 0  # that came again
        self.compared = 0
        self.difference: Difference | None = None  # the first
        self.spoilt: list[Spoilt] = []
        self.lost_from: int | None = None  # the tick from which on a lost line makes another run of it
        self._loose = min((line.tick for line in record.lost), default=MAX_TICKS)
        self._end = min(self.ticks, off_path(record))
        self._pieces = self._read(SETPOINTS.pieces(folder))
        self._piece = next(self._pieces, None)

    def _read(self, pieces: Iterator[Piece]) -> Iterator[Piece]:
        """Each piece, once it is known where a gap before it ends."""
        before: Piece | None = None
        for piece in pieces:
            self._see_spoilt(before, piece.first)
            before = piece
            yield piece
        self._see_spoilt(before, self.ticks)

    def _see_spoilt(self, piece: Piece | None, end: int) -> None:
        if piece is not None and piece.spoilt is not None:
            self.spoilt.append(Spoilt(piece.file.name, piece.end, end, piece.spoilt))

    def take(self, rows: Rows) -> None:
        """The next rows of the recorder."""
        sent = rows[rows[:, COLUMN["sync_sent"]] != 0.0]
        first, self.made = self.made, self.made + len(sent)
        found = sent[:, of_axes("setpoint", MAX_AXES)].astype(np.int64)
        while self._piece is not None:
            piece = self._piece
            begin, end = max(first, piece.first), min(self.made, piece.end, self._end)
            if begin < end and self.difference is None:
                wanted = piece.rows[begin - piece.first : end - piece.first]
                self._compare(begin, wanted, found[begin - first : end - first], sent[begin - first :])
            if self.made < piece.end:
                break
            self._piece = next(self._pieces, None)

    def _compare(self, begin: int, wanted: Counts, found: npt.NDArray[np.int64], rows: Rows) -> None:
        ticks, axes = np.nonzero(wanted != found)
        if len(ticks) and begin + int(ticks[0]) >= self._loose:
            self._end = self.lost_from = begin + int(ticks[0])
            self.compared += int(ticks[0])
            return
        self.compared += len(wanted)
        if len(ticks):
            i, axis = int(ticks[0]), int(axes[0])
            line = int(rows[i, COLUMN["line"]])
            self.difference = Difference(begin + i, axis, int(wanted[i, axis]), int(found[i, axis]), line)

    def finish(self) -> None:
        """No more rows come; what is spoilt of the rest is seen, too."""
        for _ in self._pieces:
            pass
