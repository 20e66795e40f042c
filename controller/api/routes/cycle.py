"""The cycle: load, start, hold, resume, stop, single block, retract and return."""

from __future__ import annotations

import asyncio
from typing import Any

from fastapi import Request, Response

from controller.api import models, service_client
from controller.api.access import panel_of
from controller.api.answers import Answer, Refusal
from controller.api.router import LOOKS, MOVE, VIEW, Router
from controller.messages import message

router = Router(tags=["cycle"])


RETRY = {"Retry-After": {"schema": {"type": "integer"}, "description": "Seconds."}}
PLACE = {"Location": {"schema": {"type": "string"}, "description": "Of the job: GET it until it is loaded."}}
LATER: dict[int | str, dict[str, Any]] = {
    202: {"model": models.Done, "description": "It is still being read.", "headers": {**PLACE, **RETRY}}
}


@router.post("/job", MOVE, 404, 409, 422, 503, responses=LATER)
async def load(request: Request, response: Response, body: models.Load) -> models.Done:
    """Load a program: whole, from a line and a fraction of its block, or where it was interrupted.

    200: it is loaded, and may be started. 202, after some seconds: it is read on; GET /job, which
    Location names, tells by its state when it is loaded, or was refused and why.
    """
    if body.restart and (body.line, body.fraction, body.dry_run_mm) != (None, None, None):
        raise Refusal.of(409, "bad", "restart_line")
    where = body.model_dump(include={"line", "fraction", "dry_run_mm"}, exclude_none=True)
    where |= {key: True for key in ("restart", "block_delete") if getattr(body, key)}
    panel = panel_of(request)
    return answered(
        request, response, await service_client.load(panel.store, panel.door, body.program, **where)
    )


def answered(request: Request, response: Response, loaded: dict[str, Any]) -> models.Done:
    """What the service said to a load; 202 where it is still at it."""
    if loaded.get("done") is False:
        response.status_code = 202
        response.headers.update({"Location": request.url_for("job").path, "Retry-After": "1"})
    return models.Done(request="load", result=loaded)


@router.get("/job", VIEW, 404, 503, response_model=models.JobFacts)
async def job(request: Request) -> Answer:
    """The program that is loaded, being loaded or under way, or that was last, as the status has it."""
    found = (await panel_of(request).watch.status()).get("job")
    if not found:
        raise Refusal.of(404, "missing", "not_loaded")
    return Answer(found)


@router.get("/restart", VIEW, *LOOKS)
async def restart(request: Request) -> models.RestartFacts:
    """What was interrupted, and whether it may be gone on with; by itself nothing is."""
    panel = panel_of(request)
    found = await panel.door.ask("restart")
    if not found.get("sha256"):
        return models.RestartFacts(**found)
    kept = await asyncio.to_thread(panel.store.programs.list)
    same = [program.name for program in kept if program.sha256 == found["sha256"]]
    if not same:
        words = {} if found.get("key") else dict(message("not_stored", program=found["name"]))
        return models.RestartFacts(**{**found, "offered": False, **words})
    return models.RestartFacts(**found, program=found["name"] if found["name"] in same else same[0])
