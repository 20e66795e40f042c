"""What typer says of a command line that it does not understand, in the reader's language.

Typer has its sentences in English alone, and makes them of parts. Each is a text of the catalogue under
``usage.``: its English is the form by which a sentence of typer's is recognised, with what stands at the
places, and whatever language is asked for has the words. A form with a place for ``why`` holds another one.
"""

from __future__ import annotations

import re
import string
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

import typer

from controller import messages
from controller.cli import help_texts

USAGE: Any = typer.BadParameter.__mro__[1]  # click's UsageError, wherever this typer keeps it
INSIDE = "why"  # the place of another sentence


@contextmanager
def in_language(language: str) -> Iterator[None]:
    """Gives what typer raises meanwhile its words in this language, and what is shown around them."""
    try:
        yield
    except USAGE as error:
        _put_words(error, language)
        raise
    except typer.Abort:
        from typer import rich_utils  # which shows it

        rich_utils.ABORTED_TEXT = messages.of(language).texts["usage_frame.aborted"]
        raise


def _put_words(error: Any, language: str) -> None:
    from typer import rich_utils

    texts = messages.of(language).texts
    rich_utils.ERRORS_PANEL_TITLE = texts["usage_frame.error"]
    rich_utils.RICH_HELP = texts["usage_frame.try_help"]
    if getattr(error, "ctx", None) is not None:
        help_texts.put_frame(error.ctx.command, texts)
    sentence = translated(error.format_message(), language)
    error.format_message = lambda: sentence


def translated(sentence: str, language: str) -> str:
    """A sentence of typer's in a language; as it is where the catalogue has no such form."""
    for form, key in _forms():
        if found := form.fullmatch(sentence):
            values = found.groupdict()
            if INSIDE in values:
                values[INSIDE] = translated(values[INSIDE], language)
            return messages.text(messages.message(key, **values), language)
    return sentence


@cache
def _forms() -> tuple[tuple[re.Pattern[str], str], ...]:
    """Patterns and keys; those that hold another sentence first, then those with the most words."""
    texts = {key: text for key, text in messages.LANGUAGES["en"].texts.items() if key.startswith("usage.")}

    def rank(key: str) -> tuple[bool, int]:
        parts = [*string.Formatter().parse(texts[key])]
        return all(name != INSIDE for _, name, *_ in parts), -sum(len(own) for own, *_ in parts)

    return tuple((_form(texts[key]), key) for key in sorted(texts, key=rank))


def _form(text: str) -> re.Pattern[str]:
    parts = string.Formatter().parse(text)
    pattern = "".join(re.escape(own) + (f"(?P<{name}>.+?)" if name else "") for own, name, *_ in parts)
    return re.compile(pattern, re.DOTALL)
