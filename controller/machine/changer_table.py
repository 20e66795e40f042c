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
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from controller.machine.axes import USUAL_SHARE, Axis
from controller.machine.declaration import Key, declared, key
from controller.machine.equipment import OUTPUTS, Io
from controller.machine.forms import FLAG, NAMES, TEXT, Choice, Number, Own, Rows
from controller.machine.reading import Reading, Rules, Unread
from controller.machine.toml_table import Table, is_number
from controller.messages import Key as TextKey
from controller.messages import message

SEQUENCES = ("put_away", "take")
PREPARE = "prepare"
SWITCHES = ("on", "off", "pocket")
LEVELS = ("rise", "fall", "on", "off")
MAX_POCKETS = 999
LONGEST_S = 600.0
USUAL_STEP_S = 0.3  # a step is expected to take no longer
MAX_BESIDE = 24  # outputs of a changer's preparation ...
BESIDE = 1 << MAX_BESIDE  # ... which travel as two masks in one number: on + off * BESIDE
Moves = tuple[tuple[str, tuple[float, ...]], ...]


def _moves(here: Reading, name: str) -> Moves:
    """``move_mm`` or ``move_deg``: by axis one position, or one of each pocket; within the travel."""
    entry, unit = here.table.table(name, f"{here.table.name} {name}"), name.removeprefix("move_")
    known = {axis.name: axis for axis in here.top["axis"] if axis.is_rotary == (unit == "deg")}
    pockets = None
    with here.file.collecting():
        pockets = len(here.above["pockets"])  # type: ignore[index]
    found: dict[str, tuple[float, ...]] = {}
    for one in entry.written:
        with here.file.collecting():
            if one not in known:
                allowed = ", ".join(known) or TextKey("file.none")
                entry.refuse(one, "no_axis_in", unit=unit, allowed=allowed)
            found[one] = _places(entry, one, known[one], pockets)
    if len(found) < len(entry.written):
        raise Unread(name)
    return tuple(found.items())


def _places(entry: Table, name: str, axis: Axis, pockets: int | None) -> tuple[float, ...]:
    """``pockets``: how many there are; None where that is not known."""
    low, high = sorted((axis.travel_min * axis.shown_per_unit, axis.travel_max * axis.shown_per_unit))
    allowed = message("file.may.positions", low=low, high=high, pockets=pockets or 1)
    value = entry.get(name, allowed)
    places = value if isinstance(value, list) else [value]
    if not all(map(is_number, places)) or (pockets is not None and len(places) not in (1, pockets)):
        entry.refuse(name, "no_position", allowed=allowed)
    if not all(low <= one <= high for one in places):
        entry.refuse(name, "beyond_travel", allowed=allowed)
    return tuple(float(one) / axis.shown_per_unit for one in places)


def _pockets(here: Reading, name: str) -> tuple[int, ...]:
    value = here.table.get(name, POCKETS)
    sound = isinstance(value, list) and all(type(one) is int and 0 <= one <= 99999 for one in value)
    if not sound or not 1 <= len(value) <= MAX_POCKETS:
        here.table.refuse(name, "no_pockets", allowed=POCKETS)
    tools = [one for one in value if one]
    if len(set(tools)) < len(tools):
        here.table.refuse(name, "pocket_twice")
    return tuple(value)


POCKETS = message("file.may.pockets", most=MAX_POCKETS)
POSITIONS = {"type": ["number", "array"], "items": {"type": "number"}}
MOVES = Own(_moves, message("file.may.table"), {"type": "object", "additionalProperties": POSITIONS})


