"""What was: alarms, runs and the recordings of faults."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path as FilePath
from typing import Annotated, Any, BinaryIO

from fastapi import Path, Query, Request
from fastapi.responses import FileResponse, HTMLResponse
from starlette.types import Receive, Scope, Send

from controller import messages
from controller.api import models, run_report
from controller.api.access import panel_of
from controller.api.answers import Refusal, spoken
from controller.api.app_state import Panel
from controller.api.names import leaf_of
from controller.api.router import OPERATE, VIEW, Responses, Router, body
from controller.api.run_report import AS_CUT
from controller.api.run_verdicts import NothingToJudge, record_name
from controller.messages import Key
from controller.state import record_files
from controller.store.history import Alarm, History, Run

router = Router(tags=["records"])
Most = Annotated[int, Query(ge=1, le=1000, description="At most so many.")]
Before = Annotated[int | None, Query(ge=0, le=2**53, description="Those before this number.")]
Only = Annotated[str, Query(pattern="^(all|open)$", description="'open': not acknowledged yet.")]
Number = Annotated[int, Path(ge=1, le=2**53)]
Speaks = Annotated[str, Query(max_length=20, description="Language of the page; empty: the one asked for.")]
MAX_ALARMS = 1000  # looked through for those of a run
PAGE = (422, 503)
FileName = Annotated[str, Path(pattern=r"^[0-9A-Za-z][0-9A-Za-z._-]{0,100}$")]
BYTES = {"content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}}}
FILE: Responses = {200: BYTES, 206: {**BYTES, "description": "The part that Range asks for."}}


class Opened(FileResponse):
    """A file that is open already: it is sent whole, whatever becomes of its name."""

    def __init__(self, file: BinaryIO, name: str, headers: dict[str, str] | None = None) -> None:
        path = f"/proc/self/fd/{file.fileno()}"
        super().__init__(path, headers=headers, media_type="application/octet-stream", filename=leaf_of(name))
        self._file = file

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        with self._file:
            await super().__call__(scope, receive, send)


def before(rows: Sequence[Any], most: int) -> int | None:
    """Where the next page begins; None where there is none."""
    return rows[-1].id if len(rows) == most else None


@router.get("/alarms", VIEW, *PAGE)
async def alarms(
    request: Request, most: Most = 100, before_id: Before = None, only: Only = "all"
) -> models.AlarmList:
    """Alarms, the latest first."""
    rows = await panel_of(request).past.ask(lambda past: past.alarms(most, before_id, only == "open"))
    return models.AlarmList(alarms=[models.AlarmFacts(**asdict(r)) for r in rows], before=before(rows, most))


@router.post("/alarms/{number}/acknowledge", OPERATE, 404, 409, 422, 503)
async def acknowledge(request: Request, number: Number) -> models.AlarmFacts:
    """Somebody has seen an alarm; who, is kept. It resets nothing."""
    panel = panel_of(request)
    await _alarm(panel, number)
    await panel.door.ask("acknowledge", id=number)
    return await _alarm(panel, number)


async def _alarm(panel: Panel, number: int) -> models.AlarmFacts:
    found = await panel.past.ask(lambda past: past.alarm(number))
    if found is None:
        raise Refusal.of(404, "missing", "missing", what=Key("what.alarm"), name=number)
    return models.AlarmFacts(**asdict(found))


@router.get("/runs", VIEW, *PAGE)
async def runs(request: Request, most: Most = 100, before_id: Before = None) -> models.RunList:
    """Runs, the latest first: duration, cut time, worst following error, result."""
    panel = panel_of(request)

    def listed(past: History) -> list[Run]:
        return [_whole(panel, one) for one in past.runs(most, before_id)]

    rows = await panel.past.ask(listed)
    return models.RunList(runs=[models.RunFacts(**asdict(r)) for r in rows], before=before(rows, most))


@router.get("/runs/{number}", VIEW, 404, 422, 503)
async def run(request: Request, number: Number) -> models.RunFacts:
    """One run, with the names of its files."""
    panel = panel_of(request)
    return await _with_files(panel, await _run(panel, number))


async def _with_files(panel: Panel, found: Run) -> models.RunFacts:
    files = await asyncio.to_thread(files_of, panel.run_records, record_name(found))
    return models.RunFacts(**asdict(found), files=files)


@router.post("/runs/{number}/verdict", OPERATE, 404, 409, 422, 503)
async def judge(request: Request, number: Number) -> models.RunFacts:
    """Have a run judged again as its drives have cut it; what comes of it stands with its facts."""
    panel = panel_of(request)
    found = await _run(panel, number)
    try:
        await asyncio.to_thread(panel.verdicts.ask, found)
    except NothingToJudge:
        raise Refusal.of(409, "refused", "run_has_no_verdict", id=number) from None
    return await _with_files(panel, found)


@router.put("/runs/{number}/kept", OPERATE, 404, 409, 422, 503)
async def keep(request: Request, number: Number, body: models.Switch) -> models.RunFacts:
    """Whether the record of a run stays where the oldest go, for room on the disk."""
    panel = panel_of(request)
    record = await record_of(panel, number)
    await panel.door.ask("keep_run", record=record, on=body.on)
    return await _with_files(panel, await _run(panel, number))


@router.get("/runs/{number}/files/{file}", VIEW, 404, 422, 503, carries=FILE)
async def run_file(request: Request, number: Number, file: FileName) -> Opened:
    """One file of a run's record: run.json, setpoints.npz, and what ``directrix replay`` needs."""
    panel = panel_of(request)
    return await _sent(panel.run_records, record_name(await _run(panel, number)), file)


