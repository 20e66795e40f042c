"""What is set up at the machine, over its file: offsets, tools, pockets, and the tool in the spindle."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

from controller.machine import setup_data
from controller.machine.changes import Change, laid
from controller.machine.model import TOOL_AT_POWER_ON, Machine, Tool
from controller.machine.toml_table import ConfigError
from controller.messages import message, of_error
from controller.service.alarms import Alarms
from controller.service.refusals import refused
from controller.store.service_store import ServiceStore
from controller.store.set_up_store import FITTING, SPINDLE


class Fitted(NamedTuple):
    """A machine as programs see it, and what was set over its file to make it so."""

    machine: Machine
    values: dict[str, Any]


class SetUp:
    """Any thread reads; whoever changes it, or begins what it must not change under, holds ``lock``."""

    def __init__(
        self, file: Machine, store: ServiceStore, alarms: Alarms, tell_tool: Callable[[int], object]
    ) -> None:
        """``file``: as its builder wrote it; ``tell_tool``: who else must know the tool in the spindle.

        Raises ConfigError, OSError.
        """
        self._store, self._alarms, self._tell_tool = store, alarms, tell_tool
        self.file = file
        values = store.document(FITTING, lambda found: setup_data.sound(found, store.file), dict[str, Any]())
        setup_data.note(store.file.parent, file)
        self._fitted = Fitted(self.applied(values), values)  # replaced as a whole
        # Number of the one there: T1 where nobody has changed it yet; 0: not known.
        self.tool = store.document(SPINDLE, int, TOOL_AT_POWER_ON)
        if not store.is_newest(SPINDLE):
            self.tool = 0
            self._put(SPINDLE, 0, "TOOL")
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
            self._store.put(FITTING, values)
        except OSError as error:
            raise refused("not_written", code="busy", path=self._store.file, why=error) from error
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
        self._put(FITTING, self.fitted, "NOT_KEPT")

    def find(self, tool: int) -> None:
        """At the beginning, as a changer's store has it."""
        self.tool = tool

    def put_in(self, tool: int) -> None:
        """Another tool is in the spindle; 0: nobody knows which."""
        self.tool = tool
        self._tell_tool(tool)
        self._put(SPINDLE, tool, "TOOL")

    def _put(self, document: str, value: Any, alarm: str) -> None:
        try:
            self._store.keep(document, value)
        except OSError as error:
            self._alarms.add(alarm, message("not_written", path=self._store.file, why=error))

    def with_tools(self, fitted: dict[str, Any], tools: Iterable[Tool]) -> dict[str, Any]:
        """What a program was started with, and what an operator has changed of ``tools`` since."""
        machine, values = self._fitted
        theirs = {str(tool.number) for tool in set(tools) ^ set(machine.tools)}
        changed = {key: row for key, row in values.get("tools", {}).items() if key in theirs}
        return {**fitted, "tools": {**fitted.get("tools", {}), **changed}} if changed else fitted
