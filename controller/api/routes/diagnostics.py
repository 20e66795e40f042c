"""What views ask for beside the status: buses, machine file, a program's path, an offset from the tool."""

from __future__ import annotations

import asyncio
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

from fastapi import APIRouter, Header, Request, Response
from pydantic import Field

from controller.api import machine_table, models, models_of_diagnostics, ticks, touch_off
from controller.api.access import moves, needs, panel_of
from controller.api.answers import Refusal, documented
from controller.api.app_state import Panel
from controller.api.roles import Role
from controller.api.routes.machine import LOOKS, MOVES, ask
from controller.api.routes.tables import OffsetName, rows_by
from controller.machine.changes import turned_deg
from controller.machine.machine_file import written
from controller.plan.report import picture

router = APIRouter(tags=["looks"])
FAILED = ("fault", "refused", "lost")
PICTURES = "pictures"  # folder of the state folder, where checks leave them
Reads = Annotated[float | None, Field(ge=-1e5, le=1e5, description="What the tip is to read (mm).")]


class TouchOff(models.Sent):
    """What the tip reads here from now on."""

    X: Reads = None
    Y: Reads = None
    Z: Reads = None
    tool: Annotated[int, Field(ge=1, le=99999, description="Number of the tool in the spindle.")] = 1


@router.get("/machine/buses", dependencies=[needs(Role.VIEW)], responses=LOOKS)
async def buses(request: Request) -> models_of_diagnostics.BusList:
    """How full each bus is by its budget and as heard, error counters, and how late ticks came."""
    return models_of_diagnostics.BusList(**await panel_of(request).door.ask("buses"))


@router.get("/machine/file", dependencies=[needs(Role.VIEW)], responses=documented(401, 403, 404))
async def machine_file(request: Request) -> models_of_diagnostics.MachineFile:
    """The machine file that the service runs on, value by value, with lines."""
    machine = await asyncio.to_thread(ticks.machine_of, panel_of(request).store.folder)
    text = written(machine.text)
    rows = [models_of_diagnostics.FileRow(**one.to_dict()) for one in machine_table.rows(text)]
    return models_of_diagnostics.MachineFile(name=machine.name, rows=rows, text=text)


@router.get("/statistics/runs", dependencies=[needs(Role.VIEW)], responses=documented(401, 403))
async def run_sums(request: Request) -> models_of_diagnostics.RunSums:
    """Runs counted by their result, and the time they took."""
    panel = panel_of(request)
    await asyncio.to_thread(panel.gatherer.gather)
    found = await asyncio.to_thread(panel.store.runs.sums)
    counts = {result: count for result, (count, _, _) in found.items()}
    return models_of_diagnostics.RunSums(
        runs=sum(counts.values()),
        failed=sum(count for result, count in counts.items() if result in FAILED),
        results=counts,
        duration_s=sum(moved_s for _, moved_s, _ in found.values()),
        cut_time_s=sum(cut_s for _, _, cut_s in found.values()),
    )


@router.get(
    "/programs/{name}/picture",
    response_model=models_of_diagnostics.PathPicture,
    dependencies=[needs(Role.VIEW)],
    responses={304: {"description": "As it was."}, **documented(401, 403, 404, 422)},
)
async def path_picture(
    request: Request, name: str, if_none_match: Annotated[str | None, Header()] = None
) -> Response:
    """A checked program's path, to be drawn; with its ETag sent along, only where it is another one."""
    panel = panel_of(request)
    key = await asyncio.to_thread(_picture_key, panel, name)
    tag = {"ETag": f'"{key}"', "Cache-Control": "no-cache"}
    if if_none_match == tag["ETag"]:
        return Response(status_code=304, headers=tag)
    # Made to text beside the loop: hundreds of kilobytes would hold up everybody's figures.
    told = await asyncio.to_thread(_picture, panel, name, key)
    return Response(told, media_type="application/json", headers=tag)


def _picture_key(panel: Panel, name: str) -> str:
    """Of the program's check on the machine as it is fitted. Raises Refusal."""
    program = panel.store.programs.get(name)
    check = panel.checker.of(program) if panel.checker is not None else None
    key = str(check.result.get("stored") or "") if check is not None else ""
    if not key:
        raise Refusal.told(404, "missing", "no_picture", program=name)
    return Path(key).name


def _picture(panel: Panel, name: str, key: str) -> str:
    try:
        found = picture.load(panel.store.folder / PICTURES / f"{key}.npz")
    except (OSError, ValueError, KeyError):
        raise Refusal.told(404, "missing", "picture_gone", program=name) from None
    return models_of_diagnostics.PathPicture(**_listed(found)).model_dump_json()


def _listed(found: picture.Shape) -> dict[str, Any]:
    """To the micrometre: a screen shows no more."""
    listed = {name: value.tolist() for name, value in asdict(found).items() if name != "tolerance_mm"}
    for name in ("tips", "rulings"):
        listed[name] = getattr(found, name).round(3).tolist()
    listed["axes"] = found.axes.round(5).tolist()
    return {**listed, "tolerance_mm": found.tolerance_mm}


@router.post("/offsets/{name}/touch_off", dependencies=[moves()], responses=MOVES)
async def touch(request: Request, name: OffsetName, body: TouchOff) -> models.Done:
    """Set a work offset from where the tool's tip is: here it reads what is given, axis by axis."""
    panel = panel_of(request)
    wanted = body.model_dump(include={"X", "Y", "Z"}, exclude_none=True)
    if not wanted:
        raise Refusal.told(422, "form", "no_reading")
    facts, now = await panel.door.ask("facts"), await panel.door.ask("status")
    offset = dict(facts.get("offsets") or {}).get(name)
    if offset is None or not now.get("on_table"):
        raise Refusal.told(409, "refused", "no_tip")
    if homeless := now.get("not_homed"):
        mode, axes = str(now.get("mode")), ", ".join(homeless)
        raise Refusal.told(409, "refused", "tip_not_homed", mode=mode, request="TOUCH OFF", axes=axes)
    frame, wanted = touch_off.frame(offset), touch_off.under(facts.get("shift"), wanted)
    tip = touch_off.tip_with(dict(now["on_table"]), _length_mm(facts, body.tool))
    values = {
        "origin_mm": list(touch_off.origin_for(frame, tip, wanted)),
        "turned_deg": list(turned_deg(frame)),
    }
    return await ask(request, "set_offset", name=name, values=values)


def _length_mm(facts: dict[str, Any], number: int) -> float:
    """Of a tool in the table. Raises Refusal."""
    tool = rows_by(facts, "tools", "number").get(str(number))
    if tool is None:
        raise Refusal.told(409, "refused", "no_tool", number=number)
    return float(tool["length_mm"]) + float(tool.get("wear_length_mm", 0.0))
