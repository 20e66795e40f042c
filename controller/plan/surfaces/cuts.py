"""From a G51, G52 or G6.2 block to the motions of its cut, and the audit of its surface.

A surface between B-splines becomes several cuts that join: one for each part over
which the joints change smoothly, as two G52 blocks would.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Generic, NamedTuple, TypeVar

from controller.geometry import arc_length
from controller.geometry.curves import ArcLength, Bezier, NoLength
from controller.geometry.defects import Defect, DefectKind, concave_radius, defect
from controller.geometry.placement import AT_LOWER, Placed, Strategy, Turn
from controller.geometry.rulings import smooth_parts
from controller.geometry.surfaces import Cone, RuledSurface, Surface
from controller.geometry.vectors import Number, Vector, add, cross, dot, norm, rotate, scale, subtract, unit
from controller.machine import tool_profile
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine, Tool
from controller.memory import remembered
from controller.messages import Key, Message, message
from controller.motion.motions import SurfaceCut
from controller.plan.context import Context
from controller.plan.surfaces import deviation
from controller.plan.surfaces.axis_curves import joined
from controller.plan.surfaces.placements import name_of
from controller.plan.surfaces.placing import CHOSEN_FROM, Cutter, RequiredPlacement, Row, off_mm
from controller.plan.surfaces.touching import touched
from controller.program.program import CutBlock, CutCone, CutRuled, GougeRefused, Modal, ProgramError

FREE = (Strategy.OPTIMAL, Strategy.AUTO)  # leave the ruling: they take any twist

# A check builds every block twice: to choose the branches of the whole program, and to trace it.
REMEMBERED = 256
SAME_RAD = math.radians(1e-6)  # axes nearer than this are one
MAX_KNOWN = 20_000
MAX_TOGETHER = 8  # blocks whose placement is searched as that of one surface
MEET_MM = 1e-6  # edges that are as near are one
Share = tuple[float, float]
T = TypeVar("T")


class _Known(Generic[T]):
    """What a look at a surface has found, by its hash: of a thousand surfaces not one is kept for that."""

    def __init__(self, look: Callable[..., T]) -> None:
        self._look, self._found = look, dict[str, T]()

    def __call__(self, surface: Surface, *asked: float) -> T:
        name = name_of(surface, *asked)
        if name not in self._found:
            if len(self._found) >= MAX_KNOWN:
                self._found.clear()
            self._found[name] = self._look(surface, *asked)
        return self._found[name]


_defect = _Known(defect)
_concave_radius = _Known(concave_radius)
_arc: Callable[[Any], ArcLength] = remembered(REMEMBERED)(arc_length.of)


@dataclass(frozen=True, slots=True)
class Edge:
    """One end of a cut in the table frame: where the cutter stands and which way it goes."""

    contact: Vector
    tip: Vector
    axis: Vector
    ruling: Vector  # unit vector along the ruling, upward: the axis itself where the paper places it
    tangent: Vector  # unit vector along C1, in the direction of travel
    out: Vector  # unit normal towards the cutter's side
    away: Vector  # off all of the ruling: half way between its normals where they differ much, else ``out``


@dataclass(frozen=True, slots=True)
class Cut:
    """One G51 or G52 block, or a smooth part of a G6.2 block, ready to be followed."""

    block: CutBlock
    tool: Tool
    motion: SurfaceCut
    start: Edge
    end: Edge
    part: tuple[float, float] = (0.0, 1.0)  # which part of the block, in its u

    def block_u(self, u: Number) -> Number:
        """The block's parameter at the cut's own."""
        return self.part[0] + (self.part[1] - self.part[0]) * u

    @property
    def side(self) -> float:
        return self.block.modal.side.value


class Piece(NamedTuple):
    """The share of a block, in its u, that one surface of a row is."""

    block: CutBlock
    share: Share


@dataclass(frozen=True, slots=True)
class Parts:
    """The parts of blocks that are placed together, and the cutter for them."""

    blocks: tuple[CutBlock, ...]
    tool: Tool
    row: Row
    ruled: tuple[Piece, ...]  # what each of the row's surfaces is
    free: tuple[Piece, ...]

    @staticmethod
    def of(blocks: Sequence[CutBlock], surfaces: Sequence[Surface], tool: Tool) -> Parts:
        ruled, pieces = _parts(blocks, surfaces, False)
        free, free_pieces = _parts(blocks, surfaces, True)
        cutter = _cutter(blocks[0].modal, tool, surfaces)
        row = Row(ruled, ruled if pieces == free_pieces else free, cutter)
        return Parts(tuple(blocks), tool, row, pieces, free_pieces)

    def pieces(self, placed: Sequence[Surface]) -> tuple[Piece, ...]:
        """What each surface of a placement is."""
        return self.free if len(placed) == len(self.free) else self.ruled

    def cuts(self, placed: Sequence[Surface], machine: Machine) -> tuple[Cut, ...]:
        """Their cuts, with the cutter as ``placed``; raises ValueError."""
        return tuple(self._cut(*each, machine) for each in zip(placed, self.pieces(placed), strict=True))

    def _cut(self, placed: Surface, piece: Piece, machine: Machine) -> Cut:
        frame, tool = piece.block.modal.frame(machine), self.tool
        motion = SurfaceCut(placed, _arc(placed.lower), self.row.cutter.offset_mm, tool.length_mm, frame)
        motion = touched(motion, kinematics_of(machine))
        return Cut(piece.block, tool, motion, edge(motion, 0.0), edge(motion, 1.0), piece.share)


def placed_together(blocks: Iterable[CutBlock], machine: Machine) -> Iterator[list[CutBlock]]:
    """Consecutive blocks in groups: over the joints inside of one a free axis is led on as over one surface.

    A block that cannot be read raises ProgramError after those before it.
    """
    group, unread = list[CutBlock](), iter(blocks)
    while True:
        try:
            block = next(unread, None)
        except ProgramError:
            if group:
                yield group
            raise
        if group and (block is None or len(group) == MAX_TOGETHER or not _go_on(group[-1], block, machine)):
            yield group
            group = []
        if block is None:
            return
        group.append(block)
        if _asked_placement(block, machine)[1] not in FREE:
            yield group
            group = []


def _asked_placement(block: CutBlock, machine: Machine) -> tuple[object, ...]:
    """What is asked for a block's placement, beside its surface."""
    modal, tool = block.modal, block.modal.tool_in(machine)
    if tool is None:
        return None, None
    most = tolerance_mm(modal, tool, machine)
    return tool, strategy(modal, tool, machine), modal.side, modal.allowance_mm, most, modal.frame(machine)


