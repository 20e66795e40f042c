"""Canned cycles: the picture of each, as the description of the language has it."""

from __future__ import annotations

from typing import Annotated

from fastapi import Path, Response

from controller.api import models
from controller.api.answers import Refusal
from controller.api.router import VIEW, Router, body
from controller.machine.machine_file import SHIPPED

router = Router(tags=["canned cycles"])
PICTURES = SHIPPED / "programs" / "cycles"


class Drawn(models.Told):
    cycles: list[str]


@router.get("/cycles", VIEW)
async def cycles() -> Drawn:
    """The codes of which there is a picture."""
    return Drawn(cycles=sorted(file.stem.upper() for file in PICTURES.glob("*.svg")))


@router.get("/cycles/{code}.svg", VIEW, 404, 422, carries=body("image/svg+xml"))
async def picture(code: Annotated[str, Path(max_length=10)]) -> Response:
    """Seen from the side: solid at feed, dashed at rapid, 98 and R the heights of G98 and G99."""
    known = (await cycles()).cycles
    if code not in known:
        raise Refusal.of(404, "missing", "no_drawing", found=code, allowed=", ".join(known))
    drawn = (PICTURES / f"{code.lower()}.svg").read_text(encoding="utf-8")
    return Response(drawn, media_type="image/svg+xml")
