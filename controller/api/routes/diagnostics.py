"""What views ask for beside the status: buses, machine file, a program's path."""

from __future__ import annotations

import asyncio
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

from fastapi import Header, Query, Request, Response

from controller.api import machine_table, models_of_diagnostics, outline, ticks
from controller.api.access import panel_of
from controller.api.answers import Refusal
from controller.api.app_state import Panel
from controller.api.programs import ProgramCheck
from controller.api.router import LOOKS, VIEW, Router, body
from controller.api.slashes import Name
from controller.machine.machine_file import written
from controller.plan.report import picture
from controller.store.history import History

router = Router(tags=["looks"])
FAILED = ("fault", "refused", "lost")
PICTURES = "pictures"  # folder of the panel's, where checks leave them


@router.get("/machine/buses", VIEW, *LOOKS)
async def buses(request: Request) -> models_of_diagnostics.BusList:
    """How full each bus is by its budget and as heard, error counters, and how late ticks came."""
    return models_of_diagnostics.BusList(**await panel_of(request).door.ask("buses"))


@router.get("/machine/file", VIEW, 404)
async def machine_file(request: Request) -> models_of_diagnostics.MachineFile:
    """The machine file that the service runs on, value by value, with lines."""
    machine = await asyncio.to_thread(ticks.machine_of, panel_of(request).store.folder)
    text = written(machine.text)
    rows = [models_of_diagnostics.FileRow(**one.to_dict()) for one in machine_table.rows(text)]
    return models_of_diagnostics.MachineFile(name=machine.name, rows=rows, text=text)


@router.get("/statistics/runs", VIEW, 503)
async def run_sums(request: Request) -> models_of_diagnostics.RunSums:
    """Runs counted by their result, and the time they took."""
    found = await panel_of(request).past.ask(History.sums_of_runs)
    counts = {result: count for result, (count, _, _) in found.items()}
    return models_of_diagnostics.RunSums(
        runs=sum(counts.values()),
        failed=sum(count for result, count in counts.items() if result in FAILED),
        results=counts,
        duration_s=sum(moved_s for _, moved_s, _ in found.values()),
        cut_time_s=sum(cut_s for _, _, cut_s in found.values()),
    )


SAME: dict[int | str, dict[str, Any]] = {304: {"description": "As it was."}}


@router.get(
    "/programs/{name}/picture",
    VIEW,
    404,
    422,
    responses=SAME,
    response_model=models_of_diagnostics.PathPicture,
)
async def path_picture(
    request: Request, name: Name, if_none_match: Annotated[str | None, Header()] = None
) -> Response:
    """A checked program's path, to be drawn; with its ETag sent along, only where it is another one.

    Of a program that is refused as much as could be read and planned of it.
    """
    panel = panel_of(request)
    key, _ = await asyncio.to_thread(_pictured, panel, name)
    tag = {"ETag": f'"{key}"', "Cache-Control": "no-cache"}
    if if_none_match == tag["ETag"]:
        return Response(status_code=304, headers=tag)
    # Made to text beside the loop: hundreds of kilobytes would hold up everybody's figures.
    told = await asyncio.to_thread(lambda: _json(_shape(panel, name, key)))
    return Response(told, media_type="application/json", headers=tag)


@router.get(
    "/programs/{name}/picture.svg",
    VIEW,
    404,
    422,
    carries={**body("image/svg+xml"), **SAME},
)
async def path_outline(
    request: Request,
    name: Name,
    height: Annotated[int, Query(ge=24, le=1200, description="In pixels: it is drawn so finely.")] = 300,
    if_none_match: Annotated[str | None, Header()] = None,
) -> Response:
    """The same as a picture: seen obliquely, what a refused program is refused for in red."""
    panel = panel_of(request)
    key, check = await asyncio.to_thread(_pictured, panel, name)
    tag = {"ETag": f'"{key}-{height}"', "Cache-Control": "no-cache"}
    if if_none_match == tag["ETag"]:
        return Response(status_code=304, headers=tag)

    def drawn() -> str:
        shape = _shape(panel, name, key)
        guilty = outline.guilty_of(shape, check.result) if check.state == "refused" else None
        return outline.svg(shape, height, guilty)

    return Response(await asyncio.to_thread(drawn), media_type="image/svg+xml", headers=tag)


def _pictured(panel: Panel, name: str) -> tuple[str, ProgramCheck]:
    """The picture's name, by the program's check on the machine as it is fitted. Raises Refusal."""
    program = panel.store.programs.get(name)
    check = panel.checker.of(program) if panel.checker is not None else None
    key = str(check.result.get("stored") or check.result.get("pictured") or "") if check is not None else ""
    if check is None or not key:
        raise Refusal.of(404, "missing", "no_picture", program=name)
    return Path(key).name, check


def _shape(panel: Panel, name: str, key: str) -> picture.Shape:
    try:
        return picture.load(panel.store.own / PICTURES / f"{key}.npz")
    except (OSError, ValueError, KeyError):
        raise Refusal.of(404, "missing", "picture_gone", program=name) from None


def _json(found: picture.Shape) -> str:
    return models_of_diagnostics.PathPicture(**_listed(found)).model_dump_json()


def _listed(found: picture.Shape) -> dict[str, Any]:
    """To the micrometre: a screen shows no more."""
    listed = {name: value.tolist() for name, value in asdict(found).items() if name != "tolerance_mm"}
    for name in ("tips", "rulings"):
        listed[name] = getattr(found, name).round(3).tolist()
    listed["axes"] = found.axes.round(5).tolist()
    return {**listed, "tolerance_mm": found.tolerance_mm}
