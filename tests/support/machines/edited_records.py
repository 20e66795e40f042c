"""Events and setpoints of a record changed, as a writer would have written them so."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from controller import sealed_file
from controller.state import record_files
from controller.state.setpoints import SETPOINTS


def lines_of(file: Path) -> list[dict[str, Any]]:
    """The lines of a record, without their sums."""
    lines = file.read_text(encoding="utf-8").splitlines()
    return [sealed_file.of_line(line, number=number) for number, line in enumerate(lines, 1)]


def rewrite(file: Path, lines: Iterable[dict[str, Any]]) -> None:
    """These lines instead, each with its number and sum."""
    text = "".join(sealed_file.line(values, number) for number, values in enumerate(lines, 1))
    file.write_text(text, encoding="utf-8")


def rewrite_setpoints(folder: Path, rows: np.ndarray, first: int = 0) -> None:
    """These counts (N, 5) instead of a packed segment of the record."""
    with (folder / SETPOINTS.name(first)).open("wb") as file:
        SETPOINTS.pack(file, first, rows, str(record_files.facts(folder).get("id", folder.name)))
