"""Programs of the store: upload, list, text, rename, move, delete, check.

A name with folders is one part of a path: ``/programs/fixtures%2Fpart.ngc/text``.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Annotated
from urllib.parse import quote

from fastapi import Query, Request, Response

from controller.api import listing, models, multipart, quotas
from controller.api.access import owner_of, panel_of, principal
from controller.api.answers import Refusal
from controller.api.app_state import Panel
from controller.api.multipart import Received
from controller.api.programs import Program
from controller.api.router import OPERATE, VIEW, Router
from controller.api.routes.records import FILE, Opened
from controller.api.slashes import Name
from controller.store.history import History

router = Router(tags=["programs"])
Place = Annotated[int, Query(ge=0, le=10**9)]
IN_USE_S = 10.0
IN_LISTS = ("duration_s", "takes_s", "stored", "pictured")  # of what a check found
FORM = {
    "type": "object",
    "required": ["file"],
    "properties": {
        "file": {"type": "string", "format": "binary", "minLength": 1, "description": "The program."},
        "sha256": {
            "type": "string",
            "pattern": "^([0-9A-Fa-f]{64})?$",
            "description": "What came is kept only if it has this checksum; empty: it is not looked at.",
        },
    },
}
BODY = {"requestBody": {"required": True, "content": {"multipart/form-data": {"schema": FORM}}}}


async def take(request: Request) -> Received:
    """The program of an upload, whole or not at all. Raises StoreError and Refusal."""
    panel, loop = panel_of(request), asyncio.get_running_loop()
    who = await principal(request)

    def in_use() -> frozenset[str]:  # asked by the thread that keeps the file, at the last moment
        try:
            return asyncio.run_coroutine_threadsafe(panel.watch.in_use(), loop).result(IN_USE_S)
        except TimeoutError:  # it waits behind a crowd of questions to a service that hangs
            raise Refusal.of(503, "silent", "silent_service") from None

    kind, owner = request.headers.get("content-type", ""), owner_of(request, who)
    with panel.uploading.held(owner):
        received = await multipart.receive(request.stream(), kind, panel.store.uploads, who.name, in_use)
    if panel.checker is not None:
        await asyncio.to_thread(panel.checker.ask, received.program, owner)
    panel.events.tell("programs", {"name": received.program.name, "done": "uploaded"})
    return received


def place_of(request: Request, program: Program) -> str:
    """Address of a program; a header takes no letters beyond Latin-1, so its name is encoded."""
    return str(request.url_for("program", name=quote(program.name, safe="")))


@router.post("/programs", OPERATE, 408, 409, 413, 422, 429, 503, 507, status_code=201, openapi_extra=BODY)
async def upload(request: Request, response: Response) -> models.ProgramFacts:
    """Upload a program under its file's name; it is checked, and never starts by itself."""
    program = (await take(request)).program
    response.headers["Location"] = place_of(request, program)
    return (await _facts(panel_of(request), lambda: [program]))[0]


@router.get("/programs", VIEW, 422)
async def programs(request: Request, brief: bool = False) -> models.ProgramList:
    """All programs, by name; ``brief``: of what their checks found only what a list shows."""
    panel = panel_of(request)
    found = await _facts(panel, panel.store.programs.list)
    return models.ProgramList(programs=[_brief(one) for one in found] if brief else found)


@router.get("/programs/{name}", VIEW, 404, 422)
async def program(request: Request, name: Name) -> models.ProgramFacts:
    """One program, with its check and its last run."""
    panel = panel_of(request)
    return (await _facts(panel, lambda: [panel.store.programs.get(name)]))[0]


@router.get("/programs/{name}/text", VIEW, 404, 422, 503, carries=FILE)
async def text(request: Request, name: Name) -> Opened:
    """The program as it was uploaded, byte by byte."""
    found, file = await asyncio.to_thread(panel_of(request).store.programs.opened, name)
    # Never shown by a browser as a page: programs come from anywhere.
    return Opened(
        file, found.name, headers={"ETag": f'"{found.sha256}"', "X-Content-Type-Options": "nosniff"}
    )


@router.get("/programs/{name}/around", VIEW, 404, 422, 503)
async def around(
    request: Request, name: Name, line: Place, column: Place = 0, file: Annotated[str, Query()] = ""
) -> models.LinesAround:
    """The lines up to a place, with a caret below its column: where a check found a mistake.

    The place is in the program, or in a ``file`` whose subs it calls.
    """
    programs = panel_of(request).store.programs

    def read() -> list[str]:
        return listing.around(programs.text_of(programs.get(name), file), line, column)

    return models.LinesAround(lines=await asyncio.to_thread(read))


