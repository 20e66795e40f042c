"""What an error says to people: a key of the catalogue with its values, so that every language has it.

The catalogue is the controller's data; nothing of its code is needed here. Whoever shows an error takes the
words by ``said`` in the reader's language. Scripts that use drives alone see the English ones.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

Said = dict[str, Any]  # key and values

ENGLISH = Path(__file__).parents[1] / "controller" / "messages" / "en.json"


def said(key: str, /, **values: object) -> Said:
    """A text of the catalogue with what it has places for; an error among the values is its own text."""
    if "why" in values and not str(values["why"] or "").strip():  # an OSError may have no words, for one
        values["why"] = {"key": "no_why", "values": {}}
    return {"key": key, "values": {name: _value(one) for name, one in values.items()}}


def _value(value: object) -> Any:
    own = getattr(value, "said", None) if isinstance(value, BaseException) else None
    return value if isinstance(value, str | int | float | dict | None) else own or str(value)


class TextError(Exception):
    """An error that is such a text; in words it is English."""

    def __init__(self, what: Mapping[str, Any] | str) -> None:
        """``what``: a sentence alone where it has no key."""
        self.said = dict(what) if isinstance(what, Mapping) else said("text", text=what)
        super().__init__(english(self.said))


def english(what: Mapping[str, Any]) -> str:
    """In words; a text that the catalogue lacks is shown as it is, for this must not fail."""
    values = {name: english(one) if isinstance(one, Mapping) else one for name, one in what["values"].items()}
    try:
        return _texts()[what["key"]].format(**values)
    except (KeyError, ValueError, IndexError, TypeError):
        return f"{what['key']} {values}"


@cache
def _texts() -> dict[str, str]:
    try:
        found: dict[str, str] = json.loads(ENGLISH.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found
