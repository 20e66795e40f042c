"""What a motion does, as a shop names it: told apart here alone, for reports and pictures."""

from __future__ import annotations

from controller.geometry.curves import Line
from controller.geometry.surfaces import Cone
from controller.geometry.vectors import norm, subtract
from controller.motion.motions import JointMove
from controller.plan.path.outputs import PROBE
from controller.plan.restart.program_position import BESIDE
from controller.plan.segment import Segment

# On surfaces, along lines and arcs, down and up holes of cycles, and beside threads.
CUTS = ("surface", "mill", "drill", "tap", "thread")
HOLES = ("drill", "tap")
WORKS = (*CUTS, "rapid")
OTHER = ""  # ways of the controller at feed, probing, and turns of rotaries alone at feed


def work_of(segment: Segment) -> str:
    """One of WORKS, or OTHER."""
    if segment.cutting:
        return "surface"
    if segment.name == PROBE:
        return OTHER
    if segment.feed_mm_s is None:
        return "rapid"
    if segment.name in BESIDE or turns_alone(segment):
        return OTHER
    return segment.hole or "mill"


def kind_of(segment: Segment) -> str:
    """The kind of a block by a motion of its own: 'cone', 'surface', 'drill', 'rapid', 'line', 'arc', ..."""
    if (cut := segment.cut) is not None:
        return "cone" if isinstance(cut.surface.nominal, Cone) else "surface"
    if segment.feed_mm_s is None and segment.name == "line":
        return "rapid"
    return segment.hole or segment.name


def turns_alone(segment: Segment) -> bool:
    """Whether only rotaries move: s is then not the way of X Y Z."""
    curve = segment.motion.curve if isinstance(segment.motion, JointMove) else None
    return isinstance(curve, Line) and 2.0 * norm(subtract(curve.end, curve.start)) < segment.motion.end
