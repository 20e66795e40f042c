"""How much the parts of the state folder take of their disk."""

from __future__ import annotations

import math
import os
import time
from contextlib import suppress
from pathlib import Path

MEASURED_S = 60.0  # how long sizes are taken as known


class Sizes:
    """Sizes of the parts of a folder; looked at now and then, for there may be many files."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._at_s = folder, -math.inf
        self._found: dict[str, int] = {}

    def known(self) -> dict[str, int]:
        """Bytes by the name of what lies in it; files of its own are "store" together."""
        if time.monotonic() - self._at_s > MEASURED_S:
            parts = [one for one in self._folder.iterdir() if one.is_dir()]
            own = sum(_size(one) for one in self._folder.iterdir() if not one.is_dir())
            self._found = {"store": own, **{part.name: _below(part) for part in parts}}
            self._at_s = time.monotonic()
        return self._found


def _below(folder: Path) -> int:
    return sum(_size(Path(at, name)) for at, _, names in os.walk(folder) for name in names)


def _size(file: Path) -> int:
    with suppress(OSError):  # it may just go
        return file.lstat().st_size
    return 0
