"""A program checked as a whole, and the check kept: what a start stands on.

check(...)   reads, plans and audits everything, keeps what it found
find(...)    the kept check of the same program, machine, tools and offsets, if there is one
path_of(...) the path again, block by block, with the choices of the check
rest_of(...) what is left of it from a place on
"""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from controller.geometry.vectors import ROUNDING
from controller.machine.kinematics import Kinematics, kinematics_of
from controller.machine.model import TOOL_AT_POWER_ON, Joints, Machine
from controller.messages import Message, message
from controller.motion.motions import Rotaries
from controller.plan.look_ahead import NoLaw
from controller.plan.path import path, remarks, spindle_by_hand, tool_changes
from controller.plan.report import duration, stored, survey
from controller.plan.report.passing import Passing
from controller.plan.report.stored import Stored
from controller.plan.report.survey import BlockUse, Survey
from controller.plan.restart import restart
from controller.plan.restart.program_position import Spot
from controller.plan.restart.restart import Rest, Source
from controller.plan.segment import Note, PathItem, Pause, Segment
from controller.plan.surfaces import choices, cuts, placements, placing
from controller.plan.surfaces.walls import NONE, Walls
from controller.program import blocks, carried, modal
from controller.program.carried import InForce
from controller.program.modal import State
from controller.program.position import homed
from controller.program.program import Act, Aside, Block, CutBlock, GougeRefused, Place, ProgramError
from controller.program.source_text import may_cut
from controller.verify import wording
from controller.verify.audit import Audit, FormRefused, Watched, audit
from controller.workers import Spread, here

# Share of a check that is done when cutters are placed, when branches are chosen, and when all is planned.
PLACED, CHOSEN, PLANNED = 0.1, 0.2, 0.6
MAX_KEPT = 1000  # motions of a path that is not laid once more for its run: it bounds the memory
PLACING_S = 0.4  # that a search for one surface takes, about


Progress = Callable[[float], None]  # gets the share that is done


@dataclass(frozen=True, slots=True)
class Task:
    """What is to be run, and from where."""

    text: bytes
    name: str
    machine: Machine
    kinematics: Kinematics
    start: Joints
    look: Callable[[Block], None] | None = None  # called with every block that is read; may raise
    begin: State | None = None  # the modal state before its first line; None: that of power-on
    typed: bool = False  # a line by hand, which means the tool that is there until it names one
    in_force: InForce | None = None  # where the state of each line that is read is noted

    @property
    def key(self) -> str:
        begin = None if self.begin is None else carried.to_json(self.begin)
        return stored.key(self.text, self.machine, self.start, begin)

    def read(self, in_force: InForce | None = None) -> Iterator[Block]:
        """The program as blocks; the state of each line is noted in ``in_force``. Raises ProgramError."""
        return blocks.stream(
            self.text, self.machine, self.name, start=self.start, begin=self.begin, in_force=in_force
        )


@dataclass(slots=True)
class Walk:
    """A path that is read as it is walked; notes come as they are made."""

    items: Iterable[PathItem]
    notes: list[Note] = field(default_factory=list)
    choices: Mapping[int, Rotaries] = field(default_factory=dict)


def task(text: bytes, name: str, machine: Machine) -> Task:
    """A program to be run from the homed position."""
    return Task(text, name, machine, kinematics_of(machine), homed(machine))


def standing(asked: Task, joints: Joints) -> Task:
    """A task from where the machine stands: homing by a switch leaves an axis beside its edge."""
    if max(abs(a - b) for a, b in zip(joints, asked.start, strict=True)) <= ROUNDING:
        return asked
    return replace(asked, start=joints)


