"""Tick and plan while they live: begun, listened to, asked for what is, and mourned once when they die."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from controller.ipc.control_socket import CommandRefused
from controller.ipc.handoff import Snapshot
from controller.machine import machine_file
from controller.machine.model import Machine
from controller.messages import Key, of_error
from controller.runtime.listener import Listener
from controller.runtime.recording import Keeper
from controller.service import node_status
from controller.service.engine import Engine
from controller.service.fault_reporter import Troubles
from controller.service.refusals import refused
from controller.service.watchdog import STANDS_S, Pulse
from drives.bus import BusError
from drives.log.frame_log import FrameLog

WAIT_S = 0.004
FIRST_TICK_S = 30.0
START_S = 60.0  # longer than any tick takes from the order to its first turn


class Processes:
    """Whether they live and stand, and whether the drives have their settings."""

    def __init__(self, engine: Engine, troubles: Troubles, recordings: Path) -> None:
        """``recordings``: folder for those of faults."""
        self._engine, self._troubles, self._recordings = engine, troubles, recordings
        self.commissioned = False
        self._homing: tuple[int, ...] = ()  # axes that were asked to, while they do
        self.pulse = Pulse()
        self._listener: Listener | None = None
        self._tick_died = self._plan_died = False
        self._begun_s = -START_S

    def start(self, tool: int) -> None:
        """Tick and plan, from nothing; ``tool``: in the spindle."""
        self.commissioned = False
        self._engine.tell_tool(tool)
        self.close()
        self._begun_s = time.monotonic()
        self._engine.start()
        self._tick_died = self._plan_died = False
        self._troubles.begin()
        self.pulse.begin()

    def listen(self, machine: Machine) -> None:
        """To the buses, from the first tick on; ``machine``: of recordings. Raises CommandRefused."""
        self.wait_for(lambda now: now.tick >= 0, FIRST_TICK_S, "first_tick")
        try:
            self._listener = Listener(machine_file.bus_settings(self._engine.machine), node_status.LastFrames)
        except BusError as error:
            raise CommandRefused("gone", of_error(error)) from error
        if (recorder := self._engine.recorder) is not None:
            self._troubles.record_by(Keeper(machine, recorder, self._listener.logs, self._recordings))

    def close(self) -> None:
        """Listen to nothing any more."""
        listener, self._listener = self._listener, None
        self._troubles.record_by(None)
        if listener is not None:
            listener.close()

    @property
    def logs(self) -> Mapping[str, FrameLog]:
        """What was heard on each bus."""
        listener = self._listener
        return dict(listener.logs) if listener is not None else {}

    def drives(self, machine: Machine, now: Snapshot) -> list[dict[str, Any]]:
        """A row per axis, as ``node_status`` has it."""
        return node_status.drives(machine, now, self.logs, self._homing)

    # -- the drives' settings

    def commission(self) -> None:
        """Write and read back every drive's settings, unless they have them. Raises CommandRefused."""
        if not self.commissioned:
            self._engine.line.order("commission")
            self.commissioned = True

    def lose_settings(self) -> None:
        """A drive may have others by now."""
        self.commissioned = False

    def home(self, axes: tuple[int, ...]) -> None:
        """Raises CommandRefused; then a drive may have been left in its homing mode."""
        self._homing = axes
        try:
            self._engine.line.order("home", axes)
        except CommandRefused:
            self.lose_settings()
            raise
        finally:
            self._homing = ()

    # -- what is

    def now(self) -> Snapshot:
        """The newest snapshot. Raises CommandRefused where there is no tick."""
        found = self._engine.snapshot()
        if found is None or not self._engine.tick_alive:
            raise refused("no_tick", "OFF", code="gone")
        return found

    @property
    def starting(self) -> bool:
        """Whether a tick is on its way that has not ticked yet, and may still come."""
        now = self._engine.snapshot()
        return (now is None or now.tick < 0) and time.monotonic() - self._begun_s < START_S

    def stands(self, now: Snapshot) -> bool:
        """Whether the tick's process is there and does not tick: of the machine nothing is known any more."""
        return now.tick >= 0 and self.pulse.age_s(now.tick) >= STANDS_S

    def wait_for(self, done: Callable[[Snapshot], bool], longest_s: float, what: str) -> Snapshot:
        """The first snapshot that is ``done``; ``what`` is a key of the refusals.

        Raises CommandRefused on a dead tick, or when time is over.
        """
        give_up_s = time.monotonic() + longest_s
        while True:
            now = self._engine.snapshot()
            if now is not None and done(now):
                return now
            if not self._engine.tick_alive:
                words = self._engine.last_words()
                raise CommandRefused("gone", words) if words else refused("no_tick", code="gone")
            if time.monotonic() > give_up_s:
                mode = now.mode.name if now is not None else ""
                raise refused("waited", mode, seconds=longest_s, what=Key(what))
            time.sleep(WAIT_S)

    # -- what died

    def died(self) -> str:
        """Which is seen to be gone, and was not before: "tick", "plan" or ""."""
        if not self._engine.tick_alive:
            seen, self._tick_died = self._tick_died, True
            return "" if seen else "tick"
        if self._engine.inverter is not None:
            self._engine.inverter.revive()
        seen, self._plan_died = self._plan_died, self._plan_died or not self._engine.plan_alive
        return "plan" if self._plan_died and not seen else ""

    def mend(self) -> None:
        """A new plan; the tick, the drives and where they are stay as they were."""
        with contextlib.suppress(OSError, CommandRefused):
            self._engine.mend()
        self._plan_died = False
