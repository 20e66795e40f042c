"""The queue: programs that run one after another, each so many times."""

from __future__ import annotations

import asyncio
from dataclasses import asdict
from typing import Annotated

from fastapi import APIRouter, Path, Request, Response

from controller import messages
from controller.api import loading, models
from controller.api import models_of_queue as queue_models
from controller.api.access import moves, needs, panel_of, principal
from controller.api.answers import Refusal, documented
from controller.api.app_state import Panel
from controller.api.roles import Role
from controller.api.routes.cycle import LATER, answered

router = APIRouter(tags=["queue"])
OPERATE = [needs(Role.OPERATE)]
Number = Annotated[int, Path(ge=0, le=2**53)]


@router.get("/queue", dependencies=[needs(Role.VIEW)], responses=documented(401, 403, 503))
async def queue(request: Request) -> queue_models.QueueFacts:
    """What is to run, what of it was, and whether it goes on by itself."""
    return await _facts(panel_of(request))


@router.post(
    "/queue", status_code=201, dependencies=OPERATE, responses=documented(401, 403, 404, 422, 429, 503)
)
async def add(request: Request, body: queue_models.NewEntry) -> queue_models.QueueFacts:
    """Put a program at its end; nothing is loaded or started by that."""
    panel, who = panel_of(request), await principal(request)
    await asyncio.to_thread(panel.store.queue.add, body.program, body.count, who.name)
    return await _changed(panel)


@router.patch("/queue/{number}", dependencies=OPERATE, responses=documented(401, 403, 404, 422, 503))
async def change(request: Request, number: Number, body: queue_models.EntryChange) -> queue_models.QueueFacts:
    """Another count, or another place."""
    panel = panel_of(request)
    await asyncio.to_thread(panel.store.queue.change, number, body.count, body.place)
    return await _changed(panel)


@router.delete("/queue/{number}", dependencies=OPERATE, responses=documented(401, 403, 404, 422, 503))
async def remove(request: Request, number: Number) -> queue_models.QueueFacts:
    """Take it out; what is loaded or runs is not touched."""
    panel = panel_of(request)
    await asyncio.to_thread(panel.store.queue.remove, number)
    return await _changed(panel)


@router.post(
    "/queue/load", dependencies=[moves()], responses={**LATER, **documented(401, 403, 404, 409, 422, 503)}
)
async def load_next(request: Request, response: Response) -> models.Done:
    """Load what is next, as POST /job does; it is started by POST /cycle/start."""
    panel = panel_of(request)
    if (front := await asyncio.to_thread(panel.store.queue.front)) is None:
        raise Refusal.told(409, "refused", "queue_empty")
    return answered(request, response, await loading.load(panel.store, panel.door, front.program))


@router.put("/queue/go_on", dependencies=[moves()], responses=documented(401, 403, 409, 422, 503))
async def go_on(request: Request, body: models.Switch) -> queue_models.QueueFacts:
    """Whether it goes on by itself after each run that ends whole, as long as whoever asks for it holds
    control and is heard of; any stop, hold, fault or refusal ends that. The first run is started by hand.
    """
    panel = panel_of(request)
    panel.go_on.choose(body.on)
    return await _changed(panel)


async def _changed(panel: Panel) -> queue_models.QueueFacts:
    panel.events.tell("programs", {"name": "", "done": "queued"})
    return await _facts(panel)


async def _facts(panel: Panel) -> queue_models.QueueFacts:
    entries = await asyncio.to_thread(panel.store.queue.all)
    waiting = (one.id for one in entries if one.done < one.count)
    return queue_models.QueueFacts(
        entries=[queue_models.EntryFacts(**asdict(one)) for one in entries],
        next=next(waiting, None),
        go_on=panel.go_on.on,
        **messages.facts(panel.go_on.why),
    )
