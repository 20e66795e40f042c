"""The store of the panel: one SQLite database and, beside it, the programs as files.

    store = Store(state_folder)
    store.programs.list()              names, sizes, contents; files by sha256
    store.uploads.begin("part.ngc")    the only way in: see ``uploads``
    store.checks / runs / alarms / offsets / tools / settings / marks / queue / users / audit

    STATE/store.sqlite                 facts
    STATE/programs/<sha256>.ngc        contents; written once, never changed
    STATE/programs/.incoming/          what is not complete yet

A name points at a content. A run is of a content, so that nothing that happens to a name
changes what runs; names in use are protected all the same, because that is what an
operator means by "the running program".
"""

from __future__ import annotations

import time
from pathlib import Path

from controller.api.database import Database, StoreError
from controller.api.program_queue import Queue
from controller.api.programs import Checks, Program, ProgramCheck, Programs
from controller.api.records import (
    ROLES,
    Alarm,
    Alarms,
    Audit,
    Clock,
    Entry,
    Run,
    Runs,
    Token,
    User,
    Users,
    Values,
)
from controller.api.uploads import Upload, UploadLimits, Uploads

__all__ = [
    "ROLES",
    "Alarm",
    "Entry",
    "Program",
    "ProgramCheck",
    "Run",
    "Store",
    "StoreError",
    "Token",
    "Upload",
    "UploadLimits",
    "User",
]


class Store:
    """Everything that is kept, in one folder; several processes may have it open."""

    def __init__(self, folder: Path, limits: UploadLimits | None = None, clock: Clock = time.time) -> None:
        """Open, or make, a store. Raises StoreError."""
        self.folder = folder
        self.database = database = Database(folder)
        self.programs = Programs(database, folder / "programs", clock)
        self.uploads = Uploads(self.programs, limits or UploadLimits())
        self.checks = Checks(database, clock)
        self.runs = Runs(database, clock)
        self.alarms = Alarms(database, clock)
        self.offsets = Values(database, "offsets", "name", "facts", clock)  # as fitted last
        self.tools = Values(database, "tools", "number", "facts", clock)
        self.settings = Values(database, "settings", "key", "value", clock)
        self.marks = Values(database, "marks", "key", "value", clock)  # of this store alone
        self.queue = Queue(database, clock)
        self.users = Users(database, clock)
        self.audit = Audit(database, clock)

    def sweep(self) -> int:
        """Take away what a process that died has left half done; how many files."""
        return self.uploads.sweep() + self.programs.sweep()

    def close(self) -> None:
        self.database.close()
