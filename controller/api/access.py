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

from controller.api.answers import Refusal
from controller.api.quotas import Owner
from controller.api.roles import Principal, Role
from controller.commands.table import REPEATED
from controller.ipc.asker import Asker, asker
from controller.messages import Key

if TYPE_CHECKING:
    from controller.api.app_state import Panel

COOKIE = "directrix_session"
SAFE = frozenset({"GET", "HEAD", "OPTIONS"})
PROXY_HEADERS = ("forwarded", "x-forwarded-for", "x-forwarded-host", "x-real-ip", "via")
LOCAL = Principal("local", Role.SET_UP, "local")
SEEN_S = 2.0  # age of the tick that a page has seen; it presses nothing when it is 0.7 s without one
MAX_DIGITS = 16  # of a tick
AGAIN_S = 1.0  # a jog is refreshed ten times a second and audited once; after such a pause it is another
# Who is sent away may try without end: a line for each address and reason, or the log would
# soon hold nothing else.
STRANGER_S = 60.0
MAX_AUDITED = 1000  # of the latest lines that are compared

Guard = Callable[..., Awaitable[Principal]]


def panel_of(connection: HTTPConnection) -> Panel:
    """The panel that the application was made for."""
    found: Panel = connection.app.state.panel
    return found


def needs(role: Role, again: bool = False) -> Any:
    """A dependency: who asks must have this role; ``again``: and, in a session, given the password again."""

    async def allowed(connection: HTTPConnection) -> Principal:
        return await _checked(connection, role, again)

    return Depends(_marked(allowed, role, False))


def stops() -> Any:
    """A dependency: who asks may operate, or where the panel has it so is anybody who may look."""

    async def allowed(connection: HTTPConnection) -> Principal:
        return await _checked(connection, stopping_role(panel_of(connection)))

    return Depends(_marked(allowed, Role.OPERATE, False))


def stopping_role(panel: Panel) -> Role:
    """The least role from which a stop is taken."""
    return Role.VIEW if panel.anybody_stops else Role.OPERATE


def moves(most_s: float = SEEN_S, role: Role = Role.OPERATE) -> Any:
    """A dependency: who asks has this role and holds the control token; ``most_s``: see ``SEEN_S``."""

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
        await _check_seen(connection, x_seen_tick, most_s)
        return who

    return Depends(_marked(allowed, role, True))


def _marked(guard: Guard, role: Role, control: bool) -> Guard:
    """The guard, with what it asks for where the application (and the tests) can read it."""
    guard.rule = (role, control)  # type: ignore[attr-defined]
    return guard


async def _checked(connection: HTTPConnection, role: Role, again: bool = False) -> Principal:
    panel, name = panel_of(connection), ""
    try:
        who = await _claimed(connection)
        name = "" if who is LOCAL else who.name  # whether it is of this computer is not known yet
        _check_way(connection, who)
    except Refusal as refusal:
        note_refused(connection, name, _action(connection), refusal)
        raise
    asker.set(Asker(who.name, who.role.label, address(connection)))
    allowed = who.role >= role
    if not allowed or _method(connection) not in SAFE:
        _audit(panel, connection, who, allowed)
    if not allowed:
        raise Refusal.of(403, "role", "role", name=who.name, has=who.role.label, needs=role.label)
    if again and who.how == "session" and not panel.users.is_confirmed(cookie_of(connection)):
        raise Refusal.of(403, "confirm", "confirm", name=who.name)
    return who


def cookie_of(connection: HTTPConnection) -> str:
    """Of a session; empty where there is none."""
    return connection.cookies.get(COOKIE, "")


async def _check_seen(connection: HTTPConnection, seen: str, most_s: float) -> None:
    """Raises Refusal where the tick that was seen is long ago, or of another run of the service."""
    if not (seen.isascii() and seen.isdigit() and len(seen) <= MAX_DIGITS):
        return
    tick = (await panel_of(connection).watch.status()).get("tick")
    if tick is None or tick["number"] is None:  # there was none yet
        return
    age_s = (tick["number"] - int(seen)) * tick["period_ms"] * 1e-3
    if age_s < 0.0:
        raise Refusal.of(409, "late", "late.other_run")
    if age_s > most_s:
        raise Refusal.of(409, "late", "late", age=f"{age_s:.1f}", most=f"{most_s:g}")


