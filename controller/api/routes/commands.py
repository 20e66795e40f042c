"""Routes of the commands that are answered by done or refused, made of their table; and the table itself.

What is sent is a model of a command's arguments, with the ranges and the meaning that the table has; those
that stand in the path are none of it. Whoever asks is let in as the command's ``access`` says.
"""

from __future__ import annotations

import inspect
from collections.abc import Awaitable, Callable
from typing import Annotated, Any, Literal

from fastapi import Path, Request
from pydantic import Field, create_model

from controller.api import access, models
from controller.api.access import needs, panel_of, principal
from controller.api.answers import Refusal
from controller.api.models import Sent, Told
from controller.api.roles import Role
from controller.api.router import MOVES, VIEW, Router
from controller.api.routes.machine import ask
from controller.commands.arguments import (
    NEEDED,
    Argument,
    Choice,
    Kind,
    Label,
    Named,
    Number,
    Several,
    Switch,
    Text,
    Whole,
)
from controller.commands.command import Access, Command, Rest
from controller.commands.table import ALL, AXIS
from controller.state.modes import possible_in

TAGS = {
    **{
        "job": "cycle",
        "overrides": "machine",
        "mdi": "machine",
        "macros": "machine",
        "offsets": "offsets and tools",
    },
    **{"changer": "tool changer"},
}  # of the first word of a path, where they are not that word itself
GUARDS: dict[Access, Callable[[], Any]] = {
    Access.LOOK: lambda: needs(Role.VIEW),
    Access.STOP: access.stops,
    Access.OPERATE: lambda: needs(Role.OPERATE),
    Access.MOVE: access.moves,
    Access.SET_UP: lambda: needs(Role.SET_UP),
}
NAMED = (404, *MOVES)  # what is named in the path may be missing
ROLES = {Access.LOOK: Role.VIEW, Access.SET_UP: Role.SET_UP}  # all others: to operate


class CommandFacts(Told):
    """One command."""

    name: str
    method: str | None = Field(description="Of its route; null: it has one of its own, or none.")
    path: str | None
    role: Literal["view", "operate", "set_up"]
    control: bool = Field(description="Whether the control token is needed.")
    modes: list[str] | None = Field(description="In which it is possible; null: in every one.")
    one_at_a_time: bool = Field(
        description="Takes long, and is refused while another one that does is under way (`sequence` of the "
        "status); a `load` takes the place of another."
    )
    arguments: list[str]


class CommandList(Told):
    commands: list[CommandFacts]


def made(commands: tuple[Command, ...]) -> Router:
    """A router with the routes of those commands that have one."""
    found = Router()
    for command in commands:
        if command.rest is not None:
            _add(found, command, command.rest)
    return found


def _add(router: Router, command: Command, rest: Rest) -> None:
    first = rest.path.partition("/")[0]
    guard = GUARDS[command.access]()
    if rest.seen_s is not None:
        guard = access.moves(most_s=rest.seen_s)
    statuses = NAMED if any(one.in_path for one in command.arguments) else MOVES
    add = router.guarded(rest.method, f"/{rest.path}", guard, *statuses, tags=[TAGS.get(first, first)])
    add(_endpoint(command, rest))


def _endpoint(command: Command, rest: Rest) -> Callable[..., Awaitable[models.Done]]:
    in_path = [one for one in command.arguments if one.in_path]
    of_role = [one.name for one in command.arguments if one.is_role]
    model = body_of(command, rest)

    async def endpoint(request: Request, body: Any = None, **path: Any) -> models.Done:
        values = {one.name: path[one.in_path] for one in in_path}
        if body is not None:
            values |= body.model_dump()
        for one in of_role:
            values[one] = (await principal(request)).role.label
        try:
            return await ask(request, command.name, **values)
        except Refusal as refusal:
            if not rest.idle_is_done or refusal.status != 409:
                raise
            return models.Done(request=command.name)

    kind = inspect.Parameter.KEYWORD_ONLY
    parameters = [inspect.Parameter("request", kind, annotation=Request)]
    parameters += [inspect.Parameter(one.in_path, kind, annotation=_in_path(one.kind)) for one in in_path]
    if model is not None:
        default = None if rest.bodiless else inspect.Parameter.empty
        annotation = model | None if rest.bodiless else model
        parameters.append(inspect.Parameter("body", kind, annotation=annotation, default=default))
    endpoint.__signature__ = inspect.Signature(parameters, return_annotation=models.Done)  # type: ignore[attr-defined]
    endpoint.__name__, endpoint.__doc__ = rest.name or command.name, rest.text
    return endpoint


