"""Who may ask what: every route says which role it needs, and whether the control token.

Without users the panel answers this computer alone, and then everybody on it is "local" with
all rights. As soon as there is one user, everybody logs in (a cookie, with a second token that
other sites' pages do not know) or sends a script's token.

A browser carries requests of any page that is open in it. Hence, without users: the request
must name this computer (a foreign name that resolves to it is an attack), must come from a
page of this server if from any, and not through a proxy, whose far side nobody knows.

A panel that hung answers what was asked before it did: by then whoever pressed may stand at the
machine. So a page says which tick it had seen, and what moves is refused when that is long ago.
"""

from __future__ import annotations

import ipaddress
import secrets
import time
from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING, Annotated, Any
from urllib.parse import urlsplit

from fastapi import Depends, Header
from starlette.requests import HTTPConnection

from controller.panel.answers import Refusal
from controller.panel.roles import Principal, Role

if TYPE_CHECKING:
    from controller.panel.core import Panel

COOKIE = "directrix_session"
SAFE = frozenset({"GET", "HEAD", "OPTIONS"})
PROXY_HEADERS = ("forwarded", "x-forwarded-for", "x-forwarded-host", "x-real-ip", "via")
LOCAL = Principal("local", Role.SET_UP, "local")
SEEN_S = 2.0  # age of the tick that a page has seen; it presses nothing when it is 0.7 s without one
MOST_DIGITS = 16  # of a tick
AGAIN_S = 1.0  # a jog is refreshed ten times a second and audited once

Guard = Callable[..., Awaitable[Principal]]


def panel_of(connection: HTTPConnection) -> Panel:
    """The panel that the application was made for."""
    found: Panel = connection.app.state.panel
    return found


def needs(role: Role) -> Any:
    """A dependency: who asks must have this role."""

    async def allowed(connection: HTTPConnection) -> Principal:
        return await _checked(connection, role)

    return Depends(_marked(allowed, role, False))


def moves(role: Role = Role.OPERATE) -> Any:
    """A dependency: who asks must have this role and hold the control token."""

    async def allowed(
        connection: HTTPConnection,
        x_control_token: Annotated[
            str, Header(description="From POST /api/v1/control; who holds it may move the machine.")
        ] = "",
        x_seen_tick: Annotated[
            str, Header(description="Of the last status that was seen: what comes too late moves nothing.")
        ] = "",
    ) -> Principal:
        who = await _checked(connection, role)
        panel_of(connection).control.check(x_control_token)
        await check_seen(connection, x_seen_tick, SEEN_S)
        return who

    return Depends(_marked(allowed, role, True))


def _marked(guard: Guard, role: Role, control: bool) -> Guard:
    """The guard, with what it asks for where the application (and the tests) can read it."""
    guard.rule = (role, control)  # type: ignore[attr-defined]
    return guard


async def _checked(connection: HTTPConnection, role: Role) -> Principal:
    panel = panel_of(connection)
    who = await principal(connection)
    allowed = who.role >= role
    if not allowed or _method(connection) not in SAFE:
        _audit(panel, connection, who, allowed)
    if not allowed:
        raise Refusal.told(403, "role", "role", name=who.name, has=who.role.label, needs=role.label)
    return who


async def check_seen(connection: HTTPConnection, seen: str, most_s: float) -> None:
    """Raises Refusal where the tick that was seen is long ago, or of another run of the service."""
    if not (seen.isascii() and seen.isdigit() and len(seen) <= MOST_DIGITS):
        return
    tick = (await panel_of(connection).watch.status()).get("tick")
    if tick is None:
        return
    age_s = (tick["number"] - int(seen)) * tick["period_ms"] * 1e-3
    if not 0.0 <= age_s <= most_s:
        raise Refusal.told(409, "late", "late", seen=seen, now=tick["number"], most=f"{most_s:g}")


async def principal(connection: HTTPConnection) -> Principal:
    """Who asks. Raises Refusal 401 or 403."""
    panel = panel_of(connection)
    if not panel.users.any:
        check_local(connection)
        return LOCAL
    if token := _sent_token(connection):
        if who := await panel.users.by_token(token):
            return who
        raise _unknown("This token is not known; make one by POST /api/v1/tokens.")
    if who := panel.users.by_cookie(connection.cookies.get(COOKIE, "")):
        _check_page(connection, who)
        return who
    raise _unknown("Nobody is logged in; POST /api/v1/session with name and password, or send a token.")


def _unknown(sentence: str) -> Refusal:
    return Refusal(401, "log_in", sentence, headers={"WWW-Authenticate": "Bearer"})


def _sent_token(connection: HTTPConnection) -> str:
    """``Authorization: Bearer`` of scripts, or ``X-Api-Key`` of senders that speak OctoPrint's way."""
    kind, _, token = connection.headers.get("authorization", "").partition(" ")
    if kind.lower() == "bearer" and token.strip():
        return token.strip()
    return connection.headers.get("x-api-key", "").strip()


def _check_page(connection: HTTPConnection, who: Principal) -> None:
    """A request that a cookie came with must be of our own page."""
    if _method(connection) == "WEBSOCKET":
        check_origin(connection)
    elif _method(connection) not in SAFE:
        sent = connection.headers.get("x-csrf-token", "")
        if not secrets.compare_digest(sent.encode(), who.csrf.encode()):
            raise Refusal(
                403, "csrf", "X-CSRF-Token is missing or wrong; GET /api/v1/session tells this session's."
            )


def check_local(connection: HTTPConnection) -> None:
    """Raises Refusal unless the request is of this computer, and of our own page if of any."""
    headers = connection.headers
    through = next((name for name in PROXY_HEADERS if name in headers), "")
    peer = connection.client.host if connection.client else ""
    if through or not is_loopback(peer) or not is_loopback(_host(headers.get("host", ""))):
        what = f"came through a proxy ({through})" if through else "is not of this computer"
        raise Refusal(
            403,
            "local",
            f"The request {what}, and without users only this computer is answered; "
            "add a user with: directrix users add NAME.",
        )
    if _method(connection) not in SAFE:
        check_origin(connection)


def check_origin(connection: HTTPConnection) -> None:
    """Raises Refusal for a request that a page of another site sent."""
    headers = connection.headers
    origin = headers.get("origin")
    foreign = origin is not None and urlsplit(origin).netloc.lower() != headers.get("host", "").lower()
    if foreign or headers.get("sec-fetch-site", "none") not in ("none", "same-origin"):
        raise Refusal(
            403, "origin", f"The request comes from a page of {origin or 'another site'}; use this server's."
        )


def is_loopback(host: str) -> bool:
    """Whether a host name or address is this computer's own."""
    if host.lower() == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _host(header: str) -> str:
    try:
        return urlsplit(f"//{header}").hostname or ""
    except ValueError:
        return ""


def _method(connection: HTTPConnection) -> str:
    return str(connection.scope.get("method", "WEBSOCKET"))


def address(connection: HTTPConnection) -> str:
    """Where a request comes from, for the audit log."""
    return connection.client.host if connection.client else ""


def _audit(panel: Panel, connection: HTTPConnection, who: Principal, allowed: bool) -> None:
    action = f"{_method(connection)} {connection.url.path}"[:200]
    key, now_s = (who.name, action, allowed), time.monotonic()
    repeated = connection.url.path.endswith("/jog") and now_s - panel.audited.get(key, -1e9) < AGAIN_S
    if connection.url.path.endswith("/jog"):
        panel.audited[key] = now_s
    if not repeated:
        panel.note(who.name, address(connection), action, allowed=allowed)
