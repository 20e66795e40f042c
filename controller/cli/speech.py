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

Verb = Callable[..., None]
LANGUAGE = "language"  # the parameter
Language = Annotated[str, typer.Option("--language", envvar=ENVIRONMENT)]


def header() -> dict[str, str]:
    """What asks the panel for it."""
    return {"Accept-Language": spoken.get()}


def say(key: str, **values: object) -> str:
    """A text of the client's own."""
    return console.say(f"client.{key}", **values)


class Verbs(typer.Typer):
    """An application whose verbs are functions of plain parameters, see ``speaking``."""

    def command(self, *name: str, **how: Any) -> Callable[[Verb], Verb]:  # type: ignore[override]
        add = super().command(*name, **how)
        return lambda verb: add(speaking(verb))

    def callback(self, **how: Any) -> Callable[[Verb], Verb]:  # type: ignore[override]
        """A verb only where it does something without one below it."""
        add = super().callback(**how)
        return lambda verb: add(speaking(verb) if how.get("invoke_without_command") else verb)


def speaking(verb: Verb) -> Verb:
    """The verb with ``--language``; one that there is not is English, as the panel has it.

    A parameter without a default is an argument, any other the option of its name, as typer has it; but
    a bool that is false has no ``--no-...`` beside it, and ``as_json`` is ``--json``.
    """

    @functools.wraps(verb)
    def with_language(*args: Any, language: str = messages.DEFAULT, **more: Any) -> None:
        before = spoken.set(messages.chosen(language))
        try:
            verb(*args, **more)
        finally:
            spoken.reset(before)

    own, kind = inspect.signature(verb, eval_str=True), inspect.Parameter.KEYWORD_ONLY
    last = inspect.Parameter(LANGUAGE, kind, default=messages.DEFAULT, annotation=Language)
    parameters = [
        _flag(one) if one.annotation is bool and one.default is False else one
        for one in own.parameters.values()
    ]
    with_language.__signature__ = own.replace(parameters=[*parameters, last])  # type: ignore[attr-defined]
    return with_language


def _flag(parameter: inspect.Parameter) -> inspect.Parameter:
    option = "--json" if parameter.name == "as_json" else f"--{parameter.name.replace('_', '-')}"
    return parameter.replace(annotation=Annotated[bool, typer.Option(option)])
