"""Refusals of the service in both languages, by their key in the catalogue."""

from __future__ import annotations

from collections.abc import Callable

from controller import catalogue
from controller.door import DoorError
from controller.handoff import Snapshot
from controller.state import Fault, sentence


def refused(
    key: str, mode: str = "", request: str = "", code: str = "refused", **values: object
) -> DoorError:
    """The refusal of that key, with what its text has places for; see ``DoorError`` for the others."""
    values |= {"mode": mode, "request": request}
    return in_both(lambda language: catalogue.refusal(key, language, **values), mode, request, code)


def in_both(
    words: Callable[[str], str], mode: str = "", request: str = "", code: str = "refused"
) -> DoorError:
    """The refusal whose sentence ``words`` gives for a language."""
    return DoorError(code, words("en"), mode, request, words("de"))


def by_fault(fault: Fault, mode: str = "", request: str = "", code: str = "refused") -> DoorError:
    """The refusal whose sentence is a row of the fault table."""
    return in_both(lambda language: sentence(fault, language=language), mode, request, code)


def by_now(now: Snapshot, request: str = "") -> DoorError:
    """The refusal because of the mode that the machine has come to; of a fault with which, and what to do."""
    mode = now.mode.name
    return refused("by_now", mode, request) if now.fault is Fault.NONE else by_fault(now.fault, mode, request)