def path_of(
    asked: Task,
    chosen: Mapping[int, Rotaries] | None = None,
    dry_run_mm: float = 0.0,
    in_spindle: int | None = None,
) -> Walk:
    """The path block by block, as ``chosen`` over the whole program, or as the blocks come.

    What it walks over raises ProgramError where a block is refused. ``dry_run_mm``: so far off the
    part along the tool axis, spindle and coolant off. ``in_spindle``: a tool's number, 0 = not known;
    it stops where another one is to be put in, and where the operator is to switch the spindle. None: nobody
    is waited for.
    """
    source = _source(asked, chosen, dry_run_mm).dry()
    tracer = path.PathBuilder(asked.name, source.machine, asked.kinematics, asked.start, chosen or {})
    read = _Read(iter(source.blocks))
    items = duration.bounded(tracer.items(read), source.machine, asked.name, whole=chosen is not None)
    items = _whole(items, read, asked)
    if asked.typed:
        items = _switched_off(items)
    elif not dry_run_mm:
        items = remarks.standing_spindle(items, source.machine, tracer.notes.append)
        items = remarks.plunges(items, asked.machine, asked.kinematics, tracer.notes.append)
        items = remarks.changed_rotaries(items, asked.machine, asked.start, tracer.notes.append)
    if in_spindle is not None:
        note = tracer.notes.append
        before = None if asked.begin is None else modal.begun(asked.machine, asked.begin).modal
        items = tool_changes.stopped(items, asked.machine, in_spindle, before, asked.typed, note, asked.name)
        rev_min = before.spindle_rev_min if before is not None else 0.0
        items = spindle_by_hand.stopped(items, asked.machine, rev_min, asked.typed, note)
    return Walk(items, tracer.notes, chosen or {})


def rest_of(asked: Task, chosen: Mapping[int, Rotaries] | None, spot: Spot, dry_run_mm: float = 0.0) -> Rest:
    """What is left of a program from ``spot`` on: its state to be shown, and its way once ``entered``.

    ``asked.start`` is where the whole run started, as the journal has it, or would start now. Raises
    ProgramError where there is no such place, or the program is refused before it.
    """
    return restart.find(_source(asked, chosen, dry_run_mm), spot)


def _source(asked: Task, chosen: Mapping[int, Rotaries] | None, dry_run_mm: float) -> Source:
    read = _blocks(asked)
    return Source(
        read,
        asked.name,
        asked.machine,
        asked.kinematics,
        asked.start,
        chosen,
        dry_run_mm,
        partial(walls_of, asked),
        asked.read,
        asked.begin,
    )


def walls_of(asked: Task) -> Walls:
    """All surfaces that a program cuts, read once more. Raises ProgramError where it is refused."""
    if not may_cut(asked.text):
        return NONE
    return Walls.of(asked.read(), asked.machine)


def _blocks(asked: Task) -> Iterator[Block]:
    for block in asked.read(asked.in_force):
        if asked.look is not None:
            asked.look(block)
        yield block


class _Read:
    """Blocks, with the last one that was given."""

    def __init__(self, blocks: Iterator[Block]) -> None:
        self._blocks = blocks
        self.last: Block | None = None

    def __iter__(self) -> Iterator[Block]:
        for block in self._blocks:
            self.last = block
            yield block


def _whole(items: Iterator[PathItem], read: _Read, asked: Task) -> Iterator[PathItem]:
    """A program without a block is refused; one whose moves all end where they start is a pause.

    So is a line by hand that only says how the next ones are meant.
    """
    empty = True
    for item in items:
        empty = False
        yield item
    if read.last is None and asked.typed:
        yield Pause(Place(1, 1), modal.begun(asked.machine, asked.begin).modal)
    elif read.last is None:
        raise ProgramError(asked.name, 1, 1, message("path.nothing"))
    elif empty:
        yield Pause(read.last.place, read.last.modal)


def _switched_off(items: Iterable[PathItem]) -> Iterator[PathItem]:
    """After a line by hand what is on stays on, but for M2 and M30."""
    for item in items:
        if isinstance(item, Pause) and item.act is Act.END:
            yield Pause(item.place, item.modal, act=Act.SPINDLE)
        yield item


def chosen_for(asked: Task, progress: Progress = lambda _: None) -> dict[int, Rotaries]:
    """Branch and turns over the whole program: a pass of its own over its blocks."""
    read = _with_progress(_blocks(asked), asked, progress)
    return choices.choices(read, asked.machine, asked.kinematics, asked.start, asked.name)


