"""The queue: programs that run one after another, each so many times."""

from __future__ import annotations

import asyncio
from dataclasses import asdict
from typing import Annotated

from fastapi import Path, Request, Response
from pydantic import Field

from controller import messages
from controller.api import models, service_client
from controller.api.access import panel_of, principal
from controller.api.answers import Refusal, Texts
from controller.api.app_state import Panel
from controller.api.models import Number, Sent, Told
from controller.api.router import MOVE, OPERATE, VIEW, Router
from controller.api.routes.cycle import LATER, answered

Count = Annotated[int, Field(ge=1, le=10_000)]


class NewEntry(Sent):
    program: Annotated[str, Field(min_length=1, max_length=200, description="Name in the store.")]
    count: Count = 1


class EntryChange(Sent):
    """What is null stays."""

    count: Count | None = None
    place: Annotated[int | None, Field(ge=0, le=10_000, description="0: the first.")] = None


class EntryFacts(Told):
    id: int
    program: str
    count: int
    done: int = Field(description="Of these so many ran to their end.")
    added_s: Number
    added_by: str


class QueueFacts(Told, Texts):
    """What is said is why it does not go on by itself any more."""

    entries: list[EntryFacts]
    next: int | None = Field(description="The entry that is next: the first that is not done.")
    go_on: bool = Field(description="What is next is loaded and started when a run has ended whole.")


router = Router(tags=["queue"])
EntryNumber = Annotated[int, Path(ge=0, le=2**53)]


@router.get("/queue", VIEW, 503)
async def queue(request: Request) -> QueueFacts:
    """What is to run, what of it was, and whether it goes on by itself."""
    return await _facts(panel_of(request))


@router.post("/queue", OPERATE, 404, 422, 429, 503, status_code=201)
async def add(request: Request, body: NewEntry) -> QueueFacts:
    """Put a program at its end; nothing is loaded or started by that."""
    panel, who = panel_of(request), await principal(request)
    added = await asyncio.to_thread(panel.store.queue.add, body.program, body.count, who.name)
    if [added] == await asyncio.to_thread(panel.store.queue.all):
        await panel.past.ask_if_there(panel.store.queue.count_runs)  # from here on
    return await _changed(panel)


@router.patch("/queue/{number}", OPERATE, 404, 422, 503)
async def change(request: Request, number: EntryNumber, body: EntryChange) -> QueueFacts:
    """Another count, or another place."""
    panel = panel_of(request)
    await asyncio.to_thread(panel.store.queue.change, number, body.count, body.place)
    return await _changed(panel)


@router.delete("/queue/{number}", OPERATE, 404, 422, 503)
async def remove(request: Request, number: EntryNumber) -> QueueFacts:
    """Take it out; what is loaded or runs is not touched."""
    panel = panel_of(request)
    await asyncio.to_thread(panel.store.queue.remove, number)
    return await _changed(panel)


@router.post("/queue/load", MOVE, 404, 409, 422, 503, responses=LATER)
async def load_next(request: Request, response: Response) -> models.Done:
    """Load what is next, as POST /job does; it is started by POST /cycle/start."""
    panel = panel_of(request)
    if (front := await asyncio.to_thread(panel.store.queue.front)) is None:
        raise Refusal.of(409, "refused", "queue_empty")
    return answered(request, response, await service_client.load(panel.store, panel.door, front.program))


@router.put("/queue/go_on", MOVE, 409, 422, 503)
async def go_on(request: Request, body: models.Switch) -> QueueFacts:
    """Whether it goes on by itself after each run that ends whole, as long as whoever asks for it holds
    control and is heard of; any stop, hold, fault or refusal ends that. The first run is started by hand.
    """
    panel = panel_of(request)
    panel.go_on.choose(body.on)
    return await _changed(panel)


async def _changed(panel: Panel) -> QueueFacts:
    panel.events.tell("programs", {"name": "", "done": "queued"})
    return await _facts(panel)


async def _facts(panel: Panel) -> QueueFacts:
    entries = await asyncio.to_thread(panel.store.queue.all)
    waiting = (one.id for one in entries if one.done < one.count)
    return QueueFacts(
        entries=[EntryFacts(**asdict(one)) for one in entries],
        next=next(waiting, None),
        go_on=panel.go_on.on,
        **messages.facts(panel.go_on.why),
    )
