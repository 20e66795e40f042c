"""Fault confinement on a stepped bus: who has seen how many errors, and who is off the bus."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Protocol

from drives.bench.virtual.error_counters import RECOVERY_BITS, Controller, Level
from drives.bench.virtual.nodes import Agenda
from drives.ports.error_frames import restarted_frame


class Bus(Protocol):
    """What is asked of the bus of these controllers; sources are as ``SteppedBus`` counts them."""

    bit_rate: int
    agenda: Agenda

    def is_port(self, source: int) -> bool: ...

    def mute(self, source: int) -> None: ...

    def take_again(self, source: int) -> None: ...

    def forget_routes(self) -> None: ...

    def hand(self, frame: bytes, at_s: float, sources: Sequence[int]) -> None: ...


class Confinement:
    """The CAN controllers of all that send on a bus, by source; several sources may share one."""

    def __init__(self, bus: Bus) -> None:
        self.troubled = False  # some counter is not 0
        self.restart_s = math.inf  # a bus-off port is back after this; SocketCAN's restart-ms (0 = never)
        self._bus = bus
        self._controllers: list[Controller] = []
        self._recovery_s = RECOVERY_BITS / bus.bit_rate if bus.bit_rate else 0.0

    def add(self, controller: Controller) -> None:
        """The controller of the next source."""
        self._controllers.append(controller)

    def of(self, source: int) -> Controller:
        return self._controllers[source]

    def hears(self, source: int) -> bool:
        return self._controllers[source].level is not Level.OFF

    def users(self, controller: Controller) -> list[int]:
        """The sources that send by one CAN controller."""
        return [source for source, used in enumerate(self._controllers) if used is controller]

    # -- counting

    def spoilt(self, source: int, now_s: float) -> None:
        """A frame of this source has been ended by an error frame."""
        self.troubled = True
        self._count(source, Controller.failed, now_s)

    def carried(self, source: int, now_s: float) -> None:
        """A frame went well; with all counters at 0 there is nothing to count any more."""
        self._count(source, Controller.succeeded, now_s)
        self.troubled = any(not c.clean for c in self._controllers if c.level is not Level.OFF)

    def _count(self, source: int, event: Callable[[Controller, bool], bool], now_s: float) -> None:
        sending = self._controllers[source]
        for controller in dict.fromkeys(self._controllers):
            if not event(controller, controller is sending):
                continue
            if controller.level is Level.OFF:
                self.switch_off(controller, now_s)
            else:
                self._tell(controller, controller.error_frame(), now_s)

    # -- bus-off

    def switch_off(self, controller: Controller, now_s: float, restarts: bool = True) -> None:
        """Bus-off: it neither sends nor hears, and what it had waiting is gone.

        A device's controller comes back by itself after 128 x 11 bits, a port's after
        ``restart_s``; neither does if not ``restarts``.
        """
        controller.switch_off()
        users = self.users(controller)
        for source in users:
            self._bus.mute(source)
        self._tell(controller, controller.error_frame(), now_s)
        self._bus.forget_routes()
        at_port = any(self._bus.is_port(user) for user in users)
        after_s = self.restart_s if at_port else self._recovery_s
        if restarts and after_s < math.inf:
            self._bus.agenda.add(now_s + after_s, lambda at_s: self.restart(controller, at_s))

    def restart(self, controller: Controller, now_s: float) -> None:
        """Let a bus-off controller take part again."""
        if controller.level is not Level.OFF:
            return
        controller.restart()
        for source in self.users(controller):
            self._bus.take_again(source)
        self._tell(controller, restarted_frame(), now_s)
        self._bus.forget_routes()

    def _tell(self, controller: Controller, frame: bytes, now_s: float) -> None:
        """An error frame is the word of a CAN controller to its own ports, and to who keeps a log."""
        self._bus.hand(frame, now_s, self.users(controller))
