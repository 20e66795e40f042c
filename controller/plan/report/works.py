"""What a motion does, as a shop names it: told apart here alone, for reports and pictures."""

from __future__ import annotations

from controller.geometry.curves import Line
from controller.geometry.surfaces import Cone
from controller.geometry.vectors import norm, subtract
from controller.motion.motions import JointMove
from controller.plan.path.outputs import PROBE
from controller.plan.restart.program_position import BESIDE
from controller.plan.stretch import STANDS_MM, Stretch

# On surfaces, along lines and arcs, down and up holes of cycles, and beside threads.
CUTS = ("surface", "mill", "drill", "tap", "thread")
HOLES = ("drill", "tap")
WORKS = (*CUTS, "rapid")
OTHER = ""  # ways of the controller at feed, probing, and turns of rotaries alone at feed


def work_of(stretch: Stretch) -> str:
    """One of WORKS, or OTHER."""
    if stretch.cutting:
        return "surface"
    if stretch.name == PROBE:
        return OTHER
    if stretch.feed_mm_s is None:
        return "rapid"
    if stretch.name in BESIDE or turns_alone(stretch):
        return OTHER
    return stretch.hole or "mill"


def kind_of(stretch: Stretch) -> str:
    """The kind of a block by a motion of its own: 'cone', 'surface', 'drill', 'rapid', 'line', 'arc', ..."""
    if (cut := stretch.cut) is not None:
        return "cone" if isinstance(cut.surface.nominal, Cone) else "surface"
    if stretch.feed_mm_s is None and stretch.name == "line":
        return "rapid"
    return stretch.hole or stretch.name


def turns_alone(stretch: Stretch) -> bool:
    """Whether only rotaries move."""
    curve = stretch.motion.curve if isinstance(stretch.motion, JointMove) else None
    return isinstance(curve, Line) and bool(norm(subtract(curve.end, curve.start)) < STANDS_MM)
