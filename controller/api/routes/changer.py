"""The tool changer: where its tools are, and what an operator confirms of them."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import Request
from pydantic import Field

from controller.api import models
from controller.api.access import panel_of
from controller.api.router import VIEW, Router

router = Router(tags=["tool changer"])
Number = Annotated[int, Field(ge=0, le=99999)]


@router.get("/changer", VIEW, 409, 503)
async def changer(request: Request) -> models.Told:
    """Spindle, pockets, the step under way, what must be confirmed, and the last steps."""
    facts: dict[str, Any] = await panel_of(request).door.ask("changer")
    return models.Told(**facts)
