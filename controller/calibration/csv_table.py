"""A table of measurements as CSV: a header, then a row of numbers and names each."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence

from controller.calibration.refusal import Refusal

Line = tuple[int, dict[str, str]]  # number in the file, and the row by column


def read(text: str, needed: Sequence[str], file: str) -> list[Line]:
    """The rows of a table with at least those columns; lines end as any system ends them. Raises Refusal."""
    reader = csv.DictReader(io.StringIO(text, newline=None))
    try:
        missing = [name for name in needed if name not in (reader.fieldnames or ())]
        if missing:
            raise Refusal("no_column", file=file, column=missing[0], needed=", ".join(needed))
        return [(reader.line_num, row) for row in reader]
    except csv.Error as error:
        raise Refusal("not_csv", file=file, line=reader.line_num + 1, why=error) from error


def number(row: Mapping[str, str], name: str, file: str, line: int) -> float:
    """Raises Refusal."""
    try:
        value = float(row[name] or "")
    except (TypeError, ValueError):
        value = math.nan
    if not math.isfinite(value):
        raise Refusal("no_number", file=file, line=line, column=name, found=row.get(name) or "")
    return value
