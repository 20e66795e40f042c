"""A CAN controller's error counters and what becomes of them (ISO 11898-1, fault confinement).

    transmit error +8, receive error +1, each success -1
    ACTIVE --96--> WARNING --128--> PASSIVE --transmit counter 256--> OFF --restart--> ACTIVE

Changes are told to the controller's own ports by error frames in SocketCAN's format
(linux/can/error.h); nobody else on the bus sees them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from enum import IntEnum
from typing import Protocol

from drives.bench.virtual.nodes import Agenda
from drives.pdo import ERROR_FLAG, FRAME
from drives.ports.error_frames import (
    ACTIVE_AGAIN,
    BUS_OFF,
    CONTROLLER,
    RX_PASSIVE,
    RX_WARNING,
    TX_PASSIVE,
    TX_WARNING,
    restarted_frame,
)

TRANSMIT_STEP, RECEIVE_STEP = 8, 1
WARNING_AT, PASSIVE_AT, OFF_AT = 96, 128, 256
# A passive receiver's counter falls to between 119 and 127 with the first good frame.
PASSIVE_RECEIVER_BACK = 127

# A bus-off controller may come back after this many recessive bits: 128 times eleven.
RECOVERY_BITS = 128 * 11


class Level(IntEnum):
    """How much a controller may still say."""

    ACTIVE = 0
    WARNING = 1
    PASSIVE = 2
    OFF = 3


class Controller:
    """The counters of one CAN controller; its users may be several ports."""

    __slots__ = ("level", "receive", "transmit")

    def __init__(self) -> None:
        self.transmit = 0
        self.receive = 0
        self.level = Level.ACTIVE

    @property
    def clean(self) -> bool:
        """Nothing is counted: successes change nothing."""
        return self.transmit == 0 and self.receive == 0

    def failed(self, sending: bool) -> bool:
        """An error was seen on the wire; True if the level has changed."""
        if self.level is Level.OFF:
            return False
        if sending:
            self.transmit += TRANSMIT_STEP
        elif self.receive < 255:
            self.receive += RECEIVE_STEP
        return self._settle()

    def succeeded(self, sending: bool) -> bool:
        """A frame went over the wire well; True if the level has changed."""
        if self.level is Level.OFF:
            return False
        if sending:
            self.transmit = max(0, self.transmit - 1)
        elif self.receive > PASSIVE_RECEIVER_BACK:
            self.receive = PASSIVE_RECEIVER_BACK
        else:
            self.receive = max(0, self.receive - 1)
        return self._settle()

    def switch_off(self) -> None:
        """Bus-off, however it came to that."""
        self.transmit = max(self.transmit, OFF_AT)
        self.level = Level.OFF

    def restart(self) -> None:
        self.transmit = self.receive = 0
        self.level = Level.ACTIVE

    def _settle(self) -> bool:
        before = self.level
        worst = max(self.transmit, self.receive)
        if self.transmit >= OFF_AT:
            self.level = Level.OFF
        else:
            self.level = Level((worst >= WARNING_AT) + (worst >= PASSIVE_AT))
        return self.level is not before

    def error_frame(self) -> bytes:
        """What SocketCAN tells of the present level: bus-off, or the controller's status."""
        counters = (min(255, self.transmit), min(255, self.receive))
        if self.level is Level.OFF:
            return FRAME.pack(ERROR_FLAG | BUS_OFF, 8, bytes((0, 0, 0, 0, 0, 0, *counters)))
        status = (
            self._side(self.transmit, TX_WARNING, TX_PASSIVE)
            | self._side(self.receive, RX_WARNING, RX_PASSIVE)
            or ACTIVE_AGAIN
        )
        return FRAME.pack(ERROR_FLAG | CONTROLLER, 8, bytes((0, status, 0, 0, 0, 0, *counters)))

    @staticmethod
    def _side(counter: int, warning: int, passive: int) -> int:
        if counter >= PASSIVE_AT:
            return passive
        return warning if counter >= WARNING_AT else 0


# ---- fault confinement on a stepped bus: who has seen how many errors, and who is off the bus ----


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
