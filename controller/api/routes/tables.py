"""Work offsets and the tool table: kept by the service, changed at rest only."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from fastapi import Path, Request, Response
from pydantic import Field, ValidationError

from controller.api import models
from controller.api.access import panel_of
from controller.api.answers import Refusal, of_form
from controller.api.router import LOOKS, MOVE, MOVES, VIEW, Router, body
from controller.api.routes.machine import ask
from controller.geometry.vectors import Frame
from controller.machine import tool_files
from controller.machine.changes import turned_deg
from controller.machine.tool_files import TableRefused

router = Router(tags=["offsets and tools"])
NUMBERED = r"G54\.(1 P([1-9]|[1-3][0-9]|4[0-8])|2 P[1-8])"
OffsetName = Annotated[str, Path(pattern=rf"^(G5[4-9]|G59\.[1-3]|{NUMBERED})$")]
SetName = Annotated[
    str, Path(pattern=rf"^(G5[4-9]|G59\.[1-3]|{NUMBERED}|G92|G28|G30|T[0-9]{{1,5}}|#[0-9]{{1,4}}|all)$")
]
ToolNumber = Annotated[int, Path(ge=1, le=99999)]


@router.get("/offsets", VIEW, *LOOKS)
async def offsets(request: Request) -> models.OffsetList:
    """Work offsets, G92's shift, reference points and kept parameters as they are in force, and whence."""
    facts = await panel_of(request).door.ask("facts")
    found = rows_by(facts, "offsets", "name")
    turned = {name: {"turned_deg": turned_deg(_frame(one))} for name, one in found.items()}
    others = {name: dict(facts.get(name) or {}) for name in ("shift", "references", "parameters")}
    return models.OffsetList(offsets={name: {**turned[name], **one} for name, one in found.items()}, **others)


@router.put("/offsets/{name}", MOVE, *MOVES)
async def set_offset(request: Request, name: OffsetName, body: models.OffsetValues) -> models.Done:
    """Change a work offset; refused while the machine moves or a program is on."""
    return await ask(request, "set_offset", name=name, values=body.model_dump(exclude_none=True))


Typed = float | Annotated[str, Field(min_length=1, max_length=100)]
Reads = Annotated[
    Typed | None,
    Field(description="mm or degrees, or arithmetic: '5/2', '(3+1)*2'; '+0.1' is so much more than now."),
]


class Touched(models.Sent):
    """What work figures read here from now on."""

    X: Reads = None
    Y: Reads = None
    Z: Reads = None

    @property
    def reads(self) -> dict[str, Any]:
        """By axis. Raises Refusal for none."""
        names = set("XYZABC")
        if found := self.model_dump(include=names, exclude_none=True):
            return found
        raise Refusal.of(422, "form", "no_reading")


class TouchOff(Touched):
    A: Reads = None
    B: Reads = None
    C: Reads = None
    tool: Annotated[
        int | None,
        Field(
            ge=1,
            le=99999,
            description="Null, or that in the spindle: the figures that the status tells. Another one: as "
            "they are under G43 with its length.",
        ),
    ] = None


@router.post("/offsets/{name}/touch_off", MOVE, *MOVES)
async def touch_off(request: Request, name: OffsetName, body: TouchOff) -> models.Done:
    """Set a work offset from where the tool stands: in it the work figures read what is given, axis by axis,
    in the state that is in force."""
    return await ask(request, "set_offset", name=name, reads=body.reads, tool=body.tool)


@router.get("/tools", VIEW, *LOOKS)
async def tools(request: Request) -> models.ToolList:
    """The tool table as it is in force."""
    return models.ToolList(tools=rows_by(await panel_of(request).door.ask("facts"), "tools", "number"))


class ToolFile(models.Sent):
    """A tool table of others."""

    file: Annotated[str, Field(max_length=200, description="Its name, which ends in .tbl or .json.")]
    text: Annotated[str, Field(max_length=2_000_000)]
    flute_mm: Annotated[
        float | None,
        Field(gt=0.0, le=1000.0, description="Length that cuts, where neither file nor table says it."),
    ] = None


