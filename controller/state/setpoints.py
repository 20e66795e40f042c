"""What the record of a run keeps of every tick that sent a SYNC: setpoints, positions, feed, load, in counts.

Each table lies in segments of bounded size, named after their first tick, so that no length ends a record
and what is damaged costs one segment:

    setpoints.npz               ticks from 0 on, packed
    setpoints.0000699050.npz    from tick 699050 on
    setpoints.0001398100.part   those that the run under way has written since, or a lost one had

A packed segment holds each column as its differences, of so many times as its table says (in 32 bits, which
wrap, so that their sums are the counts to the last bit): a tick takes a few bytes. Zip has a sum of each. A
segment that grows is a row of frames, each with the sums of its head and of its rows. A record of an older
version has one segment: plain rows, each with its tick before it, under ``rows`` or without frames.
"""

from __future__ import annotations

import contextlib
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
import numpy.typing as npt

from controller import npz, sealed_file
from controller.machine.kinematics.slides import Slides
from controller.machine.model import Machine
from controller.messages import Message, message, of_error
from controller.state import record_files
from controller.state.modes import MAX_AXES

SEGMENT_BYTES = 16 << 20  # of rows, before they are packed
WHOLE, PART = ".npz", ".part"
_MARK, _OLD = b"DXR2", bytes(4)  # an older version's rows begin with tick 0
_HEAD, _SUM = struct.Struct("<4sIQI"), struct.Struct("<I")  # mark, how many rows, first tick, their sum
_FRAME = struct.Struct("<4sIQII")  # a head, and its own sum

Counts = npt.NDArray[np.int32]
Values = npt.NDArray[np.float64]


class Segment(NamedTuple):
    """A file of a table, which begins with that tick."""

    first: int
    file: Path


class Piece(NamedTuple):
    """The sound rows of a segment, (N, columns), from tick ``first`` on.

    ``spoilt``: why those behind it, up to the next piece, are not there.
    """

    first: int
    rows: Counts
    file: Path
    spoilt: Message | None = None

    @property
    def end(self) -> int:
        """The tick behind the last one."""
        return self.first + len(self.rows)


class Spoilt(NamedTuple):
    """Ticks of a record that cannot be read, from ``first`` up to ``end``."""

    file: str
    first: int
    end: int
    why: Message


class SpoiltSegment(sealed_file.Damaged):
    """Which segment of a record cannot be read, and why."""

    def __init__(self, piece: Piece) -> None:
        super().__init__(message("segment.spoilt", file=piece.file.name, tick=piece.end, why=piece.spoilt))


