"""Names with folders in paths of requests: ``programs/fixtures%2Fpart.ngc/text``.

A server undoes the quoting before it looks for a route, and then nobody knows which slash was part of a
name. So the slashes of names go to the routes as a sign that no name has (``names.NEVER``).
"""

from __future__ import annotations

from typing import Annotated
from urllib.parse import unquote

from pydantic import AfterValidator
from starlette.types import ASGIApp, Receive, Scope, Send

SIGN = "\\"
NAMED = ("/api/v1/programs/", "/api/v1/folders/")

Name = Annotated[str, AfterValidator(lambda name: name.replace(SIGN, "/"))]


class Slashes:
    """Around the application."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http" and scope["path"].startswith(NAMED):
            parts = scope.get("raw_path", b"").decode("latin-1").partition("?")[0].split("/")
            if any("%2f" in part.lower() for part in parts):
                scope = {**scope, "path": "/".join(unquote(part).replace("/", SIGN) for part in parts)}
        await self._app(scope, receive, send)
