"""A machine as JSON has it: every field of the dataclass by name, enums by value, angles in radians."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any


def plain(value: Any) -> Any:
    """For ``json.dumps(default=...)``: one layer, which json goes on with. Raises TypeError."""
    if isinstance(value, Enum):
        return value.value
    if is_dataclass(value):
        return {field.name: getattr(value, field.name) for field in fields(value)}
    raise TypeError(f"A machine holds a {type(value).__name__}, which JSON cannot.")