@dataclass(frozen=True, slots=True)
class ChangerStep:
    """One step of a tool changer: its moves, then its outputs, then the input that says it is done."""

    name: str = key(TEXT, "of the step, as the operator calls it")
    within_s: float = key(Number(0.1, LONGEST_S), "not done by then: held, and told")
    fails: str = key(TEXT, "what he is told then")
    move_mm: ClassVar[Key] = declared(
        MOVES,
        "of X Y Z by name: a machine position, or one of each pocket in brackets",
        default=(),
        tables=SEQUENCES,
    )
    move_deg: ClassVar[Key] = declared(MOVES, "likewise of the rotaries", default=(), tables=SEQUENCES)
    # Of each axis that moves where to (mm, rad): one place, or one of each pocket.
    move: Moves = ()
    orient: bool = key(FLAG, "the spindle comes to its angle, as by M19", default=False, tables=SEQUENCES)
    on: tuple[str, ...] = key(NAMES, "outputs of `[io]` that are switched on", default=())
    off: tuple[str, ...] = key(NAMES, "outputs of `[io]` that are switched off", default=())
    pocket: tuple[str, ...] = key(
        NAMES, "outputs that say the pocket's number in binary, the least bit first", default=()
    )
    input: str = key(  # "": nothing is waited for
        TEXT, "of `[io]`: says that the step is done", default="", needed=(PREPARE,)
    )
    level: str = key(
        Choice(LEVELS),
        "what it does then, or is; of a step that carries a change alone counts",
        default="rise",
    )
    # The tool goes from the spindle into its pocket, or the other way.
    carries: bool = key(
        FLAG,
        "the tool is in its pocket (of `take`: in the spindle) when the step is done",
        default=False,
        tables=SEQUENCES,
    )

    @property
    def usual_s(self) -> float:
        """What its input is expected to take, s."""
        return min(USUAL_SHARE * self.within_s, USUAL_STEP_S)

    @property
    def switches(self) -> tuple[str, ...]:
        """Names of all outputs that it tells."""
        return (*self.on, *self.off, *self.pocket)

    def outputs(self, pocket: int) -> list[tuple[str, bool]]:
        """Outputs and whether each is on: a pocket's number before what begins the motion to it."""
        number = [(name, bool(pocket >> bit & 1)) for bit, name in enumerate(self.pocket)]
        return [*number, *((name, True) for name in self.on), *((name, False) for name in self.off)]


