"""Runs and alarms, as the service has them in its store; where the service is gone nothing is read."""

from __future__ import annotations

import asyncio
import sqlite3
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from controller.api.answers import Refusal
from controller.api.database import StoreError
from controller.api.service_client import Watch
from controller.store import history, service_store
from controller.store.history import History

T = TypeVar("T")


class Past:
    """Asks the service's store, read-only."""

    def __init__(self, state: Path, watch: Watch) -> None:
        self._state, self._watch = state, watch

    async def ask(self, question: Callable[[History], T]) -> T:
        """What a question, in a thread, finds there. Raises Refusal where the service does not answer, and
        StoreError where its store cannot be read.
        """
        await self._watch.status()
        return await asyncio.to_thread(self._read, question)

    async def ask_if_there(self, question: Callable[[History], T]) -> T | None:
        """None where that cannot be known now."""
        try:
            return await self.ask(question)
        except (Refusal, StoreError):
            return None

    def _read(self, question: Callable[[History], T]) -> T:
        try:
            with history.reading(self._state) as past:
                return question(past)
        except (OSError, sqlite3.Error) as error:
            file = self._state / service_store.FILE
            raise StoreError.of("store", "store_unread", file=file, why=error) from error
