"""Clamps: opened before an axis moves, closed when it has, both at rest and waited for.

A clamp may stay closed through a chain only if the chain is known whole and does not
move its axis. An endless row of lines comes in parts, so it opens them all.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from controller.machine.kinematics import Kinematics
from controller.machine.model import Machine
from controller.motion.motions import JointMove
from controller.plan.rotaries.branch import joints_along
from controller.plan.segment import ContinuousPath, PathItem, Pause, Segment
from controller.program import modal
from controller.program.program import Act

SAMPLES = 33
MOVES = 1e-7  # mm or rad: less is no motion, but rounding
CLOSING = (Act.STOP, Act.OPTIONAL_STOP, Act.TOOL, Act.END)  # somebody may reach into the machine


def opened(items: Iterable[PathItem], machine: Machine, kinematics: Kinematics) -> Iterator[PathItem]:
    """The path with a pause wherever other clamps are to be open than before."""
    clamped = [i for i, axis in enumerate(machine.axes) if axis.clamp is not None]
    if not clamped:
        yield from items
        return
    state, is_open, runs_on = modal.power_on().modal, 0, False
    for item in items:
        if isinstance(item, Pause):
            if is_open and item.act in CLOSING:
                is_open = 0
                yield Pause(item.place, state, act=Act.CLAMP)
            state, runs_on = item.modal, False
            yield replace(item, open_clamps=is_open)
            continue
        wanted = _moved(item, clamped, kinematics)
        if not runs_on and wanted != is_open:
            yield Pause(item.place, state, act=Act.CLAMP, open_clamps=wanted)
            is_open = wanted
        runs_on = item.runs_on
        yield item


def _moved(chain: ContinuousPath, clamped: list[int], kinematics: Kinematics) -> int:
    """Bits of the clamped axes that the chain moves, or may move."""
    if chain.runs_on:
        return sum(1 << i for i in clamped)
    return sum(1 << i for i in clamped if any(_moves(s, i, kinematics) for s in chain.segments))


def _moves(segment: Segment, axis: int, kinematics: Kinematics) -> bool:
    if abs(segment.end[axis] - segment.start[axis]) > MOVES:
        return True
    if isinstance(segment.motion, JointMove) and kinematics.order[axis] >= 3:
        return False  # rotaries turn evenly from start to end
    q = joints_along(segment, np.linspace(0.0, segment.motion.end, SAMPLES), kinematics)[:, axis]
    return float(np.ptp(q)) > MOVES
