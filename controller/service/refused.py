"""Refusals of the service in both languages, by their key in the catalogue."""

from __future__ import annotations

from collections.abc import Callable

from controller import catalogue
from controller.door import DoorError
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
