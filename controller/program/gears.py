"""The gears of a spindle as a program goes through them: which is in, and which one S needs."""

from __future__ import annotations

from controller.machine.equipment import Io
from controller.machine.spindle import Gear, Spindle
from controller.program.program import Outputs


def engaged(spindle: Spindle, io: Io, outputs: Outputs) -> int | None:
    """The gear that the program has shifted into; None: into none yet."""
    for n, gear in enumerate(spindle.gears):
        on, off = io.switched_masks(gear.on, gear.off)
        if outputs.on & on == on and outputs.off & off == off:
            return n
    return None


def chosen(spindle: Spindle, now: int | None, rev_min: float) -> int | None:
    """The gear for S (1/min): the one that is in where it has it, else the first; None: there is none.

    Where codes say the gear, S changes none that is in.
    """
    by_code = any(one.code for one in spindle.gears)
    if now is not None and (by_code or spindle.gears[now].holds(rev_min)):
        return now if spindle.gears[now].holds(rev_min) else None
    return next((n for n, one in enumerate(spindle.gears) if one.holds(rev_min)), None)


def shown(gear: Gear) -> str:
    """Its speeds, and its code."""
    speeds = f"{gear.low_rev_min:g} .. {gear.high_rev_min:g}"
    return f"{gear.code} {speeds}" if gear.code else speeds