def _go_on(before: CutBlock, after: CutBlock, machine: Machine) -> bool:
    """Whether one surface follows another, both for the same cutter, as if they were one."""
    if _asked_placement(before, machine) != _asked_placement(after, machine):
        return False
    one, other = surface_of(before), surface_of(after)
    ends = ((surface.lower.at(u), surface.upper.at(u)) for surface, u in ((one, 1.0), (other, 0.0)))
    if any(apart(a, b) > MEET_MM for a, b in zip(*ends, strict=True)) or len(joined((one, other))) > 1:
        return False
    return not _is_exact(before, machine) and not _is_exact(after, machine)


def _is_exact(block: CutBlock, machine: Machine) -> bool:
    """Whether the paper's placement cuts all of a block's surface: an axis of its own would only harm it."""
    tool = block.modal.tool_in(machine)
    return tool is not None and Parts.of([block], [surface_of(block)], tool).row.is_exact


def build(
    blocks: Sequence[CutBlock],
    context: Context,
    auto: Callable[[Parts], tuple[Surface, ...]],
) -> tuple[Cut, ...]:
    """The cuts of blocks that are placed together, in order; refuses a surface that its cutter cannot cut.

    ``auto`` places the parts of those for which that is asked.
    """
    tools = [_cutter_of(block, context) for block in blocks]
    block, tool, surfaces = blocks[0], tools[0], [surface_of(one) for one in blocks]
    kind = strategy(block.modal, tool, context.machine)
    try:
        parts = Parts.of(blocks, surfaces, tool)
        placed = auto(parts) if kind is Strategy.AUTO else parts.row.placed(kind)
        made = parts.cuts(placed, context.machine)
    except ValueError as error:
        why = error.said if isinstance(error, NoLength) else str(error)
        context.refuse(block.place, message("cut.not_travelled", code=code(block), why=why))
    if kind is Strategy.OPTIMAL and (as_good := _plainer(placed)):
        for one in blocks:
            context.tell(one.place, message("note.optimal", as_good=Key(as_good)))
    return made


