"""Probing cycles: which there are, and one of them from where the probe stands."""

from __future__ import annotations

import asyncio
import csv
import io
import sqlite3
from datetime import UTC, datetime
from typing import Annotated, Any

from fastapi import Path, Request, Response
from pydantic import Field

from controller.api import models
from controller.api.access import panel_of
from controller.api.answers import Refusal
from controller.api.database import StoreError
from controller.api.router import LOOKS, VIEW, Router, body
from controller.messages import of_error
from controller.program import probing_cycles
from controller.store import service_store

router = Router(tags=["probing"])
Value = Annotated[float, Field(ge=-1000.0, le=1000.0)] | Annotated[str, Field(max_length=8)]


@router.get("/probing", VIEW, *LOOKS)
async def cycles() -> models.Told:
    """Every cycle with its values: what each may be, and is where it is not said."""
    facts: dict[str, Any] = {"cycles": probing_cycles.listed(), "offsets": list(probing_cycles.SETTABLE)}
    return models.Told(**facts)


class Found(models.Told):
    """The result of a cycle."""

    at_s: float = Field(description="Seconds since 1970.")
    program: str
    cycle: str
    values: dict[str, float] = Field(description="By name, which ends in the unit.")


class Results(models.Told):
    found: list[Found]


@router.get("/probing/found", VIEW, *LOOKS)
async def results(request: Request) -> Results:
    """What cycles have found, the newest first: those by name, and those of programs."""
    return Results(**await panel_of(request).door.ask("probed"))


@router.get("/probing/found.csv", VIEW, *LOOKS, carries=body("text/csv", is_text=True))
async def results_csv(request: Request) -> Response:
    """The same as a table: a row for each value."""
    told = await results(request)
    made = io.StringIO()
    rows = csv.writer(made)
    rows.writerow(("time", "program", "cycle", "value", "unit", "number"))
    for one in told.found:
        at = datetime.fromtimestamp(one.at_s, UTC).isoformat(timespec="seconds")
        for value, number in one.values.items():
            name, _, unit = value.rpartition("_")
            rows.writerow((at, one.program, one.cycle, name or value, unit if name else "", number))
    return Response(made.getvalue(), media_type="text/csv")


@router.get("/probing/touches.csv", VIEW, 404, 503, carries=body("text/csv", is_text=True))
async def touches(request: Request) -> Response:
    """The last touches of the probe, as calibration, set-up and inspection take them."""
    state = panel_of(request).store.folder
    try:
        lines = await asyncio.to_thread(service_store.document_of, state, "touches")
    except FileNotFoundError:
        raise Refusal.of(404, "missing", "no_touches") from None
    except (OSError, ValueError, sqlite3.Error) as error:
        file, why = state / service_store.FILE, of_error(error)
        raise StoreError.of("store", "store_unread", file=file, why=why) from error
    return Response("".join(f"{line}\n" for line in lines), media_type="text/csv")


@router.get("/probing/{name}.svg", VIEW, 404, 422, carries=body("image/svg+xml"))
async def picture(name: Annotated[str, Path(max_length=20)]) -> Response:
    """What a cycle does: the part, the way of the probe, where it touches, the letters of its values."""
    if (drawn := probing_cycles.picture(name)) is None:
        allowed = ", ".join(probing_cycles.CYCLES)
        raise Refusal.of(404, "missing", "probe_cycle", found=name, allowed=allowed)
    return Response(drawn, media_type="image/svg+xml")
