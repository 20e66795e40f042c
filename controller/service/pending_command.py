"""What the plan has sent for an order, and the tick has yet to take: it may never, and that must be told.

A plan is made for the machine as it stands. A stop, a jog or a fault between the order and the
tick's next look makes it void; whoever waits for it would wait for nothing.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

from controller.ipc.control_socket import CommandRefused
from controller.ipc.handoff import Snapshot
from controller.machine.model import Joints
from controller.service.planner_client import Order
from controller.service.refusals import by_now, refused
from controller.state.modes import Mode

TAKEN_S = 120.0  # for the first window to be planned and taken


@dataclass(frozen=True, slots=True)
class Awaited:
    """The first message that is planned for an order."""

    order: int
    before: int  # the message that was accepted last
    mode: Mode  # the only one in which it is taken
    queue: tuple[int, Joints]  # what it is planned for: the epoch, and where the axes stand
    give_up_s: float

    @classmethod
    def of(cls, order: Order, now: Snapshot) -> Awaited:
        """``now``: what was planned from."""
        mode = Mode.READY if order.verb == "arm" else Mode.HOLD
        return cls(order.number, now.accepted, mode, _queue(now), time.monotonic() + TAKEN_S)

    def taken(self, now: Snapshot) -> bool:
        return now.accepted > self.before

    def in_vain(self, now: Snapshot) -> tuple[Any, ...] | None:
        """Why the tick will not take it any more, as the error of an answer; None while it may."""
        if now.mode is not self.mode:
            return _facts(by_now(now))
        if _queue(now) != self.queue:  # a stop that had been on its way, or a jog
            return _facts(refused("stopped"))
        return _facts(refused("not_taken")) if time.monotonic() > self.give_up_s else None


def _queue(now: Snapshot) -> tuple[int, Joints]:
    return now.epoch, now.joints


def _facts(error: CommandRefused) -> tuple[Any, ...]:
    return error.code, error.said, error.mode, error.request
