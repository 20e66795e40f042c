"""From anywhere to a place inside of a program: away from the part, over the place, down along the tool axis.

retract height   --------<------- position --------.      rotaries turn only here; spindle and
        ^                                          |      coolant start here
        | retract (along the tool axis first)      | down (rapid)
        |                                          + clearance above all that is cut up to there
        now                                        | plunge along the tool axis
                                                   o here the tool waits, see ``reentry``
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from controller.machine.model import Joints, Machine
from controller.messages import message
from controller.motion.motions import SurfaceCut
from controller.plan.restart import reentry
from controller.plan.restart.reentry import RETRACT_MM_S, NotPossible, Reentry, WayOnto, along_axis
from controller.plan.segment import ContinuousPath, PathItem, Pause, Segment, motion_named, straight, xyz_of
from controller.plan.surfaces import audit
from controller.plan.surfaces.approach import at_height
from controller.program.program import UNSAID, Act, Modal, Place


@dataclass(frozen=True, slots=True)
class Target:
    """The place that is to be entered: of a segment, or, where there is none, of a pause."""

    joints: Joints
    modal: Modal  # the state in which it is
    place: Place
    clear_mm: float  # along the tool axis, from where on the way is free
    segment: Segment | None = None
    s: float = 0.0

    @property
    def is_surface(self) -> bool:
        """Whether a surface is cut there."""
        return self.segment is not None and isinstance(self.segment.motion, SurfaceCut)

    def reentry(self, entrance: WayOnto) -> Reentry:
        """The way onto the path there. Raises NotPossible."""
        if self.segment is None:
            return entrance.enter_pause(self.joints, self.place, self.clear_mm)
        return entrance.enter(self.segment, self.s, self.clear_mm)


def way(
    now: Joints, onto: Reentry, clear_mm: float, place: Place, entrance: WayOnto, has_cut: bool = False
) -> tuple[list[Segment], list[Segment]]:
    """The way from ``now`` to where the tool waits: up and over, and down. Raises NotPossible.

    ``clear_mm``: along the tool axis from there, from where on the way is free. ``has_cut``: it is the tool
    that came to ``now``, so that what it touches there it has cut.
    """
    machine, kinematics = entrance.machine, entrance.kinematics
    tool, walls = entrance.fitted.tool, entrance.fitted.walls
    if not has_cut:
        entrance.see_free(now, onto.allowed_mm)
    room = reentry.room_along_axis(onto.waits, machine, kinematics)
    clear = along_axis(onto.waits, min(clear_mm, room), kinematics)
    off = reentry.to_height(now, machine.retract_mm, machine, kinematics)
    length_mm = 0.0 if tool is None else tool.length_mm
    rise = walls.height(now, length_mm, kinematics) + machine.clearance_mm
    free = along_axis(now, rise, kinematics) if rise < reentry.apart(now, off, kinematics) else off
    height = max(machine.retract_mm, *(xyz_of(q, kinematics)[2] for q in (clear, off)))
    up, over = at_height(off, height, kinematics), at_height(clear, height, kinematics)

    def move(name: str, start: Joints, end: Joints, feed_mm_s: float | None = None) -> Segment | None:
        return straight(name, place, start, end, feed_mm_s, kinematics)

    before = [move("retract", now, free, RETRACT_MM_S), move("retract", free, off), move("retract", off, up)]
    before.append(move("position", up, over))
    after = [move("down", over, clear), move("plunge", clear, onto.waits, RETRACT_MM_S)]
    laid = [[one for one in ways if one is not None] for ways in (before, after)]
    for segment in (*laid[0], *laid[1], *onto.ways):
        _see_inside(segment, machine)
    if tool is not None and (hit := walls.hit([*laid[0], *laid[1]], tool, kinematics)) is not None:
        raise NotPossible(message("aside.hits", tool=tool.number, line=hit.line))
    return laid[0], laid[1]


def enter(target: Target, now: Joints, in_spindle: int, entrance: WayOnto, name: str) -> list[PathItem]:
    """The way from ``now`` onto the target, with tool, spindle and coolant as they are there.

    ``in_spindle``: number of the tool that is in the spindle. Raises ProgramError where the way leaves an
    axis' travel, or gets into a wall.
    """
    if entrance.machine.changer is not None and target.modal.tool != in_spindle:
        sentence = message("tool.restart_other", found=in_spindle, wanted=target.modal.tool)
        raise target.place.refusal(name, sentence)
    try:
        onto = target.reentry(entrance)
        before, after = way(now, onto, target.clear_mm, target.place, entrance)
    except NotPossible as error:
        raise target.place.refusal(name, error.said) from error
    items: list[PathItem] = [ContinuousPath((segment,)) for segment in before]
    items += _settings(target, in_spindle)
    items += [ContinuousPath((segment,)) for segment in (*after, *onto.ways)]
    if onto.joins and isinstance(last := items[-1], ContinuousPath):
        items[-1] = replace(last, runs_on=True)
    return items


def _settings(target: Target, in_spindle: int) -> Iterator[Pause]:
    """Another tool is changed by hand at a stop; then spindle, coolant and outputs."""
    modal, still = target.modal, replace(target.modal, spindle_rev_min=0.0, coolant=0)
    if modal.tool != in_spindle:
        yield Pause(target.place, still, act=Act.TOOL)
        yield Pause(target.place, still, act=Act.STOP)
    if modal.spindle_rev_min or modal.coolant:
        yield Pause(target.place, modal, act=Act.SPINDLE)
    if modal.outputs != UNSAID:
        yield Pause(target.place, modal, act=Act.OUTPUT)


def _see_inside(segment: Segment, machine: Machine) -> None:
    """Raises NotPossible where a way leaves an axis' travel."""
    if (excess := audit.outside_at(machine, segment.end)) is not None:
        where = message("travel.in_entry", motion=motion_named(segment.name))
        raise NotPossible(audit.describe(machine.axes[excess.axis], excess, where))