def _cutter_of(block: CutBlock, context: Context) -> Tool:
    """The tool that cuts a block; refuses a surface that it cannot cut however it is placed."""
    machine, tool = context.machine, block.modal.tool_in(context.machine)
    if tool is None:
        known = ", ".join(f"T{t.number}" for t in machine.tools)
        context.refuse(block.place, message("cut.no_tool", tool=block.modal.tool, known=known))
    surface, kind = surface_of(block), strategy(block.modal, tool, machine)
    found = _defect(surface)
    twisted = found is not None and found.kind is DefectKind.TWIST
    if found is not None and not (twisted and kind in FREE):
        advice = _untwisted(block, surface, tool, machine) if twisted else ""
        context.refuse(block.place, described(block, found, advice))
    if block.modal.allowance_mm < 0.0 and tool.radius_mm + block.modal.allowance_mm <= 0.0:
        cutter = {"tool": tool.number, "radius": tool.radius_mm}
        context.refuse(block.place, message("cut.no_radius", allowance=block.modal.allowance_mm, **cutter))
    if kind is Strategy.AUTO and tolerance_mm(block.modal, tool, machine) is None:
        context.refuse(block.place, message("cut.no_tolerance"))
    if not twisted:  # an axis off the ruling meets other curvatures: what it cuts is judged
        _audit_hollow(block, surface, tool, context)
    _tell_flute(block, surface, tool, context)
    return tool


def _plainer(placed: Sequence[Surface]) -> str:
    """What is as good as ``optimal`` where that has searched and corrected nothing; "" where it has."""
    found = [one for one in placed if isinstance(one, Placed) and one.name]
    if not found or any(one.through is not None for one in found):
        return ""
    return "note.double" if any(one.normals_v != AT_LOWER for one in found) else "note.single"


def required_placements(blocks: Sequence[CutBlock], machine: Machine) -> Iterator[RequiredPlacement]:
    """The placements that ``build`` will search for blocks; none where it refuses one before."""
    modal, tool = blocks[0].modal, blocks[0].modal.tool_in(machine)
    if tool is None or (kind := strategy(modal, tool, machine)) is Strategy.SINGLE:
        return
    if kind is Strategy.AUTO and tolerance_mm(modal, tool, machine) is None:
        return
    surfaces = [surface_of(block) for block in blocks]
    defects = [found for found in map(_defect, surfaces) if found is not None]
    if all(found.kind is DefectKind.TWIST and kind in FREE for found in defects):
        row = Parts.of(blocks, surfaces, tool).row
        for one in CHOSEN_FROM[1:] if kind is Strategy.AUTO else (kind,):
            yield RequiredPlacement(row, one)


def _cutter(modal: Modal, tool: Tool, surfaces: Sequence[Surface]) -> Cutter:
    """The cutter with a barrel so far down that its middle meets that of the longest ruling."""
    bare, below = tool_profile.flank(tool), tool.below_mm
    if bare.barrel is not None:
        below = max(below, bare.barrel.middle_mm - bare.begins_mm - 0.5 * max(map(_longest, surfaces)))
    return Cutter.of(tool, modal.side.value, modal.allowance_mm, below)


def strategy(modal: Modal, tool: Tool, machine: Machine) -> Strategy:
    """How the cutter is placed: as the program says, else the tool, else the machine."""
    if modal.placement:
        return Strategy(modal.placement)
    return Strategy[(tool.placement or machine.placement).upper()]


def tolerance_mm(modal: Modal, tool: Tool, machine: Machine) -> float | None:
    """The form tolerance of a surface: as the program says, else the tool, else the machine; None: none."""
    if modal.tolerance_mm is not None:
        return modal.tolerance_mm
    return machine.tolerance_mm if tool.tolerance_mm is None else tool.tolerance_mm


def code(block: CutBlock) -> str:
    """The code that a block was written with."""
    if isinstance(block, CutCone):
        return "G51"
    return "G52" if isinstance(block, CutRuled) else "G6.2"


def surface_of(block: CutBlock) -> Surface:
    """The nominal surface of a block, part frame."""
    if isinstance(block, CutCone):
        return Cone(block.start, block.centre, block.height_mm, block.upper_radius_mm, block.sweep_rad)
    if isinstance(block, CutRuled):
        return RuledSurface(upper=Bezier(block.upper), lower=Bezier(block.lower))
    return RuledSurface(upper=block.upper, lower=block.lower)


