"""Files that are replaced whole or not at all, and stay so through a loss of power."""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path


def write(file: Path, text: str) -> None:
    """Replace a file, not before the disk has it. Raises OSError; then the old one is as it was.

    One writer at a time: what one that died has left half done is written over by the next.
    """
    new = file.with_name(f"{file.name}.new")
    try:
        _write_through(new, text)
        os.replace(new, file)
    finally:
        new.unlink(missing_ok=True)
    sync(file.parent)


def _write_through(file: Path, text: str | bytes) -> None:
    with open(file, "wb") as out:
        out.write(text if isinstance(text, bytes) else text.encode())
        out.flush()
        os.fsync(out.fileno())


def sync(folder: Path) -> None:
    """Make what was renamed into a folder last, where the file system knows how. Raises OSError."""
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno != errno.EINVAL:
            raise
    finally:
        os.close(handle)


@contextlib.contextmanager
def all_or_none(texts: Mapping[Path, str | bytes]) -> Iterator[Callable[[], None]]:
    """Replace several files, also on several disks: all of them or none.

        with whole.all_or_none({machine_file: text, fitting: other}) as put:
            ...           # every text is on its disk, beside its file: none of them can be too full now
            put()
            ...           # whatever goes wrong in here puts the old ones back

    Raises OSError; then, as after any exception, every file is as it was.
    """
    with contextlib.ExitStack() as tidy:
        staged = [_staged(file, text, tidy) for file, text in texts.items()]
        replaced: list[tuple[Path, Path | None]] = []

        def put() -> None:
            for file, new, old in staged:
                os.replace(new, file)
                replaced.append((file, old))
            for folder in {file.parent for file, _, _ in staged}:
                sync(folder)

        try:
            yield put
        except BaseException:
            for file, old in reversed(replaced):
                _put_back(file, old)
            raise


def _staged(file: Path, text: str | bytes, tidy: contextlib.ExitStack) -> tuple[Path, Path, Path | None]:
    """(the file, its new text beside it, the file as it is, under another name: None where there is none)."""
    new, old = file.with_name(f"{file.name}.new"), file.with_name(f"{file.name}.old")
    for made in (new, old):
        made.unlink(missing_ok=True)  # of one that died
        tidy.callback(made.unlink, missing_ok=True)
    if file.exists():
        shutil.copy2(file, old)
    _write_through(new, text)
    return file, new, old if file.exists() else None


def _put_back(file: Path, old: Path | None) -> None:
    with contextlib.suppress(OSError):  # one that cannot be put back is no reason to leave the others
        if old is None:
            file.unlink(missing_ok=True)
        else:
            os.replace(old, file)