def body_of(command: Command, rest: Rest) -> Any:
    """The model of what is sent; None where nothing is."""
    fields = [one for one in command.arguments if not one.in_path and not one.is_local]
    if not fields:
        return None
    name = rest.body or "".join(word.title() for word in command.name.split("_"))
    if name == models.Switch.__name__:
        return models.Switch
    made = {one.name: _field(one) for one in fields}
    return create_model(name, __base__=Sent, __doc__=rest.body_text or None, **made)


def _field(argument: Argument) -> Any:
    """Type and default of an argument, as pydantic takes them."""
    kind, more = _kind(argument.kind)
    if argument.meaning:
        more["description"] = argument.meaning
    if argument.default is None:
        kind = kind | None
    if argument.default is NEEDED:
        return Annotated[kind, Field(**more)], ...
    if isinstance(argument.default, dict | list):
        return Annotated[kind, Field(default_factory=type(argument.default), **more)], ...
    return Annotated[kind, Field(**more)], argument.default


def _kind(kind: Kind) -> tuple[Any, dict[str, Any]]:
    """The Python type of a kind, and its bounds."""
    match kind:
        case Number(lowest, highest, above):
            return float, {"gt" if above else "ge": lowest, "le": highest}
        case Whole(lowest, highest):
            return int, {"ge": lowest, "le": highest}
        case Switch():
            return bool, {}
        case Text() if kind is AXIS:
            return models.Axis, {}
        case Text(longest, shortest, pattern):
            bounds = {"min_length": shortest or None, "max_length": longest}
            return str, {"pattern": pattern} if pattern else bounds
        case Label(longest):
            return str, {"max_length": longest}
        case Choice(words):
            return Literal[words], {}
        case Several(of, most, fewest):
            one, within = _kind(of)
            each: Any = Annotated[one, Field(**within)] if within else one
            return list[each], {"min_length": fewest or None, "max_length": most}
        case Named(most, lowest, highest, longest):
            number = Annotated[float, Field(ge=lowest, le=highest)]
            return dict[str, number | Annotated[str, Field(max_length=longest)]], {"max_length": most}
    raise TypeError(f"{kind} has no form in REST; its route is written by hand")


def _in_path(kind: Kind) -> Any:
    made, bounds = _kind(kind)
    return Annotated[made, Path(**bounds)]


router = made(ALL)


def facts(command: Command) -> CommandFacts:
    """What a page needs to know of a command."""
    modes, rest = possible_in(command), command.rest
    return CommandFacts(
        name=command.name,
        method=rest.method if rest is not None else None,
        path=rest.path if rest is not None else None,
        role=ROLES.get(command.access, Role.OPERATE).label,
        control=command.access is Access.MOVE,
        modes=None if modes is None else [mode.name for mode in modes],
        one_at_a_time=command.one_at_a_time,
        arguments=[one.name for one in command.arguments if not one.is_local],
    )


@router.get("/commands", VIEW, tags=["machine"])
async def commands() -> CommandList:
    """Every command of the machine: who may give it, and in which modes it is possible."""
    return CommandList(commands=[facts(command) for command in ALL])


@router.get("/changer", VIEW, 409, 503, tags=["tool changer"])
async def changer(request: Request) -> models.Told:
    """Spindle, pockets, the step under way, what must be confirmed, and the last steps."""
    facts: dict[str, Any] = await panel_of(request).door.ask("changer")
    return models.Told(**facts)
