"""``[changer]``: how a machine changes its tools, as sequences of named steps.

```toml
[changer]
pockets = [1, 2, 3, 0]             # the tools of pocket 1, 2 ...; 0: the pocket is nobody's

[[changer.put_away]]
name = "To the pocket"
move_mm = { X = [-90, -30, 30, 90], Z = 200 }   # one place, or one of each pocket; machine positions
within_s = 20
fails = "The spindle does not come to the pocket."

[[changer.put_away]]
name = "Open the drawbar"
on = ["drawbar"]
input = "drawbar_open"
within_s = 3
fails = "The drawbar does not open: look at the air."
carries = true                     # from here on the tool is in its pocket

[[changer.take]]
...

[[changer.prepare]]                # where T brings the pocket to the spindle while the cut goes on: no moves
name = "Pocket down"
pocket = ["bit_1", "bit_2"]
on = ["swing"]
input = "pocket_down"
within_s = 8
fails = "The pocket does not swing down."
```
What a preparation switches is nothing that puts a tool away, or that the machine takes one by: it goes on
beside a cut, and must stand when M6 comes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from controller.machine.equipment import OUTPUTS
from controller.machine.model import MAX_BESIDE, Axis, Changer, ChangerStep, Io, Machine
from controller.machine.toml_table import Table, is_number
from controller.messages import Key, said

SEQUENCES = ("put_away", "take")
PREPARE = "prepare"
LEVELS = ("rise", "fall", "on", "off")
MAX_POCKETS = 999
LONGEST_S = 600.0


def names_of(table: Table) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The outputs and the inputs that the steps name, each once, before [io] is read."""
    outputs: dict[str, None] = {}
    inputs: dict[str, None] = {}
    for sequence in (*SEQUENCES, PREPARE):
        for row in table.tables(sequence):
            for key in ("on", "off", "pocket"):
                outputs |= dict.fromkeys(row.names(key))
            if row.has("input"):
                inputs[row.text("input")] = None
    return tuple(outputs), tuple(inputs)


def changer(table: Table, axes: Sequence[Axis], io: Io | None) -> Changer:
    """Raises ConfigError."""
    pockets = _pockets(table)
    put_away, take = (
        tuple(_step(row, axes, io, len(pockets)) for row in table.tables(sequence)) for sequence in SEQUENCES
    )
    for key, steps in zip(SEQUENCES, (put_away, take), strict=True):
        if sum(step.carries for step in steps) != 1:
            table.refuse(key, "carries_once")
        names = [step.name for step in steps]
        if len(set(names)) < len(names):
            table.refuse(key, "step_twice")
    prepare = tuple(_preparing(row, io, len(pockets)) for row in table.tables(PREPARE))
    _apart(table, prepare, put_away, take)
    table.finish()
    return Changer(pockets, put_away, take, prepare)


def _apart(
    table: Table,
    prepare: Sequence[ChangerStep],
    put_away: Sequence[ChangerStep],
    take: Sequence[ChangerStep],
) -> None:
    """What is prepared stands until the tool is over: no step up to there switches any of it."""
    if len(names := {name for step in prepare for name in step.switches}) > MAX_BESIDE:
        table.refuse(PREPARE, "prepare_many", count=len(names), most=MAX_BESIDE)
    over = next((k for k, step in enumerate(take) if step.carries), len(take))
    taken = {name: step for step in (*put_away, *take[: over + 1]) for name in step.switches}
    for step in prepare:
        for name in step.switches:
            if name in taken:
                table.refuse(PREPARE, "prepare_taken", step=step.name, name=name, other=taken[name].name)


def _pockets(table: Table) -> tuple[int, ...]:
    allowed = said("file.may.pockets", most=MAX_POCKETS)
    value = table.get("pockets", allowed)
    sound = isinstance(value, list) and all(type(one) is int and 0 <= one <= 99999 for one in value)
    if not sound or not 1 <= len(value) <= MAX_POCKETS:
        table.refuse("pockets", "no_pockets", allowed=allowed)
    tools = [one for one in value if one]
    if len(set(tools)) < len(tools):
        table.refuse("pockets", "pocket_twice")
    return tuple(value)


def _step(row: Table, axes: Sequence[Axis], io: Io | None, pockets: int) -> ChangerStep:
    found = replace(
        _switching(row, row.text("input") if row.has("input") else ""),
        move=(*_moves(row, "mm", axes, pockets), *_moves(row, "deg", axes, pockets)),
        orient=row.flag("orient", False),
        carries=row.flag("carries", False),
    )
    _reach(row, found, io, pockets)
    row.finish()
    return found


