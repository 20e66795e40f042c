"""Events as a WebSocket."""

from __future__ import annotations

import contextlib
from collections.abc import Awaitable, Callable

from anyio import create_task_group, sleep
from fastapi import WebSocket, WebSocketDisconnect

from controller import messages
from controller.api.access import address, needs, panel_of, principal
from controller.api.answers import Refusal, language_of
from controller.api.events import TOPICS, Listener
from controller.api.roles import Role
from controller.api.router import Router

router = Router()
CHECK_S = 5.0  # how long a listener who was logged out still hears
POLICY = 1008  # close code: not allowed (any more)
TRY_LATER = 1013


@router.websocket("/events", dependencies=[needs(Role.VIEW)])
async def events(
    websocket: WebSocket, topics: str = ",".join(TOPICS), language: str = "", changes: bool = False
) -> None:
    """Status 20 times a second (5 where no axis moves), alarms, jobs.

    ``topics``: names with commas between, default all.

    ``language``: for browsers, which cannot set the header.

    ``changes``: after the first status only what is new of it, by its path.
    """
    panel = panel_of(websocket)
    wanted = frozenset(topics.split(","))
    if unknown := sorted(wanted - set(TOPICS)):
        raise Refusal.of(422, "topics", "no_topic", name=repr(unknown[0][:40]), allowed=", ".join(TOPICS))
    chosen = messages.chosen(language, language_of(websocket))
    who = await principal(websocket)
    with panel.events.listening(wanted, who, address(websocket), chosen, changes) as listener:
        await websocket.accept()
        async with create_task_group() as tasks:

            async def until_one_ends(work: Callable[[], Awaitable[None]]) -> None:
                await work()
                tasks.cancel_scope.cancel()

            for work in (lambda: _tell(websocket, listener), lambda: _check(websocket)):
                tasks.start_soon(until_one_ends, work)
            await until_one_ends(lambda: _hear(websocket))
        with contextlib.suppress(RuntimeError, WebSocketDisconnect):  # it may be closed already
            await websocket.close(TRY_LATER if listener.lost else POLICY)


async def _tell(websocket: WebSocket, listener: Listener) -> None:
    with contextlib.suppress(WebSocketDisconnect, RuntimeError):
        while not listener.lost:
            for text in await listener.next():
                await websocket.send_text(text)


async def _hear(websocket: WebSocket) -> None:
    """Nothing is said this way; but that the other end closes is heard."""
    with contextlib.suppress(WebSocketDisconnect, RuntimeError):
        while True:
            await websocket.receive()


async def _check(websocket: WebSocket) -> None:
    """Ends when whoever listens would not be let in any more."""
    with contextlib.suppress(Refusal):
        while True:
            await sleep(CHECK_S)
            await principal(websocket)
