"""How a command is declared."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum, StrEnum
from typing import Any

from controller.commands.arguments import Argument


class Access(StrEnum):
    """Who may give a command."""

    LOOK = "look"  # who may look at all; it changes nothing
    STOP = "stop"  # who may operate, or where the panel has it so anybody who may look; no control token
    OPERATE = "operate"  # who may operate; no control token
    MOVE = "move"  # who may operate and holds the control token
    SET_UP = "set_up"


class Lane(StrEnum):
    """Commands that the panel may let wait for one another."""

    QUICK = "quick"
    STOP = "stop"  # never waits for others
    LOOK = "look"
    SLOW = "slow"  # what waits for a plan, a disk or motion


LANES = {Access.STOP: Lane.STOP, Access.LOOK: Lane.LOOK}


@dataclass(frozen=True, slots=True)
class Rest:
    """The route of a command that is answered by done or refused, made of the declaration."""

    method: str
    path: str
    text: str  # in OpenAPI
    name: str = ""  # of the operation, where it is another one than the command's
    body: str = ""  # name of the body's model; "": the command's own
    body_text: str = ""
    bodiless: bool = False  # the body may be left out
    seen_s: float | None = None  # the status that was seen may be so old; None: as usual
    idle_is_done: bool = False  # refused, for there is nothing to stop, is done


@dataclass(frozen=True, slots=True)
class Client:
    """The verb of the command line that is made of the declaration.

    A number, a text and axes are arguments; a switch alone is the word on or off, several are options.
    """

    name: str
    answer: str  # "client.<answer>" is the text that is printed; of a switch with "_on" or "_off" after it
    off: str = ""  # key of that where the first value is 0
    renamed: tuple[tuple[str, str], ...] = ()  # argument, and its name here where it is another one
    negative: bool = False  # a value such as -3000 is no option
    waits: bool = False  # a run comes of it, whose end may be waited for


@dataclass(frozen=True, slots=True)
class Command:
    """One command. ``needs``: names of what must hold, in the order in which it is looked at (``NEEDS`` of
    ``service.preconditions``); "mode": what the tick's table of modes says of ``request``.
    """

    name: str
    access: Access
    arguments: tuple[Argument, ...] = ()
    request: IntEnum | None = None  # of ``table.Request``: what the tick is asked for, at last
    needs: tuple[str, ...] = ()
    modes: tuple[str, ...] = ()  # in which it is possible besides those of ``request``
    rest: Rest | None = None
    client: Client | None = None
    lane: Lane | None = None  # None: by ``access``
    bit: int = 0  # of a switch in the tick: its place among all of them, in recordings, too; a power of two
    state: str = ""  # of a switch: what the status means by it, in OpenAPI
    open_ended: bool = False  # takes further arguments: the columns of a table
    one_at_a_time: bool = False  # takes long, and is refused while another such command is under way

    @property
    def is_switch(self) -> bool:
        """Whether it does nothing but switch something in the tick, in every mode."""
        return self.bit != 0

    @property
    def title(self) -> str:
        """As refusals name it."""
        return self.name.upper()

    @property
    def way(self) -> Lane:
        return self.lane or LANES.get(self.access, Lane.QUICK)

    def read(self, sent: Mapping[str, Any]) -> dict[str, Any]:
        """The arguments of what was sent; what is not declared is left out. Raises ArgumentError."""
        values = {one.name: one.read(sent) for one in self.arguments}
        return {**sent, **values} if self.open_ended else values
