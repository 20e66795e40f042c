"""Files that are replaced whole or not at all, and stay so through a loss of power."""

from __future__ import annotations

import contextlib
import errno
import logging
import os
import stat
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from controller import own_files

_log = logging.getLogger(__name__)


def write(file: Path, text: str | bytes, within: Path | None = None, mode: int | None = None) -> None:
    """Replace a file, not before the disk has it. Raises OSError; then the old one is as it was.

    One writer at a time: what one that died has left half done is written over by the next. ``within``: as
    ``own_files`` has it; ``mode``: None: the usual, less the umask.
    """
    new = file.with_name(f"{file.name}.new")
    try:
        _write_through(new, text, within, mode)
        own_files.rename(new, file, within)
    finally:
        own_files.remove(new, within)
    sync(file.parent, within)


def note(file: Path, text: str) -> None:
    """Have a file hold a text that can be had anew, whatever it holds now. Raises OSError.

    One that holds it is not written: a full disk forbids no second start.
    """
    with contextlib.suppress(OSError):
        if own_files.read_bytes(file) == text.encode():
            return
    if os.path.lexists(file):
        _log.warning("%s holds something else, and is written anew.", file)
    write(file, text)


def _write_through(
    file: Path, text: str | bytes, within: Path | None = None, mode: int | None = None
) -> None:
    with own_files.new(file, within) as out:
        if mode is not None:
            os.fchmod(out.fileno(), mode)
        out.write(text if isinstance(text, bytes) else text.encode())
        out.flush()
        os.fsync(out.fileno())


def sync(folder: Path, within: Path | None = None) -> None:
    """Make what was renamed into a folder last, where the file system knows how. Raises OSError."""
    with own_files.folder(folder, within) as at:
        try:
            os.fsync(at)
        except OSError as error:
            if error.errno != errno.EINVAL:
                raise


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
                own_files.rename(new, file)
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
        own_files.remove(made)  # of one that died
        tidy.callback(own_files.remove, made)
    there, mode = os.path.lexists(file), None
    if file.is_symlink():
        os.symlink(os.readlink(file), old)
    elif there:
        mode = stat.S_IMODE(os.lstat(file).st_mode)
        _write_through(old, own_files.read_bytes(file, shared=True), mode=mode)
    _write_through(new, text, mode=mode)
    return file, new, old if there else None


def _put_back(file: Path, old: Path | None) -> None:
    with contextlib.suppress(OSError):  # one that cannot be put back is no reason to leave the others
        if old is None:
            own_files.remove(file)
        else:
            own_files.rename(old, file)
