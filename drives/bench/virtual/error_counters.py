"""A CAN controller's error counters and what becomes of them (ISO 11898-1, fault confinement).

    transmit error +8, receive error +1, each success -1
    ACTIVE --96--> WARNING --128--> PASSIVE --transmit counter 256--> OFF --restart--> ACTIVE

Changes are told to the controller's own ports by error frames in SocketCAN's format
(linux/can/error.h); nobody else on the bus sees them.
"""

from __future__ import annotations

from enum import IntEnum

from drives.pdo import ERROR_FLAG, FRAME
from drives.ports.error_frames import (
    ACTIVE_AGAIN,
    BUS_OFF,
    CONTROLLER,
    RX_PASSIVE,
    RX_WARNING,
    TX_PASSIVE,
    TX_WARNING,
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
