"""The panel's own folder in the state folder, which is the service's: neither writes in the other's.

    STATE/          of the service; the panel reads it
    STATE/panel/    of the panel: store, programs, back-ups, pictures, log-in marker; the service reads

A version before had all of it in one. What was the panel's goes into its folder at the first start, or, where
the panel may not write in the state folder, by ``directrix service install``.
"""

from __future__ import annotations

import contextlib
import os
import stat
from pathlib import Path

from controller import own_files
from controller.api import log_in_marker

PANEL = "panel"
STORE = "store.sqlite"
PROGRAMS = "programs"
FOLDERS = (PROGRAMS, "backups", "pictures")


def of(state: Path) -> Path:
    """Where it is."""
    return state / PANEL


def make(state: Path) -> Path:
    """The folder, with what a version before has left beside it. Raises OSError."""
    own = of(state)
    own_files.make_folder(own, state)
    left = own_files.names(state)
    if STORE not in own_files.names(own) and {STORE, log_in_marker.FILE} & {*left}:
        ours = [name for name in left if _is_ours(name)]
        for name in sorted(ours, key=lambda name: name == STORE):  # last: an interruption is gone on with
            own_files.rename(state / name, own / name, state)
        if os.geteuid() == 0:
            _give_all(own, state)
    return own


def _is_ours(name: str) -> bool:
    return name in (*FOLDERS, log_in_marker.FILE) or name.startswith((STORE, "store.schema"))


def part(state: Path) -> None:
    """Root has the panel's folder, which is there, belong to its owner with all that is in it; and nobody but
    its owner write in a folder of the service. Raises OSError.
    """
    _give_all(make(state), state)
    with own_files.folder(state) as at:
        of_service = os.fstat(at)
        for _, folders, _, inner in os.fwalk(".", dir_fd=at, follow_symlinks=False):
            with contextlib.suppress(ValueError):
                folders.remove(PANEL)
            _belongs(inner, of_service)


def _give_all(own: Path, state: Path) -> None:
    with own_files.folder(own, state) as at:
        _give(own, state, os.fstat(at))


def _give(path: Path, state: Path, to: os.stat_result) -> None:
    """A link, and a file that has a second name, stay whose they are."""
    with contextlib.suppress(OSError):
        with own_files.folder(path, state) as at:
            _belongs(at, to)
        for name in own_files.names(path, state):
            _give(path / name, state, to)
        return
    with contextlib.suppress(OSError), own_files.opened(path, os.O_RDWR, state, shared=True) as file:
        _belongs(file.fileno(), to)


def _belongs(handle: int, to: os.stat_result) -> None:
    """To whom it is given; the group reads it."""
    os.fchown(handle, to.st_uid, to.st_gid)
    os.fchmod(handle, stat.S_IMODE(os.fstat(handle).st_mode) & 0o750)
