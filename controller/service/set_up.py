"""What is set up at the machine, over its file: offsets, tools, pockets, and the tool in the spindle."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from controller.machine import setup_data
from controller.machine.changes import Change, laid
from controller.machine.model import TOOL_AT_POWER_ON, Machine, Tool
from controller.machine.toml_table import ConfigError
from controller.messages import message, of_error
from controller.service import kept_file
from controller.service.alarms import Alarms
from controller.service.refusals import refused


class Fitted(NamedTuple):
    """A machine as programs see it, and what was set over its file to make it so."""

    machine: Machine
    values: dict[str, Any]


class SetUp:
    """Any thread reads; whoever changes it, or begins what it must not change under, holds ``lock``."""

    def __init__(
        self, file: Machine, state: Path, alarms: Alarms, tell_tool: Callable[[int], object]
    ) -> None:
        """``file``: as its builder wrote it; ``tell_tool``: who else must know the tool in the spindle.

        Raises ConfigError, OSError.
        """
        self._state, self._alarms, self._tell_tool = state, alarms, tell_tool
        self.file = file
        kept, none = state / setup_data.FILE, dict[str, Any]()
        values, damaged = kept_file.read(kept, lambda found: setup_data.sound(found, kept), none)
        setup_data.note(state, file)
        self._fitted = Fitted(self.applied(values), values)  # replaced as a whole
        spindle = state / setup_data.IN_SPINDLE
        # Number of the one there: T1 where nobody has changed it yet; 0: not known.
        self.tool, tool_damaged = kept_file.read_newest(spindle, int, TOOL_AT_POWER_ON, 0)
        self.damaged = tuple(one for one in (damaged, tool_damaged) if one is not None)
        self.lock = threading.Lock()  # taken before that of a run

    @property
    def machine(self) -> Machine:
        """As programs see it."""
        return self._fitted.machine

    @property
    def fitted(self) -> dict[str, Any]:
        """What was set over the machine file."""
        return self._fitted.values

    @property
    def tool_numbers(self) -> list[int]:
        """Of the tool table as it is now."""
        return [tool.number for tool in self.machine.tools]

    def to_json(self) -> dict[str, Any]:
        """Offsets and tools as they are, and which of them were set here."""
        return setup_data.to_json(*self._fitted)

    def fit(self, machine: Machine, values: dict[str, Any]) -> None:
        """Other offsets or tools from now on. Raises CommandRefused where the disk does not take them."""
        try:
            setup_data.save(self._state, values)
        except OSError as error:
            raise refused("not_written", code="busy", path=self._state, why=error) from error
        self.take(Fitted(machine, values))

    def applied(self, values: dict[str, Any]) -> Machine:
        """The machine of the file with what was set over it. Raises ConfigError."""
        return setup_data.applied(self.file, values)

    def laid(self, changes: Sequence[Change]) -> Fitted | None:
        """With what a program sets; None, and an alarm, where the reader of machine files refuses it."""
        try:
            values = laid(self.fitted, self.machine, changes)
            return Fitted(self.applied(values), values)
        except ConfigError as error:
            self._alarms.add("NOT_KEPT", of_error(error))
            return None

    def take(self, fitted: Fitted) -> None:
        """From now on it is so."""
        self._fitted = fitted

    def keep(self) -> None:
        """As it is now; what the disk does not take is an alarm."""
        try:
            setup_data.save(self._state, self.fitted)
        except OSError as error:
            self._not_written("NOT_KEPT", error)

    def find(self, tool: int) -> None:
        """At the beginning, as a changer's store has it."""
        self.tool = tool

    def put_in(self, tool: int) -> None:
        """Another tool is in the spindle; 0: nobody knows which."""
        self.tool = tool
        self._tell_tool(tool)
        try:
            setup_data.put_in(self._state, tool)
        except OSError as error:
            self._not_written("TOOL", error)

    def _not_written(self, what: str, error: OSError) -> None:
        self._alarms.add(what, message("not_written", path=self._state, why=error))

    def with_tools(self, fitted: dict[str, Any], tools: Iterable[Tool]) -> dict[str, Any]:
        """What a program was started with, and what an operator has changed of ``tools`` since."""
        machine, values = self._fitted
        theirs = {str(tool.number) for tool in set(tools) ^ set(machine.tools)}
        changed = {key: row for key, row in values.get("tools", {}).items() if key in theirs}
        return {**fitted, "tools": {**fitted.get("tools", {}), **changed}} if changed else fitted
