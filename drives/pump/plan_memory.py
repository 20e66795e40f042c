"""Plans of setpoints, from the tick to the pump, and what was played, back: shared memory, no lock, no call.

A plan says what each period of the near future sends. Periods are counted from the pump's start; period m is
played at t0 + m T. Of the rows of a plan the first ones are played as they are, the rest is the path along
which the axes come to rest if no newer plan comes:

```
   first                      first + nominal - 1                        + rows
     |--- played as they are ---|--- a stop by ``jerks``, along these rows ---|--- held --|  silence
```
It is published whole at every tick into one of two areas in turn, sealed by a CRC-32, so a reader sees a
whole plan or none: a half-written head has no number. ``changes`` is the first period whose contents differ
from the plan that it was built on; a plan that would change what has been handed over already is refused.

A row's place in its area goes by its period, so that only what is new is written.

On a machine whose axes can be tied to the spindle a row has ``THREAD`` columns more: how fast the spindle is
led (rev/s), its revolutions in one mm of s (0: nobody leads it), and how far (mm of s) the axes are sent
ahead, since their drives lag. A row behind those that are led in full (``lead.Lead``) has what the law asks
for instead: the spindle's speed and, in three columns more, its acceleration (rev/s2), and speed and
acceleration of s. A stop has the spindle's answer, so that along it both stay together. Beside a thread a
plan has the spindle's ramp (``speed_ramp``), which goes on also where the rows end.

What acts at once goes past the plan, each in one machine word that is read with every period: the
controlwords, where a drive is that does not follow, and which buses must be left alone.
"""

from __future__ import annotations

import mmap
import os
from array import array
from collections.abc import Sequence
from enum import IntEnum
from struct import Struct
from typing import Final, NamedTuple
from zlib import crc32

from drives.pump.lead import Correction, Lead, LedRows
from drives.pump.speed_ramp import NO_RAMP, SpeedRamp

ROWS: Final = 2048  # places of an area: more than a plan's rows
MAX_JERKS: Final = 2048
FOLLOWS: Final = 1 << 16  # beside a controlword: the drive goes by its target
THREAD: Final = 6  # columns of a row beside s and counts
_HEAD = "<QqqIIIIIIdddddqddd"  # number, first, changes, nominal, rows, hold, ``Stop``, ``SpeedRamp`` ...
_LEAD = "Id8d"  # ... and, where axes can be tied to the spindle, the ``Lead``, with counts of each drive
_SEAL = Struct("<I")
_DOUBLE: Final = 8
_SCALARS: Final = 16  # of the record, and ...
_MUTED: Final = 15  # ... beside it, of the tick ...
_AT_ONCE: Final = 14  # ... likewise
_ANEW: Final = 1 << 63  # of the number: a beginning
_LOOKS: Final = 1000  # at a record that is being written: some 50 us


class Phase(IntEnum):
    """What the pump sends in a period."""

    NOMINAL = 0  # the plan's row
    BRAKING = 1  # the plan is used up: its stop
    HOLDING = 2  # at rest at its end
    GAP = 3  # the pump itself was late by so much that the motors stand: the last row, until a new beginning
    SILENT = 4  # nothing


class Stop(NamedTuple):
    """A stop along the rows, from the last one that is played as it is."""

    jerks: Sequence[float]  # in units of s per s^3, each for ``held`` periods, the first for ``held - used``
    held: int
    used: int
    v: float  # of s, per s
    a: float
    axis_lag_s: float = 0.0  # on a thread: of the axes' drives ...
    spindle_slip: float = 0.0  # ... and how the spindle answers: less by this share of its speed ...
    spindle_lag_s: float = 0.0  # ... and by so much of its acceleration


NO_STOP: Final = Stop((), 1, 0, 0.0, 0.0)
_OF_STOP: Final = len(Stop._fields) - 1  # numbers in the head; the jerks are behind it
_LEAD_AT: Final = _OF_STOP + len(SpeedRamp._fields)  # ... and those of the ramp
_OF_CORRECTION: Final = len(Correction._fields)


class Played(NamedTuple):
    """The pump's newest word: ``period`` has been handed over."""

    period: int
    number: int  # of the plan that it goes by
    phase: Phase
    slips: int  # times that t0 was moved on, since the pump itself was late
    unsent: int  # bit n: the n-th bus took nothing in this period
    due_ns: int  # when the next period is due (CLOCK_MONOTONIC)
    refused: int  # plans that came too late
    late_ns: int  # of this period
    since: int  # the first period of this phase, in a row
    prepared: int = -1  # the newest period that has been chosen, by plan ``number``
    seen: int = 0  # the newest plan that was looked at for it, whether it was taken or came too late


_PLAYED = Struct(f"<{len(Played._fields)}q")
_PHASES: Final = tuple(Phase)
NOTHING_PLAYED = Played(-1, 0, Phase.SILENT, 0, 0, 0, 0, 0, -1)


