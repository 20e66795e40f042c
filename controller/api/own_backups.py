"""Back-ups that are saved from the page: archives in a folder of the panel's, the latest of them.

They are what ``directrix backup save`` writes, and are put back by ``directrix backup restore`` alone: the
service must not run then, and it is the panel's.
"""

from __future__ import annotations

import itertools
import os
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

from controller import own_files
from controller.api import backup
from controller.api.store import Store
from controller.machine import setup_data

FOLDER = "backups"  # of the panel's
KEPT = 20  # the oldest go


class Saved(NamedTuple):
    """An archive."""

    name: str
    made_s: float  # seconds since 1970
    size: int  # bytes


def folder_of(store: Store) -> Path:
    """Where they are."""
    return store.own.resolve() / FOLDER


def save(store: Store) -> Saved:
    """Make one of now, and let the oldest go.

    Raises StoreError where the disk is too full, else ConfigError, OSError, ValueError: no service has run on
    the state folder yet, or a part cannot be read.
    """
    machine = setup_data.noted(store.folder)
    store.uploads.room(sum(program.size for program in store.programs.list()))
    folder = folder_of(store)
    own_files.make_folder(folder, folder.parent)
    made = _facts(backup.save(store, machine, _free(folder / datetime.now().strftime("%Y-%m-%dT%H%M%S.zip"))))
    for old in saved(store)[KEPT:]:
        own_files.remove(folder / old.name)
    return made


def saved(store: Store) -> list[Saved]:
    """All that there are, the latest first. Raises OSError."""
    folder = folder_of(store)
    names = [name for name in own_files.names(folder, folder.parent) if name.endswith(".zip")]
    return sorted((_facts(folder / name) for name in names), key=lambda one: one.made_s, reverse=True)


def _free(file: Path) -> Path:
    """The name, or where it is taken another one with a number."""
    taken, names = own_files.names(file.parent), (f"{file.stem}-{n}{file.suffix}" for n in itertools.count(2))
    return file if file.name not in taken else file.with_name(next(n for n in names if n not in taken))


def _facts(file: Path) -> Saved:
    facts = os.stat(file, follow_symlinks=False)
    return Saved(file.name, facts.st_mtime, facts.st_size)
