"""Runs that have cut surfaces are judged as their drives have cut them, by a process after all else.

What comes of it is shown with the facts of the run, beside the verdict on the plan that its check has. So is
that nothing came of it, and why: such a run is judged again only when somebody asks for it.
"""

from __future__ import annotations

import asyncio
import contextlib
import sys
from collections import deque
from pathlib import Path
from typing import Any

from controller.api.answers import Refusal
from controller.api.checker import Errand
from controller.api.past import Past
from controller.api.store import Store
from controller.messages import message
from controller.program.source_text import may_cut
from controller.state.record_files import ACTUAL, PROGRAM, RUNS
from controller.store.history import History, Run

WORKER = (sys.executable, "-m", "controller.cli.verdict_worker")
LONGEST_S = 3600.0
LOOK_S = 5.0  # between two looks at what has ended
NEWEST = 20  # runs that are looked at: what is older when a panel begins stays as it is


def record_name(run: Run) -> str:
    """Name of the folder that the service wrote, which may be gone; empty where there never was one."""
    return Path(str(run.facts.get("record", ""))).name


class NoAnswer(Exception):
    """The process has died, or taken too long."""


class NothingToJudge(Exception):
    """The run goes on, has cut no surface, or its record is gone."""


class RunVerdicts:
    """Has one run after another judged."""

    def __init__(self, store: Store, past: Past, worker: tuple[str, ...] = WORKER) -> None:
        self._store, self._past, self._errand = store, past, Errand(worker, LONGEST_S)
        self._left: set[int] = set()  # runs that are not judged: they cut nothing
        self._asked: deque[int] = deque()  # runs that are judged again

    async def run(self) -> None:
        """Never ends."""
        while True:
            if not await self.judge_next():
                await asyncio.sleep(LOOK_S)

    async def judge_next(self) -> bool:
        """Whether there was one. Raises StoreError."""
        found = None
        with contextlib.suppress(Refusal):  # the service is gone
            found = await self._past.ask(self._next)
        if found is None:
            return False
        record, answer = self._record(found), dict[str, Any]()
        try:
            answer = await self._errand.run({"record": str(record)}, NoAnswer(), NoAnswer())
        except NoAnswer:
            answer = {"refused": message("run_verdict_failed", record=record.name, hours=LONGEST_S / 3600.0)}
        await asyncio.to_thread(self._store.verdicts.set, record.name, answer, "verdicts")
        return True

    def ask(self, run: Run) -> None:
        """Have a run judged, again where it was. Raises NothingToJudge."""
        if not self._cuts(self._record(run)):
            raise NothingToJudge
        if run.id not in self._asked:
            self._asked.append(run.id)

    def _next(self, past: History) -> Run | None:
        while self._asked:
            if (asked := past.run(self._asked.popleft())) is not None:
                return asked
        for one in past.runs(NEWEST):
            if one.id in self._left or self._store.verdicts.get(record_name(one)) is not None:
                continue
            if self._cuts(self._record(one)):
                return one
            self._left.add(one.id)
        return None

    def _record(self, run: Run) -> Path:
        return self._store.folder / RUNS / record_name(run)

    def _cuts(self, record: Path) -> bool:
        """Whether a record says where the drives were, of a program that may cut a surface."""
        with contextlib.suppress(OSError):
            return (record / ACTUAL).is_file() and may_cut((record / PROGRAM).read_bytes())
        return False
