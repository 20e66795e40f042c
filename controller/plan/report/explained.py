"""What a program asks for, motion by motion: positions, feeds and the state they stand in.

This is the reader's own view, for people and for the comparison with other interpreters. Positions
are known as far as the text tells them: behind a surface the departure is the path's choice, under
tool vectors the rotaries are; there a value is None until the program says it again.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from controller.geometry.curves import Arc
from controller.geometry.vectors import ROUNDING, Frame, Vector, norm, subtract
from controller.machine.kinematics import kinematics_of
from controller.machine.model import OFFSETS, Joints, Machine
from controller.messages import DEFAULT, text
from controller.motion.motions import JointMove, Rotaries
from controller.plan.context import Context
from controller.plan.lines import moves, spline_moves
from controller.plan.segment import rotaries_of
from controller.program.position import Coordinate, Position, read_in
from controller.program.program import (
    Act,
    Action,
    Await,
    Block,
    CutCone,
    CutNurbs,
    CutRuled,
    Dwell,
    JointArc,
    JointCurve,
    JointLine,
    JointMotion,
    Modal,
    OperatorMessage,
    Remark,
    Select,
    Setting,
    TipLine,
)

_KINDS = {
    Act.SPINDLE: "spindle",
    Act.TOOL: "tool",
    Act.COOLANT: "coolant",
    Act.OUTPUT: "output",
    Act.STOP: "stop",
    Act.OPTIONAL_STOP: "optional stop",
    Act.END: "end",
}

LINES = ("line", "drill", "tap", "thread")  # kinds of what is straight at feed: the others in a cycle, or G33


@dataclass(frozen=True, slots=True)
class Step:
    """One canonical motion or function; lengths in mm, angles in degrees of the configured sense."""

    line: int
    column: int
    # rapid, of LINES, arc, curve, surface, dwell, spindle, tool, coolant, message, stop, optional stop, end
    kind: str
    program: dict[str, Coordinate]  # position at the end, in program coordinates
    axes: dict[str, Coordinate]  # the same as positions of the machine's axes
    offset: str  # work offset
    plane: str
    facts: dict[str, Any]  # what else belongs to its kind: feed and its unit, centre, turns, seconds ...
    tilted: Frame | None = (
        None  # the tilted plane that is active, seen from the table with its rotaries at zero
    )

    def to_dict(self) -> dict[str, Any]:
        """As one object of JSON."""
        place = {"line": self.line, "column": self.column, "kind": self.kind}
        return {
            **place,
            "program": self.program,
            "axes": self.axes,
            "offset": self.offset,
            "plane": self.plane,
            "tilted": self.tilted._asdict() if self.tilted is not None else None,
            **self.facts,
        }


def steps(
    blocks: Iterable[Block], machine: Machine, name: str, start: Joints, language: str = DEFAULT
) -> Iterator[Step]:
    """The steps of ``blocks`` from the joints ``start`` on. Raises ProgramError as reading does."""
    explainer = _Explainer(machine, name, start, language)
    for block in blocks:
        yield explainer.step(block)


class _Explainer:
    def __init__(self, machine: Machine, name: str, start: Joints, language: str) -> None:
        self._machine, self._kinematics, self._language = machine, kinematics_of(machine), language
        self._context = Context.silent(machine, name, self._kinematics)
        self._position = Position(machine, start)

    def step(self, block: Block) -> Step:
        before = self._position.joints() if isinstance(block, JointMotion) else ()
        self._position.take(block)
        facts = self._facts(block, before)
        kind = facts.pop("kind")
        program = self._program(block.modal)
        if isinstance(block, CutCone | CutRuled | CutNurbs):
            program = dict(zip("XYZ", _contact_end(block), strict=True))
        place, modal = block.place, block.modal
        tilted = modal.frame(self._machine) if modal.tilted else None
        offset, axes = OFFSETS[modal.offset], self._axes()
        return Step(place.line, place.column, kind, program, axes, offset, modal.plane, facts, tilted)

    # ---- positions -------------------------------------------------------------------

    def _axes(self) -> dict[str, Coordinate]:
        axes = self._machine.axes
        known = zip(axes, self._position.joints(), strict=True)
        return {axis.name: None if q is None else q * axis.shown_per_unit for axis, q in known}

    def _program(self, modal: Modal) -> dict[str, Coordinate]:
        found: dict[str, Coordinate] = dict(zip("XYZ", self._position.in_frame(modal), strict=True))
        rotary = (self._machine.axes[i] for i in self._machine.rotary())
        for axis, q, shift in zip(rotary, self._position.rotaries, modal.turned_rad, strict=False):
            found[axis.name] = None if q is None else (q - shift) * axis.shown_per_unit
        return found

    # ---- what belongs to a kind ------------------------------------------------------

    def _facts(self, block: Block, before: tuple[Coordinate, ...]) -> dict[str, Any]:
        if isinstance(block, JointLine | TipLine):
            if block.feed_mm_s is None:
                return {"kind": "rapid"}
            hole = block.hole if isinstance(block, JointLine) else ""
            return {"kind": hole or "line", **self._feed(block, before)}
        if isinstance(block, JointArc):
            return {"kind": "arc", **self._feed(block, before), **self._arc(block, before)}
        if isinstance(block, JointCurve):
            return {"kind": "curve", **self._feed(block, before), **self._curve(block, before)}
        if isinstance(block, Dwell):
            return {"kind": "dwell", "seconds": block.seconds}
        if isinstance(block, Remark | OperatorMessage):
            told = text(block.said, self._language) if isinstance(block, Remark) else block.text
            return {"kind": "message", "text": told}
        if isinstance(block, Await):
            what = {"input": block.number, "for": block.level.name.lower()}
            return {"kind": "wait", **what, "seconds": block.seconds}
        if isinstance(block, Setting):
            return {"kind": "setting", "sets": [change.key for change in block.changes]}
        if isinstance(block, Select):
            return {"kind": "prepare", "tool": block.tool}
        if isinstance(block, Action):
            return {"kind": _KINDS[block.act], **_function(block)}
        return {"kind": "surface", "feed": block.feed_mm_s * 60.0, "unit": "mm/min"}

    def _feed(self, block: JointMotion | TipLine, before: tuple[Coordinate, ...]) -> dict[str, Any]:
        if block.time_s is not None:
            return {"feed": block.time_s, "unit": "s"}
        degrees = None if isinstance(block, JointArc | JointCurve) else block.feed_deg_s
        if isinstance(block, JointLine) and degrees is not None and self._turns_only(block, before):
            return {"feed": degrees * 60.0, "unit": "deg/min"}
        return {"feed": (block.feed_mm_s or 0.0) * 60.0, "unit": "mm/min"}

    def _turns_only(self, block: JointLine, before: tuple[Coordinate, ...]) -> bool:
        """Whether X Y Z stand while rotaries turn."""
        now = self._position.joints()
        linear = self._machine.linear()
        stands = all(_same(before[i], now[i]) if block.targets[i] is not None else True for i in linear)
        return stands and any(block.targets[i] is not None for i in self._machine.rotary())

    def _arc(self, block: JointArc, before: tuple[Coordinate, ...]) -> dict[str, Any]:
        """Centre in program coordinates, sense and turns; no centre where the start is not known."""
        told: dict[str, Any] = {"clockwise": block.clockwise, "turns": max(block.turns, 1), "centre": None}
        here = [q for q in before if q is not None]
        if len(here) < len(before):
            return told
        found = moves.arc(block, self._context, tuple(here))
        if found is not None and isinstance(found.motion, JointMove) and isinstance(found.motion.curve, Arc):
            told["centre"] = self._shown(found.motion.curve.centre, block, found.motion.start_rotaries)
        return told

    def _curve(self, block: JointCurve, before: tuple[Coordinate, ...]) -> dict[str, Any]:
        """Order, weights and, where the start is known, control points in program coordinates."""
        told = {
            "order": block.order,
            "weights": [control.weight for control in block.controls],
            "points": None,
        }
        here = [q for q in before if q is not None]
        if len(here) == len(before):
            found = spline_moves.controls(block, self._context, tuple(here))
            rotaries = rotaries_of(tuple(here), self._kinematics)
            told["points"] = [self._shown(point, block, rotaries) for point in found]
        return told

    def _shown(self, point: Vector, block: JointArc | JointCurve, rotaries: Rotaries) -> dict[str, float]:
        """A place of the axes as the program's coordinates in the plane have it."""
        frame, length_mm = read_in(block.modal, self._machine, self._kinematics, rotaries)
        place = frame.from_parent(subtract(point, (0.0, 0.0, length_mm)))
        plane = block.plane[:2] if isinstance(block, JointArc) else (0, 1)
        return {"XYZ"[i]: place[i] for i in sorted(plane)}


