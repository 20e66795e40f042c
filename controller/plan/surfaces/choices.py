"""What a whole program asks of the rotaries, and the choice of branch and turns for all of it.

A pass of its own over the blocks, before the path: the path then needs only the small
mapping it returns, and can be read block by block.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import groupby

from controller.machine.kinematics import Kinematics
from controller.machine.model import Joints, Machine
from controller.motion.motions import Rotaries
from controller.plan.context import Context
from controller.plan.rotaries import winding
from controller.plan.rotaries.winding import Row, Turned, Way
from controller.plan.segment import rotaries_of
from controller.plan.surfaces import auto, cuts, legs, train
from controller.program.program import Aside, Block, CutBlock, JointMotion, ProgramError, TipLine


def choices(
    blocks: Iterable[Block], machine: Machine, kinematics: Kinematics, start: Joints, name: str
) -> dict[int, Rotaries]:
    """Rotaries (rad) at the start of each train of cuts, by the order of its first block (``Place.order``).

    The least time of the cuts, then the least rotary travel over the whole program from the joints ``start``,
    all joints inside travel. A program that is refused somewhere gives the choices up to there.
    """
    steps = _steps(blocks, Context.silent(machine, name, kinematics))
    return winding.choose(steps, rotaries_of(start, kinematics), machine)


def _steps(blocks: Iterable[Block], context: Context) -> Iterator[Row | Turned]:
    try:
        for is_cut, group in groupby(_moving(blocks), lambda block: isinstance(block, CutBlock)):
            if is_cut:
                row = (block for block in group if isinstance(block, CutBlock))
                yield from _rows(row, context)
            else:
                yield from _moves(group, context.machine)
    except ProgramError:  # the path comes to it and refuses it with all that it knows
        return


def _moving(blocks: Iterable[Block]) -> Iterator[Block]:
    """What stands aside parts no surfaces."""
    return (block for block in blocks if not isinstance(block, Aside))


def _rows(blocks: Iterable[CutBlock], context: Context) -> Iterator[Row]:
    ready = list(auto.build(blocks, context))
    for members, _ in train.trains(ready, context):
        yield Row(members[0].block.place.order, _ways(members, context))


def _ways(members: Sequence[cuts.Cut], context: Context) -> Callable[[Rotaries], Sequence[Way]]:
    """The branches of a train; followed once, unless they depend on where the rotaries stand."""
    fields = legs.Fields(members, context.kinematics)
    known: list[Way] = []

    def ways(near: Rotaries) -> Sequence[Way]:
        if known and not fields.free:
            return known
        try:
            options = legs.timed(legs.options(fields, context, near), context)
        except ProgramError:
            return []
        known[:] = [option.way for option in options]
        return tuple(known)

    return ways


def _moves(blocks: Iterable[Block], machine: Machine) -> Iterator[Turned]:
    for block in blocks:
        if isinstance(block, JointMotion):
            to = machine.pair(block.targets, None)
            if to != (None, None):
                yield Turned(to, block.relative)
        elif isinstance(block, TipLine) and block.rotaries != (None, None):
            yield Turned(block.rotaries, block.relative)
