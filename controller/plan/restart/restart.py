"""Start inside of a program: read it without motion up to a place, enter there, cut the rest.

    blocks ... o-------o-------*====o====o====>      the path is made from the program's own start,
               read, not moved ^ cut as ever         so the rest is the very same motions

The place is line and fraction of a block, or, for the same program from the same start, a
motion and its s. Rapids are not gone through in part: the entry leads to their end.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

from controller.machine.kinematics import Kinematics
from controller.machine.model import Joints, Machine
from controller.messages import Message, message
from controller.motion.motions import Rotaries
from controller.plan.path import clamps, spindle_by_hand, tool_changes
from controller.plan.path.path import PathBuilder
from controller.plan.restart import entry
from controller.plan.restart.program_position import (
    AFTER_CHANGE,
    ENTRY_ID,
    FORMER,
    Spot,
    fraction_at,
    place_in,
)
from controller.plan.restart.reentry import Fitted, WayOnto, begins_at, joints_at
from controller.plan.restart.tops import Tops
from controller.plan.segment import ContinuousPath, PathItem, Pause
from controller.plan.surfaces.walls import NONE, Walls
from controller.program import modal
from controller.program.modal import State
from controller.program.program import (
    Act,
    Action,
    Aside,
    Await,
    Block,
    Dwell,
    JointLine,
    Modal,
    ProgramError,
    TipLine,
)


@dataclass(frozen=True, slots=True)
class Source:
    """A program on a machine, and where a whole run of it starts."""

    blocks: Iterable[Block]
    name: str
    machine: Machine
    kinematics: Kinematics
    start: Joints  # mm, rad
    chosen: Mapping[int, Rotaries] | None = None  # as a check of the whole program chose
    dry_run_mm: float = 0.0
    walls: Callable[[], Walls] = lambda: NONE  # of all of it
    again: Callable[[], Iterable[Block]] = tuple  # all of its blocks once more
    begin: State | None = None  # the modal state before its first line; None: that of power-on

    def fitted(self, modal: Modal) -> Fitted:
        """What is in the spindle in a state of the program, and what it must not get into."""
        tool = modal.tool_in(self.machine)
        return Fitted() if tool is None else Fitted(tool, self.walls())

    def dry(self) -> Source:
        """What is read in its place where it is run dry. Raises ProgramError for an impossible offset."""
        if self.dry_run_mm == 0.0:
            return self
        if why := dry_run_refusal(self.dry_run_mm):
            raise ProgramError(self.name, 1, 1, why)
        machine = dry_machine(self.machine, self.dry_run_mm)
        blocks = dry_blocks(self.blocks, self.dry_run_mm)
        return replace(self, blocks=blocks, machine=machine, dry_run_mm=0.0, walls=lambda: NONE, again=tuple)


@dataclass(frozen=True, slots=True)
class Rest:
    """What is left of a program from a place on; nothing of it is walked until ``items`` are."""

    spot: Spot
    target: entry.Target
    what: str  # 'cut', 'line', 'arc' ... or 'pause'
    items: Iterator[PathItem]  # without an entry and without clamps
    source: Source
    order: int = 0  # ``Place.order`` of the line

    def entered(self, now: Joints, in_spindle: int) -> Iterator[PathItem]:
        """All of the path: from the joints ``now`` to the place, and the rest. Raises ProgramError."""
        here = self.source
        entrance = WayOnto(here.machine, here.kinematics, here.fitted(self.target.modal))
        way = entry.enter(self.target, now, in_spindle, entrance, here.name)
        first = self._first_line() if here.machine.changer is not None else []
        return self.opened(itertools.chain(named(way, ENTRY_ID), first, self.items))

    def _first_line(self) -> list[PathItem]:
        """What is left of the line. Raises ProgramError in the middle of a tool change."""
        first: list[PathItem] = []
        for item in self.items:
            first.append(item)
            if isinstance(item, Pause) and item.changing is not None:
                if item.changing.step == 0:
                    break
                raise item.place.refusal(self.source.name, message("tool.restart_inside"))
            if item.place.order > self.order:
                break
        return first

    def opened(self, items: Iterable[PathItem]) -> Iterator[PathItem]:
        """With the clamps opened where their axes move, and stopped where the operator is to do something."""
        modal = self.target.modal
        changed = tool_changes.stopped(items, self.source.machine, modal.tool, modal)
        switched = spindle_by_hand.stopped(changed, self.source.machine)
        return clamps.opened(switched, self.source.machine, self.source.kinematics)


def find(source: Source, spot: Spot) -> Rest:
    """The rest of a program from ``spot`` on. Nothing moves by it.

    Raises ProgramError where the program is refused on the way, or has no such place.
    """
    if not 0.0 <= spot.fraction <= 1.0:
        why = message("restart.no_fraction", fraction=spot.fraction)
        raise ProgramError(source.name, spot.line, 1, why)
    return _Search(source.dry(), spot).rest()


def named(items: Iterable[PathItem], first_id: int) -> list[PathItem]:
    """The same path with its motions counted from ``first_id`` on."""
    made: list[PathItem] = []
    for item in items:
        if isinstance(item, ContinuousPath):
            made.append(replace(item, first_id=first_id))
            first_id += len(item.segments)
        else:
            made.append(item)
    return made


class _Line(NamedTuple):
    before: Modal  # the state before the line
    moving: Modal | None  # the state of its motion


class _Lines:
    """Blocks as they are read; of each line the state is remembered until it is passed."""

    def __init__(self, source: Source) -> None:
        self._blocks = source.blocks
        self._seen: dict[int, _Line] = {}  # by ``Place.order``
        self._now = modal.begun(source.machine, source.begin).modal

    def __iter__(self) -> Iterator[Block]:
        for block in self._blocks:
            line = self._seen.setdefault(block.place.order, _Line(self._now, None))
            if not isinstance(block, Action | Await | Dwell | Aside):
                self._seen[block.place.order] = line._replace(moving=block.modal)
            self._now = block.modal
            yield block

    def at(self, order: int) -> _Line:
        return self._seen[order]

    def forget(self, before: int) -> None:
        while (first := next(iter(self._seen))) < before:
            del self._seen[first]


class _Search:
    """Walks along the path until the place is found."""

    def __init__(self, source: Source, spot: Spot) -> None:
        self._source, self._spot = source, spot
        self._lines = _Lines(source)
        tracer = PathBuilder(
            source.name, source.machine, source.kinematics, source.start, source.chosen or {}
        )
        self._items = _unclamped(tracer.items(self._lines))
        self._stands = source.start
        self._goes_back = False  # lines run in another order than they stand
        self._count = 0  # motions before the item that is looked at
        self._tops = Tops(source.kinematics)

    def rest(self) -> Rest:
        return self._after_change() if self._spot.motion_id == AFTER_CHANGE else self._found()

    def _found(self) -> Rest:
        for item in self._items:
            if isinstance(item, Pause):
                if self._spot.motion_id < 0 and not item.ends and self._is_pause(item):
                    return self._at_pause(item)
                if item.probe is not None:
                    raise self._none("restart.probed", line=item.place.line)
                continue
            found = self._in(item)
            if found is not None:
                return self._from(item, *found)
            self._pass(item)
        raise self._none("restart.no_motion_of_it" if self._goes_back else "restart.no_motion")

    def _none(self, key: str, **values: object) -> ProgramError:
        return ProgramError(self._source.name, self._spot.line, 1, message(key, **values))

    def _check_known(self) -> None:
        """A line alone says where to begin only if it runs once, or the operator has named it."""
        if self._spot.motion_id in (FORMER, AFTER_CHANGE) and self._goes_back:
            raise self._none("restart.which_time")

    def _pass(self, chain: ContinuousPath) -> None:
        self._note_tops(chain)
        self._count += len(chain.segments)
        self._stands = chain.segments[-1].end
        self._lines.forget(chain.place.order)

    # --- where

    def _is_pause(self, pause: Pause) -> bool:
        self._goes_back |= pause.place.step != 0
        line = pause.place.line
        here = line == self._spot.line if self._goes_back else line >= self._spot.line
        return here and self._spot.fraction == 0.0

    def _in(self, chain: ContinuousPath) -> tuple[int, float] | None:
        """(index, s) of the place if it is in this chain."""
        line, fraction, motion_id, s = self._spot
        if motion_id >= 0:
            k = motion_id - self._count
            return (k, s) if 0 <= k < len(chain.segments) else None
        self._goes_back |= chain.place.step != 0
        if fraction > 0.0:
            found = place_in(chain, line, fraction)
            if not self._goes_back and found is None and chain.segments[0].line_at(0.0) > line:
                raise self._none("restart.moves_nothing")
            return found
        return self._first(chain, line)

    def _first(self, chain: ContinuousPath, line: int) -> tuple[int, float] | None:
        """Where the first motion of this line, or of one behind it, begins; of this line alone where lines
        are carried out in another order than they stand."""
        if self._goes_back:
            return self._first_of(chain, line)
        for k, segment in enumerate(chain.segments):
            if segment.line_at(0.0) >= line:
                return k, 0.0
            if segment.line_at(segment.motion.end) >= line:
                found = place_in(chain, line, 0.0)
                return found if found is not None else (k, segment.motion.end)
        return None

    @staticmethod
    def _first_of(chain: ContinuousPath, line: int) -> tuple[int, float] | None:
        for k, segment in enumerate(chain.segments):
            if segment.place.line == line:
                return k, 0.0
            if line in segment.lines:
                return place_in(chain, line, 0.0)
        return None

    def _after_change(self) -> Rest:
        """What comes next after the tool change of the line, of the same line, too."""
        changed = -1  # its ``Place.order``
        for item in self._items:
            place = item.place
            self._goes_back |= place.step != 0
            if not isinstance(item, Pause):
                if changed >= 0:
                    return self._from(item, 0, 0.0)
                self._pass(item)
            elif changed >= 0:
                return self._at_pause(item, item.modal if place.order == changed else None)
            elif item.probe is not None:
                raise self._none("restart.probed", line=place.line)
            elif item.changing is not None and item.changing.last and place.line == self._spot.line:
                changed = place.order
        raise self._none("restart.no_motion_of_it" if self._goes_back else "restart.no_motion")

    # --- what is left from there

    def _from(self, chain: ContinuousPath, k: int, s: float) -> Rest:
        """From inside a chain; over the end of rapids that the place is in, and of what cuts nothing."""
        while chain.segments[k].feed_mm_s is None or begins_at(chain.segments[k], s) is None:
            self._stands = chain.segments[k].end
            if k + 1 < len(chain.segments):
                k, s = k + 1, 0.0
                continue
            self._count += len(chain.segments)
            after = next(self._items, None)
            if after is None:
                raise self._none("restart.only_rapid")
            if isinstance(after, Pause):
                return self._at_pause(after)
            chain, k, s = after, 0, 0.0
        self._note_tops(chain)
        return self._on(chain, k, min(max(s, 0.0), chain.segments[k].motion.end))

    def _on(self, chain: ContinuousPath, k: int, s: float) -> Rest:
        segment = chain.segments[k]
        s = begins_at(segment, s) or 0.0
        self._check_known()
        order = segment.order_at(s)
        known = self._lines.at(order)
        state = known.moving or known.before
        joints = joints_at(segment, s, self._source.kinematics)
        rest = replace(chain, segments=chain.segments[k:], from_s=s, first_id=self._count + k)
        spot = Spot(segment.line_at(s), fraction_at(chain, k, s), self._count + k, s)
        target = entry.Target(joints, state, segment.place, self._clear(joints, state), segment, s)
        return Rest(spot, target, segment.name, itertools.chain([rest], self._items), self._source, order)

    def _at_pause(self, pause: Pause, state: Modal | None = None) -> Rest:
        """``state``: in which it is entered; None: that before the line."""
        self._check_known()
        line = pause.place.line
        state = state or self._lines.at(pause.place.order).before
        clear = self._clear(self._stands, state)
        target = entry.Target(self._stands, state, pause.place, clear)
        items = _counted(itertools.chain([pause], self._items), self._count)
        return Rest(Spot(line, 0.0), target, "pause", items, self._source, pause.place.order)

    # --- how high

    def _length(self, order: int) -> float:
        known = self._lines.at(order)
        tool = (known.moving or known.before).tool_in(self._source.machine)
        return tool.length_mm if tool is not None else 0.0

    def _note_tops(self, chain: ContinuousPath) -> None:
        for segment in chain.segments:
            self._tops.note(segment, self._length(segment.place.order))

    def _clear(self, joints: Joints, state: Modal) -> float:
        machine = self._source.machine
        tool = state.tool_in(machine)
        length = tool.length_mm if tool is not None else 0.0
        return max(0.0, self._tops.above(joints, length)) + machine.clearance_mm


def _unclamped(items: Iterable[PathItem]) -> Iterator[PathItem]:
    """Clamps are asked for anew on the way that is really gone."""
    return (item for item in items if not (isinstance(item, Pause) and item.act is Act.CLAMP))


def _counted(items: Iterator[PathItem], first_id: int) -> Iterator[PathItem]:
    """The first chain keeps its number in the whole program; the others are counted on."""
    for item in items:
        if isinstance(item, ContinuousPath):
            yield replace(item, first_id=first_id)
            break
        yield item
    yield from items


# A dry run: the whole program some way off the part along the tool axis, spindle and coolant off.
#
# A tool that is thought longer by d than it is stands d further off along its own axis, on
# every machine and at every tilt: the spindle is at tip + length x axis. So the offset is put
# on the lengths, and everything else (approach, travel, limits) is judged as it will be run.


def dry_run_refusal(offset_mm: float) -> Message | None:
    """Why an offset is refused; None where it is not."""
    return None if 0.0 <= offset_mm < 1e4 else message("restart.dry_run", offset=offset_mm)


def dry_machine(machine: Machine, offset_mm: float) -> Machine:
    """The machine whose tools are longer by the offset (mm)."""
    tools = tuple(replace(tool, length_mm=tool.length_mm + offset_mm) for tool in machine.tools)
    return replace(machine, tools=tools)


def dry_blocks(blocks: Iterable[Block], offset_mm: float) -> Iterator[Block]:
    """The same blocks with the offset on the tool's length, spindle and coolant off."""
    for block in blocks:
        modal = block.modal
        cutter = modal.cutter and replace(modal.cutter, length_mm=modal.cutter.length_mm + offset_mm)
        dry = replace(
            modal, length_mm=modal.length_mm + offset_mm, cutter=cutter, spindle_rev_min=0.0, coolant=0
        )
        if isinstance(block, JointLine | TipLine):
            block = replace(block, probe=None)  # there is nothing to be touched
        yield replace(block, modal=dry)
