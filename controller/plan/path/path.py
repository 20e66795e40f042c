"""The way of a whole program: blocks in, chains of motion out, every joint audited.

    blocks -> moves (G0 to G3), tool lines and rows of lines (G43.4, G43.5, G64 P), or trains
              of cuts (G51, G52, G6.2) with approach and departure
           -> chains that run through, pauses where the machine stands

Nothing here knows of time: ``limits`` and ``profile`` put the motion law on each chain.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from controller.machine.kinematics import Kinematics
from controller.machine.model import Joints, Machine
from controller.messages import Message, message
from controller.motion.motions import JointMove, Rotaries, SurfaceCut, ToolLine
from controller.plan.context import Context
from controller.plan.lines import exact_rows, lines, meant, moves, rows, spline_moves
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
    JointLine,
    JointMotion,
    Modal,
    Place,
    Probing,
    Program,
    ProgramError,
    Remark,
    Select,
    Setting,
    TipLine,
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


class _Way(NamedTuple):
    """Cuts under way: the next train may follow without a retract."""

    legs: Sequence[CutSegment]
    run: list[Segment]  # of the chain that they end in


class PathBuilder:
    """Makes the path block by block; ``now`` are the joints where it has come to, ``notes`` what to tell."""

    def __init__(
        self,
        name: str,
        machine: Machine,
        kinematics: Kinematics,
        start: Joints,
        chosen: Mapping[int, Rotaries],
    ) -> None:
        self._chosen = chosen  # rotaries at the start of a train, by the order of its first block
        self._context = context = Context(machine, kinematics, name, self._note)
        self._items: list[PathItem] = []  # not given away yet
        self._ahead = Ahead(iter(()))
        self.notes: list[Note] = []
        self._row: LineRow | None = None  # of lines and arcs under G64 P, or of lines that run on
        self._waiting = meant.Waiting(context)
        self._exact_lines = exact_rows.ExactLines(context)
        self._stand: Stand | None = None  # of the tool after the last block of G43.4 or G43.5
        self._run: list[Segment] = []  # feed moves that still run through
        self._blends_noted = False
        self._way: _Way | None = None  # cuts that are not left yet
        self._said: set[tuple[int, str]] = set()  # line and message that were noted
        self.now = start

    def items(self, blocks: Iterable[Block]) -> Iterator[PathItem]:
        """The path of all blocks, as it is made; before a block that is refused comes all that is sound."""
        switched = Switched(self._context.machine)
        items = switched.laid(self._sound_items(switched.read(blocks)))
        return clamps.opened(items, self._context.machine, self._context.kinematics)

    def _sound_items(self, blocks: Iterable[Block]) -> Iterator[PathItem]:
        try:
            yield from self._items_of(blocks)
        except ProgramError as error:
            first = error
            try:
                self._lay_all()
            except ProgramError as before:
                first = before
            self._leave()
            self._rest()
            yield from self._made()
            raise first from None

    def _items_of(self, blocks: Iterable[Block]) -> Iterator[PathItem]:
        self._ahead = Ahead(self._heard(blocks))
        for is_cut, group in itertools.groupby(self._ahead, lambda b: isinstance(b, CutBlock)):
            if is_cut:
                self._lay_all()
                self._surfaces(block for block in group if isinstance(block, CutBlock))
                yield from self._made()
                continue
            for block in group:
                self._block(block)
                if self._items:
                    yield from self._made()
                if isinstance(block, meant.Line) and block.probe and block.probe.came:
                    self.now = block.probe.came.rest
        self._lay_all()
        self._end_row()
        self._rest()
        yield from self._made()

    def _heard(self, blocks: Iterable[Block]) -> Iterator[Block]:
        """All but what stands aside; of it what is said to the operator is noted."""
        for block in blocks:
            if not isinstance(block, Aside):
                yield block
            elif isinstance(block, Setting | Select):
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
        if meant.may_run_on(block, self._context.machine):
            self._lay_exact_lines(True)
            self._wait(block)
            return
        self._lay_waiting(True)
        blended = block if isinstance(block, Feed) and rows.blends(block) else None
        if blended is None and self._exact_lines.takes(block):
            self._collect(block)
            return
        self._lay_exact_lines(True)
        if isinstance(block, meant.Line) and block.probe is not None:
            self._end_row()
            self._probe(block, block.probe)
            return
        if blended is not None:
            self._blended(blended)
            return
        self._end_row()
        if isinstance(block, Dwell):
            self._pause(Pause(block.place, block.modal, seconds=block.seconds))
        elif isinstance(block, Await):
            self._pause(Pause(block.place, block.modal, act=Act.INPUT, awaits=block, lifts=block.lifts))
        elif isinstance(block, Action):
            modal = block.modal if block.outputs is None else replace(block.modal, outputs=block.outputs)
            act, changing, lifts = block.act, block.changing, block.lifts
            self._pause(Pause(block.place, modal, act=act, changing=changing, lifts=lifts))
        elif isinstance(block, TipLine | JointMotion):
            self._note_blend(block)
            self._alone(block)

    def _alone(self, block: TipLine | JointMotion) -> None:
        """G0 to G5.2 as it stands there."""
        if isinstance(block, TipLine):
            self._tool(block)
        else:
            self._exact(block)

    def _exact(self, block: JointMotion) -> None:
        """G0 to G5.2 without a tool-centre mode, as it stands there."""
        made: Sequence[Segment | None]
        if isinstance(block, JointCurve):
            made = spline_moves.segments(block, self._context, self.now)
        elif isinstance(block, JointLine):
            made = [moves.line(block, self._context, self.now)]
        else:
            made = [moves.arc(block, self._context, self.now)]
        for segment in made:
            self._move(segment, block.relative)

    def _probe(self, block: JointLine | TipLine, probe: Probing) -> None:
        """A line between two pauses: armed at rest, and at rest until it is known what came of it."""
        self._pause(Pause(block.place, block.modal, act=Act.PROBE, probe=probe))
        made = len(self._items)
        self._alone(block)
        self._rest()
        ways = [one for one in self._items[made:] if isinstance(one, ContinuousPath)]
        if not ways:
            self._context.refuse(block.place, message("probing.no_way", code=probe.code))
        self._items[made:] = [
            outputs.probing_way(one, probe, block.modal.tool, self._context) for one in ways
        ]
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
            if segment.name == "swivel":
                self._rest()
            self._move(segment, block.relative)
            if segment.name == "swivel":
                self._rest()
        self._stand = replace(stand, joints=self.now)

    def _wait(self, block: meant.Line) -> None:
        """A line of which is not known yet whether it is run on from."""
        self._note_blend(block)
        if not self._waiting.takes(block):
            self._lay_waiting(True)
        if self._waiting.modal is None:
            self._end_row()
        if self._waiting.add(block):
            self._lay_waiting(False)

    def _lay_waiting(self, final: bool) -> None:
        """The lines that wait, exact or as rows; not ``final``: those of which it is known."""
        modal = self._waiting.modal
        if modal is None:
            return
        try:
            for run in self._waiting.runs(self._standing(modal.length_mm), final):
                if run.blended:
                    self._note_corners(run.blocks[0].place, "note.runs_on")
                for block in run.blocks:
                    if run.blended:
                        self._blended(block)
                    else:
                        self._alone(block)
                if not run.goes_on:
                    self._end_row()
        except ProgramError:
            self._waiting.forget()
            raise

    def _collect(self, block: TipLine) -> None:
        """An exact line of which is not known yet whether it stands in a row of short ones."""
        self._note_blend(block)
        if not self._exact_lines.goes_with(block):
            self._lay_exact_lines(True)
        if not self._exact_lines:
            self._end_row()
        if self._exact_lines.add(block):
            self._lay_exact_lines(False)

    def _lay_exact_lines(self, final: bool) -> None:
        """The exact lines that wait, alone or as rows; not ``final``: those of which it is known."""
        if not self._exact_lines:
            return
        length_mm = self._exact_lines.length_mm
        for part in self._exact_lines.parts(lambda: self._standing(length_mm), final):
            if isinstance(part, exact_rows.Laid):
                self._rest()
                self._items += part.chains
                self.now, self._stand = part.stand.joints, part.stand
            else:
                for block in part:
                    self._alone(block)

    def _lay_all(self) -> None:
        """All lines that wait; those of one kind only do."""
        self._lay_waiting(True)
        self._lay_exact_lines(True)

    def _blended(self, block: Feed) -> None:
        """A line or an arc that joins the row under G64 P, or begins one."""
        if self._row is not None and not self._row.takes(block):
            self._end_row()
        if self._row is None:
            if not self._runs_on(block):
                self._leave()
            stand = self._standing(block.modal.length_mm)
            self._row = LineRow(block, stand, self._context)
        self._row.add(block)
        if self._row.full:
            self._rest()
            for chain in self._row.chains(False):
                self._items.append(self._run_off(chain, block.modal) if self._way is not None else chain)

    def _end_row(self) -> None:
        """What is under way comes to rest: a row of lines, or cuts."""
        row, self._row = self._row, None
        if row is None:
            self._leave()
            return
        only = row.only if self._way is None else None
        self._ended(row, only, [] if only is not None else self._chains_of(row))

    def _ended(self, row: LineRow, only: Feed | None, chains: Sequence[ContinuousPath]) -> None:
        """A row that ends at rest; one that is but a single block, ``only``, stays exact."""
        if only is not None:
            self._alone(only)
        else:
            self._rest()
            self._items += chains
            self.now = row.joints
            self._stand = replace(row.stand, joints=self.now)

    def _chains_of(self, row: LineRow) -> list[ContinuousPath]:
        """All that is left of a row that ends, with the cuts before it where it runs on from them."""
        chains = list(row.chains(True))
        if chains and self._way is not None:
            chains[0] = self._run_off(chains[0], row.modal)
        return chains

    # ---- cuts ------------------------------------------------------------------------

    def _surfaces(self, blocks: Iterable[CutBlock]) -> None:
        """Consecutive cuts: each train of joined ones with its approach and departure."""
        if self._row is None:
            self._leave()
            self._rest()
        try:
            ready = self._built(blocks)
        except ProgramError:
            self._end_row()
            raise
        for members, meetings in train.trains(ready, self._context):
            if self._row is None and self._context.machine.link_mm <= 0.0:
                self._leave()
            self._train(members, meetings)

    def _built(self, blocks: Iterable[CutBlock]) -> list[cuts.Cut]:
        ready: list[cuts.Cut] = []
        told: set[str] = set()  # of a train once
        for block in blocks:
            doubt = block.doubt if isinstance(block, CutCone | CutRuled) else None
            if doubt and doubt["key"] not in told:
                told.add(doubt["key"])
                self._note(block.place, doubt)
            ready += auto.build(block, self._context)
        return ready

    def _train(self, members: Sequence[cuts.Cut], meetings: Sequence[train.Meeting]) -> None:
        """The cuts of a train behind its lead in, a link from the train before, or a row that runs on."""
        begun = self._entered(members) if self._row is not None else self._linked(members)
        if begun is not None:
            legs, run = begun
        else:
            self._leave()
            legs = self._legs(members, rotaries_of(self.now, self._context.kinematics))
            onto = leads.lay(legs, True, self._context)
            for chain in approach.arrive(legs, onto, self.now, self._context):
                self._chain(chain)
            run = list(onto.segments)
        self._way = _Way(legs, self._cut(legs, meetings, run))

    def _legs(self, members: Sequence[cuts.Cut], near: Rotaries) -> list[CutSegment]:
        wanted = self._chosen.get(members[0].block.place.order)
        return train.choose(members, self._context, near, wanted)

    def _linked(self, members: Sequence[cuts.Cut]) -> tuple[list[CutSegment], list[Segment]] | None:
        """The next train and the run with the link to it; None where the tool goes up between them."""
        if self._way is None:
            return None
        before, run = self._way
        if not links.reaches(before[-1].cut, members[0], self._context.machine):
            return None
        try:
            legs = self._legs(members, before[-1].end)
        except ProgramError:  # it may be cut from where a departure leads
            return None
        link = links.lay(before, legs, self._context)
        return (legs, [*run, link]) if link is not None else None

    def _entered(self, members: Sequence[cuts.Cut]) -> tuple[list[CutSegment], list[Segment]] | None:
        """The next train and the row that leads over into it; None where the row ends at rest before it."""
        row, self._row = self._row, None
        assert row is not None
        only, chains = row.only if self._way is None else None, self._chains_of(row)
        entered = None
        if chains:
            last = chains[-1].segments[-1]
            entered = line_blends.onto(last, row.modal, members, self._context)
        if entered is None:
            self._ended(row, only, chains)
            self._rest()
            return None
        self._rest()
        self._items += chains[:-1]
        return entered.legs, [*chains[-1].segments[:-1], entered.row]

    def _runs_on(self, block: Feed) -> bool:
        """Whether a line or an arc leads on from the cuts under way; then the path has come to their end."""
        way = self._way
        if way is None:
            return False
        before, self.now = self.now, way.run[-1].end
        row = LineRow(block, self._standing(block.modal.length_mm), self._context)
        row.add(block)
        try:
            first = [segment for chain in row.chains(True) for segment in chain.segments][:1]
        except ProgramError:  # it may run from where a departure leads
            first = []
        why = line_blends.departs(way.legs, way.run, first, block.modal, self._context)
        if why is None:
            return True
        self.now = before
        if why:
            self._note(block.place, message("row.departs", line=way.run[-1].place.line, why=why))
        return False

    def _run_off(self, chain: ContinuousPath, modal: Modal) -> ContinuousPath:
        """The cuts under way and the row that begins at their end: blended, or at rest there."""
        assert self._way is not None
        (legs, run), self._way = self._way, None
        first, *rest = chain.segments
        found = line_blends.off(legs, run, first, modal, self._context)
        if found is None:
            self._chain(ContinuousPath(tuple(run)))
            return chain
        for segment in run:
            self._audit(segment)
        return replace(chain, segments=(*run[:-1], found.cut, found.row, *rest))

    def _leave(self) -> None:
        """The end of the cuts that are under way, lead out and departure."""
        if self._way is None:
            return
        (legs, run), self._way = self._way, None
        off = leads.lay(legs, False, self._context)
        self._chain(ContinuousPath((*run, *off.segments)))
        for chain in approach.depart(legs, off, self._context):
            self._chain(chain)

    def _cut(
        self, legs: Sequence[CutSegment], meetings: Sequence[train.Meeting], run: list[Segment]
    ) -> list[Segment]:
        """``run`` with the cuts and the pivots between them; a swivel at a pole stands alone."""
        run.append(legs[0].segment)
        for (before, after), meeting in zip(itertools.pairwise(legs), meetings, strict=True):
            for segment in approach.between(before, after, meeting, self._context.kinematics):
                if segment.name == "swivel":
                    self._note(segment.place, poles.standing(segment, before, after, self._context.machine))
                    self._way = None  # of a train before that is linked: here it is
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

    def _move(self, segment: Segment | None, relative: bool) -> None:
        """A segment of G0 to G3: at rest on both sides unless it goes on as its neighbour came."""
        if segment is None:
            return
        self._audit(segment, relative)
        rapid = segment.feed_mm_s is None
        if self._run and (rapid or not self._runs_through(self._run[-1], segment)):
            self._rest()
        if len(self._run) > LONGEST_CHAIN:
            self._items.append(ContinuousPath(tuple(self._run), runs_on=True))
            self._run = []
        self._run.append(segment)
        self.now = segment.end
        if rapid:
            self._rest()

    def _runs_through(self, before: Segment, after: Segment) -> bool:
        return moves.runs_through(before, after) or lines.runs_through(before, after, self._context)

    def _rest(self) -> None:
        if self._run:
            self._items.append(ContinuousPath(tuple(self._run)))
            self._run = []

    def _chain(self, chain: ContinuousPath) -> None:
        for segment in chain.segments:
            self._audit(segment)
        self._items.append(chain)
        self.now = chain.segments[-1].end

    def _audit(self, segment: Segment, relative: bool = False) -> None:
        """Travel of everything that is not a cut: those were audited as their branch was chosen."""
        if isinstance(segment.motion, ToolLine):
            rows.audit_line(segment, self._context)
        turns = isinstance(segment.motion, SurfaceCut) and not segment.cutting  # a pivot of placed axes
        if not isinstance(segment.motion, JointMove) and not turns:
            return
        excess = audit.outside_at(self._context.machine, segment.end)
        if excess is None and segment.name in ("arc", "curve", "lead in", "lead out", "pivot", "swivel"):
            s = np.linspace(0.0, segment.motion.end, ARC_SAMPLES)
            excess = audit.outside(
                self._context.machine, s, joints_along(segment, s, self._context.kinematics)
            )
        if excess is not None:
            axis = self._context.machine.axes[excess.axis]
            where = message("travel.in", motion=motion_named(segment.name)) if segment.name != "line" else ""
            advice: Message = audit.MOVE
            if axis.is_rotary and relative:  # from another turn the same distance may fit
                a, b = segment.start[excess.axis], segment.end[excess.axis]
                advice = unwind.offer(axis, a, min(a, b), max(a, b))
            self._context.refuse(segment.place, audit.describe(axis, excess, where, advice))