def _switching(row: Table, input_: str) -> ChangerStep:
    """What every step may do: it tells outputs, and an input says that it is done."""
    return ChangerStep(
        name=row.text("name"),
        within_s=row.number("within_s", 0.1, LONGEST_S),
        fails=row.text("fails"),
        on=row.names("on"),
        off=row.names("off"),
        pocket=row.names("pocket"),
        input=input_,
        level=row.text("level", LEVELS, "rise"),
    )


def _preparing(row: Table, io: Io | None, pockets: int) -> ChangerStep:
    """A step beside a cut: it moves no axis, and an input says that it is done."""
    found = _switching(row, row.text("input"))
    _reach(row, found, io, pockets)
    if found.pocket and found.level in ("on", "off"):
        row.refuse("level", "prepare_level")
    row.finish()
    return found


def _moves(row: Table, unit: str, axes: Sequence[Axis], pockets: int) -> list[tuple[str, tuple[float, ...]]]:
    """``move_mm`` or ``move_deg``: by axis one position, or one of each pocket; within the travel."""
    key = f"move_{unit}"
    entry = row.table(key, f"{row.name} {key}", optional=True)
    known = {axis.name: axis for axis in axes if axis.is_rotary == (unit == "deg")}
    found: list[tuple[str, tuple[float, ...]]] = []
    for name in entry.written:
        if name not in known:
            entry.get(name, said("file.may.position"))
            entry.refuse(name, "no_axis_in", unit=unit, allowed=", ".join(known) or Key("file.none"))
        axis = known[name]
        low, high = sorted((axis.travel_min * axis.shown_per_unit, axis.travel_max * axis.shown_per_unit))
        allowed = said("file.may.positions", low=low, high=high, pockets=pockets)
        value = entry.get(name, allowed)
        places = value if isinstance(value, list) else [value]
        if not all(is_number(one) for one in places) or len(places) not in (1, pockets):
            entry.refuse(name, "no_position", allowed=allowed)
        if not all(low <= one <= high for one in places):
            entry.refuse(name, "beyond_travel", allowed=allowed)
        found.append((name, tuple(float(one) / axis.shown_per_unit for one in places)))
    entry.finish()
    return found


def _reach(row: Table, step: ChangerStep, io: Io | None, pockets: int) -> None:
    """A step does something, by bits that are there, and it is seen to be done."""
    if not (step.move or step.orient or step.switches or step.input):
        row.refuse("name", "step_empty")
    if step.orient and (io is None or io.orient is None):
        row.refuse("orient", "step_orient")
    if set(step.on) & set(step.off):
        row.refuse("off", "step_on_off")
    for key, names, bits in (
        ("on", step.on, io.outputs if io else ()),
        ("off", step.off, io.outputs if io else ()),
        ("pocket", step.pocket, io.outputs if io else ()),
        ("input", (step.input,) if step.input else (), io.inputs if io else ()),
    ):
        for name in names:
            if name not in dict(bits):
                kind = "inputs" if key == "input" else "outputs"
                allowed = ", ".join(one for one, _ in bits) or Key("file.no_io")
                row.refuse(key, "no_bit", name=name, kind=kind, allowed=allowed)
    for key, names in (("on", step.on), ("off", step.off), ("pocket", step.pocket)):
        if not set(names).isdisjoint(OUTPUTS):
            row.refuse(key, "coolant_outputs")
    if step.pocket and pockets >= 1 << len(step.pocket):
        bits_needed = math.ceil(math.log2(pockets + 1))
        row.refuse("pocket", "pocket_bits", count=len(step.pocket), pockets=pockets, needed=bits_needed)
    if step.carries and not step.input:
        row.refuse("carries", "carries_unseen")
    if step.carries and step.level in ("on", "off"):
        row.refuse("level", "carries_level")


def audit(machine: Machine, table: Table) -> None:
    """The tools of the pockets are in the tool table."""
    if machine.changer is None:
        return
    known = {tool.number for tool in machine.tools}
    for tool in machine.changer.pockets:
        if tool and tool not in known:
            allowed = ", ".join(f"T{number}" for number in sorted(known))
            table.get("pockets", said("file.may.tool_numbers"))
            table.refuse("pockets", "pocket_of_nobody", tool=tool, allowed=allowed)
