"""The scope: signals of every tick, of the machine now, of a fault's recording, or of a run."""

from __future__ import annotations

import asyncio
from typing import Annotated, Any

from fastapi import Query, Request, Response
from fastapi.responses import StreamingResponse

from controller.api import models_of_diagnostics as models
from controller.api import signals, ticks
from controller.api.access import panel_of
from controller.api.answers import Refusal
from controller.api.router import VIEW, Router, body
from controller.api.routes import records
from controller.api.signals import Signals
from controller.geometry.arrays import Array
from controller.messages import Key

router = Router(prefix="/ticks", tags=["scope"])
LOOKS = (404, 409, 422, 503)
MAX_SIGNALS = 16

Source = Annotated[
    str,
    Query(
        pattern=r"^(now|run:[1-9][0-9]{0,15}|recording:[0-9A-Za-z][0-9A-Za-z._-]{0,100})$",
        description="now, run:NUMBER or recording:NAME.",
    ),
]
Names = Annotated[str, Query(min_length=1, max_length=500, description="Signals, with commas between.")]
Tick = Annotated[
    int | None, Query(ge=0, le=2**53, description="Number of a tick; null: as far as there are.")
]
Most = Annotated[int, Query(ge=1, le=5000, description="Columns; each keeps its lowest and highest tick.")]
Name = Annotated[str, Query(min_length=1, max_length=40, description="A signal.")]
Edge = Annotated[str, Query(pattern="^(rising|falling|either|change)$")]
Level = Annotated[float, Query(ge=-1e12, le=1e12, allow_inf_nan=False, description="In the signal's unit.")]


@router.get("/signals", VIEW, *LOOKS)
async def names(request: Request, source: Source = "now") -> models.SignalList:
    """The signals that there are, with their units, and which ticks."""
    found = await found_in(request, source)
    return models.SignalList(signals=signals.names(found.machine), **_span(found))


@router.get("", VIEW, *LOOKS)
async def shown(
    request: Request,
    names: Names,
    source: Source = "now",
    first: Tick = None,
    last: Tick = None,
    most: Most = 1000,
) -> models.TickWindow:
    """Signals over some ticks, to be drawn."""
    found, wanted = await found_in(request, source), _signal_names(names)
    return await asyncio.to_thread(_window, found, wanted, first, last, most)


@router.get("/trigger", VIEW, *LOOKS)
async def trigger(
    request: Request,
    name: Name,
    level: Level = 0.0,
    edge: Edge = "rising",
    source: Source = "now",
    after: Tick = None,
) -> models.TriggerFacts:
    """The first tick after ``after`` at which a signal crosses a level, or changes; null: not yet."""
    found = await found_in(request, source)
    values = _values(found, name, slice(None))
    begin = 1 if after is None else max(1, found.between(after + 1, None).start)
    index = signals.crossing(values, level, edge, begin)
    return models.TriggerFacts(tick=None if index is None else int(found.ticks[index]), **_span(found))


@router.get("/export.csv", VIEW, *LOOKS, carries=body("text/csv", is_text=True))
async def as_csv(
    request: Request, names: Names, source: Source = "now", first: Tick = None, last: Tick = None
) -> StreamingResponse:
    """Every tick as a line, all digits."""
    found, wanted = await found_in(request, source), _signal_names(names)
    for name in wanted:
        _values(found, name, slice(0, 0))
    lines = signals.csv(found, wanted, found.between(first, last))
    return StreamingResponse(lines, media_type="text/csv", headers=_named("ticks.csv"))


@router.get("/export.npz", VIEW, *LOOKS, carries={200: records.FILE[200]})
async def as_npz(
    request: Request, names: Names, source: Source = "now", first: Tick = None, last: Tick = None
) -> Response:
    """Every tick as a file of NumPy: ``tick``, ``period_s``, ``units``, and an array per signal."""
    found, wanted = await found_in(request, source), _signal_names(names)
    for name in wanted:
        _values(found, name, slice(0, 0))
    data = await asyncio.to_thread(signals.npz, found, wanted, found.between(first, last))
    return Response(data, media_type="application/octet-stream", headers=_named("ticks.npz"))


def _named(file: str) -> dict[str, str]:
    return {"content-disposition": f'attachment; filename="{file}"'}


async def found_in(request: Request, source: str) -> Signals:
    """The ticks of a source. Raises Refusal."""
    panel = panel_of(request)
    kind, _, which = source.partition(":")
    if kind == "recording":
        names = {one.name for one in await asyncio.to_thread(records.inside, panel.recordings)}
        if which not in names:  # compared, never made into a path
            raise Refusal.of(404, "missing", "missing", what=Key("what.recording"), name=which)
        return await asyncio.to_thread(ticks.of_recording, panel.recordings / which)
    machine = await asyncio.to_thread(ticks.machine_of, panel.store.folder)
    if kind == "now":
        return Signals(await panel.latest.look(machine.period_s), machine)
    folder = panel.run_records / await records.record_of(panel, int(which))
    return await asyncio.to_thread(ticks.of_run, folder, machine)


def _signal_names(names: str) -> list[str]:
    wanted = list(dict.fromkeys(names.split(",")))
    if len(wanted) > MAX_SIGNALS:
        raise Refusal.of(409, "bad", "many_signals", found=len(wanted), most=MAX_SIGNALS)
    return wanted


def _values(found: Signals, name: str, where: slice) -> Array:
    try:
        return found.values(name, where)
    except KeyError:
        known = ", ".join(signals.names(found.machine))
        raise Refusal.of(404, "missing", "no_signal", name=repr(name[:40]), allowed=known) from None


def _window(
    found: Signals, wanted: list[str], first: int | None, last: int | None, most: int
) -> models.TickWindow:
    where = found.between(first, last)
    thin = signals.thinned(found.ticks[where], [_values(found, name, where) for name in wanted], most)
    high = thin.high if thin.per_column > 1 else ()
    return models.TickWindow(
        ticks=[int(tick) for tick in thin.ticks],
        per_column=thin.per_column,
        low={name: signals.plain(values) for name, values in zip(wanted, thin.low, strict=True)},
        high={name: signals.plain(values) for name, values in zip(wanted, high, strict=bool(high))},
        **_span(found),
    )


def _span(found: Signals) -> dict[str, Any]:
    ticks_there = found.ticks
    some = len(ticks_there) > 0
    return {
        "period_s": found.machine.period_s,
        "oldest": int(ticks_there[0]) if some else None,
        "newest": int(ticks_there[-1]) if some else None,
    }
