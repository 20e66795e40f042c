"""The path as the planner walks along it: numbered motions and pauses, read as they are needed.

Of each unit it is known whether the machine rests after it, whether the program's block
ends with it, and whether it is the last; that takes one unit of foresight. What lies
behind can be forgotten, so the length of a program costs no memory.
"""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from controller.machine.kinematics import Kinematics
from controller.machine.model import Joints, Machine
from controller.motion.pieces import FIRST_MARK
from controller.plan.feed import profile
from controller.plan.restart.program_position import ENTRY_ID, FORMER, Spot, fraction_at
from controller.plan.restart.reentry import is_free
from controller.plan.restart.tops import Tops
from controller.plan.segment import ContinuousPath, PathItem, Pause, Segment
from controller.program.program import Act, Probed, Probing, ProgramError

TINY = 1e-9  # of s
STANDS = -1  # motion id of a pause ...


def _id_of(pause: Pause) -> int:
    """... but of a changer's, which is told from the others by whoever keeps its journal."""
    return STANDS if pause.changing is None else FIRST_MARK - pause.changing.number


@dataclass(frozen=True, slots=True)
class Unit:
    """A segment, or a pause, of the path."""

    what: Segment | Pause
    motion_id: int  # counted along the path; STANDS for a pause
    rests: bool = True  # after it; False: it runs into the next
    block_end: bool = True  # a block of the program ends with it
    optional_stop: bool = False  # an M1 stands there
    last: bool = True
    begin: float = 0.0  # s at which it begins: a restart begins inside of a motion
    chain: ContinuousPath | None = None  # that it is a segment of ...
    index: int = 0  # ... and which

    @property
    def segment(self) -> Segment | None:
        """None: it is a pause."""
        return self.what if isinstance(self.what, Segment) else None

    @property
    def pause(self) -> Pause | None:
        """None: it is a segment."""
        return self.what if isinstance(self.what, Pause) else None

    @property
    def line(self) -> int:
        return self.what.place.line

    @property
    def order(self) -> int:
        return self.what.place.order

    @property
    def last_order(self) -> int:
        """That of the block with which it ends; a spline is many lines."""
        return self.order if self.segment is None else self.segment.order_at(self.length)

    @property
    def lines_end(self) -> Sequence[float]:
        """Places inside its motion where a line ends and the next begins."""
        return [s for s in self.segment.lines_s if 0.0 < s < self.length] if self.segment else ()

    @property
    def optional_stops(self) -> Sequence[float]:
        """Those of them with an M1."""
        marks = self.chain.optional_stops if self.chain is not None else ()
        if not marks or (segment := self.segment) is None:
            return ()
        return [s for s in self.lines_end if _between(marks, segment.order_at(s - TINY), segment.order_at(s))]

    @property
    def length(self) -> float:
        return 0.0 if self.segment is None else self.segment.motion.end