@router.get(
    "/runs/{number}/report",
    VIEW,
    404,
    422,
    503,
    carries=body("text/html", is_text=True),
)
async def report(request: Request, number: Number, language: Speaks = "") -> HTMLResponse:
    """One run as a page to be printed: how it went, its check, its alarms."""
    panel = panel_of(request)
    found = await _run(panel, number)
    alarms = await panel.past.ask(lambda past: past.alarms(MAX_ALARMS))
    told = await asyncio.to_thread(_reported, panel, found, alarms)
    return HTMLResponse(run_report.page(told, messages.chosen(language, spoken.get())))


def _reported(panel: Panel, run: Run, alarms: Sequence[Alarm]) -> run_report.Facts:
    """The check is of the machine as it is fitted now: the store keeps no other by the run."""
    check = None
    if panel.checker is not None:
        check = panel.store.checks.get(run.sha256, panel.checker.machine())
    during = [one for one in alarms if run.began_s <= one.at_s <= run.ended_s]
    files = files_of(panel.run_records, record_name(run))
    return run_report.Facts(run, check.result if check is not None else {}, during[::-1], files)


async def record_of(panel: Panel, number: int) -> str:
    """Name of the folder of a run's record, which is there. Raises Refusal."""
    name = record_name(await _run(panel, number))
    if name not in {one.name for one in await asyncio.to_thread(inside, panel.run_records)}:
        raise Refusal.of(404, "missing", "record_gone", number=number)
    return name


async def _run(panel: Panel, number: int) -> Run:
    found = await panel.past.ask(lambda past: past.run(number))
    if found is None:
        raise Refusal.of(404, "missing", "missing", what=Key("what.run"), name=number)
    return await asyncio.to_thread(_whole, panel, found)


def _whole(panel: Panel, run: Run) -> Run:
    """With the panel's verdict on it, and whether its record stays. Raises StoreError."""
    record = record_name(run)
    cut = panel.store.verdicts.get(record)
    stays = record and (panel.run_records / record / record_files.KEPT).exists()
    more = {**({AS_CUT: cut} if cut else {}), **({"kept": True} if stays else {})}
    return replace(run, facts={**run.facts, **more})


@router.get("/recordings", VIEW)
async def recordings(request: Request) -> models.RecordingList:
    """What is kept of faults: the last seconds of every tick and of every frame."""
    return models.RecordingList(recordings=await asyncio.to_thread(_listed, panel_of(request).recordings))


@router.get("/recordings/{name}/{file}", VIEW, 404, 422, carries=FILE)
async def recording(request: Request, name: FileName, file: FileName) -> Opened:
    """One file of a recording."""
    return await _sent(panel_of(request).recordings, name, file)


def _listed(folder: FilePath) -> list[models.RecordingFacts]:
    names = sorted((one.name for one in inside(folder) if one.is_dir()), reverse=True)
    return [_recording(folder, name) for name in names]


def _recording(folder: FilePath, name: str) -> models.RecordingFacts:
    files = files_of(folder, name)
    size = sum(_bytes(folder / name / file) for file in files)
    return models.RecordingFacts(name=name, files=files, bytes=size)


def _bytes(file: FilePath) -> int:
    with contextlib.suppress(OSError):  # it has just gone with the oldest
        return file.stat().st_size
    return 0


# ---- files of records


def files_of(folder: FilePath, name: str) -> list[str]:
    """Names of the files of one record."""
    if name not in {one.name for one in inside(folder)}:
        return []
    return sorted(file.name for file in inside(folder / name) if file.is_file() and not file.is_symlink())


async def _sent(folder: FilePath, name: str, file: str) -> Opened:
    found = await asyncio.to_thread(_opened, folder, name, file)
    if found is None:
        raise Refusal.of(404, "missing", "missing", what=Key("what.file"), name=f"{name}/{file}")
    return Opened(found, file)


def _opened(folder: FilePath, name: str, file: str) -> BinaryIO | None:
    """None: there is none of that name, or it has just gone with the oldest."""
    with contextlib.suppress(OSError):
        # Only what is listed: a name from outside is compared, never made into a path.
        return open(folder / name / file, "rb") if file in files_of(folder, name) else None
    return None


def inside(folder: FilePath) -> list[FilePath]:
    """What a folder holds."""
    try:
        return list(folder.iterdir())
    except OSError:  # not made yet, or just taken away with the oldest
        return []
