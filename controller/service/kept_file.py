"""What the service keeps as JSON, read at its start; what is damaged is put aside and reported.

Then the generation before counts, if that is whole; without one, what is there without a file.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from controller import own_files, sealed_file
from controller.machine.toml_table import ConfigError
from controller.messages import Said, of_error, said

ALARM = "FILE_DAMAGED"
WRONG = (*sealed_file.UNREADABLE, ConfigError)
T = TypeVar("T")


def read(file: Path, taken: Callable[[Any], T], missing: T) -> tuple[T, Said | None]:
    """What ``taken`` makes of a file's values, else of those before them, else ``missing``; and what an
    alarm says where it is not the first.
    """
    try:
        return taken(sealed_file.read(file)), None
    except FileNotFoundError:
        if not sealed_file.before(file).exists():
            return missing, None
        return _before(file, taken, missing, said("sealed.gone"))
    except WRONG as error:
        return _before(file, taken, missing, of_error(error))


def _before(file: Path, taken: Callable[[Any], T], missing: T, why: Said) -> tuple[T, Said]:
    earlier = sealed_file.before(file)
    try:
        values, at_s = taken(sealed_file.read(earlier)), sealed_file.written_s(earlier)
    except WRONG:
        return missing, put_aside(file, why)
    aside = own_files.put_aside(file)
    at = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(at_s))
    return values, said("file_before", file=file, why=why, aside=aside.name if aside else "-", at=at)


def put_aside(file: Path, why: Exception | Said | str) -> Said:
    """Gives a file that cannot be read another name; what an alarm says of it."""
    aside = own_files.put_aside(file)
    return said("file_damaged", file=file, why=why, aside=aside.name if aside else "-")
