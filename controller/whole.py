"""Files that are replaced whole or not at all, and stay so through a loss of power."""

from __future__ import annotations

import errno
import os
from pathlib import Path


def write(file: Path, text: str) -> None:
    """Replace a file, not before the disk has it. Raises OSError; then the old one is as it was.

    One writer at a time: what one that died has left half done is written over by the next.
    """
    new = file.with_name(f"{file.name}.new")
    try:
        with open(new, "w", encoding="utf-8") as out:
            out.write(text)
            out.flush()
            os.fsync(out.fileno())
        os.replace(new, file)
    finally:
        new.unlink(missing_ok=True)
    sync(file.parent)


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