class Memory:
    """The mapped bytes.

    ``words``: of each drive its controlword, with ``FOLLOWS``, and last that of the spindle; ``positions``:
    where it is (counts), which is the target of one that does not follow; ``velocity_units`` in one count per
    period, and last those of the spindle in one rev/s; ``muted``: bit n,
    nothing goes out on the n-th bus but the heartbeat; ``at_once``: periods that may be handed to the buses
    ahead of their time, where simulated drives stand; with 1 a period may be late by the wake-up, with 0 not.
    """

    def __init__(self, drives: int, descriptor: int = -1, thread: bool = False) -> None:
        """``descriptor`` of a file in memory (``create``); without one it is of this process alone.

        ``thread``: axes can be tied to the spindle.
        """
        self.drives, self.thread = drives, thread
        self.row = Struct(f"<{1 + drives + THREAD * thread}d")
        self.head = Struct(_HEAD + (f"{_LEAD}{drives}d" if thread else ""))
        self.jerks_at = (self.head.size + _SEAL.size + 7) // 8 * 8
        self.rows_at = self.jerks_at + MAX_JERKS * _DOUBLE
        self.area_bytes = self.rows_at + ROWS * self.row.size
        words_at = _SCALARS * _DOUBLE
        positions_at = words_at + (4 * (drives + 1) + 7) // 8 * 8
        units_at = positions_at + (4 * drives + 7) // 8 * 8
        self.areas_at = units_at + _DOUBLE * (drives + 1)
        size = self.areas_at + 2 * self.area_bytes
        flags = mmap.MAP_SHARED if descriptor >= 0 else mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS
        self.bytes = mmap.mmap(descriptor, size, flags)
        view = memoryview(self.bytes)
        self.record = view[: _SCALARS * _DOUBLE].cast("q")
        self.words = view[words_at : words_at + 4 * (drives + 1)].cast("I")
        self.positions = view[positions_at : positions_at + 4 * drives].cast("i")
        self.velocity_units = view[units_at : self.areas_at].cast("d")
        self.areas = tuple(
            view[at : at + self.area_bytes] for at in (self.areas_at, self.areas_at + self.area_bytes)
        )

    @property
    def muted(self) -> int:
        return int(self.record[_MUTED])

    @muted.setter
    def muted(self, buses: int) -> None:
        self.record[_MUTED] = buses

    @property
    def at_once(self) -> int:
        return int(self.record[_AT_ONCE])

    @at_once.setter
    def at_once(self, periods: int) -> None:
        self.record[_AT_ONCE] = periods

    @classmethod
    def create(cls, drives: int, thread: bool = False) -> tuple[Memory, int]:
        """A new one that another process can map, and the descriptor for it."""
        descriptor = os.memfd_create("directrix-plans")
        os.ftruncate(descriptor, len(cls(drives, thread=thread).bytes))
        return cls(drives, descriptor, thread), descriptor

    def seal(self, area: memoryview, head: bytes | memoryview, first: int, rows: int, jerks: int) -> int:
        """CRC-32 of a head, its jerks and its rows."""
        size, at = self.row.size, self.rows_at
        found = crc32(area[self.jerks_at : self.jerks_at + jerks * _DOUBLE], crc32(head))
        begin = first % ROWS
        before_the_end = min(rows, ROWS - begin)
        found = crc32(area[at + begin * size : at + (begin + before_the_end) * size], found)
        return crc32(area[at : at + (rows - before_the_end) * size], found)


class PlanWriter:
    """The tick's side."""

    def __init__(self, memory: Memory) -> None:
        self._memory = memory
        self.number = 0
        self._new_from = [0, 0]  # of each area: the first period whose row it does not have yet
        self._rows = memoryview(bytearray(ROWS * memory.row.size))
        self._next = 0  # period after the last row
        self._last = NOTHING_PLAYED

    def put(self, period: int, columns: Sequence[float]) -> None:
        """The row of a period, for the next plan; those after it are void."""
        row = self._memory.row
        row.pack_into(self._rows, period % ROWS * row.size, *columns)
        new = self._new_from
        for i in (0, 1):
            if period < new[i]:
                new[i] = period
        self._next = period + 1

    def end_at(self, period: int) -> None:
        """No row from ``period`` on counts."""
        self._next = period

    def publish(
        self,
        first: int,
        changes: int,
        nominal: int,
        hold: int,
        stop: Stop | None = None,
        anew: bool = False,
        lead: Lead | None = None,
        ramp: SpeedRamp = NO_RAMP,
    ) -> None:
        """All rows from ``first`` on, of which ``nominal`` are played as they are.

        ``anew``: after silence or a gap; the rows are then not measured by what was played before.
        ``lead`` of the rows that have the law of a thread alone; ``ramp`` of a spindle that no row leads.
        """
        memory = self._memory
        self.number += 1
        area, size = memory.areas[self.number & 1], memory.head.size
        area[:size] = bytes(size)
        self._copy(area, max(first, self._new_from[self.number & 1]))
        self._new_from[self.number & 1] = self._next
        of_jerks, *rest = NO_STOP if stop is None else stop
        jerks = len(of_jerks)
        if stop is not None:
            at = memory.jerks_at
            area[at : at + jerks * _DOUBLE] = memoryview(array("d", of_jerks)).cast("B")
        number, rows = self.number | _ANEW * anew, self._next - first
        found = (number, first, changes, nominal, rows, hold, jerks, *rest, *ramp)
        if memory.thread:
            known, bend, last, per_mm = lead or Lead(rows, 0.0, Correction(), (0.0,) * memory.drives)
            found = (*found, known, bend, *last, *per_mm)
        head = memory.head.pack(*found)
        area[size : size + 4] = _SEAL.pack(memory.seal(area, head, first, rows, jerks))
        area[:size] = head

    def _copy(self, area: memoryview, period: int) -> None:
        """The rows from ``period`` on, which may go over the end of the area."""
        size, at = self._memory.row.size, self._memory.rows_at
        while period < self._next:
            begin = period % ROWS
            many = min(self._next - period, ROWS - begin)
            area[at + begin * size : at + (begin + many) * size] = self._rows[
                begin * size : (begin + many) * size
            ]
            period += many

    def played(self) -> Played:
        """What the pump has said last.

        While it looks at a plan that is waited for; the word before it where that lasts.
        """
        record = self._memory.record
        for _ in range(_LOOKS):
            count = record[0]
            if count & 1:
                continue
            found = _PLAYED.unpack_from(self._memory.bytes, _DOUBLE)
            if record[0] == count:
                if count:
                    period, number, phase, *rest = found
                    self._last = Played(period, number, _PHASES[phase], *rest)
                break
        return self._last