class Track:
    """Units by their number along the path, from 0."""

    def __init__(
        self,
        items: Iterable[PathItem],
        machine: Machine,
        kinematics: Kinematics,
        ends: bool = True,
        probes: bool = False,
    ) -> None:
        """``ends``: the program ends with it; a way aside does not. ``probes``: it is really gone, and
        what comes behind a probing move is read when its outcome is there.
        """
        self._machine, self._kinematics = machine, kinematics
        self._ends = ends
        self._ahead = self._units(items)
        self._kept: deque[Unit] = deque()
        self._first = 0  # number of the first unit kept
        self._all = False
        self._probes = probes
        self._tops, self._length_mm = Tops(kinematics), 0.0
        self.laid = 0  # ways that were laid before units of it since
        self.waits: Probing | None = None  # for its outcome, before any more is read
        self.error: ProgramError | None = None  # that ended the path before its end

    def at(self, number: int) -> Unit | None:
        """A unit that is not forgotten; None beyond the end of the path."""
        while number >= self._first + len(self._kept) and not self._all and self.waits is None:
            self._read()
        return self._kept[number - self._first] if number - self._first < len(self._kept) else None

    @property
    def read_to(self) -> int:
        """Number of the first unit that has not been read yet."""
        return self._first + len(self._kept)

    def comes_free(self, number: int) -> bool:
        """Whether the motion before a unit, as far as it is known, leads beside the part alone."""
        known = list(itertools.islice(self._kept, max(0, number - self._first)))
        before = next((unit.segment for unit in reversed(known) if unit.segment), None)
        return is_free(before) if before is not None else self._first == 0

    def lead_in(self, number: int, s: float, ways: Sequence[Segment], joins: bool, first_id: int) -> None:
        """Lay ``ways`` before a unit, which then begins at ``s``; ``joins``: the last runs on into it."""
        unit, i = self._kept[number - self._first], number - self._first
        self._kept[i] = replace(unit, begin=s) if unit.segment else unit
        if joins and unit.segment:
            row, begins = (ways[-1], unit.segment), (0.0, s)
            runs = profile.split_at_stops(row, self._machine, self._kinematics, begins=begins)
            joins = len(runs) == 1
        self.laid += len(ways)
        for k, way in enumerate(ways):
            rests = not (joins and k == len(ways) - 1)
            laid = Unit(way, first_id + k, rests, block_end=False, last=False, chain=ContinuousPath((way,)))
            self._kept.insert(i + k, laid)

    def answer(self, number: int, came: Probed) -> int:
        """What came of the probing that ends at or behind a unit; the number of the unit behind it."""
        while self.waits is None and self.at(number) is not None:
            number += 1
        if self.waits is not None:
            self.waits.came, self.waits = came, None
        return self._first + len(self._kept)

    def number_of(self, motion_id: int) -> int | None:
        """Of the unit with that motion, if it is known."""
        for i, unit in enumerate(self._kept):
            if unit.motion_id == motion_id:
                return self._first + i
        return None

    def program_spot(self, number: int, s: float) -> Spot | None:
        """As ``spot``; on an entry, and on pauses inside of it, where the program goes on behind it."""
        ahead = first = number
        while (unit := self.at(ahead)) is not None and not 0 <= unit.motion_id < ENTRY_ID:
            ahead += 1
            first = ahead if unit.motion_id >= ENTRY_ID else first
        behind = self.at(first)
        return self.spot(first, s if first == number or behind is None else behind.begin)

    def spot(self, number: int, s: float) -> Spot | None:
        """A place as program line and fraction of its block; None beyond the end."""
        unit = self.at(number)
        if unit is None:
            return None
        if unit.chain is None or unit.segment is None:
            return Spot(unit.line, 0.0, FORMER)
        share = 1.0 if unit.segment.name == "lift" else fraction_at(unit.chain, unit.index, s)
        return Spot(unit.segment.line_at(s), share, unit.motion_id, s)

    def forget(self, before: int) -> None:
        """What lies before that number is not asked for any more."""
        while self._kept and self._first < before:
            self._kept.popleft()
            self._first += 1

    def _read(self) -> None:
        """The next unit. A program that is refused on the way ends here: what was read stays sound."""
        try:
            unit = next(self._ahead, None)
        except ProgramError as error:
            self.error, unit = error, None
        if unit is None:
            self._all = True
        else:
            self._kept.append(unit)
            self._note_top(unit.what)
            if self._probes and unit.pause and unit.pause.ends:
                self.waits = unit.pause.probe

    def _note_top(self, what: Segment | Pause) -> None:
        if isinstance(what, Segment):
            self._tops.note(what, getattr(what.motion, "length_mm", self._length_mm))
        elif what.act is Act.TOOL and (tool := what.modal.tool_in(self._machine)) is not None:
            self._length_mm = tool.length_mm

    def goes_on(self, before: Track) -> None:
        """It is what is left of another one."""
        self._tops.take(before._tops)

    def clear_mm(self, joints: Joints, segment: Segment | None = None) -> float:
        """How far off along its axis the tool is above all that the path cuts, as far as it is read."""
        length_mm = getattr(segment.motion, "length_mm", self._length_mm) if segment else self._length_mm
        return max(0.0, self._tops.above(joints, length_mm)) + self._machine.clearance_mm

    def _units(self, items: Iterable[PathItem]) -> Iterator[Unit]:
        before: Unit | None = None
        try:
            for unit, joined in self._numbered(items):
                if before is not None:
                    yield self._before(before, unit, joined)
                before = unit
                if unit.pause and unit.pause.ends:
                    yield replace(unit, last=False)  # nobody knows yet what comes behind it
                    before = None
        except ProgramError:
            if before is not None:  # the way ends behind it, but not the program
                yield replace(before, last=False)
            raise
        if before is not None:
            yield replace(before, last=self._ends)

    def _numbered(self, items: Iterable[PathItem]) -> Iterator[tuple[Unit, bool]]:
        """Units with whether they are joined to the one before without a rest."""
        count = 0
        before: Segment | None = None  # that runs on into the next chain by the path's own word
        for item in items:
            if isinstance(item, Pause):
                yield Unit(item, _id_of(item)), False
                before = None
                continue
            count = count if item.first_id is None else item.first_id
            row = item.segments if before is None else (before, *item.segments)
            joined = [before is not None, *[True] * (len(item.segments) - 1)]
            first = len(item.segments) - len(row)
            begins = [*([0.0] if before else ()), item.from_s, *[0.0] * (len(item.segments) - 1)]
            for run in profile.split_at_stops(row, self._machine, self._kinematics, 1.0, begins=begins)[:-1]:
                first += len(run)
                joined[first] = False
            for k, segment in enumerate(item.segments):
                begin = 0.0 if k else item.from_s
                yield Unit(segment, count, begin=begin, chain=item, index=k), joined[k]
                count += 1
            before = item.segments[-1] if item.runs_on else None

    def _before(self, unit: Unit, after: Unit, joined: bool) -> Unit:
        marks, order = after.chain.optional_stops if after.chain is not None else (), unit.last_order
        optional = bool(marks) and _between(marks, order, after.order)
        return replace(
            unit, rests=not joined, block_end=order != after.order, optional_stop=optional, last=False
        )


def _between(marks: Iterable[int], order: int, after: int) -> bool:
    """Whether an M1 stands between two blocks; those of no motion between them are passed over."""
    return any(order <= mark < after for mark in marks)