def _with_progress(read: Iterator[Block], asked: Task, progress: Progress) -> Iterator[Block]:
    """Blocks; ``progress`` gets the share of the program that is read."""
    lines = max(1, asked.text.count(b"\n"))
    for block in read:
        progress(min(1.0, block.place.line / lines))
        yield block


def _between(progress: Progress, low: float, high: float) -> Progress:
    """The progress of a part of what is done, as that of all of it."""
    return lambda share: progress(low + (high - low) * min(share, 1.0))


def walk_of(asked: Task, kept: Stored | None, unchecked: bool, progress: Progress = lambda _: None) -> Walk:
    """The path of a start: by its stored check; else read to its end first, so that nothing
    begins that will be refused; else, ``unchecked``, refused only where the walk comes to it.
    """
    if kept is None and not unchecked:
        with _gouges_placed(asked):
            whole = path_of(asked, chosen_for(asked, _between(progress, 0.0, PLANNED)))
            watched = Watched(whole.items)
            items = _fixed(watched)
            notes = whole.notes + _audited(asked, watched, _between(progress, PLANNED, 1.0)).notes
        again = path_of(asked, whole.choices) if items is None else Walk(items, choices=whole.choices)
        return _noted(again, notes)
    if kept is not None:
        placements.learn(kept.placements)
    return _noted(path_of(asked, kept.choices if kept else None), kept.notes if kept else ())


def walk_from(asked: Task, walk: Walk, joints: Joints, unchecked: bool) -> Walk:
    """That path, begun where the machine stands."""
    stands = standing(asked, joints)
    if stands is asked:
        return walk
    return _noted(path_of(stands, None if unchecked else walk.choices), walk.notes)


def _walked(walk: Walk) -> Watched:
    """A path gone through, and what is kept of it."""
    watched = Watched(walk.items)
    for _ in watched:
        pass
    return watched


def _fixed(watched: Watched) -> list[PathItem] | None:
    """A path gone through, as it can be gone again; None where it is long, or its run decides on it."""
    kept, fixed = list[PathItem](), True
    for item in watched:
        probes = isinstance(item, Pause) and item.probe is not None
        fixed = fixed and not probes and len(watched.segments) <= MAX_KEPT
        if fixed:
            kept.append(item)
    return kept if fixed else None


@contextlib.contextmanager
def _gouges_placed(asked: Task) -> Iterator[None]:
    """What the path itself refuses as a gouge is looked at as closely as what its end would show.

    A lead or a hollow is refused as soon as the path comes to it; place and depth of the whole
    program's gouges need all of it, so it is read once more with gouges let through.
    """
    try:
        yield
    except GougeRefused as refusal:
        lenient = replace(asked, machine=replace(asked.machine, gouge="warn"))
        try:
            _audited(asked, _walked(path_of(lenient, chosen_for(lenient))))
        except FormRefused:
            raise refusal from None
        except ProgramError as found:
            raise found from refusal
        raise


def _audited(
    asked: Task, watched: Watched, progress: Progress = lambda _: None, spread: Spread = here
) -> Audit:
    """What is reported of the surfaces; raises ProgramError where they are refused."""

    return audit(watched, asked.read, asked.name, asked.machine, asked.kinematics, progress, spread)


def _noted(walk: Walk, notes: Sequence[Note]) -> Walk:
    return replace(walk, notes=list(notes)) if notes else walk


def segments(walk: Walk) -> dict[int, Segment]:
    """All segments of a path by motion id: the planner counts them in the order of the path."""
    return dict(enumerate(segment for item in walk.items for segment in item.segments))


def check(
    asked: Task,
    where: Path,
    tell: Callable[[BlockUse], None] = lambda _: None,
    progress: Callable[[int], None] = lambda _: None,
    watch: Callable[[Iterable[PathItem]], Iterable[PathItem]] = lambda items: items,
    spread: Spread = here,
) -> tuple[Survey, Stored, Message | str]:
    """Look at the whole program and keep what was found: survey, check, and a warning or "".

    As ``looked_at``. Raises ProgramError.
    """
    found, kept = looked_at(asked, tell, progress, watch, spread)
    return found, kept, keep(kept, asked.key, where)


