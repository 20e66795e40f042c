"""Runs and alarms in the store of a state folder, as its service writes them: for tests of who reads."""

from __future__ import annotations

import contextlib
import time
from functools import cache
from pathlib import Path
from typing import Any

from controller.messages import Message, plain
from controller.service import runs
from controller.service.alarms import Alarms
from controller.store import history, service_store
from controller.store.service_store import ServiceStore


def begin(state: Path) -> None:
    """A store in which nothing is, where there is none, at no cost."""
    if not (file := state / service_store.FILE).exists():
        file.write_bytes(_empty())


@cache
def _empty() -> bytes:
    with contextlib.closing(service_store.in_memory(None)) as sql:
        return sql.serialize()


def settled(state: Path) -> list[Message]:
    """What a service that starts on these records says of them."""
    with contextlib.closing(ServiceStore(state)) as store:
        return runs.settle(store, state)


def indexed(state: Path) -> list[history.Run]:
    """The runs that a service which starts on these records knows."""
    written = WrittenHistory(state)
    runs.index(written.store, state)
    written.store.close()
    return written.runs()


class WrittenHistory:
    """The service's end of it, which is never closed."""

    def __init__(self, state: Path) -> None:
        self.state, self.store = state, ServiceStore(state)
        self._alarms = Alarms(self.store)

    def run(self, program: str, result: str = "completed", record: str = "", **facts: Any) -> int:
        """A run that has ended just now; its number."""
        number, now_s = len(history.records(self.store)) + 1, time.time()
        known = {"id": record or f"record{number}", "started_s": now_s - 1.0, "ended_s": now_s}
        with self.store.write() as sql:
            history.add_run(sql, {"name": program, "result": result, "sha256": "0" * 64, **known, **facts})
        return number

    def alarm(self, name: str, said: Message | str, axis: str = "", **facts: Any) -> int:
        """Its number."""
        return int(self._alarms.add(name, plain(said), axis=axis, **facts)["id"])

    def acknowledge(self, number: int | None, by: str = "") -> None:
        self._alarms.acknowledge(number, by)

    def runs(self) -> list[history.Run]:
        with history.reading(self.state) as past:
            return past.runs()

    def alarms(self) -> list[history.Alarm]:
        with history.reading(self.state) as past:
            return past.alarms()
