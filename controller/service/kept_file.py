"""What the service keeps as JSON, read at its start; what is damaged is put aside and reported.

Then the generation before counts, if that is whole; without one, what is there without a file.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from controller import own_files, sealed_file
from controller.machine.toml_table import ConfigError
from controller.messages import Message, message, of_error

WRONG = (*sealed_file.UNREADABLE, ConfigError)
T = TypeVar("T")


def read(file: Path, taken: Callable[[Any], T], missing: T) -> tuple[T, Message | None]:
    """What ``taken`` makes of a file's values, else of the generation before, which then is the file's, else
    ``missing``; and what an alarm says where it is not the first.
    """
    values, why = _newest(file, taken, missing)
    if why is None:
        return values, None
    earlier = sealed_file.before(file)
    try:
        plain, at_s = sealed_file.read(earlier), sealed_file.written_s(earlier)
        values = taken(plain)
    except WRONG:
        own_files.put_aside(earlier)
        return missing, put_aside(file, why)
    return values, sealed_file.before_counts(file, why, _replaced(file, plain), at_s)


def read_newest(file: Path, taken: Callable[[Any], T], missing: T, unknown: Any) -> tuple[T, Message | None]:
    """Likewise of what is wrong where it is not the newest: instead of the generation before, and from then
    on in the file, there is ``unknown``, as a file has it.
    """
    values, why = _newest(file, taken, missing)
    if why is None:
        return values, None
    return taken(unknown), sealed_file.begun_anew(file, why, _replaced(file, unknown))


def _newest(file: Path, taken: Callable[[Any], T], missing: T) -> tuple[T, Message | None]:
    """What ``taken`` makes of the newest generation, and None; or ``missing`` and why it is not to be had."""
    try:
        return taken(sealed_file.read(file)), None
    except FileNotFoundError:
        return missing, message("sealed.gone") if sealed_file.before(file).exists() else None
    except WRONG as error:
        return missing, of_error(error)


def _replaced(file: Path, values: Any) -> str:
    """Puts ``values`` in the place of a damaged file, and names where that one is now; "" where it is gone.

    Where the disk takes none it stays where it is, to be found damaged again: never is no file in its place.
    """
    aside = own_files.put_aside(file)
    try:
        sealed_file.write(file, values)
    except OSError:
        if aside is not None:
            with contextlib.suppress(OSError):
                own_files.rename(aside, file)
        return file.name
    return aside.name if aside is not None else ""


def put_aside(file: Path, why: Exception | Message | str) -> Message:
    """Gives a file that cannot be read another name; what an alarm says of it."""
    aside = own_files.put_aside(file)
    return sealed_file.begun_anew(file, why, aside.name if aside else "")
