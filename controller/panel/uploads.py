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
import shutil
import tempfile
import threading
import time
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from controller.panel import names
from controller.panel.database import StoreError
from controller.panel.programs import Program, Programs

LOOK_EVERY = 1 << 22  # bytes between two looks at the free space
JUST_MADE_S = 60.0


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
            raise StoreError(
                "many", f"{name}: {self.limits.at_once} uploads are under way; wait for one of them to end."
            )
        try:
            with _part(self._programs.incoming) as file:
                yield Upload(self._programs, self, file, name, sha256, size, by)
        finally:
            self._places.release()

    def _fits(self, size: int) -> None:
        if size > self.limits.most_bytes:
            raise StoreError(
                "size",
                f"upload: has {size} bytes; allowed are {self.limits.most_bytes}; "
                f"split the program, or raise the limit of the panel.",
            )
        self.room(size)

    def room(self, size: int) -> None:
        """Raises StoreError "space" where the disk would become too full."""
        free = shutil.disk_usage(self._programs.incoming).free
        if free < size + self.limits.free_bytes:
            raise StoreError(
                "space",
                f"upload: the disk has {free >> 20} MB left, of which {self.limits.free_bytes >> 20} MB "
                f"stay free; delete programs or recordings, then repeat.",
            )

    def sweep(self) -> int:
        """Remove temporary files of dead processes; how many."""
        return sum(_remove_dead(file) for file in self._programs.incoming.glob("*.part"))


class Upload:
    """One file on its way in. A sum over what came is kept while it comes."""

    def __init__(
        self,
        programs: Programs,
        uploads: Uploads,
        file: BinaryIO,
        name: str,
        sha256: str | None,
        size: int | None,
        by: str,
    ) -> None:
        self._programs, self._uploads, self._file = programs, uploads, file
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
            raise StoreError(
                "size",
                f"{self.name}: has more than the {most} bytes that were announced or are allowed; "
                "nothing of it was kept, send it again with its true size.",
            )
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
        """Make it a program, replacing what the name stood for; ``in_use``: see ``Programs``.

        Raises StoreError: empty, size, sha256, running, space.
        """
        found = self._sum.hexdigest()
        self._whole(found, _hash(sha256) or self._sha256)
        with _full(self.name):
            self._file.flush()
            os.fchmod(self._file.fileno(), 0o640)
            os.fsync(self._file.fileno())
        lines = self._ends + (self._last != b"\n")
        program = Program(self.name, found, self.received, lines, self._programs.now_s(), self._by)
        with _full(self.name):
            return self._programs.keep(Path(self._file.name), program, in_use)

    def _whole(self, found: str, expected: str | None) -> None:
        if not self.received:
            raise StoreError("empty", f"{self.name}: has no bytes; nothing was kept, send the program.")
        if self._size is not None and self.received != self._size:
            raise StoreError(
                "size", f"{self.name}: {self.received} of {self._size} bytes came; nothing was kept, repeat."
            )
        if expected is not None and found != expected:
            raise StoreError(
                "sha256",
                f"{self.name}: what came has sha256 {found}, announced was {expected}; "
                f"nothing was kept, send it again.",
            )


@contextlib.contextmanager
def _part(folder: Path) -> Iterator[BinaryIO]:
    """A locked temporary file, gone at the end unless it was renamed."""
    with _full("upload"):
        file = tempfile.NamedTemporaryFile(dir=folder, suffix=".part", delete=False)  # noqa: SIM115
    try:
        fcntl.flock(file.fileno(), fcntl.LOCK_EX)
        yield file  # type: ignore[misc]
    finally:
        with contextlib.suppress(OSError):  # the rest of a buffer that the disk has no room for
            file.close()
        Path(file.name).unlink(missing_ok=True)


def _remove_dead(file: Path) -> bool:
    """A file that nobody holds; one that was just made may be about to be locked."""
    try:
        if time.time() - file.stat().st_mtime < JUST_MADE_S:
            return False
        handle = os.open(file, os.O_RDWR)
    except OSError:
        return False
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        file.unlink(missing_ok=True)
        return True
    except OSError:
        return False
    finally:
        os.close(handle)


@contextlib.contextmanager
def _full(name: str) -> Iterator[None]:
    """An operating system's refusal to write, as a sentence."""
    try:
        yield
    except OSError as error:
        full = error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
        do = "delete programs or recordings" if full else "check the state folder"
        raise StoreError(
            "space" if full else "store",
            f"{name}: could not be written ({error.strerror}); nothing was kept, {do}, then repeat.",
        ) from error


def _hash(sha256: str | None) -> str | None:
    """Lower case, or None for none. Raises StoreError."""
    if not sha256:
        return None
    plain = sha256.strip().lower()
    if len(plain) != 64 or set(plain) - set("0123456789abcdef"):
        raise StoreError(
            "sha256", f"sha256 {names.shown(sha256)}: is no checksum; allowed are 64 hexadecimal digits."
        )
    return plain