@router.post("/drafts", OPERATE, 413, 422, 429, 503)
async def draft(request: Request, body: models.Draft) -> models.DraftRead:
    """Have a text read as a program of that name would be; nothing is kept, nothing is planned."""
    owner = owner_of(request, await principal(request))
    found = await panel_of(request).drafts.read(body.name, body.text, owner)
    return models.DraftRead(refusals=[models.DraftRefusal(**one) for one in found])


@router.patch("/programs/{name}", OPERATE, 404, 409, 422, 503)
async def rename(request: Request, name: Name, body: models.Rename) -> models.ProgramFacts:
    """Give a program another name; refused for the loaded one."""
    panel = panel_of(request)
    used = await panel.watch.in_use()
    renamed = await asyncio.to_thread(panel.store.programs.rename, name, body.name, used)
    panel.events.tell("programs", {"name": name, "done": "renamed", "to": renamed.name})
    return (await _facts(panel, lambda: [renamed]))[0]


@router.patch("/folders/{name}", OPERATE, 404, 409, 422, 503)
async def move(request: Request, name: Name, body: models.Rename) -> models.ProgramList:
    """Give a folder another name, or put it into another one, with all that is in it; what was moved.

    A folder is there as long as a program is in it. Refused where one of them is loaded.
    """
    panel = panel_of(request)
    used = await panel.watch.in_use()
    moved = await asyncio.to_thread(panel.store.programs.move, name, body.name, used)
    panel.events.tell("programs", {"name": name, "done": "moved", "to": body.name})

    def listed() -> list[Program]:
        return [panel.store.programs.get(to) for to in sorted(moved.values())]

    return models.ProgramList(programs=await _facts(panel, listed))


@router.delete("/programs/{name}", OPERATE, 404, 409, 422, 503, status_code=204)
async def delete(request: Request, name: Name) -> None:
    """Delete a program; refused for the loaded one."""
    panel = panel_of(request)
    await asyncio.to_thread(panel.store.programs.delete, name, await panel.watch.in_use())
    panel.events.tell("programs", {"name": name, "done": "deleted"})


@router.get("/programs/{name}/check", VIEW, 404, 422)
async def check(request: Request, name: Name) -> models.CheckFacts:
    """What the check said, or how far it is."""
    panel = panel_of(request)
    return await asyncio.to_thread(lambda: _check(panel, panel.store.programs.get(name)))


@router.post("/programs/{name}/check", OPERATE, 404, 422, 429, status_code=202)
async def ask_check(request: Request, name: Name) -> models.CheckFacts:
    """Have it checked on the machine as it is fitted now, unless it was."""
    panel, owner = panel_of(request), owner_of(request, await principal(request))

    def ask() -> models.CheckFacts:
        found = panel.store.programs.get(name)
        if panel.checker is not None:
            quotas.check(panel.checker.waiting(owner), owner, "checks_many_of_one", quotas.MAX_CHECKS)
            panel.checker.ask(found, owner)
        return _check(panel, found)

    return await asyncio.to_thread(ask)


async def _facts(panel: Panel, wanted: Callable[[], Sequence[Program]]) -> list[models.ProgramFacts]:
    """Of programs that are looked up in a thread; of their runs nothing where the service is gone. Raises
    StoreError.
    """
    ran = await panel.past.ask_if_there(History.by_program)

    def of(program: Program) -> models.ProgramFacts:
        last, made = (ran or {}).get(program.name, (None, None if ran is None else 0))
        facts = {**asdict(program), "last_run": asdict(last) if last else None, "completed": made}
        return models.ProgramFacts(**facts, check=_check(panel, program))

    return await asyncio.to_thread(lambda: [of(program) for program in wanted()])


def _brief(program: models.ProgramFacts) -> models.ProgramFacts:
    if (check := program.check) is None:
        return program
    result = {key: check.result[key] for key in IN_LISTS if key in check.result}
    verdict = check.verdict and check.verdict.model_copy(update={"surfaces": []})
    return program.model_copy(
        update={"check": check.model_copy(update={"result": result, "verdict": verdict})}
    )


def _check(panel: Panel, program: Program) -> models.CheckFacts:
    known = panel.checker.of(program) if panel.checker is not None else None
    if known is None:
        return models.CheckFacts(state="none", over_limit=False)
    result = dict(known.result)
    verdict = result.get("verdict")
    over = any(row.get("over") for row in result.get("joints") or ())
    return models.CheckFacts(
        state=known.state, progress=known.progress, result=result, verdict=verdict, over_limit=over
    )
