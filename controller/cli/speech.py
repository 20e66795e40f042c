"""In which language verbs speak, and have the panel speak: ``--language`` of each of them."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Annotated, Any

import typer

from controller import messages
from controller.cli.help_texts import ENVIRONMENT
from controller.verify import console
from controller.verify.console import spoken

LANGUAGE = "language"  # the parameter
Language = Annotated[str, typer.Option("--language", envvar=ENVIRONMENT)]


def header() -> dict[str, str]:
    """What asks the panel for it."""
    return {"Accept-Language": spoken.get()}


def say(key: str, **values: object) -> str:
    """A text of the client's own."""
    return console.say(f"client.{key}", **values)


def teach(app: typer.Typer) -> None:
    """Gives every verb of an application, and of those below it, its ``--language``."""
    for one in app.registered_commands:
        if one.callback is not None and LANGUAGE not in inspect.signature(one.callback).parameters:
            one.callback = speaking(one.callback)
    for group in app.registered_groups:
        if group.typer_instance is not None:
            teach(group.typer_instance)


def speaking(verb: Callable[..., None]) -> Callable[..., None]:
    """The verb with ``--language``; one that there is not is English, as the panel has it."""

    @functools.wraps(verb)
    def with_language(*args: Any, language: str = messages.DEFAULT, **more: Any) -> None:
        before = spoken.set(messages.chosen(language))
        try:
            verb(*args, **more)
        finally:
            spoken.reset(before)

    own, kind = inspect.signature(verb, eval_str=True), inspect.Parameter.KEYWORD_ONLY
    last = inspect.Parameter(LANGUAGE, kind, default=messages.DEFAULT, annotation=Language)
    told = own.replace(parameters=[*own.parameters.values(), last])
    with_language.__signature__ = told  # type: ignore[attr-defined]
    return with_language
