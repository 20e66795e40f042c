"""Where and how a run begins: what a start needs besides the program, in the service and in its repetition.

The path is the program's own, from the place where a whole run of it starts. The machine may stand
elsewhere when a rest of it is gone on with: then an entry leads to that rest.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

from controller.machine.model import Joints, Machine
from controller.machine.spindle import unasked
from controller.plan.off_path import Back
from controller.plan.report.stored import Stored
from controller.plan.restart import other_tool
from controller.plan.restart.program_position import Spot
from controller.plan.restart.reentry import Fitted
from controller.plan.restart.restart import Rest
from controller.program import carried
from controller.program.modal import State
from controller.runtime import checked
from controller.runtime.checked import Task, Walk
from controller.state.modes import StaysOn


@dataclass(frozen=True, slots=True)
class Start:
    """One start of a program."""

    joints: Joints  # mm, rad: where the machine stands
    plan_time_s: float  # of the path clock
    spot: Spot | None = None  # to go on from; None: from the top
    whole_from: Joints | None = None  # where the whole run starts that ``spot`` is of; None: homed position
    dry_run_mm: float = 0.0  # off along the tool axis, spindle off
    in_spindle: int = 0  # number of the tool; 0 = not known
    typed: bool = False  # a line by hand, which means that tool
    unchecked: bool = False  # from the top, with branch and turns chosen as the blocks come
    begin: State | None = None  # the modal state before the first line; None: that of power-on
    asks_spindle: bool = True  # the operator is asked to switch a spindle; False: an older record

    @property
    def stays_on(self) -> StaysOn:
        """What is on of spindle, coolant and outputs, before it and after it."""
        before = StaysOn.BEFORE if self.begin is not None else StaysOn(0)
        return before | StaysOn.AFTER if self.typed else before

    def to_dict(self) -> dict[str, Any]:
        """As JSON has it, without loss."""
        plain = {f.name: getattr(self, f.name) for f in fields(self)}
        begin = None if self.begin is None else carried.to_json(self.begin)
        return {**plain, "spot": None if self.spot is None else list(self.spot), "begin": begin}

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Start:
        """Raises ValueError, KeyError or TypeError for anything but what ``to_dict`` makes."""
        spot, whole = values["spot"], values["whole_from"]
        return cls(
            _joints(values["joints"]),
            float(values["plan_time_s"]),
            None if spot is None else Spot(int(spot[0]), float(spot[1]), int(spot[2]), float(spot[3])),
            None if whole is None else _joints(whole),
            float(values["dry_run_mm"]),
            int(values["in_spindle"]),
            bool(values.get("typed", False)),
            bool(values.get("unchecked", False)),
            None if values.get("begin") is None else carried.from_json(values["begin"]),
            bool(values.get("asks_spindle", False)),
        )


def _joints(values: Iterable[Any]) -> Joints:
    return tuple([float(q) for q in values])


def path_from(asked: Task, kept: Stored | None, start: Start, cut_with: Machine | None = None) -> Walk:
    """The path of a start; without a check branch and turns are chosen here. Raises ProgramError.

    ``cut_with``: the machine, with its tools, that has cut what comes before the start's spot; None: not
    known. Raises NotPossible where the tool that is fitted now would cut the rest deeper.
    """
    if asked.machine.changer is not None:
        asked = replace(asked, machine=replace(asked.machine, in_spindle=start.in_spindle))
    asked = replace(asked, begin=start.begin, typed=start.typed)
    if not start.asks_spindle:
        asked = replace(asked, machine=replace(asked.machine, spindle=unasked(asked.machine.spindle)))
    choices = kept.choices if kept is not None else None if start.unchecked else checked.chosen_for(asked)
    if start.spot is not None:
        left = rest(asked, choices or {}, start)
        if cut_with is not None:
            _see_cuts_no_deeper(left, cut_with, start.joints)
        entered = left.entered(start.joints, start.in_spindle)
        return Walk(entered, choices=choices or {})
    asked = checked.standing(asked, start.joints)
    walk = checked.path_of(asked, choices, start.dry_run_mm, start.in_spindle)
    walk.notes += kept.notes if kept is not None else ()
    return walk


def _see_cuts_no_deeper(left: Rest, cut_with: Machine, now: Joints) -> None:
    before = cut_with.tool(left.target.modal.tool)
    after = left.target.modal.tool_in(left.source.machine)
    if before is not None and after is not None:
        other_tool.see_cuts_no_deeper(before, after, left, now)


def back_with(left: Rest, before: Machine) -> Back:
    """To what is left of a program, with the tool that is fitted by now for that of ``before``."""
    modal = left.target.modal
    return Back(left.source.fitted(modal), left, before.tool(modal.tool))


def back(asked: Task, tool: int) -> Back:
    """To where a program was left, with the tool of that number; 0 = not known."""
    fitted = asked.machine.tool(tool)
    return Back() if fitted is None else Back(Fitted(fitted, checked.walls_of(asked)))


def rest(asked: Task, choices: Mapping[int, tuple[float, float]], start: Start) -> Rest:
    """What is left of the program from the spot of a start on. Raises ProgramError."""
    assert start.spot is not None
    asked = replace(asked, begin=start.begin)
    if start.whole_from is not None:
        asked = replace(asked, start=start.whole_from)
    return checked.rest_of(asked, choices, start.spot, start.dry_run_mm)