async def principal(connection: HTTPConnection) -> Principal:
    """Who asks. Raises Refusal 401 or 403."""
    who = await _claimed(connection)
    _check_way(connection, who)
    return who


async def _claimed(connection: HTTPConnection) -> Principal:
    """Whose cookie or token came. Raises Refusal 401."""
    users = panel_of(connection).users
    if not users.any:
        return LOCAL
    if token := _sent_token(connection):
        if who := await users.by_token(token):
            return who
        raise _unknown("unknown_token")
    if who := users.by_cookie(cookie_of(connection)):
        return who
    users.check_lost()
    raise _unknown("not_logged_in")


def _check_way(connection: HTTPConnection, who: Principal) -> None:
    """Raises Refusal 403 where a request came by a way that is not for whom it names."""
    if who.how == "local":
        check_local(connection)
    elif who.how == "session":
        _check_page(connection, who)


def _unknown(key: str) -> Refusal:
    return Refusal.of(401, "log_in", key, headers={"WWW-Authenticate": "Bearer"})


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
            raise Refusal.of(403, "csrf", "no_csrf")


def check_local(connection: HTTPConnection) -> None:
    """Raises Refusal unless the request is of this computer, and of our own page if of any."""
    headers = connection.headers
    through = next((name for name in PROXY_HEADERS if name in headers), "")
    peer = connection.client.host if connection.client else ""
    if through or not is_loopback(peer) or not is_loopback(_host(headers.get("host", ""))):
        raise Refusal.of(403, "local", "by_proxy" if through else "not_local", header=through)
    if _method(connection) not in SAFE:
        check_origin(connection)


def check_origin(connection: HTTPConnection) -> None:
    """Raises Refusal for a request that a page of another site sent."""
    headers = connection.headers
    origin = headers.get("origin")
    foreign = origin is not None and urlsplit(origin).netloc.lower() != headers.get("host", "").lower()
    if foreign or headers.get("sec-fetch-site", "none") not in ("none", "same-origin"):
        raise Refusal.of(403, "origin", "foreign_page", site=origin or Key("another_site"))


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


def owner_of(connection: HTTPConnection, who: Principal) -> Owner:
    """Whom quotas are counted for."""
    return who.name, address(connection)


def _action(connection: HTTPConnection) -> str:
    return f"{_method(connection)} {connection.url.path}"[:200]


def _audit(panel: Panel, connection: HTTPConnection, who: Principal, allowed: bool) -> None:
    action = _action(connection)
    refreshed = connection.url.path.endswith(REPEATED)
    if not refreshed or _is_news(panel, (who.name, action, allowed), AGAIN_S, from_last=True):
        panel.note(who.name, address(connection), action, allowed=allowed)


def note_refused(connection: HTTPConnection, user: str, action: str, refusal: Refusal) -> None:
    """A line of the audit log for one who was not let in; ``user``: as far as it is known."""
    panel, code = panel_of(connection), refusal.facts.code
    if _is_news(panel, (f"{address(connection)} {user}", code, False), STRANGER_S):
        panel.note(user, address(connection), action, code, allowed=False)


def _is_news(panel: Panel, key: tuple[str, str, bool], again_s: float, from_last: bool = False) -> bool:
    """Whether there was no line like it for ``again_s``; ``from_last``: nor one that was kept back."""
    now_s, last_s = time.monotonic(), panel.audited.pop(key, -1e9)
    news = now_s - last_s >= again_s
    while len(panel.audited) >= MAX_AUDITED:
        del panel.audited[next(iter(panel.audited))]
    panel.audited[key] = now_s if news or from_last else last_s
    return news
