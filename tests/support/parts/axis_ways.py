"""The ways of the axes that lines and arcs of a program ask for, as the plan makes them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

from support.machines.traced_programs import mill

from controller.geometry.vectors import Vector, subtract
from controller.machine.model import Joints, Machine
from controller.motion.motions import JointMove
from controller.plan.context import Context
from controller.plan.lines import moves
from controller.program import blocks
from controller.program.position import Position, homed
from controller.program.program import JointArc, JointLine


class Way(NamedTuple):
    """Of one block: ``points`` from its beginning to its end, less the work offset (mm)."""

    block: JointLine | JointArc
    points: list[Vector]

    @property
    def kind(self) -> str:
        if isinstance(self.block, JointArc):
            return "arc"
        return "rapid" if self.block.feed_mm_s is None else "feed"


def fanuc_mill(**fields: Any) -> Machine:
    """A mill without a spindle that reads Fanuc's dialect."""
    return replace(mill(unset=()), **{"dialect": "fanuc", "without_point": "unit", **fields})


def ways(text: str, on: Machine, samples: int) -> list[Way]:
    """Of each line and arc, ``samples`` steps long. Raises ProgramError."""
    context, position = Context.silent(on, "p"), Position(on, homed(on))
    origin, found = on.offsets[0].origin, list[Way]()
    for block in blocks.stream(text.encode(), on, "p"):
        now: Joints = tuple(q or 0.0 for q in position.joints())
        position.take(block)
        if isinstance(block, JointArc):
            made = moves.arc(block, context, now)
        elif isinstance(block, JointLine):
            made = moves.line(block, context, now)
        else:
            continue
        if made is None or not isinstance(made.motion, JointMove):
            continue
        rows = (made.motion.curve.at(k / samples) for k in range(samples + 1))
        found.append(Way(block, [subtract((float(x), float(y), float(z)), origin) for x, y, z, *_ in rows]))
    return found
