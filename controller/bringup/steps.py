"""The steps of a bring-up, declared once: in the order in which they are done, for a machine as it is built.

What is done in a step of a kind is in ``conduct.CONDUCT``. Its texts are ``bringup.step.KIND.title``, ``.do``
(what happens, and what moves) and ``.look`` (what the operator looks at).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from controller.machine.model import Axis, Machine
from controller.messages import Message, message

ESTOP_INPUT = "estop"


@dataclass(frozen=True, slots=True)
class Kind:
    """``of``: what there is a step for, by name; "" = one for the machine. ``moves``: axes or the spindle."""

    name: str
    of: Callable[[Machine], list[str]]
    moves: bool


@dataclass(frozen=True, slots=True)
class Step:
    """One step of a machine. ``name`` is how it is asked for: its kind, and behind a dot what it is of."""

    kind: str
    of: str
    moves: bool

    @property
    def name(self) -> str:
        return f"{self.kind}.{self.of}" if self.of else self.kind

    def text(self, which: str) -> Message:
        return message(f"bringup.step.{self.kind}.{which}", of=self.of)


def _once(machine: Machine) -> list[str]:
    return [""]


def _axes(which: Callable[[Axis], bool]) -> Callable[[Machine], list[str]]:
    return lambda machine: [axis.name for axis in machine.axes if which(axis)]


def _where(there: Callable[[Machine], bool]) -> Callable[[Machine], list[str]]:
    return lambda machine: [""] if there(machine) else []


def _planes(machine: Machine) -> list[str]:
    names = [axis.name for axis in machine.axes if not axis.is_rotary]
    return [plane for plane in ("XY", "XZ", "YZ") if set(plane) <= set(names)]


def _every(axis: Axis) -> bool:
    return True


def _has_input(name: str) -> Callable[[Machine], bool]:
    return lambda machine: machine.io is not None and machine.io.input(name) is not None


KINDS: tuple[Kind, ...] = (
    Kind("inputs", _where(lambda machine: machine.io is not None), moves=False),
    Kind("switches", _axes(_every), moves=False),
    Kind("estop", _where(_has_input(ESTOP_INPUT)), moves=False),
    Kind("sto", _axes(_every), moves=False),
    Kind("brake", _axes(lambda axis: axis.brake), moves=False),
    Kind("scale", _axes(_every), moves=True),
    Kind("response", _axes(_every), moves=True),
    Kind("circle", _planes, moves=True),
    Kind("clamp", _axes(lambda axis: axis.clamp is not None), moves=True),
    Kind("spindle", _where(lambda machine: machine.spindle is not None), moves=True),
    Kind("changer", _where(lambda machine: machine.changer is not None), moves=True),
    Kind("rotaries", _where(lambda machine: bool(machine.rotary())), moves=True),
    Kind("dry_run", _once, moves=True),
)


def steps(machine: Machine) -> list[Step]:
    """All that a machine has."""
    return list(_steps(machine))


def _steps(machine: Machine) -> Iterator[Step]:
    for kind in KINDS:
        yield from (Step(kind.name, of, kind.moves) for of in kind.of(machine))
