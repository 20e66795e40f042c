"""The cycle: load, start, hold, resume, stop, single block, retract and return."""

from __future__ import annotations

import asyncio
from typing import Any

from fastapi import APIRouter, Request, Response

from controller.api import models, service_client
from controller.api.access import moves, needs, panel_of, stops
from controller.api.answers import Answer, Refusal, documented
from controller.api.roles import Role
from controller.api.routes.machine import LOOKS, MOVES, ask
from controller.messages import said

router = APIRouter(tags=["cycle"])


RETRY = {"Retry-After": {"schema": {"type": "integer"}, "description": "Seconds."}}
PLACE = {"Location": {"schema": {"type": "string"}, "description": "Of the job: GET it until it is loaded."}}
LATER: dict[int | str, dict[str, Any]] = {
    202: {"model": models.Done, "description": "It is still being read.", "headers": {**PLACE, **RETRY}}
}


@router.post("/job", dependencies=[moves()], responses={**LATER, **documented(401, 403, 404, 409, 422, 503)})
async def load(request: Request, response: Response, body: models.Load) -> models.Done:
    """Load a program: whole, from a line and a fraction of its block, or where it was interrupted.

    200: it is loaded, and may be started. 202, after some seconds: it is read on; GET /job, which
    Location names, tells by its state when it is loaded, or was refused and why.
    """
    if body.restart and (body.line, body.fraction, body.dry_run_mm) != (None, None, None):
        raise Refusal.told(409, "bad", "restart_line")
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


@router.get(
    "/job",
    dependencies=[needs(Role.VIEW)],
    response_model=models.JobFacts,
    responses=documented(401, 403, 404, 503),
)
async def job(request: Request) -> Answer:
    """The program that is loaded, being loaded or under way, or that was last, as the status has it."""
    found = (await panel_of(request).watch.status()).get("job")
    if not found:
        raise Refusal.told(404, "missing", "not_loaded")
    return Answer(found)


@router.get("/restart", dependencies=[needs(Role.VIEW)], responses=LOOKS)
async def restart(request: Request) -> models.RestartFacts:
    """What was interrupted, and whether it may be gone on with; by itself nothing is."""
    panel = panel_of(request)
    found = await panel.door.ask("restart")
    if not found.get("sha256"):
        return models.RestartFacts(**found)
    kept = await asyncio.to_thread(panel.store.programs.list)
    same = [program.name for program in kept if program.sha256 == found["sha256"]]
    if not same:
        words = {} if found.get("key") else dict(said("not_stored", program=found["name"]))
        return models.RestartFacts(**{**found, "offered": False, **words})
    return models.RestartFacts(**found, program=found["name"] if found["name"] in same else same[0])


@router.delete("/job", dependencies=[moves()], responses=MOVES)
async def unload(request: Request) -> models.Done:
    """Forget the loaded program; refused while it runs."""
    return await ask(request, "unload")


@router.post("/cycle/start", dependencies=[moves()], responses=MOVES)
async def start(request: Request, body: models.Start | None = None) -> models.Done:
    """Cycle start of the loaded program.

    Where the disk cannot take what the run leaves behind, it is refused with the code "unrecorded"; with
    "worn" where the tool in the spindle is at the end of its life.
    """
    confirmed = {key: True for key in ("unrecorded", "worn") if body is not None and getattr(body, key)}
    return await ask(request, "start", **confirmed)


@router.post("/cycle/hold", dependencies=[stops()], responses=MOVES)
async def hold(request: Request) -> models.Done:
    """Slow down to rest on the path, at once. Needs no control token."""
    return await ask(request, "hold")


@router.post("/cycle/resume", dependencies=[moves()], responses=MOVES)
async def resume(request: Request) -> models.Done:
    """Go on after a hold."""
    return await ask(request, "resume")


@router.post("/cycle/stop", dependencies=[stops()], responses=MOVES)
async def stop(request: Request) -> models.Done:
    """Slow down to rest on the path and end the program. Needs no control token."""
    return await ask(request, "stop")


@router.put("/cycle/single_block", dependencies=[moves()], responses=MOVES)
async def single_block(request: Request, body: models.Switch) -> models.Done:
    """Stop at the end of every block, or run through."""
    return await ask(request, "single_block", on=body.on)


@router.put("/cycle/optional_stop", dependencies=[moves()], responses=MOVES)
async def optional_stop(request: Request, body: models.Switch) -> models.Done:
    """Whether M1 stops."""
    return await ask(request, "optional_stop", on=body.on)


@router.put("/cycle/adaptive_feed", dependencies=[moves()], responses=MOVES)
async def adaptive_feed(request: Request, body: models.Switch) -> models.Done:
    """Whether the load of the spindle leads the feed of every cut, or only where the program says M52 P1."""
    return await ask(request, "adaptive_feed", on=body.on)


@router.post("/cycle/retract", dependencies=[moves()], responses=MOVES)
async def retract(request: Request, body: models.Retract) -> models.Done:
    """In a hold, or ready: move back along the tool axis, to look, to change the insert, or after a fault.

    At most by the status' `retract_room_mm`; a refusal says how far.
    """
    return await ask(request, "retract", mm=body.mm)


@router.post("/cycle/withdraw", dependencies=[moves()], responses=MOVES)
async def withdraw(request: Request, body: models.Withdraw) -> models.Done:
    """Out of a thread in which a fault, a stop or a loss of power has left the tool: in step.

    Until then nothing else moves the machine but a resume. What is known of the thread is the notice
    IN_THREAD of the status.
    """
    return await ask(request, "withdraw", mm=body.mm, is_out=body.is_out)


@router.post("/cycle/return", dependencies=[moves()], responses=MOVES)
async def return_(request: Request) -> models.Done:
    """Back to a place off the part, beside the path, with the tool that is in the spindle now.

    A resume then leads in and goes on. Refused where the way would lead into a surface of the program.
    """
    return await ask(request, "return")
