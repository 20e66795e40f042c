"""The bring-up of a new machine: its steps, what came of each, and the one that is being done."""

from __future__ import annotations

import asyncio
from pathlib import Path as FilePath
from typing import Annotated, Any

from fastapi import Path, Request, Response
from pydantic import Field

from controller.api import models, ticks
from controller.api.access import moves, panel_of
from controller.api.answers import Refusal, spoken
from controller.api.app_state import Panel
from controller.api.roles import Role
from controller.api.router import SET_UP, VIEW, Router, body
from controller.bringup import protocol as protocols
from controller.bringup import report
from controller.bringup import steps as declared
from controller.bringup.protocol import Protocol
from controller.bringup.steps import Step
from controller.verify import console

router = Router(prefix="/bring-up", tags=["bring-up"])
CARRIED = ("authorization", "cookie", "x-api-key", "x-csrf-token", "x-control-token", "host")
Name = Annotated[str, Path(max_length=40, pattern="^[a-z_]+(\\.[A-Z]+)?$")]


class StepStart(models.Sent):
    """A step may begin, and what it moves may move."""

    part: Annotated[str, Field(max_length=200, description="Of the dry run: a program of the store.")] = ""


class StepAnswer(models.Sent):
    """What the operator says to the question of the step under way."""

    number: Annotated[int, Field(ge=1, le=1_000_000, description="Of the question.")]
    answer: Annotated[float, Field(ge=-1e6, le=1e6)] | bool | None = Field(
        description="What a gauge says; whether it was seen, or is done; null: the step is left."
    )


class StepSkip(models.Sent):
    """A step that is not done on this machine."""

    reason: Annotated[str, Field(min_length=1, max_length=200)]


@router.get("", VIEW, 404, 409)
async def listed(request: Request) -> models.Told:
    """Every step with what moves, what to look at and what came of it; the question of the one under way."""
    panel = panel_of(request)
    protocol, steps = await asyncio.to_thread(_opened, panel)
    facts: dict[str, Any] = {
        "machine": protocol.machine,
        "folder": str(protocol.folder),
        "summary": report.summary(protocol, steps),
        "steps": [_row(panel, protocol, step) for step in steps],
        "under_way": panel.bring_up.step or None,
        "question": panel.bring_up.question,
    }
    return models.Told(**facts)


def _row(panel: Panel, protocol: Protocol, step: Step) -> dict[str, Any]:
    row = report.row(protocol, step, panel.bring_up.not_done.get(step.name))
    texts = {which: step.text(which) for which in ("title", "do", "look")}
    older = step.name in protocol.done and protocol.is_of_another_file(step.name)
    return {**row, **texts, "kind": step.kind, "older": older}


@router.get("/report.html", VIEW, 404, carries=body("text/html", is_text=True))
async def as_page(request: Request) -> Response:
    """The report with its pictures."""
    panel = panel_of(request)

    def page() -> str:
        console.spoken.set(spoken.get())
        return report.page(*_opened(panel))

    return Response(await asyncio.to_thread(page), media_type="text/html")


@router.post("/answer", SET_UP, 409, 422)
async def answer(request: Request, body: StepAnswer) -> models.Done:
    """Answer the question of the step under way, or leave that step."""
    panel_of(request).bring_up.answer(body.number, body.answer)
    return models.Done(request="bring_up")


@router.post("/{step}", moves(role=Role.SET_UP), 404, 409, 422, 503)
async def begin(request: Request, step: Name, body: StepStart) -> models.Done:
    """Begin a step: whatever it moves moves now. Hold and stop end it as they end any run."""
    panel = panel_of(request)
    await asyncio.to_thread(_named, panel, step)
    scheme, (host, port) = "https" if panel.by_tls else "http", request.scope["server"]
    part = panel.store.programs.get(body.part) if body.part else None
    job = {
        "state": str(panel.store.folder),
        "protocol": str(_folder(panel)),
        "step": step,
        "part": None if part is None else (panel.store.programs.sound_path(part.sha256), part.name),
        "url": f"{scheme}://[{host}]:{port}" if ":" in host else f"{scheme}://{host}:{port}",
        "headers": {name: request.headers[name] for name in CARRIED if name in request.headers},
        "language": spoken.get(),
    }
    await panel.bring_up.begin(job)
    return models.Done(request="bring_up")


@router.post("/{step}/skip", SET_UP, 404, 409, 422)
async def skip(request: Request, step: Name, body: StepSkip) -> models.Done:
    """Leave a step out, and say why in the protocol."""
    panel = panel_of(request)
    if panel.bring_up.step:
        raise Refusal.of(409, "busy", "bringup.busy", step=panel.bring_up.step)

    def skipped() -> None:
        _named(panel, step)
        _opened(panel)[0].skip(step, body.reason)

    await asyncio.to_thread(skipped)
    panel.bring_up.not_done.pop(step, None)
    return models.Done(request="bring_up")


def _folder(panel: Panel) -> FilePath:
    """Of the protocol: the panel's own, for in the service's it may not write."""
    return panel.store.own / protocols.FOLDER


def _opened(panel: Panel) -> tuple[Protocol, list[Step]]:
    """Raises Refusal where there is no machine yet, or the protocol is of another one or damaged."""
    machine = ticks.machine_of(panel.store.folder)
    try:
        protocol = protocols.opened(_folder(panel), machine, simulated=False)
    except protocols.NoProtocol as error:
        raise Refusal(409, "bad", error.said) from error
    return protocol, declared.steps(machine)


def _named(panel: Panel, name: str) -> Step:
    """Raises Refusal."""
    _, steps = _opened(panel)
    for step in steps:
        if step.name == name:
            return step
    raise Refusal.of(404, "missing", "bringup.no_step", found=name, known=", ".join(s.name for s in steps))
