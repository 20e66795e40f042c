"""The client verbs that are answered by done or refused, made of the table of commands."""

from __future__ import annotations

import contextlib
import inspect
from collections.abc import Callable
from functools import partial
from typing import Annotated, Any, Literal
from urllib.parse import quote

import typer

from controller.cli import remote
from controller.cli.client import Json, TakeOver, Url, Wait, carried_out, connected, set_going
from controller.cli.speech import say
from controller.commands.arguments import NEEDED, Argument, Number, Several, Switch, Whole
from controller.commands.command import Access, Client, Command, Rest
from controller.commands.table import ALL

TYPES = {Number: float, Whole: int}  # of arguments; all others are text
ON = "switch"  # the argument of a verb that does nothing but switch


def register(app: typer.Typer) -> None:
    """Adds these verbs to the command line."""
    for command in ALL:
        if command.client is not None and command.rest is not None:
            loose = {"ignore_unknown_options": True} if command.client.negative else None
            made = verb(command, command.client, command.rest)
            app.command(command.client.name, context_settings=loose)(made)


def verb(command: Command, client: Client, rest: Rest) -> Callable[..., None]:
    """The function of a verb, with the parameters that its command has."""
    taken = {_name(command, client, one): one for one in command.arguments if not one.is_local}
    kind = inspect.Parameter.KEYWORD_ONLY
    parameters = [_parameter(command, client, name, one) for name, one in taken.items()]
    if client.waits:
        parameters.append(inspect.Parameter("wait", kind, annotation=Wait, default=False))
    if command.access is Access.MOVE:
        parameters.append(inspect.Parameter("take_over", kind, annotation=TakeOver, default=False))
    parameters.append(inspect.Parameter("url", kind, annotation=Url, default=remote.URL))
    parameters.append(inspect.Parameter("as_json", kind, annotation=Json, default=False))

    def made(
        url: str, as_json: bool, take_over: bool | None = None, wait: bool = False, **typed: Any
    ) -> None:
        values = {one.name: _value(one, typed[name]) for name, one in taken.items()}
        with connected(url, as_json) as machine:
            control = contextlib.nullcontext() if take_over is None else machine.control(take_over)
            ask = partial(_ask, machine, command, rest, values)
            set_going(machine, control, ask, partial(_sentence, command, client, values), wait, as_json)

    made.__name__ = client.name
    made.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    made.__annotations__ = {one.name: one.annotation for one in parameters}
    return made


def _name(command: Command, client: Client, argument: Argument) -> str:
    """Of a parameter, which the texts of help have, too."""
    if command.is_switch:
        return ON
    renamed = dict(client.renamed).get(argument.name, argument.name)
    return argument.name if isinstance(argument.kind, Switch) else renamed


def _parameter(command: Command, client: Client, name: str, argument: Argument) -> inspect.Parameter:
    """As typer takes it."""
    needed = argument.default is NEEDED
    default = inspect.Parameter.empty if needed else argument.default
    match argument.kind:
        case Switch() if command.is_switch:
            annotation: Any = Annotated[Literal["on", "off"], typer.Argument()]
        case Switch():
            option = f"--{dict(client.renamed).get(name, name)}"
            annotation = Annotated[bool, typer.Option(option)]
        case Several():
            annotation, default = Annotated[list[str] | None, typer.Argument()], None
        case other:
            kind: Any = TYPES.get(type(other), str)
            annotation = Annotated[kind | None if default is None else kind, typer.Argument()]
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, annotation=annotation, default=default)


def _value(argument: Argument, typed: Any) -> Any:
    """What is sent of what was typed."""
    if isinstance(argument.kind, Several):
        return [one.upper() for one in typed] if typed else None if argument.default is None else []
    return typed == "on" if isinstance(argument.kind, Switch) and isinstance(typed, str) else typed


def _ask(machine: remote.Machine, command: Command, rest: Rest, values: dict[str, Any]) -> Any:
    names = {one.name: one.in_path for one in command.arguments if one.in_path}
    path = rest.path.format(**{place: quote(str(values[name]), "") for name, place in names.items()})
    body = {name: value for name, value in values.items() if name not in names}
    if rest.method == "PUT":
        return machine.put(path, body)
    return carried_out(machine, path, body or None)


def _sentence(command: Command, client: Client, values: dict[str, Any], answer: Any) -> str:
    """What was done; also that what was only being prepared is given up."""
    result = answer.get("result") or {}
    if result.get("outcome") == "given_up":
        return say("given_up", what=result["what"])
    first = next(iter(values.values()), True)
    if command.is_switch:
        return say(f"{client.answer}_{'on' if first else 'off'}")
    renamed = dict(client.renamed)
    shown = {renamed.get(name, name): _shown(value) for name, value in values.items()}
    kinds = " ".join(name for name, on in values.items() if on is True) or "–"
    return say(client.off if client.off and not first else client.answer, **shown, kinds=kinds)


def _shown(value: Any) -> Any:
    return " ".join(value) or say("none_open") if isinstance(value, list) else value