def _parts(
    blocks: Sequence[CutBlock], surfaces: Sequence[Surface], free: bool
) -> tuple[tuple[Surface, ...], tuple[Piece, ...]]:
    """The smooth parts of some blocks' surfaces, each with the piece that it is; see ``Row``."""
    found = list[tuple[Surface, Piece]]()
    for block, surface in zip(blocks, surfaces, strict=True):
        if isinstance(block, CutCone | CutRuled):
            found.append((surface, Piece(block, (0.0, 1.0))))
            continue
        upper, lower = block.upper.snapped(block.lower.breaks), block.lower
        for share in smooth_parts(upper, lower, *((1, 2) if free else (2, 3))):
            part = RuledSurface(upper.between(*share), lower.between(*share))
            found.append((part, Piece(block, share)))
    return tuple(part for part, _ in found), tuple(piece for _, piece in found)


def describe(found: Defect) -> Message:
    """What is wrong with a surface and what to do; without a full stop."""
    figures = {"u": found.u, "v": found.v, "turn_deg": found.turn_deg}
    known = {name: value for name, value in figures.items() if math.isfinite(value)}  # NaN is no JSON
    return message(f"defect.{found.kind.value}", **known)


def described(block: CutBlock, found: Defect, advice: Message | str = "") -> Message:
    """The same of the surface of a block."""
    return message("cut.defect", code=code(block), defect=describe(found), advice=advice)


def _untwisted(block: CutBlock, surface: Surface, tool: Tool, machine: Machine) -> Message:
    """What helps a twisted surface: a placement that leaves the ruling, where one is good enough.

    A surface in several parts is not searched for a refusal: that would take seconds for each of them.
    """
    parts, kind = Parts.of([block], [surface], tool), strategy(block.modal, tool, machine)
    if len(parts.free) > 1:
        return message("cut.try_free")
    own, best = (off_mm(parts.row, one) for one in (kind, Strategy.OPTIMAL))
    most = tolerance_mm(block.modal, tool, machine)
    if best < own and (most is None or best <= most):
        words = Key("cut.p3" if most is None else "cut.p3_or_p4")
        return message("cut.write_free", words=words, kind=kind.name.lower(), own=own, best=best)
    allowed = "" if most is None else message("cut.form_tolerance", most=most)
    return message("cut.none_found", tool=tool.number, best=min(own, best), allowed=allowed)


def _audit_hollow(block: CutBlock, surface: Surface, tool: Tool, context: Context) -> None:
    """A cutter that does not fit into the hollow of its side cuts away what it must leave (gouge)."""
    side = block.modal.side
    radius, u = _concave_radius(surface, side.value)
    if tool.radius_mm > radius * (1.0 + 1e-9):
        gouge(
            message(
                "gouge.no_room",
                code=code(block),
                tool=tool.number,
                radius=tool.radius_mm,
                hollow=radius,
                u=u,
                side=Key(f"gouge.{side.name.lower()}"),
            ),
            message("gouge.fit_hollow", hollow=radius),
            block,
            context,
        )


def _tell_flute(block: CutBlock, surface: Surface, tool: Tool, context: Context) -> None:
    """A note where the longest ruling is longer than what the flank cuts."""
    longest = _longest(surface)
    if longest > (bare := tool_profile.flank_mm(tool)):
        flute = {"flute": tool.flute_mm, "flank": bare}
        told = message("note.flute", tool=tool.number, longest=longest, **flute)
        context.tell(block.place, told)


def _longest(surface: Surface) -> float:
    """About the longest ruling, mm."""
    return max(float(norm(surface.ruling(i / 64.0))) for i in range(65))


def gouge(what: Message, advice: Message, block: CutBlock, context: Context) -> None:
    """Refuse what cuts into the part, or only note it where the machine file says gouge = "warn"."""
    if context.machine.gouge == "refuse":
        why = message("gouge.refused", what=what, advice=advice, more="")
        raise block.place.refusal(context.program, why, GougeRefused)
    context.tell(block.place, message("gouge.told", what=what, advice=advice))


def flank(cut: Cut) -> deviation.Standing:
    """That of a cut as it is placed."""
    tool, surface, bare = cut.tool, cut.motion.surface, tool_profile.flank(cut.tool)
    low = surface.shift_mm if isinstance(surface, Placed) else 0.0
    offset = surface.offset_mm if isinstance(surface, Placed) else cut.motion.offset_mm
    radius = abs(offset) - low * math.tan(tool.taper_rad)
    return deviation.Standing(radius, tool.taper_rad, bare.barrel, bare.begins_mm)