@router.get("/tools.tbl", VIEW, *LOOKS, carries=body("text/plain; charset=utf-8"))
async def tools_tbl(request: Request) -> Response:
    """The tool table as LinuxCNC's tool.tbl, wear laid in."""
    return Response(await _written(request, "tools.tbl"), media_type="text/plain")


@router.get("/tools.json", VIEW, *LOOKS, carries=body("application/json"))
async def tools_json(request: Request) -> Response:
    """The tool table as JSON with the property names of ISO 13399, wear laid in."""
    return Response(await _written(request, "tools.json"), media_type="application/json")


async def _written(request: Request, name: str) -> str:
    return tool_files.written((await tools(request)).tools.values(), name)


@router.post("/tools/import", MOVE, *MOVES)
async def import_tools(request: Request, body: ToolFile) -> models.Done:
    """Take the tools of a file into the table: LinuxCNC's tool.tbl, or JSON with ISO 13399's names.

    Those of the same number are replaced, and their wear is none. A file that cannot be read as a whole
    changes nothing; of one whose tool the machine refuses, those before it are in the table.
    """
    there = {int(number): row for number, row in (await tools(request)).tools.items()}
    try:
        rows = tool_files.taken(body.text, body.file, there, body.flute_mm)
    except TableRefused as refused:
        raise Refusal(422, "bad", refused.said) from refused
    wanted = {row["number"]: _tool_values(row) for row in rows}
    for number, values in wanted.items():
        await ask(request, "set_tool", number=number, **values.model_dump(exclude_none=True))
    return models.Done(request="import", result={"tools": list(wanted)})


def _tool_values(row: dict[str, Any]) -> models.ToolValues:
    """Raises Refusal."""
    try:
        return models.ToolValues(**{name: value for name, value in row.items() if name != "number"})
    except ValidationError as error:
        raise of_form({**one, "loc": (f"T{row['number']}", *one["loc"])} for one in error.errors()) from error


@router.put("/tools/{number}", MOVE, *MOVES)
async def set_tool(request: Request, number: ToolNumber, body: models.ToolValues) -> models.Done:
    """Add or change a tool; refused while the machine moves or a program is on, but for the
    insert that is changed after a retract."""
    return await ask(request, "set_tool", number=number, **body.model_dump(exclude_none=True))


@router.post("/tools/{number}/touch_off", MOVE, *MOVES)
async def touch_off_tool(request: Request, number: ToolNumber, body: Touched) -> models.Done:
    """Set a tool's length from where it stands: with it in force the work figure of the one axis that is
    given reads so. Its wear is 0 then."""
    return await ask(request, "set_tool", number=number, reads=body.reads)


@router.get("/tools/{number}/picture", VIEW, 404, 422, 503, carries=body("image/svg+xml"))
async def tool_picture(request: Request, number: ToolNumber) -> Response:
    """A tool's profile, to scale: what cuts, the neck above it, its holder."""
    rows = rows_by(await panel_of(request).door.ask("facts"), "tools", "number")
    if (row := rows.get(str(number))) is None:
        raise Refusal.of(404, "missing", "not_in_table", number=number)
    return Response(tool_files.picture(row), media_type="image/svg+xml")


@router.delete("/tools/{number}", MOVE, *MOVES)
async def remove_tool(request: Request, number: ToolNumber) -> models.Done:
    """Take a tool out of the table; refused as a change is."""
    return await ask(request, "set_tool", number=number, remove=True)


def _frame(offset: Mapping[str, Any]) -> Frame:
    """Of an offset as the service tells it: ``origin_mm`` and, where turned, ``axes``."""
    rows = [offset["origin_mm"], *(offset.get("axes") or ())]
    return Frame(*[(float(x), float(y), float(z)) for x, y, z in rows])


def rows_by(facts: dict[str, Any], what: str, key: str) -> dict[str, Any]:
    """Rows by their key, however the service tells them."""
    found = facts.get(what) or {}
    if isinstance(found, dict):
        return {str(name): value for name, value in found.items()}
    return {str(row.get(key)): row for row in found}