class Table(NamedTuple):
    """Rows of int32; those of axes that the machine has not are 0."""

    columns: tuple[str, ...]  # of the recorder
    stem: str  # of its files
    differences: int  # how often a column is differenced before it is packed

    @property
    def whole(self) -> str:
        """The file of its first segment, once that is packed."""
        return self.name(0)

    @property
    def part(self) -> str:
        """The file of its first segment, while that grows."""
        return self.name(0, PART)

    @property
    def row_bytes(self) -> int:
        return 4 * len(self.columns)

    def name(self, first: int, suffix: str = WHOLE) -> str:
        """Of the file of the segment that begins with a tick."""
        return f"{self.stem}.{first:010d}{suffix}" if first else f"{self.stem}{suffix}"

    # -- written

    def frame(self, first: int, rows: Counts, record: str) -> bytes:
        """Rows (N, columns) as they are added to the segment of a ``record`` that grows."""
        data = rows.astype("<i4").tobytes()
        head = _HEAD.pack(_MARK, len(rows), first, zlib.crc32(data, _seed(record)))
        return head + _SUM.pack(zlib.crc32(head)) + data

    def pack(self, file: BinaryIO, first: int, rows: Counts, record: str) -> None:
        """A whole segment. Raises OSError."""
        packed = rows
        for _ in range(self.differences):
            packed = np.diff(packed, axis=0, prepend=np.zeros_like(packed, shape=(1, packed.shape[1])))
        place: dict[str, Any] = {"columns": np.array(self.columns), "first": first, "record": record}
        packed = np.asfortranarray(packed)  # column by column, which takes less room
        np.savez_compressed(file, **place, differences=self.differences, packed=packed)

    # -- read

    def segments(self, folder: Path) -> list[Segment]:
        """Of a record, in the order of their ticks; where both are there the packed file."""
        found = dict[int, Path]()
        for suffix in (PART, WHOLE):
            for file in folder.glob(f"{self.stem}*{suffix}"):
                number = file.name.removeprefix(self.stem).removesuffix(suffix).removeprefix(".")
                first = int(number) if number.isdecimal() else 0
                if file.name == self.name(first, suffix):
                    found[first] = file
        return [Segment(first, found[first]) for first in sorted(found)]

    def pieces(self, folder: Path) -> Iterator[Piece]:
        """The segments of a record, one after the other; one that is missing is a piece without rows."""
        facts, tick, spoilt = record_files.known(folder), 0, False
        for segment in self.segments(folder):
            if segment.first > tick and not spoilt:
                yield self._nothing(Segment(tick, folder / self.name(tick)), message("segment.missing"))
            piece = self.piece(segment, self._record_of(facts, folder))
            if segment.first < tick:
                piece = self._nothing(
                    Segment(tick, segment.file), message("segment.overlaps", tick=segment.first)
                )
            yield piece
            tick, spoilt = piece.end, piece.spoilt is not None
        if tick and not spoilt and tick < int(facts.get("ticks", 0)):
            yield self._nothing(Segment(tick, folder / self.name(tick)), message("segment.missing"))

    def _record_of(self, facts: dict[str, Any], folder: Path) -> str:
        """Whose segments are in a folder; where files of a run were copied alone, the first one says so."""
        whole = [] if facts else [one.file for one in self.segments(folder) if one.file.suffix == WHOLE]
        with contextlib.suppress(OSError, ValueError, KeyError, IndexError):
            return str(npz.read(whole[0])["record"])
        return str(facts.get("id", folder.name))

    def piece(self, segment: Segment, record: str) -> Piece:
        """What is sound of a segment; ``record``: that it is to be of."""
        try:
            if segment.file.suffix == WHOLE:
                return Piece(segment.first, self._unpacked(segment, record), segment.file)
            rows, spoilt = self.of_part(segment.file.read_bytes(), segment.first, record)
        except (OSError, ValueError, KeyError) as error:
            return self._nothing(segment, of_error(error))
        return Piece(segment.first, rows, segment.file, spoilt)

    def _nothing(self, segment: Segment, why: Message) -> Piece:
        return Piece(segment.first, self._rows(b""), segment.file, why)

    def _unpacked(self, segment: Segment, record: str) -> Counts:
        """Raises OSError, and ValueError or KeyError for what is no such segment."""
        found = npz.read(segment.file)
        if "rows" in found:  # of an older version
            return np.asarray(found["rows"][:, 1:], dtype=np.int32)
        place = tuple(found["columns"]), int(found["first"]), str(found["record"])
        if place != (self.columns, segment.first, record):
            raise sealed_file.Damaged(message("segment.elsewhere"))
        rows = found["packed"]
        for _ in range(int(found["differences"])):
            rows = np.cumsum(rows, axis=0, dtype=np.int32)
        return np.ascontiguousarray(rows)

    def of_part(self, data: bytes, first: int, record: str) -> tuple[Counts, Message | None]:
        """(N, columns) of what was written while a run went on, and why there is no more of it.

        The last frame may be torn: its service was killed then.
        """
        if not first and data.startswith(_OLD):
            return self._of_old_part(data)
        found, at, tick = [self._rows(b"")], 0, first
        while len(data) - at >= _FRAME.size:
            mark, count, begins, of_rows, of_head = _FRAME.unpack_from(data, at)
            head, at = data[at : at + _HEAD.size], at + _FRAME.size
            rows = data[at : at + count * self.row_bytes]
            is_sound = mark == _MARK and of_head == zlib.crc32(head) and begins == tick
            if is_sound and len(rows) < count * self.row_bytes:
                break
            if not is_sound or of_rows != zlib.crc32(rows, _seed(record)):
                return np.concatenate(found), message("segment.damaged")
            found.append(self._rows(rows))
            at, tick = at + len(rows), tick + count
        return np.concatenate(found), None

    def _of_old_part(self, data: bytes) -> tuple[Counts, Message | None]:
        """Rows with their ticks before them."""
        each = 4 + self.row_bytes
        rows = np.frombuffer(data[: len(data) // each * each], dtype="<i4").reshape(-1, each // 4)
        wrong = np.flatnonzero(rows[:, 0] != np.arange(len(rows)))
        if len(wrong):
            return rows[: wrong[0], 1:], message("segment.damaged")
        return rows[:, 1:], None

    def _rows(self, data: bytes) -> Counts:
        return np.frombuffer(data, dtype="<i4").reshape(-1, len(self.columns))

    def read_around(self, folder: Path, ticks: int = 0) -> tuple[Counts | None, tuple[Spoilt, ...]]:
        """Of a record, (N, columns) counts with ``MISSING`` where a segment is spoilt, and which are; of so
        many ``ticks`` at least. None where there are none.
        """
        pieces = list(self.pieces(folder))
        if not pieces:
            return None, ()
        count = max(ticks, self.ticks(folder), pieces[-1].end)
        rows = np.full((count, len(self.columns)), MISSING, dtype=np.int32)
        spoilt = []
        for piece, end in zip(pieces, (*[one.first for one in pieces[1:]], count), strict=True):
            rows[piece.first : piece.end] = piece.rows
            if piece.spoilt is not None:
                spoilt.append(Spoilt(piece.file.name, piece.end, end, piece.spoilt))
        return rows, tuple(spoilt)

    def read(self, folder: Path, most: int = 1 << 40) -> Counts | None:
        """Of a record, (N, columns) counts, as far as written, ``most`` so many; None where there are none.

        Raises SpoiltSegment.
        """
        found = []
        for piece in self.pieces(folder):
            if piece.spoilt is not None:
                raise SpoiltSegment(piece)
            found.append(piece.rows)
            if piece.end >= most:
                break
        return np.concatenate(found)[:most] if found else None

    def ticks(self, folder: Path) -> int:
        """How many a record has: by its end, or else by the last of its segments."""
        facts, segments = record_files.known(folder), self.segments(folder)
        if not segments:
            return 0
        last = self.piece(segments[-1], self._record_of(facts, folder))
        return max(last.end, int(facts.get("ticks", 0)))


def in_counts(values: Values) -> Counts:
    """Values that are multiplied by their counts, as whole ones; ``MISSING`` where there is none (NaN)."""
    most = np.iinfo(np.int32).max
    found = np.clip(np.round(values), -most, most)
    return np.where(np.isnan(found), MISSING, found).astype(np.int32)


def _seed(record: str) -> int:
    """Of the sums of a record's rows: those of another one do not fit."""
    return zlib.crc32(record.encode())


def _table(file: str, column: str, differences: int) -> Table:
    columns = tuple([f"{column}_{i}" for i in range(MAX_AXES)])
    return Table(columns, file.removesuffix(WHOLE), differences)


# A setpoint is smooth to its second difference; a position that a drive tells has its noise.
SETPOINTS, ACTUAL = _table(record_files.SETPOINTS, "setpoint", 2), _table(record_files.ACTUAL, "actual", 1)
PROCESS = Table(("feed_mm_s", "spindle_load"), record_files.PROCESS.removesuffix(WHOLE), 1)
PROCESS_PER_UNIT = np.array([1e3, 1e4])  # counts: um/s, and 0.01 % of the rated torque
TABLES = (SETPOINTS, ACTUAL, PROCESS)
MISSING = -(1 << 31)  # instead of counts


def process_values(counts: Counts) -> Values:
    """(N, 2) feed (mm/s) and load of the spindle (share), NaN where that is not told."""
    return np.where(counts == MISSING, np.nan, counts / PROCESS_PER_UNIT)


def commanded(counts: Values, machine: Machine) -> Values:
    """(N, axes) mm and rad that setpoints of counts are meant for; what tables add to them is left in."""
    sent = [column / axis.counts_per_unit for column, axis in zip(counts.T, machine.axes, strict=True)]
    return np.stack(Slides(machine.axes).real(sent), axis=1)


def counts_per_unit(machine: Machine) -> Values:
    """(MAX_AXES,) counts of mm and rad; 1 where the machine has no axis."""
    found = np.ones(MAX_AXES)
    found[: len(machine.axes)] = [axis.counts_per_unit for axis in machine.axes]
    return found
