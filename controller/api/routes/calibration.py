"""Calibration, set-up of the part and inspection: what may be measured, and what a measurement comes to.

Nothing is changed here. A work offset that was found is set as any (PUT /offsets/{name}); a machine file that
was found is told whole: it belongs to who may write it on the machine (directrix backup update).
"""

from __future__ import annotations

import asyncio
import contextlib
import tempfile
from collections.abc import AsyncIterator, Mapping
from pathlib import Path as FilePath
from typing import Annotated, Any

import numpy as np
from fastapi import Path, Request
from pydantic import Field

from controller.api import models
from controller.api.access import owner_of, panel_of, principal
from controller.api.answers import Refusal
from controller.api.app_state import Panel
from controller.api.router import OPERATE, VIEW, Router
from controller.api.routes.ticks import found_in
from controller.calibration import measurements
from controller.calibration.refusal import Refusal as Unmeasured
from controller.ipc.handoff import ROW

router = Router(prefix="/calibration", tags=["calibration"])
MAX_TABLE = 1_900_000  # characters
Value = Annotated[float, Field(ge=-1e9, le=1e9)] | Annotated[str, Field(max_length=measurements.MAX_TEXT)]


class Measured(models.Sent):
    """Values that are not named are as usual."""

    values: Annotated[dict[str, Value], Field(default_factory=dict, max_length=12)]
    table: Annotated[str, Field(max_length=MAX_TABLE, description="CSV of what was measured.")] = ""
    program: Annotated[
        str, Field(max_length=200, description="In the store, whose surfaces it is about.")
    ] = ""
    ticks: Annotated[
        str | None,
        Field(pattern="^(now|recording:[0-9A-Za-z][0-9A-Za-z._-]{0,100})$", description="As it moved."),
    ] = None


class Evaluated(models.Told):
    measurement: str
    told: dict[str, Any] = Field(description="Figures by name, which ends in the unit.")
    machine_file: str | None = Field(description="As it would be with this; nothing was written.")
    picture: str | None = Field(description="PNG as base64; null: of this there is none.")


@router.get("", VIEW)
async def known() -> models.Told:
    """Every measurement: what it takes, its values, whether it finds what stands in a machine file."""
    facts: dict[str, Any] = {"measurements": measurements.listed()}
    return models.Told(**facts)


@router.post("/{name}", OPERATE, 404, 409, 413, 422, 429, 503)
async def evaluate(request: Request, name: Annotated[str, Path(max_length=20)], body: Measured) -> Evaluated:
    """What a measurement comes to, on the machine as it is fitted."""
    panel = panel_of(request)
    try:
        kind = measurements.named(name)
    except Unmeasured as error:
        raise Refusal(404, "missing", error.said) from error
    try:
        values = measurements.complete(name, body.values)
    except Unmeasured as error:
        raise Refusal(422, "bad", error.said) from error
    _there(kind, body)
    job = {"measurement": name, "values": values, "table": body.table, "file": "table"}
    job |= {"state": str(panel.store.folder), **await asyncio.to_thread(_program, panel, body.program)}
    owner = owner_of(request, await principal(request))
    busy = Refusal.of(429, "many", "calibration.busy", headers={"Retry-After": "1"})
    failed = Refusal.of(503, "unread", "calibration.unread", seconds=panel.measuring.longest_s)
    async with _recording(request, body.ticks if kind.takes == "ticks" else None) as file:
        answer = await panel.measuring.run({**job, "recording": file}, busy, failed, owner)
    if refused := answer.get("refused"):
        raise Refusal(422, "bad", refused)
    return Evaluated(measurement=name, **answer["found"])


def _there(kind: measurements.Measurement, body: Measured) -> None:
    """Raises Refusal where what is measured by is missing."""
    needed = {
        "no_table": kind.takes in ("touches", "laser") and not body.table,
        "no_recording": kind.takes == "ticks" and body.ticks is None,
        "no_program": kind.program == "yes" and not body.program,
    }
    if missing := next((key for key, lacks in needed.items() if lacks), None):
        raise Refusal.of(422, "form", f"calibration.{missing}")


def _program(panel: Panel, name: str) -> Mapping[str, Any]:
    """Raises StoreError where there is none of that name."""
    if not name:
        return {"program": None, "name": "", "files": {}}
    found = panel.store.programs.get(name)
    path = panel.store.programs.sound_path(found.sha256)
    return {"program": path, "name": found.name, "files": panel.store.programs.called(found)}


@contextlib.asynccontextmanager
async def _recording(request: Request, source: str | None) -> AsyncIterator[str | None]:
    """A file with the ticks of a source, while it is looked at; None for none. Raises Refusal."""
    if source is None:
        yield None
        return
    found = await found_in(request, source)
    with tempfile.TemporaryDirectory() as folder:
        file = FilePath(folder) / "ticks.npz"
        period_s = found.machine.period_s
        await asyncio.to_thread(np.savez, file, columns=np.array(ROW), rows=found.rows, period_s=period_s)
        yield str(file)
