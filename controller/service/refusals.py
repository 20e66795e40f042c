"""Refusals of the service, by their key in the catalogue."""

from __future__ import annotations

from controller.ipc.control_socket import CommandRefused
from controller.ipc.handoff import Snapshot
from controller.messages import said
from controller.state.modes import Fault, told


def refused(
    key: str, mode: str = "", request: str = "", code: str = "refused", **values: object
) -> CommandRefused:
    """The refusal of that key, with what its text has places for; see ``CommandRefused`` for the others."""
    return CommandRefused(code, said(key, **values, mode=mode, request=request), mode, request)


def by_fault(fault: Fault, mode: str = "", request: str = "", code: str = "refused") -> CommandRefused:
    """The refusal whose sentence is a row of the fault table."""
    return CommandRefused(code, told(fault), mode, request)


def by_now(now: Snapshot, request: str = "") -> CommandRefused:
    """The refusal because of the mode that the machine has come to; of a fault with which, and what to do."""
    mode = now.mode.name
    return refused("by_now", mode, request) if now.fault is Fault.NONE else by_fault(now.fault, mode, request)
