"""The state at the place where a program is entered, as the operator reads it before the start."""

from __future__ import annotations

from controller.geometry.vectors import Frame
from controller.machine.model import OFFSETS, Machine
from controller.messages import DEFAULT, LANGUAGES, Key, Message, message
from controller.plan.restart.restart import Rest
from controller.program.program import Modal

COOLANT = (Key("at.off"), Key("at.mist"), Key("at.flood"), Key("at.mist_and_flood"))


def messages(rest: Rest) -> list[Message]:
    """The place, what is in force there, and how it is entered."""
    at, machine, spot = rest.target.modal, rest.source.machine, rest.spot
    feed = Key("at.none") if at.feed_mm_s is None else f"{at.feed_mm_s * 60.0:g} mm/min"
    offset, length = OFFSETS[at.offset], f"{at.length_mm:.3f}"
    spindle = {"rev_min": f"{at.spindle_rev_min:g}", "coolant": COOLANT[at.coolant], "feed": feed}
    way = f"at.way.{rest.what}"
    what = Key(way) if way in LANGUAGES[DEFAULT].texts else rest.what
    size = _size(machine, at.tool)
    tilted = [message("at.tilted", **_plane(at.frame(machine)))] if at.tilted else []
    return [
        message("at.place", line=spot.line, percent=f"{spot.fraction * 100.0:.1f}", what=what),
        message("at.sized_tool" if size else "at.tool", tool=at.tool, offset=offset, length=length, **size),
        *tilted,
        message("at.spindle", **spindle),
        *([message("at.outputs", outputs=names)] if (names := _on(machine, at)) else []),
        message("at.entry", joints=_joints(rest)),
    ]


def _plane(frame: Frame) -> dict[str, str]:
    """A tilted plane in words, seen from the table with its rotaries at zero."""
    names = {"origin": "XYZ", "x": "IJK", "z": "IJK"}
    return {
        what: " ".join(f"{letter}{q + 0.0:.4f}" for letter, q in zip(names[what], vector, strict=True))
        for what, vector in (("origin", frame.origin), ("x", frame.x), ("z", frame.z))
    }


def _on(machine: Machine, at: Modal) -> str:
    """The outputs that the program has switched on, and off, before there."""
    names = machine.io.switched if machine.io is not None else ()
    told = [f"{name} 1" for i, name in enumerate(names) if at.outputs.on >> i & 1]
    told += [f"{name} 0" for i, name in enumerate(names) if at.outputs.off >> i & 1]
    outs = machine.io.analogue_out if machine.io is not None else ()
    return ", ".join(told + [f"{outs[i].name} {value:g}" for i, value in at.outputs.levels])


def _size(machine: Machine, number: int) -> dict[str, str]:
    """Of a tool; nothing where the table has none of that number."""
    tool = machine.tool(number)
    return {"radius": f"{tool.radius_mm:.3f}", "long": f"{tool.length_mm:.3f}"} if tool else {}


def _joints(rest: Rest) -> str:
    machine = rest.source.machine
    shown = machine.shown(rest.target.joints)
    return " ".join(f"{axis.name} {q:.3f}" for axis, q in zip(machine.axes, shown, strict=True))
