"""Whether anybody has to log in, known apart from the table of users: a file beside the store.

A store that has lost its rows looks like one that never had any, and that answers everybody on this computer.
So it is said in a file of its own that nobody has to log in (``nobody``), or how many users there are
(``users 3``). What is neither, or is not there, opens nothing.
"""

from __future__ import annotations

import re
from pathlib import Path

from controller import atomic_file, own_files

FILE = "log_in"
NOBODY = "nobody\n"
_USERS = re.compile(r"users ([1-9]\d{0,5})\n", re.ASCII)


def is_there(state: Path) -> bool:
    """Whether there is such a file, whatever it holds."""
    return FILE in own_files.names(state)


def users(state: Path) -> int | None:
    """How many users there are, 0: nobody has to log in; None: it cannot be known."""
    try:
        text = own_files.read_text(state / FILE, shared=True)
    except (OSError, ValueError):
        return None
    found = _USERS.fullmatch(text)
    return int(found[1]) if found else 0 if text == NOBODY else None


def write(state: Path, count: int) -> None:
    """Raises OSError."""
    atomic_file.write(state / FILE, f"users {count}\n" if count else NOBODY)
