"""The modal codes in which a block runs, as an operator reads them beside the figures.

Those that the plan goes by: what only says how the text is read (G20, G90, G94) has been dealt with
when it was read, and the motion itself is told by its name.
"""

from __future__ import annotations

from controller.machine.model import OFFSETS
from controller.program.program import Modal, Side, Tip

COOLANT = ("M9", "M7", "M8", "M7 M8")
TIPS = {Tip.ROTARIES: "G43.4", Tip.VECTORS: "G43.5"}


def of(modal: Modal) -> tuple[str, ...]:
    """In the order in which they are shown: plane, side, length, offset, path, tool, spindle, coolant."""
    found = [modal.plane, _side(modal), _length(modal), OFFSETS[modal.offset], _path(modal)]
    if modal.tilted:
        found.append("G68.2")
    return tuple(
        code for code in (*found, f"T{modal.tool}", *_spindle(modal), COOLANT[modal.coolant]) if code
    )


def _side(modal: Modal) -> str:
    """Of surfaces G40 and G42 are one side: with neither G41 nor a contour beside it nothing is told."""
    if modal.planar is not None:
        return modal.planar.code
    return "G41" if modal.side is Side.LEFT else ""


def _length(modal: Modal) -> str:
    return TIPS.get(modal.tip, "G43" if modal.length_mm else "G49")


def _path(modal: Modal) -> str:
    if modal.exact:
        return "G61"
    return f"G64 P{modal.blend_mm:g}" if modal.blend_mm else "G64"


def _spindle(modal: Modal) -> tuple[str, ...]:
    speed = modal.spindle_rev_min
    return (f"S{abs(speed):.0f}", "M3" if speed > 0.0 else "M4") if speed else ("M5",)
