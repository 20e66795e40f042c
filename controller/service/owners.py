"""What a service is put together of: who owns what of one machine."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from controller import sealed_file
from controller.ipc import control_socket
from controller.ipc.control_socket import CommandRefused
from controller.machine import setup_data
from controller.machine.model import Changer, Machine
from controller.messages import Message
from controller.runtime.bus_load import overload
from controller.runtime.plan_messages import News
from controller.runtime.startup import SessionError
from controller.service import alarms, durations, journal, older_files, runs
from controller.service.alarms import Alarms
from controller.service.engine import Engine
from controller.service.fault_reporter import Troubles
from controller.service.folders import Folders
from controller.service.journal import Journal
from controller.service.probed import Probed
from controller.service.processes import Processes
from controller.service.room import Room
from controller.service.sequencer import Sequencer
from controller.service.set_up import SetUp
from controller.service.thread_guard import ThreadGuard
from controller.service.tool_changer import ToolChanger
from controller.service.usage import Usage
from controller.store.service_store import ServiceStore
from controller.store.tool_store import ToolStore

SEALED = setup_data.MACHINE, control_socket.LAST  # what it notes beside its store


class Owners:
    """Who owns what of a machine, but for the run and who looks on; the folders must be writable."""

    def __init__(
        self, machine: Machine, kept: Folders, hear: Callable[[News], None], engine: Engine | None = None
    ) -> None:
        """``hear`` takes what the plan says; ``engine``: None makes one.

        Raises SessionError, ConfigError, OSError.
        """
        if sentence := overload(machine):
            raise SessionError(sentence)
        kept.make()
        self.state = state = kept.state
        self.store = ServiceStore(state)
        losses = older_files.take_over(self.store, state)
        self.alarms, self.room = Alarms(self.store), Room(kept, machine)
        self._folder = tempfile.TemporaryDirectory(prefix="directrix-")
        folder = Path(self._folder.name)
        self.engine = engine or Engine(machine, folder, kept, hear)
        self.set_up = SetUp(machine, self.store, self.alarms, self.engine.tell_tool)
        self.usage = Usage(self.store, machine)
        self.probed, self.durations = Probed(self.store), durations.of_service(self.store)
        self.thread = ThreadGuard(self.store)
        self.sequencer = Sequencer(self._failed)
        self.writer = ThreadPoolExecutor(1, "records")  # of what runs leave
        entry = journal.read(self.store)
        self.interrupted = entry if entry is not None and not entry.ended else None  # a run, by the last end
        self.journal = Journal(self.store, last=entry)
        for damaged in (*self.store.losses, *losses):
            self.alarms.add(alarms.DAMAGE, damaged)
        for lost in runs.settle(self.store, state):
            self.alarms.add(runs.ALARM, lost)
        runs.index(self.store, state)
        sealed_file.mark(state, SEALED)
        self.troubles = Troubles(self.set_up.machine, self.alarms, self.writer)
        self.processes = Processes(self.engine, self.troubles, kept.recordings)
        self.changer = self._opened_changer()

    def _opened_changer(self) -> ToolChanger | None:
        """Where the machine has one: which tool is in the spindle, its store says."""
        set_up = self.set_up
        if set_up.machine.changer is None:
            return None

        def changer() -> Changer:
            """As its pockets are now."""
            assert set_up.machine.changer is not None
            return set_up.machine.changer

        store = ToolStore(self.store)
        machine, add = set_up.machine, self.alarms.add
        made = ToolChanger(store, changer, self.engine, add, machine.period_s, self._worn, machine.io)
        set_up.find(made.whereabouts.spindle)
        return made

    def check_store(self) -> None:
        """As each start does: an alarm says what is lost. A disk that does not answer is looked at again."""
        with contextlib.suppress(OSError):
            losses = self.store.check()
            for loss in losses:
                self.alarms.add(alarms.DAMAGE, loss)
            if losses:  # what is known is put anew
                runs.index(self.store, self.state)
                self.set_up.keep()
                self.set_up.put_in(self.set_up.tool)
                self.journal.keep()
                self.thread.save()
            if losses and self.changer is not None:
                self.changer.store.forget()

    def _worn(self, tool: int) -> Message | None:
        """What is said before a tool comes whose life is over; None of any other."""
        return self.usage.worn_message("change_worn", tool, self.set_up.tool_numbers)

    def _save_usage(self, at_once: bool = False) -> None:
        """Counters that cannot be kept are kept later."""
        with contextlib.suppress(OSError):
            self.usage.save(at_once)

    def _failed(self, name: str, error: CommandRefused) -> None:
        """Work that came to nothing after its answer may have gone out already."""
        if error.code != "busy" and name in ("power up", "home", "enable", "reset"):
            self.alarms.add(f"{name} failed".upper().replace(" ", "_"), error.said)
