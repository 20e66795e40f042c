"""The way of a whole program: blocks in, chains of motion out, every joint audited.

    blocks -> moves (G0 to G3), tool lines and rows of lines (G43.4, G43.5, G64 P), or trains
              of cuts (G51, G52, G6.2) with approach and departure
           -> chains that run through, pauses where the machine stands

Nothing here knows of time: ``limits`` and ``profile`` put the motion law on each chain.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple, Protocol

import numpy as np

from controller.machine.kinematics import Kinematics
from controller.machine.model import Joints, Machine
from controller.messages import Message, message
from controller.motion.motions import JointMove, Rotaries, SurfaceCut, ToolLine
from controller.plan.context import Context
from controller.plan.lines import exact_rows, lines, meant, rows, spline_moves
from controller.plan.lines.corners import Feed
from controller.plan.lines.lines import Stand
from controller.plan.lines.rows import LineRow
from controller.plan.path import clamps, outputs, poles
from controller.plan.path.outputs import Switched
from controller.plan.rotaries.branch import joints_along
from controller.plan.segment import (
    ContinuousPath,
    Note,
    Path,
    PathItem,
    Pause,
    Segment,
    motion_named,
    rotaries_of,
)
from controller.plan.surfaces import (
    approach,
    audit,
    auto,
    choices,
    cuts,
    leads,
    line_blends,
    links,
    train,
    unwind,
)
from controller.plan.surfaces.legs import CutSegment
from controller.program.block_look_ahead import Ahead
from controller.program.program import (
    Act,
    Action,
    Aside,
    Await,
    Block,
    CutBlock,
    CutCone,
    CutRuled,
    Dwell,
    JointCurve,
    JointMotion,
    Modal,
    OperatorMessage,
    Place,
    Probing,
    Program,
    ProgramError,
    Remark,
    TipLine,
    probing_of,
)

ARC_SAMPLES = 181
MAX_SAID = 100  # messages that are noted
LONGEST_CHAIN = 64  # segments; a longer row of lines comes in parts


def trace(program: Program, machine: Machine, kinematics: Kinematics, start: Joints) -> Path:
    """The path of ``program`` from the joints ``start`` (mm, rad); nothing moves by it.

    Raises ProgramError with file, line, column and a sentence for the first block that
    cannot be run: surface, gouge, corner, travel, branch or arc.
    """
    chosen = choices.choices(program.blocks, machine, kinematics, start, program.name)
    tracer = PathBuilder(program.name, machine, kinematics, start, chosen)
    items = tuple(tracer.items(program.blocks))
    path = Path(items, tuple(tracer.notes), tracer.now)
    if program.blocks and not path.items:  # every move ends where it starts: a run of no length
        path = replace(path, items=(Pause(program.blocks[-1].place, program.blocks[-1].modal),))
    return path


def stream(
    blocks: Iterable[Block],
    name: str,
    machine: Machine,
    kinematics: Kinematics,
    start: Joints,
    chosen: Mapping[int, Rotaries] | None = None,
) -> Iterator[PathItem]:
    """As ``trace``, item by item and without the notes; no more of the program is held than a window.

    ``chosen``: rotaries (rad) at the start of a train of cuts or at a G0 with a tool vector, by
    ``Place.order``; without it each is chosen as it comes. ProgramError comes when its block does.
    """
    return PathBuilder(name, machine, kinematics, start, chosen or {}).items(blocks)


class LineQueue(Protocol):
    """Collects lines of one kind until it is known how they are laid; false while there are none."""

    @property
    def length_mm(self) -> float:
        """Of their tool."""

    def takes(self, block: Block) -> bool:
        """Whether a block is of this kind."""

    def goes_with(self, block: Feed) -> bool:
        """Whether it may stand in one row with those that wait."""

    def add(self, block: Any) -> bool:
        """``block`` is one that it takes. Whether it is time to look at them."""

    def parts(self, standing: Callable[[], Stand], final: bool) -> Iterable[rows.Part]:
        """What is certain by now, ``final``: all of it; ``standing``: where the path has come to by then."""

    def forget(self) -> None:
        """None of them is wanted any more."""


class Pending(NamedTuple):
    """What has not come to rest: it will, or it runs on into what follows. Replaced as a whole.

    ``lines`` come after a ``row``, the row after a ``run``; each may be missing. Where the run ends in the
    cuts of a train, ``legs`` are these: the next train may follow without a retract.
    """

    end: Joints  # where the path has come to, but for the row and the lines
    run: tuple[Segment, ...] = ()  # motions that run through, of exact lines or with the cuts of a train
    legs: Sequence[CutSegment] = ()
    row: LineRow | None = None  # lines and arcs under G64 P, or lines that run on
    lines: LineQueue | None = None  # of which it is not known yet how they are laid


class PathBuilder:
    """A fold over blocks: each makes items of the path and a new ``Pending``; ``notes`` are to be told."""

    def __init__(
        self,
        name: str,
        machine: Machine,
        kinematics: Kinematics,
        start: Joints,
        chosen: Mapping[int, Rotaries],
    ) -> None:
        self._context = context = Context(machine, kinematics, name, self._note)
        self._chosen = chosen  # rotaries at the start of a train, by the order of its first block
        self._ahead = Ahead(iter(()))
        self._queues: Sequence[LineQueue] = meant.Waiting(context), exact_rows.ExactLines(context)
        self._pending = Pending(start)
        self._stand: Stand | None = None  # of the tool after the last block of G43.4 or G43.5
        self._items: list[PathItem] = []  # not given away yet
        self._blends_noted = False
        self._said: set[tuple[int, str]] = set()  # line and words to the operator that were noted
        self.notes: list[Note] = []

    @property
    def now(self) -> Joints:
        """Where the path has come to."""
        return self._pending.end

    def items(self, blocks: Iterable[Block]) -> Iterator[PathItem]:
        """The path of all blocks, as it is made; before a block that is refused comes all that is sound."""
        machine, kinematics = self._context.machine, self._context.kinematics
        switched = Switched(machine)
        return clamps.opened(switched.laid(self._sound_items(switched.read(blocks))), machine, kinematics)

    def _sound_items(self, blocks: Iterable[Block]) -> Iterator[PathItem]:
        try:
            yield from self._items_of(blocks)
        except ProgramError as error:
            first = error
            try:
                self._lay_lines()
            except ProgramError as before:
                first = before
            self._pending = self._pending._replace(row=None)
            self._rest()
            yield from self._made()
            raise first from None

    def _items_of(self, blocks: Iterable[Block]) -> Iterator[PathItem]:
        self._ahead = Ahead(self._heard(blocks))
        for is_cut, group in itertools.groupby(self._ahead, lambda b: isinstance(b, CutBlock)):
            if is_cut:
                self._lay_lines()
                self._surfaces(block for block in group if isinstance(block, CutBlock))
                yield from self._made()
                continue
            for block in group:
                self._block(block)
                if self._items:
                    yield from self._made()
                if (probe := probing_of(block)) and probe.came:
                    self._pending = Pending(probe.came.rest)
        self._rest()
        yield from self._made()

    def _heard(self, blocks: Iterable[Block]) -> Iterator[Block]:
        """All but what stands aside; of it what is said to the operator is noted."""
        for block in blocks:
            if not isinstance(block, Aside):
                yield block
            elif not isinstance(block, OperatorMessage):
                continue
            elif (words := (block.place.line, block.text)) not in self._said and len(self._said) < MAX_SAID:
                self._said.add(words)
                self._note(block.place, message("note.says", text=block.text))

    def _made(self) -> list[PathItem]:
        made, self._items = self._items, []
        return made

    def _block(self, block: Block) -> None:
        """Anything but a cut."""
        if isinstance(block, Remark):
            self._note(block.place, block.said)
            return
        queue = next((one for one in self._queues if one.takes(block)), None)
        if self._pending.lines is not queue:
            self._lay_lines()
        if queue is not None and isinstance(block, Feed):
            self._wait(block, queue)
        elif isinstance(block, Feed) and (probe := probing_of(block)):
            self._probe(block, probe)
        elif isinstance(block, Feed) and rows.blends(block):
            self._blended(block)
        elif isinstance(block, TipLine | JointMotion):
            self._to_exact()
            self._note_blend(block)
            self._alone(block)
        elif isinstance(block, Dwell | Await | Action):
            self._pause(pause_of(block))

    def _wait(self, block: Feed, queue: LineQueue) -> None:
        """A line of which it is not known yet how it is laid."""
        self._note_blend(block)
        if queue and not queue.goes_with(block):
            self._lay_lines()
        if not queue:
            self._to_exact()
        self._pending = self._pending._replace(lines=queue)
        if queue.add(block):
            self._lay_lines(False)

    def _lay_lines(self, final: bool = True) -> None:
        """The lines that wait, exact or as rows; not ``final``: those of which it is known."""
        queue = self._pending.lines
        if queue is None:
            return
        self._pending = self._pending._replace(lines=None)
        length_mm = queue.length_mm
        try:
            for part in queue.parts(lambda: self._standing(length_mm), final):
                self._lay(part)
        except ProgramError:
            queue.forget()
            raise
        if queue:
            self._pending = self._pending._replace(lines=queue)

    def _lay(self, part: rows.Part) -> None:
        if part.laid is not None:
            chains, self._stand = part.laid
            self._at_rest(chains, self._stand.joints)
        if part.blended:
            self._note_corners(part.blocks[0].place, "note.runs_on")
        for block in part.blocks:
            if part.blended:
                self._blended(block)
            else:
                self._alone(block)
        if not part.goes_on:
            self._to_exact()

    def _alone(self, block: TipLine | JointMotion) -> None:
        """G0 to G5.2 as it stands there, exact."""
        if isinstance(block, TipLine):
            self._tool(block)
            return
        for segment in spline_moves.moves_of(block, self._context, self.now):
            self._move(segment, block.relative)

    def _probe(self, block: Feed, probe: Probing) -> None:
        """A line between two pauses: armed at rest, and at rest until it is known what came of it."""
        self._pause(Pause(block.place, block.modal, act=Act.PROBE, probe=probe))
        made = len(self._items)
        self._alone(block)
        self._rest()
        ways = [one for one in self._items[made:] if isinstance(one, ContinuousPath)]
        if not ways:
            self._context.refuse(block.place, message("probing.no_way", code=probe.code))
        tool = block.modal.tool
        self._items[made:] = [outputs.probing_way(one, probe, tool, self._context) for one in ways]
        self._pause(Pause(block.place, block.modal, act=Act.PROBE, probe=probe, ends=True))

    # ---- lines of the tool and rows of lines -----------------------------------------

    def _standing(self, length_mm: float) -> Stand:
        """The tool where the path has come to, as programmed if the last block moved it so."""
        stand = self._stand
        if stand is None or stand.joints != self.now or stand.length_mm != length_mm:
            stand = Stand.at(self.now, length_mm, self._context.kinematics)
        return stand

    def _tool(self, block: TipLine) -> None:
        """G0 or exact G1 under G43.4 or G43.5."""
        stand = self._standing(block.modal.length_mm)
        made: list[Segment] = []
        if block.feed_mm_s is None and not block.stands:
            following = self._ahead.lines_like(block) if block.axis is not None else []
            wanted = self._chosen.get(block.place.order)
            one, stand = lines.rapid(block, stand, following, wanted, self._context)
            made += [one] if one is not None else []
        else:
            made, stand = lines.exact(block, stand, self._context)
        for segment in made:
            self._move(segment, block.relative)
        self._stand = replace(stand, joints=self.now)

    def _blended(self, block: Feed) -> None:
        """A line or an arc that joins the row under G64 P, or begins one."""
        if self._pending.row is not None and not self._pending.row.takes(block):
            self._to_exact()
        row = self._pending.row
        if row is None:
            if self._pending.legs and not self._runs_on(block):
                self._rest()
            row = LineRow(block, self._standing(block.modal.length_mm), self._context)
            self._pending = self._pending._replace(row=row)
        row.add(block)
        if row.full:
            if self._pending.run and not self._pending.legs:
                self._items.append(ContinuousPath(self._pending.run))
                self._pending = self._pending._replace(run=())
            for chain in row.chains(False):
                self._items.append(self._run_off(chain, block.modal) if self._pending.legs else chain)

    def _to_exact(self) -> None:
        """A row that is under way, or cuts, come to rest; exact motions may run on."""
        row = self._pending.row
        if row is not None:
            only = self._only(row)
            self._ended(row, only, [] if only is not None else self._chains_of(row))
        elif self._pending.legs:
            self._rest()

    def _only(self, row: LineRow) -> Feed | None:
        """The block of a row of one, which stays exact unless it leads on from cuts."""
        return None if self._pending.legs else row.only

    def _ended(self, row: LineRow, only: Feed | None, chains: Sequence[ContinuousPath]) -> None:
        """A row ends at rest, or it is the single block ``only``."""
        self._pending = self._pending._replace(row=None)
        if only is not None:
            self._alone(only)
        else:
            self._at_rest(chains, row.joints)
            self._stand = replace(row.stand, joints=row.joints)

    def _chains_of(self, row: LineRow) -> list[ContinuousPath]:
        """All that is left of a row that ends, with the cuts before it where it runs on from them."""
        self._pending = self._pending._replace(row=None)
        chains = list(row.chains(True))
        if chains and self._pending.legs:
            chains[0] = self._run_off(chains[0], row.modal)
        return chains

    # ---- cuts ------------------------------------------------------------------------

    def _surfaces(self, blocks: Iterable[CutBlock]) -> None:
        """Consecutive cuts: each train of joined ones with its approach and departure."""
        if self._pending.row is None:
            self._rest()
        try:
            ready = list(auto.build(self._doubted(blocks), self._context))
        except ProgramError:
            self._to_exact()
            raise
        for members, meetings in train.trains(ready, self._context):
            if self._pending.row is None and self._context.machine.link_mm <= 0.0:
                self._rest()
            self._train(members, meetings)

    def _doubted(self, blocks: Iterable[CutBlock]) -> Iterator[CutBlock]:
        """All of them; what may be meant otherwise is noted."""
        noted = set[str]()  # of a train once
        for block in blocks:
            doubt = block.doubt if isinstance(block, CutCone | CutRuled) else None
            if doubt and doubt["key"] not in noted:
                noted.add(doubt["key"])
                self._note(block.place, doubt)
            yield block

    def _train(self, members: Sequence[cuts.Cut], meetings: Sequence[train.Meeting]) -> None:
        """The cuts of a train behind its lead in, a link from the train before, or a row that runs on."""
        begun = self._entered(members) if self._pending.row is not None else self._linked(members)
        if begun is not None:
            legs, run = begun
        else:
            self._rest()
            legs = self._legs(members, rotaries_of(self.now, self._context.kinematics))
            onto = leads.lay(legs, True, self._context)
            for chain in approach.arrive(legs, onto, self.now, self._context):
                self._chain(chain)
            run = list(onto.segments)
        run = self._cut(legs, meetings, run)
        self._pending = Pending(run[-1].end, tuple(run), legs)

    def _legs(self, members: Sequence[cuts.Cut], near: Rotaries) -> list[CutSegment]:
        return train.choose(members, self._context, near, self._chosen.get(members[0].block.place.order))

    def _linked(self, members: Sequence[cuts.Cut]) -> tuple[list[CutSegment], list[Segment]] | None:
        """The next train and the run with the link to it; None where the tool goes up between them."""
        before, run = self._pending.legs, self._pending.run
        if not before or not links.reaches(before[-1].cut, members[0], self._context.machine):
            return None
        try:
            legs = self._legs(members, before[-1].end)
        except ProgramError:  # it may be cut from where a departure leads
            return None
        link = links.lay(before, legs, self._context)
        return (legs, [*run, link]) if link is not None else None

    def _entered(self, members: Sequence[cuts.Cut]) -> tuple[list[CutSegment], list[Segment]] | None:
        """The next train and the row that leads over into it; None where the row ends at rest before it."""
        row = self._pending.row
        assert row is not None
        only, chains = self._only(row), self._chains_of(row)
        entered = None
        if chains:
            entered = line_blends.onto(chains[-1].segments[-1], row.modal, members, self._context)
        if entered is None:
            self._ended(row, only, chains)
            return None
        self._at_rest(chains[:-1], self.now)
        return entered.legs, [*chains[-1].segments[:-1], entered.row]

    def _runs_on(self, block: Feed) -> bool:
        """Whether a line or an arc leads on from the cuts under way."""
        legs, run = self._pending.legs, self._pending.run
        row = LineRow(block, self._standing(block.modal.length_mm), self._context)
        row.add(block)
        try:
            first = [segment for chain in row.chains(True) for segment in chain.segments][:1]
        except ProgramError:  # it may run from where a departure leads
            first = []
        why = line_blends.departs(legs, run, first, block.modal, self._context)
        if why:
            self._note(block.place, message("row.departs", line=run[-1].place.line, why=why))
        return why is None

    def _run_off(self, chain: ContinuousPath, modal: Modal) -> ContinuousPath:
        """The cuts under way and the row that begins at their end: blended, or at rest there."""
        legs, run = self._pending.legs, self._pending.run
        self._pending = self._pending._replace(run=(), legs=())
        first, *rest = chain.segments
        found = line_blends.off(legs, run, first, modal, self._context)
        if found is None:
            self._chain(ContinuousPath(run))
            return chain
        for segment in run:
            audit_travel(segment, self._context)
        return replace(chain, segments=(*run[:-1], found.cut, found.row, *rest))

    def _cut(
        self, legs: Sequence[CutSegment], meetings: Sequence[train.Meeting], run: list[Segment]
    ) -> list[Segment]:
        """``run`` with the cuts and the pivots between them; a swivel at a pole stands alone."""
        run.append(legs[0].segment)
        for (before, after), meeting in zip(itertools.pairwise(legs), meetings, strict=True):
            for segment in approach.between(before, after, meeting, self._context.kinematics):
                if segment.name == "swivel":
                    self._note(segment.place, poles.standing(segment, before, after, self._context.machine))
                    self._pending = Pending(self.now)  # of a train before that is linked: here it is
                    self._chain(ContinuousPath(tuple(run)))
                    self._chain(ContinuousPath((segment,)))
                    run = []
                else:
                    run.append(segment)
            run.append(after.segment)
        return run

    # ---- collecting --------------------------------------------------------------

    def _note(self, place: Place, told: Message) -> None:
        self.notes.append(Note(place, told))

    def _note_blend(self, block: Feed | JointCurve) -> None:
        if not block.modal.exact and block.feed_mm_s is not None:
            self._note_corners(block.place, "note.exact")

    def _note_corners(self, place: Place, key: str) -> None:
        """Which corners of lines are not exact, once."""
        if not self._blends_noted:
            self._blends_noted = True
            mm, degrees = self._context.machine.joint_tolerance_mm, self._context.machine.joint_tolerance_deg
            self._note(place, message(key, mm=mm, degrees=degrees))

    def _pause(self, pause: Pause) -> None:
        self._rest()
        self._items.append(pause)

    def _move(self, segment: Segment, relative: bool) -> None:
        """A segment of G0 to G5.2: at rest on both sides unless it goes on as its neighbour came."""
        audit_travel(segment, self._context, relative)
        run = self._pending.run
        rests = segment.feed_mm_s is None or segment.name == "swivel"
        if run and (rests or not lines.runs_through(run[-1], segment, self._context)):
            self._rest()
            run = ()
        if len(run) > LONGEST_CHAIN:
            self._items.append(ContinuousPath(run, runs_on=True))
            run = ()
        self._pending = Pending(segment.end, (*run, segment))
        if rests:
            self._rest()

    def _rest(self) -> None:
        """All that is under way comes to rest, cuts by their lead out and departure."""
        self._lay_lines()
        if self._pending.row is not None:
            self._to_exact()
        run, legs = self._pending.run, self._pending.legs
        self._pending = Pending(self.now)
        if legs:
            off = leads.lay(legs, False, self._context)
            self._chain(ContinuousPath((*run, *off.segments)))
            for chain in approach.depart(legs, off, self._context):
                self._chain(chain)
        elif run:
            self._items.append(ContinuousPath(run))

    def _at_rest(self, chains: Sequence[ContinuousPath], end: Joints) -> None:
        """What is under way comes to rest; so do chains that were audited as they were made."""
        self._rest()
        self._items += chains
        self._pending = Pending(end)

    def _chain(self, chain: ContinuousPath) -> None:
        for segment in chain.segments:
            audit_travel(segment, self._context)
        self._items.append(chain)
        self._pending = self._pending._replace(end=chain.segments[-1].end)


def pause_of(block: Dwell | Await | Action) -> Pause:
    """The standstill that a block asks for."""
    if isinstance(block, Dwell):
        return Pause(block.place, block.modal, seconds=block.seconds)
    if isinstance(block, Await):
        return Pause(block.place, block.modal, act=Act.INPUT, awaits=block, lifts=block.lifts)
    modal = block.modal if block.outputs is None else replace(block.modal, outputs=block.outputs)
    return Pause(block.place, modal, act=block.act, changing=block.changing, lifts=block.lifts)


def audit_travel(segment: Segment, context: Context, relative: bool = False) -> None:
    """Travel of everything that is not a cut: those were audited as their branch was chosen."""
    machine, kinematics = context.machine, context.kinematics
    if isinstance(segment.motion, ToolLine):
        rows.audit_line(segment, context)
    turns = isinstance(segment.motion, SurfaceCut) and not segment.cutting  # a pivot of placed axes
    if not isinstance(segment.motion, JointMove) and not turns:
        return
    excess = audit.outside_at(machine, segment.end)
    if excess is None and segment.name in ("arc", "curve", "lead in", "lead out", "pivot", "swivel"):
        s = np.linspace(0.0, segment.motion.end, ARC_SAMPLES)
        excess = audit.outside(machine, s, joints_along(segment, s, kinematics))
    if excess is not None:
        axis = machine.axes[excess.axis]
        where = message("travel.in", motion=motion_named(segment.name)) if segment.name != "line" else ""
        advice: Message = audit.MOVE
        if axis.is_rotary and relative:  # from another turn the same distance may fit
            a, b = segment.start[excess.axis], segment.end[excess.axis]
            advice = unwind.offer(axis, a, min(a, b), max(a, b))
        context.refuse(segment.place, audit.describe(axis, excess, where, advice))
