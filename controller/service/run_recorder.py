"""The record of the run under way: begun and ended with it, and brought to the disk beside it."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from typing import Any

from controller import messages
from controller.ipc.handoff import Snapshot
from controller.machine.model import Machine
from controller.messages import Message, message
from controller.runtime.plan_messages import Turn
from controller.runtime.starts import Start
from controller.service.engine import Engine
from controller.service.jobs import Job
from controller.service.owners import Owners
from controller.service.room import SPARE_BYTES
from controller.service.runs import Rows, RunRecord
from controller.store import history

IDLE_S = 0.5  # without a record, between two looks whether something else is to be saved
SYNC_S = 0.05  # a loss of power costs so much of a record, and what the disk itself takes


class RunRecorder:
    """A thread of its own has the disk take what is written: nobody else waits for that."""

    def __init__(self, service: Owners, save: Callable[[], object]) -> None:
        """``save`` is called now and then, for what else changes as it runs."""
        self._store, self._room, self._alarms = service.store, service.room, service.alarms
        self._writer, self._save = service.writer, save  # that ends records, and makes room
        self.record: RunRecord | None = None
        self._packing: Future[None] | None = None
        self.unrecorded: Message | None = None  # why the run, or the last one, has no whole record
        self._over = threading.Event()
        self._begun = threading.Event()  # a record is, or all is over
        threading.Thread(target=self._sync, name="sync", daemon=True).start()

    def begin(self, job: Job, machine: Machine, engine: Engine, now: Snapshot | None) -> str:
        """A run is asked for; what was asked of the tick before ``now`` is none of it. The run's id."""
        if (rows := engine.recorder) is not None:
            rows.drain()
        while engine.asked and now is not None and now.has_taken(engine.asked[0].number):
            engine.asked.popleft()
        spot = job.program.spot
        what = {
            "name": job.program.name,
            "sha256": job.sha256,
            "line": spot.line if spot is not None else None,
        }
        self.record, self.unrecorded = RunRecord(self._store.file.parent, machine, what), None
        self._begun.set()
        self._report(self.record)
        return self.record.folder.name

    def started(self, start: Start, job: Job) -> None:
        """From where, and on what."""
        if self.record is not None:
            self.record.begins(start, job.program, job.fitted)

    def planned(self, turns: tuple[Turn, ...], fitted: dict[str, Any]) -> None:
        """When the planner acted; ``fitted``: now."""
        if self.record is not None:
            self.record.planned(turns, fitted)

    def take(self, rows: Rows, engine: Engine, now: Snapshot | None) -> None:
        """The newest rows of the tick, and what was asked of it."""
        if self.record is not None:
            self.record.take(rows, engine.asked, now)
            if self.record.to_pack and (self._packing is None or self._packing.done()):
                self._packing = self._writer.submit(self._pack, self.record)
            self._report(self.record)

    def _pack(self, record: RunRecord) -> None:
        """What is full takes less room from now on, and others go where there is none."""
        record.pack()
        if not self._make_room():
            record.give_up(message("no_room_left", spare=SPARE_BYTES >> 20))

    def _make_room(self) -> bool:
        with contextlib.suppress(OSError):
            return self._room.make()
        return True  # what cannot be written is reported where it is

    def find(self, results: Sequence[dict[str, Any]]) -> None:
        """What probing cycles have found."""
        if self.record is not None:
            self.record.find(results)

    def release(self) -> RunRecord | None:
        """The record, which nothing is added to any more."""
        record, self.record = self.record, None
        return record

    def end(self, result: str, planned_s: float | None, why: Message | None, more: Mapping[str, Any]) -> None:
        """The run is over; ``more``: facts that others have."""
        if (record := self.release()) is not None:
            known = {"planned_s": planned_s, **more, **messages.facts(why)}
            self._writer.submit(self._end, record, result, known)
            self._writer.submit(self._make_room)

    def _end(self, record: RunRecord, result: str, known: Mapping[str, Any]) -> None:
        """Writes the record, and its row; where the disk takes none, the next start does."""
        facts = record.end(result, **known)
        with contextlib.suppress(OSError):
            self._store.insist(lambda sql: history.add_run(sql, facts))

    def close(self) -> None:
        """All is over: nothing goes to the disk beside the run any more."""
        self._over.set()
        self._begun.set()

    def _report(self, record: RunRecord) -> None:
        """Once: nothing of a run is kept, or no more of it than until now."""
        if record.problem and self.unrecorded is None:
            name, key = str(record.what.get("name", "")), "record_ended" if record.began else "not_recorded"
            self.unrecorded = message(key, program=name, why=record.problem)
            self._alarms.add("NOT_RECORDED", self.unrecorded)

    def _sync(self) -> None:
        while not self._over.is_set():
            if self.record is None:
                self._begun.wait(IDLE_S)
                self._begun.clear()
            elif not self._over.wait(SYNC_S) and (record := self.record) is not None:
                record.sync()
            if not self._over.is_set():
                self._save()