class PlanReader:
    """The pump's side. Read: ``number`` and what else the plan that was taken says."""

    def __init__(self, memory: Memory) -> None:
        self._memory = memory
        self.number = self.first = self.nominal = self.rows = self.hold = 0
        self.anew = False
        self.stop: Stop | None = None
        self.ramp = NO_RAMP
        self.refused = 0
        self.seen = 0  # newest number that was looked at
        self._rows = b""
        self.row = LedRows(self._row, None)

    def take(self, period: int, begins: bool) -> bool:
        """Takes the newest whole plan that may be played from ``period`` on; whether there was one.

        ``begins``: only a beginning will do, of which a row is left to be played.
        """
        one, other = self._memory.areas
        newest = (one, other) if _number(one) > _number(other) else (other, one)
        for area in newest:
            head = bytes(area[: self._memory.head.size])
            number, first, changes, nominal, rows, hold, jerks, *rest = self._memory.head.unpack(head)
            anew, number = number >= _ANEW, number & ~_ANEW
            if number <= self.seen:
                return False
            if not (0 < nominal <= rows <= ROWS and jerks <= MAX_JERKS):
                continue
            copied, jerked, sealed = self._copied(area, head, first, rows, jerks)
            if not sealed:
                continue
            self.seen = number
            begun = anew and period < first + nominal
            if first > period or (begins and not begun) or (changes < period and not anew):
                self.refused += 1
                return False
            self.number, self.first, self.nominal = number, first, nominal
            self.rows, self.hold, self.anew, self._rows = rows, hold, anew, copied
            of_stop, of_ramp, of_lead = rest[:_OF_STOP], rest[_OF_STOP:_LEAD_AT], rest[_LEAD_AT:]
            self.stop = Stop(jerked, *of_stop) if jerks else None
            self.ramp = SpeedRamp(*of_ramp)
            self.row = LedRows(self._row, _lead(of_lead) if of_lead else None)
            return True
        return False

    def _copied(
        self, area: memoryview, head: bytes, first: int, rows: int, jerks: int
    ) -> tuple[bytes, array[float], bool]:
        """Its rows in their order and its jerks, and whether they are whole, and the head's."""
        size, at = self._memory.row.size, self._memory.rows_at
        begin = first % ROWS
        many = min(rows, ROWS - begin)
        copied = bytes(area[at + begin * size : at + (begin + many) * size]) + bytes(
            area[at : at + (rows - many) * size]
        )
        jerks_at, end = self._memory.jerks_at, self._memory.head.size
        jerked = bytes(area[jerks_at : jerks_at + jerks * _DOUBLE])
        seal = _SEAL.unpack_from(area, end)[0]
        whole = crc32(copied, crc32(jerked, crc32(head))) == seal and bytes(area[:end]) == head
        return copied, array("d", jerked), whole

    def _row(self, i: int) -> tuple[float, ...]:
        row = self._memory.row
        return row.unpack_from(self._rows, i * row.size)

    def begin_report(self) -> None:
        """Until ``report`` nobody reads: what is chosen meanwhile and what is said of it are one."""
        self._memory.record[0] |= 1

    def report(self, played: Played) -> None:
        """The record; whoever reads sees it whole."""
        record = self._memory.record
        count = record[0] | 1
        record[0] = count
        _PLAYED.pack_into(self._memory.bytes, _DOUBLE, *played)
        record[0] = count + 1


def _lead(found: Sequence[float]) -> Lead:
    """As a head has it."""
    known, bend_rev, *rest = found
    return Lead(int(known), bend_rev, Correction(*rest[:_OF_CORRECTION]), rest[_OF_CORRECTION:])


def _number(area: memoryview) -> int:
    return int.from_bytes(area[:8], "little") & ~_ANEW
