"""OctoPrint's routes that senders and phone apps use (docs.octoprint.org/en/master/api).

An upload never selects or starts anything, whatever the sender asks for, and says so. What a printer has
and a milling machine has not (heaters, filament) is left out, not made up. Pause and cancel are hold and
stop, for which nobody needs control; what moves the machine needs it (X-Control-Token), which an app for
printers does not have: it is refused by 409, as OctoPrint does where the state does not allow it.
"""

from __future__ import annotations

import asyncio
import shutil
from collections.abc import Mapping
from typing import Annotated, Any, Literal
from urllib.parse import quote

from fastapi import Header, Request, Response
from pydantic import BaseModel

from controller import messages
from controller.api.access import panel_of
from controller.api.answers import Refusal, spoken
from controller.api.app_state import Panel
from controller.api.names import leaf_of
from controller.api.programs import Program
from controller.api.router import OPERATE, VIEW, Router
from controller.api.routes.machine import ask
from controller.api.routes.programs import BODY, place_of, take

router = Router(tags=["OctoPrint's way to upload and to look"])
FLAGS = (
    *("operational", "ready", "printing", "pausing", "paused", "cancelling", "error"),
    *("closedOrError", "sdReady"),
)
# Mode of the machine -> OctoPrint's word for it, and which flags are true.
STATES: dict[str, tuple[str, set[str]]] = {
    "OFF": ("Offline", {"closedOrError"}),
    "READY": ("Operational", {"operational", "ready"}),
    "HOMING": ("Operational", {"operational"}),
    "JOG": ("Operational", {"operational"}),
    "RUNNING": ("Printing", {"operational", "printing"}),
    "TOOL_CHANGE": ("Printing", {"operational", "printing"}),
    "HOLD": ("Paused", {"operational", "paused"}),
    "STOPPING": ("Cancelling", {"operational", "cancelling"}),
    "FAULT": ("Error", {"error", "closedOrError"}),
}
GONE = ("Offline", {"closedOrError"})


class JobCommand(BaseModel):
    """What an app asks of the job; "pause" without an action does the other of pause and resume."""

    command: Literal["start", "cancel", "restart", "pause"]
    action: Literal["pause", "resume", "toggle"] = "toggle"


@router.get("/api/version", VIEW)
async def octoprint_version() -> dict[str, str]:
    """Senders look for a text that begins with OctoPrint."""
    return {"api": "0.1", "server": "1.9.0", "text": "OctoPrint (Directrix)"}


@router.post(
    "/api/files/local", OPERATE, 408, 409, 413, 422, 429, 503, 507, status_code=201, openapi_extra=BODY
)
async def octoprint_upload(request: Request, response: Response) -> dict[str, Any]:
    """Upload a program; the same rules as POST /api/v1/programs."""
    program = (await take(request)).program
    where = place_of(request, program)
    response.headers["Location"] = where
    file = {
        "name": leaf_of(program.name),
        "path": program.name,
        "origin": "local",
        "refs": {"resource": where},
    }
    return {"done": True, "effectiveSelect": False, "effectivePrint": False, "files": {"local": file}}


@router.get("/api/files", VIEW, 503)
@router.get("/api/files/local", VIEW, 503)
async def octoprint_files(request: Request) -> dict[str, Any]:
    """All programs, and the room for more (bytes)."""
    store = panel_of(request).store
    kept = await asyncio.to_thread(store.programs.list)
    disk = await asyncio.to_thread(shutil.disk_usage, store.folder)
    return {"files": [_file(request, program) for program in kept], "free": disk.free, "total": disk.total}


@router.get("/api/files/local/{name:path}", VIEW, 404, 422, 503)
async def octoprint_file(request: Request, name: str) -> dict[str, Any]:
    """One program."""
    return _file(request, await asyncio.to_thread(panel_of(request).store.programs.get, name))


@router.get("/api/printer", VIEW, 409)
async def octoprint_printer(request: Request) -> dict[str, Any]:
    """The state as flags; 409 where the machine is off, in a fault, or not there, as OctoPrint has it."""
    text, flags = _state(await _status(panel_of(request)))
    if "operational" not in flags:
        raise Refusal.of(409, "refused", "not_operational", state=text)
    said = {"text": text, "flags": {flag: flag in flags for flag in FLAGS}}
    return {"temperature": {}, "sd": {"ready": False}, "state": said}


@router.get("/api/job", VIEW)
async def octoprint_job(request: Request) -> dict[str, Any]:
    """What is loaded or runs, and how far it is: per cent, and seconds."""
    status = await _status(panel_of(request))
    job: Mapping[str, Any] = status.get("job") or {}
    text, _ = _state(status)
    share = job.get("fraction")
    told: dict[str, Any] = {
        "job": {
            "file": {"name": job.get("name"), "path": job.get("name"), "origin": "local" if job else None},
            "estimatedPrintTime": job.get("duration_s"),
            "filament": None,
        },
        "progress": {
            "completion": None if share is None else 100.0 * share,
            "printTime": _seconds(job.get("elapsed_s")),
            "printTimeLeft": _seconds(job.get("left_s")),
        },
        "state": text,
    }
    fault: Mapping[str, Any] = status.get("fault") or {}
    words = messages.text(fault, spoken.get()) or fault.get("name")
    return {**told, "error": words} if text == "Error" else told


@router.post("/api/job", OPERATE, 409, 422, 503, status_code=204)
async def octoprint_command(
    request: Request,
    body: JobCommand,
    x_control_token: Annotated[str, Header(description="Needed for start and resume.")] = "",
) -> None:
    """Pause (hold), cancel (stop), and, holding control, start and resume."""
    panel = panel_of(request)
    verb = await _verb(panel, body)
    if verb in ("start", "resume"):
        panel.control.check(x_control_token)
    await ask(request, verb)


async def _verb(panel: Panel, body: JobCommand) -> str:
    """The service's. Raises Refusal for what the machine does not do."""
    if body.command == "restart":
        raise Refusal.of(409, "refused", "no_restart")
    if body.command != "pause":
        return {"start": "start", "cancel": "stop"}[body.command]
    if body.action != "toggle":
        return {"pause": "hold", "resume": "resume"}[body.action]
    return "resume" if (await panel.watch.status()).get("mode") == "HOLD" else "hold"


async def _status(panel: Panel) -> Mapping[str, Any]:
    """Nothing, where the service is gone: that is a state, too."""
    try:
        return await panel.watch.status()
    except Refusal:
        return {}


def _state(status: Mapping[str, Any]) -> tuple[str, set[str]]:
    """A mode that is not known is not taken for one in which something may be done."""
    return STATES.get(str(status.get("mode")), GONE)


def _seconds(value: Any) -> int | None:
    return round(value) if isinstance(value, int | float) else None


def _file(request: Request, program: Program) -> dict[str, Any]:
    where = place_of(request, program)
    text = str(request.url_for("text", name=quote(program.name, safe="")))
    return {
        **{
            "name": leaf_of(program.name),
            "display": leaf_of(program.name),
            "path": program.name,
            "origin": "local",
        },
        **{"type": "machinecode", "typePath": ["machinecode", "gcode"]},
        **{"size": program.size, "date": int(program.uploaded_s)},
        "refs": {"resource": where, "download": text},
    }
