"""Rows of TOML files for people: values, and keys with their meanings."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from controller.machine.named_files import toml_text


def value(of: Any) -> str:
    """A text, number, flag, list or inline table as TOML has it."""
    if isinstance(of, dict):
        return "{ " + ", ".join(f"{key} = {value(one)}" for key, one in of.items()) + " }"
    if isinstance(of, list | tuple):
        return "[" + ", ".join(map(value, of)) + "]"
    return toml_text(of) if isinstance(of, str) else json.dumps(of)


def noted(row: str, note: str, column: int) -> Iterator[str]:
    """A row with a note from that column on; a long one has it in the line before."""
    if note and len(row) >= column:
        yield f"# {note}:"
        note = ""
    yield f"{row:<{column}}# {note}" if note else row
