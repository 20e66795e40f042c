"""The store of the panel: one SQLite database and, beside it, the programs as files.

    store = Store(state_folder)
    store.programs.list()              names, sizes, contents; files by sha256
    store.uploads.begin("part.ngc")    the only way in: see ``uploads``
    store.checks / verdicts / settings / marks / queue / users / audit

    STATE/panel/store.sqlite                 facts
    STATE/panel/programs/<sha256>.ngc        contents; written once, never changed
    STATE/panel/programs/.incoming/          what is not complete yet

A name points at a content. A run is of a content, so that nothing that happens to a name
changes what runs; names in use are protected all the same, because that is what an
operator means by "the running program".
"""

from __future__ import annotations

import math
import os
import time
from contextlib import suppress
from pathlib import Path

from controller.api import own_folder
from controller.api.database import Database, StoreError
from controller.api.program_queue import Queue
from controller.api.programs import FOLDER, Checks, Program, ProgramCheck, Programs
from controller.api.records import Audit, Clock, User, Users, Values
from controller.api.uploads import UploadLimits, Uploads
from controller.messages import Message, message

LOSSES = "losses"  # a mark

__all__ = ["Program", "ProgramCheck", "Store", "StoreError", "UploadLimits", "User"]


class Store:
    """Everything that is kept, in one folder; several processes may have it open."""

    def __init__(self, folder: Path, limits: UploadLimits | None = None, clock: Clock = time.time) -> None:
        """Open, or make, the store of a state folder. Raises StoreError."""
        self.folder = folder
        self.database = database = Database(folder)
        self.own = database.file.parent  # the panel's own folder
        self.programs = Programs(database, self.own / FOLDER, clock)
        self.uploads = Uploads(self.programs, limits or UploadLimits())
        self.checks = Checks(database, clock)
        self.verdicts = Values(database, "verdicts", clock)  # on runs, by their records
        self.settings = Values(database, "settings", clock)
        self.marks = Values(database, "marks", clock)  # of this store alone
        self.queue = Queue(database, clock)
        self.users = Users(database, clock)
        self.audit = Audit(database, clock)
        if (aside := database.lost) is not None:
            self.programs.recover()
            self.report(message("store_lost", file=database.file, aside=aside.name))
        if database.is_gone:
            self.programs.recover()
            self.report(message("store_gone", file=database.file))

    def report(self, what: Message) -> None:
        """Something was lost: the panel has the service raise an alarm. Raises StoreError."""
        if what not in (losses := self.losses):
            self.marks.set(LOSSES, [*losses, what], "store")

    @property
    def losses(self) -> list[Message]:
        """Of which the service has raised no alarm yet."""
        found: list[Message] = self.marks.get(LOSSES, [])
        return found

    def losses_reported(self) -> None:
        self.marks.remove(LOSSES)

    def sweep(self) -> int:
        """Take away what a process that died has left half done; how many files. Rows that are damaged are
        taken out and reported. Raises StoreError.
        """
        if (damaged := self.database.take_out_damaged()) is not None:
            self.programs.recover()
            tables, aside = damaged
            self.report(message("store_rows", file=self.database.file, tables=tables, aside=aside.name))
        return self.uploads.sweep() + self.programs.sweep()

    def close(self) -> None:
        self.database.close()


# How much the parts of the state folder take of their disk.

MEASURED_S = 60.0  # how long sizes are taken as known


class Sizes:
    """Sizes of the parts of a folder; looked at now and then, for there may be many files."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._at_s = folder, -math.inf
        self._found: dict[str, int] = {}

    def known(self) -> dict[str, int]:
        """Bytes by the name of what lies in it; files of its own are "store" together."""
        if time.monotonic() - self._at_s > MEASURED_S:
            own_folders = self._folder, own_folder.of(self._folder)
            found = [one for folder in own_folders for one in folder.iterdir() if one != own_folders[1]]
            parts = [one for one in found if one.is_dir()]
            own = sum(_size(one) for one in found if not one.is_dir())
            self._found = {"store": own, **{part.name: _below(part) for part in parts}}
            self._at_s = time.monotonic()
        return self._found


def _below(folder: Path) -> int:
    return sum(_size(Path(at, name)) for at, _, names in os.walk(folder) for name in names)


def _size(file: Path) -> int:
    with suppress(OSError):  # it may just go
        return file.lstat().st_size
    return 0
