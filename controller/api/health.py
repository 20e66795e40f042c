"""``/healthz`` and ``/readyz`` for who watches over processes: without log-in, nothing but ok or not."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response

from controller.api import models
from controller.api.access import panel_of
from controller.api.answers import DESCRIPTIONS, Refusal

router = APIRouter(tags=["health"])
ALIVE, READY = "/healthz", "/readyz"


@router.get(ALIVE)
async def alive() -> models.Health:
    """Whether the panel answers at all."""
    return models.Health(ok=True)


@router.get(READY, responses={503: {"model": models.Health, "description": DESCRIPTIONS[503]}})
async def ready(request: Request, response: Response) -> models.Health:
    """Whether the service answers and its tick runs; 503 where not."""
    try:
        ok = bool((await panel_of(request).watch.status()).get("tick_alive"))
    except Refusal:
        ok = False
    response.status_code = 200 if ok else 503
    return models.Health(ok=ok)
