"""Refusals of the service, by their key in the messages; arguments of a request that must be of a kind."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from controller.ipc.control_socket import CommandRefused
from controller.ipc.handoff import Snapshot
from controller.messages import message
from controller.state.modes import Fault, fault_message


def refused(
    key: str, mode: str = "", request: str = "", code: str = "refused", **values: object
) -> CommandRefused:
    """The refusal of that key, with what its text has places for; see ``CommandRefused`` for the others."""
    return CommandRefused(code, message(key, **values, mode=mode, request=request), mode, request)


def by_fault(fault: Fault, mode: str = "", request: str = "", code: str = "refused") -> CommandRefused:
    """The refusal whose sentence is a row of the fault table."""
    return CommandRefused(code, fault_message(fault), mode, request)


def by_now(now: Snapshot, request: str = "") -> CommandRefused:
    """The refusal because of the mode that the machine has come to; of a fault with which, and what to do."""
    mode = now.mode.name
    return refused("by_now", mode, request) if now.fault is Fault.NONE else by_fault(now.fault, mode, request)


def number(args: Mapping[str, Any], key: str, lowest: float, highest: float) -> float:
    """A number between two finite bounds, which leaves nan and inf out. Raises CommandRefused."""
    value = args.get(key)
    if not isinstance(value, int | float) or isinstance(value, bool) or not lowest <= value <= highest:
        raise refused("not_number", code="bad", name=key, value=value, lowest=lowest, highest=highest)
    return float(value)


def whole(args: Mapping[str, Any], key: str, below: float = math.inf) -> int | None:
    """A whole number from 0, or None where it is missing or null. Raises CommandRefused."""
    value = args.get(key)
    if value is None:
        return None
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < below:
        raise refused("not_whole", code="bad", name=key, value=value)
    return value
