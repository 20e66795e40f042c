"""The only way into the program store: a temporary file that becomes a program whole, or goes.

    with store.uploads.begin("part.ngc", sha256=...) as upload:
        for chunk in ...: upload.write(chunk)
        program = upload.commit(in_use)          # without this, leaving the block keeps nothing

The temporary file is locked as long as its process lives, so that a sweep by another process
knows the remains of a dead one from an upload that is under way.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import hashlib
import os
import secrets
import shutil
import threading
import time
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from controller import own_files
from controller.api import names
from controller.api.database import StoreError
from controller.api.programs import Program, Programs
from controller.messages import Key

LOOK_EVERY = 1 << 22  # bytes between two looks at the free space
JUST_MADE_S = 60.0
PART = ".part"
MODE = 0o640  # of a program from its first byte on: root's half of one is swept by the panel's user, too


@dataclass(frozen=True, slots=True)
class UploadLimits:
    """What an upload may take."""

    most_bytes: int = 256 << 20
    free_bytes: int = 256 << 20  # that stay free on the disk
    at_once: int = 8
    patience_s: float = 30.0  # for the first bytes, and on top of the slowest pace
    slowest_bytes_s: float = 500.0  # on average; a serial line at 4800 Bd is as slow as that


class Uploads:
    """Begins uploads, and knows how many are under way."""

    def __init__(self, programs: Programs, limits: UploadLimits) -> None:
        self._programs, self.limits = programs, limits
        self._places = threading.BoundedSemaphore(limits.at_once)

    @contextlib.contextmanager
    def begin(
        self, name: str, sha256: str | None = None, size: int | None = None, by: str = ""
    ) -> Iterator[Upload]:
        """An upload under that name; what is known of it beforehand is checked at once and at the end.

        Raises StoreError: name, sha256, size, space, many.
        """
        name, sha256 = names.check(name), _hash(sha256)
        if size is not None:
            self._fits(size)
        if not self._places.acquire(blocking=False):
            raise StoreError.of("many", "upload_many", name=name, most=self.limits.at_once)
        try:
            with _part(self._programs.incoming) as part:
                yield Upload(self._programs, self, *part, name, sha256, size, by)
        finally:
            self._places.release()

    def _fits(self, size: int) -> None:
        if size > self.limits.most_bytes:
            raise StoreError.of("size", "upload_large", size=size, most=self.limits.most_bytes)
        self.room(size)

    def room(self, size: int) -> None:
        """Raises StoreError "space" where the disk would become too full."""
        free = shutil.disk_usage(self._programs.incoming).free
        if free < size + self.limits.free_bytes:
            kept = self.limits.free_bytes
            raise StoreError.of("space", "upload_room", left=free >> 20, kept=kept >> 20)

    def sweep(self) -> int:
        """Remove temporary files of dead processes; how many."""
        incoming = self._programs.incoming
        there = own_files.names(incoming, incoming.parent.parent)
        return sum(_remove_dead(incoming / name) for name in there if name.endswith(PART))


class Upload:
    """One file on its way in. A sum over what came is kept while it comes."""

    def __init__(
        self,
        programs: Programs,
        uploads: Uploads,
        path: Path,
        file: BinaryIO,
        name: str,
        sha256: str | None,
        size: int | None,
        by: str,
    ) -> None:
        self._programs, self._uploads, self._path, self._file = programs, uploads, path, file
        self.name, self._sha256, self._size, self._by = name, sha256, size, by
        self._sum = hashlib.sha256()
        self._ends = 0  # of lines
        self._last = b"\n"
        self._looked = -LOOK_EVERY
        self.received = 0  # bytes

    def write(self, chunk: bytes) -> None:
        """The next bytes. Raises StoreError: size, space."""
        if not chunk:
            return
        self.received += len(chunk)
        if self.received > min(self._uploads.limits.most_bytes, self._size or self.received):
            most = min(self._uploads.limits.most_bytes, self._size or self.received)
            raise StoreError.of("size", "upload_more", name=self.name, most=most)
        if self.received - self._looked >= LOOK_EVERY:
            self._uploads.room(len(chunk))
            self._looked = self.received
        self._sum.update(chunk)
        self._ends += chunk.count(b"\n")
        self._last = chunk[-1:]
        with _full(self.name):
            self._file.write(chunk)

    def named(self, name: str | None, size: int | None) -> None:
        """What is only known at the end: another name, the size. Raises StoreError "name"."""
        self.name = names.check(name) if name else self.name
        self._size = self._size if size is None else size

    def commit(self, in_use: Collection[str] = (), sha256: str | None = None) -> Program:
        """Make it a program, replacing what had the name; ``in_use``: see ``Programs``.

        Raises StoreError: empty, cut, sha256, running, space.
        """
        found = self._sum.hexdigest()
        self._whole(found, _hash(sha256) or self._sha256)
        with _full(self.name):
            self._file.flush()
            os.fsync(self._file.fileno())
        lines = self._ends + (self._last != b"\n")
        program = Program(self.name, found, self.received, lines, self._programs.now_s(), self._by)
        with _full(self.name):
            return self._programs.keep(self._path, program, in_use)

    def _whole(self, found: str, expected: str | None) -> None:
        if not self.received:
            raise StoreError.of("empty", "upload_empty", name=self.name)
        if self._size is not None and self.received != self._size:
            came = {"came": self.received, "size": self._size}
            raise StoreError.of("cut", "upload_fewer", name=self.name, **came)
        if expected is not None and found != expected:
            raise StoreError.of("sha256", "upload_sum", name=self.name, found=found, wanted=expected)


@contextlib.contextmanager
def _part(folder: Path) -> Iterator[tuple[Path, BinaryIO]]:
    """A locked temporary file with its name, gone at the end unless it was renamed."""
    path, state = folder / f"{secrets.token_hex(8)}{PART}", folder.parent.parent
    with _full("upload"):
        file = own_files.new(path, state, MODE)
    try:
        os.fchmod(file.fileno(), MODE)
        fcntl.flock(file.fileno(), fcntl.LOCK_EX)
        yield path, file
    finally:
        with contextlib.suppress(OSError):  # the rest of a buffer that the disk has no room for
            file.close()
        own_files.remove(path, state)


def _remove_dead(file: Path) -> bool:
    """A file that nobody holds; one that was just made may be about to be locked."""
    state = file.parent.parent.parent
    with (
        contextlib.suppress(OSError),
        own_files.opened(file, os.O_RDONLY, state, shared=True) as found,  # all that a lock needs
    ):
        if time.time() - os.fstat(found.fileno()).st_mtime >= JUST_MADE_S:
            fcntl.flock(found.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
            own_files.remove(file, state)
            return True
    return False


@contextlib.contextmanager
def _full(name: str) -> Iterator[None]:
    """An operating system's refusal to write, as a sentence."""
    try:
        yield
    except OSError as error:
        full = error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
        code, remedy = ("space", "remedy.full") if full else ("store", "remedy.folder")
        said = {"name": name, "why": error, "remedy": Key(remedy)}
        raise StoreError.of(code, "upload_failed", **said) from error


def _hash(sha256: str | None) -> str | None:
    """Lower case, or None for none. Raises StoreError."""
    if not sha256:
        return None
    plain = sha256.strip().lower()
    if len(plain) != 64 or set(plain) - set("0123456789abcdef"):
        raise StoreError.of("sha256", "bad_sum", found=names.shown(sha256))
    return plain
