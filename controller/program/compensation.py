"""Cutter compensation: lines and arcs between G41 D and G40 become the cutter's ways beside them.

Blocks go in as programmed and come out as they are cut, each with the line that it stems from. One line
or arc is held back until the next one says where its way ends (``contour.corners``), and with it what
stands between the two: functions, dwells, messages, moves along the normal of the plane. All else passes.

The position of the reader follows the program, not the cutter: distances (G91) count from there, as in
LinuxCNC, and so do parameters. So the first move after G40 is given all axes of the plane.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

from controller.machine.model import Machine
from controller.messages import message
from controller.program.compensated import MOTIONS, Cutter, Held, NotBesideError, to_end
from controller.program.line import CommonRun
from controller.program.motion_words import PLANES
from controller.program.position import Position
from controller.program.program import (
    Block,
    CutCone,
    CutNurbs,
    CutRuled,
    JointArc,
    Modal,
    Place,
    Planar,
    ProgramError,
    TipLine,
)

MAX_HELD = 1000  # blocks behind a G41 before it is decided


def beside(
    lines: Iterable[CommonRun | Sequence[Block]],
    position: Position,
    machine: Machine,
    name: str,
    refused: list[ProgramError] | None = None,
) -> Iterator[Sequence[Block]]:
    """The blocks of ``lines`` as they are cut; ``position`` takes them as they are programmed.

    Raises ProgramError; with ``refused`` it is noted there, and the contour left uncompensated.
    """
    path = _Path(machine, position)
    for line in lines:
        blocks = line.blocks if isinstance(line, CommonRun) else line
        if isinstance(line, CommonRun) and path.rests and blocks[0].modal.planar is None:
            position.take_run(line)
            yield blocks
            continue
        for block in blocks:
            if block.modal.planar is None and path.rests:
                position.take(block)
                yield (block,)
                continue
            try:
                for made in path.take(block):
                    yield (made,)
            except NotBesideError as error:
                _refuse(error, name, refused)
                path.give_up(block.modal.planar)
    try:
        for made in path.finish():
            yield (made,)
    except NotBesideError as error:
        _refuse(error, name, refused)


def _refuse(error: NotBesideError, name: str, refused: list[ProgramError] | None) -> None:
    wrong = error.place.refusal(name, error.said)
    if refused is None:
        raise wrong from None
    refused.append(wrong)


class _Path:
    """What is on: nothing, a G41 that waits for what comes first, or a cutter beside a contour."""

    def __init__(self, machine: Machine, position: Position) -> None:
        self._machine, self._position = machine, position
        self._undecided: list[Held] = []
        self._cutter: Cutter | None = None
        self._left_out: Planar | None = None  # a G41 that was refused
        self._passed: Place | None = None  # of a G41 behind which too much came before it was decided
        self._last: tuple[Modal, Modal] | None = None  # with compensation, and without
        self._owed: str = ""  # the plane in which the cutter still stands beside its programmed place

    @property
    def rests(self) -> bool:
        return self._cutter is None and not self._owed and not self._undecided

    def give_up(self, planar: Planar | None) -> None:
        self._cutter, self._owed, self._left_out = None, "", planar
        self._undecided.clear()

    def take(self, block: Block) -> Iterator[Block]:
        """What is cut for a block, as far as it is known."""
        held = self._held(block)
        planar = block.modal.planar
        if planar is None or (self._left_out is not None and planar.place == self._left_out.place):
            yield from self._without(held)
        elif planar.lines:
            yield from self._along(held, planar)
        elif len(self._undecided) < MAX_HELD and planar.place != self._passed:
            self._undecided.append(held)
        else:
            self._passed = planar.place
            yield from self._without(held)

    def finish(self) -> Iterator[Block]:
        """What is held at the end of the program."""
        yield from self._ended()
        for held in self._undecided:
            yield self._plain(held.block)

    # ---- with and without ------------------------------------------------------------

    def _held(self, block: Block) -> Held:
        """A block, with where it begins and ends as programmed."""
        if not isinstance(block, MOTIONS):
            self._position.take(block)
            return Held(block)
        before = self._position.in_frame(block.modal)
        self._position.take(block)
        after = self._position.in_frame(block.modal)
        return Held(block, before, after, tuple(self._position.joints()))

    def _without(self, held: Held) -> Iterator[Block]:
        yield from self._ended()
        for waiting in self._undecided:
            yield self._plain(waiting.block)
        self._undecided.clear()
        yield self._plain(self._led_out(held) if self._owed else held.block)

    def _along(self, held: Held, planar: Planar) -> Iterator[Block]:
        if self._cutter is None or self._cutter.planar.place != planar.place:
            yield from self._ended()
            self._check_begin(held, planar)
            self._cutter = Cutter(planar, held.block.modal, self._machine)
        waiting, self._undecided = self._undecided, []
        for one in (*waiting, held):
            for block in self._cutter.take(one):
                yield self._plain(block)

    def _check_begin(self, held: Held, planar: Planar) -> None:
        if planar.place == self._passed:
            why = message("beside.late", code=planar.code, line=planar.place.line, most=MAX_HELD)
            raise NotBesideError(held.block.place, why)
        if self._owed not in ("", held.block.modal.plane):
            planes = {"plane": held.block.modal.plane, "owed": self._owed}
            why = message("beside.owed", code=planar.code, line=planar.place.line, **planes)
            raise NotBesideError(held.block.place, why)

    def _ended(self) -> Iterator[Block]:
        """The last way, as far as its own end."""
        if self._cutter is not None:
            cutter, self._cutter = self._cutter, None
            yield from (self._plain(block) for block in cutter.finish())
            self._owed = cutter.plane if cutter.begun else self._owed

    def _plain(self, block: Block) -> Block:
        """A block without the compensation that has been done; blocks share their modal state."""
        if block.modal.planar is None:
            return block
        if self._last is None or self._last[0] is not block.modal:
            planar = block.modal.planar
            beside_mm = planar.off_mm if planar.lines else 0.0
            self._last = block.modal, replace(block.modal, planar=None, beside_mm=beside_mm)
        return replace(block, modal=self._last[1])

    # ---- after G40 -------------------------------------------------------------------

    def _led_out(self, held: Held) -> Block:
        """A block after G40: the first move in the plane goes from beside the contour to its own end."""
        block = held.block
        if isinstance(block, CutCone | CutRuled | CutNurbs):
            self._owed = ""
        if not isinstance(block, MOTIONS):
            return block
        axes = PLANES[self._owed][:2]
        linear = self._machine.linear()
        words = block.tip if isinstance(block, TipLine) else [block.targets[i] for i in linear]
        if all(words[axis] is None for axis in axes) and not isinstance(block, JointArc):
            return block  # a whole circle has no words of the plane
        self._owed = ""
        if isinstance(block, JointArc):
            raise NotBesideError(block.place, message("beside.arc_behind"))
        return to_end(held, axes, self._machine)
