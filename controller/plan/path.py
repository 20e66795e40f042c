"""The way of a whole program: blocks in, chains of motion out, every joint audited.

    blocks -> moves (G0 to G3), or trains of cuts (G51, G52) with approach and departure
           -> chains that run through, pauses where the machine stands

Nothing here knows of time: ``limits`` and ``profile`` put the motion law on each chain.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from controller.kinematics import Kinematics
from controller.machine import Joints, Machine
from controller.motions import JointMove
from controller.plan import approach, audit, cuts, moves, train
from controller.plan.branch import BranchLost, joints_along
from controller.plan.program import (
    Action,
    Block,
    CutCone,
    CutRuled,
    Dwell,
    JointArc,
    JointLine,
    Place,
    Program,
)
from controller.plan.stretch import Chain, Note, Path, Pause, Stretch, Voice, rotaries_of

__all__ = ["BranchLost", "Chain", "Note", "Path", "Pause", "Stretch", "joints_along", "trace"]

ARC_SAMPLES = 181
SWIVEL = "Stops at the pole between two blocks and turns the rotary axis under the standing tool."


def trace(program: Program, machine: Machine, kinematics: Kinematics, start: Joints) -> Path:
    """The path of ``program`` from the joints ``start`` (mm, rad); nothing moves by it.

    Raises ProgramError with file, line, column and a sentence for the first block that
    cannot be run: surface, gouge, corner, travel, branch or arc.
    """
    tracer = _Tracer(program, machine, kinematics, start)
    for is_cut, group in itertools.groupby(program.blocks, lambda b: isinstance(b, CutCone | CutRuled)):
        if is_cut:
            tracer.surfaces(block for block in group if isinstance(block, CutCone | CutRuled))
        else:
            for block in group:
                tracer.block(block)
    path = tracer.path()
    if program.blocks and not path.items:  # every move ends where it starts: a run of no length
        path = replace(path, items=(Pause(program.blocks[-1].place, program.blocks[-1].modal),))
    return path


class _Tracer:
    """Collects the path block by block; ``now`` are the joints where it has come to."""

    def __init__(self, program: Program, machine: Machine, kinematics: Kinematics, start: Joints) -> None:
        self._machine, self._kinematics = machine, kinematics
        self._voice = Voice(program.name, self._note)
        self._items: list[Chain | Pause] = []
        self._notes: list[Note] = []
        self._run: list[Stretch] = []  # feed moves that still run through
        self._blends_noted = False
        self.now = start

    def path(self) -> Path:
        self._rest()
        return Path(tuple(self._items), tuple(self._notes), self.now)

    def block(self, block: Block) -> None:
        """Anything but a cut."""
        if isinstance(block, Dwell):
            self._pause(Pause(block.place, block.modal, seconds=block.seconds))
        elif isinstance(block, Action):
            self._pause(Pause(block.place, block.modal, act=block.act))
        elif isinstance(block, JointLine):
            self._note_blend(block)
            self._move(moves.line(block, self._machine, self._kinematics, self.now))
        elif isinstance(block, JointArc):
            self._note_blend(block)
            self._move(moves.arc(block, self._machine, self._kinematics, self.now, self._voice))

    def surfaces(self, blocks: Iterable[CutCone | CutRuled]) -> None:
        """Consecutive cuts: each train of joined ones with its approach and departure."""
        self._rest()
        ready = []
        for block in blocks:
            self._note_blend(block)
            ready.append(cuts.build(block, self._machine, self._voice))
        for members, meetings in _trains(ready, self._voice):
            self._train(members, meetings)

    def _train(self, members: Sequence[cuts.Cut], meetings: Sequence[train.Meeting]) -> None:
        machine, kinematics = self._machine, self._kinematics
        near = rotaries_of(self.now, kinematics)
        legs = train.choose(members, machine, kinematics, near, self._voice)
        onto = approach.lead_in(legs[0], machine, kinematics)
        off = approach.lead_out(legs[-1], machine, kinematics)
        approach.audit_lead(onto, legs, True, machine, self._voice)
        approach.audit_lead(off, legs, False, machine, self._voice)
        for chain in approach.arrive(legs, self.now, machine, kinematics):
            self._chain(chain)
        for chain in self._cutting(legs, meetings, onto, off):
            self._chain(chain)
        for chain in approach.depart(legs, machine, kinematics):
            self._chain(chain)

    def _cutting(
        self,
        legs: Sequence[train.Leg],
        meetings: Sequence[train.Meeting],
        onto: approach.Lead,
        off: approach.Lead,
    ) -> Iterator[Chain]:
        """Lead in, cuts with the pivots between them, lead out; a swivel at a pole stands alone."""
        run = [*onto.stretches, approach.cut_stretch(legs[0])]
        for (before, after), meeting in zip(itertools.pairwise(legs), meetings, strict=True):
            for stretch in approach.between(before, after, meeting, self._kinematics):
                if stretch.name == "swivel":
                    self._note(stretch.place, SWIVEL)
                    yield Chain(tuple(run))
                    yield Chain((stretch,))
                    run = []
                else:
                    run.append(stretch)
            run.append(approach.cut_stretch(after))
        yield Chain((*run, *off.stretches))

    # ---- collecting --------------------------------------------------------------

    def _note(self, place: Place, sentence: str) -> None:
        self._notes.append(Note(place, sentence))

    def _note_blend(self, block: JointLine | JointArc | CutCone | CutRuled) -> None:
        if not block.modal.exact and not self._blends_noted:
            self._blends_noted = True
            self._note(block.place, "G64 is run as G61: the path is followed exactly and not blended.")

    def _pause(self, pause: Pause) -> None:
        self._rest()
        self._items.append(pause)

    def _move(self, stretch: Stretch | None) -> None:
        """A stretch of G0 to G3: at rest on both sides unless it goes on as its neighbour came."""
        if stretch is None:
            return
        self._audit(stretch)
        rapid = stretch.feed_mm_s is None
        if self._run and (rapid or not moves.runs_through(self._run[-1], stretch)):
            self._rest()
        self._run.append(stretch)
        self.now = stretch.end
        if rapid:
            self._rest()

    def _rest(self) -> None:
        if self._run:
            self._items.append(Chain(tuple(self._run)))
            self._run = []

    def _chain(self, chain: Chain) -> None:
        for stretch in chain.stretches:
            self._audit(stretch)
        self._items.append(chain)
        self.now = chain.stretches[-1].end

    def _audit(self, stretch: Stretch) -> None:
        """Travel of everything that is not a cut: those were audited as their branch was chosen."""
        if not isinstance(stretch.motion, JointMove):
            return
        excess = audit.outside_at(self._machine, stretch.end)
        if excess is None and stretch.name in ("arc", "lead in", "lead out", "pivot", "swivel"):
            s = np.linspace(0.0, stretch.motion.end, ARC_SAMPLES)
            excess = audit.outside(self._machine, s, joints_along(stretch, s, self._kinematics))
        if excess is not None:
            axis = self._machine.axes[excess.axis]
            where = f" in the {stretch.name}" if stretch.name != "line" else ""
            self._voice.refuse(stretch.place, audit.describe(axis, excess, where))


def _trains(ready: Sequence[cuts.Cut], voice: Voice) -> Iterator[tuple[list[cuts.Cut], list[train.Meeting]]]:
    """Rows of cuts that run through, with how each follows the one before."""
    members, meetings = [ready[0]], list[train.Meeting]()
    for before, after in itertools.pairwise(ready):
        meeting = train.meet(before, after, voice)
        if meeting is train.Meeting.APART:
            yield members, meetings
            members, meetings = [after], []
        else:
            members.append(after)
            meetings.append(meeting)
    yield members, meetings
