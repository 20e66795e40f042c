"""What the service keeps as JSON, read at its start; what cannot be read is put aside and reported."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from controller import own_files
from controller.messages import Said, said

ALARM = "FILE_DAMAGED"
WRONG = (OSError, ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError)
T = TypeVar("T")


def read(file: Path, taken: Callable[[Any], T], missing: T) -> tuple[T, Said | None]:
    """What ``taken`` makes of a file's values, else ``missing``; and what an alarm says of it."""
    try:
        return taken(json.loads(own_files.read_text(file))), None
    except FileNotFoundError:
        return missing, None
    except WRONG as error:
        return missing, put_aside(file, error)


def put_aside(file: Path, why: Exception | str) -> Said:
    """Gives a file that cannot be read another name; what an alarm says of it."""
    aside = own_files.put_aside(file)
    return said("file_damaged", file=file, why=why, aside=aside.name if aside else "-")
