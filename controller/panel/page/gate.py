"""Who may see the page: the same rules as for the routes, before anything of the page answers.

Scripts, styles and fonts are open (they are in every copy of the package); the page itself and
the socket that builds it are for those who may at least look. The log-in page needs nothing.
"""

from __future__ import annotations

from starlette.requests import HTTPConnection
from starlette.responses import RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocketClose

from controller.panel.access import check_local, check_origin, note_refused, panel_of, principal
from controller.panel.answers import Refusal

LOG_IN = "/login"
OPEN = ("/page/", LOG_IN)
CLOSED = 1008  # a socket of somebody who may not
# Everything comes from this server; NiceGUI builds its elements from texts, which needs "eval".
POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval' blob:; "
    "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:; "
    "connect-src 'self' ws: wss:; worker-src 'self' blob:; frame-ancestors 'none'; base-uri 'self'"
)


class Gate:
    """Around NiceGUI's application."""

    def __init__(self, page: ASGIApp, outer: ASGIApp) -> None:
        """``outer``: the panel's application, whose users and rules hold here."""
        self._page, self._outer = page, outer

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._page(scope, receive, send)
            return
        asked = HTTPConnection({**scope, "app": self._outer})
        try:
            await _check(asked)
        except Refusal as refusal:
            if refusal.status == 403:  # 401 is everybody before the log-in
                note_refused(asked, "", f"page {scope['path']}"[:200], refusal)
            await _sent_away(scope, receive, send, refusal)
            return
        await self._page(scope, receive, _guarded(send))


async def _check(asked: HTTPConnection) -> None:
    """Raises Refusal."""
    scope, path = asked.scope, str(asked.scope["path"])
    if scope["type"] == "http" and (path.startswith(OPEN) or _is_asset(path)):
        if not panel_of(asked).users.any:
            check_local(asked)
        return
    if scope["type"] == "websocket" or scope["method"] not in ("GET", "HEAD"):
        check_origin(asked)
    # A post of the page's own socket has no token of the session: its origin was looked at.
    await principal(HTTPConnection({**scope, "method": "GET", "type": "http"}))


def _is_asset(path: str) -> bool:
    """What NiceGUI brings along; its versioned folder has nothing of a machine."""
    return path.startswith("/_nicegui/")


async def _sent_away(scope: Scope, receive: Receive, send: Send, refusal: Refusal) -> None:
    if scope["type"] == "websocket":
        await WebSocketClose(CLOSED)(scope, receive, send)
        return
    answer: Response = refusal.response()
    if refusal.status == 401 and scope["method"] == "GET" and scope["path"] == "/":
        answer = RedirectResponse(LOG_IN, 303)
    await answer(scope, receive, send)


def _guarded(send: Send) -> Send:
    async def headed(message: Message) -> None:
        if message["type"] == "http.response.start":
            message["headers"] = [*message["headers"], (b"content-security-policy", POLICY.encode())]
        await send(message)

    return headed
