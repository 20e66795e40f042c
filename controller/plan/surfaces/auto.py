"""The placement ``auto``: of the others the one that leaves a block least off, and all of it.

What is compared is what the check will judge: the flank along the normals of the surface, at the ends too,
by the cuts of all smooth parts, the turns between their placements and the leads as they will be laid. What
a placement cuts too deep away from the ends no lead or turn makes good, so as a rule only the best one is
gone through whole.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from controller.geometry.arrays import Array, columns
from controller.geometry.placement import Placed, Strategy
from controller.geometry.surfaces import Surface
from controller.machine.kinematics import Kinematics
from controller.machine.model import Machine
from controller.plan.context import Context
from controller.plan.rotaries.branch import joints_along
from controller.plan.segment import Segment
from controller.plan.surfaces import approach, blending, cuts, leads, placements, train
from controller.plan.surfaces.cuts import Cut, Parts
from controller.plan.surfaces.placing import CHOSEN_FROM, Grid, as_the_paper
from controller.program.program import CutBlock, ProgramError

MIDDLE = 0.1  # of u: so far from the ends of a block nothing but its cuts counts
BESIDE = np.linspace(0.0, 1.0, 129)[1:] ** 2  # of a lead, closer where it joins the cut
TURNED = np.linspace(0.0, 1.0, 17)


def build(blocks: Iterable[CutBlock], context: Context) -> Iterator[Cut]:
    """As ``cuts.build``, for whatever placement is asked for; what joins smoothly is placed together."""
    auto = partial(_least_off, machine=context.machine, name=context.program)
    for group in cuts.placed_together(blocks, context.machine):
        yield from cuts.build(group, context, auto)


def _least_off(parts: Parts, machine: Machine, name: str) -> tuple[Surface, ...]:
    """The surfaces of a block as a check has kept them, or as they are found now; of equals the plainest."""
    row, asked = parts.row, _choice_inputs(parts, machine)
    known = row.known(Strategy.AUTO, *asked)
    if known is not None:
        return known
    ways = [row.placed(kind) for kind in CHOSEN_FROM]
    if all(way == ways[0] for way in ways):
        return ways[0]
    grids = [[Grid.of(as_the_paper(one.nominal, row.cutter)) for one in way] for way in ways]
    cut = [parts.cuts(way, machine) for way in ways]
    least = [_middle(*each) for each in zip(cut, grids, strict=True)]
    best, found = 0, np.inf
    for k in sorted(range(len(ways)), key=least.__getitem__):
        if least[k] >= found:
            break
        off = _whole(cut[k], grids[k], machine, name)
        if off < found or (off == found and k < best):
            best, found = k, off
    chosen = row.named(ways[best], Strategy.AUTO, *asked)
    placements.learn({one.name: placements.Recipe.of(one) for one in chosen})
    return chosen


def _choice_inputs(parts: Parts, machine: Machine) -> tuple[object, ...]:
    """What the choice depends on beside the surfaces: the block's joints and its leads."""
    block, joints = parts.blocks[0], blending.allowed_by(parts.blocks[0].modal, machine)
    led = machine.lead_mm, machine.lead_feed_mm_s, machine.period_s, machine.axes
    others = tuple(one.feed_mm_s for one in parts.blocks[1:])
    return block.feed_mm_s, block.modal.frame(machine), joints, led, *others


def _middle(way: Sequence[Cut], grids: Sequence[Grid]) -> float:
    """How far (mm) a block is off at least: too deep by its own cuts, or left away from its ends."""
    worst = 0.0
    for cut, grid, left in zip(way, grids, _by_cuts(way, grids), strict=True):
        inner = np.abs(cut.block_u(grid.u) - 0.5) < 0.5 - MIDDLE
        worst = max(worst, float(-left.min()), float(left.max(where=inner, initial=0.0)))
    return worst


def _whole(way: Sequence[Cut], grids: Sequence[Grid], machine: Machine, name: str) -> float:
    """How far (mm) a block is off at most; inf where it cannot be run so."""
    silent = Context.silent(machine, name)
    try:
        trains = list(train.trains(way, silent))
        beside = [poses for one in trains for poses in _beside(*one, silent)]
    except ProgramError:
        return np.inf
    way = [cut for members, _ in trains for cut in members]  # led over into each other
    left = _by_cuts(way, grids)
    for tips, axes in beside:
        for k, (cut, grid) in enumerate(zip(way, grids, strict=True)):
            left[k] = np.minimum(left[k], grid.left_by(tips, axes, cuts.flank(cut)))
    return max(float(np.abs(one).max()) for one in left)


def _by_cuts(way: Sequence[Cut], grids: Sequence[Grid]) -> list[Array]:
    """What the cuts of a block leave of each of its parts, along the normals: its own and those beside."""
    placed = [
        one.motion.surface if isinstance(one.motion.surface, Placed) else grid.single
        for one, grid in zip(way, grids, strict=True)
    ]
    return [
        np.min([grid.left(one) for one in placed[max(i - 1, 0) : i + 2]], axis=0)
        for i, grid in enumerate(grids)
    ]


def _beside(
    members: Sequence[Cut], meetings: Sequence[train.Meeting], context: Context
) -> Iterator[tuple[Array, Array]]:
    """Tips and axes (N, 3), part frame, of all but the cuts of a train: the turns between them, the leads."""
    legs = train.choose(members, context, (0.0, 0.0))
    for before, after, meeting in zip(legs[:-1], legs[1:], meetings, strict=True):
        for segment in approach.between(before, after, meeting, context.kinematics):
            yield _poses(segment, TURNED, before.cut, context.kinematics)
    warned = replace(context, machine=replace(context.machine, gouge="warn"))
    for at_start, share, cut in ((True, 1.0 - BESIDE, members[0]), (False, BESIDE, members[-1])):
        for segment in leads.lay(legs, at_start, warned).segments:
            yield _poses(segment, share, cut, context.kinematics)


def _poses(segment: Segment, share: Array, cut: Cut, kinematics: Kinematics) -> tuple[Array, Array]:
    joints = joints_along(segment, np.sort(share) * segment.motion.end, kinematics)
    pose, part = kinematics.forward([*joints.T], cut.motion.length_mm, np), cut.motion.part
    return columns(part.from_parent(pose.tip), len(joints)), columns(part.turn_back(pose.axis), len(joints))
