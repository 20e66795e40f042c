"""The probing cycles that ship as programs, by their names and values; and one of them as lines of a program.

Page, REST and command line ask for a cycle by name; what runs is the program that any part program may call
(``config/programs/probing``), with these lines before it:

    G21 G90 G94 G40 G55 G43
    o<probe_bore> call [20] [2]

The work offset that is to be set is the active one meanwhile, so what is told is in its coordinates, as they
were; one that nobody has set yet cannot be, and G54 is. Cycles on the tool setter, and of the probe itself,
set the tool, no offset.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from decimal import Decimal
from typing import Any, NamedTuple

from controller.machine.model import OFFSETS
from controller.messages import Message, message
from controller.program import linked

TOWARDS = {"X+": (1, 0), "X-": (-1, 0), "Y+": (0, 1), "Y-": (0, -1)}
CORNERS = {"X+Y+": (1, 1), "X+Y-": (1, -1), "X-Y+": (-1, 1), "X-Y-": (-1, -1)}
AXES = {"X": (1, 0), "Y": (0, 1)}
KEEPS = {"no": (0,), "yes": (1,)}  # in the tool table
CHOICES: Mapping[str, Mapping[str, tuple[int, ...]]]
CHOICES = {"towards": TOWARDS, "corner": CORNERS, "axis": AXES, "keep": KEEPS}
NONE = "none"
SETTABLE = (NONE, *OFFSETS[:9])  # which offset a cycle may set: G10 P1 to P9


class Length(NamedTuple):
    """A value with its bounds and what it is where nothing is said; 0 only where it is lowest, or usual."""

    lowest: float
    highest: float
    usual: float
    unit: str = "mm"

    @property
    def may_be_0(self) -> bool:
        return 0.0 in (self.lowest, self.usual)


LENGTHS = {
    "most": Length(0.1, 500.0, 20.0),
    "along": Length(-500.0, 500.0, 20.0),
    "half": Length(0.1, 500.0, 20.0),
    "down": Length(0.1, 200.0, 10.0),
    "beside_x": Length(-500.0, 500.0, 20.0),
    "beside_y": Length(-500.0, 500.0, 20.0),
    "turning": Length(0.0, 5000.0, 0.0, "1/min"),
    "within": Length(0.001, 10.0, 0.1),
    "diameter": Length(1.0, 500.0, 25.0),
    "height": Length(-1000.0, 1000.0, 0.0),
}
CYCLES: dict[str, tuple[str, ...]] = {  # the values of each in the order of its program's
    "top": ("most",),
    "edge": ("towards", "most"),
    "corner": ("corner", "along", "most"),
    "bore": ("most",),
    "boss": ("half", "down", "most"),
    "pocket": ("axis", "most"),
    "web": ("axis", "half", "down", "most"),
    "plane": ("beside_x", "beside_y", "most"),
    "angle": ("towards", "along", "most"),
    "tool_length": ("most", "turning", "keep"),
    "tool_radius": ("half", "down", "most", "turning", "keep"),
    "tool_check": ("most", "turning", "within"),
    "ring": ("diameter", "most", "keep"),
    "sphere": ("diameter", "most", "keep"),
    "gauge": ("height", "most", "keep"),
}


ON_SETTER = ("tool_length", "tool_radius", "tool_check")  # of the tool in the spindle
OF_PROBE = ("ring", "sphere", "gauge")  # of the probe's own ball and length
SET_NONE = (*ON_SETTER, *OF_PROBE)  # they set no offset


class CycleRefused(Exception):
    """A cycle, or a value of it, that cannot be; ``said``: the sentence."""

    def __init__(self, told: Message) -> None:
        super().__init__(told)
        self.said = told


def listed() -> list[dict[str, Any]]:
    """Every cycle with its values: what each may be, and is where it is not said."""
    return [
        {"name": name, "values": [_facts(value) for value in values], "sets": name not in SET_NONE}
        for name, values in CYCLES.items()
    ]


def picture(cycle: str) -> str | None:
    """The drawing of a cycle (SVG) with the letters of its values; None where there is no such cycle."""
    if cycle not in CYCLES:
        return None
    return (linked.SHIPPED / f"probe_{cycle}.svg").read_text(encoding="utf-8")


def program(
    cycle: object, values: Mapping[str, Any], offset: object, unset: Collection[str] = (), tool: int = 0
) -> bytes:
    """The lines that run a cycle, with its program behind them; ``offset``: to be set, or "none".

    ``unset``: offsets that nobody has set. ``tool``: put in by hand, so that the program must be told of it;
    0: the changer knows it, or nobody. Raises CycleRefused.
    """
    wanted = CYCLES.get(cycle) if isinstance(cycle, str) else None
    if wanted is None:
        raise _refused("probe_cycle", found=cycle, allowed=CYCLES)
    if foreign := sorted(set(values) - set(wanted)):
        raise _refused("probe_value", name=foreign[0], cycle=cycle, allowed=wanted)
    settable = SETTABLE[:1] if cycle in SET_NONE else SETTABLE
    if offset not in settable:
        raise _refused("probe_offset", found=offset, allowed=settable)
    numbers = [number for name in wanted for number in _numbers(name, values.get(name))]
    if cycle not in SET_NONE:
        numbers.append(SETTABLE.index(str(offset)))
    active = OFFSETS[0] if offset in (NONE, *unset) else offset
    call = " ".join(f"[{Decimal(f'{number:.12g}'):f}]" for number in numbers)
    there = f"M61 Q{tool}\n" if tool else ""
    text = f"{there}G21 G90 G94 G40 {active} G43\no<probe_{cycle}> call {call}\n"
    return bytes(linked.linked(text.encode(), lambda _: None))


def _facts(name: str) -> dict[str, Any]:
    if (choices := CHOICES.get(name)) is not None:
        return {"name": name, "choices": list(choices), "usual": next(iter(choices))}
    return {"name": name, **LENGTHS[name]._asdict()}


def _numbers(name: str, value: object) -> tuple[float, ...]:
    """As the program takes it; what is usual for None."""
    if (choices := CHOICES.get(name)) is not None:
        chosen = next(iter(choices)) if value is None else value
        if not isinstance(chosen, str) or chosen not in choices:
            raise _refused("probe_choice", name=name, found=value, allowed=choices)
        return choices[chosen]
    length = LENGTHS[name]
    if value is None:
        return (length.usual,)
    if (
        isinstance(value, int | float)
        and not isinstance(value, bool)
        and (value != 0.0 or length.may_be_0)
        and length.lowest <= value <= length.highest
    ):
        return (float(value),)
    key = "probe_number" if length.lowest > 0.0 or length.may_be_0 else "probe_length"
    raise _refused(key, name=name, found=value, **length._asdict())


def _refused(key: str, allowed: Any = (), **values: object) -> CycleRefused:
    return CycleRefused(message(key, allowed=", ".join(allowed), **values))