def looked_at(
    asked: Task,
    tell: Callable[[BlockUse], None] = lambda _: None,
    progress: Callable[[int], None] = lambda _: None,
    watch: Callable[[Iterable[PathItem]], Iterable[PathItem]] = lambda items: items,
    spread: Spread = here,
) -> tuple[Survey, Stored]:
    """The whole program: survey and check.

    ``tell`` is that of ``survey.survey``; ``progress`` gets what is done of all, as a line of the
    program; ``watch`` hands the path on as it is read; ``spread`` takes what is per surface. Raises
    ProgramError.
    """
    lines = max(1, asked.text.count(b"\n"))

    def done(share: float) -> None:
        progress(int(share * lines))

    planned = _between(done, CHOSEN, PLANNED)
    with _gouges_placed(asked):
        place_ahead(asked, spread, _between(done, 0.0, PLACED))
        chosen = chosen_for(asked, _between(done, PLACED, CHOSEN))
        there = asked.begin.modal.tool if asked.begin is not None else TOOL_AT_POWER_ON
        in_force = InForce()
        walk = path_of(replace(asked, in_force=in_force), chosen, in_spindle=there)
        placed = placements.Noted(watch(walk.items))
        watched, passing = Watched(placed), Passing()
        try:
            found = survey.survey(
                watched,
                asked.machine,
                asked.kinematics,
                tell,
                lambda line: planned(line / lines),
                passing,
                in_force,
            )
        except NoLaw as lost:
            raise ProgramError(asked.name, lost.line, 1, message("path.no_law")) from lost
        seen = _audited(asked, watched, _between(done, PLANNED, 1.0), spread)
    notes, overcuts = (*walk.notes, *seen.notes), tuple(seen.overcuts)
    figures = found.ticks, found.duration_s, found.blocks
    return found, Stored(
        *figures,
        walk.choices,
        notes,
        overcuts,
        placed.recipes,
        tuple(seen.verdicts),
        tuple(passing.marks),
        tuple(passing.events),
    )


def place_ahead(asked: Task, spread: Spread, progress: Progress = lambda _: None) -> None:
    """Searches the placements of all surfaces before the path asks for one after the other.

    Nothing where nobody else searches. A program that is refused somewhere is placed up to there.
    """
    if spread is here or not may_cut(asked.text):
        return
    wanted: dict[placing.RequiredPlacement, None] = {}
    with contextlib.suppress(ProgramError):
        read = _with_progress(_blocks(asked), asked, _between(progress, 0.0, 0.1))
        moving = (block for block in read if not isinstance(block, Aside))
        for is_cut, group in itertools.groupby(moving, lambda block: isinstance(block, CutBlock)):
            row = (block for block in group if isinstance(block, CutBlock))
            for together in cuts.placed_together(row, asked.machine) if is_cut else ():
                wanted |= dict.fromkeys(cuts.required_placements(together, asked.machine))
    unknown = [one for one in wanted if not one.is_known]
    for k, recipes in enumerate(spread(placing.searched, unknown, PLACING_S)):
        placements.learn(recipes)
        progress(0.1 + 0.9 * (k + 1) / len(unknown))


def keep(kept: Stored, name: str, where: Path) -> Message | str:
    """Store a check; a warning where that was not to be done, or ""."""
    try:
        stored.save(kept, name, where)
    except OSError as error:
        return message("stored.not_kept", folder=where, why=error)
    return ""


def verdict_of(kept: Stored, most: int = wording.MAX_SURFACES) -> dict[str, Any] | None:
    """What a check says of the form of all surfaces, as ``wording.to_json`` does."""
    return wording.to_json(kept.verdicts, most)


def find(asked: Task, where: Path) -> tuple[Stored | None, Message | str]:
    """The kept check, and a warning or "" where there is none to be used."""
    kept, warning = stored.load(asked.key, where)
    if kept is not None:
        placements.learn(kept.placements)
    return kept, warning