def _same(a: Coordinate, b: Coordinate) -> bool:
    return a is not None and b is not None and abs(a - b) < ROUNDING


def _function(block: Action) -> dict[str, Any]:
    if block.act is Act.SPINDLE:
        return {"rev_min": block.modal.spindle_rev_min}
    if block.act is Act.TOOL:
        return {"tool": block.modal.tool}
    if block.act is Act.OUTPUT:
        outputs = block.modal.outputs
        return {"on": outputs.on, "off": outputs.off, "levels": dict(outputs.levels)}
    if block.act is Act.COOLANT:
        return {"mist": bool(block.modal.coolant & 1), "flood": bool(block.modal.coolant & 2)}
    return {}


def _contact_end(block: CutCone | CutRuled | CutNurbs) -> tuple[float, float, float]:
    """Where the contact of a surface ends, in program coordinates (mm)."""
    if isinstance(block, CutRuled):
        return block.lower[3]
    if isinstance(block, CutNurbs):
        x, y, z = block.lower.at(1.0)
        return float(x), float(y), float(z)
    radius = subtract(block.start, block.centre)
    size, angle = norm(radius), math.atan2(radius[1], radius[0]) + block.sweep_rad
    x, y, z = block.centre
    return x + size * math.cos(angle), y + size * math.sin(angle), z
