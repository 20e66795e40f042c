"""A door that answers every verb at once and keeps what was asked: for tests of the client verbs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from controller.api.answers import Refusal
from controller.messages import plain


class NotingDoor:
    """Answers every verb at once and keeps what was asked."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, dict[str, Any]]] = []
        self.results: dict[str, dict[str, Any]] = {"load": {"restart": [plain("Work offset G54.")]}}
        self.coming: list[dict[str, Any]] = []  # sequences of the next statuses
        self.jobs: list[dict[str, Any]] = []  # likewise; the last one stays
        self.refused: dict[str, Refusal] = {}
        self.then: dict[str, Callable[[], None]] = {}  # what comes of a verb
        self.before_status: Callable[[], object] = lambda: None
        self.status: dict[str, Any] = {"mode": "READY", "joints": {}, "job": None}

    async def ask(self, verb: str, **args: Any) -> dict[str, Any]:
        if verb != "status":
            self.asked.append((verb, args))
        if verb in self.refused:
            raise self.refused[verb]
        if verb == "status":
            self.before_status()
            if self.jobs:
                self.status["job"] = self.jobs.pop(0)
            return {**self.status, "sequence": self.coming.pop(0) if self.coming else None}
        self.then.get(verb, lambda: None)()
        return self.results.get(verb, {})

    @property
    def verbs(self) -> list[str]:
        """Without the end of a jog that giving control back asks for."""
        return [verb for verb, _ in self.asked if verb != "jog_stop"]
