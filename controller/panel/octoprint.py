"""The two routes of OctoPrint that senders use to upload: they ask for the version, then send.

An upload never selects or starts anything, whatever the sender asks for, and says so.
"""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Request, Response

from controller.panel.access import needs
from controller.panel.answers import documented
from controller.panel.roles import Role
from controller.panel.routes.programs import BODY, place_of, take

router = APIRouter(tags=["OctoPrint's way to upload"])


@router.get("/api/version", dependencies=[needs(Role.VIEW)], responses=documented(401, 403))
async def octoprint_version() -> dict[str, str]:
    """Senders look for a text that begins with OctoPrint."""
    return {"api": "0.1", "server": "1.9.0", "text": "OctoPrint (Directrix)"}


@router.post(
    "/api/files/local",
    status_code=201,
    dependencies=[needs(Role.OPERATE)],
    openapi_extra=BODY,
    responses=documented(401, 403, 408, 409, 413, 422, 429, 503, 507),
)
async def octoprint_upload(request: Request, response: Response) -> dict[str, Any]:
    """Upload a program; the same rules as POST /api/v1/programs."""
    program = (await take(request)).program
    where = place_of(request, program)
    response.headers["Location"] = where
    file = {"name": program.name, "path": program.name, "origin": "local", "refs": {"resource": where}}
    return {"done": True, "effectiveSelect": False, "effectivePrint": False, "files": {"local": file}}
