"""How a text travels: by its key with its values, in no language; and how it becomes words.

What drives and controller report is a text of the catalogue (``controller/messages``, which is data; nothing
of the controller's code is needed here). Who shows it has the texts of a language and fills them in
(``filled``). Scripts that use drives alone see the English ones (``english``).
"""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, TypedDict

FOLDER = Path(__file__).parents[1] / "controller" / "messages"
NONE_YET: Mapping[str, Any] = {}


class Message(TypedDict):
    """A text in no language. A value is plain JSON, another ``Message``, or a list of them, which are read
    one after the other; a text among the values may use the values beside it.
    """

    key: str
    values: dict[str, Any]


class Key(str):
    """A value that is itself a text, by its key, for instance what was waited for."""


def message(key: str, /, **values: object) -> Message:
    """The text of a key, with what it has places for; an error among the values is its ``reason``."""
    if "why" in values and not str(values["why"] or "").strip():  # an OSError may have no words, for one
        values["why"] = Key("no_why")
    return Message(key=key, values={name: _value(value) for name, value in values.items()})


def plain(sentence: Message | str) -> Message:
    """Also of what is known as a sentence only, of a program's reader for one."""
    return message("text", text=sentence) if isinstance(sentence, str) else sentence


def of_error(error: BaseException) -> Message:
    """What an error says: its own text, with its place where it has one; else its words."""
    own: Message | None = getattr(error, "placed", None) or getattr(error, "said", None)
    return own or plain(str(error))


class TextError(Exception):
    """An error that is a text: ``said``; in words it is English, for logs."""

    def __init__(self, what: Message | str) -> None:
        """``what``: a sentence alone where it has no key."""
        self.said = plain(what)
        super().__init__(english(self.said))


def several(*texts: Message | str) -> Message:
    """One after the other, without those that are empty."""
    return message("text", text=[plain(one) for one in texts if one])


def chain(link: str, texts: Sequence[Message | str]) -> Message | str:
    """Several as one: ``link`` is "and" or "or"; each is a key or plain words."""
    last: Message | str = texts[-1]
    for one in texts[-2::-1]:
        last = message(link, one=one, other=last)
    return last


def once(texts: Iterable[Message]) -> list[Message]:
    """Each of them at its first place only."""
    found: list[Message] = []
    for one in texts:
        if one not in found:
            found.append(one)
    return found


def _value(value: object) -> Any:
    if isinstance(value, Key):
        return Message(key=str(value), values={})
    if isinstance(value, list | tuple):
        return [_value(one) for one in value]
    if isinstance(value, BaseException):
        return reason(value)
    return value if isinstance(value, str | int | float | dict | None) else str(value)


def reason(error: BaseException) -> Message | str:
    """What an error gives as its reason: its own text, or that of the operating system's number; else its
    words.
    """
    own: Message | None = getattr(error, "said", None)
    if own or not isinstance(error, OSError):
        return own or str(error)
    name = errno.errorcode.get(error.errno or 0, "")
    if name and error.strerror == os.strerror(error.errno or 0) and f"errno.{name}" in _known():
        return Message(key=f"errno.{name}", values={})
    return error.strerror or str(error)


# ---- in words


def is_message(value: object) -> bool:
    return isinstance(value, Mapping) and "key" in value and "values" in value


def filled(said: Mapping[str, Any], texts: Mapping[str, str], around: Mapping[str, Any] = NONE_YET) -> str:
    """A text in words, by the texts of a language; ``around``: the values of the one that holds it.

    A value named ``unit`` is in the words of the language where it has some: ``unit.deg``. A key of another
    version, and values that do not fit it, are shown as they are: it must not fail.
    """

    def words(value: Any, name: str = "") -> Any:
        if name == "unit":
            return texts.get(f"unit.{value}", value)
        if is_message(value):
            return filled(value, texts, figures)
        return (
            " ".join(map(words, value)) if isinstance(value, list) and all(map(is_message, value)) else value
        )

    key, values = str(said["key"]), {**around, **(said["values"] or {})}
    figures = {name: value for name, value in values.items() if isinstance(value, str | int | float)}
    try:
        return texts[key].format(**{name: words(value, name) for name, value in values.items()})
    except (KeyError, ValueError, IndexError, TypeError):
        return f"{key} {figures}"


def english(said: Mapping[str, Any]) -> str:
    """In English words; as it is where there is no catalogue, for this must not fail."""
    return filled(said, _known())


def _known() -> Mapping[str, str]:
    try:
        return english_texts()
    except (OSError, ValueError):
        return {}


@cache
def english_texts() -> dict[str, str]:
    """Every English text by its key. Raises as ``read``."""
    return read(FOLDER / "en.json")


def read(file: Path) -> dict[str, str]:
    """The texts of a language's file. Raises OSError, and ValueError that names the file, line and column."""
    try:
        texts: dict[str, str] = json.loads(file.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{file}: {error}; a file of texts is a JSON object of key and text.") from error
    return texts