@dataclass(frozen=True, slots=True)
class Changer:
    """What M6 does where a machine changes its tools by itself."""

    pockets: tuple[int, ...] = key(  # of pocket 1, 2 ... the number of its tool; 0 = it is nobody's
        Own(_pockets, POCKETS, {"type": "array", "items": {"type": "integer", "minimum": 0}}),
        "the tools of pocket 1, 2 ...; 0: the pocket is nobody's",
    )
    put_away: tuple[ChangerStep, ...] = key(
        Rows(ChangerStep), "the steps that bring the tool of the spindle into its pocket", silent=()
    )
    take: tuple[ChangerStep, ...] = key(
        Rows(ChangerStep), "the steps that bring a tool into the empty spindle", silent=()
    )
    prepare: tuple[ChangerStep, ...] = key(
        Rows(ChangerStep),
        "the steps that bring its pocket to where it is taken; they run from T on, beside the cut",
        default=(),
    )

    @property
    def names(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """The outputs and the inputs that its steps name, each once."""
        steps = (*self.put_away, *self.take, *self.prepare)
        outputs = dict.fromkeys(name for step in steps for name in (*step.on, *step.off, *step.pocket))
        return tuple(outputs), tuple(dict.fromkeys(step.input for step in steps if step.input))

    @property
    def beside(self) -> tuple[str, ...]:
        """The outputs that a preparation switches, each once."""
        return tuple(dict.fromkeys(name for step in self.prepare for name in step.switches))

    def output_word(self, step: ChangerStep, pocket: int) -> float:
        """The outputs that a step of the preparation switches, as the tick takes them; 0.0: none."""
        bits = {name: 1 << i for i, name in enumerate(self.beside)}
        rows = step.outputs(pocket)
        on, off = (sum(bits[name] for name, is_on in rows if is_on is which) for which in (True, False))
        return float(on + off * BESIDE)

    def pocket(self, tool: int) -> int | None:
        """The pocket of a tool, from 1; None where it has none."""
        return self.pockets.index(tool) + 1 if tool and tool in self.pockets else None


def _check_carries(here: Reading) -> None:
    for sequence in SEQUENCES:
        with here.file.collecting():
            if sum(step.carries for step in here[sequence]) != 1:
                here.table.refuse(sequence, "carries_once")


def _check_names(here: Reading) -> None:
    for sequence in SEQUENCES:
        with here.file.collecting():
            names = [step.name for step in here[sequence]]
            if len(set(names)) < len(names):
                here.table.refuse(sequence, "step_twice")


def _check_apart(here: Reading) -> None:
    """What is prepared stands until the tool is over: no step up to there switches any of it."""
    prepare, take = here[PREPARE], here["take"]
    if len(names := {name for step in prepare for name in step.switches}) > MAX_BESIDE:
        here.table.refuse(PREPARE, "prepare_many", count=len(names), most=MAX_BESIDE)
    over = next((k for k, step in enumerate(take) if step.carries), len(take))
    taken = {name: step for step in (*here["put_away"], *take[: over + 1]) for name in step.switches}
    for step in prepare:
        for name in step.switches:
            if name in taken:
                other = taken[name].name
                here.table.refuse(PREPARE, "prepare_taken", step=step.name, name=name, other=other)


RULES: Mapping[type, Rules] = {
    ChangerStep: Rules(fills={"move": lambda here: (*here["move_mm"], *here["move_deg"])}),
    Changer: Rules(checks=(_check_carries, _check_names, _check_apart)),
}


# ---- what only the whole file can show


def check_step(step: Reading) -> None:
    """A step does something, and by outputs of the changer's own."""
    switched = {name: step[name] for name in SWITCHES}
    if not (step["move"] or step["orient"] or any(switched.values()) or step["input"]):
        step.table.refuse("name", "step_empty")
    if set(switched["on"]) & set(switched["off"]):
        step.table.refuse("off", "step_on_off")
    for name, outputs in switched.items():
        with step.file.collecting():
            if not set(outputs).isdisjoint(OUTPUTS):
                step.table.refuse(name, "coolant_outputs")


def check_bits(step: Reading) -> None:
    """The bits that a step names are there."""
    io: Io | None = step.top["io"]
    rows = [(name, step[name], "outputs", io.outputs if io else ()) for name in SWITCHES]
    if step["input"]:
        rows.append(("input", (step["input"],), "inputs", io.inputs if io else ()))
    for key_, names, kind, bits in rows:
        for name in names:
            if name not in dict(bits) and step.file.misses(kind, name):
                allowed = ", ".join(one for one, _ in bits) or TextKey("file.none" if io else "file.no_io")
                with step.file.collecting():
                    step.table.refuse(key_, "no_bit", name=name, kind=kind, allowed=allowed)


def check_orient(step: Reading) -> None:
    """The spindle comes to its angle where the machine has a way to bring it there."""
    io: Io | None = step.top["io"]
    if step["orient"] and (io is None or io.orient is None):
        step.table.refuse("orient", "step_orient")


def check_pocket(step: Reading) -> None:
    """Its outputs can say the number of every pocket."""
    bits = len(step["pocket"])
    if bits and (pockets := len(step.top["changer"].pockets)) >= 1 << bits:
        needed = math.ceil(math.log2(pockets + 1))
        step.table.refuse("pocket", "pocket_bits", count=bits, pockets=pockets, needed=needed)


def check_level(step: Reading) -> None:
    """What says that a step is done cannot have said so before."""
    stands = step["level"] in ("on", "off")
    if step["carries"] and not step["input"]:
        step.table.refuse("carries", "carries_unseen")
    if step["carries"] and stands:
        step.table.refuse("level", "carries_level")
    if step.called == PREPARE and step["pocket"] and stands:
        step.table.refuse("level", "prepare_level")


def check_tools(changer: Reading) -> None:
    """The tools of the pockets are in the tool table."""
    tools = sorted(tool.number for tool in changer.top["tool"])
    for tool in changer["pockets"]:
        if tool and tool not in tools:
            allowed = ", ".join(f"T{number}" for number in tools)
            changer.table.refuse("pockets", "pocket_of_nobody", tool=tool, allowed=allowed)