def edge(cut: SurfaceCut, u: float) -> Edge:
    """The end of a cut at ``u`` = 0 or 1, in the table frame."""
    surface, part = cut.surface, cut.part
    tip, axis = surface.pose(u, cut.offset_mm)
    out = scale(surface.normal(u), math.copysign(1.0, cut.offset_mm))
    ruling = unit(surface.ruling(u)) if isinstance(surface, Placed) else axis
    return Edge(
        contact=part.to_parent(surface.contact(u)),
        tip=part.to_parent(tip),
        axis=part.turn(axis),
        ruling=part.turn(ruling),
        tangent=part.turn(_tangent(surface, u)),
        out=part.turn(out),
        away=part.turn(_away(surface, u, out)),
    )


def _away(surface: Surface, u: float, out: Vector) -> Vector:
    """Half way between ``out`` at C1 and the normal at C0, where an axis leaves the ruling; else ``out``.

    Along ``out`` itself the upper part of the flank would go into a surface whose normal turns by more
    than 90 degrees.
    """
    if not (isinstance(surface, Placed) and surface.through is not None):
        return out
    ruling = surface.ruling(u)
    upper = cross(add(*surface.rates(u, math)), ruling)
    upper = scale(unit(upper), math.copysign(1.0, dot(out, cross(surface.rates(u, math)[0], ruling))))
    return unit(add(out, upper))


def _tangent(surface: Surface, u: float) -> Vector:
    """Direction of C1 at an end; where C1' is 0 there, the direction just inside."""
    rate = surface.lower.derivative(u)
    if norm(rate) > 1e-9:
        return unit(rate)
    inner = 1e-6 if u < 0.5 else 1.0 - 1e-6
    return unit(surface.lower.derivative(inner))


def hollow(cut: Cut, u: float) -> bool:
    """Whether the surface bends towards the cutter at ``u``, seen in the plane normal to the ruling.

    The curvature there is (C1'' n - 2 (C1' a)(a' n)) / |t|^2 with a the axis and t
    the part of C1' across it (the twist of the ruling takes part where C1 is oblique).
    """
    surface = cut.motion.surface
    axis, normal = unit(surface.ruling(u)), surface.normal(u)
    tangent, second = surface.lower.derivative(u), surface.lower.derivative(u, 2)
    along = dot(tangent, axis)
    across = subtract(tangent, scale(axis, along))
    twist = dot(surface.ruling_curve.derivative(u), normal) / norm(surface.ruling(u))
    bend = dot(second, normal) - 2.0 * along * twist
    return bool(cut.side * bend > 1e-6 * max(dot(across, across), 1e-18))


def turned(before: Edge, after: Edge) -> float:
    """Angle (rad) by which the side normal turns about the shared ruling, left positive."""
    across = dot(cross(before.out, after.out), before.ruling)
    return math.atan2(across, dot(before.out, after.out))


def turned_axis(edge: Edge, angle_rad: float) -> Vector:
    """The axis of an edge after a turn about its ruling."""
    return rotate(edge.ruling, angle_rad, edge.axis) if edge.ruling is not edge.axis else edge.axis


def turn(before: Cut, after: Cut) -> SurfaceCut | None:
    """What leads from one cut to the next about the ruling they share, contact standing.

    None where the axis of both is along that ruling: it is held then, and an arc will do.
    """
    end, start = before.end, after.start
    if all(apart(edge.axis, edge.ruling) <= SAME_RAD for edge in (end, start)):
        return None
    first, second = before.motion.surface, after.motion.surface
    poses = first.pose(1.0, before.motion.offset_mm), second.pose(0.0, after.motion.offset_mm)
    way = Turn(first.contact(1.0), unit(first.ruling(1.0)), *poses, turned(end, start))
    return SurfaceCut(way, arc_length.of(way.lower), 0.0, after.motion.length_mm, after.motion.part)


def apart(a: Vector, b: Vector) -> float:
    """Distance of two points, or, of two unit vectors, their angle while it is tiny."""
    return float(norm(subtract(a, b)))


def beside(point: Vector, *steps: tuple[Vector, float]) -> Vector:
    """A point moved by so much along each of some directions."""
    for direction, by in steps:
        point = add(point, scale(direction, by))
    return point
